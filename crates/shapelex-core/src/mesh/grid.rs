//! Clustering on a regular grid: one vertex for each cell, in linear time that can be stopped.

use super::MeshError;
use super::clean::{Cleaned, drop_unreferenced, duplicates};
use super::work::{Watch, Work};
use std::collections::{HashMap, HashSet};

/// Cells along the longest side of the grids that are tried; one cell keeps no face, the library's limit is 1025.
pub(super) const COARSEST_GRID: usize = 2;
pub(super) const FINEST_GRID: usize = 1000;

/// A grid over [−1, 1]³.
#[derive(Clone, Copy, Debug)]
pub(super) struct Grid {
    cells: usize,
    /// Cells that hold vertices at most.
    occupied: usize,
}

/// What is known of a cell.
#[derive(Clone, Copy, Debug)]
struct Cell {
    sum: [f64; 3],
    count: f64,
    /// The vertex nearest to the mean, and the square of its distance.
    nearest: (u32, f64),
}

/// The finest grid of which at most `most` cells hold vertices; the coarsest where there is none.
///
/// # Errors
/// [`MeshError::Cancelled`], [`MeshError::Memory`].
pub(super) fn finest_grid(vertices: &[[f64; 3]], most: usize, work: Work) -> Result<Grid, MeshError> {
    let _held = work.hold(most, 24)?;
    let (mut fits, mut exceeds) = (COARSEST_GRID, FINEST_GRID + 1);
    while exceeds - fits > 1 {
        let grid = Grid {
            cells: fits.midpoint(exceeds),
            occupied: most,
        };
        if grid.occupied_at_most(vertices, most, work)? {
            fits = grid.cells;
        } else {
            exceeds = grid.cells;
        }
    }
    Ok(Grid {
        cells: fits,
        occupied: most.max(COARSEST_GRID.pow(3)),
    })
}

impl Grid {
    /// A grid with three quarters of the cells along a side; `None` where there is none.
    pub fn coarser(self) -> Option<Self> {
        let cells = 3 * self.cells / 4;
        (cells >= COARSEST_GRID).then_some(Self { cells, ..self })
    }

    fn key(&self, p: &[f64; 3]) -> u32 {
        let n = self.cells as f64;
        p.iter().fold(0, |key, x| {
            let cell = ((0.5 * x + 0.5) * n).clamp(0.0, n - 1.0) as u32;
            key * self.cells as u32 + cell
        })
    }

    fn occupied_at_most(&self, vertices: &[[f64; 3]], most: usize, work: Work) -> Result<bool, MeshError> {
        // Neighbours in the list are mostly neighbours in space: the last cell spares most of the hashing.
        let mut seen = HashSet::with_capacity(most.min(vertices.len()));
        let mut last = None;
        for (i, p) in vertices.iter().enumerate() {
            work.look(i)?;
            let key = self.key(p);
            if last != Some(key) {
                seen.insert(key);
                last = Some(key);
                if seen.len() > most {
                    return Ok(false);
                }
            }
        }
        Ok(true)
    }

    /// Moves every vertex to the one of its cell that is nearest to the mean of the cell; faces without three different
    /// vertices, and all but the first of those with the same three, go.
    ///
    /// # Errors
    /// [`MeshError::Cancelled`], [`MeshError::Memory`].
    pub fn apply(&self, mesh: &mut Cleaned, work: Work) -> Result<(), MeshError> {
        let to = self.nearest(&mesh.vertices, work)?;
        for (i, f) in mesh.faces.iter_mut().enumerate() {
            work.look(i)?;
            *f = f.map(|v| to[v as usize]);
        }
        mesh.faces
            .retain(|f| f[0] != f[1] && f[1] != f[2] && f[2] != f[0]);
        drop_unreferenced(&mut mesh.vertices, &mut mesh.faces, work)?;
        let duplicate = duplicates(mesh.vertices.len(), &mesh.faces, work)?;
        let mut i = 0;
        mesh.faces.retain(|_| {
            i += 1;
            !duplicate[i - 1]
        });
        Ok(())
    }

    /// For each vertex the one that stands for its cell.
    fn nearest(&self, vertices: &[[f64; 3]], work: Work) -> Result<Vec<u32>, MeshError> {
        let _held = (work.hold(vertices.len(), 8)?, work.hold(self.occupied, 96)?);
        let mut number: HashMap<u32, u32> = HashMap::new();
        let mut cells: Vec<Cell> = Vec::new();
        let mut cell_of = Vec::with_capacity(vertices.len());
        for (i, p) in vertices.iter().enumerate() {
            work.look(i)?;
            let next = cells.len() as u32;
            let at = *number.entry(self.key(p)).or_insert(next);
            if at == next {
                cells.push(Cell {
                    sum: [0.0; 3],
                    count: 0.0,
                    nearest: (i as u32, f64::INFINITY),
                });
            }
            let cell = &mut cells[at as usize];
            for (sum, x) in cell.sum.iter_mut().zip(p) {
                *sum += x;
            }
            cell.count += 1.0;
            cell_of.push(at);
        }
        for (i, p) in vertices.iter().enumerate() {
            work.look(i)?;
            let cell = &mut cells[cell_of[i] as usize];
            let away: f64 = (0..3).map(|k| (p[k] - cell.sum[k] / cell.count).powi(2)).sum();
            if away < cell.nearest.1 {
                cell.nearest = (i as u32, away);
            }
        }
        for at in &mut cell_of {
            *at = cells[*at as usize].nearest.0;
        }
        Ok(cell_of)
    }
}
