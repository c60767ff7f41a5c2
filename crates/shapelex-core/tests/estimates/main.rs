//! What admission reserves, against what is allocated: never too little, and not so much that nobody gets in.

use shapelex_core::cancel::Cancel;
use shapelex_core::memory::MemoryBudget;
use shapelex_core::mesh::{MeshError, TriangleSoup};
use shapelex_core::parameters::{Parameters, Preset};
use shapelex_core::pipeline::estimate::{self, Role};
use shapelex_core::pipeline::{
    Description, PipelineError, Within, describe_query, describe_query_within, describe_shape,
    held_out_scores, learn_model,
};
use std::alloc::{GlobalAlloc, Layout, System};
use std::f64::consts::{PI, TAU};
use std::sync::atomic::{AtomicUsize, Ordering};

/// The system's allocator, counted.
struct Counted;

static NOW: AtomicUsize = AtomicUsize::new(0);
static PEAK: AtomicUsize = AtomicUsize::new(0);

fn grown(bytes: usize) {
    let now = NOW.fetch_add(bytes, Ordering::Relaxed) + bytes;
    PEAK.fetch_max(now, Ordering::Relaxed);
}

#[allow(unsafe_code, reason = "an allocator has no other interface")]
// SAFETY: every call goes on to the system's allocator unchanged.
unsafe impl GlobalAlloc for Counted {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        grown(layout.size());
        // SAFETY: the caller's promises are passed on.
        unsafe { System.alloc(layout) }
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        grown(layout.size());
        // SAFETY: the caller's promises are passed on.
        unsafe { System.alloc_zeroed(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        NOW.fetch_sub(layout.size(), Ordering::Relaxed);
        // SAFETY: the caller's promises are passed on.
        unsafe { System.dealloc(pointer, layout) }
    }

    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        grown(size);
        NOW.fetch_sub(layout.size(), Ordering::Relaxed);
        // SAFETY: the caller's promises are passed on.
        unsafe { System.realloc(pointer, layout, size) }
    }
}

#[global_allocator]
static ALLOCATOR: Counted = Counted;

/// What a piece of work allocates at its peak beyond what there was, in bytes, on a pool of its own.
fn peak_of<T: Send>(work: impl FnOnce() -> T + Send) -> (T, u64) {
    let mut threads = Vec::new();
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(2)
        .spawn_handler(|thread| {
            threads.push(std::thread::spawn(|| thread.run()));
            Ok(())
        })
        .build()
        .unwrap();
    let measured = pool.install(|| {
        let before = NOW.load(Ordering::Relaxed);
        PEAK.store(before, Ordering::Relaxed);
        let done = work();
        (done, (PEAK.load(Ordering::Relaxed) - before) as u64)
    });
    // What a thread keeps is freed when it ends, and must not be counted as there when the next piece of work begins.
    drop(pool);
    for thread in threads {
        thread.join().unwrap();
    }
    measured
}

/// A bumpy sphere of rings; without the caps it is open at both ends.
fn sphere(rings: u32, around: u32, open: bool) -> TriangleSoup {
    let mut soup = TriangleSoup::default();
    let cut = if open { 0.6 } else { 0.02 };
    for i in 0..rings {
        let polar = cut + (PI - 2.0 * cut) * f64::from(i) / f64::from(rings - 1);
        for j in 0..around {
            let turn = TAU * f64::from(j) / f64::from(around);
            // Without a symmetry, so that no two signatures are equal.
            let bumps = 0.25 * (3.0 * turn + polar).cos() * polar.sin() + 0.1 * (turn + 0.3).sin();
            let r = 1.0 + bumps + 0.1 * (5.0 * polar).sin();
            soup.vertices.push([
                1.3 * r * polar.sin() * turn.cos(),
                r * polar.sin() * turn.sin(),
                r * polar.cos(),
            ]);
        }
    }
    let at = |i: u32, j: u32| i * around + j % around;
    for i in 0..rings - 1 {
        for j in 0..around {
            soup.faces.push([at(i, j), at(i, j + 1), at(i + 1, j)]);
            soup.faces.push([at(i, j + 1), at(i + 1, j + 1), at(i + 1, j)]);
        }
    }
    if !open {
        for (ring, out) in [(0, false), (rings - 1, true)] {
            let tip = soup.vertices.len() as u32;
            soup.vertices.push([0.0, 0.0, if out { -1.0 } else { 1.0 }]);
            for j in 0..around {
                let (a, b) = (at(ring, j), at(ring, j + 1));
                soup.faces.push(if out { [a, b, tip] } else { [b, a, tip] });
            }
        }
    }
    soup
}

/// Checks an estimate and prints both.
fn compare(what: &str, peak: u64, estimate: u64, wrong: &mut Vec<String>) {
    let line = format!(
        "{what}: {:.1} MB allocated, {:.1} MB estimated, {:.2} times",
        peak as f64 / 1e6,
        estimate as f64 / 1e6,
        estimate as f64 / peak as f64
    );
    println!("{line}");
    if peak > estimate || estimate > 8 * peak + (16 << 20) {
        wrong.push(line);
    }
}

