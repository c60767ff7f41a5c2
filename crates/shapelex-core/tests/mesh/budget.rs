//! What the readers take: memory is reserved before, and a stop is seen soon.

use shapelex_core::cancel::Cancel;
use shapelex_core::memory::MemoryBudget;
use shapelex_core::mesh::{Format, Limits, MeshError, ReadContext, Source, TriangleSoup, read_within};
use std::fmt::Write;
use std::sync::Arc;
use std::time::{Duration, Instant};

fn read(bytes: &[u8], format: Format, context: &ReadContext) -> Result<TriangleSoup, MeshError> {
    let source = Source {
        bytes,
        media_type: Some(format.media_type()),
        ..Source::default()
    };
    read_within(&source, context).map(|(_, soup)| soup)
}

/// A height field of `side`² vertices, as quadrilaterals.
struct Field {
    side: usize,
}

impl Field {
    fn vertices(&self) -> impl Iterator<Item = [f32; 3]> {
        let side = self.side;
        (0..side * side).map(move |k| [(k % side) as f32, (k / side) as f32, (k * k % 97) as f32 * 0.01])
    }

    fn quads(&self) -> impl Iterator<Item = [usize; 4]> {
        let side = self.side;
        let corner = move |k: usize| k / (side - 1) * side + k % (side - 1);
        (0..(side - 1).pow(2)).map(move |k| [0, 1, side + 1, side].map(|d| corner(k) + d))
    }

    fn write(&self, format: Format, binary: bool) -> Vec<u8> {
        let (v, q) = (self.side.pow(2), (self.side - 1).pow(2));
        let mut text = String::new();
        match (format, binary) {
            (Format::Obj, _) => {
                self.vertices()
                    .for_each(|[x, y, z]| _ = writeln!(text, "v {x:.6} {y:.6} {z:.6}"));
                self.quads()
                    .for_each(|[a, b, c, d]| _ = writeln!(text, "f {} {} {} {}", a + 1, b + 1, c + 1, d + 1));
            }
            (Format::Ply, true) => return self.binary_ply(),
            (Format::Stl, true) => return self.binary_stl(),
            (Format::Stl, false) => {
                text += "solid\n";
                let points: Vec<_> = self.vertices().collect();
                for [a, b, c, d] in self.quads() {
                    for triangle in [[a, b, c], [a, c, d]] {
                        text += "facet normal 0 0 1\nouter loop\n";
                        triangle.iter().for_each(|&k| {
                            let [x, y, z] = points[k];
                            _ = writeln!(text, "vertex {x:.4} {y:.4} {z:.4}");
                        });
                        text += "endloop\nendfacet\n";
                    }
                }
                text += "endsolid\n";
            }
            _ => {
                text = if format == Format::Off {
                    format!("OFF\n{v} {q} 0\n")
                } else {
                    format!(
                        "ply\nformat ascii 1.0\nelement vertex {v}\nproperty float x\nproperty float y\nproperty float z\nelement face {q}\nproperty list uchar int vertex_indices\nend_header\n"
                    )
                };
                self.vertices()
                    .for_each(|[x, y, z]| _ = writeln!(text, "{x:.6} {y:.6} {z:.6}"));
                self.quads()
                    .for_each(|[a, b, c, d]| _ = writeln!(text, "4 {a} {b} {c} {d}"));
            }
        }
        text.into_bytes()
    }

    fn binary_ply(&self) -> Vec<u8> {
        let (v, q) = (self.side.pow(2), (self.side - 1).pow(2));
        let mut bytes = format!("ply\nformat binary_little_endian 1.0\nelement vertex {v}\nproperty float x\nproperty float y\nproperty float z\nelement face {q}\nproperty list uchar int vertex_indices\nend_header\n").into_bytes();
        bytes.extend(self.vertices().flatten().flat_map(f32::to_le_bytes));
        for quad in self.quads() {
            bytes.push(4);
            bytes.extend(quad.iter().flat_map(|&k| (k as u32).to_le_bytes()));
        }
        bytes
    }

    fn binary_stl(&self) -> Vec<u8> {
        let points: Vec<_> = self.vertices().collect();
        let mut bytes = vec![0; 80];
        bytes.extend((2 * (self.side - 1).pow(2) as u32).to_le_bytes());
        for [a, b, c, d] in self.quads() {
            for triangle in [[a, b, c], [a, c, d]] {
                bytes.extend([0; 12]);
                bytes.extend(
                    triangle
                        .iter()
                        .flat_map(|&k| points[k])
                        .flat_map(f32::to_le_bytes),
                );
                bytes.extend([0; 2]);
            }
        }
        bytes
    }
}

