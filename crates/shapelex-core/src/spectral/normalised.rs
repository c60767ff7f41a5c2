//! The generalised problem W φ = λ A φ as a standard one: S x = λ x with S = A^(-1/2) W A^(-1/2), x = A^(1/2) φ.

use super::{Operators, SpectralError};

/// S (n × n, both triangles, CSC) with what is known about it in advance.
pub struct Normalised {
    pub n: usize,
    pub pointers: Vec<usize>,
    pub rows: Vec<usize>,
    pub values: Vec<f64>,
    /// A^(-1/2), n entries.
    pub inv_sqrt_mass: Vec<f64>,
    /// ‖S‖_∞, which bounds the largest eigenvalue and the rounding of a product.
    pub norm: f64,
    /// The exact null space, if any.
    pub null: NullSpace,
}

/// The null space of S: one vector per connected component on which the rows of W sum to zero.
///
/// Component c contributes x_i = √a_i / √(Σ_c a) on its own vertices. The supports are disjoint, so projecting a
/// vector costs O(n) however many components there are. A component cut by a Dirichlet condition contributes none.
pub struct NullSpace {
    /// Per vertex: its null vector, or `u32::MAX`.
    pub label: Vec<u32>,
    /// Per vertex: the entry of that null vector, or 0.
    pub entry: Vec<f64>,
    /// How many null vectors there are.
    pub count: usize,
}

impl NullSpace {
    /// The same null space with rows in another order, `order[new] = old`.
    pub fn permuted(&self, order: &[usize]) -> Self {
        Self {
            label: order.iter().map(|&o| self.label[o]).collect(),
            entry: order.iter().map(|&o| self.entry[o]).collect(),
            count: self.count,
        }
    }
}

impl Normalised {
    /// Scales the operators. Vertices with an entry in `keep` (ascending) survive; the rest are held at zero.
    pub fn new(operators: &Operators, keep: Option<&[usize]>) -> Result<Self, SpectralError> {
        let w = &operators.stiffness;
        let all = w.cols();
        let (n, local) = match keep {
            None => (all, None),
            Some(keep) => {
                let mut local = vec![usize::MAX; all];
                for (new, &old) in keep.iter().enumerate() {
                    local[old] = new;
                }
                (keep.len(), Some(local))
            }
        };
        let old = |i: usize| keep.map_or(i, |k| k[i]);
        let inv_sqrt_mass: Vec<f64> = (0..n).map(|i| 1.0 / operators.mass[old(i)].sqrt()).collect();
        let indptr = w.indptr();
        let (pointers_all, rows_all, values_all) = (indptr.raw_storage(), w.indices(), w.data());
        let mut pointers = Vec::with_capacity(n + 1);
        let mut rows = Vec::with_capacity(w.nnz());
        let mut values = Vec::with_capacity(w.nnz());
        pointers.push(0);
        let mut norm: f64 = 0.0;
        for column in 0..n {
            let mut sum = 0.0;
            for at in pointers_all[old(column)]..pointers_all[old(column) + 1] {
                let row = local.as_ref().map_or(rows_all[at], |l| l[rows_all[at]]);
                if row == usize::MAX {
                    continue;
                }
                let value = values_all[at] * (inv_sqrt_mass[row] * inv_sqrt_mass[column]);
                sum += value.abs();
                rows.push(row);
                values.push(value);
            }
            if !f64::is_finite(sum) {
                return Err(SpectralError::Factorisation {
                    detail: format!("the weights at vertex {} are not finite", old(column)),
                });
            }
            norm = norm.max(sum);
            pointers.push(rows.len());
        }
        let mut s = Self {
            n,
            pointers,
            rows,
            values,
            inv_sqrt_mass,
            norm,
            null: NullSpace {
                label: Vec::new(),
                entry: Vec::new(),
                count: 0,
            },
        };
        s.null = s.null_space();
        Ok(s)
    }

