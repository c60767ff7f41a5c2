//! What a file says, before anything is cleaned.

use super::{Format, Limits, MeshError};

/// Largest magnitude of a coordinate. The square of an area is a product of four lengths; beyond this it overflows.
pub const MAX_COORDINATE: f64 = 1e75;

/// Triangles as a file gave them: indices are in range and coordinates finite, nothing else is promised.
///
/// `vertices` is V rows of x, y, z in the file's own units and order; `faces` is F rows of indices into it, with
/// polygons already split into triangles.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TriangleSoup {
    /// V × 3 coordinates.
    pub vertices: Vec<[f64; 3]>,
    /// F × 3 vertex indices.
    pub faces: Vec<[u32; 3]>,
    /// Step of the last digit in which the coordinates were written, in their units: vertices that differ by less may
    /// have been one vertex. For 32-bit floats the distance of two neighbouring ones at the largest coordinate. 0 where
    /// the coordinates are exact or where nothing tells (fewer than five digits).
    pub resolution: f64,
}

fn is_usable(point: &[f64; 3]) -> bool {
    point.iter().all(|x| x.abs() <= MAX_COORDINATE)
}

impl TriangleSoup {
    /// Checks what every reader promises: faces there are, within the limits, their indices in range, all coordinates
    /// of their corners finite and at most [`MAX_COORDINATE`] in magnitude. A vertex that no face uses may be anywhere:
    /// where its coordinates are not usable, it is moved to the first corner of the first face.
    ///
    /// Errors: [`MeshError::NoFaces`], [`MeshError::TooLarge`], [`MeshError::IndexOutOfRange`] (the face counted from
    /// 0 after triangulation), [`MeshError::NotFinite`] and, for huge numbers, [`MeshError::Malformed`].
    pub fn checked(mut self, format: Format, limits: &Limits) -> Result<Self, MeshError> {
        let n = self.vertices.len();
        limits.check_vertices(n)?;
        limits.check_faces(self.faces.len())?;
        let Some(&[first, ..]) = self.faces.first() else {
            return Err(MeshError::NoFaces { vertices: n });
        };
        for (face, f) in self.faces.iter().enumerate() {
            if let Some(&k) = f.iter().find(|&&k| k as usize >= n) {
                return Err(MeshError::IndexOutOfRange {
                    face,
                    index: i64::from(k),
                    vertices: n,
                });
            }
        }
        if self.vertices.iter().all(is_usable) {
            return Ok(self);
        }
        let unusable = |k: &u32| !is_usable(&self.vertices[*k as usize]);
        if let Some(vertex) = self.faces.iter().flatten().copied().filter(unusable).min() {
            return Err(unusable_vertex(
                vertex as usize,
                &self.vertices[vertex as usize],
                format,
            ));
        }
        let used = self.vertices[first as usize];
        for point in self.vertices.iter_mut().filter(|p| !is_usable(p)) {
            *point = used;
        }
        Ok(self)
    }

    /// Splits a fan of triangles around its first vertex and appends them. Fewer than three vertices, a point or a
    /// line, append nothing.
    pub(super) fn push_polygon(&mut self, polygon: &[u32], limits: &Limits) -> Result<(), MeshError> {
        let Some((&first, rest)) = polygon.split_first() else {
            return Ok(());
        };
        self.faces
            .extend(rest.windows(2).map(|pair| [first, pair[0], pair[1]]));
        limits.check_faces(self.faces.len())
    }

    /// Appends the triangles of a strip, every second one turned so that all face the same way.
    pub(super) fn push_strip(&mut self, strip: &[u32], limits: &Limits) -> Result<(), MeshError> {
        self.faces.extend(strip.windows(3).enumerate().map(|(k, w)| {
            if k % 2 == 0 {
                [w[0], w[1], w[2]]
            } else {
                [w[1], w[0], w[2]]
            }
        }));
        limits.check_faces(self.faces.len())
    }
}

fn unusable_vertex(vertex: usize, p: &[f64; 3], format: Format) -> MeshError {
    if !p.iter().all(|x| x.is_finite()) {
        return MeshError::NotFinite { vertex };
    }
    MeshError::malformed(
        format,
        format!(
            "vertex {vertex} is at ({:e}, {:e}, {:e}); coordinates must stay below {MAX_COORDINATE:e}",
            p[0], p[1], p[2]
        ),
    )
}
