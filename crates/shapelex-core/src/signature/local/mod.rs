//! Signatures of the surface near a point, which do not change where something else of the shape is missing.

mod cells;
mod histogram;
mod points;
#[cfg(test)]
mod tests;

use super::Signatures;
use crate::cancel::{Cancel, Cancelled};
use crate::mesh::TriMesh;
use cells::Point;
use faer::Mat;
use histogram::{BINS, Histogram};
use points::OrientedPoints;
use serde::{Deserialize, Serialize};

/// Points on a surface at most, however small the radius.
const MOST_POINTS: usize = 60_000;

/// How oriented-point histograms are computed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct LocalParameters {
    /// Radii of the neighbourhoods, in the mesh's units, each with a histogram of its own.
    pub radii: Vec<f64>,
    /// Signatures, at points spread evenly over the surface.
    pub keypoints: usize,
    /// Oriented points in a flat neighbourhood of each radius.
    pub points: usize,
    /// Radius over which normals are averaged, as a share of the smallest radius; 0 leaves them as they are.
    pub smoothing: f64,
    /// Seed of the points.
    pub seed: u64,
}

impl Default for LocalParameters {
    fn default() -> Self {
        Self {
            radii: vec![0.06, 0.12],
            keypoints: 1000,
            points: 90,
            smoothing: 0.0,
            seed: 1,
        }
    }
}

impl LocalParameters {
    /// Length of a signature.
    pub fn dimension(&self) -> usize {
        self.radii.len() * BINS
    }

    fn smallest_radius(&self) -> f64 {
        self.radii.iter().copied().fold(f64::INFINITY, f64::min)
    }

    /// Points for each unit of area, so that a flat neighbourhood of a radius has as many as asked for.
    fn density(&self, radius: f64) -> f64 {
        self.points as f64 / (std::f64::consts::PI * radius * radius)
    }
}

/// Histograms of the oriented points around keypoints: M × K, each of unit norm.
///
/// A point p with normal m counts for a keypoint k with normal n by distance ‖p − k‖/r, angle ⟨m, n⟩ and height
/// ⟨p − k, n⟩/r (method, "Local signatures"). `vertices` names a corner of the face that each keypoint lies on.
///
/// # Errors
/// [`Cancelled`].
pub fn local_signatures(
    mesh: &TriMesh,
    parameters: &LocalParameters,
    cancel: &Cancel,
) -> Result<Signatures, Cancelled> {
    let points = oriented_points(mesh, parameters);
    cancel.check()?;
    let keypoints = points.keypoints(parameters.keypoints);
    let places: Vec<Point> = keypoints.iter().map(|&k| *points.point(k)).collect();
    Ok(Signatures {
        matrix: histograms(&points, &places, parameters, cancel)?,
        vertices: keypoints.iter().map(|&k| points.corner(k)).collect(),
    })
}

/// Points as dense as the smallest radius needs them, with their normals averaged.
fn oriented_points(mesh: &TriMesh, parameters: &LocalParameters) -> OrientedPoints {
    let smallest = parameters.smallest_radius();
    let count = (mesh.area() * parameters.density(smallest)).ceil() as usize;
    let count = count.max(parameters.points).min(MOST_POINTS);
    let mut points = OrientedPoints::on(mesh, count, parameters.seed);
    points.smooth_normals(parameters.smoothing * smallest);
    points
}

/// The signatures of a surface at some places: M × K.
fn histograms(
    points: &OrientedPoints,
    places: &[Point],
    parameters: &LocalParameters,
    cancel: &Cancel,
) -> Result<Mat<f64>, Cancelled> {
    let mut matrix = Mat::zeros(parameters.dimension(), places.len());
    for (i, &radius) in parameters.radii.iter().enumerate() {
        cancel.check()?;
        let step = parameters.density(parameters.smallest_radius()) / parameters.density(radius);
        let cells = points.cells(step, radius);
        let mut histogram = Histogram::new(radius, &cells);
        for (j, place) in places.iter().enumerate() {
            let column = matrix.col_as_slice_mut(j);
            histogram.fill(&cells, place, &mut column[i * BINS..(i + 1) * BINS]);
        }
    }
    for j in 0..matrix.ncols() {
        unit(matrix.col_as_slice_mut(j));
    }
    Ok(matrix)
}

/// The square root of each value, of unit norm in every radius and in all.
fn unit(column: &mut [f64]) {
    let radii = (column.len() / BINS) as f64;
    for part in column.chunks_exact_mut(BINS) {
        let sum: f64 = part.iter().sum();
        if sum > 0.0 {
            let scale = 1.0 / (sum * radii);
            part.iter_mut().for_each(|x| *x = (*x * scale).sqrt());
        }
    }
}
