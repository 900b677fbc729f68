//! Round numbers along an axis, and the horizontal axis that everything in a picture shares.

use super::canvas::{TEXT, width};
use crate::report::digits::Digits;

/// Positions of ticks and how they are labelled.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Ticks {
    pub(super) at: Vec<f64>,
    digits: Digits,
}

impl Ticks {
    /// About `wanted` multiples of 1, 2 or 5 · 10^k inside `[low, high]`.
    pub(super) fn new((low, high): (f64, f64), wanted: usize) -> Self {
        let raw = (high - low) / wanted.max(1) as f64;
        let decade = 10f64.powi(raw.log10().floor() as i32);
        // The one of 1, 2, 5, 10 that is nearest on a logarithmic scale.
        let factor = match raw / decade {
            share if share < 2f64.sqrt() => 1.0,
            share if share < 10f64.sqrt() => 2.0,
            share if share < 50f64.sqrt() => 5.0,
            _ => 10.0,
        };
        let step = factor * decade;
        // Multiples of the step, not sums of it: no drift.
        let slack = 1e-9;
        let (first, last) = ((low / step - slack).ceil(), (high / step + slack).floor());
        let count = (last - first).max(0.0).min(4.0 * wanted as f64) as usize;
        let at: Vec<f64> = (0..=count).map(|i| (first + i as f64) * step).collect();
        let largest = at.iter().fold(step, |a, v| a.max(v.abs()));
        let place = (step * (1.0 + slack)).log10().floor() as i32;
        Self {
            digits: Digits::down_to(place, largest),
            at,
        }
    }

    /// Width of the widest label.
    pub(super) fn widest(&self) -> f64 {
        self.labelled()
            .map(|(_, label)| width(&label, TEXT))
            .fold(0.0, f64::max)
    }

    /// Each tick with its label.
    pub(super) fn labelled(&self) -> impl Iterator<Item = (f64, String)> + '_ {
        self.at.iter().map(|&v| (v, self.digits.write(v)))
    }
}

/// The horizontal axis.
pub(super) struct Across {
    pub range: (f64, f64),
    pub ticks: Ticks,
    pub left: f64,
    pub right: f64,
}

impl Across {
    /// Position of a value.
    pub fn x(&self, value: f64) -> f64 {
        let share = (value - self.range.0) / (self.range.1 - self.range.0);
        self.left + share * (self.right - self.left)
    }
}

/// A range that can be drawn: a little wider than the values, never empty.
pub(super) fn padded(values: impl Iterator<Item = f64>, share: f64) -> (f64, f64) {
    let (low, high) = values
        .filter(|v| v.is_finite())
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| {
            (l.min(v), h.max(v))
        });
    if low > high {
        return (0.0, 1.0);
    }
    let width = high - low;
    // Rounding of a constant is no range.
    if width <= 1e-12 * low.abs().max(high.abs()) {
        let half = if low == 0.0 { 1.0 } else { 0.1 * low.abs() };
        return (low - half, high + half);
    }
    (low - share * width, high + share * width)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn labels(low: f64, high: f64, wanted: usize) -> Vec<String> {
        Ticks::new((low, high), wanted)
            .labelled()
            .map(|(_, l)| l)
            .collect()
    }

    #[test]
    fn ticks_are_round_and_inside() {
        assert_eq!(
            labels(0.0, 15.0, 5),
            ["0", "2", "4", "6", "8", "10", "12", "14"]
        );
        assert_eq!(labels(-2.3, 2.3, 5), ["−2", "−1", "0", "1", "2"]);
        assert_eq!(labels(-0.11, 0.13, 3), ["−0.1", "0.0", "0.1"]);
        assert_eq!(
            labels(1000.001, 1000.003, 2),
            ["1000.001", "1000.002", "1000.003"]
        );
        assert_eq!(labels(0.0, 3e7, 3), ["0", "1e7", "2e7", "3e7"]);
    }

    #[test]
    fn any_range_has_between_one_and_a_dozen_ticks() {
        for exponent in -12..12 {
            for (a, b) in [(0.0, 1.0), (-3.3, 0.07), (17.0, 19.9), (0.999, 1.001)] {
                let scale = 10f64.powi(exponent);
                let ticks = Ticks::new((a * scale, b * scale), 5);
                assert!(
                    (1..=12).contains(&ticks.at.len()),
                    "{a} {b} {exponent}: {ticks:?}"
                );
                let slack = 1e-6 * (b - a) * scale;
                let inside = |v: &f64| (a * scale - slack..=b * scale + slack).contains(v);
                assert!(ticks.at.iter().all(inside), "{ticks:?}");
            }
        }
    }

    #[test]
    fn constants_and_nothing_have_a_range() {
        assert_eq!(padded([5.0, 5.0].into_iter(), 0.05), (4.5, 5.5));
        assert_eq!(padded([0.0].into_iter(), 0.05), (-1.0, 1.0));
        assert_eq!(padded([f64::NAN].into_iter(), 0.05), (0.0, 1.0));
        assert_eq!(padded([0.0, f64::NAN, 10.0].into_iter(), 0.1), (-1.0, 11.0));
    }
}
