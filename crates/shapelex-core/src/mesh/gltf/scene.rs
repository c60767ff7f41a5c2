//! The meshes and skins of the default scene, and the soup they make in one state.

use super::document::Document;
use super::geometry::Geometry;
use super::matrix::{Matrix, transform};
use super::nodes::{NodeState, Nodes};
use super::part::{Morphed, Part};
use super::schema::SceneNodes;
use super::skin::Skin;
use super::work::BLOCK;
use crate::mesh::{MeshError, TriangleSoup};
use std::collections::BTreeMap;
use std::collections::btree_map::Entry;

/// Bytes of a node's state and of its transform, in memory.
const STATE: u64 = 128 + 128;
/// Bytes of a joint's matrix.
const MATRIX: u64 = 128;
const PLACING: &str = "steps of placing its vertices";

/// A mesh at a node.
struct Instance {
    node: usize,
    mesh: usize,
    skin: Option<usize>,
    /// Its first vertex in the soup.
    base: usize,
}

/// All that is needed to build the default scene in any state of its nodes.
pub(super) struct Scene<'s, 'd> {
    document: &'s Document<'d>,
    pub nodes: Nodes,
    /// In the order of the nodes.
    instances: Vec<Instance>,
    /// The instances by skin and mesh, so that joints and morph targets are worked out once for all that share them.
    grouped: Vec<usize>,
    meshes: BTreeMap<usize, Geometry<'s>>,
    skins: BTreeMap<usize, Skin<'s>>,
    pub vertices: usize,
    pub faces: usize,
}

impl<'s, 'd> Scene<'s, 'd> {
    /// Reads the meshes and skins the default scene shows, counting what they add up to against the limits.
    pub fn open(document: &'s Document<'d>) -> Result<Self, MeshError> {
        let nodes = Nodes::open(document)?;
        let mut scene = Self {
            document,
            nodes,
            instances: Vec::new(),
            grouped: Vec::new(),
            meshes: BTreeMap::new(),
            skins: BTreeMap::new(),
            vertices: 0,
            faces: 0,
        };
        let mut instanced = 0;
        for node in scene.shown()? {
            let Some((mesh, skin)) = scene.nodes.mesh(node) else {
                continue;
            };
            instanced += usize::from(scene.nodes.instanced[node]);
            scene.add(node, mesh, skin)?;
        }
        if scene.instances.is_empty() && document.meshes.len() > 0 {
            return Err(MeshError::EmptyScene {
                meshes: document.meshes.len(),
            });
        }
        if instanced > 0 {
            document.context.warnings.add(format!(
                "The file draws many copies of the meshes of {instanced} of its nodes (EXT_mesh_gpu_instancing); \
                 one copy of each was read."
            ));
        }
        let key = |k: &usize| (scene.instances[*k].skin, scene.instances[*k].mesh, *k);
        let mut grouped: Vec<usize> = (0..scene.instances.len()).collect();
        grouped.sort_by_key(key);
        scene.grouped = grouped;
        Ok(scene)
    }

    fn add(&mut self, node: usize, mesh: usize, skin: Option<usize>) -> Result<(), MeshError> {
        let document = self.document;
        let geometry = match self.meshes.entry(mesh) {
            Entry::Vacant(slot) => slot.insert(Geometry::open(document, mesh)?),
            Entry::Occupied(slot) => slot.into_mut(),
        };
        if let Some(skin) = skin
            && let Entry::Vacant(slot) = self.skins.entry(skin)
        {
            slot.insert(Skin::open(document, skin)?);
        }
        let base = self.vertices;
        self.vertices = self.vertices.saturating_add(geometry.vertex_count());
        self.faces = self.faces.saturating_add(geometry.faces.len());
        document.limits.check_vertices(self.vertices)?;
        document.limits.check_faces(self.faces)?;
        self.instances.push(Instance {
            node,
            mesh,
            skin,
            base,
        });
        Ok(())
    }

    /// The nodes of the default scene, each once, parents first.
    fn shown(&self) -> Result<Vec<usize>, MeshError> {
        let document = self.document;
        let scene: Option<SceneNodes> = match document.scene {
            Some(index) => Some(document.get(&document.scenes, index)?),
            None if document.scenes.len() > 0 => Some(document.get(&document.scenes, 0)?),
            None => None,
        };
        let roots: Vec<usize> = match scene {
            Some(scene) => scene.nodes.iter().flatten().map(|n| n.value()).collect(),
            None => self.nodes.roots(),
        };
        let mut seen = vec![false; self.nodes.len()];
        let mut shown = Vec::new();
        let mut stack: Vec<usize> = roots.into_iter().rev().collect();
        while let Some(k) = stack.pop() {
            document.element(&document.nodes, k)?;
            if std::mem::replace(&mut seen[k], true) {
                continue;
            }
            shown.push(k);
            let children = self.nodes.shown_children(k);
            stack.extend(children.iter().map(|c| *c as usize).rev());
        }
        Ok(shown)
    }

    /// The scene as one soup, with every node in the given state. Its memory stays reserved.
    pub fn build(&self, state: &[NodeState]) -> Result<TriangleSoup, MeshError> {
        self.document
            .context
            .memory
            .grow(24 * self.vertices as u64 + 12 * self.faces as u64)?;
        let vertices = self.place(state)?;
        let mut faces = Vec::with_capacity(self.faces);
        for instance in &self.instances {
            let base = instance.base as u32;
            for block in self.meshes[&instance.mesh].faces.chunks(BLOCK) {
                self.document.work.spend(block.len(), 3, PLACING)?;
                faces.extend(block.iter().map(|f| f.map(|k| base + k)));
            }
        }
        if faces.is_empty() {
            let loose: usize = self.instances.iter().map(|i| self.meshes[&i.mesh].loose).sum();
            return Err(MeshError::NoFaces {
                vertices: vertices.len().saturating_add(loose),
            });
        }
        let soup = TriangleSoup {
            vertices,
            faces,
            resolution: 0.0,
        };
        soup.checked(self.document.format, self.document.limits)
    }

