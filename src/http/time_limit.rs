//! A query that names its own time limit gets the best ranking there is when it ends.
//!
//! Classes are scored one after the other instead of all at once, each exactly as in a whole ranking; what was scored
//! when time is up is ordered and answered, and what was not is named.

use super::problem::{Code, Problem};
use shapelex_core::cancel::Cancel;
use shapelex_core::coding::CodingError;
use shapelex_core::parameters::RankBy;
use shapelex_core::ranking::{Index, IndexedClass, Ranking, RankingError, View, rank};
use std::time::Duration;

/// The end of a query's time. Dropping it is the end too, so that the work stops where the client goes away.
pub struct TimeLimit {
    view: TimeView,
    timer: tokio::task::JoinHandle<()>,
}

/// What the work looks at.
#[derive(Clone)]
pub struct TimeView {
    /// Set at the end.
    pub over: Cancel,
    /// What was asked for.
    pub limit: Duration,
}

impl TimeLimit {
    /// Starts the clock. Needs the runtime.
    pub fn start(limit: Duration) -> Self {
        let over = Cancel::new();
        let flag = over.clone();
        let timer = tokio::spawn(async move {
            tokio::time::sleep(limit).await;
            flag.cancel();
        });
        let view = TimeView { over, limit };
        Self { view, timer }
    }

    /// What the work looks at, without what ends it.
    pub fn view(&self) -> TimeView {
        self.view.clone()
    }
}

impl TimeView {
    /// The problem of a query whose time was over before any class was scored.
    pub fn nothing_scored(&self) -> Problem {
        let seconds = self.limit.as_secs_f64();
        Problem::new(
            Code::DeadlineExceeded,
            format!("no class was scored within the {seconds:.3} s the query asked for"),
        )
        .with("limit_seconds", seconds)
    }
}

impl Drop for TimeLimit {
    fn drop(&mut self) {
        self.view.over.cancel();
        self.timer.abort();
    }
}

/// Ranks as many classes as there is time for, and gives the labels of the others.
///
/// # Errors
/// Those of [`rank`]; cancelled where not even one class was scored.
pub fn rank_until(
    views: &[View],
    index: &Index,
    rank_by: RankBy,
    over: &Cancel,
) -> Result<(Ranking, Vec<String>), RankingError> {
    collect(&index.classes, over, |class| {
        let one = Index {
            parameters: index.parameters.clone(),
            classes: vec![class.clone()],
        };
        rank(views, &one, rank_by, over)
    })
}

fn collect(
    classes: &[IndexedClass],
    over: &Cancel,
    mut rank_one: impl FnMut(&IndexedClass) -> Result<Ranking, RankingError>,
) -> Result<(Ranking, Vec<String>), RankingError> {
    let mut whole: Option<Ranking> = None;
    let mut left = Vec::new();
    for class in classes {
        if over.is_cancelled() && whole.is_some() {
            left.push(class.label.clone());
            continue;
        }
        match (rank_one(class), &mut whole) {
            (Ok(ranking), None) => whole = Some(ranking),
            (Ok(ranking), Some(whole)) => {
                whole.classes.extend(ranking.classes);
                whole.shapes.extend(ranking.shapes);
            }
            (Err(RankingError::Coding(CodingError::Cancelled(_))), Some(_)) => left.push(class.label.clone()),
            (Err(error), _) => return Err(error),
        }
    }
    let mut ranking = whole.ok_or(RankingError::EmptyIndex)?;
    ranking.compared = ranking.classes.len();
    order(&mut ranking);
    Ok((ranking, left))
}

/// Orders classes and shapes, best first and ties by label, and compares each class with the next.
fn order(ranking: &mut Ranking) {
    ranking
        .classes
        .sort_by(|a, b| a.score.total_cmp(&b.score).then_with(|| a.label.cmp(&b.label)));
    ranking
        .shapes
        .sort_by(|a, b| a.score.total_cmp(&b.score).then_with(|| a.label.cmp(&b.label)));
    for i in 0..ranking.classes.len() {
        let next = ranking.classes.get(i + 1).map(|c| c.score);
        let score = ranking.classes[i].score;
        ranking.classes[i].margin = next.map(|next| if next > 0.0 { (next - score) / next } else { 0.0 });
    }
    ranking.confidence = ranking.classes.first().and_then(|c| c.margin).unwrap_or(1.0);
}

#[cfg(test)]
mod tests {
    use super::*;
    use shapelex_core::cancel::Cancelled;
    use shapelex_core::parameters::Hypothesis;
    use shapelex_core::ranking::ClassScore;
    use std::collections::BTreeMap;

    fn class(label: &str) -> IndexedClass {
        IndexedClass {
            label: label.to_owned(),
            dictionaries: BTreeMap::new(),
            shapes: Vec::new(),
        }
    }

    fn scored(label: &str, score: f64) -> Ranking {
        Ranking {
            classes: vec![ClassScore {
                label: label.to_owned(),
                score,
                frobenius_error: 0.0,
                relative_error: 0.0,
                mean_objective: score,
                trimmed_objective: score,
                mean_nonzeros: 1.0,
                hypothesis: Hypothesis::Plain,
                margin: None,
            }],
            shapes: Vec::new(),
            confidence: 1.0,
            signatures: 1,
            compared: 1,
            pruned: 0,
        }
    }

    const STOPPED: RankingError = RankingError::Coding(CodingError::Cancelled(Cancelled));

    #[test]
    fn what_was_scored_in_time_is_ordered_and_the_rest_is_named() {
        let classes = ["a", "b", "c", "d"].map(class);
        let over = Cancel::new();
        let (ranking, left) = collect(&classes, &over, |class| match class.label.as_str() {
            "a" => Ok(scored("a", 4.0)),
            "b" => Ok(scored("b", 3.0)),
            _ => {
                over.cancel();
                Err(STOPPED)
            }
        })
        .unwrap();
        let order: Vec<&str> = ranking.classes.iter().map(|c| c.label.as_str()).collect();
        assert_eq!(
            (order, left),
            (vec!["b", "a"], vec!["c".to_owned(), "d".to_owned()])
        );
        assert_eq!(ranking.classes[0].margin, Some(0.25));
        assert_eq!((ranking.classes[1].margin, ranking.confidence), (None, 0.25));
    }

    #[test]
    fn nothing_scored_in_time_is_a_failure() {
        let over = Cancel::new();
        over.cancel();
        let outcome = collect(&[class("a")], &over, |_| Err(STOPPED));
        assert_eq!(outcome.unwrap_err(), STOPPED);
    }
}