const FORMS: [(Format, bool); 6] = [
    (Format::Obj, false),
    (Format::Off, false),
    (Format::Ply, false),
    (Format::Ply, true),
    (Format::Stl, false),
    (Format::Stl, true),
];

#[test]
fn memory_is_reserved_and_what_is_temporary_given_back() {
    let field = Field { side: 100 };
    for (format, binary) in FORMS {
        let bytes = field.write(format, binary);
        let budget = MemoryBudget::new(100 << 20);
        let context = ReadContext {
            memory: Arc::new(budget.reservation()),
            ..ReadContext::new(Limits::default())
        };
        let soup = read(&bytes, format, &context).expect("small");
        assert_eq!(
            (soup.vertices.len(), soup.faces.len()),
            (10_000, 2 * 99 * 99),
            "{format}"
        );
        // What is still reserved is the soup.
        let held = (24 * soup.vertices.capacity() + 12 * soup.faces.capacity()) as u64;
        assert_eq!(context.memory.bytes(), held, "{format} {binary}");
        // Nothing stays after a refusal, and no step of growth is left out.
        for limit in [0, 1000, 100_000, held - 1] {
            let budget = MemoryBudget::new(limit);
            let context = ReadContext {
                memory: Arc::new(budget.reservation()),
                ..ReadContext::new(Limits::default())
            };
            let refused = read(&bytes, format, &context);
            assert!(
                matches!(refused, Err(MeshError::Memory(_))),
                "{format} {limit}: {refused:?}"
            );
            assert_eq!(budget.used(), 0, "{format} {limit}");
        }
    }
}

/// Texts that keep a reader busy in one place.
fn long_runs() -> Vec<(&'static str, Format, Vec<u8>)> {
    let mut runs = Vec::new();
    let length = 60 << 20;
    let tetrahedron = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\n";
    let fill = |head: &str, unit: &str| {
        let mut text = head.to_owned();
        text += &unit.repeat(length / unit.len());
        text.into_bytes()
    };
    runs.push(("blanks", Format::Obj, fill(tetrahedron, " ")));
    runs.push(("a comment", Format::Obj, fill(&format!("{tetrahedron}#"), "x")));
    runs.push(("a word", Format::Obj, fill(tetrahedron, "x")));
    runs.push(("line ends", Format::Obj, fill(tetrahedron, "\n")));
    runs.push((
        "continued lines",
        Format::Obj,
        fill(&format!("{tetrahedron}f 1 2 3"), "\\\n"),
    ));
    runs.push(("one face", Format::Obj, fill(&format!("{tetrahedron}f"), " 1")));
    runs.push(("a name", Format::Stl, fill("solid facet ", "x y")));
    runs.push(("lines of blanks", Format::Off, fill("OFF\n3 1 0\n", " \n")));
    runs.push(("a list passed over", Format::Ply, {
        let head = "ply\nformat ascii 1.0\nelement dust 1\nproperty list int int x\nend_header\n";
        fill(&format!("{head}{} ", length / 2), "1 ")
    }));
    runs.push(("keywords", Format::Stl, fill("solid\n", "endloop ")));
    runs.push(("rows passed over", Format::Ply, {
        let head = format!(
            "ply\nformat ascii 1.0\nelement dust {}\nproperty int x\nend_header\n",
            length / 2
        );
        fill(&head, "1\n")
    }));
    runs
}

#[test]
fn a_stop_is_seen_soon() {
    let field = Field { side: 900 };
    let mut inputs = long_runs();
    for (format, binary) in FORMS {
        inputs.push(("a field", format, field.write(format, binary)));
    }
    for (what, format, bytes) in inputs {
        for before in [0, 5, 50] {
            let context = ReadContext::new(Limits::default());
            let cancel: Cancel = context.cancel.clone();
            let (answer, late) = std::thread::scope(|scope| {
                let stopper = scope.spawn(move || {
                    std::thread::sleep(Duration::from_millis(before));
                    cancel.cancel();
                    Instant::now()
                });
                let answer = read(&bytes, format, &context);
                let ended = Instant::now();
                let stopped = stopper.join().expect("no panic");
                (answer, ended.saturating_duration_since(stopped))
            });
            // Stopped, or done before the next look at the flag. A busy machine may not run the thread for a while.
            let cancelled = matches!(answer, Err(MeshError::Cancelled(_)));
            assert!(
                cancelled || late < Duration::from_millis(20),
                "{format}, {what}: {late:?}"
            );
            assert!(late < Duration::from_millis(200), "{format}, {what}: {late:?}");
        }
    }
}

