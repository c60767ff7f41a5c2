//! Cost over size on logarithmic axes, with the exponent of a power law.

use super::axes::Axis;
use super::lines::{Line, line_chart};
use super::{FigureError, Series};

/// What is measured against what, each with its unit.
#[derive(Clone, Copy, Debug)]
pub struct CostAxes<'a> {
    /// Such as `vertices`.
    pub x: &'a str,
    /// Such as `time (s)`.
    pub y: &'a str,
}

/// y = factor · x^exponent.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PowerLaw {
    /// Slope on logarithmic axes: 1 is linear growth, 2 quadratic.
    pub exponent: f64,
    /// y at x = 1.
    pub factor: f64,
}

/// The power law nearest to the points in the least squares of the logarithms; `None` with fewer than two different
/// positive x.
pub fn fit_power_law(points: &[(f64, f64)]) -> Option<PowerLaw> {
    let logs: Vec<(f64, f64)> = positive(points).map(|(x, y)| (x.ln(), y.ln())).collect();
    let n = logs.len() as f64;
    let mean_x = logs.iter().map(|p| p.0).sum::<f64>() / n;
    let mean_y = logs.iter().map(|p| p.1).sum::<f64>() / n;
    let spread: f64 = logs.iter().map(|p| (p.0 - mean_x).powi(2)).sum();
    let common: f64 = logs.iter().map(|p| (p.0 - mean_x) * (p.1 - mean_y)).sum();
    if spread.is_nan() || spread <= 1e-12 {
        return None;
    }
    let exponent = common / spread;
    Some(PowerLaw {
        exponent,
        factor: (mean_y - exponent * mean_x).exp(),
    })
}

/// Draws one line per series on logarithmic axes. The legend gives each series' fitted exponent. Points with a
/// coordinate that is not positive and finite are left out.
///
/// # Errors
/// [`FigureError::Empty`] without a point that can be drawn.
pub fn cost_curves(title: &str, axes: CostAxes<'_>, series: &[Series]) -> Result<String, FigureError> {
    let all: Vec<(f64, f64)> = series.iter().flat_map(|s| positive(&s.points)).collect();
    if all.is_empty() {
        return Err(FigureError::Empty { what: "points" });
    }
    let labels: Vec<String> = series
        .iter()
        .map(|s| match fit_power_law(&s.points) {
            Some(law) => format!("{} ~ x^{:.2}", s.label, law.exponent),
            None => s.label.clone(),
        })
        .collect();
    let description = format!("{} over {}: {}.", axes.y, axes.x, labels.join(", "));
    let x = Axis::logarithmic(axes.x, range(all.iter().map(|p| p.0)), 7);
    let y = Axis::logarithmic(axes.y, range(all.iter().map(|p| p.1)), 7);
    line_chart(title, &description, (x, y), &|plot| {
        series
            .iter()
            .zip(&labels)
            .map(|(s, label)| {
                let points: Vec<(i32, i32)> = positive(&s.points).map(|p| plot.place(p)).collect();
                (
                    label.clone(),
                    Line {
                        marks: points.clone(),
                        points,
                    },
                )
            })
            .collect()
    })
}

fn positive(points: &[(f64, f64)]) -> impl Iterator<Item = (f64, f64)> + '_ {
    let good = |v: f64| v.is_finite() && v > 0.0;
    points.iter().copied().filter(move |&(x, y)| good(x) && good(y))
}

/// From the least to the greatest value, with some room.
fn range(values: impl Iterator<Item = f64>) -> (f64, f64) {
    let (low, high) = values.fold((f64::INFINITY, 0.0f64), |(l, h), v| (l.min(v), h.max(v)));
    (low / 1.3, high * 1.3)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_power_law_is_recovered() {
        let points: Vec<(f64, f64)> = [10.0, 100.0, 1e4]
            .iter()
            .map(|&x: &f64| (x, 3.0 * x.powf(1.5)))
            .collect();
        let law = fit_power_law(&points).unwrap();
        assert!((law.exponent - 1.5).abs() < 1e-12, "{law:?}");
        assert!((law.factor - 3.0).abs() < 1e-9, "{law:?}");
        assert_eq!(fit_power_law(&points[..1]), None);
        assert_eq!(fit_power_law(&[(0.0, 1.0), (-1.0, 2.0), (5.0, f64::NAN)]), None);
    }
}
