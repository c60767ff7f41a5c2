//! Sparse factorisation of S − c I and the solve with several right-hand sides.
//!
//! For a shift c inside the spectrum the matrix is indefinite: S − c I = L D Lᵀ, and by Sylvester's law of inertia the
//! number of negative entries of D is the number of eigenvalues of S below c. That makes the factorisation the solver's
//! certificate as well as its engine. The factorisation is faer's (AMD ordering, supernodal, no pivoting across the
//! diagonal); its accuracy is not assumed but seen in the residuals of the final vectors.

use super::SpectralError;
use super::normalised::Normalised;
use super::simd::{Row, Simd, Vector, kernel, load, store};
use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::ldlt::factor::LdltRegularization;
use faer::sparse::linalg::SupernodalThreshold;
use faer::sparse::linalg::cholesky::{
    CholeskySymbolicParams, SymbolicCholesky, SymbolicCholeskyRaw, SymmetricOrdering,
    factorize_symbolic_cholesky, supernodal,
};
use faer::sparse::{SparseColMatRef, SymbolicSparseColMatRef};
use faer::{Par, Side};

/// Rows per panel of the packed factor below a supernode's diagonal block.
const PANEL: usize = 4;

/// Below any ratio of operations to entries. `FORCE_SUPERNODAL` is 0, which a star does not exceed: the ordering leaves its
/// hub out of the count, and the other vertices have no neighbours besides.
const ALWAYS_SUPERNODAL: SupernodalThreshold = SupernodalThreshold(-1.0);

/// The fill-reducing order and symbolic factor of S's pattern, with S's lower triangle ready to be shifted.
pub struct Analysis {
    n: usize,
    symbolic: SymbolicCholesky<usize>,
    pointers: Vec<usize>,
    rows: Vec<usize>,
    values: Vec<f64>,
}

/// L D Lᵀ of the permuted S − c I, packed for [`Factor::solve`].
pub struct Factor {
    n: usize,
    simd: Simd,
    /// Eigenvalues of S below the shift.
    pub below: usize,
    supernodes: Vec<Supernode>,
    pattern: Vec<u32>,
    values: Vec<f64>,
    inv_pivot: Vec<f64>,
}

#[derive(Clone, Copy)]
struct Supernode {
    start: usize,
    size: usize,
    pattern: usize,
    pattern_end: usize,
    values: usize,
}

fn failed(detail: impl std::fmt::Display) -> SpectralError {
    SpectralError::Factorisation {
        detail: detail.to_string(),
    }
}

impl Analysis {
    /// Orders S by approximate minimum degree and finds the structure of its factor.
    pub fn new(s: &Normalised) -> Result<Self, SpectralError> {
        let mut pointers = Vec::with_capacity(s.n + 1);
        let mut rows = Vec::with_capacity(s.rows.len() / 2 + s.n);
        let mut values = Vec::with_capacity(s.rows.len() / 2 + s.n);
        pointers.push(0);
        for j in 0..s.n {
            for (i, value) in s.column(j).filter(|(i, _)| *i >= j) {
                rows.push(i);
                values.push(value);
            }
            pointers.push(rows.len());
        }
        let pattern = SymbolicSparseColMatRef::new_checked(s.n, s.n, &pointers, None, &rows);
        let symbolic = factorize_symbolic_cholesky(
            pattern,
            Side::Lower,
            SymmetricOrdering::Amd,
            CholeskySymbolicParams {
                supernodal_flop_ratio_threshold: ALWAYS_SUPERNODAL,
                ..Default::default()
            },
        )
        .map_err(|e| failed(format!("ordering failed: {e:?}")))?;
        Ok(Self {
            n: s.n,
            symbolic,
            pointers,
            rows,
            values,
        })
    }

    /// `order[new] = old`: the vertex at each place of the fill-reducing order.
    pub fn order(&self) -> Vec<usize> {
        match self.symbolic.perm() {
            Some(perm) => perm.arrays().0.to_vec(),
            None => (0..self.n).collect(),
        }
    }

