//! Figures: well-formed SVG that says what it was given.

use shapelex::benchmark::deform::Deformation;
use shapelex::figure::{
    Bar, ClassAccuracy, CostAxes, EmbeddedPoint, FigureError, GalleryRow, HeatMap, Histogram, HistogramPanel,
    RowView, Series, bars, between_classes, class_accuracy, classical_mds, cost_curves, coverage, embedding,
    gallery, heat_map, histograms, precision_recall,
};
use shapelex::sample::{ZooOptions, species};

/// Checks that every tag is closed in order, that attributes are quoted, and that text is escaped; returns the texts.
fn well_formed(svg: &str) -> Vec<String> {
    let mut open: Vec<&str> = Vec::new();
    let mut texts = Vec::new();
    let mut rest = svg;
    while let Some(at) = rest.find('<') {
        let text = rest[..at].trim();
        if !text.is_empty() {
            for (i, _) in text.match_indices('&') {
                let entity = &text[i..text[i..].find(';').map_or(i, |end| i + end + 1)];
                assert!(
                    ["&amp;", "&lt;", "&gt;", "&quot;", "&apos;"].contains(&entity),
                    "{text}"
                );
            }
            texts.push(text.to_owned());
        }
        let end = at + rest[at..].find('>').expect("an unclosed tag");
        let tag = &rest[at + 1..end];
        rest = &rest[end + 1..];
        assert!(!tag.contains('<'), "{tag}");
        if let Some(name) = tag.strip_prefix('/') {
            assert_eq!(open.pop(), Some(name));
            continue;
        }
        assert_eq!(tag.matches('"').count() % 2, 0, "{tag}");
        let name = tag.split([' ', '/']).next().unwrap();
        for attribute in tag.split('"').step_by(2).map(str::trim) {
            let attribute = attribute.trim_start_matches(name).trim();
            assert!(
                attribute.is_empty() || attribute == "/" || attribute.ends_with('='),
                "{tag}"
            );
        }
        if !tag.ends_with('/') {
            open.push(name);
        }
    }
    assert!(open.is_empty(), "not closed: {open:?}");
    assert!(rest.trim().is_empty(), "{rest}");
    assert!(!svg.contains("NaN") && !svg.contains("inf\""));
    texts
}

/// An attribute of a tag.
fn attribute<'a>(tag: &'a str, name: &str) -> Option<&'a str> {
    let rest = &tag[tag.find(&format!(" {name}=\""))? + name.len() + 3..];
    rest.split('"').next()
}

/// Checks that every text begins and ends inside the figure, by Helvetica's mean width of a letter.
fn nothing_is_cut(svg: &str) {
    let (_, drawn) = svg.split_once("viewBox=\"0 0 ").unwrap();
    let size: Vec<f64> = drawn
        .split('"')
        .next()
        .unwrap()
        .split(' ')
        .map(|n| n.parse().unwrap())
        .collect();
    let mut seen = 0;
    for piece in svg.split("<text ").skip(1) {
        let (tag, rest) = piece.split_once('>').unwrap();
        let tag = format!(" {tag}");
        let text = rest.split('<').next().unwrap().trim();
        let number = |name: &str| attribute(&tag, name).unwrap().parse::<f64>().unwrap();
        let (x, y) = (number("x"), number("y"));
        let length = 0.5 * number("font-size") * text.chars().count() as f64;
        let before = match attribute(&tag, "text-anchor") {
            Some("middle") => 0.5,
            Some("end") => 1.0,
            _ => 0.0,
        };
        let (from, to) = (-before * length, (1.0 - before) * length);
        let (low, high, limit) = if tag.contains("rotate(270") || tag.contains("rotate(-90") {
            (y - to, y - from, size[1])
        } else {
            (x + from, x + to, size[0])
        };
        assert!(
            low >= -1.0 && high <= limit + 1.0,
            "'{text}' from {low} to {high} of {limit}"
        );
        seen += 1;
    }
    assert!(seen > 0);
}

fn says(svg: &str, labels: &[&str]) {
    let texts = well_formed(svg);
    nothing_is_cut(svg);
    for label in labels {
        assert!(texts.iter().any(|t| t == label), "no '{label}' in {texts:?}");
    }
    assert!(svg.starts_with("<svg xmlns="));
    assert!(svg.contains("<title>"));
    save(svg);
}

