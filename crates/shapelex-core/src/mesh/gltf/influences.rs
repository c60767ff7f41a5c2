//! Which joints each vertex follows, and how much.

use super::accessor::Column;
use super::document::Document;
use super::matrix::{Matrix, accumulate, transform};
use super::used::Used;
use super::work::BLOCK;
use crate::memory::Held;
use crate::mesh::MeshError;

/// Most sets of four joints, `JOINTS_n` and `WEIGHTS_n`, that are read of a primitive.
const MAX_SETS: usize = 8;
/// Most joints with a weight per vertex, on average over the largest mesh.
const MEAN_INFLUENCES: usize = 8;
const STEPS: &str = "steps of reading its joint weights";

/// Joints with a positive weight, vertex by vertex.
pub(super) struct Influences<'s> {
    /// Where each vertex's begin, and the end of the last.
    starts: Vec<u32>,
    joints: Vec<u16>,
    weights: Vec<f32>,
    /// The largest joint among them.
    pub top: Option<u16>,
    _memory: Held<'s>,
}

impl<'s> Influences<'s> {
    /// Reads the joints of the used vertices; `None` where there are no sets.
    pub fn read(
        document: &'s Document<'_>,
        sets: &[(Column<'_>, Column<'_>)],
        used: &Used,
    ) -> Result<Option<Self>, MeshError> {
        if sets.is_empty() {
            return Ok(None);
        }
        if sets.len() > MAX_SETS {
            return Err(MeshError::TooLarge {
                what: "sets of joints in a primitive",
                found: sets.len(),
                limit: MAX_SETS,
            });
        }
        let count = count(document, sets, used)?;
        let vertices = used.len();
        let memory = document
            .context
            .memory
            .hold(4 * (vertices as u64 + 1) + 6 * count as u64)?;
        let mut influences = Self {
            starts: Vec::with_capacity(vertices + 1),
            joints: Vec::with_capacity(count),
            weights: Vec::with_capacity(count),
            top: None,
            _memory: memory,
        };
        influences.starts.push(0);
        for (at, k) in used.iter().enumerate() {
            if at % BLOCK == 0 {
                document
                    .work
                    .spend(BLOCK.min(used.len() - at) * sets.len(), 30, STEPS)?;
            }
            for (joints, weights) in sets {
                for i in 0..4 {
                    let weight = weights.number(k, i) as f32;
                    if weight > 0.0 {
                        influences.push(document, joints.number(k, i), weight)?;
                    }
                }
            }
            influences.starts.push(influences.joints.len() as u32);
        }
        Ok(Some(influences))
    }

    fn push(&mut self, document: &Document<'_>, joint: f64, weight: f32) -> Result<(), MeshError> {
        // The format stores joints in 16 bits at most.
        if !(0.0..=65535.0).contains(&joint) {
            return Err(document.malformed(format!("a vertex follows joint {joint}")));
        }
        let joint = joint as u16;
        self.joints.push(joint);
        self.weights.push(weight);
        self.top = self.top.max(Some(joint));
        Ok(())
    }

    /// Writes the points moved by their joints, with `joints` from bound mesh to scene. A vertex without weights
    /// follows the first joint.
    ///
    /// `false` where that makes no surface: what comes out is not finite or a single point (joints scaled to nothing,
    /// as some exporters leave them).
    pub fn place(
        &self,
        document: &Document<'_>,
        points: &[[f64; 3]],
        joints: &[Matrix],
        placed: &mut [[f64; 3]],
    ) -> Result<bool, MeshError> {
        let Some(first) = joints.first() else {
            return Ok(false);
        };
        for (block, (points, slots)) in points.chunks(BLOCK).zip(placed.chunks_mut(BLOCK)).enumerate() {
            let at = block * BLOCK;
            let influences = (self.starts[at + points.len()] - self.starts[at]) as usize;
            document.work.spend(
                influences + 2 * points.len(),
                12,
                "steps of moving its vertices by joints",
            )?;
            for (k, (point, slot)) in points.iter().zip(slots).enumerate() {
                let blended = self.blend(at + k, joints);
                *slot = transform(blended.as_ref().unwrap_or(first), *point);
            }
        }
        let finite = placed.iter().flatten().all(|x| x.is_finite());
        let spread = placed.iter().any(|p| *p != placed[0]);
        Ok(finite && spread)
    }

    /// A vertex's joint matrix: the mean of its joints', weighted; `None` where no joint has a weight.
    fn blend(&self, vertex: usize, joints: &[Matrix]) -> Option<Matrix> {
        let range = self.starts[vertex] as usize..self.starts[vertex + 1] as usize;
        let mut sum = [0.0; 16];
        let mut total = 0.0;
        for (joint, weight) in self.joints[range.clone()].iter().zip(&self.weights[range]) {
            accumulate(&mut sum, &joints[usize::from(*joint)], f64::from(*weight));
            total += f64::from(*weight);
        }
        (total > 0.0).then(|| sum.map(|x| x / total))
    }
}

/// How many joints with a weight the used vertices have, within the limit of all that the document shows.
fn count(
    document: &Document<'_>,
    sets: &[(Column<'_>, Column<'_>)],
    used: &Used,
) -> Result<usize, MeshError> {
    let mut count = 0;
    for (at, k) in used.iter().enumerate() {
        if at % BLOCK == 0 {
            document
                .work
                .spend(BLOCK.min(used.len() - at) * sets.len(), 20, STEPS)?;
        }
        for (_, weights) in sets {
            count += (0..4).filter(|i| weights.number(k, *i) as f32 > 0.0).count();
        }
    }
    let limit = document.limits.max_vertices.saturating_mul(MEAN_INFLUENCES);
    let found = document.influences.get().saturating_add(count);
    document.influences.set(found);
    if found > limit {
        return Err(MeshError::TooLarge {
            what: "joints with a weight, of all vertices together",
            found,
            limit,
        });
    }
    Ok(count)
}
