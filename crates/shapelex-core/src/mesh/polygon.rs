//! Polygons → triangles.
//!
//! A polygon of n corners becomes n − 2 triangles that keep its border, so that a closed surface stays closed: corners
//! on a straight border or at the same place are kept. A polygon whose fan around its first corner lies within it, as
//! of every strictly convex one, becomes that fan. Every other is seen along its normal (Newell's) and cut by ear
//! clipping ([`ears`]) or, where it has many corners, along a sweep ([`sweep`]). One that crosses itself has no right
//! triangulation and gets what ear clipping makes of it.
//!
//! The work is bounded by n log n and a constant: where a file exhausts [`EFFORT`], its remaining crossing polygons
//! stay fans.

mod ears;
mod sweep;

use super::reserved::ReservedVec;
use super::{MeshError, ReadContext};
use crate::memory::{MemoryError, Reservation};
use ears::Effort;

/// Polygons with more corners are cut along a sweep.
const EAR_CLIPPING_UP_TO: usize = 32;

/// Steps of ear clipping in one file, of some nanoseconds each.
const EFFORT: u64 = 300_000_000;

/// Polygons between two looks at the stop flag.
const STRIDE: usize = 1024;

/// A triangle is thin where twice its area is below this share of its longest edge's square.
const THIN: f64 = 1e-9;

/// How many polygons of how many corners a file has, in its order.
#[derive(Debug)]
pub(super) struct PolygonRuns<'a>(ReservedVec<'a, Run>);

#[derive(Clone, Copy, Debug)]
struct Run {
    corners: u32,
    polygons: u32,
}

impl<'a> PolygonRuns<'a> {
    /// No polygons.
    pub fn new(memory: &'a Reservation) -> Self {
        Self(ReservedVec::new(memory))
    }

    /// Takes note of further polygons; those of fewer than three corners have no triangles and are passed over.
    ///
    /// Errors: [`MemoryError`].
    #[inline]
    pub fn push(&mut self, corners: usize, polygons: usize) -> Result<(), MemoryError> {
        let (corners, polygons) = (corners as u32, polygons as u32);
        match self.0.last_mut() {
            _ if corners < 3 || polygons == 0 => Ok(()),
            Some(last) if last.corners == corners => {
                last.polygons += polygons;
                Ok(())
            }
            _ => self.0.push(Run { corners, polygons }),
        }
    }

    /// Replaces the fan of each polygon in `faces` by its triangulation.
    ///
    /// Errors: [`MeshError::Memory`], [`MeshError::Cancelled`].
    pub fn triangulate(
        &self,
        faces: &mut [[u32; 3]],
        triangulator: &mut Triangulator<'_>,
    ) -> Result<(), MeshError> {
        let mut rest = faces;
        for run in self.0.iter() {
            let triangles = run.corners as usize - 2;
            let (these, after) = rest.split_at_mut(triangles * run.polygons as usize);
            if run.corners > 3 {
                for (k, fan) in these.chunks_exact_mut(triangles).enumerate() {
                    if k.is_multiple_of(STRIDE) {
                        triangulator.context.cancel.check()?;
                    }
                    triangulator.triangulate(fan)?;
                }
            }
            rest = after;
        }
        Ok(())
    }
}

/// Splits polygons over one list of vertices.
pub(super) struct Triangulator<'a> {
    vertices: &'a [[f64; 3]],
    context: &'a ReadContext,
    effort: Effort<'a>,
}

impl<'a> Triangulator<'a> {
    /// A triangulator that has done nothing yet.
    pub fn new(vertices: &'a [[f64; 3]], context: &'a ReadContext) -> Self {
        Self {
            vertices,
            context,
            effort: Effort::new(EFFORT, &context.cancel),
        }
    }

