//! A gallery of meshes: a row per shape, a column per deformation (the paper's Figures 2 and 3).

use super::FigureError;
use super::canvas::{self, draw, font, label, px, upwards};
use super::extent::widest;
use super::palette::{INK, MUTED, shaded};
use super::render::{Frame, facets};
use plotters::element::Polygon;
use plotters::style::text_anchor::{HPos, VPos};
use plotters::style::{Color, RGBColor};
use shapelex_core::mesh::{Components, MeshError, PrepareOptions, TriMesh, TriangleSoup, prepare};

/// Triangles of the whole figure; each takes about 75 bytes.
const FACETS: usize = 22_000;
/// Side of a cell in pixels, and how much of it the row's first mesh takes.
const CELL: f64 = 132.0;
const FILLED: f64 = 0.74;
/// Size of the names of rows and columns, in pixels.
const NAME: f64 = 13.0;
/// The outside of a surface, and its inside, which is seen through holes.
const OUTSIDE: RGBColor = RGBColor(138, 180, 222);
const INSIDE: RGBColor = RGBColor(226, 134, 52);
/// Triangles are drawn this much larger, in pixels, so that no background shines through between neighbours.
const GROWN: f64 = 0.35;

/// One row: a shape and what became of it.
#[derive(Clone, Debug, PartialEq)]
pub struct GalleryRow {
    /// What stands before the row.
    pub label: String,
    /// One mesh per column; `None` leaves the cell empty.
    pub meshes: Vec<Option<TriangleSoup>>,
    /// From where they are looked at.
    pub view: RowView,
}

/// From where the meshes of a row are looked at.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum RowView {
    /// The view and the scale of the first are kept for the others: what became of one shape.
    #[default]
    Shared,
    /// Each has its own: different shapes.
    Own,
}

/// Draws meshes by parallel projection, shaded, their inside in another colour. Within a row all have one scale, unless
/// one would not fit its cell. Meshes with more triangles than the figure has room for are simplified, so that the text
/// stays below 2 MB.
///
/// # Errors
/// [`FigureError::Empty`] without meshes; [`FigureError::Shape`] where a row has not one mesh per column;
/// [`FigureError::Mesh`] where one has no usable face.
pub fn gallery(title: &str, columns: &[String], rows: &[GalleryRow]) -> Result<String, FigureError> {
    let cells = rows.iter().flat_map(|row| &row.meshes).flatten().count();
    if cells == 0 {
        return Err(FigureError::Empty { what: "meshes" });
    }
    for row in rows {
        if row.meshes.len() != columns.len() {
            return Err(FigureError::Shape {
                what: "meshes of a row",
                expected: columns.len(),
                found: row.meshes.len(),
            });
        }
    }
    let names = |items: &mut dyn Iterator<Item = &str>| items.collect::<Vec<_>>().join(", ");
    let description = format!(
        "Shapes {} (rows), each as {} (columns).",
        names(&mut rows.iter().map(|r| r.label.as_str())),
        names(&mut columns.iter().map(String::as_str))
    );
    let (left, top) = (36.0, 72.0);
    // A cell is at least as large as its mesh, and as wide and high as the names along it.
    let across = widest(columns.iter().map(String::as_str), NAME, CELL - 12.0) + 12.0;
    let down = widest(rows.iter().map(|r| r.label.as_str()), NAME, CELL - 12.0) + 12.0;
    let size = (
        (left + across * columns.len() as f64 + 12.0).max(300.0),
        top + down * rows.len() as f64 + 12.0,
    );
    draw(title, &description, size, |root| {
        let heading = font(NAME, INK, HPos::Center, VPos::Center);
        for (j, name) in columns.iter().enumerate() {
            let x = left + across * (j as f64 + 0.5);
            canvas::write(root, &label(name), (x, top - 14.0), &heading)?;
        }
        let side = upwards(&font(NAME, MUTED, HPos::Center, VPos::Center));
        for (i, row) in rows.iter().enumerate() {
            let y = top + down * (i as f64 + 0.5);
            canvas::write(root, &label(&row.label), (20.0, y), &side)?;
            let mut view: Option<(Frame, f64)> = None;
            for (j, soup) in row.meshes.iter().enumerate() {
                let Some(soup) = soup else { continue };
                let centre = (left + across * (j as f64 + 0.5), y);
                if row.view == RowView::Own {
                    view = None;
                }
                draw_mesh(root, soup, centre, &mut view, FACETS / cells)?;
            }
        }
        Ok(())
    })
}

/// The mesh scaled so that the box around it has the diagonal of the other's: what came out of a step that changes the
/// unit is shown beside what went in.
pub fn as_large_as(other: &TriangleSoup, mut mesh: TriangleSoup) -> TriangleSoup {
    let factor = diagonal(other) / diagonal(&mesh);
    if factor.is_finite() {
        mesh.vertices.iter_mut().flatten().for_each(|x| *x *= factor);
    }
    mesh
}

