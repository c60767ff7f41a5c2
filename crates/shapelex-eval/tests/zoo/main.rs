//! The zoo's promises: closed spheres, vertex counts, seeds, bending without stretching, files other readers accept.

use shapelex_core::mesh::TriangleSoup;
use shapelex_eval::sample::{Species, ZooOptions, creatures, species, write_glb, write_obj};
use std::collections::{HashMap, HashSet};

const SEED: u64 = 7;

fn small() -> ZooOptions {
    ZooOptions {
        min_vertices: 1000,
        max_vertices: 1400,
        ..ZooOptions::default()
    }
}

/// Independent of the generator's own check: every directed edge once, its reverse once, Euler's formula, one
/// component.
fn assert_sphere(mesh: &TriangleSoup, what: &str) {
    let mut edges = HashSet::new();
    for f in &mesh.faces {
        for (a, b) in [(f[0], f[1]), (f[1], f[2]), (f[2], f[0])] {
            assert_ne!(a, b, "{what}: degenerate face");
            assert!(edges.insert((a, b)), "{what}: edge {a}-{b} twice");
        }
    }
    assert!(
        edges.iter().all(|&(a, b)| edges.contains(&(b, a))),
        "{what}: not closed"
    );
    let (v, e, f) = (mesh.vertices.len(), edges.len() / 2, mesh.faces.len());
    assert_eq!(v + f, e + 2, "{what}: V {v} E {e} F {f} is not a sphere");
    let mut around: HashMap<u32, Vec<u32>> = HashMap::new();
    for &(a, b) in &edges {
        around.entry(a).or_default().push(b);
    }
    let (mut reached, mut stack) = (HashSet::from([0]), vec![0]);
    while let Some(a) = stack.pop() {
        stack.extend(around[&a].iter().filter(|&&b| reached.insert(b)));
    }
    assert_eq!(reached.len(), v, "{what}: more than one component");
}

fn area_and_volume(mesh: &TriangleSoup) -> (f64, f64) {
    let (mut area, mut volume) = (0.0, 0.0);
    for f in &mesh.faces {
        let [a, b, c] = f.map(|i| mesh.vertices[i as usize]);
        let cross = |u: [f64; 3], v: [f64; 3]| {
            [
                u[1] * v[2] - u[2] * v[1],
                u[2] * v[0] - u[0] * v[2],
                u[0] * v[1] - u[1] * v[0],
            ]
        };
        let sub = |u: [f64; 3], v: [f64; 3]| [u[0] - v[0], u[1] - v[1], u[2] - v[2]];
        let dot = |u: [f64; 3], v: [f64; 3]| u[0] * v[0] + u[1] * v[1] + u[2] * v[2];
        let n = cross(sub(b, a), sub(c, a));
        area += 0.5 * dot(n, n).sqrt();
        volume += dot(a, cross(b, c)) / 6.0;
    }
    (area, volume)
}

#[test]
fn named_species_give_closed_spheres_in_the_default_range() {
    let all = Species::named();
    assert!(all.len() >= 16);
    let names: HashSet<&str> = all.iter().map(|s| s.name()).collect();
    for expected in [
        "man", "woman", "dog", "cat", "horse", "camel", "elephant", "flamingo", "lioness",
    ] {
        assert!(names.contains(expected), "no {expected}");
    }
    let options = ZooOptions::default();
    for creature in creatures(&all, 3, SEED, &options) {
        let creature = creature.unwrap();
        let what = format!("{} {}", creature.class, creature.pose);
        let n = creature.mesh.vertices.len();
        assert!((1500..=3000).contains(&n), "{what}: {n} vertices");
        assert_sphere(&creature.mesh, &what);
        assert!(
            area_and_volume(&creature.mesh).1 > 0.0,
            "{what}: faces look inwards"
        );
    }
}

#[test]
fn random_species_give_closed_spheres_and_differ() {
    let options = ZooOptions {
        min_vertices: 500,
        max_vertices: 1500,
        ..ZooOptions::default()
    };
    let mut compactness = Vec::new();
    for i in 0..24 {
        let s = Species::random(SEED, i);
        let mesh = s.pose(SEED, 0, &options).unwrap();
        assert!((500..=1500).contains(&mesh.vertices.len()));
        assert_sphere(&mesh, s.name());
        let (area, volume) = area_and_volume(&mesh);
        compactness.push(area.powf(1.5) / volume);
    }
    compactness.sort_by(f64::total_cmp);
    let (least, most) = (compactness[0], compactness[compactness.len() - 1]);
    assert!(
        most / least > 1.5,
        "random species all look alike: {least} to {most}"
    );
}

#[test]
fn the_seed_decides_everything() {
    let all = species(SEED, 18);
    assert_eq!(all.len(), 18);
    assert_eq!(all[17].name(), Species::random(SEED, 1).name());
    assert_eq!(all[17].skeleton(), Species::random(SEED, 1).skeleton());
    assert_ne!(all[17].skeleton(), Species::random(SEED + 1, 1).skeleton());
    let man = &all[0];
    let first = man.pose(SEED, 4, &small()).unwrap();
    assert_eq!(first, man.pose(SEED, 4, &small()).unwrap());
    assert_ne!(first, man.pose(SEED + 1, 4, &small()).unwrap());
    assert_ne!(first, man.pose(SEED, 5, &small()).unwrap());
}

