//! A benchmark's tables: for the terminal, as Markdown, CSV and JSON.

use super::CliError;
use super::output::table;
use shapelex_eval::benchmark::measures::RetrievalMeasures;
use shapelex_eval::benchmark::paper::{PaperRow, QUERIES, TABLE_1};
use shapelex_eval::benchmark::report::{BenchmarkReport, ClassMatrix, Count, Counts, PrecisionRecall, TOTAL};
use shapelex_eval::benchmark::{Category, Outcome, Robustness};
use std::path::Path;

/// One method's column of the paper's table.
type Pick = fn(&PaperRow) -> usize;

/// Adds a unit's outcome to the report. `at` is protocol, method and category.
pub fn add(report: &mut BenchmarkReport, at: (Robustness, &str, &str), classes: &[String], outcome: Outcome) {
    let (protocol, method, category) = (at.0.name().to_owned(), at.1.to_owned(), at.2.to_owned());
    let counts = report
        .counts
        .entry(protocol.clone())
        .or_default()
        .entry(method.clone())
        .or_default();
    counts.insert(category.clone(), outcome.count);
    let total = counts.entry(TOTAL.to_owned()).or_default();
    total.correct += outcome.count.correct;
    total.total += outcome.count.total;
    report
        .mistakes
        .entry(protocol.clone())
        .or_default()
        .entry(method.clone())
        .or_default()
        .extend(outcome.mistakes);
    report.histograms.extend(outcome.histograms);
    if !outcome.matrix.is_empty() {
        report.dissimilarity.push(ClassMatrix {
            protocol,
            method: method.clone(),
            category: category.clone(),
            classes: classes.to_vec(),
            values: outcome.matrix,
        });
    }
    if let Some(measures) = outcome.measures {
        let all = report.retrieval.entry(method.clone()).or_default();
        all.remove(TOTAL);
        all.insert(category, measures);
        let parts: Vec<RetrievalMeasures> = all.values().cloned().collect();
        all.insert(TOTAL.to_owned(), RetrievalMeasures::mean(&parts));
        report.precision_recall.retain(|curve| curve.method != method);
        report
            .precision_recall
            .extend(all.iter().map(|(category, m)| PrecisionRecall {
                method: method.clone(),
                category: category.clone(),
                recall: RetrievalMeasures::recalls(),
                precision: m.precision.clone(),
            }));
    }
}

/// A table before it has a form: a title, a header (`>` aligns to the right) and rows.
struct Sheet {
    title: String,
    header: Vec<String>,
    rows: Vec<Vec<String>>,
}

/// All tables for the terminal.
pub fn text(report: &BenchmarkReport) -> String {
    let mut parts = vec![heading(report)];
    for sheet in sheets(report) {
        let header: Vec<&str> = sheet.header.iter().map(String::as_str).collect();
        parts.push(format!("\n{}\n{}", sheet.title, table(&header, &sheet.rows)));
    }
    parts.join("\n")
}

fn heading(report: &BenchmarkReport) -> String {
    let nulls: Vec<String> = report
        .nulls
        .iter()
        .map(|n| format!("{} ({})", n.class, n.vertices))
        .collect();
    let same: Vec<String> = report.same.iter().map(|g| g.join(" = ")).collect();
    let mut text = format!(
        "{} null shapes (vertices): {}\nseed {}, ",
        nulls.len(),
        nulls.join(", "),
        report.seed
    );
    if report.query_samples > 0 {
        text += &format!("{} signatures coded per query, ", report.query_samples);
    }
    if !same.is_empty() {
        text += &format!("counted as the same: {}, ", same.join("; "));
    }
    text + &format!("{:.0} s", report.seconds)
}

fn sheets(report: &BenchmarkReport) -> Vec<Sheet> {
    let mut sheets: Vec<Sheet> = Robustness::ALL
        .iter()
        .filter(|p| report.counts.contains_key(p.name()))
        .map(|&p| counts_sheet(report, p))
        .collect();
    if !report.retrieval.is_empty() {
        sheets.push(measures_sheet(report));
    }
    sheets.push(cost_sheet(report));
    sheets
}

/// Methods in the order in which they were run.
fn methods(report: &BenchmarkReport) -> Vec<&str> {
    let names = report.costs.iter().map(|c| c.method.as_str());
    names.filter(|&m| m != "describe").collect()
}