    fn numeric(&self, shift: f64) -> Result<Vec<f64>, SpectralError> {
        let mut values = self.values.clone();
        for j in 0..self.n {
            // The diagonal is the first entry of a lower column; every vertex has one.
            values[self.pointers[j]] -= shift;
        }
        let pattern = SymbolicSparseColMatRef::new_checked(self.n, self.n, &self.pointers, None, &self.rows);
        let matrix = SparseColMatRef::new(pattern, &values);
        let mut factor = vec![0.0; self.symbolic.len_val()];
        let scratch = self
            .symbolic
            .factorize_numeric_ldlt_scratch::<f64>(Par::Seq, Default::default());
        let mut memory = MemBuffer::try_new(scratch).map_err(|e| failed(format!("out of memory: {e:?}")))?;
        self.symbolic
            .factorize_numeric_ldlt(
                &mut factor,
                matrix,
                Side::Lower,
                LdltRegularization::default(),
                Par::Seq,
                MemStack::new(&mut memory),
                Default::default(),
            )
            .map_err(|e| failed(format!("{e:?} at shift {shift}")))?;
        Ok(factor)
    }

    fn supernodal(&self) -> Result<&supernodal::SymbolicSupernodalCholesky<usize>, SpectralError> {
        match self.symbolic.raw() {
            SymbolicCholeskyRaw::Supernodal(s) => Ok(s),
            SymbolicCholeskyRaw::Simplicial(_) => Err(failed("no supernodal factor")),
        }
    }

    /// The number of eigenvalues of S below `shift`.
    pub fn count_below(&self, shift: f64) -> Result<usize, SpectralError> {
        let values = self.numeric(shift)?;
        let symbolic = self.supernodal()?;
        let factor = supernodal::SupernodalLdltRef::<usize, f64>::new(symbolic, &values);
        let mut below = 0;
        for k in 0..symbolic.n_supernodes() {
            let block = factor.supernode(k).val();
            for i in 0..block.ncols() {
                if !block[(i, i)].is_finite() {
                    return Err(failed(format!("a pivot is not finite at shift {shift}")));
                }
                below += usize::from(block[(i, i)] < 0.0);
            }
        }
        Ok(below)
    }

    /// Factorises S − shift·I.
    pub fn factorise(&self, shift: f64) -> Result<Factor, SpectralError> {
        let raw = self.numeric(shift)?;
        let symbolic = self.supernodal()?;
        let source = supernodal::SupernodalLdltRef::<usize, f64>::new(symbolic, &raw);
        let mut factor = Factor {
            n: self.n,
            simd: Simd::detect(),
            below: 0,
            supernodes: Vec::with_capacity(symbolic.n_supernodes()),
            pattern: Vec::new(),
            values: Vec::with_capacity(raw.len() + raw.len() / 8),
            inv_pivot: vec![0.0; self.n],
        };
        for k in 0..symbolic.n_supernodes() {
            let node = source.supernode(k);
            let (block, start) = (node.val(), node.start());
            let size = block.ncols();
            let below_diagonal = node.pattern().len();
            let pattern = factor.pattern.len();
            factor.pattern.extend(node.pattern().iter().map(|&r| r as u32));
            factor.supernodes.push(Supernode {
                start,
                size,
                pattern,
                pattern_end: factor.pattern.len(),
                values: factor.values.len(),
            });
            for i in 0..size {
                let pivot = block[(i, i)];
                if !pivot.is_finite() || pivot == 0.0 {
                    return Err(failed(format!("pivot {pivot} at shift {shift}")));
                }
                factor.below += usize::from(pivot < 0.0);
                factor.inv_pivot[start + i] = 1.0 / pivot;
                // Strict lower triangle of the diagonal block, row by row, zeros above it.
                factor
                    .values
                    .extend((0..size).map(|c| if c < i { block[(i, c)] } else { 0.0 }));
            }
            // Below it: panels of PANEL rows, column by column, zero rows as padding.
            for first in (0..below_diagonal).step_by(PANEL) {
                for c in 0..size {
                    factor.values.extend((first..first + PANEL).map(|r| {
                        if r < below_diagonal {
                            block[(size + r, c)]
                        } else {
                            0.0
                        }
                    }));
                }
            }
        }
        factor.pattern.shrink_to_fit();
        Ok(factor)
    }
}

impl Factor {
    /// The diagonal block of a supernode, the panels below it and the rows those stand for.
    #[inline(always)]
    fn parts(&self, node: &Supernode) -> (&[f64], &[f64], &[u32]) {
        let pattern = &self.pattern[node.pattern..node.pattern_end];
        let (diagonal, rest) = self.values[node.values..].split_at(node.size * node.size);
        (diagonal, rest, pattern)
    }