    /// Replaces a fan of at least two triangles by the triangulation of its polygon.
    ///
    /// Errors: [`MeshError::Memory`], [`MeshError::Cancelled`].
    pub fn triangulate(&mut self, fan: &mut [[u32; 3]]) -> Result<(), MeshError> {
        if let [first, second] = fan {
            self.split_quad(first, second);
            return Ok(());
        }
        let normal = self.normal(fan);
        let has_area = dot(normal, normal) > 0.0;
        if !has_area || self.is_inside(fan, normal) {
            return Ok(());
        }
        let n = fan.len() + 2;
        // The corners and their places in the plane.
        let bytes = n as u64 * (size_of::<u32>() + size_of::<[f64; 2]>()) as u64;
        let _held = self.context.memory.hold(bytes)?;
        let corners: Vec<u32> = fan[0][..2]
            .iter()
            .copied()
            .chain(fan.iter().map(|t| t[2]))
            .collect();
        let points = self.project(&corners, normal);
        if n > EAR_CLIPPING_UP_TO {
            let _held = self.context.memory.hold(sweep::bytes(n))?;
            if let Some(triangles) = sweep::triangulate(&points, &self.context.cancel)? {
                replace(fan, &corners, triangles.iter());
                return Ok(());
            }
        }
        if self.effort.is_spent() {
            return Ok(());
        }
        let _held = self.context.memory.hold(ears::bytes(n))?;
        let triangles = ears::triangulate(&points, &mut self.effort)?;
        replace(fan, &corners, triangles.iter());
        Ok(())
    }

    /// Splits a quadrilateral by its other diagonal where the first one lies outside it, or leaves a thin triangle that
    /// the other does not leave.
    fn split_quad(&self, first: &mut [u32; 3], second: &mut [u32; 3]) {
        let [a, b, c] = *first;
        let d = second[2];
        let [pa, pb, pc, pd] = [a, b, c, d].map(|k| self.vertices[k as usize]);
        let normal = cross(sub(pc, pa), sub(pd, pb));
        let share = |p, q, r| dot(cross(sub(q, p), sub(r, p)), normal);
        let whole = dot(normal, normal);
        let fan = share(pa, pb, pc).min(share(pa, pc, pd));
        let is_good = fan > 1e-6 * whole;
        if !is_good && whole > 0.0 && share(pb, pc, pd).min(share(pb, pd, pa)) > fan {
            *first = [b, c, d];
            *second = [b, d, a];
        }
    }

    /// Twice the area vector of a fan's border.
    fn normal(&self, fan: &[[u32; 3]]) -> [f64; 3] {
        let doubled = |t: &[u32; 3]| {
            let [a, b, c] = t.map(|k| self.vertices[k as usize]);
            cross(sub(b, a), sub(c, a))
        };
        fan.iter()
            .map(doubled)
            .fold([0.0; 3], |s, x| [s[0] + x[0], s[1] + x[1], s[2] + x[2]])
    }

    /// Whether all triangles of a fan face the way of the normal, and none is thin.
    fn is_inside(&self, fan: &[[u32; 3]], normal: [f64; 3]) -> bool {
        let length = dot(normal, normal).sqrt();
        fan.iter().all(|t| {
            let [a, b, c] = t.map(|k| self.vertices[k as usize]);
            let edges = [sub(b, a), sub(c, a), sub(c, b)];
            let longest = edges.map(|e| dot(e, e)).into_iter().fold(0.0, f64::max);
            dot(cross(edges[0], edges[1]), normal) > THIN * longest * length
        })
    }

    /// Corners as seen against the normal, with the first one at the origin and the farthest at a distance of about 1.
    fn project(&self, corners: &[u32], normal: [f64; 3]) -> Vec<[f64; 2]> {
        let length = dot(normal, normal).sqrt();
        let n = normal.map(|x| x / length);
        let steepest = (0..3).fold(0, |k, l| if n[l].abs() > n[k].abs() { l } else { k });
        let mut axis = [0.0; 3];
        axis[(steepest + 1) % 3] = 1.0;
        let along = dot(axis, n);
        let u: [f64; 3] = std::array::from_fn(|k| axis[k] - along * n[k]);
        let u = u.map(|x| x / dot(u, u).sqrt());
        let v = cross(n, u);
        let at = |k: &u32| sub(self.vertices[*k as usize], self.vertices[corners[0] as usize]);
        let extent = corners.iter().flat_map(at).fold(0.0, |e: f64, x| e.max(x.abs()));
        corners
            .iter()
            .map(|k| {
                let p = at(k).map(|x| x / extent);
                [dot(p, u), dot(p, v)]
            })
            .collect()
    }
}

fn replace<'t>(fan: &mut [[u32; 3]], corners: &[u32], triangles: impl Iterator<Item = &'t [u32; 3]>) {
    for (face, triangle) in fan.iter_mut().zip(triangles) {
        *face = triangle.map(|k| corners[k as usize]);
    }
}

fn sub(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}

#[cfg(test)]
mod tests;
