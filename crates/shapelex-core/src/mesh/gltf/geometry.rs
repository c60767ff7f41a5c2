//! The triangles of one glTF mesh over the vertices its primitives share.

use super::document::Document;
use super::draco::{Declared, Decoded};
use super::part::{Draft, Part, Sources};
use super::schema::{self, Index, Primitive};
use super::used::Used;
use super::work::BLOCK;
use crate::memory::Held;
use crate::mesh::{MeshError, TriangleSoup};
use gltf::json::accessor::Type;
use gltf::json::mesh::Mode;
use gltf::json::validation::Checked;
use std::collections::BTreeMap;
use std::ops::Range;

/// Bytes of a face in memory.
const FACE: u64 = 12;

/// All primitives of a mesh.
pub(super) struct Geometry<'s> {
    /// Runs of vertices, in order.
    pub parts: Vec<Part<'s>>,
    /// Triangles over the vertices of all parts.
    pub faces: Vec<[u32; 3]>,
    /// Default weights of the morph targets.
    pub weights: Vec<f64>,
    /// Morph targets of the part that has most of them.
    pub targets: usize,
    /// Vertices of primitives that are points or lines.
    pub loose: usize,
    _memory: Vec<Held<'s>>,
}

/// A primitive that draws triangles.
struct Plan {
    mode: Mode,
    /// The run of vertices it draws.
    draft: usize,
    indices: Option<Index>,
    /// Its corners.
    listed: usize,
    /// Its triangles, where they came out of a Draco stream.
    decoded: Option<Vec<[u32; 3]>>,
}

impl Plan {
    /// How many triangles it draws.
    fn drawn(&self) -> usize {
        match (&self.decoded, self.mode) {
            (Some(faces), _) => faces.len(),
            (None, Mode::Triangles) => self.listed / 3,
            (None, _) => self.listed.saturating_sub(2),
        }
    }
}

/// Runs of vertices that are not read yet.
#[derive(Default)]
struct Drafts<'s> {
    list: Vec<Draft<'s>>,
    by_sources: BTreeMap<Sources, usize>,
}

impl<'s> Drafts<'s> {
    fn add(
        &mut self,
        sources: Sources,
        open: impl FnOnce(&Sources) -> Result<Draft<'s>, MeshError>,
    ) -> Result<usize, MeshError> {
        if let Some(known) = self.by_sources.get(&sources) {
            return Ok(*known);
        }
        let added = self.list.len();
        self.list.push(open(&sources)?);
        self.by_sources.insert(sources, added);
        Ok(added)
    }
}

/// What a primitive draws whose triangles are in a Draco stream.
fn plan_stream<'s>(
    document: &'s Document<'_>,
    draco: &schema::Draco,
    declared: &Declared,
    sources: Sources,
    drafts: &mut Drafts<'s>,
) -> Result<Plan, MeshError> {
    let stream = Decoded::open(document, draco, declared)?;
    let open = |sources: &Sources| Draft::decoded(document, sources, &stream, &draco.attributes);
    let draft = drafts.add(sources, open)?;
    let faces = stream.faces();
    Ok(Plan {
        mode: Mode::Triangles,
        draft,
        indices: None,
        listed: 3 * faces.len(),
        decoded: Some(faces),
    })
}

impl<'s> Geometry<'s> {
    /// Reads a mesh, its morph targets aside.
    pub fn open(document: &'s Document<'_>, index: usize) -> Result<Self, MeshError> {
        let mesh: schema::Mesh = document.get(&document.meshes, index)?;
        let mut geometry = Self {
            parts: Vec::new(),
            faces: Vec::new(),
            weights: mesh.weights.unwrap_or_default(),
            targets: 0,
            loose: 0,
            _memory: Vec::new(),
        };
        let (mut drafts, mut plans) = (Drafts::default(), Vec::new());
        let mut drawn = 0usize;
        for primitive in &mesh.primitives {
            if let Some(plan) = geometry.plan(document, primitive, &mut drafts)? {
                drawn = drawn.saturating_add(plan.drawn());
                document.limits.check_faces(drawn)?;
                plans.push(plan);
            }
        }
        geometry
            ._memory
            .push(document.context.memory.hold(FACE * drawn as u64)?);
        geometry.faces.reserve_exact(drawn);
        let ranges: Vec<(usize, Range<usize>)> = plans
            .into_iter()
            .map(|plan| {
                let (draft, start) = (plan.draft, geometry.faces.len());
                geometry.draw(document, plan, drafts.list[draft].positions.count)?;
                Ok((draft, start..geometry.faces.len()))
            })
            .collect::<Result<_, MeshError>>()?;
        geometry.read_parts(document, drafts.list, &ranges)?;
        Ok(geometry)
    }

    pub fn vertex_count(&self) -> usize {
        self.parts.iter().map(|p| p.positions.len()).sum()
    }

