//! Null distribution of the statistics: the fitted twin simulated, refitted and evaluated like the records.

use crate::diagnose::error::DiagnoseError;
use crate::diagnose::residuals::local::local;
use crate::diagnose::residuals::omnibus::omnibus;
use crate::diagnose::test::fitted_twin::FittedTwin;
use crate::diagnose::test::shared::Shared;
use crate::diagnose::test::statistics::Statistics;
use crate::diagnose::thresholds::Thresholds;
use crate::fit::climb::climb;
use crate::fit::problem::Problem;
use crate::fit::reference::Reference;
use crate::likelihood::kalman::FilterError;
use crate::math::{quantile, rank_p_value};
use crate::progress::Stage;
use crate::record::Record;
use crate::twin::Noise;
use rayon::prelude::*;

/// Iterations of a refit that starts where the simulation was made.
const WARM: usize = 6;
/// Difference of two equal statistics: rounding.
const HAIR: f64 = 1e-6;

/// The record's statistics and those of simulations; `None`: a simulation that could not be filtered.
pub(in crate::diagnose) struct NullDistribution {
    pub own: Statistics,
    pub others: Vec<Option<Statistics>>,
}

/// Result of a structural test.
#[derive(Debug, Clone)]
pub(in crate::diagnose) struct Test {
    pub p_value: f64,
    /// Standard deviations above what the twin itself shows.
    pub statistic: f64,
    /// Simulations that are as extreme as the record.
    pub as_extreme: usize,
    /// Family-wise p-value of each candidate.
    pub candidates: Vec<f64>,
    /// Family-wise p-value of each window and region.
    pub local: Vec<f64>,
}

impl<'a> FittedTwin<'a> {
    /// Returns the statistics of the records themselves.
    pub fn own_statistics(&self) -> Result<Option<Statistics>, FilterError> {
        if self.problem.is_simulated() {
            return Ok(self
                .shared()?
                .and_then(|s| s.statistics(self, self.problem.records)));
        }
        self.statistics(&self.problem, &self.fitted.theta)
    }

    /// Returns the ensembles that all statistics of a black box share.
    fn shared(&self) -> Result<Option<Shared>, FilterError> {
        if self.problem.is_simulated() {
            Shared::new(self)
        } else {
            Ok(None)
        }
    }

    /// Returns the statistics of the records of `problem`, fitted at θ.
    fn statistics(
        &self,
        problem: &Problem<'_>,
        theta: &[f64],
    ) -> Result<Option<Statistics>, FilterError> {
        let Some(reference) = Reference::new(problem, theta)? else {
            return Ok(None);
        };
        let points = self.dictionary.scan(problem, theta, &reference)?;
        let gains = self.dictionary.best(&points);
        let states = problem.states(theta)?;
        Ok(Some(Statistics {
            gains: gains.iter().map(|g| (2.0 * g).sqrt()).collect(),
            omnibus: omnibus(&states, problem.records, self.bins.states),
            local: local(&states, problem.records, &self.bins),
            points,
        }))
    }

    /// Returns the statistics of one simulation of the fitted twin, refitted.
    fn replicate(
        &self,
        noise: Noise,
        shared: Option<&Shared>,
    ) -> Result<Option<Statistics>, DiagnoseError> {
        let mut records = Vec::new();
        for (r, record) in self.problem.records.iter().enumerate() {
            let theta = self.problem.of_record(r, &self.fitted.theta);
            let drive = record.drive();
            let noise = noise.child("record").sample(r as u64);
            match self.problem.twin.simulate(&theta, drive, noise) {
                // A black box may diverge without saying so.
                Ok(outputs) if outputs.iter().any(|v| !v.is_finite()) => return Ok(None),
                Ok(outputs) => {
                    records.push(Record::new(drive.clone(), record.with_gaps_in(outputs))?);
                }
                Err(error) if error.costs_one_run() => return Ok(None),
                Err(error) => return Err(error.into()),
            }
        }
        if let Some(shared) = shared {
            return Ok(shared.statistics(self, &records));
        }
        let problem = self.problem.on(&records);
        let Some(fitted) = climb(&problem, &self.fitted.theta, WARM)? else {
            return Ok(None);
        };
        match self.statistics(&problem, &fitted.theta) {
            Ok(statistics) => Ok(statistics),
            Err(error) if error.is_recoverable() => Ok(None),
            Err(error) => Err(error.into()),
        }
    }

    /// Returns the record's statistics beside those of `replicates` simulations, or of fewer once it is clear whether p ≤ `level`;
    /// `None` where the record cannot be evaluated.
    pub fn null_distribution(
        &self,
        replicates: usize,
        level: f64,
        noise: Noise,
        stage: &Stage,
    ) -> Result<Option<NullDistribution>, DiagnoseError> {
        let shared = self.shared()?;
        let own = match &shared {
            Some(shared) => shared.statistics(self, self.problem.records),
            None => self.own_statistics()?,
        };
        let Some(own) = own else {
            return Ok(None);
        };
        let mut null = NullDistribution {
            own,
            others: vec![],
        };
        while null.others.len() < replicates {
            let from = null.others.len();
            let to = (from + Thresholds::BATCH).min(replicates);
            let batch = (from as u64..to as u64)
                .into_par_iter()
                .map(|i| {
                    let statistics =
                        self.replicate(noise.child("replicate").sample(i), shared.as_ref())?;
                    stage.tick()?;
                    Ok(statistics)
                })
                .collect::<Result<Vec<_>, DiagnoseError>>()?;
            null.others.extend(batch);
            let test = null.test();
            let overwhelming = test.statistic > Thresholds::OVERWHELMING && test.p_value <= level;
            if overwhelming || test.as_extreme >= Thresholds::ENOUGH_EXTREME {
                break;
            }
        }
        stage.finish();
        Ok(Some(null))
    }
}

