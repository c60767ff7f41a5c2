//! Species, pose number and seed → a mesh.

use super::body::Body;
use super::pose::{Clearance, draw, place, stride};
use super::remesh::remesh;
use super::skeleton::Skeleton;
use super::surface::polygonise;
use super::topology::{is_sphere, is_sphere_if_closed};
use super::vector::{Motion, Rotation, Vec3, add_scaled};
use rand::seq::SliceRandom;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use shapelex_core::mesh::TriangleSoup;

/// Times a pose is redrawn before it is given up.
const ATTEMPTS: usize = 24;
/// Draws of angles per attempt until no two limbs are too near each other.
const DRAWS: usize = 60;
/// Vertices of the marching surface per vertex asked for: enough for simplification to choose well.
const OVERSAMPLING: f64 = 2.7;
/// Marching tetrahedra make about this many vertices per squared grid spacing of area.
const VERTICES_PER_SQUARE: f64 = 4.5;

/// How fine a creature's mesh is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ZooOptions {
    /// Fewest vertices of a mesh.
    pub min_vertices: usize,
    /// Most vertices of a mesh. Each pose draws its number between the two.
    pub max_vertices: usize,
    /// Leave the creature standing as it was built, y up and facing +z, in its own units: for pictures. Otherwise
    /// every pose is turned, moved and scaled at random.
    pub upright: bool,
}

impl Default for ZooOptions {
    /// 1500 to 3000 vertices.
    fn default() -> Self {
        Self {
            min_vertices: 1500,
            max_vertices: 3000,
            upright: false,
        }
    }
}

/// A creature could not be made.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum SampleError {
    /// The options name no possible number of vertices.
    #[error("vertices must run from at least {least} up to at most {most}, got {min}..={max}")]
    Options {
        /// The fewest vertices the zoo can make a body from.
        least: usize,
        /// The most it is willing to make.
        most: usize,
        /// What was asked for at least.
        min: usize,
        /// What was asked for at most.
        max: usize,
    },
    /// No redrawn pose gave one closed surface of genus 0 with a number of vertices in range.
    #[error("pose {pose} of {species} gave no closed surface in {attempts} attempts")]
    NoSurface {
        /// The species.
        species: String,
        /// The pose's number.
        pose: usize,
        /// How often it was redrawn.
        attempts: usize,
    },
}

impl ZooOptions {
    fn check(&self) -> Result<(), SampleError> {
        let (least, most) = (200, 50_000);
        let (min, max) = (self.min_vertices, self.max_vertices);
        if min < least || max > most || min > max {
            return Err(SampleError::Options {
                least,
                most,
                min,
                max,
            });
        }
        Ok(())
    }
}

/// A kind of creature: what a class of the zoo is.
#[derive(Clone, Debug)]
pub struct Species {
    name: String,
    skeleton: Skeleton,
    clearance: Clearance,
}

impl Species {
    /// Names a skeleton.
    pub(super) fn new(name: impl Into<String>, skeleton: Skeleton) -> Self {
        let clearance = Clearance::at_rest(&skeleton);
        Self {
            name: name.into(),
            skeleton,
            clearance,
        }
    }

    /// Its name, fit for a class name or a folder.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The creature at rest.
    pub fn skeleton(&self) -> &Skeleton {
        &self.skeleton
    }

    /// Makes one pose.
    ///
    /// The mesh is closed, connected, oriented outwards and of genus 0. Its triangulation, vertex order, place,
    /// orientation and size (a factor of 0.5 to 2) are drawn anew for every pose. The same species, seed, pose and
    /// options give the same mesh.
    ///
    /// # Errors
    /// [`SampleError::Options`] for an impossible range of vertices; [`SampleError::NoSurface`] when no redrawn pose
    /// gave a good surface, which happens only with too few vertices for the thinnest limb.
    pub fn pose(&self, seed: u64, pose: usize, options: &ZooOptions) -> Result<TriangleSoup, SampleError> {
        options.check()?;
        let mut rng = stream(seed, &self.name, pose as u64);
        self.mesh(pose, options, &mut rng, |reach, turn, rng| {
            self.body(reach, turn, rng)
        })
    }

    /// Makes a frame of a walk: `time` in 0..1 is the share of the stride that is over. Frames of one seed show one
    /// animal in one place: only its gait moves, and between frames that follow each other hardly.
    ///
    /// # Errors
    /// As [`pose`](Self::pose).
    pub fn walk(&self, seed: u64, time: f64, options: &ZooOptions) -> Result<TriangleSoup, SampleError> {
        options.check()?;
        let mut rng = stream(seed, &self.name, u64::MAX);
        let gait: ChaCha8Rng = rng.clone();
        self.mesh(0, options, &mut rng, |reach, turn, _| {
            let whole = Motion::about([0.0; 3], turn);
            let mut reach = reach;
            loop {
                let angles = stride(&self.skeleton, reach, time, &mut gait.clone());
                let body = Body::new(&self.skeleton, &place(&self.skeleton, &angles, whole));
                if self.clearance.holds(&body) || reach < 1e-3 {
                    return body;
                }
                reach *= 0.9;
            }
        })
    }

