//! Meshes near the limits: memory is reserved before it is taken, and a stop is noticed at once.

use crate::shapes::*;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use shapelex_core::cancel::Cancel;
use shapelex_core::memory::MemoryBudget;
use shapelex_core::mesh::{MeshError, PrepareOptions, TriangleSoup, prepare_within};
use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::time::Duration;

/// Counts what a thread holds and has held at most.
struct Counting;

thread_local! {
    static HELD: Cell<i64> = const { Cell::new(0) };
    static PEAK: Cell<i64> = const { Cell::new(0) };
}

fn count(bytes: i64) {
    let _ = HELD.try_with(|held| {
        held.set(held.get() + bytes);
        let _ = PEAK.try_with(|peak| peak.set(peak.get().max(held.get())));
    });
}

// SAFETY: every call is passed on to the system's allocator unchanged.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        count(layout.size() as i64);
        // SAFETY: the caller's contract is that of `System`.
        unsafe { System.alloc(layout) }
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        count(layout.size() as i64);
        // SAFETY: as above.
        unsafe { System.alloc_zeroed(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        count(-(layout.size() as i64));
        // SAFETY: as above.
        unsafe { System.dealloc(pointer, layout) }
    }

    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        // Both may be there for a moment.
        count(size as i64);
        count(-(layout.size() as i64));
        // SAFETY: as above.
        unsafe { System.realloc(pointer, layout, size) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// Random faces between random points.
pub fn random_complex(vertices: u32, faces: u32) -> TriangleSoup {
    let mut rng = ChaCha8Rng::seed_from_u64(11);
    TriangleSoup {
        vertices: (0..vertices)
            .map(|_| std::array::from_fn(|_| rng.random_range(-1.0..1.0)))
            .collect(),
        faces: (0..faces)
            .map(|_| std::array::from_fn(|_| rng.random_range(0..vertices)))
            .collect(),
        ..Default::default()
    }
}

/// All unit squares of a lattice: four faces at every edge inside.
fn lattice(side: u32) -> TriangleSoup {
    let mut soup = TriangleSoup::default();
    let at = |p: [u32; 3]| (p[0] * side + p[1]) * side + p[2];
    for n in 0..side.pow(3) {
        let p = [n / side / side, n / side % side, n % side];
        soup.vertices.push(p.map(f64::from));
        for (u, v) in [(0, 1), (0, 2), (1, 2)] {
            if p[u] + 1 < side && p[v] + 1 < side {
                let step = |axes: &[usize]| {
                    let mut q = p;
                    axes.iter().for_each(|k| q[*k] += 1);
                    at(q)
                };
                let (a, b, c, d) = (at(p), step(&[u]), step(&[u, v]), step(&[v]));
                soup.faces.extend([[a, b, c], [a, c, d]]);
            }
        }
    }
    soup
}

/// A cone of `n` faces around one vertex.
fn fan(n: u32) -> TriangleSoup {
    TriangleSoup {
        vertices: (0..=n)
            .map(|i| {
                let turn = f64::from(i) / f64::from(n) * std::f64::consts::TAU;
                let r = f64::from(i.min(1));
                [r * turn.cos(), r * turn.sin(), 0.3 * r * (5.0 * turn).sin()]
            })
            .collect(),
        faces: (1..=n).map(|i| [0, i, i % n + 1]).collect(),
        ..Default::default()
    }
}

/// `n` faces on one edge.
fn book(n: u32) -> TriangleSoup {
    let mut soup = TriangleSoup {
        vertices: vec![[0.0; 3], [0.0, 0.0, 1.0]],
        ..Default::default()
    };
    for i in 0..n {
        let turn = 2.4 * f64::from(i);
        soup.vertices.push([turn.cos(), turn.sin(), 0.5]);
        soup.faces.push([0, 1, i + 2]);
    }
    soup
}

/// A strip of one face's width.
fn ribbon(n: u32) -> TriangleSoup {
    TriangleSoup {
        vertices: (0..n)
            .map(|i| {
                let turn = f64::from(i / 2) * 20.0 / f64::from(n);
                [turn.cos(), turn.sin(), 0.1 * turn + 0.02 * f64::from(i % 2)]
            })
            .collect(),
        faces: (2..n).map(|i| [i - 2, i - 1, i]).collect(),
        ..Default::default()
    }
}

/// A sphere in a random order, every second face turned round.
fn scrambled(side: u32) -> TriangleSoup {
    let mut soup = shuffled(&globe(side, side), 4);
    for f in soup.faces.iter_mut().step_by(2) {
        f.swap(0, 1);
    }
    soup
}

/// Each face a part of its own, with a noise that is a step of the file.
fn loose(side: u32) -> TriangleSoup {
    let mut soup = as_stl(&globe(side, side));
    for (i, p) in soup.vertices.iter_mut().enumerate() {
        p[i % 3] += 1e-7;
    }
    soup.resolution = 1e-7;
    soup
}

/// Points that lie so close that each may have to be welded to the next.
fn corner(n: u32) -> TriangleSoup {
    let mut soup = random_complex(n, 2 * n);
    soup.vertices.iter_mut().flatten().for_each(|x| *x *= 1e-6);
    soup.vertices[0] = [1.0; 3];
    soup
}

type Make = fn(u32) -> TriangleSoup;

/// Inputs of about `n` faces, by name.
const INPUTS: [(&str, Make); 9] = [
    ("random complex", |n| random_complex(n / 2, n)),
    ("dense complex", |n| random_complex(n / 100, n)),
    ("lattice", |n| lattice((f64::from(n) / 6.0).cbrt() as u32)),
    ("fan", fan),
    ("book", book),
    ("ribbon", ribbon),
    ("scrambled sphere", |n| {
        scrambled((f64::from(n) / 2.0).sqrt() as u32)
    }),
    ("loose faces", |n| loose((f64::from(n) / 6.0).sqrt() as u32)),
    ("points in a corner", |n| corner(n / 2)),
];

#[test]
fn memory_is_reserved_before_it_is_taken() {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    for (name, make) in INPUTS {
        pool.install(|| {
            let soup = make(300_000);
            let options = PrepareOptions::default();
            let bound =
                96 * soup.vertices.len() + 64 * soup.faces.len() + 1800 * options.working_size + (32 << 20);
            let budget = MemoryBudget::new(bound as u64);
            let reservation = budget.reservation();
            let base = HELD.get();
            PEAK.set(base);
            let result = prepare_within(soup, &options, &Cancel::new(), &reservation);
            let taken = PEAK.get() - base;
            if let Err(MeshError::Memory(error)) = &result {
                panic!("{name}: {error}");
            }
            assert!(taken <= bound as i64, "{name}: {taken} bytes, promised {bound}");
            assert_eq!(reservation.bytes(), 0, "{name}");
            eprintln!("{name}: {} MB of {} MB", taken >> 20, bound >> 20);
        });
    }
}

#[test]
fn what_is_not_granted_is_refused() {
    for (name, make) in INPUTS {
        let soup = make(100_000);
        let budget = MemoryBudget::new(100_000);
        let reservation = budget.reservation();
        let result = prepare_within(soup, &PrepareOptions::default(), &Cancel::new(), &reservation);
        assert!(matches!(result, Err(MeshError::Memory(_))), "{name}: {result:?}");
        assert_eq!(budget.used(), 0, "{name}");
    }
}

/// Nanoseconds a thread has run, by its folder in /proc; `None` where the system does not say.
fn processor_time(thread: &std::path::Path) -> Option<Duration> {
    let text = std::fs::read_to_string(thread.join("schedstat")).ok()?;
    Some(Duration::from_nanos(
        text.split_whitespace().next()?.parse().ok()?,
    ))
}

#[test]
fn a_stop_is_noticed_within_50_ms() {
    let Ok(me) = std::fs::read_link("/proc/thread-self") else {
        eprintln!("skipped: no /proc");
        return;
    };
    drop(me);
    let mut worst = Duration::ZERO;
    for (name, make) in INPUTS {
        let soup = make(1_900_000);
        for after in [50, 150, 300, 500, 800, 1200] {
            let soup = soup.clone();
            let cancel = Cancel::new();
            let (sender, receiver) = std::sync::mpsc::channel();
            let flag = cancel.clone();
            let worker = std::thread::spawn(move || {
                // One thread, so that its processor time is that of the work.
                let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
                pool.install(|| {
                    let thread =
                        std::path::Path::new("/proc").join(std::fs::read_link("/proc/thread-self").unwrap());
                    let began = processor_time(&thread);
                    sender.send((thread.clone(), began)).unwrap();
                    let memory = MemoryBudget::unlimited().reservation();
                    let result = prepare_within(soup, &PrepareOptions::default(), &flag, &memory);
                    (
                        matches!(result, Err(MeshError::Cancelled(_))),
                        processor_time(&thread),
                    )
                })
            });
            let (thread, began) = receiver.recv().unwrap();
            let Some(began) = began else {
                eprintln!("skipped: no schedstat");
                return;
            };
            let until = began + Duration::from_millis(after);
            while processor_time(&thread).is_some_and(|now| now < until) && !worker.is_finished() {
                std::thread::sleep(Duration::from_millis(1));
            }
            cancel.cancel();
            let stopped_at = processor_time(&thread);
            let (cancelled, ended_at) = worker.join().unwrap();
            if let (true, Some(from), Some(to)) = (cancelled, stopped_at, ended_at) {
                let took = to.saturating_sub(from);
                eprintln!("{name}, {after} ms: {:.1} ms", took.as_secs_f64() * 1e3);
                worst = worst.max(took);
                assert!(
                    took < Duration::from_millis(50),
                    "{name} after {after} ms: {took:?}"
                );
            }
        }
    }
    eprintln!("worst {worst:?}");
}
