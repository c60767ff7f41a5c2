//! The zoo: procedural articulated creatures, any number of classes and poses, with no licence attached.
//!
//! A [`Species`] is a tree of bones with ranges for its joints and implicit solids that hang on the bones
//! ([`skeleton`]). A pose draws joint angles ([`pose`]), the solids move along and are united smoothly into one
//! implicit body ([`body`]), the body is cut by a randomly turned grid into triangles ([`surface`]) and these are
//! simplified and evened out ([`remesh`]). So two poses of a species bend without stretching much and share no
//! triangulation, which is what retrieval has to see through.
//!
//! Everything follows from seeds. Nothing is read or written; [`write_obj`] and [`write_glb`] return bytes.

pub mod body;
pub mod generate;
pub mod pose;
mod random;
pub mod remesh;
pub mod skeleton;
mod species;
pub mod surface;
mod template;
pub mod topology;
pub mod vector;
pub mod write;

pub use generate::{SampleError, Species, ZooOptions};
pub use write::{write_glb, write_obj};

use shapelex_core::mesh::TriangleSoup;

/// One pose of one class.
#[derive(Clone, Debug, PartialEq)]
pub struct Creature {
    /// The species' name.
    pub class: String,
    /// The pose's number, from 0.
    pub pose: usize,
    /// Its mesh.
    pub mesh: TriangleSoup,
}

/// The first `classes` species of the zoo: the named ones, then random ones drawn from the seed.
pub fn species(seed: u64, classes: usize) -> Vec<Species> {
    let mut all = Species::named();
    let named = all.len();
    all.truncate(classes);
    all.extend((named..classes).map(|i| Species::random(seed, (i - named) as u64)));
    all
}

/// All poses of all species, class by class, one mesh at a time.
pub fn creatures<'a>(
    species: &'a [Species],
    poses: usize,
    seed: u64,
    options: &'a ZooOptions,
) -> impl Iterator<Item = Result<Creature, SampleError>> + 'a {
    species.iter().flat_map(move |s| {
        (0..poses).map(move |pose| {
            Ok(Creature {
                class: s.name().to_owned(),
                pose,
                mesh: s.pose(seed, pose, options)?,
            })
        })
    })
}
