//! Nodes, skins and meshes of the default scene, and the soup they make in one state.

use super::document::Document;
use super::matrix::{IDENTITY, Matrix, accumulate, compose, product, transform};
use super::primitive::Geometry;
use crate::mesh::{MeshError, TriangleSoup};
use gltf::json::accessor::Type;
use std::collections::BTreeMap;
use std::collections::btree_map::Entry;

/// How one node is placed relative to its parent, and the weights of its mesh's morph targets.
#[derive(Clone, Debug)]
pub(super) struct NodeState {
    pub translation: [f64; 3],
    /// A quaternion, x, y, z, w.
    pub rotation: [f64; 4],
    pub scale: [f64; 3],
    /// Replaces the three above where the node is given by a matrix.
    pub matrix: Option<Box<Matrix>>,
    /// Overrides the mesh's own weights.
    pub weights: Option<Vec<f64>>,
}

impl NodeState {
    fn local(&self) -> Matrix {
        match &self.matrix {
            Some(matrix) => **matrix,
            None => compose(self.translation, self.rotation, self.scale),
        }
    }
}

/// The node hierarchy: a forest, checked.
pub(super) struct Nodes {
    parents: Vec<Option<usize>>,
    /// Every node after its parent.
    order: Vec<usize>,
    rest: Vec<NodeState>,
}

impl Nodes {
    /// Refuses children that do not exist, two parents of one node and circles.
    fn open(document: &Document<'_>) -> Result<Self, MeshError> {
        let nodes = &document.root.nodes;
        let mut parents = vec![None; nodes.len()];
        for (k, node) in nodes.iter().enumerate() {
            for child in node.children.iter().flatten() {
                document.get(nodes, child.value(), "node")?;
                if parents[child.value()].replace(k).is_some() {
                    return Err(document.malformed(format!("node {} has two parents", child.value())));
                }
            }
        }
        let mut order: Vec<usize> = (0..nodes.len()).filter(|&k| parents[k].is_none()).collect();
        let mut next = 0;
        while let Some(&k) = order.get(next) {
            order.extend(nodes[k].children.iter().flatten().map(|c| c.value()));
            next += 1;
        }
        // With one parent each, what cannot be reached from a root hangs on a circle.
        if order.len() < nodes.len() {
            return Err(document.malformed("its nodes form a circle"));
        }
        let rest = nodes
            .iter()
            .map(|node| NodeState {
                translation: node.translation.unwrap_or([0.0; 3]).map(f64::from),
                rotation: node.rotation.unwrap_or_default().0.map(f64::from),
                scale: node.scale.unwrap_or([1.0; 3]).map(f64::from),
                matrix: node.matrix.map(|m| Box::new(m.map(f64::from))),
                weights: node
                    .weights
                    .as_ref()
                    .map(|w| w.iter().map(|&x| f64::from(x)).collect()),
            })
            .collect();
        Ok(Self { parents, order, rest })
    }

    /// The nodes as the file rests.
    pub fn rest(&self) -> Vec<NodeState> {
        self.rest.clone()
    }

    /// Each node's transform into the scene.
    fn globals(&self, state: &[NodeState]) -> Vec<Matrix> {
        let mut globals = vec![IDENTITY; state.len()];
        for &k in &self.order {
            let local = state[k].local();
            globals[k] = match self.parents[k] {
                Some(parent) => product(&globals[parent], &local),
                None => local,
            };
        }
        globals
    }
}

struct Skin {
    joints: Vec<usize>,
    inverse_bind: Vec<Matrix>,
}

impl Skin {
    fn open(document: &Document<'_>, index: usize) -> Result<Self, MeshError> {
        let skin = document.get(&document.root.skins, index, "skin")?;
        let joints: Vec<usize> = skin.joints.iter().map(|j| j.value()).collect();
        for &joint in &joints {
            document.get(&document.root.nodes, joint, "node")?;
        }
        let inverse_bind = match skin.inverse_bind_matrices {
            Some(accessor) => {
                let limit = document.limits.max_vertices;
                let flat = document.numbers(accessor, Type::Mat4, limit, "inverse bind matrices", |x| x)?;
                let matrices = flat.chunks_exact(16);
                matrices.map(|m| std::array::from_fn(|k| m[k])).collect()
            }
            None => vec![IDENTITY; joints.len()],
        };
        if inverse_bind.len() < joints.len() {
            return Err(document.malformed(format!(
                "skin {index} has {} joints and {} inverse bind matrices",
                joints.len(),
                inverse_bind.len()
            )));
        }
        Ok(Self { joints, inverse_bind })
    }

    /// For each joint: from the mesh as it was bound to the scene.
    fn matrices(&self, globals: &[Matrix]) -> Vec<Matrix> {
        let pairs = self.joints.iter().zip(&self.inverse_bind);
        pairs
            .map(|(&joint, inverse)| product(&globals[joint], inverse))
            .collect()
    }
}

/// A mesh at a node.
struct Instance {
    node: usize,
    mesh: usize,
    skin: Option<usize>,
}