/// Of the box around a mesh.
fn diagonal(mesh: &TriangleSoup) -> f64 {
    (0..3)
        .map(|k| {
            let along = || mesh.vertices.iter().map(|p| p[k]);
            let low = along().fold(f64::INFINITY, f64::min);
            (along().fold(f64::NEG_INFINITY, f64::max) - low).powi(2)
        })
        .sum::<f64>()
        .sqrt()
}

/// Draws one mesh around a place in pixels. `view` is the row's frame and pixels per unit, chosen by its first mesh.
fn draw_mesh(
    root: &canvas::Area<'_>,
    soup: &TriangleSoup,
    (x, y): (f64, f64),
    view: &mut Option<(Frame, f64)>,
    budget: usize,
) -> Result<(), FigureError> {
    let (mut mesh, unit) = clean(soup, 0)?;
    let (frame, row_scale) = match *view {
        Some(view) => view,
        None => {
            let frame = Frame::of(&mesh)?;
            let extent = Extent::of(&facets(&mesh, &frame, 60.0));
            let scale = FILLED * CELL / (extent.side() * unit);
            *view.insert((frame, scale))
        }
    };
    // Two samples a pixel tell what is seen.
    let mut seen = facets(&mesh, &frame, 2.0 * row_scale * unit);
    for _ in 0..4 {
        if seen.len() <= budget {
            break;
        }
        let share = 0.95 * budget as f64 / seen.len() as f64;
        let size = ((mesh.vertices().len() as f64 * share) as usize).max(40);
        mesh = clean(soup, size)?.0;
        seen = facets(&mesh, &frame, 2.0 * row_scale * unit);
    }
    let extent = Extent::of(&seen);
    let scale = (row_scale * unit).min(0.97 * CELL / extent.side());
    for facet in &seen {
        let corners = facet.corners.map(|[u, v]| {
            [
                x + (u - extent.middle[0]) * scale,
                y - (v - extent.middle[1]) * scale,
            ]
        });
        let colour = if facet.inside { INSIDE } else { OUTSIDE };
        let style = shaded(colour, facet.brightness).filled();
        let corners: Vec<(i32, i32)> = grown(&corners).iter().map(|c| (px(c[0]), px(c[1]))).collect();
        root.draw(&Polygon::new(corners, style))?;
    }
    Ok(())
}

/// The mesh at unit area with all its parts, and the length of that unit in the soup's own. `size` bounds the vertices;
/// 0 keeps all.
fn clean(soup: &TriangleSoup, size: usize) -> Result<(TriMesh, f64), MeshError> {
    let options = PrepareOptions {
        components: Components::All,
        fill_holes_below: 0.0,
        working_size: size,
    };
    let area: f64 = soup
        .faces
        .iter()
        .filter_map(|f| {
            let corner = |k: usize| soup.vertices.get(f[k] as usize);
            let (a, b, c) = (corner(0)?, corner(1)?, corner(2)?);
            let u: [f64; 3] = std::array::from_fn(|k| b[k] - a[k]);
            let v: [f64; 3] = std::array::from_fn(|k| c[k] - a[k]);
            let n = [
                u[1] * v[2] - u[2] * v[1],
                u[2] * v[0] - u[0] * v[2],
                u[0] * v[1] - u[1] * v[0],
            ];
            Some(0.5 * n.iter().map(|x| x * x).sum::<f64>().sqrt())
        })
        .sum();
    let (mesh, _) = prepare(soup.clone(), &options)?;
    Ok((mesh, area.sqrt()))
}

/// What facets cover.
struct Extent {
    middle: [f64; 2],
    half: [f64; 2],
}

impl Extent {
    fn of(facets: &[super::render::Facet]) -> Self {
        let all = || facets.iter().flat_map(|f| f.corners);
        let bound =
            |axis: usize, from: f64, pick: fn(f64, f64) -> f64| all().map(|c| c[axis]).fold(from, pick);
        let low = [0, 1].map(|axis| bound(axis, f64::INFINITY, f64::min));
        let high = [0, 1].map(|axis| bound(axis, f64::NEG_INFINITY, f64::max));
        Self {
            middle: [0, 1].map(|k| 0.5 * (low[k] + high[k])),
            half: [0, 1].map(|k| (0.5 * (high[k] - low[k])).max(1e-9)),
        }
    }

    /// Side of the square it fits into.
    fn side(&self) -> f64 {
        2.0 * self.half[0].max(self.half[1])
    }
}

/// The triangle with its corners moved away from its middle.
fn grown(corners: &[[f64; 2]; 3]) -> [[f64; 2]; 3] {
    let middle = [0, 1].map(|k| corners.iter().map(|c| c[k]).sum::<f64>() / 3.0);
    corners.map(|c| {
        let (dx, dy) = (c[0] - middle[0], c[1] - middle[1]);
        let length = dx.hypot(dy).max(1e-9);
        [c[0] + GROWN * dx / length, c[1] + GROWN * dy / length]
    })
}
