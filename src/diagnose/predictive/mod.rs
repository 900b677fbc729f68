//! Predictive check of an all-clear: do records that the fitted twin simulates look like the measured ones?
//!
//! Fitted noise can swallow what a twin lacks: the likelihood is then content, and the twin is of no use. So records are simulated at draws
//! of the fit's posterior, with the noise that the fit claims. Each statistic T (`statistics.rs`) of the measured records is compared with
//! its simulated values at the same draws:
//!
//! ```text
//! z_s = (mean T_s of the measured records − mean T_s of simulated ones)/deviation of simulated ones
//! p   = share of simulated records with max_s as large: of |z_s|, of z_s where less than usual is no fault (bursts, correlation); tails, and
//!       predictions in a closed loop, are told, and no fault
//! ```
//!
//! The largest z has its own distribution here, so the number of statistics does not matter. Simulations end early where many have as
//! large a one. A statistic at the fitted θ is a little too good, at draws a little too bad; the check is then rather too quiet.
//!
//! Sources: Gelman, Meng & Stern, "Posterior predictive assessment of model fitness via realized discrepancies", *Statistica Sinica* 6
//! (1996); Besag & Clifford, "Sequential Monte Carlo p-values", *Biometrika* 78 (1991).

mod disturbance;
mod reference;
mod statistics;

pub(in crate::diagnose) use reference::declared;

use super::outcome::{Predicted, PredictiveCheck};
use super::quantify::free_run::mean;
use super::thresholds::THRESHOLDS;
use crate::fit::posterior::PosteriorSample;
use crate::fit::problem::Problem;
use crate::hypothesis::search::model::Model;
use crate::math::{deviation, quantile};
use crate::parallel::try_found;
use crate::record::Record;
use crate::study::StudyError;
use crate::twin::Noise;
use statistics::{Discrepancy, Look};
use std::ops::Range;

/// A twin at one draw, and records that it simulates there.
pub(in crate::diagnose) struct Replicate {
    pub theta: Vec<f64>,
    pub records: Vec<Record>,
}

/// The check of a fitted twin.
pub(in crate::diagnose) struct Predictive<'m> {
    pub model: &'m Model,
    /// Places whose noise level is declared.
    pub declared: Vec<String>,
    /// `true` where no input reacts to an output.
    pub is_open_loop: bool,
    /// Draws of its posterior.
    pub draws: &'m PosteriorSample,
    pub noise: Noise,
}

