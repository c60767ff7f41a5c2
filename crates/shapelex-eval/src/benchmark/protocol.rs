//! Which shapes train and which are queried.

use rand::SeedableRng;
use rand::seq::{IndexedRandom, SliceRandom};
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// A way to split labelled shapes into training shapes and queries.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Protocol {
    /// Every shape is queried once; all others train.
    LeaveOneOut,
    /// In every class, in natural order of the names, the 1st, 3rd, 5th … train and the others are queried: with poses
    /// numbered from 0 the even ones train and the odd ones are queried.
    EvenOdd,
    /// One shape per class, drawn at random, trains and all others are queried; repeated.
    OneShot {
        /// Independent draws.
        draws: usize,
        /// Seed of the draws.
        seed: u64,
    },
    /// Every class is shuffled and dealt into k folds; each fold is queried once, the others train.
    KFold {
        /// Number of folds, at least 2.
        folds: usize,
        /// Seed of the shuffle.
        seed: u64,
    },
    /// The last shapes are queried, all before them train.
    TrainQuery {
        /// How many are queried.
        queries: usize,
    },
}

impl Protocol {
    /// The protocol's name in reports.
    pub fn name(&self) -> &'static str {
        match self {
            Self::LeaveOneOut => "leave-one-out",
            Self::EvenOdd => "even/odd",
            Self::OneShot { .. } => "one-shot",
            Self::KFold { .. } => "k-fold",
            Self::TrainQuery { .. } => "train/query",
        }
    }
}

/// One split: indices into the labelled shapes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Round {
    /// Training shapes by class; a class without any is not in the index of this round.
    pub train: BTreeMap<String, Vec<usize>>,
    /// Queries. Only shapes of a class that trains are queried.
    pub query: Vec<usize>,
}

/// The splits of a protocol over shapes with the given classes and names.
pub fn rounds(protocol: Protocol, classes: &[&str], names: &[&str]) -> Vec<Round> {
    let mut members: BTreeMap<&str, Vec<usize>> = BTreeMap::new();
    for (i, class) in classes.iter().enumerate() {
        members.entry(class).or_default().push(i);
    }
    for list in members.values_mut() {
        list.sort_by(|&a, &b| natural_key(names[a]).cmp(&natural_key(names[b])));
    }
    let split = |queried: &dyn Fn(&str, usize) -> bool| {
        let mut round = Round {
            train: BTreeMap::new(),
            query: Vec::new(),
        };
        for (class, list) in &members {
            let (query, train): (Vec<usize>, Vec<usize>) = list.iter().partition(|&&i| queried(class, i));
            if !train.is_empty() {
                round.train.insert((*class).to_owned(), train);
                round.query.extend(query);
            }
        }
        round
    };
    let mut result = match protocol {
        Protocol::LeaveOneOut => members
            .values()
            .flatten()
            .map(|&left_out| split(&|_, i| i == left_out))
            .collect(),
        Protocol::EvenOdd => {
            let odd: Vec<usize> = members
                .values()
                .flat_map(|l| l.iter().skip(1).step_by(2).copied())
                .collect();
            vec![split(&|_, i| odd.contains(&i))]
        }
        Protocol::OneShot { draws, seed } => (0..draws)
            .map(|draw| {
                let mut rng = ChaCha8Rng::seed_from_u64(seed.wrapping_add(draw as u64));
                let chosen: Vec<usize> = members
                    .values()
                    .filter_map(|l| l.choose(&mut rng).copied())
                    .collect();
                split(&|_, i| !chosen.contains(&i))
            })
            .collect(),
        Protocol::TrainQuery { queries } => {
            let trained = classes.len().saturating_sub(queries);
            vec![split(&|_, i| i >= trained)]
        }
        Protocol::KFold { folds, seed } => {
            let mut rng = ChaCha8Rng::seed_from_u64(seed);
            let mut fold_of = vec![0; classes.len()];
            for list in members.values() {
                let mut dealt = list.clone();
                dealt.shuffle(&mut rng);
                for (k, &i) in dealt.iter().enumerate() {
                    fold_of[i] = k % folds.max(2);
                }
            }
            (0..folds.max(2))
                .map(|fold| split(&|_, i| fold_of[i] == fold))
                .collect::<Vec<_>>()
        }
    };
    result.retain(|round| !round.query.is_empty());
    result
}

/// A name cut into text and numbers, so that `cat10` comes after `cat2`.
pub fn natural_key(name: &str) -> Vec<(String, u64)> {
    let mut key = Vec::new();
    let mut rest = name;
    while !rest.is_empty() {
        let text = rest.find(|c: char| c.is_ascii_digit()).unwrap_or(rest.len());
        let digits = rest[text..]
            .find(|c: char| !c.is_ascii_digit())
            .unwrap_or(rest.len() - text);
        key.push((
            rest[..text].to_owned(),
            rest[text..text + digits].parse().unwrap_or(u64::MAX),
        ));
        rest = &rest[text + digits..];
    }
    key
}

#[cfg(test)]
mod tests {
    use super::*;

    const CLASSES: [&str; 7] = ["cat", "cat", "cat", "dog", "dog", "shark", "cat"];
    const NAMES: [&str; 7] = ["cat10", "cat2", "cat0", "dog0", "dog1", "shark0", "cat1"];

    #[test]
    fn leave_one_out_queries_every_shape_of_a_class_that_still_trains() {
        let all = rounds(Protocol::LeaveOneOut, &CLASSES, &NAMES);
        // The lone shark cannot be queried: without it its class does not train.
        assert_eq!(all.len(), 6);
        for round in &all {
            assert_eq!(round.query.len(), 1);
            assert_eq!(round.train.values().map(Vec::len).sum::<usize>(), 6);
            assert!(!round.train.values().flatten().any(|i| round.query.contains(i)));
        }
    }

    #[test]
    fn even_odd_goes_by_the_numbers_in_the_names() {
        let all = rounds(Protocol::EvenOdd, &CLASSES, &NAMES);
        assert_eq!(all.len(), 1);
        assert_eq!(all[0].train["cat"], [2, 1], "cat0 and cat2 train");
        assert_eq!(all[0].query, [6, 0, 4], "cat1, cat10 and dog1 are queried");
    }

    #[test]
    fn one_shot_trains_one_shape_per_class_and_follows_its_seed() {
        let protocol = Protocol::OneShot { draws: 5, seed: 3 };
        let all = rounds(protocol, &CLASSES, &NAMES);
        assert_eq!(all.len(), 5);
        assert!(
            all.iter()
                .all(|r| r.train.values().all(|l| l.len() == 1) && r.query.len() == 4)
        );
        assert_eq!(all, rounds(protocol, &CLASSES, &NAMES));
        assert!(all.iter().any(|r| r != &all[0]), "draws differ");
    }

    #[test]
    fn the_last_shapes_are_queried_where_their_class_trains() {
        let all = rounds(Protocol::TrainQuery { queries: 3 }, &CLASSES, &NAMES);
        assert_eq!(all.len(), 1);
        assert_eq!(all[0].train["cat"], [2, 1, 0]);
        assert_eq!(all[0].query, [6, 4], "cat1 and dog1; no shark trains");
    }

    #[test]
    fn k_fold_queries_everything_once() {
        let all = rounds(Protocol::KFold { folds: 2, seed: 1 }, &CLASSES, &NAMES);
        let mut queried: Vec<usize> = all.iter().flat_map(|r| r.query.clone()).collect();
        queried.sort_unstable();
        assert_eq!(queried, [0, 1, 2, 3, 4, 6]);
    }
}