/// All that is needed to build the default scene in any state of its nodes.
pub(super) struct Scene<'d, 'a> {
    document: &'d Document<'a>,
    pub nodes: Nodes,
    instances: Vec<Instance>,
    meshes: BTreeMap<usize, Geometry>,
    skins: BTreeMap<usize, Skin>,
}

impl<'d, 'a> Scene<'d, 'a> {
    /// Reads the meshes and skins the default scene shows, counting what they add up to against the limits.
    pub fn open(document: &'d Document<'a>) -> Result<Self, MeshError> {
        let nodes = Nodes::open(document)?;
        let mut scene = Self {
            document,
            nodes,
            instances: Vec::new(),
            meshes: BTreeMap::new(),
            skins: BTreeMap::new(),
        };
        let (mut vertices, mut faces) = (0usize, 0usize);
        for node in scene.shown()? {
            let Some(mesh) = document.root.nodes[node].mesh.map(|m| m.value()) else {
                continue;
            };
            let skin = document.root.nodes[node].skin.map(|s| s.value());
            if let Entry::Vacant(slot) = scene.meshes.entry(mesh) {
                slot.insert(Geometry::open(document, mesh)?);
            }
            if let Some(skin) = skin
                && let Entry::Vacant(slot) = scene.skins.entry(skin)
            {
                slot.insert(Skin::open(document, skin)?);
            }
            let geometry = &scene.meshes[&mesh];
            vertices = vertices.saturating_add(geometry.vertex_count());
            faces = faces.saturating_add(geometry.faces.len());
            document.limits.check_vertices(vertices)?;
            document.limits.check_faces(faces)?;
            scene.instances.push(Instance { node, mesh, skin });
        }
        Ok(scene)
    }

    /// The nodes of the default scene, each once, parents first.
    fn shown(&self) -> Result<Vec<usize>, MeshError> {
        let root = &self.document.root;
        let scene = match root.scene {
            Some(index) => Some(self.document.get(&root.scenes, index.value(), "scene")?),
            None => root.scenes.first(),
        };
        let roots: Vec<usize> = match scene {
            Some(scene) => scene.nodes.iter().map(|n| n.value()).collect(),
            None => (0..root.nodes.len())
                .filter(|&k| self.nodes.parents[k].is_none())
                .collect(),
        };
        let mut seen = vec![false; root.nodes.len()];
        let mut shown = Vec::new();
        let mut stack: Vec<usize> = roots.into_iter().rev().collect();
        while let Some(k) = stack.pop() {
            let node = self.document.get(&root.nodes, k, "node")?;
            if std::mem::replace(&mut seen[k], true) {
                continue;
            }
            shown.push(k);
            let children = node.children.iter().flatten();
            stack.extend(children.map(|c| c.value()).rev());
        }
        Ok(shown)
    }

    /// Vertices of the whole scene.
    pub fn vertex_count(&self) -> usize {
        let counts = self.instances.iter().map(|i| self.meshes[&i.mesh].vertex_count());
        counts.sum()
    }

    /// The scene as one soup, with every node in the given state.
    pub fn build(&self, state: &[NodeState]) -> Result<TriangleSoup, MeshError> {
        let globals = self.nodes.globals(state);
        let mut soup = TriangleSoup::default();
        for instance in &self.instances {
            let geometry = &self.meshes[&instance.mesh];
            let base = soup.vertices.len() as u32;
            let weights = state[instance.node].weights.as_ref().unwrap_or(&geometry.weights);
            let joints = instance.skin.map(|s| self.skins[&s].matrices(&globals));
            for part in &geometry.parts {
                let points = part.morphed(self.document, weights)?;
                let skinned = match &joints {
                    Some(joints) => part.skinned(self.document, &points, joints)?,
                    None => None,
                };
                match skinned {
                    Some(placed) => soup.vertices.extend(placed),
                    None => {
                        let matrix = &globals[instance.node];
                        soup.vertices.extend(points.iter().map(|&p| transform(matrix, p)));
                    }
                }
            }
            soup.faces
                .extend(geometry.faces.iter().map(|f| f.map(|k| base + k)));
        }
        if soup.faces.is_empty() {
            let loose: usize = self.instances.iter().map(|i| self.meshes[&i.mesh].loose).sum();
            return Err(MeshError::NoFaces {
                vertices: soup.vertices.len().saturating_add(loose),
            });
        }
        soup.checked(self.document.format, &self.document.limits)
    }
}

/// A vertex's joint matrix: the mean of its joints', weighted; `None` where no joint has a weight.
pub(super) fn blend(influences: &[(u32, f32)], joints: &[Matrix]) -> Option<Matrix> {
    let mut sum = [0.0; 16];
    let mut total = 0.0;
    for &(joint, weight) in influences {
        if weight > 0.0 {
            accumulate(&mut sum, &joints[joint as usize], f64::from(weight));
            total += f64::from(weight);
        }
    }
    (total > 0.0).then(|| sum.map(|x| x / total))
}
