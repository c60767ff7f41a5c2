//! Texts are whole, and numbers along axes are written once.

use crate::names;
use crate::svg::{says, well_formed};
use shapelex_eval::figure::{
    Bar, ClassAccuracy, EmbeddedPoint, HeatMap, Histogram, HistogramPanel, Series, bars, class_accuracy,
    coverage, embedding, heat_map, histograms, precision_recall,
};

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
