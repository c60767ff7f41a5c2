//! Bytes the steps take at most, from the sizes they work on: for admission, so rather too many than too few.
//!
//! Each formula names what is held at the same time. `tests/estimates` compares them with what is allocated.

use super::fixed_grid::{AREA_SCALES, FIXED_ENERGIES};
use crate::parameters::{Channel, Hypothesis, Parameters};
use crate::spectral;

/// Bytes of a double.
const F64: u64 = 8;
/// Bytes per vertex of a mesh with its operators: corners, faces, and some seven entries of each matrix per row.
const MESH: u64 = 600;
/// Bytes of a non-zero of a code, in the memory of the thread and in the result.
const CODE_ENTRY: u64 = 28;
/// What is in none of the formulas: small buffers of many kinds.
const SMALL: u64 = 2 << 20;
/// Signals of a product with all atoms.
const CODED_TOGETHER: u64 = 256;
/// Signals the objective is measured on while a dictionary is learnt.
const MEASURED: u64 = 500;

/// What a shape is described for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    /// To be learnt from.
    Training,
    /// To be ranked.
    Query,
}

/// Bytes that cleaning and simplifying a mesh takes beside the mesh: welding, edges, quadrics.
pub fn preparing_bytes(vertices: usize, faces: usize) -> u64 {
    SMALL + 100 * vertices as u64 + 120 * faces as u64
}

/// Vertices a mesh has at most once it is prepared.
pub fn prepared_vertices(vertices: usize, parameters: &Parameters) -> usize {
    let kept = match parameters.working_size {
        0 => vertices,
        // Closing holes adds a vertex for each, and a hole has three of its own or more but for rare ones.
        size => (3 * vertices / 2).min(3 * size / 2),
    };
    kept.max(parameters.refine_below)
}

/// Signatures per view.
fn signatures(vertices: usize, parameters: &Parameters, role: Role) -> usize {
    let asked = match role {
        Role::Training => parameters.samples_per_shape,
        Role::Query => parameters.query_samples,
    };
    if asked == 0 { vertices } else { asked.min(vertices) }
}

/// Signatures per channel of a training shape of so many prepared vertices, at most.
pub fn training_signatures(vertices: usize, parameters: &Parameters) -> usize {
    signatures(vertices, parameters, Role::Training)
}

/// Length of a channel's signatures.
fn dimension(channel: Channel, parameters: &Parameters) -> usize {
    match channel {
        Channel::FixedGrid => FIXED_ENERGIES,
        Channel::Plain | Channel::Whitened => parameters.energies,
    }
}

/// Bytes of a description of a mesh of so many prepared vertices: its views, of which an open query has one per assumed
/// area and an open training shape a doubled one more.
pub fn description_bytes(vertices: usize, parameters: &Parameters, role: Role) -> u64 {
    let values: usize = parameters
        .channels()
        .iter()
        .map(|&channel| {
            let views = match (channel, role) {
                (Channel::FixedGrid, Role::Query) => AREA_SCALES.len() + 1,
                // A part has a share of its vertices in each, and its plain view is doubled beside.
                (Channel::FixedGrid, Role::Training) => 1,
                (Channel::Plain, Role::Training) => 2,
                (Channel::Plain | Channel::Whitened, _) => 1,
            };
            views * dimension(channel, parameters)
        })
        .sum();
    F64 * (values * signatures(vertices, parameters, role)) as u64
}

/// Bytes at the peak of describing a mesh of so many vertices as read, from its Laplacian on, where it is a surface.
pub fn describing_bytes(vertices: usize, parameters: &Parameters, role: Role) -> u64 {
    prepared_describing_bytes(prepared_vertices(vertices, parameters), parameters, role)
}

/// As [`describing_bytes`], for the vertices of a prepared mesh.
///
/// Plain and whitened spectra are solved for at the same time; then the doubled one beside both, whose vectors are
/// spread over all vertices, merged and scaled. A spectrum is cut to the eigenpairs of a channel by a copy.
pub fn prepared_describing_bytes(v: usize, parameters: &Parameters, role: Role) -> u64 {
    let has = |hypothesis| parameters.hypotheses.contains(&hypothesis);
    let n = parameters.eigenpairs;
    let most = match has(Hypothesis::Doubled) {
        true => n.max(parameters.part_eigenpairs),
        false => n,
    };
    // An eighth more: a dense solve's workspace is a little larger than the matrices it is estimated by.
    let solve = |pairs: usize| spectral::estimated_bytes(v, pairs) as u64 * 9 / 8;
    let vectors = |pairs: usize| F64 * (v * pairs.min(v)) as u64;
    let (mut first, mut kept) = (solve(most), vectors(most));
    if has(Hypothesis::Whitened) {
        first += solve(n) + MESH * v as u64;
        kept += vectors(n);
    }
    let doubled = match has(Hypothesis::Doubled) {
        true => solve(most) + 2 * vectors(most),
        false => 0,
    };
    let samples = signatures(v, parameters, role) as u64;
    let squares = F64 * samples * most as u64 + vectors(most);
    let views = description_bytes(v, parameters, role);
    SMALL + MESH * v as u64 + first.max(kept + doubled.max(2 * vectors(most) + squares + views))
}