    /// The scene at rest as one soup. A mesh that is shown once gives its faces away instead of copying them.
    pub fn into_soup(mut self) -> Result<TriangleSoup, MeshError> {
        let alone = match self.instances.as_slice() {
            [instance] => Some(instance.mesh),
            _ => None,
        };
        let geometry = alone.and_then(|mesh| self.meshes.get_mut(&mesh));
        let Some(geometry) = geometry.filter(|g| !g.faces.is_empty()) else {
            return self.build(&self.nodes.rest());
        };
        let faces = std::mem::take(&mut geometry.faces);
        self.document
            .context
            .memory
            .grow(24 * self.vertices as u64 + 12 * self.faces as u64)?;
        let vertices = self.place(&self.nodes.rest())?;
        let soup = TriangleSoup {
            vertices,
            faces,
            resolution: 0.0,
        };
        soup.checked(self.document.format, self.document.limits)
    }

    /// All vertices, placed.
    fn place(&self, state: &[NodeState]) -> Result<Vec<[f64; 3]>, MeshError> {
        let _states = self.document.context.memory.hold(STATE * state.len() as u64)?;
        let globals = self.nodes.globals(self.document, state)?;
        let mut vertices = vec![[0.0; 3]; self.vertices];
        for group in self
            .grouped
            .chunk_by(|a, b| self.instances[*a].skin == self.instances[*b].skin)
        {
            self.place_group(group, state, &globals, &mut vertices)?;
        }
        Ok(vertices)
    }

    /// The matrices of the joints that the instances of one skin follow; none where there is no skin.
    fn joints(&self, group: &[usize], globals: &[Matrix]) -> Result<Vec<Matrix>, MeshError> {
        let of_group = || group.iter().map(|k| &self.instances[*k]);
        let Some(skin) = of_group().next().and_then(|i| i.skin).map(|s| &self.skins[&s]) else {
            return Ok(Vec::new());
        };
        let parts = of_group().flat_map(|i| &self.meshes[&i.mesh].parts);
        let tops = parts.filter_map(|p| p.influences.as_ref()).filter_map(|i| i.top);
        let top = tops.max().unwrap_or(0);
        if skin.len() > 0 && usize::from(top) >= skin.len() {
            return Err(self.document.malformed(format!(
                "a vertex follows joint {top} of a skin with {} joints",
                skin.len()
            )));
        }
        skin.matrices(self.document, globals, top)
    }

    /// Places the instances that follow one skin, or none.
    fn place_group(
        &self,
        group: &[usize],
        state: &[NodeState],
        globals: &[Matrix],
        vertices: &mut [[f64; 3]],
    ) -> Result<(), MeshError> {
        let document = self.document;
        let of_group = || group.iter().map(|k| &self.instances[*k]);
        let joints = self.joints(group, globals)?;
        let _joints = document.context.memory.hold(MATRIX * joints.len() as u64)?;
        let mut morphs = Morphs::default();
        for instance in of_group() {
            let geometry = &self.meshes[&instance.mesh];
            let weights = self
                .nodes
                .weights(instance.node, state)
                .unwrap_or(&geometry.weights);
            let morphed = morphs.of(document, instance.mesh, geometry, weights)?;
            let mut base = instance.base;
            for (part, morphed) in geometry.parts.iter().zip(morphed) {
                let points = morphed.as_ref().map_or(&part.positions, |m| &m.points);
                let slots = &mut vertices[base..base + points.len()];
                base += points.len();
                let placed = match (&part.influences, joints.is_empty()) {
                    (Some(influences), false) => influences.place(document, points, &joints, slots)?,
                    _ => false,
                };
                if !placed {
                    // Skinning makes no sense here: the stored positions are placed by the node.
                    let matrix = &globals[instance.node];
                    for (points, slots) in points.chunks(BLOCK).zip(slots.chunks_mut(BLOCK)) {
                        document.work.spend(points.len(), 8, PLACING)?;
                        for (point, slot) in points.iter().zip(slots) {
                            *slot = transform(matrix, *point);
                        }
                    }
                }
            }
        }
        Ok(())
    }
}

/// The morphed points of the mesh that was placed last, for the next instance with the same weights.
#[derive(Default)]
struct Morphs<'s> {
    of: Option<(usize, Vec<f64>)>,
    parts: Vec<Option<Morphed<'s>>>,
}

impl<'s> Morphs<'s> {
    fn of(
        &mut self,
        document: &'s Document<'_>,
        mesh: usize,
        geometry: &Geometry<'_>,
        weights: &[f64],
    ) -> Result<&[Option<Morphed<'s>>], MeshError> {
        let weights = &weights[..weights.len().min(geometry.targets)];
        document
            .work
            .spend(weights.len(), 2, "steps of comparing its morph weights")?;
        let same = self
            .of
            .as_ref()
            .is_some_and(|(of, with)| *of == mesh && with == weights);
        if !same {
            // Those before are freed first.
            self.parts.clear();
            let morphed = |part: &Part<'_>| part.morphed(document, weights);
            self.parts = geometry.parts.iter().map(morphed).collect::<Result<_, _>>()?;
            self.of = Some((mesh, weights.to_vec()));
        }
        Ok(&self.parts)
    }
}
