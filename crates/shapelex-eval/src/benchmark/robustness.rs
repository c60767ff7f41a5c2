//! The robustness benchmark's categories and protocols (docs/evaluation/results.md#robustness-benchmark).

use super::deform::Deformation;
use super::protocol::Round;
use std::collections::BTreeMap;

/// A category: null shapes and what became of them.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Category {
    /// One deformation at five strengths.
    Deformed(Deformation),
    /// Up to five other poses.
    Isometry,
}

impl Category {
    /// The nine of the paper.
    pub const PAPER: [Self; 9] = [
        Self::Deformed(Deformation::Affine),
        Self::Deformed(Deformation::Holes),
        Self::Deformed(Deformation::MicroHoles),
        Self::Deformed(Deformation::Scale),
        Self::Deformed(Deformation::Sampling),
        Self::Deformed(Deformation::Noise),
        Self::Deformed(Deformation::ShotNoise),
        Self::Deformed(Deformation::Topology),
        Self::Deformed(Deformation::View),
    ];

    /// Two of the SHREC 2010 robustness set, for nulls that come with other poses.
    pub const POSED: [Self; 2] = [Self::Isometry, Self::Deformed(Deformation::LocalScale)];

    /// Those of the protocol `similarity_holes_range`.
    pub const SIMILARITY: [Self; 2] = [
        Self::Deformed(Deformation::SimilarityHoles),
        Self::Deformed(Deformation::SimilarityRange),
    ];

    /// The category's name in tables, files and on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Deformed(deformation) => deformation.name(),
            Self::Isometry => "isometry",
        }
    }
}

/// A protocol of the robustness benchmark, over the members of one category.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Robustness {
    /// All members train, all are queried, each under a dictionary it trained. It saturates.
    In,
    /// One strength (the null shape counts as one) is left out of training and queried, each in turn. Closest to the
    /// paper's Table 1.
    Hold,
    /// The null shapes train, the deformed are queried: the honest, hard one.
    Null,
    /// Every shape asks for the others of its category, shape against shape; right where the nearest is of its class.
    Retrieval,
    /// As `Null`, over shapes turned, moved, scaled and cut, or scanned from one side.
    SimilarityHolesRange,
}

impl Robustness {
    /// All, in the order of the tables.
    pub const ALL: [Self; 5] = [
        Self::In,
        Self::Hold,
        Self::Null,
        Self::Retrieval,
        Self::SimilarityHolesRange,
    ];

    /// The protocol's name in tables, files and on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::In => "in",
            Self::Hold => "hold",
            Self::Null => "null",
            Self::Retrieval => "retrieval",
            Self::SimilarityHolesRange => "similarity_holes_range",
        }
    }

    /// The protocol of that name.
    pub fn named(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|p| p.name() == name)
    }

    /// Whether the protocol is run over a category.
    pub fn covers(self, category: Category) -> bool {
        Category::SIMILARITY.contains(&category) == (self == Self::SimilarityHolesRange)
    }
}

/// A shape of a category.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Member {
    /// Its class.
    pub class: String,
    /// Strength of its deformation, 1 to 5 (for other poses, their number); 0 for the null shape.
    pub strength: usize,
}

/// The splits of a protocol; none for [`Robustness::Retrieval`], which has no classes to train.
///
/// Only members whose class still trains are queried.
pub fn robustness_rounds(protocol: Robustness, members: &[Member]) -> Vec<Round> {
    let split = |trains: &dyn Fn(usize) -> bool, queried: &dyn Fn(usize) -> bool| {
        let mut train: BTreeMap<String, Vec<usize>> = BTreeMap::new();
        for (i, member) in members.iter().enumerate().filter(|(_, m)| trains(m.strength)) {
            train.entry(member.class.clone()).or_default().push(i);
        }
        let query = (0..members.len())
            .filter(|&i| queried(members[i].strength) && train.contains_key(&members[i].class))
            .collect();
        Round { train, query }
    };
    let mut rounds = match protocol {
        Robustness::In => vec![split(&|_| true, &|_| true)],
        Robustness::Hold => {
            let levels = members.iter().map(|m| m.strength + 1).max().unwrap_or(0);
            (0..levels)
                .map(|held| split(&|s| s != held, &|s| s == held))
                .collect()
        }
        Robustness::Null | Robustness::SimilarityHolesRange => vec![split(&|s| s == 0, &|s| s > 0)],
        Robustness::Retrieval => Vec::new(),
    };
    rounds.retain(|r| !r.query.is_empty());
    rounds
}

#[cfg(test)]
mod tests {
    use super::*;

    fn twelve_by_six() -> Vec<Member> {
        (0..=5)
            .flat_map(|strength| {
                (0..12).map(move |c| Member {
                    class: format!("c{c:02}"),
                    strength,
                })
            })
            .collect()
    }

    #[test]
    fn a_category_of_twelve_classes_is_queried_as_the_paper_does() {
        let members = twelve_by_six();
        let queries = |p| {
            robustness_rounds(p, &members)
                .iter()
                .map(|r| r.query.len())
                .sum::<usize>()
        };
        assert_eq!(queries(Robustness::In), 72);
        assert_eq!(queries(Robustness::Hold), 72);
        assert_eq!(queries(Robustness::Null), 60);
        // Nine categories make the paper's 648, and 540 under `null`.
        assert_eq!(
            (Category::PAPER.len() * 72, Category::PAPER.len() * 60),
            (648, 540)
        );
    }

    #[test]
    fn a_held_out_strength_never_trains() {
        let members = twelve_by_six();
        let rounds = robustness_rounds(Robustness::Hold, &members);
        assert_eq!(rounds.len(), 6);
        let mut queried = Vec::new();
        for round in &rounds {
            let level = members[round.query[0]].strength;
            assert!(round.query.iter().all(|&i| members[i].strength == level));
            for (class, train) in &round.train {
                assert_eq!(train.len(), 5);
                assert!(
                    train
                        .iter()
                        .all(|&i| members[i].strength != level && members[i].class == *class)
                );
            }
            queried.extend(round.query.clone());
        }
        queried.sort_unstable();
        assert!(queried.into_iter().eq(0..72));
    }

    #[test]
    fn names_lead_back_to_protocols_and_each_category_has_its_own() {
        for protocol in Robustness::ALL {
            assert_eq!(Robustness::named(protocol.name()), Some(protocol));
        }
        assert!(Robustness::Null.covers(Category::Isometry));
        assert!(!Robustness::Null.covers(Category::SIMILARITY[0]));
        assert!(Robustness::SimilarityHolesRange.covers(Category::SIMILARITY[1]));
    }
}
