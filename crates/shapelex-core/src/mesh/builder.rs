//! Collects what a reader finds and turns it into a checked soup.

use super::polygon::{PolygonRuns, Triangulator};
use super::precision::{Decimal, Precision, Written};
use super::reserved::ReservedVec;
use super::{Format, MeshError, ReadContext, TriangleSoup};

/// Elements between two looks at the stop flag.
const STRIDE: usize = 4096;

/// A soup under construction: checks the limits, reserves the memory and looks at the stop flag as it grows.
pub(super) struct SoupBuilder<'a> {
    context: &'a ReadContext,
    format: Format,
    vertices: ReservedVec<'a, [f64; 3]>,
    /// Polygons as fans, split properly at the end, when all vertices are known.
    faces: ReservedVec<'a, [u32; 3]>,
    polygons: PolygonRuns<'a>,
    precision: Precision,
    written: Written,
}

impl<'a> SoupBuilder<'a> {
    /// An empty soup of a format whose coordinates are written in some form.
    pub fn new(format: Format, written: Written, context: &'a ReadContext) -> Self {
        Self {
            context,
            format,
            vertices: ReservedVec::new(&context.memory),
            faces: ReservedVec::new(&context.memory),
            polygons: PolygonRuns::new(&context.memory),
            precision: Precision::default(),
            written,
        }
    }

    /// Vertices so far.
    pub fn vertices(&self) -> &[[f64; 3]] {
        &self.vertices
    }

    /// Triangles so far.
    pub fn face_count(&self) -> usize {
        self.faces.len()
    }

    /// Makes room for vertices a header promises.
    ///
    /// Errors: [`MeshError::TooLarge`], [`MeshError::Memory`].
    pub fn expect_vertices(&mut self, count: usize) -> Result<(), MeshError> {
        self.context
            .limits
            .check_vertices(self.vertices.len().saturating_add(count))?;
        Ok(self.vertices.reserve_exact(count)?)
    }

    /// Makes room for faces a header promises.
    ///
    /// Errors: [`MeshError::TooLarge`], [`MeshError::Memory`].
    pub fn expect_faces(&mut self, count: usize) -> Result<(), MeshError> {
        self.context
            .limits
            .check_faces(self.faces.len().saturating_add(count))?;
        Ok(self.faces.reserve_exact(count)?)
    }

    /// Appends a vertex.
    ///
    /// Errors: [`MeshError::TooLarge`], [`MeshError::Memory`], [`MeshError::Cancelled`].
    #[inline]
    pub fn push_vertex(&mut self, point: [Decimal; 3]) -> Result<(), MeshError> {
        for x in point {
            self.precision.note(x);
        }
        let next = self.vertices.len() + 1;
        self.context.limits.check_vertices(next)?;
        if next.is_multiple_of(STRIDE) {
            self.context.cancel.check()?;
        }
        Ok(self.vertices.push(point.map(|x| x.value))?)
    }

    /// Appends a polygon of n corners as n − 2 triangles; fewer than three corners, a point or a line, append nothing.
    ///
    /// Errors: as [`push_vertex`](Self::push_vertex).
    #[inline]
    pub fn push_polygon(&mut self, polygon: &[u32]) -> Result<(), MeshError> {
        let Some((&first, rest)) = polygon.split_first() else {
            return Ok(());
        };
        let triangles = rest.len().saturating_sub(1);
        self.room_for(triangles)?;
        let fan = rest.windows(2).map(|pair| [first, pair[0], pair[1]]);
        self.faces.extend(triangles, fan)?;
        Ok(self.polygons.push(polygon.len(), 1)?)
    }

    /// Appends the triangles of a strip, every second one turned so that all face the same way.
    ///
    /// Errors: as [`push_vertex`](Self::push_vertex).
    pub fn push_strip(&mut self, strip: &[u32]) -> Result<(), MeshError> {
        let triangles = strip.len().saturating_sub(2);
        self.room_for(triangles)?;
        let turned = strip.windows(3).enumerate().map(|(k, w)| match k % 2 {
            0 => [w[0], w[1], w[2]],
            _ => [w[1], w[0], w[2]],
        });
        self.faces.extend(triangles, turned)?;
        Ok(self.polygons.push(3, triangles)?)
    }

    fn room_for(&self, triangles: usize) -> Result<(), MeshError> {
        let before = self.faces.len();
        self.context.limits.check_faces(before + triangles)?;
        if before / STRIDE != (before + triangles) / STRIDE {
            self.context.cancel.check()?;
        }
        Ok(())
    }

    /// The soup, checked and with its polygons triangulated.
    ///
    /// Errors: those of [`TriangleSoup::checked`], [`MeshError::Memory`], [`MeshError::Cancelled`].
    pub fn finish(self) -> Result<TriangleSoup, MeshError> {
        self.context.cancel.check()?;
        let soup = TriangleSoup {
            resolution: self.precision.resolution(self.written),
            vertices: self.vertices.into_inner(),
            faces: self.faces.into_inner(),
        };
        let mut soup = soup.checked(self.format, &self.context.limits)?;
        let mut triangulator = Triangulator::new(&soup.vertices, self.context);
        self.polygons.triangulate(&mut soup.faces, &mut triangulator)?;
        Ok(soup)
    }
}
