//! The figures of an evaluation.

use crate::svg::says;
use crate::{CLASSES, errors, names};
use shapelex_eval::sample::{ZooOptions, species};

#[test]
fn an_evaluation_gives_confusion_dissimilarity_and_embedding() {
    use shapelex_eval::benchmark::{Evaluation, Protocol, QueryResult};
    use shapelex_eval::figure::evaluation_figures;

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
        measures: Default::default(),
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
fn a_confusion_is_coloured_by_the_share_of_the_class() {
    use shapelex_eval::benchmark::{Evaluation, Protocol, QueryResult};
    use shapelex_eval::figure::evaluation_figures;

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
        measures: Default::default(),
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
    use shapelex_eval::figure::{WorstQuery, worst_queries};
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
