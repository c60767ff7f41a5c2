//! The vertices and triangles of one glTF mesh, with what morphs and skins them.

use super::document::Document;
use super::matrix::{Matrix, transform};
use super::scene::blend;
use crate::mesh::{MeshError, TriangleSoup};
use gltf::json::Index;
use gltf::json::accessor::{Accessor, Type};
use gltf::json::mesh::{Mode, Primitive, Semantic};
use gltf::json::validation::Checked;
use std::borrow::Cow;

/// All primitives of a mesh.
pub(super) struct Geometry {
    /// Runs of vertices, in order.
    pub parts: Vec<Part>,
    /// Triangles over the vertices of all parts.
    pub faces: Vec<[u32; 3]>,
    /// Default weights of the morph targets.
    pub weights: Vec<f64>,
    /// Vertices of primitives that are points or lines.
    pub loose: usize,
}

/// Vertices that one or more primitives share.
pub(super) struct Part {
    /// The accessors it was read from: equal sources are read once.
    sources: Vec<Option<usize>>,
    positions: Vec<[f64; 3]>,
    /// Displacements of each morph target, read when a weight asks for them.
    targets: Vec<Option<Index<Accessor>>>,
    /// (joint, weight), `influences_per_vertex` for each vertex.
    influences: Vec<(u32, f32)>,
    influences_per_vertex: usize,
}

impl Geometry {
    /// Reads a mesh, its morph targets aside.
    pub fn open(document: &Document<'_>, index: usize) -> Result<Self, MeshError> {
        let mesh = document.get(&document.root.meshes, index, "mesh")?;
        let mut geometry = Self {
            parts: Vec::new(),
            faces: Vec::new(),
            weights: mesh.weights.iter().flatten().map(|&w| f64::from(w)).collect(),
            loose: 0,
        };
        for primitive in &mesh.primitives {
            geometry.add(document, primitive)?;
        }
        Ok(geometry)
    }

    pub fn vertex_count(&self) -> usize {
        self.parts.iter().map(|p| p.positions.len()).sum()
    }

    fn add(&mut self, document: &Document<'_>, primitive: &Primitive) -> Result<(), MeshError> {
        let Some(&positions) = primitive.attributes.get(&Checked::Valid(Semantic::Positions)) else {
            // Nothing to draw (glTF 2.0, 3.7.2.1).
            return Ok(());
        };
        let mode = match primitive.mode {
            Checked::Valid(mode) => mode,
            Checked::Invalid => return Err(document.malformed("a primitive has an unknown mode")),
        };
        if !matches!(mode, Mode::Triangles | Mode::TriangleStrip | Mode::TriangleFan) {
            self.loose = self.loose.saturating_add(document.count(positions)?);
            return Ok(());
        }
        let limits = &document.limits;
        let (base, count) = self.part(document, primitive, positions)?;
        limits.check_vertices(self.vertex_count())?;
        let listed = match primitive.indices {
            Some(accessor) => document.count(accessor)?,
            None => count,
        };
        let drawn = match mode {
            Mode::Triangles => listed / 3,
            _ => listed.saturating_sub(2),
        };
        limits.check_faces(self.faces.len().saturating_add(drawn))?;
        let indices = match primitive.indices {
            Some(accessor) => document.numbers(accessor, Type::Scalar, listed, "indices", |x| x as u32)?,
            None => (0..count as u32).collect(),
        };
        if let Some(at) = indices.iter().position(|&k| k as usize >= count) {
            let face = match mode {
                Mode::Triangles => at / 3,
                _ => at.saturating_sub(2),
            };
            return Err(MeshError::IndexOutOfRange {
                face: self.faces.len() + face,
                index: i64::from(indices[at]),
                vertices: count,
            });
        }
        let mut drawn = TriangleSoup::default();
        match mode {
            Mode::Triangles => drawn
                .faces
                .extend(indices.chunks_exact(3).map(|f| [f[0], f[1], f[2]])),
            Mode::TriangleStrip => drawn.push_strip(&indices, limits)?,
            _ => drawn.push_polygon(&indices, limits)?,
        }
        let base = base as u32;
        self.faces.extend(drawn.faces.iter().map(|f| f.map(|k| base + k)));
        Ok(())
    }

