//! How a soup becomes a mesh.

use serde::{Deserialize, Serialize};

/// Which connected components are kept.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Components {
    /// The one with the largest area.
    #[default]
    Largest,
    /// All with at least 1 % of the area.
    All,
}

/// How a soup becomes a mesh (docs/method.md#mesh).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct PrepareOptions {
    /// Which connected components are kept.
    pub components: Components,
    /// Close boundary loops with a perimeter below this many times √area; 0 closes none.
    pub fill_holes_below: f64,
    /// Simplify meshes with more vertices than this, or than 8; 0 never does.
    pub working_size: usize,
}

impl Default for PrepareOptions {
    /// Largest component, holes below 1.2 √area closed, 2000 vertices.
    fn default() -> Self {
        Self {
            components: Components::Largest,
            fill_holes_below: 1.2,
            working_size: 2000,
        }
    }
}
