//! The figures of a robustness benchmark: the paper's Figures 3 to 6, and precision over recall.

use super::{
    EmbeddedPoint, FigureError, GalleryRow, HeatMap, Histogram, HistogramPanel, RowView, Series, as_large_as,
    between_classes, classical_mds, embedding, gallery, heat_map, histograms, precision_recall,
};
use crate::benchmark::deform::Deformation;
use crate::benchmark::report::{BenchmarkReport, ClassMatrix, DistanceHistogram, TOTAL};
use shapelex_core::mesh::TriangleSoup;

/// Rows of the gallery at most: more make each mesh coarser.
const GALLERY_ROWS: usize = 4;
/// Panels of the histograms at most.
const PANELS: usize = 12;
/// Categories drawn over each null's histogram: near, middle and far from it, so that the lines can be told apart.
const DRAWN: [&str; 3] = ["noise", "holes", "view"];

/// A figure and the name of the file it belongs into.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Sheet {
    /// Such as `mds.svg`.
    pub name: String,
    /// The SVG document.
    pub svg: String,
}

impl Sheet {
    /// A sheet of that name.
    pub(super) fn new(name: impl Into<String>, svg: String) -> Self {
        Self {
            name: name.into(),
            svg,
        }
    }
}

/// The paper's Figure 3: null shapes with their classes, each with its nine deformations, which `deform` makes of the
/// null at a place of the list. Of more than four nulls, four evenly spread are shown.
///
/// # Errors
/// As [`gallery`].
pub fn deformation_gallery(
    nulls: &[(&str, &TriangleSoup)],
    strength: u32,
    deform: &dyn Fn(usize, Deformation) -> Option<TriangleSoup>,
) -> Result<Sheet, FigureError> {
    let shown = nulls.len().min(GALLERY_ROWS);
    let rows: Vec<GalleryRow> = (0..shown)
        .map(|i| i * nulls.len() / shown)
        .map(|at| {
            let (class, null) = nulls[at];
            let deformed = Deformation::ALL.map(|kind| {
                let mesh = deform(at, kind)?;
                // Down-sampling gives a mesh in a unit of its own.
                Some(match kind {
                    Deformation::Sampling => as_large_as(null, mesh),
                    _ => mesh,
                })
            });
            GalleryRow {
                label: class.to_owned(),
                view: RowView::Shared,
                meshes: std::iter::once(Some(null.clone())).chain(deformed).collect(),
            }
        })
        .collect();
    let mut columns = vec!["null".to_owned()];
    columns.extend(Deformation::ALL.map(|d| spoken(d.name())));
    Ok(Sheet {
        name: "gallery.svg".to_owned(),
        svg: gallery(
            &format!("Null shapes and their deformations at strength {strength}"),
            &columns,
            &rows,
        )?,
    })
}

/// Every figure the report has data for: `sdd.svg`, `dissimilarity.svg`, `mds.svg`, `precision_recall.svg`.
///
/// # Errors
/// The first figure's that cannot be drawn.
pub fn benchmark_figures(report: &BenchmarkReport) -> Result<Vec<Sheet>, FigureError> {
    let mut sheets = Vec::new();
    if !report.histograms.is_empty() {
        sheets.push(distance_histograms(&report.histograms)?);
    }
    if let Some(matrix) = telling_matrix(&report.dissimilarity) {
        sheets.push(dissimilarity(&matrix, "class of the deformed shapes")?);
        sheets.push(class_embedding(&matrix)?);
    }
    let curves: Vec<Series> = report
        .precision_recall
        .iter()
        .filter(|c| c.category == TOTAL)
        .map(|c| Series {
            label: spoken(&c.method),
            points: c
                .recall
                .iter()
                .copied()
                .zip(c.precision.iter().copied())
                .collect(),
        })
        .collect();
    if !curves.is_empty() {
        sheets.push(Sheet {
            name: "precision_recall.svg".to_owned(),
            svg: precision_recall("Retrieval of nulls and their deformations", &curves)?,
        });
    }
    Ok(sheets)
}