    /// What a primitive draws; nothing where it has no positions (glTF 2.0, 3.7.2.1) or is points or lines.
    fn plan(
        &mut self,
        document: &'s Document<'_>,
        primitive: &Primitive,
        drafts: &mut Drafts<'s>,
    ) -> Result<Option<Plan>, MeshError> {
        let Some(position) = primitive.attributes.position else {
            return Ok(None);
        };
        let mode = match primitive.mode {
            Some(Checked::Valid(mode)) => mode,
            None => Mode::Triangles,
            Some(Checked::Invalid) => return Err(document.malformed("a primitive has an unknown mode")),
        };
        let vertices = document.accessor(position)?;
        if !matches!(mode, Mode::Triangles | Mode::TriangleStrip | Mode::TriangleFan) {
            self.loose = self.loose.saturating_add(document.count(&vertices));
            return Ok(None);
        }
        let indices = primitive
            .indices
            .map(|index| document.accessor(index))
            .transpose()?;
        let listed = indices.as_ref().map(|indices| document.count(indices));
        let draco = primitive.extensions.as_ref().and_then(|e| e.draco.as_ref());
        // Where the same data is stored without compression too, that is what is read.
        let stored = vertices.buffer_view.is_some() && indices.is_none_or(|i| i.buffer_view.is_some());
        if let Some(draco) = draco.filter(|_| !stored) {
            let declared = Declared {
                faces: listed.unwrap_or_default() / 3,
                vertices: document.count(&vertices),
            };
            let sources = Sources::of(primitive, position, Some(draco.buffer_view));
            return plan_stream(document, draco, &declared, sources, drafts).map(Some);
        }
        let sources = Sources::of(primitive, position, None);
        let draft = drafts.add(sources, |sources| Draft::open(document, sources))?;
        let count = drafts.list[draft].positions.count;
        if primitive.indices.is_none() {
            document.limits.check_vertices(count)?;
        }
        Ok(Some(Plan {
            mode,
            draft,
            indices: primitive.indices,
            listed: listed.unwrap_or(count),
            decoded: None,
        }))
    }

    /// Appends a primitive's triangles, with the indices of its own accessors.
    fn draw(&mut self, document: &Document<'_>, plan: Plan, count: usize) -> Result<(), MeshError> {
        if let Some(faces) = plan.decoded {
            if let Some(at) = faces.iter().position(|f| f.iter().any(|k| *k as usize >= count)) {
                return Err(document.malformed(format!(
                    "Draco compression: face {at} refers to vertices {:?} of {count}",
                    faces[at]
                )));
            }
            self.faces.extend(faces);
            return Ok(());
        }
        let listed = plan.listed;
        let _corners = document.context.memory.hold(4 * listed as u64)?;
        let mut corners: Vec<u32> = Vec::with_capacity(listed);
        match plan.indices {
            Some(index) => {
                let column = document.column(&document.accessor(index)?, Type::Scalar, "indices")?;
                for k in 0..listed {
                    if k % BLOCK == 0 {
                        document
                            .work
                            .spend(BLOCK.min(listed - k), 10, "steps of reading its faces")?;
                    }
                    corners.push(column.index(k));
                }
            }
            None => corners.extend(0..count as u32),
        }
        if let Some(at) = corners.iter().position(|k| *k as usize >= count) {
            let face = match plan.mode {
                Mode::Triangles => at / 3,
                _ => at.saturating_sub(2),
            };
            return Err(MeshError::IndexOutOfRange {
                face: self.faces.len() + face,
                index: i64::from(corners[at]),
                vertices: count,
            });
        }
        let mut drawn = TriangleSoup {
            vertices: Vec::new(),
            faces: std::mem::take(&mut self.faces),
            resolution: 0.0,
        };
        match plan.mode {
            Mode::Triangles => drawn.faces.extend(corners.as_chunks::<3>().0),
            Mode::TriangleStrip => drawn.push_strip(&corners, document.limits)?,
            _ => drawn.push_polygon(&corners, document.limits)?,
        }
        self.faces = drawn.faces;
        Ok(())
    }

    /// Reads the vertices that faces use and lets the faces count those.
    fn read_parts(
        &mut self,
        document: &'s Document<'_>,
        drafts: Vec<Draft<'s>>,
        ranges: &[(usize, Range<usize>)],
    ) -> Result<(), MeshError> {
        let mut of_draft: Vec<Vec<&Range<usize>>> = vec![Vec::new(); drafts.len()];
        for (draft, range) in ranges {
            of_draft[*draft].push(range);
        }
        let mut base = 0u32;
        for (draft, ranges) in drafts.into_iter().zip(of_draft) {
            let declared = draft.positions.count;
            let count = 3 * ranges.iter().map(|r| r.len()).sum::<usize>();
            let memory = document.context.memory.hold(Used::bytes(count, declared))?;
            let indices = ranges
                .iter()
                .flat_map(|r| self.faces[(*r).clone()].as_flattened());
            let used = Used::of(indices, count, declared);
            document
                .limits
                .check_vertices((base as usize).saturating_add(used.len()))?;
            for range in ranges {
                for block in self.faces[range.clone()].chunks_mut(BLOCK) {
                    document
                        .work
                        .spend(block.len(), 36, "steps of reading its faces")?;
                    for face in block {
                        *face = face.map(|k| base + used.place(k));
                    }
                }
            }
            base += used.len() as u32;
            let part = draft.read(document, used)?;
            self.targets = self.targets.max(part.targets.len());
            self.parts.push(part);
            self._memory.push(memory);
        }
        Ok(())
    }
}
