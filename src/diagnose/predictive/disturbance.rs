//! The disturbance that fitted noise swallows: its place, its time scale, its bursts.
//!
//! At a state it is the process noise of each step given the whole record (the filter's disturbance smoother), over the step, and the
//! correlated noise there; at a sensor the correlated noise. It is scanned by windows of L samples, L in octaves:
//!
//! ```text
//! push:  max |Σ d|/√L        power:  max Σ d²/L        over all windows
//! z   = (ln measured − mean ln simulated)/deviation of ln simulated
//! ```
//!
//! Simulated is the fitted twin with noise as declared, or as fitted where nothing is declared. The place is that with the largest z; the
//! probability of a place is in proportion to e^(z²/2), its likelihood ratio if z is normal. Bursts are windows beyond what 95 % of
//! simulated records have anywhere, of the clearest length with which they are half of the record at most.

use super::{Predictive, Replicate};
use crate::diagnose::outcome::{Burst, HiddenDisturbance, TargetShare};
use crate::diagnose::quantify::free_run::{mean, root};
use crate::diagnose::thresholds::THRESHOLDS;
use crate::effect::{TargetKind, targets};
use crate::fit::problem::Problem;
use crate::likelihood::kalman::FilterError;
use crate::math::{descending, deviation, quantile};
use crate::parallel::try_each;
use crate::record::Record;
use crate::study::StudyError;
use crate::twin::{Entry, Parameter, Role};
use std::ops::Range;

/// A place that may be disturbed.
struct NoisyPlace {
    name: String,
    unit: String,
    entry: Entry,
    /// States of correlated noise there.
    memories: Vec<usize>,
}

/// Disturbance at one place, by record and sample.
type Course = Vec<Vec<f64>>;

/// Windows of a scan: their length in samples, and what is summed.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Scan {
    length: usize,
    is_push: bool,
}

/// Clearness of the disturbance of a place, and the windows in which it is clear.
struct Clearest {
    score: f64,
    /// Windows of each length and kind, clearest first, and what 95 % of simulated records do not reach in any.
    scans: Vec<(Scan, f64)>,
    size: f64,
    expected: f64,
}

impl Predictive<'_> {
    /// The disturbance, and the probability of each place; `None` where no place has fitted noise.
    pub fn disturbance(&self) -> Result<Option<(HiddenDisturbance, Vec<TargetShare>)>, StudyError> {
        let problem = &self.model.problem;
        let places = places(problem);
        let fitted = &self.model.fitted.theta;
        let measured = courses(problem, fitted, &problem.records, &places)?;
        let (reference, _) = self.reference();
        let replicates = self.replicates(0..THRESHOLDS.check_first, |_| &reference)?;
        let simulated = try_each(&replicates, |Replicate { records, .. }| {
            courses(problem, fitted, records, &places)
        })?;
        let clear: Vec<Clearest> = (0..places.len())
            .map(|i| {
                let simulated: Vec<&Course> = simulated.iter().map(|all| &all[i]).collect();
                clearest(&measured[i], &simulated)
            })
            .collect();
        let best = (0..places.len()).max_by(|&a, &b| clear[a].score.total_cmp(&clear[b].score));
        let Some(first) = best else {
            return Ok(None);
        };
        let top = clear[first].score.powi(2);
        let weights: Vec<f64> = (clear.iter())
            .map(|one| (0.5 * (one.score.powi(2) - top)).exp())
            .collect();
        let sum: f64 = weights.iter().sum();
        let shares = (places.iter().zip(&weights))
            .map(|(place, weight)| TargetShare {
                target: place.name.clone(),
                probability: weight / sum,
            })
            .collect();
        let (place, clear, record) = (&places[first], &clear[first], &problem.records[0]);
        let drive = record.drive();
        let disturbance = HiddenDisturbance {
            place: place.name.clone(),
            unit: place.unit.clone(),
            size: clear.size,
            expected: clear.expected,
            time_scale: (clear.scans.first()).map(|(scan, _)| scan.length as f64 * drive.dt()),
            bursts: (clear.scans.iter())
                .map(|(scan, limit)| scan.bursts(&measured[first][0], *limit))
                .find(|all| {
                    let rows: usize = all.iter().map(|stretch| stretch.len()).sum();
                    rows > 0 && 2 * rows <= record.samples()
                })
                .map_or(vec![], |all| {
                    all.iter().map(|stretch| burst(record, stretch)).collect()
                }),
            course: (measured[first][0].iter().enumerate())
                .map(|(k, value)| (drive.time(k), *value))
                .collect(),
        };
        Ok(Some((disturbance, shares)))
    }
}

/// States whose noise level is fitted, and sensors with correlated noise.
fn places(problem: &Problem) -> Vec<NoisyPlace> {
    let twin = &problem.twin;
    let Some(outline) = twin.outline() else {
        return vec![];
    };
    let disturbances = twin.disturbances();
    let memories = |entry: Entry| -> Vec<usize> {
        let own = disturbances.iter().filter(|(at, ..)| *at == entry);
        own.map(|(_, state, _)| *state).collect()
    };
    let mut all = vec![];
    for (i, state) in outline.states.iter().enumerate() {
        let is_own = |p: &Parameter| p.role == Role::Noise && p.target() == state.name;
        if twin.fits_noise_of(i) || outline.parameters.iter().any(is_own) {
            let (name, unit, entry) = (state.name.clone(), state.rate_unit(), Entry::State(i));
            let memories = memories(entry);
            all.push(NoisyPlace {
                name,
                unit,
                entry,
                memories,
            });
        }
    }
    let sensors = targets(TargetKind::Sensor, None, &problem.twin.signals());
    for (j, output) in outline.outputs.iter().enumerate() {
        let (name, unit, entry) = (sensors[j].clone(), output.unit.clone(), Entry::Sensor(j));
        let memories = memories(entry);
        if !memories.is_empty() {
            all.push(NoisyPlace {
                name,
                unit,
                entry,
                memories,
            });
        }
    }
    all
}

