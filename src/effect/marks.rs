//! Marks that signal effects leave on measured outputs.

use crate::record::{distinct, step_of};

/// The mark of an effect on measured outputs, whatever the twin: values that pile up at its ends or steps.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum OutputMark {
    /// The effect leaves none.
    Unmarked,
    /// It would leave one, and there is none.
    Absent,
    /// There is one, of these magnitudes.
    Present(Vec<f64>),
}

/// Equal values at an end that noise does not bring about, and how many times more often they come than a usual value, and than those
/// next to them. A rounded oscillation is often at its ends: at the top of a parabola, steps hold 1 : 0.41 : 0.32 of its time.
const TIES: usize = 4;
const OFTEN: usize = 3;

/// OutputMark of a limited range, as (low, high): many samples exactly at the least or the greatest value.
pub(crate) fn clipped(outputs: &[f64]) -> OutputMark {
    let values = distinct(outputs);
    if values.len() < 3 {
        return OutputMark::Absent;
    }
    let mut counts: Vec<usize> = values.iter().map(|(_, count)| *count).collect();
    counts.sort_unstable();
    let usual = counts[counts.len() / 2];
    let at = |(value, count): (f64, usize), beside: [(f64, usize); 2], off: f64| {
        let [(_, next), (_, second)] = beside;
        // Only rounded values repeat.
        let beside = if next > 1 { next + second } else { next };
        let piled_up = count >= TIES.max(OFTEN * usual.max(beside));
        if piled_up { value } else { off }
    };
    let last = values.len() - 1;
    let low = at(values[0], [values[1], values[2]], f64::NEG_INFINITY);
    let high = at(
        values[last],
        [values[last - 1], values[last - 2]],
        f64::INFINITY,
    );
    if low.is_finite() || high.is_finite() {
        OutputMark::Present(vec![low, high])
    } else {
        OutputMark::Absent
    }
}

/// Mark of a range that is limited before the noise: none, and refuted by values that repeat at an end.
pub(crate) fn unclipped(outputs: &[f64]) -> OutputMark {
    match stops(outputs) {
        true => OutputMark::Absent,
        false => OutputMark::Unmarked,
    }
}

/// Returns whether values are rounded so coarsely that most of them repeat.
pub(crate) fn on_levels(outputs: &[f64]) -> bool {
    step_of(outputs).is_some() && 2 * distinct(outputs).len() <= outputs.len()
}

/// Returns whether outputs stop at an end of their range: many samples exactly there.
pub(crate) fn stops(outputs: &[f64]) -> bool {
    matches!(clipped(outputs), OutputMark::Present(_))
}

/// OutputMark of rounding, as its step.
pub(crate) fn rounded(outputs: &[f64]) -> OutputMark {
    step_of(outputs).map_or(OutputMark::Absent, |step| OutputMark::Present(vec![step]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    fn noise() -> Vec<f64> {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        (0..300).map(|_| rng.gen_range(-1.0..1.0)).collect()
    }

    #[test]
    fn what_is_neither_clipped_nor_rounded_is_not_marked() {
        assert_eq!(clipped(&noise()), OutputMark::Absent);
        assert_eq!(rounded(&noise()), OutputMark::Absent);
        // Nor are the digits of a file.
        let digits: Vec<f64> = noise()
            .iter()
            .map(|v| (v * 100.0).round() / 100.0)
            .collect();
        assert_eq!(clipped(&digits), OutputMark::Absent);
        assert_eq!(rounded(&digits), OutputMark::Absent);
        assert_eq!(clipped(&[]), OutputMark::Absent);
        // Nor are the turning points of a rounded oscillation.
        let wave = |size: f64| -> Vec<f64> {
            (0..300)
                .map(|k| ((0.13 * k as f64).sin() * size).round() / 10.0)
                .collect()
        };
        for size in [20.0, 20.4, 50.4, 110.4, 200.4] {
            assert_eq!(clipped(&wave(size)), OutputMark::Absent, "{size}");
        }
        // The same behind a sensor that stops is marked.
        let behind: Vec<f64> = wave(110.4).iter().map(|y| y.min(9.0)).collect();
        assert_eq!(
            clipped(&behind),
            OutputMark::Present(vec![f64::NEG_INFINITY, 9.0])
        );
        assert_eq!(rounded(&[1.0; 50]), OutputMark::Absent);
    }

    #[test]
    fn ends_and_steps_are_found() {
        let high: Vec<f64> = noise().iter().map(|v| v.min(0.8)).collect();
        assert_eq!(
            clipped(&high),
            OutputMark::Present(vec![f64::NEG_INFINITY, 0.8])
        );
        let coarse: Vec<f64> = noise().iter().map(|v| (v / 0.3).round() * 0.3).collect();
        let OutputMark::Present(m) = rounded(&coarse) else {
            panic!("no step");
        };
        assert!((m[0] - 0.3).abs() < 1e-9);
        // Fine steps, half-way between multiples.
        let fine: Vec<f64> = (noise().iter())
            .map(|v| ((v / 0.0031).floor() + 0.5) * 0.0031)
            .collect();
        let OutputMark::Present(m) = rounded(&fine) else {
            panic!("no fine step");
        };
        assert!((m[0] - 0.0031).abs() < 1e-6);
        // Rounded values pile up everywhere, not at the ends.
        assert_eq!(clipped(&coarse), OutputMark::Absent);
    }
}
