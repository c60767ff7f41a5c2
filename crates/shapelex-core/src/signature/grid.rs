//! Where along the spectrum a descriptor is evaluated.

/// `count` values evenly spaced from `low` to `high`, both included.
pub fn linspace(low: f64, high: f64, count: usize) -> Vec<f64> {
    let step = if count > 1 {
        (high - low) / (count - 1) as f64
    } else {
        0.0
    };
    (0..count).map(|i| low + step * i as f64).collect()
}