/// With `SHAPELEX_FIGURES=DIR` the tests leave their figures in DIR, to be looked at.
fn save(svg: &str) {
    let Some(dir) = std::env::var_os("SHAPELEX_FIGURES") else {
        return;
    };
    let title = svg.split("<title>").nth(1).unwrap().split('<').next().unwrap();
    let name: String = title.chars().filter(char::is_ascii_alphanumeric).collect();
    std::fs::write(std::path::Path::new(&dir).join(format!("{name}.svg")), svg).unwrap();
}

fn names(list: &[&str]) -> Vec<String> {
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

const CLASSES: [&str; 6] = ["man", "woman", "cat", "lioness", "horse", "elephant"];

fn errors() -> Vec<Vec<f64>> {
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
fn an_evaluation_gives_confusion_dissimilarity_and_embedding() {
    use shapelex::benchmark::{Evaluation, Protocol, QueryResult};
    use shapelex::figure::evaluation_figures;

    let queries: Vec<QueryResult> = errors()
        .iter()
        .enumerate()
        .map(|(i, row)| {
            let mut ranked: Vec<(String, f64)> =
                names(&CLASSES).into_iter().zip(row.iter().copied()).collect();
            ranked.sort_by(|a, b| a.1.total_cmp(&b.1));
            QueryResult {
                class: CLASSES[i].to_owned(),
                name: "0".to_owned(),
                ranked,
                correct: true,
                true_rank: 1,
                error_margin: -0.1,
            }
        })
        .collect();
    let mut evaluation = Evaluation {
        protocol: Protocol::EvenOdd,
        correct: 6,
        total: 6,
        queries,
        confusion: std::collections::BTreeMap::new(),
        not_queried: 0,
    };
    let sheets = evaluation_figures(&evaluation).unwrap();
    let files: Vec<&str> = sheets.iter().map(|s| s.name.as_str()).collect();
    assert_eq!(
        files,
        [
            "even-odd-confusion.svg",
            "even-odd-accuracy.svg",
            "even-odd-dissimilarity.svg",
            "even-odd-mds.svg"
        ]
    );
    says(
        &sheets[0].svg,
        &["Answers of even/odd: 6 of 6 right", "elephant", "1"],
    );
    says(&sheets[0].svg, &["share of the class&apos;s queries", "100 %"]);
    says(&sheets[1].svg, &["Accuracy by class, even/odd", "1 of 1, 100 %"]);
    says(&sheets[2].svg, &["0.3770", "class of the queries"]);
    assert!(
        !sheets[2].svg.contains("deformed"),
        "these are no deformed shapes"
    );
    says(&sheets[3].svg, &CLASSES);
    // A class that some were not compared with leaves a gap, and no plane.
    evaluation.queries[0].ranked.truncate(3);
    assert_eq!(evaluation_figures(&evaluation).unwrap().len(), 3);
    evaluation.queries.clear();
    assert!(evaluation_figures(&evaluation).is_err());
}

#[test]
fn a_report_gives_the_papers_figures() {
    use shapelex::benchmark::report::{
        BenchmarkReport, ClassMatrix, DistanceHistogram, PrecisionRecall, TOTAL,
    };
    use shapelex::figure::{benchmark_figures, deformation_gallery};

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

#[test]
fn long_names_are_whole_in_every_figure() {
    let long = "a creature with an uncommonly long and winding name".to_owned();
    let list = vec![
        Bar {
            label: long.clone(),
            value: 0.4,
        },
        Bar {
            label: "W".repeat(60),
            value: 0.5,
        },
    ];
    says(&bars("Bars", "mean objective", &list).unwrap(), &[&long]);
    let accuracy = [ClassAccuracy {
        class: long.clone(),
        correct: 3,
        total: 7,
    }];
    says(
        &class_accuracy("Accuracy", &accuracy).unwrap(),
        &[&long, "3 of 7, 43 %"],
    );
    let series = [Series {
        label: long.clone(),
        points: vec![(0.5, 0.9), (1.0, 0.2)],
    }];
    says(&precision_recall("Curves", &series).unwrap(), &[&long]);
    says(&coverage("Coverage", &series).unwrap(), &[&long, "as promised"]);
    let points: Vec<EmbeddedPoint> = [(0.0, 0.0), (1.0, 0.5), (-1.0, 0.1)]
        .map(|at| EmbeddedPoint {
            label: long.clone(),
            group: String::new(),
            at,
        })
        .to_vec();
    says(&embedding("Plane", "units", &points).unwrap(), &[&long]);
    let panel = HistogramPanel {
        title: long.clone(),
        main: Histogram {
            label: "null".to_owned(),
            shares: vec![0.004, 0.006],
        },
        others: Vec::new(),
    };
    says(
        &histograms("Distances", "distance", 0.8, &[panel]).unwrap(),
        &[&long],
    );
    let title =
        "A title that is much wider than the one small bar below it, and that is still read to its end";
    says(&bars(title, "value", &list[..1]).unwrap(), &[title]);
}

/// The texts of ticks that are written more than once in one figure.
fn repeated_numbers(svg: &str, unit: &str) -> Vec<String> {
    let texts = well_formed(svg);
    let numbers: Vec<&String> = texts
        .iter()
        .filter(|t| t.ends_with(unit) && t.len() > unit.len())
        .collect();
    let twice = |t: &&&String| numbers.iter().filter(|other| other == t).count() > 1;
    numbers.iter().filter(twice).map(|t| (**t).clone()).collect()
}

#[test]
fn ticks_are_whole_for_counts_and_never_written_twice() {
    // Shares below one percent were all written "0 %" or "1 %".
    let panel = HistogramPanel {
        title: "small".to_owned(),
        main: Histogram {
            label: "null".to_owned(),
            shares: vec![0.004, 0.006, 0.011],
        },
        others: Vec::new(),
    };
    let svg = histograms("Distances", "distance", 0.8, &[panel]).unwrap();
    assert_eq!(repeated_numbers(&svg, " %"), Vec::<String>::new());
    // Counts up to 2 had ticks at 0.5 and 1.5.
    let labels = names(&["a", "b"]);
    let values = [vec![2.0, 0.0], vec![1.0, 1.0]];
    let map = HeatMap {
        row_axis: "row",
        column_axis: "column",
        value: "queries",
        rows: &labels,
        columns: &labels,
        values: &values,
        texts: None,
        shares: false,
    };
    let svg = heat_map("Counts", &map).unwrap();
    let ticks = well_formed(&svg);
    assert!(
        ticks
            .iter()
            .all(|t| t.parse::<f64>().is_err() || !t.contains('.')),
        "{ticks:?}"
    );
}

#[test]
fn a_confusion_is_coloured_by_the_share_of_the_class() {
    use shapelex::benchmark::{Evaluation, Protocol, QueryResult};
    use shapelex::figure::evaluation_figures;

    let query = |class: &str, answered: &str, i: usize| QueryResult {
        class: class.to_owned(),
        name: i.to_string(),
        ranked: vec![(answered.to_owned(), 0.1), ("other".to_owned(), 0.2)],
        correct: class == answered,
        true_rank: 1 + usize::from(class != answered),
        error_margin: 0.0,
    };
    // A hundred queries of one class and two of another, all right: both rows are equally right.
    let mut queries: Vec<QueryResult> = (0..100).map(|i| query("many", "many", i)).collect();
    queries.extend((0..2).map(|i| query("few", "few", i)));
    let evaluation = Evaluation {
        protocol: Protocol::LeaveOneOut,
        correct: 102,
        total: 102,
        queries,
        confusion: std::collections::BTreeMap::new(),
        not_queried: 0,
    };
    let svg = &evaluation_figures(&evaluation).unwrap()[0].svg;
    says(svg, &["100", "2"]);
    let brightest = svg.matches("fill=\"#FEE838\"").count();
    assert!(brightest >= 2, "{brightest} cells of the brightest colour");
}

#[test]
fn the_worst_queries_are_shown_beside_what_they_were_taken_for() {
    use shapelex::figure::{WorstQuery, worst_queries};
    let options = ZooOptions {
        upright: true,
        min_vertices: 900,
        max_vertices: 1200,
    };
    let meshes: Vec<_> = species(1, 3)
        .iter()
        .map(|kind| kind.pose(1, 0, &options).unwrap())
        .collect();
    let worst = vec![
        WorstQuery {
            label: "cat-03 as a class with a long name".to_owned(),
            query: Some(meshes[0].clone()),
            answered: Some(meshes[1].clone()),
            own: Some(meshes[2].clone()),
        },
        WorstQuery {
            label: "dog-01".to_owned(),
            query: Some(meshes[1].clone()),
            answered: None,
            own: Some(meshes[0].clone()),
        },
    ];
    let sheet = worst_queries("even/odd", worst).unwrap();
    assert_eq!(sheet.name, "even-odd-worst.svg");
    says(
        &sheet.svg,
        &[
            "query",
            "answered class",
            "own class",
            "cat-03 as a class with a long name",
        ],
    );
}
