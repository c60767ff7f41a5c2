//! What an answer says in words: which class, which few, none of them, or that this cannot be told.

use super::calibration::SIGNIFICANCE;
use super::not_judged::NotJudged;
use serde::{Deserialize, Serialize};

/// The first classes of a ranking that the verdict is about. It does not depend on how many are asked for beyond these.
pub const JUDGED: usize = 5;
/// Names in a sentence.
const NAMED: usize = 3;

/// What an answer is taken to be.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum VerdictKind {
    /// One class is possible.
    Class,
    /// Several classes are possible.
    Several,
    /// No class is possible.
    NoneOfThese,
    /// What is possible cannot be told.
    NotJudged,
}

/// See [`VerdictKind`].
#[derive(Clone, Debug, PartialEq)]
pub struct Verdict {
    /// What the answer is taken to be.
    pub kind: VerdictKind,
    /// Positions in the ranking of the classes it names as possible.
    pub named: Vec<usize>,
    /// One sentence for people.
    pub text: String,
    /// 1 less the largest p-value of the classes that are not named: at most so rarely a query of a known class gets so
    /// clear an answer that is wrong. `None` where it cannot be told.
    pub probability: Option<f64>,
    /// Why it is not judged; only where it is not.
    pub reason: Option<NotJudged>,
}

/// A class as a verdict sees it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Candidate<'a> {
    /// What it is called.
    pub name: &'a str,
    /// Its p-value, or why it has none.
    pub p_value: Result<f64, NotJudged>,
}

impl Verdict {
    /// Judges a ranking, best first, by the p-values of its first [`JUDGED`] classes; `least` is the smallest p-value the
    /// calibration can give.
    ///
    /// Possible classes are those with a p-value above [`SIGNIFICANCE`]. The best class is named with them, so that what is
    /// said is never at odds with the order; where none is possible none is named. A class without a p-value is not named,
    /// and leaves the probability open; one learnt from near copies of a pose leaves open whether none is possible.
    pub fn of(ranked: &[Candidate<'_>], least: f64) -> Self {
        let ranked = &ranked[..ranked.len().min(JUDGED)];
        let Some(best) = ranked.first() else {
            return Self::not_judged(None, NotJudged::TooFewShapes);
        };
        if let Err(reason) = best.p_value {
            return Self::not_judged(Some(best.name), reason);
        }
        let possible = |c: &Candidate<'_>| c.p_value.is_ok_and(|p| p > SIGNIFICANCE);
        if !ranked.iter().any(possible) {
            if ranked.iter().any(|c| c.p_value == Err(NotJudged::NearCopies)) {
                return Self::not_judged(Some(best.name), NotJudged::NearCopies);
            }
            return Self {
                kind: VerdictKind::NoneOfThese,
                named: Vec::new(),
                text: format!("none of the known classes; nearest: {}", best.name),
                probability: certainty(ranked.iter(), least),
                reason: None,
            };
        }
        let named: Vec<usize> = (0..ranked.len())
            .filter(|&i| i == 0 || possible(&ranked[i]))
            .collect();
        let names: Vec<&str> = named.iter().map(|&i| ranked[i].name).collect();
        let others = ranked.iter().skip(1).filter(|c| !possible(c));
        let probability = certainty(others, least);
        let sure = probability.map_or(String::new(), |p| {
            format!(
                " (at least {:.0} % of such answers are right)",
                (100.0 * p).floor()
            )
        });
        Self {
            kind: if names.len() == 1 {
                VerdictKind::Class
            } else {
                VerdictKind::Several
            },
            named,
            text: alternatives(&names) + &sure,
            probability,
            reason: None,
        }
    }

    /// A ranking that cannot be judged; `best` is its first class.
    pub fn not_judged(best: Option<&str>, reason: NotJudged) -> Self {
        Self {
            kind: VerdictKind::NotJudged,
            named: Vec::new(),
            text: format!("nearest: {} (not judged: {reason})", best.unwrap_or("none")),
            probability: None,
            reason: Some(reason),
        }
    }
}

/// 1 less the largest p-value, which is no smaller than `least`; `None` where one is missing.
fn certainty<'a>(mut others: impl Iterator<Item = &'a Candidate<'a>>, least: f64) -> Option<f64> {
    others
        .try_fold(least, |largest, c| Some(largest.max(c.p_value.ok()?)))
        .map(|largest| 1.0 - largest)
}

