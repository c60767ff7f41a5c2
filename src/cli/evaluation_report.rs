//! An evaluation as text.

use super::evaluation::{Outcome, Report};
use super::output::table;
use shapelex_eval::benchmark::retrieval::RetrievalOutcome;
use shapelex_eval::benchmark::{AtLevel, Estimate, OpenSet, Share};

/// Confusion matrices with more classes than this do not fit a screen; they are listed instead.
const MATRIX_CLASSES: usize = 26;

/// The whole report.
pub fn text(report: &Report) -> String {
    let mut parts = vec![format!(
        "{} shapes in {} classes, {:.1} s",
        report.shapes,
        report.classes.len(),
        report.seconds
    )];
    if !report.left_out.is_empty() {
        parts.push(format!(
            "left out, too few shapes: {}",
            report.left_out.join(", ")
        ));
    }
    for refused in &report.refused {
        parts.push(format!("refused: {}: {}", refused.file, refused.reason));
    }
    parts.extend(report.protocols.iter().map(outcome));
    if !report.protocols.is_empty() {
        parts.push(summary(report));
    }
    parts.extend(report.retrieval.as_ref().map(retrieval));
    parts.extend(report.open_set.as_ref().map(open_set));
    parts.join("\n")
}

fn retrieval(outcome: &RetrievalOutcome) -> String {
    let m = &outcome.measures;
    let values = [
        m.nearest_neighbour,
        m.first_tier,
        m.second_tier,
        m.e_measure,
        m.dcg,
        m.average_precision,
    ];
    let mut row = vec![outcome.total.to_string()];
    row.extend(values.map(|v| format!("{v:.3}")));
    let header = [
        ">queries",
        ">nearest neighbour",
        ">first tier",
        ">second tier",
        ">E-measure",
        ">DCG",
        ">mAP",
    ];
    format!("\nretrieval, shape against shape\n{}", table(&header, &[row]))
}

fn open_set(outcome: &OpenSet) -> String {
    let row = |what: &str, share: &Share| {
        vec![
            what.to_owned(),
            share.count.to_string(),
            share.total.to_string(),
            format!("{:.1} %", 100.0 * share.value()),
        ]
    };
    let mut rows = vec![
        row("the possible classes hold the true one", &outcome.covered),
        row(
            "of an indexed class, answered none of these",
            &outcome.refused_known,
        ),
        row(
            "of a class left out, answered none of these",
            &outcome.refused_unknown,
        ),
    ];
    for (class, share) in &outcome.refused_by_class {
        rows.push(row(&format!("    {class}"), share));
    }
    let mut text = format!(
        "\nopen set, {:.2} possible classes on average\n{}",
        outcome.mean_set_size,
        table(&["", ">shapes", ">of", ">"], &rows)
    );
    if !outcome.by_level.is_empty() {
        text += &format!("\n\n{}", by_level(&outcome.by_level));
    }
    text
}

/// How often the possible classes hold the true one, beside what their level promises.
fn by_level(levels: &[AtLevel]) -> String {
    let rows: Vec<Vec<String>> = levels
        .iter()
        .map(|at| {
            vec![
                format!("{:.2}", at.level),
                format!("{:.0} %", 100.0 * (1.0 - at.level)),
                format!("{:.1} %", 100.0 * at.covered.value()),
                at.covered.count.to_string(),
                at.covered.total.to_string(),
            ]
        })
        .collect();
    let header = [
        ">p-value above",
        ">promised",
        ">hold the true class",
        ">shapes",
        ">of",
    ];
    table(&header, &rows)
}

fn summary(report: &Report) -> String {
    let rows: Vec<Vec<String>> = report
        .protocols
        .iter()
        .map(|o| {
            let e = &o.evaluation;
            vec![
                o.name.to_owned(),
                e.correct.to_string(),
                e.total.to_string(),
                format!("{:.2} %", 100.0 * o.top1),
                estimate(&e.measures.nearest_neighbour),
                estimate(&e.measures.first_tier),
                estimate(&e.measures.dcg),
            ]
        })
        .collect();
    let header = [
        "protocol",
        ">right",
        ">queries",
        ">top-1",
        ">nearest neighbour (95 %)",
        ">first tier (95 %)",
        ">DCG (95 %)",
    ];
    format!("\n{}", table(&header, &rows))
}

