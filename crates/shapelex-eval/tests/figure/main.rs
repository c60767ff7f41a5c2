//! Figures: well-formed SVG that says what it was given.

mod evaluation;
mod svg;
mod texts;

use shapelex_eval::benchmark::deform::Deformation;
use shapelex_eval::figure::{
    Bar, CostAxes, EmbeddedPoint, FigureError, GalleryRow, HeatMap, Histogram, HistogramPanel, RowView,
    Series, bars, between_classes, classical_mds, cost_curves, embedding, gallery, heat_map, histograms,
    precision_recall,
};
use shapelex_eval::sample::{ZooOptions, species};
use svg::{nothing_is_cut, says};

pub fn names(list: &[&str]) -> Vec<String> {
    list.iter().map(|&s| s.to_owned()).collect()
}

#[test]
fn a_gallery_shows_every_deformation_and_stays_small() {
    let options = ZooOptions {
        upright: true,
        ..ZooOptions::default()
    };
    let mut columns = names(&["null"]);
    columns.extend(Deformation::ALL.map(|d| d.name().replace('_', " ")));
    let rows: Vec<GalleryRow> = species(1, 4)
        .iter()
        .map(|kind| {
            let null = kind.pose(1, 0, &options).unwrap();
            let mut meshes = vec![Some(null.clone())];
            meshes.extend(Deformation::ALL.map(|d| Some(d.apply(&null, 4, 1))));
            GalleryRow {
                view: RowView::Shared,
                label: kind.name().to_owned(),
                meshes,
            }
        })
        .collect();
    let svg = gallery("Deformations at strength 4", &columns, &rows).unwrap();
    assert!(svg.len() < 2_000_000, "{} bytes", svg.len());
    assert!(svg.matches("<polygon").count() > 5000);
    let labels: Vec<&str> = columns.iter().map(String::as_str).collect();
    says(&svg, &labels);
    says(&svg, &[&rows[0].label, &rows[3].label]);
    // The same data, the same figure.
    assert_eq!(
        gallery("Deformations at strength 4", &columns, &rows).unwrap(),
        svg
    );
    assert!(matches!(
        gallery("x", &columns[..3], &rows),
        Err(FigureError::Shape {
            expected: 3,
            found: 10,
            ..
        })
    ));
    assert!(matches!(
        gallery("x", &columns, &[]),
        Err(FigureError::Empty { .. })
    ));
}

#[test]
fn histograms_name_panels_and_lines() {
    let bell = |middle: f64| -> Vec<f64> {
        let raw: Vec<f64> = (0..100)
            .map(|i| (-(f64::from(i) - middle).powi(2) / 150.0).exp())
            .collect();
        let sum: f64 = raw.iter().sum();
        raw.iter().map(|v| v / sum).collect()
    };
    let panel = |title: &str, middle: f64| HistogramPanel {
        title: title.to_owned(),
        main: Histogram {
            label: "null".to_owned(),
            shares: bell(middle),
        },
        others: ["noise", "view", "holes & <cuts>"]
            .iter()
            .enumerate()
            .map(|(i, label)| Histogram {
                label: (*label).to_owned(),
                shares: bell(middle + 4.0 * (i as f64 + 1.0)),
            })
            .collect(),
    };
    let panels = [
        panel("cat", 20.0),
        panel("dog", 40.0),
        panel("horse", 30.0),
        panel("wolf", 33.0),
        panel("man", 55.0),
    ];
    let svg = histograms(
        "Distances of signatures",
        "distance of two signatures",
        0.8,
        &panels,
    )
    .unwrap();
    says(
        &svg,
        &[
            "cat",
            "man",
            "noise",
            "holes &amp; &lt;cuts&gt;",
            "distance of two signatures",
        ],
    );
    assert!(matches!(
        histograms("x", "y", 1.0, &[]),
        Err(FigureError::Empty { .. })
    ));
}

pub const CLASSES: [&str; 6] = ["man", "woman", "cat", "lioness", "horse", "elephant"];

