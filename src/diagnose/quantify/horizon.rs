//! Errors of predictions over several horizons, before and after a gap is closed.
//!
//! A free run forgets the record: where a twin drifts, noise alone drives it away, and a gap that is closed does not show. A prediction
//! over h samples begins anew from what the record has shown. Windows of h samples are kept from the filter, every second one, then
//! the others; squared errors over the windows, divided by the variance of y, are compared with those of records that the accepted twin
//! simulates at draws of its posterior, noise levels included:
//!
//! ```text
//! closed = (B − A)/(B − F)      B, A: mean squares of twin and accepted twin;  F: mean over simulated records of Aᵢ
//! ```
//!
//! If the accepted twin is right, A is one more of the Aᵢ, errors of estimation included, and the true system scores 1 in expectation.
//! The headline is the horizon with the largest (mean Bᵢ − F)/s, s the standard deviation of the Aᵢ: where twin and floor differ most
//! clearly. Neither A nor B takes part in the choice: a noisy record would choose itself. A free run has a share only where it can follow:
//! noise alone must leave it half of the variance of y, F < ½. Its interval is that of (B − δBᵢ − A + δAᵢ)/(B − δBᵢ − F), δ the deviations
//! of simulated records from their mean: what another record of the same system would have given.

use super::free_run::{Runner, mean, scaled, variances};
use crate::diagnose::outcome::Horizon;
use crate::diagnose::thresholds::THRESHOLDS;
use crate::fit::problem::Problem;
use crate::likelihood::kalman::{FilterError, recoverable};
use crate::math::{deviation, quantile};
use crate::parallel::{each, try_each};
use crate::record::{Record, Signal};
use crate::study::StudyError;
use crate::twin::Noise;

/// Held-out data: a record, and its first row that counts.
#[derive(Clone, Copy)]
pub(in crate::diagnose) struct HeldOutRows<'r> {
    pub record: &'r Record,
    pub from: usize,
}

/// A model at θ that has not seen the held-out data.
pub(in crate::diagnose) struct Predictor {
    pub problem: Problem,
    /// θ of one record.
    pub theta: Vec<f64>,
    pub runner: Runner,
}

/// Reach of predictions ahead.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::diagnose) enum Reach {
    /// Samples.
    Samples(usize),
    /// From the start, inputs alone.
    FreeRun,
}

impl Reach {
    /// Tells whether a share can be measured at this reach, the floor being so large.
    fn can_measure(self, floor: f64) -> bool {
        self != Self::FreeRun || floor < THRESHOLDS.follows
    }
}

impl Predictor {
    /// Mean log density of a row that counts, given the rows before; `None` where the filter fails.
    pub fn log_score(&self, rows: HeldOutRows<'_>) -> Result<Option<f64>, FilterError> {
        let problem = self.problem.on(std::slice::from_ref(rows.record));
        let filtered = recoverable(problem.filtered(&problem.full(&self.theta)))?;
        Ok(filtered.map(|all| mean(&all[0].log_densities[rows.from..])))
    }

    /// Squared errors over the variance of y, mean over channels, by row that counts; `None` where predictions fail. `scale`
    /// are the variances that errors are divided by.
    pub fn errors(
        &self,
        rows: HeldOutRows<'_>,
        reach: Reach,
        scale: &[f64],
    ) -> Result<Option<Vec<f64>>, FilterError> {
        let HeldOutRows { record, from } = rows;
        let Reach::Samples(h) = reach else {
            return Ok(self
                .runner
                .outputs(record)
                .map(|run| scaled(&(record.outputs() - &run), scale, from)));
        };
        let predicted = |record: &Record| -> Result<Option<Signal>, FilterError> {
            Ok(recoverable(self.problem.predicted(&self.theta, record))?.flatten())
        };
        if h == 1 {
            let all = predicted(record)?;
            return Ok(all.map(|p| scaled(&(record.outputs() - &p), scale, from.max(1))));
        }
        // Rows before the first window are seen: predictions begin where the record has shown the state.
        let begin = from.max(h);
        let window = |k: usize| (k - begin) / h % 2;
        let mut errors = Signal::from_elem(record.outputs().dim(), f64::NAN);
        for part in 0..2 {
            let mut seen = record.outputs().clone();
            for (k, mut row) in seen.rows_mut().into_iter().enumerate().skip(begin) {
                if window(k) == part {
                    row.fill(f64::NAN);
                }
            }
            let Ok(masked) = Record::new(record.drive().clone(), seen) else {
                return Ok(None);
            };
            let Some(predicted) = predicted(&masked)? else {
                return Ok(None);
            };
            for k in (begin..record.samples()).filter(|&k| window(k) == part) {
                let error = &record.outputs().row(k) - &predicted.row(k);
                errors.row_mut(k).assign(&error);
            }
        }
        Ok(Some(scaled(&errors, scale, begin)))
    }
}

/// Horizons that are looked at: one sample, a tenth of the record and between, the free run.
pub(in crate::diagnose) fn reaches(problem: &Problem, rows: HeldOutRows<'_>) -> Vec<Reach> {
    if problem.is_simulated() {
        return vec![Reach::FreeRun];
    }
    let longest = rows.record.samples() / 10;
    let lengths = THRESHOLDS.horizons.into_iter().take_while(|h| *h < longest);
    let mut all: Vec<Reach> = lengths.chain([longest]).map(Reach::Samples).collect();
    all.push(Reach::FreeRun);
    all
}

/// Errors over all horizons, and the squared errors at each that the headline is resampled from.
pub(in crate::diagnose) struct Compared {
    pub horizons: Vec<Horizon>,
    /// The horizon where twin and floor differ most clearly, if any does.
    pub headline: Option<usize>,
    reaches: Vec<Reach>,
    scale: Vec<f64>,
}