    /// x ← (S − c I)⁻¹ x for B right-hand sides; rows in the fill-reducing order, one array of B per row.
    pub fn solve<const B: usize>(&self, x: &mut [[f64; B]])
    where
        [f64; B]: Row,
    {
        debug_assert_eq!(x.len(), self.n);
        solve_kernel::<B>(self.simd, self, x);
    }
}

kernel! {
    fn solve_kernel<const B: usize>(factor: &Factor, x: &mut [[f64; B]]) => solve_body
}

#[inline(always)]
fn solve_body<V: Vector, const B: usize>(factor: &Factor, x: &mut [[f64; B]]) {
    for node in &factor.supernodes {
        let (diagonal, panels, pattern) = factor.parts(node);
        let (own, later) = x[node.start..].split_at_mut(node.size);
        for i in 1..node.size {
            let mut sum: V = load(&own[i]);
            for (l, y) in diagonal[i * node.size..][..i].iter().zip(own.iter()) {
                sum = V::splat(*l).times_from(load(y), sum);
            }
            store(&mut own[i], sum);
        }
        for (rows, panel) in pattern.chunks(PANEL).zip(panels.chunks_exact(PANEL * node.size)) {
            let mut sums = [V::splat(0.0); PANEL];
            for (l, y) in panel.as_chunks::<PANEL>().0.iter().zip(own.iter()) {
                let y: V = load(y);
                for k in 0..PANEL {
                    sums[k] = V::splat(l[k]).times_plus(y, sums[k]);
                }
            }
            for (&row, sum) in rows.iter().zip(sums) {
                let target = &mut later[row as usize - node.start - node.size];
                let difference = V::splat(-1.0).times_plus(sum, load(target));
                store(target, difference);
            }
        }
    }
    for node in factor.supernodes.iter().rev() {
        let (diagonal, panels, pattern) = factor.parts(node);
        let (own, later) = x[node.start..].split_at_mut(node.size);
        for (row, d) in own.iter_mut().zip(&factor.inv_pivot[node.start..]) {
            let scaled = V::splat(*d).times(load(row));
            store(row, scaled);
        }
        // Up to four columns at a time, their sums in registers across all panels.
        let mut first = 0;
        while first < node.size {
            let panels = panels.chunks_exact(PANEL * node.size);
            match node.size - first {
                1 => backward::<V, 1, B>(own, later, first, node, pattern, panels),
                2 => backward::<V, 2, B>(own, later, first, node, pattern, panels),
                3 => backward::<V, 3, B>(own, later, first, node, pattern, panels),
                _ => backward::<V, 4, B>(own, later, first, node, pattern, panels),
            }
            first += 4;
        }
        for i in (1..node.size).rev() {
            let (others, rest) = own.split_at_mut(i);
            let y: V = load(&rest[0]);
            for (l, target) in diagonal[i * node.size..][..i].iter().zip(others) {
                let sum = V::splat(*l).times_from(y, load(target));
                store(target, sum);
            }
        }
    }
}

/// y ← y − Lᵀ x for C columns of a supernode from `first` on, x the rows below it.
#[inline(always)]
fn backward<'a, V: Vector, const C: usize, const B: usize>(
    own: &mut [[f64; B]],
    later: &[[f64; B]],
    first: usize,
    node: &Supernode,
    pattern: &[u32],
    panels: impl Iterator<Item = &'a [f64]>,
) {
    let mut sums = [[V::splat(0.0); 2]; C];
    for (rows, panel) in pattern.chunks(PANEL).zip(panels) {
        let mut gathered = [V::splat(0.0); PANEL];
        for (g, &row) in gathered.iter_mut().zip(rows) {
            *g = load(&later[row as usize - node.start - node.size]);
        }
        let panel = &panel.as_chunks::<PANEL>().0[first..first + C];
        for c in 0..C {
            for k in 0..PANEL {
                sums[c][k % 2] = V::splat(panel[c][k]).times_from(gathered[k], sums[c][k % 2]);
            }
        }
    }
    for (y, [one, other]) in own[first..].iter_mut().zip(sums) {
        let sum = one.plus(other).plus(load(y));
        store(y, sum);
    }
}
