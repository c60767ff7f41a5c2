//! A query for the best few of many classes answers as the full ranking does.

#[path = "../../benches/scale/zoo.rs"]
mod zoo;

use shapelex_core::cancel::Cancel;
use shapelex_core::parameters::{Channel, Hypothesis, RankBy};
use shapelex_core::ranking::{Index, IndexedShape, Ranking, View, rank, rank_top};
use std::sync::LazyLock;

type Outcome<T> = Result<T, Box<dyn std::error::Error>>;

const CLASSES: usize = 300;
/// Creatures, mixtures, and one that is in no class.
const QUERIES: [usize; 12] = [0, 5, 11, 17, 23, 40, zoo::REAL, 100, 150, 222, 299, 5000];

static INDEX: LazyLock<Index> = LazyLock::new(|| zoo::index(CLASSES).unwrap());

fn both(views: &[View], index: &Index, rank_by: RankBy, top: usize) -> (Ranking, Ranking) {
    let cancel = Cancel::new();
    let all = rank(views, index, rank_by, &cancel).unwrap();
    let few = rank_top(views, index, rank_by, top, &cancel).unwrap();
    assert_eq!(all.pruned, 0);
    assert_eq!(all.classes.len(), index.classes.len());
    assert_eq!(few.classes, all.classes[..top.min(all.classes.len())]);
    assert_eq!(few.shapes, all.shapes[..top.min(all.shapes.len())]);
    assert_eq!(few.confidence, all.confidence);
    assert_eq!((few.compared, few.signatures), (all.compared, all.signatures));
    (all, few)
}

#[test]
fn the_ten_best_of_many_are_those_of_the_full_ranking() {
    for rank_by in [RankBy::Objective, RankBy::TrimmedObjective] {
        let mut pruned = 0;
        for number in QUERIES {
            let views = zoo::query(number).unwrap();
            let (all, few) = both(&views, &INDEX, rank_by, 10);
            if number < CLASSES {
                assert_eq!(all.classes[0].label, format!("class-{number:05}"));
            }
            pruned += few.pruned;
        }
        assert!(
            pruned > QUERIES.len() * CLASSES / 2,
            "{pruned} pruned, {rank_by:?}"
        );
    }
}

#[test]
fn a_surface_with_a_boundary_is_measured_by_the_trimmed_objective() {
    let mut views = zoo::query(17).unwrap();
    let (whole, _) = both(&views, &INDEX, RankBy::Objective, 10);
    let (trimmed, _) = both(&views, &INDEX, RankBy::TrimmedObjective, 10);
    views[0].bounded = true;
    let (bounded, few) = both(&views, &INDEX, RankBy::Objective, 10);
    assert_eq!(bounded, trimmed);
    assert!(few.pruned > CLASSES / 2);
    for class in &bounded.classes {
        let same = whole.classes.iter().find(|c| c.label == class.label).unwrap();
        assert_eq!(
            (class.score, same.score),
            (class.trimmed_objective, class.mean_objective)
        );
        assert!(class.score < same.score);
    }
    // Eq. 5 stays Eq. 5.
    let (paper, _) = both(&views, &INDEX, RankBy::Frobenius, 10);
    assert_eq!(paper.classes[0].score, paper.classes[0].frobenius_error);
}

#[test]
fn every_hypothesis_counts() {
    // Channels and areas borrow other classes' dictionaries and signals: what is tested is how they are combined.
    let mut index = INDEX.clone();
    let plain: Vec<_> = index
        .classes
        .iter()
        .map(|c| c.dictionaries[&Channel::Plain].clone())
        .collect();
    for (i, class) in index.classes.iter_mut().enumerate() {
        let other = |k: usize| plain[(i + k) % CLASSES].clone();
        class.dictionaries.insert(Channel::Whitened, other(7));
        class.dictionaries.insert(Channel::FixedGrid, other(13));
    }
    let view = |number, hypothesis, channel| {
        let mut view = zoo::query(number).unwrap().remove(0);
        (view.hypothesis, view.channel) = (hypothesis, channel);
        view
    };
    let mut used = std::collections::BTreeSet::new();
    let mut pruned = 0;
    for (a, b, c) in [(3, 20, 31), (20, 3, 40), (9, 33, 2)] {
        let mut views = vec![
            view(a, Hypothesis::Plain, Channel::Plain),
            view(b, Hypothesis::Whitened, Channel::Whitened),
        ];
        pruned += both(&views, &index, RankBy::Objective, 10).1.pruned;
        views.push(view(c, Hypothesis::Doubled, Channel::FixedGrid));
        views.push(view(c + 1, Hypothesis::Doubled, Channel::FixedGrid));
        let (_, few) = both(&views, &index, RankBy::Objective, 10);
        pruned += both(&views, &index, RankBy::TrimmedObjective, 10).1.pruned;
        pruned += few.pruned;
        used.extend(few.classes.iter().map(|c| c.hypothesis));
    }
    assert_eq!(used.len(), 3, "{used:?}");
    assert!(pruned > CLASSES, "{pruned} pruned");
}

#[test]
fn orders_without_a_bound_are_evaluated_in_full() {
    let views = zoo::query(4).unwrap();
    let (_, few) = both(&views, &INDEX, RankBy::Frobenius, 10);
    assert_eq!(few.pruned, 0);
    let (_, few) = both(&views, &INDEX, RankBy::Objective, CLASSES - 1);
    assert_eq!(few.pruned, 0, "nearly all are asked for");
}

#[test]
fn ties_are_broken_by_label_as_in_the_full_ranking() {
    let mut index = INDEX.clone();
    for k in 0..20 {
        let mut copy = index.classes[8].clone();
        copy.label = format!("{}copy-{k:02}", if k % 2 == 0 { "a" } else { "z" });
        index.classes.push(copy);
    }
    let (_, few) = both(&zoo::query(8).unwrap(), &index, RankBy::Objective, 10);
    assert_eq!(few.classes[0].label, "acopy-00");
    assert_eq!(few.classes[0].score, few.classes[9].score);
}

#[test]
fn shapes_are_left_out_by_the_same_bound() {
    let mut index = INDEX.clone();
    let shapes: Vec<IndexedShape> = index
        .classes
        .drain(5..)
        .map(|class| IndexedShape {
            label: class.label,
            dictionaries: class.dictionaries,
        })
        .collect();
    index.classes[1].shapes = shapes;
    let (all, few) = both(&zoo::query(30).unwrap(), &index, RankBy::Objective, 3);
    assert_eq!(all.shapes.len(), CLASSES - 5);
    assert_eq!(few.shapes[0].label, "class-00030");
}
