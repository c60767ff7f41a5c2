//! Real animated files against poses that were baked from them by other software.

use super::*;
use crate::mesh::Limits;
use crate::mesh::trimesh::face_area;
use std::path::PathBuf;

fn data(name: &str) -> Option<PathBuf> {
    let path = shapelex_testing::repository("../shared/data");
    if path.is_dir() {
        return Some(path);
    }
    eprintln!("skipped: {name}: no ../shared/data");
    None
}

/// Sorted edge lengths over √area, three per face: equal for equal surfaces, whatever their place, size and order.
fn profile(soup: &TriangleSoup) -> Vec<f64> {
    let area: f64 = soup.faces.iter().map(|f| face_area(&soup.vertices, f)).sum();
    let mut lengths: Vec<f64> = soup
        .faces
        .iter()
        .flat_map(|f| [[f[0], f[1]], [f[1], f[2]], [f[2], f[0]]])
        .map(|e| {
            let [a, b] = e.map(|k| soup.vertices[k as usize]);
            let d: f64 = (0..3).map(|k| (a[k] - b[k]).powi(2)).sum();
            (d / area).sqrt()
        })
        .collect();
    lengths.sort_by(f64::total_cmp);
    lengths
}

/// Largest difference of two profiles, relative to the mean edge; infinite if they differ in number.
fn difference(a: &TriangleSoup, b: &TriangleSoup) -> f64 {
    let (a, b) = (profile(a), profile(b));
    if a.len() != b.len() {
        return f64::INFINITY;
    }
    let mean = a.iter().sum::<f64>() / a.len() as f64;
    let largest = a.iter().zip(&b).map(|(x, y)| (x - y).abs()).fold(0.0, f64::max);
    largest / mean
}

#[test]
fn poses_match_those_baked_by_other_software() {
    let Some(data) = data("poses_match_those_baked_by_other_software") else {
        return;
    };
    let context = ReadContext::new(Limits::default());
    let mut compared = 0;
    for animal in ["Cow", "Fox", "Horse", "Stag", "Wolf"] {
        let bytes =
            std::fs::read(data.join(format!("quaternius_animals_gltf/{animal}.gltf"))).expect("a file");
        let source = Source {
            bytes: &bytes,
            ..Source::default()
        };
        let container = Container::open(&bytes, Format::Gltf, |_| Ok(())).expect("a container");
        let document = Document::open(&container, &source, &context).expect("a document");
        let scene = Scene::open(&document).expect("a scene");
        let clips = Clip::list(&document).expect("clips");
        let class = data.join("quaternius_animals").join(animal.to_lowercase());
        let baked = |name: &str| -> Option<TriangleSoup> {
            let bytes = std::fs::read(class.join(format!("{name}.off"))).ok()?;
            Some(crate::mesh::off::read(&bytes, &context).expect("a valid OFF"))
        };
        // The stag's horns, a second mesh on a joint of its head, were not baked.
        let bind = baked("bind").expect("a bind pose");
        let rest = scene.build(&scene.nodes.rest()).expect("a soup");
        if bind.faces.len() != rest.faces.len() {
            assert_eq!(animal, "Stag");
            continue;
        }
        // The baked coordinates have six digits.
        assert!(difference(&rest, &bind) < 1e-4, "{animal}");
        // Stored positions, the same mesh without its skin, are another surface.
        let text = String::from_utf8(bytes.clone()).expect("JSON");
        let bare = Source {
            bytes: &text.replace("\"skin\"", "\"xkin\"").into_bytes(),
            ..source
        };
        let stored = read(&bare, Format::Gltf, &context).expect("a soup");
        assert!(difference(&stored, &bind) > 5e-3, "{animal}");
        for clip in &clips {
            let tracks = clip.tracks(&document).expect("tracks");
            for percent in [30, 70] {
                let Some(expected) = baked(&format!("{}_{percent}", clip.name)) else {
                    continue;
                };
                let pose = sample(&document, &scene, &tracks, f64::from(percent) / 100.0).expect("a pose");
                let found = difference(&pose, &expected);
                // Six digits make 5e-4; between keys of fast turns it matters how rotations are interpolated.
                assert!(found < 5e-3, "{animal} {}_{percent}: {found:.2e}", clip.name);
                assert!(difference(&pose, &rest) > 2.0 * found);
                compared += 1;
            }
        }
    }
    assert!(compared > 80, "{compared} poses compared");
}
