//! Which training shapes are near copies of each other, such as frames of one walk that follow each other.
//!
//! Two shapes are told apart by the first eigenvalues of their surfaces at unit area (Shape DNA), which neither motion nor
//! triangulation changes: the distance is the root mean square of the differences of their logarithms. Other poses of a
//! body are 0.008 and more apart (zoo, Quaternius animals, TOSCA), other triangulations of a pose and frames a hundredth of a
//! stride apart 0.001 to 0.003.

use super::Description;

/// Shapes at most this far apart are near copies.
const NEAR: f64 = 0.005;
/// Eigenvalues compared, the first beside 0.
const EIGENVALUES: usize = 13;

/// The group of each shape, numbered from 0 in the order of their first shapes: near copies, and what is connected by
/// them, are in one.
pub fn groups(shapes: &[&Description]) -> Vec<usize> {
    let logarithms: Vec<Vec<f64>> = shapes
        .iter()
        .map(|shape| logarithms(&shape.eigenvalues))
        .collect();
    let mut group: Vec<usize> = (0..shapes.len()).collect();
    for i in 0..shapes.len() {
        for j in 0..i {
            if group[i] != group[j] && near(&logarithms[i], &logarithms[j]) {
                let (from, to) = (group[i].max(group[j]), group[i].min(group[j]));
                group.iter_mut().filter(|g| **g == from).for_each(|g| *g = to);
            }
        }
    }
    // Each group is called after its first shape; numbers in the order of these.
    let mut first = group.clone();
    first.dedup();
    first.sort_unstable();
    first.dedup();
    group.iter().map(|g| first.partition_point(|f| f < g)).collect()
}

fn logarithms(eigenvalues: &[f64]) -> Vec<f64> {
    let first = eigenvalues.iter().skip(1).take(EIGENVALUES);
    first.map(|value| value.max(f64::MIN_POSITIVE).ln()).collect()
}

fn near(one: &[f64], other: &[f64]) -> bool {
    let sum: f64 = one.iter().zip(other).map(|(a, b)| (a - b) * (a - b)).sum();
    one.len() == other.len() && !one.is_empty() && sum <= NEAR * NEAR * one.len() as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::PrepareReport;

    fn shape(scale: f64) -> Description {
        Description {
            views: Vec::new(),
            report: PrepareReport::default(),
            eigenvalues: (0..20).map(|k| scale * f64::from(k)).collect(),
        }
    }

    #[test]
    fn near_copies_are_in_one_group_and_so_is_what_they_connect() {
        let groups_of = |scales: &[f64]| {
            let shapes: Vec<Description> = scales.iter().map(|scale| shape(*scale)).collect();
            groups(&shapes.iter().collect::<Vec<_>>())
        };
        assert_eq!(groups_of(&[1.0, 1.02, 1.04]), [0, 1, 2]);
        assert_eq!(groups_of(&[1.0, 1.02, 1.001, 1.021]), [0, 1, 0, 1]);
        // 0.006 from end to end, and by 0.003 connected.
        assert_eq!(groups_of(&[1.0, 1.006, 1.5, 1.003]), [0, 0, 1, 0]);
        assert_eq!(groups_of(&[]), [0; 0]);
    }

    #[test]
    fn shapes_without_eigenvalues_are_no_copies() {
        let mut shapes = [shape(1.0), shape(1.0)];
        shapes.iter_mut().for_each(|s| s.eigenvalues.clear());
        assert_eq!(groups(&[&shapes[0], &shapes[1]]), [0, 1]);
    }
}