    /// The surface of a posed body; the pose is drawn again where it gives none.
    fn mesh(
        &self,
        pose: usize,
        options: &ZooOptions,
        rng: &mut ChaCha8Rng,
        posed: impl Fn(f64, Rotation, &mut ChaCha8Rng) -> Body,
    ) -> Result<TriangleSoup, SampleError> {
        let ZooOptions {
            min_vertices: min,
            max_vertices: max,
            upright,
        } = *options;
        // A little inside the range, since simplification stops at the nearest collapse.
        let slack = (max - min) / 20;
        let vertices = rng.random_range(min + slack..=max - slack);
        for attempt in 0..ATTEMPTS {
            let reach = 0.93f64.powi((attempt as i32 - 4).max(0));
            // The body is turned against the grid, whose axes are fixed.
            let turn = random_rotation(rng);
            let body = posed(reach, turn, rng);
            let offset: Vec3 = rng.random();
            let fine = polygonise(&body, self.spacing(&body, vertices, attempt), offset);
            if !is_sphere_if_closed(fine.vertices.len(), &fine.faces) {
                continue;
            }
            let Some(mesh) = remesh(&body, &fine, vertices) else {
                continue;
            };
            if (min..=max).contains(&mesh.vertices.len()) && is_sphere(mesh.vertices.len(), &mesh.faces) {
                let mut mesh = shuffled(mesh, rng);
                if upright {
                    mesh.vertices = mesh.vertices.iter().map(|&v| turn.apply_transposed(v)).collect();
                } else {
                    disguise(&mut mesh, rng);
                }
                return Ok(mesh);
            }
        }
        Err(SampleError::NoSurface {
            species: self.name.clone(),
            pose,
            attempts: ATTEMPTS,
        })
    }

    /// A posed body, turned as a whole, its limbs apart.
    fn body(&self, mut reach: f64, turn: Rotation, rng: &mut ChaCha8Rng) -> Body {
        let whole = Motion::about([0.0; 3], turn);
        let mut posed = |reach: f64| {
            let angles = draw(&self.skeleton, reach, rng);
            Body::new(&self.skeleton, &place(&self.skeleton, &angles, whole))
        };
        let mut body = posed(reach);
        for draws in 1..DRAWS {
            if self.clearance.holds(&body) {
                break;
            }
            // Half of the draws at full reach, then ever nearer to rest, where the limbs are apart by definition.
            if draws > DRAWS / 2 {
                reach *= 0.9;
            }
            body = posed(reach);
        }
        body
    }

    /// Grid spacing that gives enough vertices to simplify from and does not lose the thinnest part.
    fn spacing(&self, body: &Body, vertices: usize, attempt: usize) -> f64 {
        let wanted = OVERSAMPLING * vertices as f64;
        let by_area = (VERTICES_PER_SQUARE * 0.7 * body.rough_area() / wanted).sqrt();
        by_area.min(1.15 * self.skeleton.thinnest()) * 0.93f64.powi(attempt as i32)
    }
}

/// The same mesh with its vertices and faces in another order.
fn shuffled(mesh: TriangleSoup, rng: &mut ChaCha8Rng) -> TriangleSoup {
    let mut order: Vec<u32> = (0..mesh.vertices.len() as u32).collect();
    order.shuffle(rng);
    let mut vertices = vec![[0.0; 3]; mesh.vertices.len()];
    for (&v, &place) in mesh.vertices.iter().zip(&order) {
        vertices[place as usize] = v;
    }
    let mut faces: Vec<[u32; 3]> = mesh.faces.iter().map(|f| f.map(|v| order[v as usize])).collect();
    faces.shuffle(rng);
    TriangleSoup {
        vertices,
        faces,
        ..TriangleSoup::default()
    }
}

/// Scales by a factor between 0.5 and 2, then moves by up to a unit along each axis.
fn disguise(mesh: &mut TriangleSoup, rng: &mut ChaCha8Rng) {
    let size = 2f64.powf(rng.random_range(-1.0..1.0));
    let shift: Vec3 = std::array::from_fn(|_| rng.random_range(-1.0..1.0));
    for v in &mut mesh.vertices {
        *v = add_scaled(shift, *v, size);
    }
}

/// A rotation drawn uniformly: a normalised quaternion from the ball (Marsaglia 1972 by rejection).
fn random_rotation(rng: &mut impl Rng) -> Rotation {
    loop {
        let q: [f64; 4] = std::array::from_fn(|_| rng.random_range(-1.0..1.0));
        let square: f64 = q.iter().map(|c| c * c).sum();
        if (1e-3..=1.0).contains(&square) {
            return Rotation::from_quaternion(q);
        }
    }
}

/// An independent random stream for every seed, name and number.
pub(super) fn stream(seed: u64, name: &str, number: u64) -> ChaCha8Rng {
    let mut hash = blake3::Hasher::new();
    hash.update(&seed.to_le_bytes());
    hash.update(&number.to_le_bytes());
    hash.update(name.as_bytes());
    ChaCha8Rng::from_seed(*hash.finalize().as_bytes())
}
