//! The paper's own results (Boscaini, Castellani 2013, Table 1), to stand beside ours.

use super::deform::Deformation;

/// What the paper reports of one deformation: right answers of 72.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PaperRow {
    /// The deformation.
    pub deformation: Deformation,
    /// Signature Distance Distribution, mean of five runs.
    pub signature_distances: usize,
    /// Shape DNA, 13 eigenvalues.
    pub shape_dna: usize,
    /// Sparse coding.
    pub sparse_coding: usize,
}

/// Queries in each category of the paper.
pub const QUERIES: usize = 72;

/// Table 1, in its order.
pub const TABLE_1: [PaperRow; 9] = [
    row(Deformation::Affine, 45, 49, 59),
    row(Deformation::Holes, 36, 58, 65),
    row(Deformation::MicroHoles, 65, 64, 65),
    row(Deformation::Scale, 72, 71, 72),
    row(Deformation::Sampling, 67, 69, 72),
    row(Deformation::Noise, 71, 72, 72),
    row(Deformation::ShotNoise, 70, 72, 72),
    row(Deformation::Topology, 58, 55, 72),
    row(Deformation::View, 11, 16, 49),
];

const fn row(
    deformation: Deformation,
    signature_distances: usize,
    shape_dna: usize,
    sparse_coding: usize,
) -> PaperRow {
    PaperRow {
        deformation,
        signature_distances,
        shape_dna,
        sparse_coding,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_rows_add_up_to_the_papers_averages() {
        let sum = |pick: fn(&PaperRow) -> usize| TABLE_1.iter().map(pick).sum::<usize>();
        assert_eq!(
            [
                sum(|r| r.signature_distances),
                sum(|r| r.shape_dna),
                sum(|r| r.sparse_coding)
            ],
            [495, 526, 598]
        );
        assert!(TABLE_1.iter().map(|r| r.deformation).eq(Deformation::ALL));
    }
}