fn variants() -> Vec<(String, Parameters)> {
    let mut all: Vec<(String, Parameters)> = Preset::ALL
        .iter()
        .map(|preset| (format!("{preset:?}"), Parameters::preset(*preset)))
        .collect();
    all.push((
        "many eigenpairs".to_owned(),
        Parameters {
            eigenpairs: 500,
            part_eigenpairs: 800,
            ..Parameters::preset(Preset::Robust)
        },
    ));
    all.push((
        "unsimplified".to_owned(),
        Parameters {
            working_size: 0,
            query_samples: 0,
            samples_per_shape: 0,
            ..Parameters::default()
        },
    ));
    all.push((
        "refined".to_owned(),
        Parameters {
            refine_below: 8000,
            ..Parameters::default()
        },
    ));
    all
}

// One test, so that the memory of one case is not counted for another.
#[test]
fn what_is_reserved_is_enough_and_not_absurd() {
    let cancel = Cancel::new();
    let mut wrong = Vec::new();
    for (name, parameters) in variants() {
        for (mesh, soup) in [
            ("small closed", sphere(20, 30, false)),
            ("closed", sphere(60, 100, false)),
            ("open", sphere(60, 100, true)),
            ("small open", sphere(20, 40, true)),
        ] {
            let (vertices, faces) = (soup.vertices.len(), soup.faces.len());
            for role in [Role::Query, Role::Training] {
                let estimate = estimate::describing_bytes(vertices, &parameters, role)
                    .max(estimate::preparing_bytes(vertices, faces));
                let soup = soup.clone();
                let (described, peak) = peak_of(|| match role {
                    Role::Query => describe_query(soup, &parameters, &cancel, &|_| ()),
                    Role::Training => describe_shape(soup, &parameters, &cancel, &|_| ()),
                });
                let described = described.unwrap_or_else(|e| panic!("{name}, {mesh}: {e}"));
                compare(&format!("{name}, {mesh}, {role:?}"), peak, estimate, &mut wrong);
                let kept: usize = described
                    .views
                    .iter()
                    .map(|v| v.signatures.matrix.ncols() * v.signatures.matrix.nrows())
                    .sum();
                let prepared = estimate::prepared_vertices(vertices, &parameters);
                let most = estimate::description_bytes(prepared, &parameters, role);
                assert!(
                    8 * kept as u64 <= most,
                    "{name}, {mesh}, {role:?}: {kept} values, {most}"
                );
            }
        }
    }
    let large = sphere(400, 500, false);
    let (vertices, faces) = (large.vertices.len(), large.faces.len());
    let (_, peak) = peak_of(|| shapelex_core::mesh::prepare(large, &Parameters::default().prepare_options()));
    let estimate = estimate::preparing_bytes(vertices, faces);
    compare("preparing 200000 vertices", peak, estimate, &mut wrong);

    for (name, parameters) in [
        ("default", Parameters::default()),
        ("robust", Parameters::preset(Preset::Robust)),
        (
            "many atoms",
            Parameters {
                atoms: 2500,
                energies: 400,
                iterations: 2,
                batch: 3000,
                ..Parameters::default()
            },
        ),
    ] {
        let describe = |k: u32| describe_shape(sphere(20 + k, 60, false), &parameters, &cancel, &|_| ());
        let shapes: Vec<Description> = (0..4).map(|k| describe(k).unwrap()).collect();
        let all: Vec<&Description> = shapes.iter().collect();
        let signatures: usize = all.iter().map(|d| d.views[0].signatures.len()).sum();
        let largest = estimate::description_bytes(2000, &parameters, Role::Training);
        let estimate = estimate::learning_bytes(0, largest, signatures, &parameters);
        let (_, peak) = peak_of(|| {
            let model = learn_model(&all, &parameters, &cancel, &|_, _| ()).unwrap();
            (held_out_scores(&all, &parameters, &cancel).unwrap(), model)
        });
        compare(&format!("learning, {name}"), peak, estimate, &mut wrong);
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    tangles_are_counted();
}

/// Random faces between random points.
fn tangle(vertices: u32, faces: usize) -> TriangleSoup {
    let mut state = 88_172_645_463_325_252u64;
    let mut next = move || {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        (state >> 32) as u32
    };
    TriangleSoup {
        vertices: (0..vertices)
            .map(|_| std::array::from_fn(|_| f64::from(next())))
            .collect(),
        faces: (0..faces)
            .map(|_| std::array::from_fn(|_| next() % vertices))
            .collect(),
        ..TriangleSoup::default()
    }
}

/// What a factor takes on a tangle is reserved before it is made.
fn tangles_are_counted() {
    let parameters = Parameters {
        working_size: 0,
        ..Parameters::preset(Preset::Default)
    };
    let cancel = Cancel::new();
    // The factor of 8000 vertices that are all but all joined is dense: 256 MB, and as much while it is packed.
    let budget = MemoryBudget::new(400 << 20);
    let memory = budget.reservation();
    let within = Within {
        cancel: &cancel,
        memory: &memory,
    };
    let refused = describe_query_within(tangle(8000, 400_000), &parameters, within, &|_| ());
    assert!(
        matches!(refused, Err(PipelineError::Mesh(MeshError::Memory(_)))),
        "{refused:?}"
    );
    assert_eq!(budget.used(), 0);
    // A surface of as many vertices fits.
    let surface = describe_query_within(sphere(80, 100, false), &parameters, within, &|_| ());
    assert_eq!(surface.unwrap().report.vertices, 8002);
    assert_eq!(budget.used(), 0);
}
