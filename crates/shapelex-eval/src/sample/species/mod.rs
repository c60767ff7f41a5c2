//! The named species.

mod crawler;
mod quadruped;
mod upright;

use super::generate::Species;
use super::skeleton::Skeleton;

/// Builds a creature at rest.
type Plan = fn() -> Skeleton;

impl Species {
    /// The sixteen named species, always in this order.
    pub fn named() -> Vec<Self> {
        let zoo: [(&str, Plan); 16] = [
            ("man", upright::man),
            ("woman", upright::woman),
            ("dog", quadruped::dog),
            ("cat", quadruped::cat),
            ("horse", quadruped::horse),
            ("camel", quadruped::camel),
            ("elephant", quadruped::elephant),
            ("flamingo", upright::flamingo),
            ("lioness", quadruped::lioness),
            ("gorilla", upright::gorilla),
            ("giraffe", quadruped::giraffe),
            ("crocodile", crawler::crocodile),
            ("octopus", crawler::octopus),
            ("spider", crawler::spider),
            ("kangaroo", upright::kangaroo),
            ("rabbit", quadruped::rabbit),
        ];
        zoo.into_iter()
            .map(|(name, build)| Self::new(name, build()))
            .collect()
    }
}