/// Categories of a protocol, in the order of the paper.
fn categories(counts: &Counts) -> Vec<&'static str> {
    let all = Category::PAPER
        .iter()
        .chain(&Category::POSED)
        .chain(&Category::SIMILARITY);
    all.map(|c| c.name())
        .filter(|c| counts.contains_key(*c))
        .collect()
}

fn counts_sheet(report: &BenchmarkReport, protocol: Robustness) -> Sheet {
    let by_method = &report.counts[protocol.name()];
    let columns = by_method.values().next().map(categories).unwrap_or_default();
    let sizes: Vec<usize> = columns
        .iter()
        .filter_map(|c| by_method.values().next()?.get(*c).map(|n| n.total))
        .collect();
    let mut header = vec!["method".to_owned()];
    header.extend(columns.iter().map(|c| format!(">{c}")));
    header.extend([">total", ">share", ">95 % interval"].map(str::to_owned));
    let mut rows = Vec::new();
    // The paper's rows stand where the categories are its own and as large as its own.
    let comparable = matches!(protocol, Robustness::Hold | Robustness::Retrieval);
    if comparable && sizes.iter().all(|&n| n == QUERIES) {
        let picks: [(&str, Pick); 3] = [
            ("paper: SDD", |r| r.signature_distances),
            ("paper: Shape DNA", |r| r.shape_dna),
            ("paper: sparse coding", |r| r.sparse_coding),
        ];
        for (name, pick) in picks {
            let cells: Option<Vec<usize>> = columns
                .iter()
                .map(|c| TABLE_1.iter().find(|r| r.deformation.name() == *c).map(pick))
                .collect();
            if let Some(cells) = cells {
                let sum = cells.iter().sum();
                let total = Count {
                    correct: sum,
                    total: QUERIES * cells.len(),
                };
                let cells = cells.iter().map(usize::to_string).collect();
                rows.push(row(name, cells, total));
            }
        }
    }
    for method in methods(report) {
        if let Some(counts) = by_method.get(method) {
            let cell = |c: &&str| counts.get(*c).map_or("–".to_owned(), |n| n.correct.to_string());
            let total = counts.get(TOTAL).copied().unwrap_or_default();
            rows.push(row(method, columns.iter().map(cell).collect(), total));
        }
    }
    let sizes = match sizes.iter().all(|n| Some(n) == sizes.first()) {
        true => sizes.first().map_or(String::new(), |n| format!(" of {n} each")),
        false => format!(" of {sizes:?}"),
    };
    Sheet {
        title: format!(
            "{}: {}, right answers{sizes}",
            protocol.name(),
            describe(protocol)
        ),
        header,
        rows,
    }
}

fn row(name: &str, cells: Vec<String>, total: Count) -> Vec<String> {
    let (low, high) = total.interval();
    let share = total.correct as f64 / total.total.max(1) as f64;
    let mut row = vec![name.to_owned()];
    row.extend(cells);
    row.push(format!("{} / {}", total.correct, total.total));
    row.push(format!("{share:.3}"));
    row.push(format!("{low:.3}–{high:.3}"));
    row
}

fn describe(protocol: Robustness) -> &'static str {
    match protocol {
        Robustness::In => "all six shapes of a class train, all are queried",
        Robustness::Hold => "one strength is left out of training and queried, each in turn",
        Robustness::Null => "the null shapes train, the deformed are queried",
        Robustness::Retrieval => "shape against shape within a category, nearest neighbour",
        Robustness::SimilarityHolesRange => {
            "the null shapes train; queried are shapes turned, moved, scaled and cut or scanned"
        }
    }
}

fn measures_sheet(report: &BenchmarkReport) -> Sheet {
    let header = [
        "method",
        ">nearest neighbour",
        ">first tier",
        ">second tier",
        ">E-measure",
        ">DCG",
        ">mAP",
        ">queries",
    ];
    let rows = methods(report)
        .into_iter()
        .filter_map(|method| Some((method, report.retrieval.get(method)?.get(TOTAL)?)))
        .map(|(method, m)| {
            let mut row = vec![method.to_owned()];
            let values = [
                m.nearest_neighbour,
                m.first_tier,
                m.second_tier,
                m.e_measure,
                m.dcg,
                m.average_precision,
            ];
            row.extend(values.map(|v| format!("{v:.3}")));
            row.push(m.queries.to_string());
            row
        })
        .collect();
    Sheet {
        title: "retrieval: means over all categories".to_owned(),
        header: header.map(str::to_owned).to_vec(),
        rows,
    }
}