fn estimate(estimate: &Estimate) -> String {
    format!("{:.3} ({:.3}–{:.3})", estimate.mean, estimate.low, estimate.high)
}

fn outcome(outcome: &Outcome) -> String {
    let e = &outcome.evaluation;
    let mut text = format!(
        "\n{}: {} of {} right ({:.2} %)",
        outcome.name,
        e.correct,
        e.total,
        100.0 * outcome.top1
    );
    if e.not_queried > 0 {
        text += &format!(
            "; {} not queried, as no other shape of their class trains",
            e.not_queried
        );
    }
    text += "\n";
    text += &confusion(outcome);
    if !e.queries.is_empty() {
        let rows: Vec<Vec<String>> = e
            .queries
            .iter()
            .map(|q| {
                let (answered, score) = q.ranked.first().cloned().unwrap_or_default();
                vec![
                    q.class.clone(),
                    q.name.clone(),
                    answered,
                    format!("{score:.5}"),
                    q.true_rank.to_string(),
                    format!("{:+.4}", q.error_margin),
                ]
            })
            .collect();
        text += "\nworst queries; an error margin above 0 is a mistake\n";
        text += &table(
            &[
                "class",
                "shape",
                "answered",
                ">score",
                ">rank of the true",
                ">error margin",
            ],
            &rows,
        );
    }
    text
}

/// Rows are true classes, columns answers, in the same order.
fn confusion(outcome: &Outcome) -> String {
    let confusion = &outcome.evaluation.confusion;
    let mut classes: Vec<&str> = confusion.keys().map(String::as_str).collect();
    for answers in confusion.values() {
        for answer in answers.keys() {
            if !classes.contains(&answer.as_str()) {
                classes.push(answer);
            }
        }
    }
    if classes.len() > MATRIX_CLASSES {
        let mistakes: Vec<String> = confusion
            .iter()
            .flat_map(|(class, answers)| {
                answers
                    .iter()
                    .filter(move |(answer, _)| *answer != class)
                    .map(move |(answer, n)| format!("{class} taken for {answer}: {n}"))
            })
            .collect();
        return if mistakes.is_empty() {
            "no class was taken for another".to_owned()
        } else {
            mistakes.join("\n")
        };
    }
    let numbers: Vec<String> = (1..=classes.len()).map(|i| format!(">{i}")).collect();
    let mut header = vec![">", "class"];
    header.extend(numbers.iter().map(String::as_str));
    let rows: Vec<Vec<String>> = classes
        .iter()
        .enumerate()
        .filter_map(|(i, class)| {
            let answers = confusion.get(*class)?;
            let mut row = vec![(i + 1).to_string(), (*class).to_owned()];
            row.extend(
                classes
                    .iter()
                    .map(|answer| answers.get(*answer).map_or("·".to_owned(), usize::to_string)),
            );
            Some(row)
        })
        .collect();
    table(&header, &rows)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_open_set_has_a_row_per_level() {
        let at = |level, count| AtLevel {
            level,
            covered: Share { count, total: 20 },
        };
        let outcome = OpenSet {
            by_level: vec![at(0.05, 19), at(0.1, 17)],
            ..OpenSet::default()
        };
        let text = open_set(&outcome);
        let row = |level: &str| {
            text.lines()
                .find(|line| line.trim_start().starts_with(level))
                .unwrap()
        };
        let words = |line: &str| -> Vec<String> { line.split_whitespace().map(str::to_owned).collect() };
        assert_eq!(words(row("0.05")), ["0.05", "95", "%", "95.0", "%", "19", "20"]);
        assert_eq!(words(row("0.10")), ["0.10", "90", "%", "85.0", "%", "17", "20"]);
    }
}
