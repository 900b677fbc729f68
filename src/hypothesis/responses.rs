//! Responses of unknown form to a signal that repeats itself: waves that are locked to it.
//!
//! ```text
//! β_1·sin(2π·n·f·t) + β_2·cos(2π·n·f·t)        f: frequency of an input or an output, known from the record;  n = 1, 2, 3
//! ```
//!
//! Whatever answers to a periodic signal repeats with it. A free wave that ends at the frequency of an input or of the twin's own cycle is
//! therefore suspected to be such a response: it found a frequency that it could have missed, and the locked wave has to find none. Both
//! explain the record alike, and the free one pays for the range that its frequency is drawn from.

use super::functions::locked_wave;
use super::listed::Library;
use super::term::Term;
use crate::effect::{TargetKind, targets};
use crate::hypothesis::limits::TERM;
use crate::twin::{Role, is_memory};
use rustfft::FftPlanner;
use rustfft::num_complex::Complex;

/// Locked waves at every place of a twin; none where no signal repeats itself.
pub(super) fn responses(library: &Library<'_>) -> Vec<Term> {
    let scales = library.scales;
    let outline = &scales.outline;
    let (dt, duration) = (scales.dt(), scales.duration());
    let record = &scales.records[0];
    let inputs = outline.inputs.iter().zip(record.drive().inputs().columns());
    let outputs = outline.outputs.iter().zip(record.outputs().columns());
    let mut lines: Vec<(&str, f64)> = vec![];
    for (quantity, values) in inputs.chain(outputs) {
        let values: Vec<f64> = values.iter().copied().collect();
        if let Some(frequency) = line(&values, dt) {
            let is_known = |other: &(&str, f64)| (other.1 - frequency).abs() < 0.5 / duration;
            if !lines.iter().any(is_known) {
                lines.push((&quantity.name, frequency));
            }
        }
    }
    let places = places(library);
    let mut terms = vec![];
    for (signal, frequency) in lines {
        let multiples = (1..=TERM.harmonics).map(|n| n as f64 * frequency);
        for frequency in multiples.filter(|f| *f < 0.5 / dt) {
            let wave = |(kind, target, largest): &(TargetKind, String, f64)| {
                locked_wave(kind.name(), target, signal, *largest, frequency)
            };
            terms.extend(places.iter().map(wave));
        }
    }
    terms
}

/// Places at which a response may enter, with its largest size.
fn places(library: &Library<'_>) -> Vec<(TargetKind, String, f64)> {
    let scales = library.scales;
    let outline = &scales.outline;
    let mut places = vec![];
    if scales.has_equations() {
        for (i, (state, rate)) in outline.states.iter().zip(&scales.rates).enumerate() {
            if *rate > 0.0 && !scales.defined[i] && !is_memory(&state.name) {
                places.push((TargetKind::State, state.name.clone(), *rate));
            }
        }
        let own = outline
            .parameters
            .iter()
            .filter(|p| p.role == Role::Parameter);
        places.extend(own.map(|p| (TargetKind::Parameter, p.name.clone(), 1.0)));
    }
    let signals = library.twin.signals();
    for kind in [TargetKind::Sensor, TargetKind::Actuator] {
        let all = targets(kind, None, &signals).into_iter().enumerate();
        places.extend(all.map(|(j, target)| (kind, target, scales.size(kind, j))));
    }
    places
}

/// Frequency at which a signal repeats itself, in Hz; none where no line holds enough of its variance.
fn line(values: &[f64], dt: f64) -> Option<f64> {
    let n = values.len();
    let present: Vec<f64> = values.iter().copied().filter(|v| v.is_finite()).collect();
    let mean = present.iter().sum::<f64>() / present.len().max(1) as f64;
    let mut series: Vec<Complex<f64>> = (values.iter())
        .map(|v| Complex::new(if v.is_finite() { v - mean } else { 0.0 }, 0.0))
        .collect();
    let whole: f64 = series.iter().map(Complex::norm_sqr).sum();
    series.resize(TERM.periodogram_points * n, Complex::new(0.0, 0.0));
    FftPlanner::new()
        .plan_fft_forward(TERM.periodogram_points * n)
        .process(&mut series);
    let first = (TERM.least_cycles * TERM.periodogram_points as f64) as usize;
    let power: Vec<f64> = series[..TERM.periodogram_points * n / 2]
        .iter()
        .map(Complex::norm_sqr)
        .collect();
    let top = (first..power.len()).max_by(|a, b| power[*a].total_cmp(&power[*b]))?;
    // A sine of amplitude a has n·a²/2 in the record and n²·a²/4 at its peak.
    let share = 2.0 * power[top] / (n as f64 * whole);
    (share > TERM.line).then(|| top as f64 / ((TERM.periodogram_points * n) as f64 * dt))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::twin::Noise;

    #[test]
    fn lines_are_those_of_signals_that_repeat() {
        let of = |f: &dyn Fn(f64) -> f64| {
            let values: Vec<f64> = (0..600).map(|k| f(0.05 * f64::from(k))).collect();
            line(&values, 0.05)
        };
        let found = of(&|t| 3.0 + (0.9 * t).sin()).unwrap();
        assert!(
            (found * std::f64::consts::TAU - 0.9).abs() < 0.01,
            "{found}"
        );
        let square = of(&|t| if (0.21 * t).fract() < 0.5 { 1.0 } else { -1.0 }).unwrap();
        assert!((square - 0.21).abs() < 0.003, "{square}");
        // Levels that are held for a time and drawn anew, a ramp, a constant.
        let mut source = Noise::new(1, "levels", 0).source("levels");
        let levels: Vec<f64> = (0..60).map(|_| source.uniform()).collect();
        assert_eq!(of(&|t| levels[(t / 0.5) as usize]), None);
        assert_eq!(of(&|t| t), None);
        assert_eq!(of(&|_| 2.0), None);
    }
}