/// The disturbance at each place in records like the problem's, at its full θ.
fn courses(
    problem: &Problem,
    theta: &[f64],
    records: &[Record],
    places: &[NoisyPlace],
) -> Result<Vec<Course>, FilterError> {
    let problem = problem.on(records);
    let all = problem.disturbances(theta)?;
    let at = |place: &NoisyPlace, r: usize, k: usize| {
        let (steps, states) = &all[r];
        let memories = place.memories.iter().map(|&i| states.means[[k, i]]);
        let memory: f64 = memories.sum();
        match place.entry {
            Entry::State(i) => steps[[k + 1, i]] / records[r].drive().step(k) + memory,
            _ => memory,
        }
    };
    let of_record = |place: &NoisyPlace, r: usize| -> Vec<f64> {
        let rows = 0..records[r].samples() - 1;
        rows.map(|k| at(place, r, k)).collect()
    };
    let course = |place: &NoisyPlace| (0..records.len()).map(|r| of_record(place, r)).collect();
    Ok(places.iter().map(course).collect())
}

/// The windows in which a disturbance is clearest beside simulated ones.
fn clearest(measured: &Course, simulated: &[&Course]) -> Clearest {
    let rms = |course: &Course| {
        let squares: Vec<f64> = course.iter().flatten().map(|v| v * v).collect();
        root(&squares)
    };
    let sizes: Vec<f64> = simulated.iter().map(|course| rms(course)).collect();
    let mut best = Clearest {
        score: 0.0,
        scans: vec![],
        size: rms(measured),
        expected: mean(&sizes),
    };
    let mut clear = vec![];
    let longest = measured.iter().map(Vec::len).max().unwrap_or(0) / 8;
    let lengths = std::iter::successors(Some(1), |length| Some(2 * length));
    for length in lengths.take_while(|length| *length <= longest.max(1)) {
        for is_push in [true, false] {
            let scan = Scan { length, is_push };
            let largest = |course: &Course| {
                let all = course.iter().flat_map(|d| scan.windows(d));
                all.fold(f64::MIN_POSITIVE, f64::max).ln()
            };
            let values: Vec<f64> = simulated.iter().map(|course| largest(course)).collect();
            let z = (largest(measured) - mean(&values)) / deviation(&values);
            if z.is_finite() {
                let limit = quantile(&values, 0.95).map_or(f64::INFINITY, f64::exp);
                clear.push((z, (scan, limit)));
            }
        }
    }
    descending(&mut clear, |a| a.0);
    best.score = clear.first().map_or(0.0, |(z, _)| z.max(0.0));
    best.scans = clear.into_iter().map(|(_, scan)| scan).collect();
    best
}

impl Scan {
    /// The statistic of each window, by its first sample.
    fn windows(self, w: &[f64]) -> Vec<f64> {
        let term = |v: f64| if self.is_push { v } else { v * v };
        let mut sum: f64 = w.iter().take(self.length).map(|v| term(*v)).sum();
        let mut all = vec![];
        for first in 0..(w.len() + 1).saturating_sub(self.length) {
            let length = self.length as f64;
            all.push(match self.is_push {
                true => sum.abs() / length.sqrt(),
                false => sum / length,
            });
            if let Some(next) = w.get(first + self.length) {
                sum += term(*next) - term(w[first]);
            }
        }
        all
    }

    /// Stretches of samples in windows beyond a limit.
    fn bursts(self, d: &[f64], limit: f64) -> Vec<Range<usize>> {
        let mut all: Vec<Range<usize>> = vec![];
        for (first, value) in self.windows(d).into_iter().enumerate() {
            if value > limit {
                let end = first + self.length;
                match all.last_mut() {
                    Some(last) if first <= last.end => last.end = end,
                    _ => all.push(first..end),
                }
            }
        }
        all
    }
}

/// A stretch of samples in seconds.
fn burst(record: &Record, stretch: &Range<usize>) -> Burst {
    let time = |k: usize| record.drive().time(k.min(record.samples() - 1));
    Burst {
        start: time(stretch.start),
        end: time(stretch.end),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn windows_are_sums_over_their_samples() {
        let w = [1.0, -1.0, 2.0, 2.0];
        let scan = |length, is_push| Scan { length, is_push }.windows(&w);
        assert_eq!(scan(1, true), [1.0, 1.0, 2.0, 2.0]);
        assert_eq!(scan(2, false), [1.0, 2.5, 4.0]);
        assert_eq!(scan(5, true), [0.0; 0]);
        let pairs = Scan {
            length: 2,
            is_push: false,
        };
        let bursts = pairs.bursts(&w, 2.0);
        assert_eq!((bursts.len(), bursts[0].clone()), (1, 1..4));
    }
}