#[test]
fn poses_do_not_share_a_triangulation() {
    // Sorted vertex degrees are the same for two meshes of one connectivity, whatever the vertex order.
    let horse = &Species::named()[4];
    let mut seen = HashSet::new();
    for pose in 0..6 {
        let mesh = horse.pose(SEED, pose, &small()).unwrap();
        let mut degree = vec![0u32; mesh.vertices.len()];
        for &v in mesh.faces.iter().flatten() {
            degree[v as usize] += 1;
        }
        degree.sort_unstable();
        assert!(seen.insert(degree), "pose {pose} repeats a triangulation");
    }
}

#[test]
fn creatures_bend_without_stretching() {
    // Surface^(3/2) / volume has no unit; a body that bends keeps both.
    for s in Species::named() {
        let values: Vec<f64> = (0..4)
            .map(|pose| {
                let (area, volume) = area_and_volume(&s.pose(SEED, pose, &small()).unwrap());
                area.powf(1.5) / volume
            })
            .collect();
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        let spread = values.iter().map(|v| (v / mean - 1.0).abs()).fold(0.0, f64::max);
        assert!(
            spread < 0.05,
            "{}: area^1.5 / volume spreads by {spread}",
            s.name()
        );
    }
}

#[test]
fn upright_creatures_stand_and_others_are_moved() {
    let giraffe = Species::named()
        .into_iter()
        .find(|s| s.name() == "giraffe")
        .unwrap();
    let upright = ZooOptions {
        upright: true,
        ..small()
    };
    let extent = |mesh: &TriangleSoup, axis: usize| {
        let along = mesh.vertices.iter().map(|v| v[axis]);
        along.clone().fold(f64::MIN, f64::max) - along.fold(f64::MAX, f64::min)
    };
    let standing = giraffe.pose(SEED, 0, &upright).unwrap();
    assert!(extent(&standing, 1) > 1.3 * extent(&standing, 0));
    let moved = giraffe.pose(SEED, 0, &small()).unwrap();
    let (a, b) = (area_and_volume(&standing).0, area_and_volume(&moved).0);
    let scale = (b / a).sqrt();
    assert!((0.5..=2.0).contains(&scale) && (scale - 1.0).abs() > 1e-6);
}

#[test]
fn impossible_options_are_refused_by_name() {
    let man = &Species::named()[0];
    for (min_vertices, max_vertices) in [(10, 100), (2000, 1000), (1000, 10_000_000)] {
        let options = ZooOptions {
            min_vertices,
            max_vertices,
            ..ZooOptions::default()
        };
        let error = man.pose(SEED, 0, &options).unwrap_err().to_string();
        assert!(error.contains(&max_vertices.to_string()), "{error}");
    }
}

#[test]
fn obj_bytes_read_back_exactly() {
    let mesh = Species::named()[2].pose(SEED, 0, &small()).unwrap();
    let bytes = write_obj(&mesh);
    let (models, _) = tobj::load_obj_buf(&mut bytes.as_slice(), &tobj::LoadOptions::default(), |_| {
        Err(tobj::LoadError::OpenFileFailed)
    })
    .unwrap();
    assert_eq!(models.len(), 1);
    let read = &models[0].mesh;
    assert_eq!(read.indices.len(), 3 * mesh.faces.len());
    // tobj numbers vertices by first use; corners are compared by place.
    for (corner, &i) in mesh.faces.iter().flatten().enumerate() {
        let j = read.indices[corner] as usize;
        assert_eq!(&read.positions[3 * j..3 * j + 3], &mesh.vertices[i as usize]);
    }
}

#[test]
fn glb_bytes_read_back_to_single_precision() {
    let mesh = Species::named()[12].pose(SEED, 0, &small()).unwrap();
    let bytes = write_glb(&mesh);
    // `from_slice` validates the document: accessor bounds, buffer lengths, indices of everything.
    let file = gltf::Gltf::from_slice(&bytes).unwrap();
    let blob = file.blob.as_deref().unwrap();
    let primitive = file.meshes().next().unwrap().primitives().next().unwrap();
    assert_eq!(primitive.mode(), gltf::mesh::Mode::Triangles);
    let reader = primitive.reader(|_| Some(blob));
    let positions: Vec<[f32; 3]> = reader.read_positions().unwrap().collect();
    let expected: Vec<[f32; 3]> = mesh.vertices.iter().map(|v| v.map(|x| x as f32)).collect();
    assert_eq!(positions, expected);
    let indices: Vec<u32> = reader.read_indices().unwrap().into_u32().collect();
    assert_eq!(indices, mesh.faces.concat());
    let bounds = primitive.bounding_box();
    for axis in 0..3 {
        let along = expected.iter().map(|p| p[axis]);
        assert_eq!(bounds.min[axis], along.clone().fold(f32::MAX, f32::min));
        assert_eq!(bounds.max[axis], along.fold(f32::MIN, f32::max));
    }
    assert_eq!(
        u32::from_le_bytes(bytes[8..12].try_into().unwrap()) as usize,
        bytes.len()
    );
    assert_eq!(bytes.len() % 4, 0);
}
