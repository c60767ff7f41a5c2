//! The node hierarchy, and where its nodes stand.

use super::document::Document;
use super::matrix::{IDENTITY, Matrix, compose, product};
use super::schema::Node;
use super::work::BLOCK;
use crate::mesh::MeshError;

/// How one node is placed relative to its parent, and the weights of its mesh's morph targets.
#[derive(Clone, Debug)]
pub(super) struct NodeState {
    pub translation: [f64; 3],
    /// A quaternion, x, y, z, w.
    pub rotation: [f64; 4],
    pub scale: [f64; 3],
    /// A clip has moved it: then the three above hold, also where the file gives a matrix.
    pub moved: bool,
    /// Weights a clip has set.
    pub weights: Option<Vec<f64>>,
}

/// The node hierarchy: a forest, checked.
pub(super) struct Nodes {
    parents: Vec<Option<u32>>,
    children: Vec<Vec<u32>>,
    /// Every node after its parent.
    order: Vec<u32>,
    rest: Vec<NodeState>,
    /// Transforms of nodes that are given by a matrix.
    matrices: Vec<Option<Box<Matrix>>>,
    /// Weights that override the mesh's own.
    weights: Vec<Option<Vec<f64>>>,
    /// The mesh a node shows, and the skin it follows.
    shows: Vec<(Option<u32>, Option<u32>)>,
    hidden: Vec<bool>,
    /// Nodes that draw many copies of their mesh.
    pub instanced: Vec<bool>,
}

impl Nodes {
    /// Refuses children that do not exist, two parents of one node and circles.
    pub fn open(document: &Document<'_>) -> Result<Self, MeshError> {
        let count = document.nodes.len();
        let mut nodes = Self {
            parents: vec![None; count],
            children: Vec::with_capacity(count),
            order: Vec::with_capacity(count),
            rest: Vec::with_capacity(count),
            matrices: Vec::with_capacity(count),
            weights: Vec::with_capacity(count),
            shows: Vec::with_capacity(count),
            hidden: Vec::with_capacity(count),
            instanced: Vec::with_capacity(count),
        };
        for k in 0..count {
            let node: Node<'_> = document.get(&document.nodes, k)?;
            nodes.add(document, k, node)?;
        }
        nodes.order = (0..count as u32)
            .filter(|k| nodes.parents[*k as usize].is_none())
            .collect();
        let mut next = 0;
        while let Some(&k) = nodes.order.get(next) {
            nodes.order.extend(&nodes.children[k as usize]);
            next += 1;
        }
        // With one parent each, what cannot be reached from a root hangs on a circle.
        if nodes.order.len() < count {
            return Err(document.malformed("its nodes form a circle"));
        }
        Ok(nodes)
    }

    fn add(&mut self, document: &Document<'_>, k: usize, node: Node<'_>) -> Result<(), MeshError> {
        let children: Vec<u32> = node.children.iter().flatten().map(|c| c.value() as u32).collect();
        for child in &children {
            document.element(&document.nodes, *child as usize)?;
            if self.parents[*child as usize].replace(k as u32).is_some() {
                return Err(document.malformed(format!("node {child} has two parents")));
            }
        }
        self.children.push(children);
        self.rest.push(NodeState {
            translation: node.translation.unwrap_or([0.0; 3]),
            rotation: node.rotation.unwrap_or([0.0, 0.0, 0.0, 1.0]),
            scale: node.scale.unwrap_or([1.0; 3]),
            moved: false,
            weights: None,
        });
        self.matrices.push(node.matrix.map(Box::new));
        self.weights.push(node.weights);
        let index = |i: Option<super::schema::Index>| i.map(|i| i.value() as u32);
        self.shows.push((index(node.mesh), index(node.skin)));
        let extensions = node.extensions.unwrap_or_default();
        self.hidden
            .push(extensions.visibility.is_some_and(|v| !v.visible));
        self.instanced.push(extensions.gpu_instancing.is_some());
        Ok(())
    }

    /// The nodes as the file rests.
    pub fn rest(&self) -> Vec<NodeState> {
        self.rest.clone()
    }

    /// How many there are.
    pub fn len(&self) -> usize {
        self.rest.len()
    }

    /// Nodes without a parent.
    pub fn roots(&self) -> Vec<usize> {
        (0..self.len()).filter(|k| self.parents[*k].is_none()).collect()
    }

    /// A node's children; none where it hides them, and itself.
    pub fn shown_children(&self, k: usize) -> &[u32] {
        if self.hidden[k] { &[] } else { &self.children[k] }
    }

    /// The mesh a node shows, and its skin.
    pub fn mesh(&self, k: usize) -> Option<(usize, Option<usize>)> {
        let (mesh, skin) = self.shows[k];
        let mesh = mesh.filter(|_| !self.hidden[k])?;
        Some((mesh as usize, skin.map(|s| s as usize)))
    }

    /// The weights of the morph targets of the mesh at a node, where they differ from the mesh's own.
    pub fn weights<'n>(&'n self, k: usize, state: &'n [NodeState]) -> Option<&'n Vec<f64>> {
        state[k].weights.as_ref().or(self.weights[k].as_ref())
    }

    /// Each node's transform into the scene.
    pub fn globals(&self, document: &Document<'_>, state: &[NodeState]) -> Result<Vec<Matrix>, MeshError> {
        let mut globals = vec![IDENTITY; state.len()];
        for order in self.order.chunks(BLOCK) {
            document
                .work
                .spend(order.len(), 100, "steps of placing its nodes")?;
            for &k in order {
                let k = k as usize;
                let local = match &self.matrices[k] {
                    Some(matrix) if !state[k].moved => **matrix,
                    _ => compose(state[k].translation, state[k].rotation, state[k].scale),
                };
                globals[k] = match self.parents[k] {
                    Some(parent) => product(&globals[parent as usize], &local),
                    None => local,
                };
            }
        }
        Ok(globals)
    }
}
