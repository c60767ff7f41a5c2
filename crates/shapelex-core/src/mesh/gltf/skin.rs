//! Skins: joints, and where the mesh was when it was bound to them.

use super::accessor::Column;
use super::document::Document;
use super::matrix::{Matrix, product};
use super::schema;
use super::work::BLOCK;
use crate::mesh::MeshError;
use gltf::json::accessor::Type;

/// A skin.
pub(super) struct Skin<'s> {
    joints: Vec<u32>,
    /// From the mesh to each joint when they were bound; the identity where there are none.
    inverse_bind: Option<Column<'s>>,
}

impl<'s> Skin<'s> {
    /// Opens a skin; its matrices stay where they are.
    pub fn open(document: &'s Document<'_>, index: usize) -> Result<Self, MeshError> {
        let skin: schema::Skin = document.get(&document.skins, index)?;
        let joints: Vec<u32> = skin.joints.iter().map(|j| j.value() as u32).collect();
        for joint in &joints {
            document.element(&document.nodes, *joint as usize)?;
        }
        let inverse_bind = match skin.inverse_bind_matrices {
            Some(accessor) => {
                let accessor = document.accessor(accessor)?;
                Some(document.column(&accessor, Type::Mat4, "inverse bind matrices")?)
            }
            None => None,
        };
        if let Some(inverse) = inverse_bind.as_ref().filter(|i| i.count < joints.len()) {
            return Err(document.malformed(format!(
                "skin {index} has {} joints and {} inverse bind matrices",
                joints.len(),
                inverse.count
            )));
        }
        Ok(Self { joints, inverse_bind })
    }

    /// How many joints there are.
    pub fn len(&self) -> usize {
        self.joints.len()
    }

    /// For the first joints, up to `top`: from the mesh as it was bound to the scene.
    pub fn matrices(
        &self,
        document: &Document<'_>,
        globals: &[Matrix],
        top: u16,
    ) -> Result<Vec<Matrix>, MeshError> {
        let used = &self.joints[..self.joints.len().min(usize::from(top) + 1)];
        let mut matrices = Vec::with_capacity(used.len());
        for (k, joint) in used.iter().enumerate() {
            if k % BLOCK == 0 {
                let count = BLOCK.min(used.len() - k);
                document.work.spend(count, 120, "steps of placing its joints")?;
            }
            let global = &globals[*joint as usize];
            matrices.push(match &self.inverse_bind {
                Some(inverse) => product(global, &inverse.element(k)),
                None => *global,
            });
        }
        Ok(matrices)
    }
}
