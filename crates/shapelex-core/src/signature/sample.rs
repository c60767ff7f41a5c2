//! Which vertices give signatures.

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// At most `count` of the first `mass.len()` vertices, drawn without replacement with probability proportional to
/// their mass (area), in ascending order; all of them where `count` is 0 or not smaller.
///
/// Drawing by exponential keys (Efraimidis, Spirakis 2006): the `count` largest of ln(u)/w.
pub fn sample_by_area(mass: &[f64], count: usize, seed: u64) -> Vec<u32> {
    if count == 0 || count >= mass.len() {
        return (0..mass.len() as u32).collect();
    }
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut keys: Vec<(f64, u32)> = mass
        .iter()
        .enumerate()
        .map(|(i, &w)| {
            let u: f64 = rng.random::<f64>().max(f64::MIN_POSITIVE);
            (u.ln() / w.max(f64::MIN_POSITIVE), i as u32)
        })
        .collect();
    keys.sort_unstable_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
    let mut chosen: Vec<u32> = keys[..count].iter().map(|k| k.1).collect();
    chosen.sort_unstable();
    chosen
}