    /// The first vertex and the number of vertices of the part a primitive draws, read if no primitive before had it.
    fn part(
        &mut self,
        document: &Document<'_>,
        primitive: &Primitive,
        positions: Index<Accessor>,
    ) -> Result<(usize, usize), MeshError> {
        let attribute = |semantic| primitive.attributes.get(&Checked::Valid(semantic)).copied();
        let influences: Vec<(Index<Accessor>, Index<Accessor>)> = (0..)
            .map_while(|set| attribute(Semantic::Joints(set)).zip(attribute(Semantic::Weights(set))))
            .collect();
        let targets: Vec<Option<Index<Accessor>>> =
            primitive.targets.iter().flatten().map(|t| t.positions).collect();
        let mut sources = vec![Some(positions.value())];
        sources.extend(targets.iter().map(|t| t.map(|t| t.value())));
        sources.push(None);
        sources.extend(
            influences
                .iter()
                .flat_map(|(j, w)| [Some(j.value()), Some(w.value())]),
        );
        let mut base = 0;
        for part in &self.parts {
            if part.sources == sources {
                return Ok((base, part.positions.len()));
            }
            base += part.positions.len();
        }
        let positions = document.points(positions, "vertices")?;
        let per_vertex = 4 * influences.len();
        let most = document.limits.max_vertices;
        let mut merged = vec![
            (0, 0.0);
            if influences.is_empty() {
                0
            } else {
                positions.len() * per_vertex
            }
        ];
        for (set, &(joints, weights)) in influences.iter().enumerate() {
            let joints = document.numbers(joints, Type::Vec4, most, "joints", |x| x as u32)?;
            let weights = document.numbers(weights, Type::Vec4, most, "joint weights", |x| x as f32)?;
            if joints.len() != 4 * positions.len() || weights.len() != joints.len() {
                return Err(document.malformed("positions, joints and weights differ in number"));
            }
            for (k, pair) in joints.into_iter().zip(weights).enumerate() {
                merged[k / 4 * per_vertex + 4 * set + k % 4] = pair;
            }
        }
        let count = positions.len();
        self.parts.push(Part {
            sources,
            positions,
            targets,
            influences: merged,
            influences_per_vertex: per_vertex,
        });
        Ok((base, count))
    }
}

impl Part {
    /// Positions + Σ weight · displacement over the morph targets with a weight.
    pub fn morphed(
        &self,
        document: &Document<'_>,
        weights: &[f64],
    ) -> Result<Cow<'_, [[f64; 3]]>, MeshError> {
        let mut points = Cow::Borrowed(self.positions.as_slice());
        for (target, &weight) in self.targets.iter().zip(weights) {
            let Some(target) = target.filter(|_| weight != 0.0) else {
                continue;
            };
            let displacements = document.points(target, "vertices of a morph target")?;
            if displacements.len() != points.len() {
                return Err(document.malformed(format!(
                    "a morph target of {} vertices for a mesh of {}",
                    displacements.len(),
                    points.len()
                )));
            }
            for (p, d) in points.to_mut().iter_mut().zip(displacements) {
                *p = std::array::from_fn(|k| p[k] + weight * d[k]);
            }
        }
        Ok(points)
    }

    /// The points moved by their joints, with `joints` from bound mesh to scene; the node's own transform does not
    /// count (glTF 2.0, 3.7.3.3). A vertex without weights follows the first joint.
    ///
    /// `None` where skinning makes no sense: the part has no joints, or what comes out is not finite or a single point
    /// (joints scaled to nothing, as some exporters leave them). Then the stored positions are placed by the node.
    pub fn skinned(
        &self,
        document: &Document<'_>,
        points: &[[f64; 3]],
        joints: &[Matrix],
    ) -> Result<Option<Vec<[f64; 3]>>, MeshError> {
        let Some(first) = joints.first().filter(|_| self.influences_per_vertex > 0) else {
            return Ok(None);
        };
        let used = self.influences.iter().filter(|(_, weight)| *weight > 0.0);
        if let Some((joint, _)) = used.into_iter().find(|(j, _)| *j as usize >= joints.len()) {
            return Err(document.malformed(format!(
                "a vertex follows joint {joint} of a skin with {} joints",
                joints.len()
            )));
        }
        let placed: Vec<[f64; 3]> = points
            .iter()
            .zip(self.influences.chunks_exact(self.influences_per_vertex))
            .map(|(&p, influences)| transform(blend(influences, joints).as_ref().unwrap_or(first), p))
            .collect();
        let finite = placed.iter().flatten().all(|x| x.is_finite());
        let spread = placed.iter().any(|p| *p != placed[0]);
        Ok((finite && spread).then_some(placed))
    }
}
