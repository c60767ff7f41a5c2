//! The deformations do what their names say, and an evaluation tells right from wrong.

use shapelex_core::cancel::Cancel;
use shapelex_core::mesh::trimesh::face_area;
use shapelex_core::mesh::{Components, PrepareOptions, PrepareReport, TriangleSoup, prepare};
use shapelex_core::parameters::{Channel, Hypothesis, Parameters, Preset};
use shapelex_core::pipeline::{PreparedShape, describe_both, describe_plain, describe_query};
use shapelex_eval::benchmark::deform::Deformation;
use shapelex_eval::benchmark::specimen::Wanted;
use shapelex_eval::benchmark::{Evaluation, LabelledShape, Protocol, Specimen, evaluate};
use shapelex_eval::sample::{Species, ZooOptions};
use std::collections::BTreeSet;

const SMALL: ZooOptions = ZooOptions {
    min_vertices: 700,
    max_vertices: 1000,
    upright: false,
};

/// Deformations that are not the paper's.
const BEYOND: [Deformation; 3] = [
    Deformation::LocalScale,
    Deformation::SimilarityHoles,
    Deformation::SimilarityRange,
];

fn creature(species: usize, pose: usize) -> TriangleSoup {
    Species::named()[species].pose(1, pose, &SMALL).unwrap()
}

fn area(mesh: &TriangleSoup) -> f64 {
    mesh.faces.iter().map(|f| face_area(&mesh.vertices, f)).sum()
}

fn used(mesh: &TriangleSoup) -> usize {
    mesh.faces.iter().flatten().collect::<BTreeSet<_>>().len()
}

fn report(mesh: TriangleSoup) -> PrepareReport {
    let options = PrepareOptions {
        components: Components::Largest,
        fill_holes_below: 0.0,
        working_size: 0,
    };
    prepare(mesh, &options).unwrap().1
}

#[test]
fn every_deformation_is_a_function_of_its_seed_and_leaves_a_shape() {
    let null = creature(0, 0);
    for deformation in Deformation::ALL.into_iter().chain(BEYOND) {
        for strength in Deformation::STRENGTHS {
            let first = deformation.apply(&null, strength, 7);
            assert_eq!(
                first,
                deformation.apply(&null, strength, 7),
                "{} {strength}",
                deformation.name()
            );
            assert_ne!(first, null, "{} {strength}", deformation.name());
            assert!(report(first).vertices > 50, "{} {strength}", deformation.name());
        }
    }
}

#[test]
fn strengths_go_as_far_as_the_paper_says() {
    let null = creature(1, 0);
    let share = |d: Deformation, s| area(&d.apply(&null, s, 3)) / area(&null);
    // The paper's scale factors, squared.
    for (strength, factor) in [(1, 0.5f64), (2, 0.875), (3, 1.25), (4, 1.625), (5, 2.0)] {
        assert!((share(Deformation::Scale, strength) - factor * factor).abs() < 1e-9);
    }
    // Less than a fifth of the points at the strongest.
    let left = used(&Deformation::Sampling.apply(&null, 5, 3)) as f64 / used(&null) as f64;
    assert!(left < 0.2, "{left} of the vertices are left");
    assert!(share(Deformation::Holes, 5) < share(Deformation::Holes, 1));
    assert!(share(Deformation::MicroHoles, 5) < share(Deformation::MicroHoles, 1));
    // One side of a closed surface is about half of it, and open.
    for strength in Deformation::STRENGTHS {
        let view = Deformation::View.apply(&null, strength, 3);
        let seen = area(&view) / area(&null);
        assert!((0.25..0.7).contains(&seen), "a view shows {seen} of the area");
        assert!(report(view).openness > 2.5);
    }
    // Welding makes one vertex of two, two pairs per strength, and only stretches what is around them.
    let welded = Deformation::Topology.apply(&null, 5, 3);
    assert_eq!(used(&welded), used(&null) - 10);
    let stretched = area(&welded) / area(&null);
    assert!(
        (1.0..1.6).contains(&stretched),
        "the area is {stretched} of the null's"
    );
    // Noise moves everything a little, shot noise a little far.
    let moved = |d: Deformation| {
        let to = d.apply(&null, 5, 3);
        to.vertices
            .iter()
            .zip(&null.vertices)
            .filter(|(a, b)| a != b)
            .count() as f64
            / null.vertices.len() as f64
    };
    assert!(moved(Deformation::Noise) > 0.99);
    assert!((0.01..0.1).contains(&moved(Deformation::ShotNoise)));
}

