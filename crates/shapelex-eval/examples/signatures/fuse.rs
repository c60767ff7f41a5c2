//! Two signatures, one score: each divided by its own separation.

use super::rows::{Row, Rows};
use super::sets::Set;
use super::settings::Settings;
use shapelex_eval::benchmark::query_result::counts_as;
use std::collections::BTreeMap;

/// The columns of a report.
pub fn header() -> String {
    format!(
        "{:<24} {:>6} {:>6} {:>6}  both, by weight; (separations)",
        "set", "queries", "WKS", "local"
    )
}

/// What a signature says of one probe: the score of its own class less that of each other.
type Margins = Vec<[f64; 2]>;

/// Rules of a fused score, learnt from probes, by round and openness. Where only one kind of openness was probed it stands
/// for both.
struct Rules(BTreeMap<(usize, bool), Rule>);

/// Divisors and weights of two scores.
#[derive(Clone, Copy, Debug, Default)]
struct Rule {
    /// Mean of (mean score of others − own).
    separation: [f64; 2],
    /// The same over the variance of the margins: weights of a linear discriminant of independent scores.
    discriminant: [f64; 2],
    /// Weights of a conditional logit.
    logit: [f64; 2],
}

impl Rules {
    fn of(set: &Set, wks: &Rows, local: &Rows) -> Self {
        let of = |rows: &Rows| -> Vec<Row> {
            if set.probes.is_empty() {
                rows.queries.clone()
            } else {
                rows.probes.clone()
            }
        };
        let mut margins: BTreeMap<(usize, bool), Vec<Margins>> = BTreeMap::new();
        for (w, l) in of(wks).iter().zip(&of(local)) {
            // Rounds of leave-one-out ask one shape each; together they tell.
            let round = if set.probes.is_empty() { 0 } else { w.round };
            let shape = &set.shapes[w.shape];
            let own = |row: &Row| {
                let own = row
                    .scores
                    .iter()
                    .filter(|(class, _)| counts_as(&shape.class, class, &set.same));
                own.map(|(_, score)| *score).fold(f64::INFINITY, f64::min)
            };
            let (own_w, own_l) = (own(w), own(l));
            let others = w
                .scores
                .iter()
                .filter(|(class, _)| !counts_as(&shape.class, class, &set.same));
            let probe = others
                .map(|(class, score)| [score - own_w, l.scores[class] - own_l])
                .collect();
            margins.entry((round, shape.open)).or_default().push(probe);
        }
        Self(
            margins
                .into_iter()
                .map(|(key, probes)| (key, Rule::of(&probes)))
                .collect(),
        )
    }

    fn get(&self, set: &Set, row: &Row) -> Rule {
        let round = if set.probes.is_empty() { 0 } else { row.round };
        let open = set.shapes[row.shape].open;
        let found = self.0.get(&(round, open)).or_else(|| self.0.get(&(round, !open)));
        found.copied().unwrap_or_default()
    }

    fn text(&self, open: bool) -> String {
        let all: Vec<Rule> = self
            .0
            .iter()
            .filter(|(k, _)| k.1 == open)
            .map(|(_, v)| *v)
            .collect();
        let mean = |pick: &dyn Fn(&Rule) -> f64| all.iter().map(pick).sum::<f64>() / all.len() as f64;
        let ratio = |pick: &dyn Fn(&Rule) -> [f64; 2]| {
            mean(&|r| pick(r)[1] / pick(r)[0] * r.separation[1] / r.separation[0])
        };
        format!(
            "sep {:.4} {:.4} lda {:.2} logit {:.2}",
            mean(&|r| r.separation[0]),
            mean(&|r| r.separation[1]),
            ratio(&|r| r.discriminant),
            ratio(&|r| r.logit)
        )
    }
}

impl Rule {
    fn of(probes: &[Margins]) -> Self {
        let mut rule = Self::default();
        for i in 0..2 {
            let all: Vec<f64> = probes.iter().flatten().map(|m| m[i]).collect();
            let mean = all.iter().sum::<f64>() / all.len().max(1) as f64;
            let variance = all.iter().map(|m| (m - mean).powi(2)).sum::<f64>() / all.len().max(1) as f64;
            rule.separation[i] = mean.max(1e-6);
            rule.discriminant[i] = mean.max(0.0) / variance.max(1e-12);
        }
        rule.logit = logit(probes, rule.separation);
        rule
    }
}