/// "a", "a or b", "a, b or c", "a, b, c or 2 more".
fn alternatives(names: &[&str]) -> String {
    let mut shown: Vec<String> = names.iter().take(NAMED).map(|n| (*n).to_owned()).collect();
    if names.len() > NAMED {
        shown.push(format!("{} more", names.len() - NAMED));
    }
    match shown.split_last() {
        Some((last, rest)) if !rest.is_empty() => format!("{} or {last}", rest.join(", ")),
        _ => shown.concat(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FEW: Result<f64, NotJudged> = Err(NotJudged::TooFewShapes);

    fn judge(ranked: &[(&str, Result<f64, NotJudged>)]) -> Verdict {
        let ranked: Vec<_> = ranked
            .iter()
            .map(|&(name, p_value)| Candidate { name, p_value })
            .collect();
        Verdict::of(&ranked, 0.01)
    }

    #[test]
    fn every_kind_is_said_in_words() {
        let one = judge(&[("cat", Ok(0.6)), ("dog", Ok(0.03)), ("cow", Ok(0.02))]);
        assert_eq!((one.kind, one.probability), (VerdictKind::Class, Some(0.97)));
        assert_eq!(one.text, "cat (at least 97 % of such answers are right)");
        let two = judge(&[("cat", Ok(0.6)), ("dog", Ok(0.3)), ("cow", Ok(0.02))]);
        assert_eq!((two.kind, two.probability), (VerdictKind::Several, Some(0.98)));
        assert!(two.text.starts_with("cat or dog (at least 98 %"), "{}", two.text);
        let none = judge(&[("michael", Ok(0.02)), ("dog", Ok(0.01))]);
        assert_eq!(
            (none.kind, none.probability),
            (VerdictKind::NoneOfThese, Some(0.98))
        );
        assert_eq!(none.text, "none of the known classes; nearest: michael");
        let unknown = judge(&[("cat", FEW), ("dog", Ok(0.01))]);
        assert_eq!(
            (unknown.kind, unknown.probability),
            (VerdictKind::NotJudged, None)
        );
        assert!(
            unknown.text.starts_with("nearest: cat (not judged: "),
            "{}",
            unknown.text
        );
        let copies = judge(&[("cat", Ok(0.02)), ("dog", Err(NotJudged::NearCopies))]);
        assert_eq!(
            (copies.kind, copies.reason),
            (VerdictKind::NotJudged, Some(NotJudged::NearCopies))
        );
        let open = Verdict::not_judged(Some("cat"), NotJudged::Open);
        assert!(open.text.contains("open"), "{}", open.text);
    }

    #[test]
    fn the_best_class_is_always_named_and_nothing_beyond_the_fifth_counts() {
        let worse = judge(&[("cat", Ok(0.04)), ("dog", Ok(0.3))]);
        assert!(worse.text.starts_with("cat or dog"), "{}", worse.text);
        let mut many = vec![("a", Ok(0.9)), ("b", Ok(0.8)), ("c", Ok(0.7)), ("d", Ok(0.6))];
        many.push(("e", Ok(0.5)));
        let five = judge(&many);
        assert!(five.text.starts_with("a, b, c or 2 more"), "{}", five.text);
        many.push(("f", Ok(0.4)));
        assert_eq!(judge(&many), five);
    }

    #[test]
    fn no_answer_is_certain_and_a_class_without_a_p_value_leaves_it_open() {
        assert_eq!(judge(&[("cat", Ok(1.0))]).probability, Some(0.99));
        let open = judge(&[("cat", Ok(0.5)), ("dog", FEW)]);
        assert_eq!((open.kind, open.probability), (VerdictKind::Class, None));
        assert_eq!(open.text, "cat");
    }
}