#[test]
fn deformations_beyond_the_papers_do_what_they_say() {
    let null = creature(1, 0);
    let boundary = report(null.clone()).boundary_edges;
    assert_eq!(boundary, 0, "the creature is closed");
    for strength in Deformation::STRENGTHS {
        // A range scan is one open sheet of about half the surface, evenly sampled.
        let scan = Deformation::SimilarityRange.apply(&null, strength, 3);
        assert!(
            scan.vertices.len() > 500 && scan.vertices.len() < 1500,
            "{}",
            scan.vertices.len()
        );
        assert!(report(scan).openness > 2.5);
        // Bulges move vertices, and cut nothing.
        let bulged = Deformation::LocalScale.apply(&null, strength, 3);
        assert_eq!(bulged.faces, null.faces);
        assert!(area(&bulged) > area(&null));
        // Holes are cut, and the rest is turned, moved and scaled by up to four.
        let cut = Deformation::SimilarityHoles.apply(&null, strength, 3);
        assert!(cut.faces.len() < null.faces.len());
        assert!(report(cut).boundary_edges > 0);
    }
    let far = Deformation::SimilarityHoles.apply(&null, 1, 3);
    let scale = (area(&far) / area(&null)).sqrt();
    assert!(
        (0.2..4.0).contains(&scale) && (scale - 1.0).abs() > 0.02,
        "{scale}"
    );
}

fn labelled(species: &[usize], poses: usize, parameters: &Parameters) -> Vec<LabelledShape> {
    let mut shapes = Vec::new();
    for &s in species {
        for pose in 0..poses {
            let (training, query) = describe_both(creature(s, pose), parameters, &Cancel::new()).unwrap();
            let class = Species::named()[s].name().to_owned();
            shapes.push(LabelledShape {
                class,
                name: format!("pose{pose}"),
                training,
                query,
            });
        }
    }
    shapes
}

/// Every other shape of a class trains, the rest are queried.
fn even_odd(shapes: &[LabelledShape], parameters: &Parameters) -> Evaluation {
    let protocol = Protocol::EvenOdd;
    evaluate(shapes, protocol, parameters, &[], &Cancel::new(), &|_, _| ()).unwrap()
}

#[test]
fn an_evaluation_counts_right_and_wrong() {
    let parameters = Parameters {
        atoms: 32,
        ..Parameters::preset(Preset::Default)
    };
    let mut shapes = labelled(&[0, 4, 7], 3, &parameters);
    let run = |shapes: &[LabelledShape], same: &[Vec<String>]| {
        evaluate(
            shapes,
            Protocol::LeaveOneOut,
            &parameters,
            same,
            &Cancel::new(),
            &|_, _| (),
        )
        .unwrap()
    };
    let right = run(&shapes, &[]);
    assert_eq!((right.correct, right.total), (9, 9));
    assert_eq!(right, run(&shapes, &[]), "the same twice");
    // A shape under a wrong label is taken for what it is, and counts as a mistake unless the two are the same.
    let (wrong, true_class) = (shapes[3].class.clone(), shapes[0].class.clone());
    shapes[0].class.clone_from(&wrong);
    shapes[0].name = "impostor".into();
    let mixed = run(&shapes, &[]);
    assert_eq!(mixed.confusion[&wrong][&true_class], 1);
    assert_eq!(mixed.queries[0].name, "impostor", "the worst comes first");
    assert!(mixed.queries[0].error_margin > 0.0 && !mixed.queries[0].correct);
    let excused = run(&shapes, &[vec![wrong, true_class]]);
    assert_eq!(excused.correct, excused.total);
}

