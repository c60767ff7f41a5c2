//! Round numbers along an axis, each written once and with as many decimals as tell it from its neighbours.

/// A place on an axis and what is written there.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Tick {
    /// The value.
    pub at: f64,
    /// The value as text.
    pub text: String,
}

/// What an axis counts or measures.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Quantity {
    /// Any number.
    Real,
    /// Whole numbers only.
    Count,
    /// Shares, written as percent.
    Share,
}

/// About as many ticks as are aimed at, at multiples of 1, 2 or 5 times a power of ten within the range; more where
/// there would be only one.
pub(super) fn linear(range: (f64, f64), aim: usize, quantity: Quantity) -> Vec<Tick> {
    let most = aim + 6;
    (aim.max(1)..=most)
        .map(|aim| divided(range, aim, quantity))
        .find(|ticks| ticks.len() >= 2)
        .unwrap_or_else(|| divided(range, most, quantity))
}

fn divided((low, high): (f64, f64), aim: usize, quantity: Quantity) -> Vec<Tick> {
    let unit = if quantity == Quantity::Share { 100.0 } else { 1.0 };
    let (low, high) = (low * unit, high * unit);
    let finite = low.is_finite() && high.is_finite() && high > low;
    if !finite {
        return Vec::new();
    }
    let mut step = step((high - low) / aim as f64);
    if quantity == Quantity::Count {
        step = step.max(1.0);
    }
    let decimals = (-step.log10().floor()).max(0.0) as usize;
    let slack = step * 1e-9;
    let first = ((low - slack) / step).ceil() as i64;
    let last = ((high + slack) / step).floor() as i64;
    (first..=last)
        .map(|k| {
            let value = k as f64 * step;
            let number = if decimals > 6 || value.abs() >= 1e7 {
                format!("{value:.2e}")
            } else {
                format!("{value:.decimals$}")
            };
            Tick {
                at: value / unit,
                text: if quantity == Quantity::Share {
                    format!("{number} %")
                } else {
                    number
                },
            }
        })
        .collect()
}

/// The least of 1, 2, 5, 10 … times a power of ten that is no less.
fn step(raw: f64) -> f64 {
    let power = 10f64.powf(raw.log10().floor());
    let nice = [1.0, 2.0, 5.0, 10.0]
        .into_iter()
        .find(|n| n * power >= raw * (1.0 - 1e-9));
    nice.unwrap_or(10.0) * power
}

/// Ticks of a logarithmic axis: powers of ten, and their multiples by 2 and 5 where there is room; a range within a
/// power of ten is divided evenly.
pub(super) fn logarithmic((low, high): (f64, f64), aim: usize) -> Vec<Tick> {
    if !(low > 0.0 && high > low && high.is_finite()) {
        return Vec::new();
    }
    let powers = low.log10().floor() as i32..=high.log10().ceil() as i32;
    let of = |factors: &[f64]| -> Vec<f64> {
        powers
            .clone()
            .flat_map(|p| factors.iter().map(move |f| f * 10f64.powi(p)))
            .filter(|v| (low * 0.999_999..=high * 1.000_001).contains(v))
            .collect()
    };
    let sets = [of(&[1.0, 2.0, 5.0]), of(&[1.0])];
    let fitting = sets.iter().find(|set| set.len() <= aim + 1).unwrap_or(&sets[1]);
    if fitting.len() < 3 && sets[0].len() < 3 {
        return linear((low, high), aim, Quantity::Real);
    }
    let every = fitting.len().div_ceil(aim + 1).max(1);
    fitting
        .iter()
        .step_by(every)
        .map(|&at| Tick { at, text: short(at) })
        .collect()
}

/// 200, 50k, 3M; below one as it is.
fn short(value: f64) -> String {
    let tidy = |scaled: f64, unit: &str| format!("{}{unit}", (scaled * 10.0).round() / 10.0);
    match value {
        v if v >= 1e9 => tidy(v / 1e9, "G"),
        v if v >= 1e6 => tidy(v / 1e6, "M"),
        v if v >= 1e3 => tidy(v / 1e3, "k"),
        v if v >= 1.0 => tidy(v, ""),
        v => super::canvas::number(v),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn texts(ticks: &[Tick]) -> Vec<&str> {
        ticks.iter().map(|t| t.text.as_str()).collect()
    }

    #[test]
    fn counts_are_whole_and_nothing_is_written_twice() {
        assert_eq!(
            texts(&linear((0.0, 3.0), 5, Quantity::Count)),
            ["0", "1", "2", "3"]
        );
        assert_eq!(texts(&linear((0.0, 1.0), 4, Quantity::Count)), ["0", "1"]);
        assert_eq!(
            texts(&linear((0.0, 0.02), 4, Quantity::Share)),
            ["0.0 %", "0.5 %", "1.0 %", "1.5 %", "2.0 %"]
        );
        assert_eq!(
            texts(&linear((0.0, 1.0), 5, Quantity::Share)),
            ["0 %", "20 %", "40 %", "60 %", "80 %", "100 %"]
        );
        for (low, high) in [(0.377, 0.378), (-0.3, 0.3), (0.0, 1e-9), (1e8, 1.1e8), (5.0, 5.3)] {
            for aim in 2..8 {
                let ticks = linear((low, high), aim, Quantity::Real);
                let mut unique = texts(&ticks);
                assert!(
                    unique.len() >= 2 && unique.len() <= aim + 2,
                    "{low} {high}: {unique:?}"
                );
                unique.dedup();
                assert_eq!(unique.len(), ticks.len(), "{unique:?}");
            }
        }
        assert!(linear((1.0, 1.0), 4, Quantity::Real).is_empty());
        assert!(!texts(&linear((-1.0, 1.0), 4, Quantity::Real)).contains(&"-0.0"));
    }

    #[test]
    fn logarithmic_axes_have_powers_or_what_fits() {
        assert_eq!(texts(&logarithmic((1e3, 1e6), 7)), ["1k", "10k", "100k", "1M"]);
        assert_eq!(
            texts(&logarithmic((1.0, 100.0), 7)),
            ["1", "2", "5", "10", "20", "50", "100"]
        );
        let narrow = logarithmic((1100.0, 1400.0), 5);
        assert!(narrow.len() >= 3, "{narrow:?}");
        let wide = logarithmic((1e-12, 1e12), 7);
        assert!(wide.len() <= 9, "{wide:?}");
        let short: Vec<String> = [0.002, 0.5, 1.0, 20.0, 1000.0, 2.5e6].map(super::short).to_vec();
        assert_eq!(short, ["0.002", "0.5", "1", "20", "1k", "2.5M"]);
    }
}