impl NullDistribution {
    /// Returns for each candidate the root √(2·gain) from which on it alone would raise an alarm at `level`.
    pub fn roots_needed(&self, level: f64) -> Vec<f64> {
        let others: Vec<&Statistics> = self.others.iter().flatten().collect();
        let rows =
            |take: fn(&Statistics) -> &Vec<f64>| others.iter().map(|l| take(l)).collect::<Vec<_>>();
        let gains = rows(|l| &l.gains);
        let top_gain = largest(&standardised(&gains));
        let top_omnibus = largest(&standardised(&rows(|l| &l.omnibus)));
        let both: Vec<Vec<f64>> = (top_gain.iter().zip(&top_omnibus))
            .map(|(a, b)| vec![*a, *b])
            .collect();
        let both = largest(&standardised(&both.iter().collect::<Vec<_>>()));
        let alarm = quantile(&both, 1.0 - level).unwrap_or(f64::INFINITY);
        let (centre, spread) = moments(top_gain.iter().copied());
        let top = centre + alarm * spread;
        (0..self.own.gains.len())
            .map(|c| {
                let (centre, spread) = moments(gains.iter().map(|g| g[c]));
                centre + top * spread
            })
            .collect()
    }

    /// Tests whether the records come from the twin.
    ///
    /// Each statistic is expressed in standard deviations over *all others*, simulations and record alike; the largest of
    /// the candidates' and the largest of the omnibus' are expressed so once more, and the larger of the two is ranked. As
    /// the record is treated as any simulation is, the rank is exact where the simulations are as the record.
    pub fn test(&self) -> Test {
        let pool: Vec<&Statistics> = std::iter::once(&self.own)
            .chain(self.others.iter().flatten())
            .collect();
        let failed = self.others.iter().filter(|o| o.is_none()).count();
        let of = |take: fn(&Statistics) -> &Vec<f64>| -> Vec<Vec<f64>> {
            standardised(
                &pool
                    .iter()
                    .map(|statistics| take(statistics))
                    .collect::<Vec<_>>(),
            )
        };
        let ranked = |all: &[f64], own: f64| {
            let mut null = all[1..].to_vec();
            null.extend(std::iter::repeat_n(f64::NAN, failed));
            rank_p_value(&null, own - HAIR)
        };
        let (gains, omnibus, local) = (of(|l| &l.gains), of(|l| &l.omnibus), of(|l| &l.local));
        let (top_gain, top_omnibus) = (largest(&gains), largest(&omnibus));
        let both: Vec<Vec<f64>> = (top_gain.iter().zip(&top_omnibus))
            .map(|(a, b)| vec![*a, *b])
            .collect();
        let both = largest(&standardised(&both.iter().collect::<Vec<_>>()));
        let top_local = largest(&local);
        Test {
            p_value: ranked(&both, both[0]),
            statistic: both[0],
            as_extreme: failed + both[1..].iter().filter(|z| **z >= both[0] - HAIR).count(),
            candidates: gains[0].iter().map(|z| ranked(&top_gain, *z)).collect(),
            local: local[0].iter().map(|z| ranked(&top_local, *z)).collect(),
        }
    }
}

/// The largest entry of each row.
pub(in crate::diagnose) fn largest(rows: &[Vec<f64>]) -> Vec<f64> {
    (rows.iter())
        .map(|row| row.iter().fold(f64::NEG_INFINITY, |a, v| a.max(*v)))
        .map(|v| if v.is_finite() { v } else { 0.0 })
        .collect()
}

/// Mean and standard deviation, the latter as wide as a test takes it.
fn moments(values: impl Iterator<Item = f64>) -> (f64, f64) {
    let values: Vec<f64> = values.collect();
    let n = values.len().max(1) as f64;
    let mean = values.iter().sum::<f64>() / n;
    let variance = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / n;
    (
        mean,
        variance
            .max(Thresholds::LEAST_SPREAD * Thresholds::LEAST_SPREAD)
            .sqrt(),
    )
}

/// Each entry less the mean of its column over all *other* rows, in their standard deviations.
pub(in crate::diagnose) fn standardised(rows: &[&Vec<f64>]) -> Vec<Vec<f64>> {
    let n = rows.len() as f64;
    let width = rows.first().map_or(0, |r| r.len());
    let mut z: Vec<Vec<f64>> = rows.iter().map(|_| vec![0.0; width]).collect();
    for j in 0..width {
        let sum: f64 = rows.iter().map(|r| r[j]).sum();
        let centre = sum / n;
        let square: f64 = rows.iter().map(|r| (r[j] - centre).powi(2)).sum();
        for (row, z) in rows.iter().zip(&mut z) {
            let own = row[j] - centre;
            let mean = -own / (n - 1.0);
            let variance = (square - own * own) / (n - 1.0) - mean * mean;
            z[j] = (own - mean)
                / variance
                    .max(Thresholds::LEAST_SPREAD * Thresholds::LEAST_SPREAD)
                    .sqrt();
        }
    }
    z
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_outlier_is_measured_by_the_others() {
        let rows: Vec<Vec<f64>> = [50.0, 1.0, 2.0, 3.0].map(|v| vec![v]).to_vec();
        let z = standardised(&rows.iter().collect::<Vec<_>>());
        // Mean 2, standard deviation √(2/3).
        assert!((z[0][0] - 48.0 / (2.0f64 / 3.0).sqrt()).abs() < 1e-9);
        assert!(z[1][0] < 0.0);
    }
}