/// Bytes that factors take beyond those of a surface, for a mesh of so many prepared vertices and an excess of separators
/// ([`separator_excess`](crate::mesh::edges::separator_excess)).
///
/// A graph of n vertices that is x changes away from a plane one is cut in two by some 3 √(x n) vertices, whose block of
/// the factor is dense, and by no more than all. The factor is held twice while it is packed, and two are made at a time.
pub fn factor_excess_bytes(vertices: usize, excess: usize, parameters: &Parameters) -> u64 {
    let (n, x) = (vertices as u64, excess as u64);
    let separator = n.min(((9 * x).saturating_mul(n) as f64).sqrt() as u64);
    let alone = parameters.hypotheses.iter().all(|h| *h == Hypothesis::Plain);
    let factors = if alone { 1 } else { 2 };
    factors * 2 * F64 * separator * separator / 2
}

/// Bytes of a dictionary that is ready to code: atoms at both precisions, and both matrices of their products.
pub fn dictionary_bytes(channel: Channel, atoms: usize, parameters: &Parameters) -> u64 {
    let (m, l) = (dimension(channel, parameters) as u64, atoms as u64);
    12 * m * l + 12 * l * l + 16 * l
}

/// Bytes of a class's or a shape's dictionaries, in all channels.
pub fn model_bytes(atoms: usize, parameters: &Parameters) -> u64 {
    let channels = parameters.channels();
    let each = channels.iter().map(|&c| dictionary_bytes(c, atoms, parameters));
    each.sum()
}

/// Bytes of the memory a thread codes in: products of a block of signals with all atoms, and a batch's codes.
pub fn coding_bytes(signals: usize, atoms: usize, dimension: usize) -> u64 {
    let (n, l, m) = (signals as u64, atoms as u64, dimension as u64);
    let codes = n * l.min(m) * CODE_ENTRY;
    let block = n.min(CODED_TOGETHER) * (4 * l + 8 * m);
    // What the active set has of the atoms in it: their products and a factor.
    let active = 3 * F64 * l.min(m) * l.min(m);
    codes + block + active + 64 * n
}

/// Bytes at the peak of ranking a description under an index whose largest dictionary has so many atoms, on so many
/// threads.
pub fn ranking_bytes(vertices: usize, atoms: usize, threads: usize, parameters: &Parameters) -> u64 {
    let v = prepared_vertices(vertices, parameters);
    let signals = signatures(v, parameters, Role::Query);
    let each = parameters
        .channels()
        .iter()
        .map(|&channel| coding_bytes(signals, atoms, dimension(channel, parameters)))
        .max();
    threads as u64 * each.unwrap_or_default()
}

/// Bytes at the peak of learning a class from shapes with so many signatures per channel: `descriptions` are the bytes of all
/// of them, which are held, and `largest` those of one, whose views are copied where it is scored.
///
/// Beside these, the finished dictionaries of the class and those of a fold that is being measured, and of the channel
/// that is being learnt: initial, present and rounded atoms, the sums of codes and signals, the matrices of products, a
/// batch with its codes.
pub fn learning_bytes(descriptions: u64, largest: u64, signatures: usize, parameters: &Parameters) -> u64 {
    let atoms = parameters.atoms.min(signatures);
    let batch = parameters.batch.min(signatures).max(MEASURED as usize);
    let learning = parameters.channels().into_iter().map(|channel| {
        let dimension = dimension(channel, parameters);
        let (m, l, b) = (dimension as u64, atoms as u64, batch as u64);
        let dictionaries = 5 * F64 * m * l + (3 * F64 + 8) * l * l;
        dictionaries + F64 * m * b + coding_bytes(batch, atoms, dimension)
    });
    let numbers = 64 * signatures as u64;
    SMALL
        + descriptions
        + largest
        + 2 * model_bytes(atoms, parameters)
        + numbers
        + learning.max().unwrap_or_default()
}