/// Weights that make the true classes of the probes most likely under P(class) ∝ exp(−w·s), with a normal prior; by
/// gradient ascent on scores over their separations.
fn logit(probes: &[Margins], scale: [f64; 2]) -> [f64; 2] {
    const PRIOR: f64 = 0.01;
    let mut weights = [1.0, 1.0];
    for step in 0..400 {
        let mut gradient = weights.map(|w| -PRIOR * w);
        for probe in probes {
            let scaled = || probe.iter().map(|m| [m[0] / scale[0], m[1] / scale[1]]);
            let odds: Vec<f64> = scaled()
                .map(|m| (-(weights[0] * m[0] + weights[1] * m[1])).min(50.0).exp())
                .collect();
            let total = 1.0 + odds.iter().sum::<f64>();
            for (m, odds) in scaled().zip(odds) {
                for i in 0..2 {
                    gradient[i] += odds / total * m[i] / probes.len() as f64;
                }
            }
        }
        let rate = 2.0 / (1.0 + f64::from(step) / 50.0);
        for i in 0..2 {
            weights[i] = (weights[i] + rate * gradient[i]).clamp(0.0, 50.0);
        }
    }
    [weights[0] / scale[0], weights[1] / scale[1]]
}

fn right(set: &Set, row: &Row, scores: impl Iterator<Item = (String, f64)>) -> bool {
    let best = scores.min_by(|a, b| a.1.total_cmp(&b.1));
    best.is_some_and(|(class, _)| counts_as(&set.shapes[row.shape].class, &class, &set.same))
}

/// Prints a line for a set; of deformed shapes one for each deformation.
pub fn report(set: &Set, wks: &Rows, local: &Rows, settings: &Settings) {
    let rules = Rules::of(set, wks, local);
    let mut groups: BTreeMap<String, Vec<usize>> = BTreeMap::new();
    for (w, l) in wks.queries.iter().zip(&local.queries) {
        let own = |row: &Row| right(set, row, row.scores.iter().map(|(c, s)| (c.clone(), *s)));
        let rule = rules.get(set, w);
        let mut outcomes = vec![true, own(w), own(l)];
        let [a, b] = rule.separation;
        let sums = settings.weights.iter().map(|weight| [1.0 / a, weight / b]);
        for [of_wks, of_local] in sums.chain([rule.discriminant, rule.logit]) {
            let fused = w.scores.iter().map(|(class, score)| {
                let other = l.scores.get(class).copied().unwrap_or(f64::INFINITY);
                (class.clone(), of_wks * score + of_local * other)
            });
            outcomes.push(right(set, w, fused));
        }
        let shape = &set.shapes[w.shape];
        if settings.list && !outcomes[2] {
            println!(
                "  {} {}: WKS {} local {}",
                shape.class, shape.name, outcomes[1], outcomes[2]
            );
        }
        let mut names = vec![set.name.clone()];
        if set.name == "deformed" {
            let kind = shape.name.rsplit_once('-').map_or("", |(kind, _)| kind);
            names.push(format!("deformed {kind}"));
        }
        for name in names {
            let counts = groups.entry(name).or_insert_with(|| vec![0; outcomes.len()]);
            for (count, outcome) in counts.iter_mut().zip(&outcomes) {
                *count += usize::from(*outcome);
            }
        }
    }
    for (name, counts) in groups {
        let labels = settings
            .weights
            .iter()
            .map(f64::to_string)
            .chain(["lda".to_owned(), "logit".to_owned()]);
        let fused: Vec<String> = labels
            .zip(&counts[3..])
            .map(|(label, count)| format!("{label}:{count}"))
            .collect();
        println!(
            "{name:<24} {:>6} {:>6} {:>6}  {}  (whole {}; open {})",
            counts[0],
            counts[1],
            counts[2],
            fused.join("  "),
            rules.text(false),
            rules.text(true)
        );
    }
}