#[test]
fn the_robust_preset_undoes_affine_maps_of_a_known_mesh_and_sees_views() {
    let robust = Parameters {
        atoms: 32,
        ..Parameters::preset(Preset::Robust)
    };
    let nulls = labelled(&[0, 4, 7], 1, &robust);
    let training: Vec<LabelledShape> = nulls
        .iter()
        .flat_map(|null| {
            // The null trains; a strong affine map of it, of the same class, is what is asked about.
            let species = Species::named()
                .iter()
                .position(|s| s.name() == null.class)
                .unwrap();
            let deformed = Deformation::Affine.apply(&creature(species, 0), 5, 11);
            let (training, query) = describe_both(deformed, &robust, &Cancel::new()).unwrap();
            [
                null.clone(),
                LabelledShape {
                    class: null.class.clone(),
                    name: "pose1".into(),
                    training,
                    query,
                },
            ]
        })
        .collect();
    let answer = even_odd(&training, &robust);
    assert_eq!((answer.correct, answer.total), (3, 3), "{:?}", answer.queries);
    // A view is open, so it is described as it is and under the areas assumed, all on the fixed grid.
    let view = Deformation::View.apply(&creature(4, 0), 1, 5);
    let (training, query) = describe_both(view.clone(), &robust, &Cancel::new()).unwrap();
    // What the baselines compare a query by is what they kept of the same shape as one that trains.
    let plain = describe_plain(view.clone(), &robust, &Cancel::new(), &|_| ()).unwrap();
    assert_eq!(plain.eigenvalues, training.eigenvalues);
    assert_eq!(
        plain.views[0].signatures.matrix,
        training.views[0].signatures.matrix
    );
    let alone = describe_query(view, &robust, &Cancel::new(), &|_| ()).unwrap();
    for views in [&query.views, &alone.views] {
        let seen: Vec<_> = views.iter().map(|v| (v.hypothesis, v.channel)).collect();
        let mut expected = vec![(Hypothesis::Doubled, Channel::FixedGrid); 5];
        expected[0].0 = Hypothesis::Plain;
        assert_eq!(seen, expected);
    }
    // One that trains is doubled in both channels, and each area has its share of the vertices.
    let seen: Vec<_> = training
        .views
        .iter()
        .map(|v| (v.hypothesis, v.channel, v.area_scale))
        .collect();
    assert_eq!(
        seen[..3],
        [
            (Hypothesis::Plain, Channel::Plain, 1.0),
            (Hypothesis::Doubled, Channel::Plain, 2.0),
            (Hypothesis::Whitened, Channel::Whitened, 1.0),
        ]
    );
    assert_eq!(
        seen[3..],
        [2.0, 2.5, 3.0, 4.0].map(|area| (Hypothesis::Doubled, Channel::FixedGrid, area))
    );
    let mut shared: Vec<u32> = training.views[3..]
        .iter()
        .flat_map(|v| v.signatures.vertices.clone())
        .collect();
    shared.sort_unstable();
    assert_eq!(shared, training.views[0].signatures.vertices);
    assert!(training.views.iter().chain(&query.views).all(|v| v.bounded));
    assert!(nulls.iter().all(|n| n.query.views.iter().all(|v| !v.bounded)));
}

#[test]
fn parts_that_train_tell_what_the_whole_is() {
    let parameters = Parameters {
        atoms: 64,
        ..Parameters::preset(Preset::Default)
    };
    // Poses 0, 2 and 4 train, views all; the whole and a view from another side are asked about.
    let describe = |species: usize, pose: u32, seed: u64| {
        let whole = creature(species, 0);
        let soup = match pose {
            1 => whole,
            _ => Deformation::View.apply(&whole, pose.max(1), seed),
        };
        let (training, query) = describe_both(soup, &parameters, &Cancel::new()).unwrap();
        LabelledShape {
            class: species.to_string(),
            name: format!("pose{pose}"),
            training,
            query,
        }
    };
    let (mut wholes, mut views) = (0, 0);
    for seed in [31, 32, 33] {
        let shapes: Vec<_> = (0..12)
            .flat_map(|species| (0..5).map(move |pose| (species, pose)))
            .map(|(species, pose)| describe(species, pose, seed))
            .collect();
        let answer = even_odd(&shapes, &parameters);
        let right = |name| {
            let asked = answer.queries.iter().filter(|q| q.name == name);
            asked.filter(|q| q.correct).count()
        };
        wholes += right("pose1");
        views += right("pose3");
    }
    // 31 and 25; were the parts learnt as they are, 29 and 22.
    assert!(wholes + views >= 54, "{wholes} wholes and {views} views of 36");
}

#[test]
fn a_specimen_serves_presets_of_few_and_of_many_hypotheses_in_any_order() {
    let coding = [Preset::Default, Preset::Robust, Preset::Paper].map(Parameters::preset);
    let specimen = Specimen::describe(&creature(0, 0), &coding, Some(&coding[2]), &Cancel::new()).unwrap();
    let wanted = Wanted {
        training: true,
        query: true,
    };
    for (which, channels, hypotheses) in [(0, 2, 1), (1, 3, 2), (2, 1, 1)] {
        let (training, query) = specimen.descriptions(which, &coding[which], wanted).unwrap();
        assert_eq!(
            (training.views.len(), query.views.len()),
            (channels, hypotheses),
            "{:?}",
            coding[which].preset
        );
    }
}

#[test]
fn a_coarse_closed_mesh_is_refined_before_its_spectrum_and_a_part_is_not() {
    let parameters = Parameters::preset(Preset::Default);
    let signatures = |soup: TriangleSoup, parameters: &Parameters| {
        let shape = PreparedShape::new(soup, parameters, &Cancel::new(), &|_| ()).unwrap();
        shape.signature_vertices()
    };
    let coarse = Deformation::Sampling.apply(&creature(1, 0), 5, 3);
    let vertices = used(&coarse);
    assert!(vertices < 200);
    assert_eq!(signatures(coarse.clone(), &parameters), 1000);
    let literal = Parameters::preset(Preset::Paper);
    assert_eq!(signatures(coarse, &literal), vertices);
    let view = Deformation::View.apply(&creature(1, 0), 1, 3);
    assert!(signatures(view, &parameters) < 700);
}