impl Predictive<'_> {
    /// Compares the measured records with simulated ones; `None` where nothing can be simulated, or simulations cost too much.
    pub fn check(&self) -> Result<Option<PredictiveCheck>, StudyError> {
        let problem = &self.model.problem;
        if problem.is_simulated() || self.draws.thetas.is_empty() {
            return Ok(None);
        }
        let statistics = Discrepancy::all(problem);
        let measured = self.measured(&statistics)?;
        let mut simulated: Vec<Look> = vec![];
        let mut compared = None;
        for count in [THRESHOLDS.check_first, THRESHOLDS.check_records] {
            let draw = |i: usize| &self.draws.thetas[i % self.draws.thetas.len()];
            let all = self.replicates(simulated.len()..count, draw)?;
            simulated.extend(looks(problem, &all, &statistics)?);
            compared = Some(self.compare(&statistics, &measured, &simulated));
            let is_clear = |check: &PredictiveCheck| {
                check.p_value * (simulated.len() + 1) as f64 > THRESHOLDS.check_enough
            };
            if compared.as_ref().is_some_and(is_clear) {
                break;
            }
        }
        let noise_share = self.noise_share(&statistics, &simulated)?;
        Ok(compared.map(|check| PredictiveCheck {
            noise_share,
            ..check
        }))
    }

    /// The statistics of the measured records: means over draws.
    fn measured(&self, statistics: &[Discrepancy]) -> Result<Look, StudyError> {
        let problem = &self.model.problem;
        let draws = self
            .draws
            .thetas
            .iter()
            .step_by((self.draws.thetas.len() / THRESHOLDS.check_first).max(1));
        let measured: Vec<Replicate> = draws
            .map(|theta| Replicate {
                theta: theta.clone(),
                records: problem.records.to_vec(),
            })
            .collect();
        let all = looks(problem, &measured, statistics)?;
        let mean = |s: usize| {
            let values = all.iter().map(|look| look[s]).filter(|v| v.is_finite());
            let values: Vec<f64> = values.collect();
            values.iter().sum::<f64>() / values.len() as f64
        };
        Ok((0..statistics.len()).map(mean).collect())
    }

    /// Records simulated at θ of each number, with the gaps of the measured ones; runs that end are left out.
    fn replicates<'t>(
        &self,
        numbers: Range<usize>,
        theta: impl Fn(usize) -> &'t Vec<f64> + Sync,
    ) -> Result<Vec<Replicate>, StudyError> {
        try_found(numbers, |i| self.replicate(i, theta(i).clone()))
    }

    fn replicate(&self, i: usize, theta: Vec<f64>) -> Result<Option<Replicate>, StudyError> {
        let problem = &self.model.problem;
        let runners = statistics::runners(problem, &problem.records, &theta)?;
        let noise = self.noise.child("replicate");
        let records = (problem.records.iter().zip(runners).enumerate())
            .map(|(r, (record, runner))| {
                let stream = (i * problem.records.len() + r) as u64;
                let run = runner?.simulated(record, noise.sample(stream))?;
                Record::new(record.drive().clone(), record.with_gaps_in(run)).ok()
            })
            .collect::<Option<Vec<_>>>();
        Ok(records.map(|records| Replicate { theta, records }))
    }

    /// Compares statistics of the measured records with those of simulated ones.
    fn compare(
        &self,
        statistics: &[Discrepancy],
        measured: &Look,
        simulated: &[Look],
    ) -> PredictiveCheck {
        // A value that is not finite is of a statistic that has no meaning here (readings that never move).
        let usable: Vec<usize> = (0..statistics.len())
            .filter(|&s| {
                measured[s].is_finite() && simulated.iter().all(|look| look[s].is_finite())
            })
            .collect();
        let columns: Vec<(usize, f64, f64)> = (usable.into_iter())
            .filter_map(|s| {
                let values: Vec<f64> = simulated.iter().map(|look| look[s]).collect();
                let spread = deviation(&values);
                (spread > 0.0 && spread.is_finite()).then(|| (s, mean(&values), spread))
            })
            .collect();
        let (is_white, is_open_loop) = (self.correlated().is_empty(), self.is_open_loop);
        let departed = |s: usize, z: f64| statistics[s].departure(z, is_white, is_open_loop);
        let largest = |look: &Look| {
            let departure =
                |(s, mean, spread): &(usize, f64, f64)| departed(*s, (look[*s] - mean) / spread);
            columns.iter().map(departure).fold(0.0, f64::max)
        };
        let own = largest(measured);
        let above = simulated.iter().filter(|look| largest(look) >= own).count();
        let rows = (columns.iter())
            .map(|&(s, mean, spread)| {
                let values: Vec<f64> = simulated.iter().map(|look| look[s]).collect();
                let end =
                    |p: f64| quantile(&values, p).map_or(f64::NAN, |v| statistics[s].shown(v));
                Predicted {
                    statistic: statistics[s].id(),
                    measured: statistics[s].shown(measured[s]),
                    expected: [end(0.05), end(0.95)],
                    deviations: (measured[s] - mean) / spread,
                    departure: departed(s, (measured[s] - mean) / spread),
                }
            })
            .collect();
        PredictiveCheck {
            p_value: (above + 1) as f64 / (simulated.len() + 1) as f64,
            simulations: simulated.len(),
            rows,
            noise_share: None,
            disturbance: None,
        }
    }
}

/// The statistics of each; those whose filter or run fails are left out.
fn looks(
    problem: &Problem,
    replicates: &[Replicate],
    statistics: &[Discrepancy],
) -> Result<Vec<Look>, StudyError> {
    try_found(replicates, |one| {
        statistics::look(problem, &one.records, &one.theta, statistics)
    })
}
