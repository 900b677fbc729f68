//! Start frequencies of a periodic effect: the likelihood has tops far narrower than a dictionary.

use crate::diagnose::test::fitted_twin::FittedTwin;
use crate::diagnose::thresholds::Thresholds;
use crate::fit::reference::Reference;
use crate::likelihood::kalman::{FilterError, recoverable};

/// Magnitudes (amplitude, frequency, phase) at the best frequencies of a candidate that has a frequency and a phase.
///
/// At each frequency the gains in phase and a quarter ahead add up, and their multiples α₀, α₁ say amplitude and phase:
///
/// ```text
/// α₀·sin(ωt) + α₁·sin(ωt + π/2) = √(α₀² + α₁²)·sin(ωt + atan2(α₁, α₀))
/// ```
pub(in crate::diagnose) fn peaks(
    model: &FittedTwin<'_>,
    reference: &Reference,
    candidate: usize,
) -> Result<Vec<(usize, Vec<f64>)>, FilterError> {
    let dictionary = &model.dictionary;
    let periodic = (dictionary.variants.iter().enumerate())
        .find(|(_, v)| v.candidate == candidate && is_periodic(v));
    let Some((index, variant)) = periodic else {
        return Ok(vec![]);
    };
    let record = &model.problem.records[0];
    let (dt, samples) = (record.drive().dt(), record.samples() as f64);
    let unit = variant.axes[0].width;
    let count = ((Thresholds::FREQUENCIES_PER_CYCLE * Thresholds::HIGHEST_FREQUENCY * samples)
        as usize)
        .clamp(2, Thresholds::MOST_FREQUENCIES);
    let mut all: Vec<(f64, Vec<f64>)> = Vec::with_capacity(count);
    for i in 1..=count {
        let frequency = i as f64 / (Thresholds::FREQUENCIES_PER_CYCLE * samples * dt);
        let mut gain = 0.0;
        let mut parts = [0.0; 2];
        for (part, phase) in parts.iter_mut().zip([0.0, std::f64::consts::FRAC_PI_2]) {
            let m = [unit, frequency, phase];
            let (problem, full) = variant.at(&model.problem, &model.fitted.theta, &m);
            let Some(there) = recoverable(problem.filtered(&full))? else {
                continue;
            };
            let free = (f64::NEG_INFINITY, f64::INFINITY);
            let one = reference.gain(&reference.direction(&there), free);
            (*part, gain) = (one.alpha, gain + one.nats);
        }
        let amplitude = unit * parts[0].hypot(parts[1]);
        all.push((gain, vec![amplitude, frequency, parts[1].atan2(parts[0])]));
    }
    let mut tops: Vec<(f64, Vec<f64>)> = (0..all.len())
        .filter(|&i| {
            let beside = |j: usize| all.get(j).map_or(0.0, |a| a.0);
            all[i].0 > 0.0 && all[i].0 >= beside(i + 1) && (i == 0 || all[i].0 >= beside(i - 1))
        })
        .map(|i| all[i].clone())
        .collect();
    tops.sort_by(|a, b| b.0.total_cmp(&a.0));
    Ok((tops.into_iter().take(Thresholds::PEAKS))
        .map(|(_, m)| (index, m))
        .collect())
}

/// Amplitude, frequency, phase.
fn is_periodic(variant: &crate::diagnose::hypotheses::variant::Variant) -> bool {
    let units: Vec<&str> = variant.free.iter().map(|m| m.unit).collect();
    matches!(units[..], [_, "Hz", "rad"])
}
