//! The real process, killed at random moments, on a disk that may be full: what was acknowledged must be there at the
//! next start, byte for byte, and nothing half-made.
//!
//! `SHAPELEX_KILLS` sets how often it is killed (30 unless told otherwise; a night takes 500), `SHAPELEX_STARTS` how
//! often it starts on a full disk (16), `SHAPELEX_SEED` where the randomness starts.
#![cfg(unix)]

mod client;
mod denied;
mod disk;
mod disk_full;
mod full_starts;
mod kills;
mod memory;
mod model;
mod process;
mod restores;
mod upgrades;

/// A bumpy torus as OFF text; every seed gives another one, so that no two uploads are the same file.
pub fn mesh(seed: u32) -> String {
    const AROUND: usize = 16;
    const ACROSS: usize = 9;
    let bump = f64::from(seed % 97) / 97.0;
    let mut text = format!("OFF\n# {seed}\n{} {} 0\n", AROUND * ACROSS, 2 * AROUND * ACROSS);
    for i in 0..AROUND {
        for j in 0..ACROSS {
            let u = std::f64::consts::TAU * i as f64 / AROUND as f64;
            let v = std::f64::consts::TAU * j as f64 / ACROSS as f64;
            let r = 0.35 + 0.1 * bump * (3.0 * u).sin() + 0.03 * (2.0 * v + bump).cos();
            let ring = 1.0 + r * v.cos();
            let (x, y, z) = (ring * u.cos(), ring * u.sin() * (1.0 + 0.4 * bump), r * v.sin());
            text += &format!("{x:.6} {y:.6} {z:.6}\n");
        }
    }
    let at = |i: usize, j: usize| (i % AROUND) * ACROSS + j % ACROSS;
    for i in 0..AROUND {
        for j in 0..ACROSS {
            let (a, b, c, d) = (at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1));
            text += &format!("3 {a} {b} {c}\n3 {a} {c} {d}\n");
        }
    }
    text
}