/// Figure 4: one panel per null, a few categories over it. Of several methods the first is shown.
fn distance_histograms(all: &[DistanceHistogram]) -> Result<Sheet, FigureError> {
    let method = &all[0].method;
    let of_method = || all.iter().filter(|h| h.method == *method);
    let histogram = |h: &DistanceHistogram, label: &str| Histogram {
        label: label.to_owned(),
        shares: h.shares.clone(),
    };
    let panels: Vec<HistogramPanel> = of_method()
        .filter(|h| h.category.is_none())
        .take(PANELS)
        .map(|null| HistogramPanel {
            title: null.class.clone(),
            main: histogram(null, "null"),
            others: DRAWN
                .iter()
                .filter_map(|name| {
                    let found =
                        of_method().find(|h| h.class == null.class && h.category.as_deref() == Some(name))?;
                    Some(histogram(found, &spoken(name)))
                })
                .collect(),
        })
        .collect();
    Ok(Sheet {
        name: "sdd.svg".to_owned(),
        svg: histograms(
            "Distances between signatures: nulls (areas) and deformations (lines)",
            "distance of two signatures",
            all[0].largest,
            &panels,
        )?,
    })
}

/// The matrix that says most: of the harder protocol, the default preset, and the mean over all categories.
fn telling_matrix(all: &[ClassMatrix]) -> Option<ClassMatrix> {
    let all: Vec<&ClassMatrix> = all.iter().collect();
    let of_protocol = prefer(all, |m| &m.protocol, &["null", "hold"]);
    let of_method = prefer(of_protocol, |m| &m.method, &["default", "robust"]);
    let first = *of_method.first()?;
    if let Some(total) = of_method.iter().find(|m| m.category == TOTAL) {
        return Some((*total).clone());
    }
    let same: Vec<&&ClassMatrix> = of_method.iter().filter(|m| m.classes == first.classes).collect();
    let mean = |i: usize, j: usize| {
        let values: Vec<f64> = same
            .iter()
            .filter_map(|m| m.values.get(i)?.get(j).copied())
            .filter(|v| v.is_finite())
            .collect();
        values.iter().sum::<f64>() / values.len() as f64
    };
    let n = first.classes.len();
    Some(ClassMatrix {
        category: TOTAL.to_owned(),
        values: (0..n).map(|i| (0..n).map(|j| mean(i, j)).collect()).collect(),
        ..first.clone()
    })
}

/// Those of one kind: the first of `wanted` that there is, else the first there is.
fn prefer<'a>(
    from: Vec<&'a ClassMatrix>,
    kind: fn(&ClassMatrix) -> &str,
    wanted: &[&str],
) -> Vec<&'a ClassMatrix> {
    let there = |w: &&&str| from.iter().any(|m| kind(m) == **w);
    let Some(chosen) = wanted
        .iter()
        .find(there)
        .copied()
        .or(from.first().map(|m| kind(m)))
    else {
        return from;
    };
    from.iter().copied().filter(|m| kind(m) == chosen).collect()
}

/// Figure 5. `row_axis` says whose the rows are.
pub(super) fn dissimilarity(matrix: &ClassMatrix, row_axis: &str) -> Result<Sheet, FigureError> {
    let map = HeatMap {
        row_axis,
        column_axis: "class they are compared with",
        value: "mean score",
        rows: &matrix.classes,
        columns: &matrix.classes,
        values: &matrix.values,
        texts: None,
        shares: false,
    };
    let title = format!(
        "Dissimilarity of classes: {}, protocol {}",
        spoken(&matrix.method),
        matrix.protocol
    );
    Ok(Sheet {
        name: "dissimilarity.svg".to_owned(),
        svg: heat_map(&title, &map)?,
    })
}

/// Figure 6.
pub(super) fn class_embedding(matrix: &ClassMatrix) -> Result<Sheet, FigureError> {
    let embedded = classical_mds(between_classes(&matrix.values)?.as_ref())?;
    let points: Vec<EmbeddedPoint> = matrix
        .classes
        .iter()
        .enumerate()
        .map(|(i, class)| EmbeddedPoint {
            label: class.clone(),
            group: String::new(),
            at: (embedded.points[(i, 0)], embedded.points[(i, 1)]),
        })
        .collect();
    let title = format!(
        "Classes in the plane: {}, protocol {}; {:.0} % of the spread",
        spoken(&matrix.method),
        matrix.protocol,
        100.0 * embedded.explained
    );
    Ok(Sheet {
        name: "mds.svg".to_owned(),
        svg: embedding(&title, "root of the score", &points)?,
    })
}

/// `shot_noise` as words.
fn spoken(name: &str) -> String {
    name.replace('_', " ")
}