pub fn errors() -> Vec<Vec<f64>> {
    let places: [[f64; 2]; 6] = [
        [0.0, 0.0],
        [0.4, 0.1],
        [3.0, 1.0],
        [3.4, 1.5],
        [2.0, 3.0],
        [1.0, 4.0],
    ];
    (0..6)
        .map(|i| {
            (0..6)
                .map(|j| {
                    let (a, b) = (places[i], places[j]);
                    0.377 + 0.002 * ((a[0] - b[0]).powi(2) + (a[1] - b[1]).powi(2))
                })
                .collect()
        })
        .collect()
}

#[test]
fn a_heat_map_names_rows_columns_and_values() {
    let mut values = errors();
    values[2][5] = f64::NAN;
    let labels = names(&CLASSES);
    let map = HeatMap {
        row_axis: "class of the query",
        column_axis: "class of the dictionary",
        value: "mean objective",
        rows: &labels,
        columns: &labels,
        values: &values,
        texts: None,
        shares: false,
    };
    let svg = heat_map("Dissimilarity of classes", &map).unwrap();
    says(&svg, &CLASSES);
    says(&svg, &["class of the query", "mean objective", "–", "0.3770"]);
    let long = "a class with a name that is much longer than most names are".to_owned();
    let odd = HeatMap {
        rows: std::slice::from_ref(&long),
        values: &values[..1],
        ..map.clone()
    };
    let svg = heat_map("One row", &odd).unwrap();
    says(&svg, &[&long]);
    nothing_is_cut(&svg);
    let ragged = HeatMap {
        columns: &labels[..4],
        ..map
    };
    assert!(matches!(
        heat_map("x", &ragged),
        Err(FigureError::Shape {
            expected: 4,
            found: 6,
            ..
        })
    ));
}

#[test]
fn an_embedding_names_its_points() {
    let distances = between_classes(&errors()).unwrap();
    let embedded = classical_mds(distances.as_ref()).unwrap();
    // The made-up classes lie in a plane.
    assert!(embedded.explained > 0.999, "{}", embedded.explained);
    let points: Vec<EmbeddedPoint> = CLASSES
        .iter()
        .enumerate()
        .map(|(i, name)| EmbeddedPoint {
            label: (*name).to_owned(),
            group: String::new(),
            at: (embedded.points[(i, 0)], embedded.points[(i, 1)]),
        })
        .collect();
    says(
        &embedding("Classes in the plane", "√objective", &points).unwrap(),
        &CLASSES,
    );
    let many: Vec<EmbeddedPoint> = (0..90)
        .map(|i| EmbeddedPoint {
            label: format!("shape{i}"),
            group: CLASSES[i % 6].to_owned(),
            at: ((i as f64 * 0.7).sin() * i as f64, (i as f64 * 1.3).cos() * 40.0),
        })
        .collect();
    let svg = embedding("Shapes in the plane", "units", &many).unwrap();
    says(&svg, &CLASSES);
    assert!(!svg.contains(">shape3<"));
    assert!(matches!(embedding("x", "y", &[]), Err(FigureError::Empty { .. })));
}

#[test]
fn curves_name_their_series() {
    let curve = |label: &str, power: f64| Series {
        label: label.to_owned(),
        points: (1..=40)
            .map(|i| (f64::from(i) / 40.0, 1.0 - (f64::from(i) / 40.0).powf(power)))
            .collect(),
    };
    let methods = [
        curve("robust", 9.0),
        curve("default", 6.0),
        curve("Shape DNA", 3.0),
        curve("bag of words, SI-HKS", 2.0),
        curve("SDD", 1.5),
    ];
    says(
        &precision_recall("Precision and recall", &methods).unwrap(),
        &["robust", "Shape DNA", "bag of words, SI-HKS"],
    );
    let cost = |label: &str, exponent: f64, factor: f64| Series {
        label: label.to_owned(),
        points: [1e3, 3e3, 1e4, 3e4, 1e5, 1e6]
            .iter()
            .map(|x: &f64| (*x, factor * x.powf(exponent)))
            .collect(),
    };
    let svg = cost_curves(
        "Cost of a query",
        CostAxes {
            x: "vertices",
            y: "time (s)",
        },
        &[cost("parse and clean", 1.0, 1e-6), cost("eigenpairs", 1.31, 2e-6)],
    )
    .unwrap();
    says(&svg, &["vertices", "time (s)", "eigenpairs ~ x^1.31", "10k"]);
    assert!(matches!(
        precision_recall("x", &[]),
        Err(FigureError::Empty { .. })
    ));
}