    /// Rows and values of a column.
    pub fn column(&self, j: usize) -> impl Iterator<Item = (usize, f64)> + '_ {
        let range = self.pointers[j]..self.pointers[j + 1];
        self.rows[range.clone()]
            .iter()
            .copied()
            .zip(self.values[range].iter().copied())
    }

    /// The vertices of every connected component, ascending; components by their first vertex.
    pub fn parts(&self) -> Vec<Vec<usize>> {
        let component = self.components();
        let count = component.iter().map(|c| c + 1).max().unwrap_or(0);
        let mut parts = vec![Vec::new(); count];
        for (vertex, &c) in component.iter().enumerate() {
            parts[c].push(vertex);
        }
        parts
    }

    /// The diagonal block of one connected component, given by its vertices in ascending order.
    pub fn block(&self, part: &[usize]) -> Self {
        let mut pointers = Vec::with_capacity(part.len() + 1);
        let (mut rows, mut values) = (Vec::new(), Vec::new());
        pointers.push(0);
        for &j in part {
            for (i, value) in self.column(j) {
                // Outside of the component there are only zeros.
                if let Ok(row) = part.binary_search(&i) {
                    rows.push(row);
                    values.push(value);
                }
            }
            pointers.push(rows.len());
        }
        let label: Vec<u32> = part.iter().map(|&i| self.null.label[i]).collect();
        let has_null = label.iter().any(|&l| l != u32::MAX);
        Self {
            n: part.len(),
            pointers,
            rows,
            values,
            inv_sqrt_mass: part.iter().map(|&i| self.inv_sqrt_mass[i]).collect(),
            norm: self.norm,
            null: NullSpace {
                label: label
                    .into_iter()
                    .map(|l| if l == u32::MAX { l } else { 0 })
                    .collect(),
                entry: part.iter().map(|&i| self.null.entry[i]).collect(),
                count: usize::from(has_null),
            },
        }
    }

    fn null_space(&self) -> NullSpace {
        let n = self.n;
        let component = self.components();
        let count = component.iter().map(|c| c + 1).max().unwrap_or(0);
        let sqrt_mass = |i: usize| 1.0 / self.inv_sqrt_mass[i];
        // S √a is W 1, scaled: zero on the component, up to rounding, unless a boundary value is held.
        let mut defect = vec![0.0; count];
        let mut scale = vec![0.0; count];
        let mut mass = vec![0.0; count];
        for j in 0..n {
            let (mut sum, mut size) = (0.0, 0.0);
            for (i, value) in self.column(j) {
                sum += value * sqrt_mass(i);
                size += (value * sqrt_mass(i)).abs();
            }
            defect[component[j]] += sum.abs();
            scale[component[j]] += size;
            mass[component[j]] += sqrt_mass(j).powi(2);
        }
        let mut number = vec![u32::MAX; count];
        let mut found = 0u32;
        for c in 0..count {
            if defect[c] <= 1e-12 * scale[c] {
                number[c] = found;
                found += 1;
            }
        }
        let label: Vec<u32> = component.iter().map(|&c| number[c]).collect();
        let entry = (0..n)
            .map(|i| {
                if label[i] == u32::MAX {
                    0.0
                } else {
                    sqrt_mass(i) / mass[component[i]].sqrt()
                }
            })
            .collect();
        NullSpace {
            label,
            entry,
            count: found as usize,
        }
    }

    /// Connected components of the non-zero pattern, numbered by their first vertex.
    fn components(&self) -> Vec<usize> {
        let mut component = vec![usize::MAX; self.n];
        let mut stack = Vec::new();
        let mut count = 0;
        for seed in 0..self.n {
            if component[seed] != usize::MAX {
                continue;
            }
            component[seed] = count;
            stack.push(seed);
            while let Some(j) = stack.pop() {
                for (i, value) in self.column(j) {
                    if value != 0.0 && component[i] == usize::MAX {
                        component[i] = count;
                        stack.push(i);
                    }
                }
            }
            count += 1;
        }
        component
    }
}