/// Compares the twin (`before`) with the accepted one (`after`) on held-out data; `draws` are of the accepted one's posterior.
pub(in crate::diagnose) fn compare(
    before: &Predictor,
    after: &Predictor,
    draws: &[Predictor],
    rows: HeldOutRows<'_>,
    noise: Noise,
) -> Result<Compared, StudyError> {
    let simulated = simulated(draws, rows.record, THRESHOLDS.floor_records, noise);
    let mut compared = Compared {
        horizons: vec![],
        headline: None,
        reaches: vec![],
        scale: variances(rows.record.outputs()),
    };
    let mut clearest = THRESHOLDS.clear;
    for reach in reaches(&after.problem, rows) {
        let own = |p: &Predictor| p.errors(rows, reach, &compared.scale);
        let (Some(b), Some(a)) = (own(before)?, own(after)?) else {
            continue;
        };
        if b.is_empty() {
            continue;
        }
        let on_simulated = |p: &Predictor| -> Result<Vec<f64>, FilterError> {
            let all = compared.means(p, reach, rows, &simulated)?;
            Ok(all.into_iter().flatten().collect())
        };
        // Whether the gap shows, simulated records say: where the measured one does, its noise would have chosen itself.
        let (floors, twins) = (on_simulated(after)?, on_simulated(before)?);
        let (floor, spread) = (mean(&floors), deviation(&floors));
        let clear = (mean(&twins) - floor) / spread.max(f64::MIN_POSITIVE);
        let is_clear = clear.is_finite()
            && clear > THRESHOLDS.clear
            && reach.can_measure(floor)
            && mean(&b) > floor;
        if is_clear && clear > clearest {
            (compared.headline, clearest) = (Some(compared.horizons.len()), clear);
        }
        let samples = match reach {
            Reach::Samples(h) => Some(h),
            Reach::FreeRun => None,
        };
        compared.horizons.push(Horizon {
            samples,
            seconds: samples.map(|h| h as f64 * rows.record.drive().dt()),
            before: mean(&b).sqrt(),
            after: mean(&a).sqrt(),
            floor: floor.sqrt(),
            closed: is_clear.then(|| share(mean(&b), mean(&a), floor)),
        });
        compared.reaches.push(reach);
    }
    Ok(compared)
}

/// Records like the measured one, each at a draw.
fn simulated(draws: &[Predictor], record: &Record, count: u64, noise: Noise) -> Vec<Record> {
    let all = each(0..count, |i| {
        let draw = draws.get(i as usize % draws.len().max(1))?;
        let run = draw.runner.simulated(record, noise.sample(i))?;
        Record::new(record.drive().clone(), record.with_gaps_in(run)).ok()
    });
    all.into_iter().flatten().collect()
}

impl Compared {
    /// Mean squared error of a model on each record; `None` where it fails.
    fn means(
        &self,
        of: &Predictor,
        reach: Reach,
        rows: HeldOutRows<'_>,
        records: &[Record],
    ) -> Result<Vec<Option<f64>>, FilterError> {
        try_each(records, |record| {
            let errors = of.errors(HeldOutRows { record, ..rows }, reach, &self.scale)?;
            Ok(errors.map(|errors| mean(&errors)))
        })
    }

    /// Error of another model at a horizon, as a root mean square.
    pub fn error(
        &self,
        horizon: Option<usize>,
        of: &Predictor,
        rows: HeldOutRows<'_>,
    ) -> Result<Option<f64>, StudyError> {
        let Some(at) = horizon else {
            return Ok(None);
        };
        let errors = of.errors(rows, self.reaches[at], &self.scale)?;
        Ok(errors.map(|errors| mean(&errors).sqrt()))
    }

    /// 90 % interval of the headline's share, from records that the accepted twin simulates. Not clamped.
    pub fn interval(
        &self,
        before: &Predictor,
        after: &Predictor,
        draws: &[Predictor],
        rows: HeldOutRows<'_>,
        noise: Noise,
    ) -> Result<Option<[f64; 2]>, StudyError> {
        let Some(at) = self.headline else {
            return Ok(None);
        };
        let records = simulated(draws, rows.record, THRESHOLDS.share_records, noise);
        let of = |p: &Predictor| self.means(p, self.reaches[at], rows, &records);
        let pairs: Vec<[f64; 2]> = (of(before)?.into_iter().zip(of(after)?))
            .filter_map(|(b, a)| Some([b?, a?]))
            .collect();
        let centre = [0, 1].map(|m| mean(&pairs.iter().map(|pair| pair[m]).collect::<Vec<_>>()));
        let shown = &self.horizons[at];
        let [b, a, floor] = [shown.before, shown.after, shown.floor].map(|root| root * root);
        let shares: Vec<f64> = (pairs.iter())
            .map(|pair| share(b - pair[0] + centre[0], a - pair[1] + centre[1], floor))
            .filter(|share| share.is_finite())
            .collect();
        let tail = 0.5 * (1.0 - THRESHOLDS.interval_level);
        let ends = [tail, 1.0 - tail].map(|p| quantile(&shares, p).ok());
        Ok(match ends {
            [Some(low), Some(high)] => Some([low, high]),
            _ => None,
        })
    }
}

fn share(before: f64, after: f64, floor: f64) -> f64 {
    (before - after) / (before - floor)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_free_run_that_noise_drives_away_has_no_share() {
        assert!(Reach::FreeRun.can_measure(0.3));
        assert!(!Reach::FreeRun.can_measure(0.6));
        assert!(Reach::Samples(10).can_measure(0.6));
    }

    #[test]
    fn half_of_a_gap_is_half() {
        assert!((share(1.0, 0.6, 0.2) - 0.5).abs() < 1e-12);
    }
}
