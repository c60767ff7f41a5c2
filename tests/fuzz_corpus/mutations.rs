//! Changed inputs of the corpora of glTF, for where there is no libFuzzer: a bounded number of them in every test run,
//! or as long as `SHAPELEX_MUTATE_SECONDS` says.

use crate::mesh;
use shapelex_core::mesh::Format;
use std::path::Path;
use std::time::{Duration, Instant};

/// Inputs that are tried where no time is given.
const ROUNDS: usize = 1500;
/// Longest time one input may take, as under libFuzzer.
const LIMIT: Duration = Duration::from_secs(5);

/// A generator of pseudo-random numbers (Marsaglia's xorshift).
struct Random(u64);

impl Random {
    fn below(&mut self, limit: usize) -> usize {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 % limit.max(1) as u64) as usize
    }
}

/// Where the binary chunk of a GLB begins, so that half of the changes fall into it.
fn binary_of(bytes: &[u8]) -> usize {
    bytes
        .windows(4)
        .position(|w| w == b"BIN\0")
        .map_or(0, |at| at + 4)
}

fn change(bytes: &mut Vec<u8>, random: &mut Random) {
    let binary = binary_of(bytes);
    for _ in 0..=random.below(4) {
        if bytes.is_empty() {
            return;
        }
        let at = match random.below(3) {
            0 => random.below(bytes.len()),
            // The beginning of a stream has its counts.
            1 => (binary + random.below(64)).min(bytes.len() - 1),
            _ => binary + random.below(bytes.len() - binary),
        };
        match random.below(6) {
            0 => bytes[at] ^= 1 << random.below(8),
            1 => bytes[at] = random.below(256) as u8,
            2 => bytes[at] = [0, 1, 0x7f, 0x80, 0xff, b'9'][random.below(6)],
            3 => {
                let length = random.below(16).min(bytes.len() - at);
                let from = random.below(bytes.len() - length);
                bytes.copy_within(from..from + length, at);
            }
            4 if at > binary => bytes.truncate(at),
            _ => {
                if let Some(digit) = bytes[at..].iter().position(u8::is_ascii_digit) {
                    bytes[at + digit] = b'0' + random.below(10) as u8;
                }
            }
        }
    }
}

#[test]
fn changed_gltf_files_keep_what_the_targets_check() {
    let seconds: Option<u64> = std::env::var("SHAPELEX_MUTATE_SECONDS")
        .ok()
        .and_then(|s| s.parse().ok());
    let mut inputs = Vec::new();
    for (target, format) in [("mesh_glb", Format::Glb), ("mesh_gltf", Format::Gltf)] {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR"))
            .join("fuzz/corpus")
            .join(target);
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            let bytes = std::fs::read(&path).unwrap();
            // Seeds of compressed files are few among many, so each counts for twenty.
            let name = path.file_name().unwrap().to_string_lossy().into_owned();
            let weight = if name.contains("draco") || name.contains("meshopt") {
                20
            } else {
                1
            };
            inputs.extend(std::iter::repeat_n((format, bytes), weight));
        }
    }
    assert!(inputs.len() > 100, "{} inputs", inputs.len());
    let mut random = Random(seconds.map_or(0x9e37_79b9_7f4a_7c15, |_| u64::from(std::process::id()) + 1));
    let (began, mut rounds, mut slowest) = (Instant::now(), 0usize, Duration::ZERO);
    while seconds.map_or(rounds < ROUNDS, |s| began.elapsed() < Duration::from_secs(s)) {
        let (format, mut bytes) = inputs[random.below(inputs.len())].clone();
        change(&mut bytes, &mut random);
        let started = Instant::now();
        let checked = std::panic::catch_unwind(|| mesh::check(&bytes, Some(format)));
        let took = started.elapsed();
        slowest = slowest.max(took);
        rounds += 1;
        if checked.is_err() || took > LIMIT {
            let kept = std::env::temp_dir().join(format!("shapelex-mutated-{rounds}.{}", format.extension()));
            std::fs::write(&kept, &bytes).unwrap();
            panic!("round {rounds}, {took:?}: {}", kept.display());
        }
    }
    println!("{rounds} inputs, the slowest took {slowest:?}");
}