#[test]
fn bars_carry_their_values() {
    let list: Vec<Bar> = CLASSES
        .iter()
        .enumerate()
        .map(|(i, name)| Bar {
            label: (*name).to_owned(),
            value: 0.377 + 0.01 * i as f64,
        })
        .collect();
    says(
        &bars("cat3.off", "mean objective", &list).unwrap(),
        &["man", "0.37700", "0.42700"],
    );
    assert!(matches!(bars("x", "y", &[]), Err(FigureError::Empty { .. })));
}

#[test]
fn a_report_gives_the_papers_figures() {
    use shapelex_eval::benchmark::report::{
        BenchmarkReport, ClassMatrix, DistanceHistogram, PrecisionRecall, TOTAL,
    };
    use shapelex_eval::figure::{benchmark_figures, deformation_gallery};

    let histogram = |category: Option<&str>| DistanceHistogram {
        method: "sdd_wks".to_owned(),
        class: "cat".to_owned(),
        category: category.map(str::to_owned),
        largest: 0.5,
        shares: vec![0.25; 4],
    };
    let matrix = |method: &str, category: &str, offset: f64| ClassMatrix {
        protocol: "null".to_owned(),
        method: method.to_owned(),
        category: category.to_owned(),
        classes: names(&CLASSES),
        values: errors()
            .iter()
            .map(|row| row.iter().map(|v| v + offset).collect())
            .collect(),
    };
    let report = BenchmarkReport {
        histograms: vec![histogram(None), histogram(Some("view")), histogram(Some("scale"))],
        dissimilarity: vec![
            matrix("shape_dna", "noise", 5.0),
            matrix("default", "noise", 0.0),
            matrix("default", "shot_noise", 0.2),
        ],
        precision_recall: vec![PrecisionRecall {
            method: "bow_si_hks".to_owned(),
            category: TOTAL.to_owned(),
            recall: vec![0.0, 0.5, 1.0],
            precision: vec![1.0, 0.8, 0.3],
        }],
        ..BenchmarkReport::default()
    };
    let sheets = benchmark_figures(&report).unwrap();
    let files: Vec<&str> = sheets.iter().map(|s| s.name.as_str()).collect();
    assert_eq!(
        files,
        ["sdd.svg", "dissimilarity.svg", "mds.svg", "precision_recall.svg"]
    );
    says(&sheets[0].svg, &["cat", "view"]);
    // The mean over the categories of the default preset: 0.377 + 0.1 on the diagonal.
    says(&sheets[1].svg, &["elephant", "0.4770"]);
    says(&sheets[2].svg, &CLASSES);
    says(&sheets[3].svg, &["bow si hks"]);
    assert_eq!(benchmark_figures(&BenchmarkReport::default()).unwrap(), []);

    let options = ZooOptions {
        upright: true,
        min_vertices: 300,
        max_vertices: 400,
    };
    let nulls: Vec<_> = species(1, 6)
        .iter()
        .map(|kind| (kind.name().to_owned(), kind.pose(1, 0, &options).unwrap()))
        .collect();
    let named: Vec<_> = nulls.iter().map(|(name, mesh)| (name.as_str(), mesh)).collect();
    let sheet = deformation_gallery(&named, 3, &|at, kind| Some(kind.apply(named[at].1, 3, 1))).unwrap();
    assert_eq!(sheet.name, "gallery.svg");
    // Four of the six, evenly spread.
    says(
        &sheet.svg,
        &[named[0].0, named[1].0, named[3].0, named[4].0, "shot noise"],
    );
    assert!(!sheet.svg.contains(&format!(">\n{}\n<", named[2].0)));
}