fn cost_sheet(report: &BenchmarkReport) -> Sheet {
    let rows = report
        .costs
        .iter()
        .map(|c| {
            let memory = c
                .peak_bytes
                .map_or("–".to_owned(), |b| format!("{:.0}", b as f64 / 1024.0 / 1024.0));
            let note = if c.cached { "some of it cached" } else { "" };
            vec![
                c.method.clone(),
                format!("{:.1}", c.seconds),
                memory,
                note.to_owned(),
            ]
        })
        .collect();
    Sheet {
        title: "cost; 'describe' is what all methods share: deforming, spectra, signatures".to_owned(),
        header: ["method", ">wall time, s", ">peak memory, MiB", ""]
            .map(str::to_owned)
            .to_vec(),
        rows,
    }
}

/// Writes `benchmark.md`, `benchmark.json` and, as CSV, `counts.csv`, `retrieval.csv` and `precision_recall.csv`.
///
/// # Errors
/// [`CliError::Failed`] with the path that cannot be written.
pub fn write(dir: &Path, report: &BenchmarkReport) -> Result<(), CliError> {
    std::fs::create_dir_all(dir).map_err(|error| CliError::at(dir, error))?;
    let json = serde_json::to_string(report).map_err(|error| CliError::Failed(error.to_string()))?;
    let files = [
        ("benchmark.md", markdown(report)),
        ("benchmark.json", json),
        ("counts.csv", counts_csv(report)),
        ("retrieval.csv", retrieval_csv(report)),
        ("precision_recall.csv", precision_csv(report)),
    ];
    for (name, contents) in files {
        let path = dir.join(name);
        std::fs::write(&path, contents).map_err(|error| CliError::at(&path, error))?;
    }
    Ok(())
}

fn markdown(report: &BenchmarkReport) -> String {
    let mut text = format!(
        "# Robustness benchmark\n\n{}\n",
        heading(report).replace('\n', "\n\n")
    );
    for sheet in sheets(report) {
        let plain: Vec<&str> = sheet.header.iter().map(|h| h.trim_start_matches('>')).collect();
        let rule: Vec<&str> = sheet
            .header
            .iter()
            .map(|h| if h.starts_with('>') { "--:" } else { "---" })
            .collect();
        text += &format!(
            "\n## {}\n\n| {} |\n| {} |\n",
            sheet.title,
            plain.join(" | "),
            rule.join(" | ")
        );
        for row in sheet.rows {
            text += &format!("| {} |\n", row.join(" | "));
        }
    }
    text
}

fn counts_csv(report: &BenchmarkReport) -> String {
    let mut text = "protocol,method,category,correct,total,low,high\n".to_owned();
    for (protocol, methods) in &report.counts {
        for (method, counts) in methods {
            for (category, n) in counts {
                let (low, high) = n.interval();
                text += &format!(
                    "{protocol},{method},{category},{},{},{low:.4},{high:.4}\n",
                    n.correct, n.total
                );
            }
        }
    }
    text
}

fn retrieval_csv(report: &BenchmarkReport) -> String {
    let mut text =
        "method,category,queries,nearest_neighbour,first_tier,second_tier,e_measure,dcg,average_precision\n"
            .to_owned();
    for (method, categories) in &report.retrieval {
        for (category, m) in categories {
            text += &format!(
                "{method},{category},{},{:.4},{:.4},{:.4},{:.4},{:.4},{:.4}\n",
                m.queries,
                m.nearest_neighbour,
                m.first_tier,
                m.second_tier,
                m.e_measure,
                m.dcg,
                m.average_precision
            );
        }
    }
    text
}

fn precision_csv(report: &BenchmarkReport) -> String {
    let mut text = "method,category,recall,precision\n".to_owned();
    for curve in &report.precision_recall {
        for (recall, precision) in curve.recall.iter().zip(&curve.precision) {
            text += &format!("{},{},{recall:.2},{precision:.4}\n", curve.method, curve.category);
        }
    }
    text
}