/// Processor time of this thread.
#[cfg(target_os = "linux")]
fn processor_time() -> Duration {
    let text = std::fs::read_to_string("/proc/thread-self/schedstat").expect("Linux");
    let nanoseconds = text.split(' ').next().and_then(|n| n.parse().ok());
    Duration::from_nanos(nanoseconds.expect("a number"))
}

/// Files just below the limits: prints and bounds the processor time and the memory reserved.
#[cfg(target_os = "linux")]
#[test]
fn files_below_the_limits_are_read_in_time() {
    // 1.99 million vertices, 3.98 million triangles; the ascii STL of them is longer than the limit.
    for (format, binary) in FORMS {
        let side = if (format, binary) == (Format::Stl, false) {
            900
        } else {
            1410
        };
        let bytes = Field { side }.write(format, binary);
        assert!(bytes.len() < Limits::default().max_bytes, "{} bytes", bytes.len());
        let budget = MemoryBudget::new(256 << 20);
        let context = ReadContext {
            memory: Arc::new(budget.reservation()),
            ..ReadContext::new(Limits::default())
        };
        let began = processor_time();
        let soup = read(&bytes, format, &context).expect("below the limits");
        let took = processor_time() - began;
        println!(
            "{format} {}: {} MB, {} faces, {:.2} s, {} MB held",
            if binary { "binary" } else { "text" },
            bytes.len() >> 20,
            soup.faces.len(),
            took.as_secs_f64(),
            context.memory.bytes() >> 20
        );
        assert!(took < Duration::from_secs(4), "{format}: {took:?}");
    }
}

/// One face of as many corners as the limits allow, and a line that is nothing but corners.
#[test]
fn long_lines_take_no_copies() {
    let budget = MemoryBudget::new(150 << 20);
    let attempt = |bytes: &[u8], format| {
        let context = ReadContext {
            memory: Arc::new(budget.reservation()),
            ..ReadContext::new(Limits::default())
        };
        read(bytes, format, &context)
    };
    let line = format!("v 0 0 0\nv 1 0 0\nv 0 1 0\nf{}\n", " 1".repeat(50 << 20));
    assert!(matches!(
        attempt(line.as_bytes(), Format::Obj),
        Err(MeshError::TooLarge { what: "faces", .. })
    ));
    let continued = format!(
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\nf{} 1 2 3\n",
        "\\\n".repeat(50 << 20)
    );
    assert_eq!(
        attempt(continued.as_bytes(), Format::Obj)
            .expect("valid")
            .faces
            .len(),
        2
    );
    assert_eq!(budget.used(), 0);
}

/// Polygons that make a simple algorithm slow: each is read within a bound on processor time that a square exceeds.
#[cfg(target_os = "linux")]
#[test]
fn polygons_of_many_corners_take_no_quadratic_time() {
    let obj = |points: &[[f64; 2]], corners: usize| {
        let mut text = String::new();
        points.iter().for_each(|[x, y]| _ = writeln!(text, "v {x} {y} 0"));
        for k in 0..points.len() / corners {
            text += "f";
            (1..=corners).for_each(|c| _ = write!(text, " {}", k * corners + c));
            text += "\n";
        }
        text.into_bytes()
    };
    let million = 1_000_000;
    let comb = |n: usize| -> Vec<[f64; 2]> {
        let teeth = (0..n - 2).map(|k| [k as f64, if k % 2 == 0 { 0.0 } else { n as f64 }]);
        teeth.chain([[n as f64, -1.0], [0.0, -1.0]]).collect()
    };
    let noise: Vec<[f64; 2]> = (0..2 * million as u64)
        .map(|k| [(k * k * 31 % 10_007) as f64, (k * k * k % 10_009) as f64])
        .collect();
    for (what, points, corners) in [
        ("a comb", comb(million), million),
        ("crossing", noise[..million].to_vec(), million),
        ("many crossing", noise.clone(), 32),
        ("many crossing, with a sweep", noise.clone(), 40),
        ("crossing quadrilaterals", noise, 4),
    ] {
        let bytes = obj(&points, corners);
        let context = ReadContext::new(Limits::default());
        let began = processor_time();
        let soup = read(&bytes, Format::Obj, &context).expect("polygons");
        let took = processor_time() - began;
        println!("{what}: {} faces, {:.2} s", soup.faces.len(), took.as_secs_f64());
        assert_eq!(soup.faces.len(), points.len() / corners * (corners - 2), "{what}");
        assert!(took < Duration::from_secs(5), "{what}: {took:?}");
    }
}
