//! Vertices that primitives share: read once, morphed and placed as often as a mesh is shown.

use super::accessor::Column;
use super::document::Document;
use super::draco::Decoded;
use super::influences::Influences;
use super::schema::{Attributes, Index, Primitive};
use super::used::Used;
use super::work::BLOCK;
use crate::memory::Held;
use crate::mesh::MeshError;
use gltf::json::accessor::Type;

const JOINTS: &str = "joints";
const WEIGHTS: &str = "joint weights";
/// Bytes of a point in memory.
const POINT: u64 = 24;

/// What vertices are read from: primitives with equal sources share their vertices.
#[derive(PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Sources {
    position: Index,
    targets: Vec<Option<Index>>,
    sets: Vec<(Index, Index)>,
    /// The view of a Draco stream.
    pub stream: Option<Index>,
}

impl Sources {
    /// The sources of a primitive that has positions.
    pub fn of(primitive: &Primitive, position: Index, stream: Option<Index>) -> Self {
        let targets = primitive.targets.iter().flatten();
        Self {
            position,
            targets: targets.map(|t| t.position).collect(),
            sets: sets(&primitive.attributes),
            stream,
        }
    }
}

/// The pairs `JOINTS_n`, `WEIGHTS_n` from 0 up to the first that is not there.
fn sets(attributes: &Attributes) -> Vec<(Index, Index)> {
    let named = |list: &[(u32, Index)], n: u32| list.iter().find(|(k, _)| *k == n).map(|(_, index)| *index);
    (0..)
        .map_while(|n| named(&attributes.joints, n).zip(named(&attributes.weights, n)))
        .collect()
}

/// Vertices whose accessors are open, before it is known which of them are used.
pub(super) struct Draft<'s> {
    pub positions: Column<'s>,
    sets: Vec<(Column<'s>, Column<'s>)>,
    targets: Vec<Option<Index>>,
}

impl<'s> Draft<'s> {
    /// Opens the accessors.
    pub fn open(document: &'s Document<'_>, sources: &Sources) -> Result<Self, MeshError> {
        let column = |index, kind, what| document.column(&document.accessor(index)?, kind, what);
        Ok(Self {
            positions: column(sources.position, Type::Vec3, "vertices")?,
            sets: sources
                .sets
                .iter()
                .map(|(j, w)| Ok((column(*j, Type::Vec4, JOINTS)?, column(*w, Type::Vec4, WEIGHTS)?)))
                .collect::<Result<_, MeshError>>()?,
            targets: sources.targets.clone(),
        })
    }

    /// Takes what the stream has out of it, and opens the accessors of the rest.
    pub fn decoded(
        document: &'s Document<'_>,
        sources: &Sources,
        stream: &Decoded<'_>,
        ids: &Attributes,
    ) -> Result<Self, MeshError> {
        let column = |index, id: Option<Index>, kind: Type, what| {
            let accessor = document.accessor(index)?;
            let Some(id) = id else {
                return document.column(&accessor, kind, what);
            };
            let component = document.component(&accessor, kind, what)?;
            let components = kind.multiplicity();
            let kept = document.keep(4 * components * stream.vertices(), "bytes in Draco streams")?;
            let numbers = stream.attribute(document, id, components, what)?;
            let accessor = (component, accessor.normalized.unwrap_or(false));
            Ok(Column::decoded(numbers, Some(kept), components, accessor))
        };
        let in_stream = sets(ids);
        Ok(Self {
            positions: column(sources.position, ids.position, Type::Vec3, "vertices")?,
            sets: sources
                .sets
                .iter()
                .enumerate()
                .map(|(n, (joints, weights))| {
                    let ids = in_stream.get(n);
                    Ok((
                        column(*joints, ids.map(|i| i.0), Type::Vec4, JOINTS)?,
                        column(*weights, ids.map(|i| i.1), Type::Vec4, WEIGHTS)?,
                    ))
                })
                .collect::<Result<_, MeshError>>()?,
            targets: sources.targets.clone(),
        })
    }

    /// Reads the used vertices.
    pub fn read(self, document: &'s Document<'_>, used: Used) -> Result<Part<'s>, MeshError> {
        let declared = self.positions.count;
        let sets_fit = self
            .sets
            .iter()
            .all(|(j, w)| j.count == declared && w.count == declared);
        if !sets_fit {
            return Err(document.malformed("positions, joints and weights differ in number"));
        }
        let memory = document.context.memory.hold(POINT * used.len() as u64)?;
        let mut positions = Vec::with_capacity(used.len());
        for (at, k) in used.iter().enumerate() {
            if at % BLOCK == 0 {
                let count = BLOCK.min(used.len() - at);
                document.work.spend(count, 10, "steps of reading its vertices")?;
            }
            positions.push(self.positions.element(k));
        }
        Ok(Part {
            positions,
            influences: Influences::read(document, &self.sets, &used)?,
            targets: self.targets,
            declared,
            used,
            _memory: memory,
        })
    }
}

/// Vertices that one or more primitives share.
pub(super) struct Part<'s> {
    pub positions: Vec<[f64; 3]>,
    pub influences: Option<Influences<'s>>,
    /// Displacements of each morph target, read when a weight asks for them.
    pub targets: Vec<Option<Index>>,
    /// Vertices of the accessors, and which of them are here.
    declared: usize,
    used: Used,
    _memory: Held<'s>,
}

/// Points that morph targets have moved.
pub(super) struct Morphed<'s> {
    pub points: Vec<[f64; 3]>,
    _memory: Held<'s>,
}

impl Part<'_> {
    /// Positions + Σ weight · displacement over the morph targets with a weight; `None` where there are none.
    pub fn morphed<'m>(
        &self,
        document: &'m Document<'_>,
        weights: &[f64],
    ) -> Result<Option<Morphed<'m>>, MeshError> {
        document
            .work
            .spend(self.targets.len(), 2, "steps of comparing its morph weights")?;
        let mut active = self
            .targets
            .iter()
            .zip(weights)
            .filter_map(|(target, weight)| target.filter(|_| *weight != 0.0).zip(Some(*weight)))
            .peekable();
        if active.peek().is_none() {
            return Ok(None);
        }
        let memory = document
            .context
            .memory
            .hold(POINT * self.positions.len() as u64)?;
        let mut points = self.positions.clone();
        for (target, weight) in active {
            let accessor = document.accessor(target)?;
            let displacements = document.column(&accessor, Type::Vec3, "vertices of a morph target")?;
            if displacements.count != self.declared {
                return Err(document.malformed(format!(
                    "a morph target of {} vertices for a mesh of {}",
                    displacements.count, self.declared
                )));
            }
            for (at, (k, point)) in self.used.iter().zip(&mut points).enumerate() {
                if at % BLOCK == 0 {
                    document.work.spend(
                        BLOCK.min(self.used.len() - at),
                        12,
                        "steps of applying its morph targets to its vertices",
                    )?;
                }
                for (i, x) in point.iter_mut().enumerate() {
                    *x += weight * displacements.number(k, i);
                }
            }
        }
        Ok(Some(Morphed {
            points,
            _memory: memory,
        }))
    }
}
