//! Errors of each stage of the estimator over many simulated records.

use super::{Scenario, scenario};
use crate::progress::{Cancelled, Progress};
use crate::twin::{Noise, Record, RecordError, SimulationError};
use crate::two_stage::{EstimateError, EstimateOptions, Estimator};
use std::fmt;

/// A stage of the estimator whose error is scored.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Method {
    /// The pretrained network.
    TsPre,
    /// Gauss–Newton, whatever the gate says.
    GaussNewton,
    /// Tuned heads, whatever the gate says.
    TsFine,
    /// What the estimator answers: gate, misfit and all.
    Final,
}

impl fmt::Display for Method {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::TsPre => "TS-pre",
            Self::GaussNewton => "GN",
            Self::TsFine => "TS-fine",
            Self::Final => "final",
        })
    }
}

/// Error of one method.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MethodScore {
    /// Method.
    pub method: Method,
    /// Mean over runs and parameters of the squared error.
    pub mse: f64,
    /// Median over runs of the squared error, averaged over parameters.
    pub median: f64,
    /// Mean wall-clock time a record, milliseconds.
    pub milliseconds: f64,
}

/// What is run.
#[derive(Debug, Clone, Copy)]
pub struct MonteCarlo {
    /// Where θ comes from.
    pub scenario: Scenario,
    /// Number of records.
    pub runs: usize,
    /// Seed of records and estimates.
    pub seed: u64,
}

/// Why there are no scores.
#[derive(Debug, thiserror::Error)]
pub enum MonteCarloError {
    /// The paper has no test points for this twin.
    #[error("the paper has no test points for twin \"{0}\"; choose van-der-pol or tanks")]
    NoScenario(String),
    /// A record could not be simulated.
    #[error(transparent)]
    Simulation(#[from] SimulationError),
    /// A record could not be made.
    #[error(transparent)]
    Record(#[from] RecordError),
    /// An estimate failed.
    #[error("run {run}: {error}")]
    Estimate {
        /// Run, from 0.
        run: usize,
        /// What failed.
        error: Box<EstimateError>,
    },
    /// Stopped from outside.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

/// One run: squared error, averaged over parameters, and milliseconds, for each of the four methods.
type Run = [(f64, f64); 4];

/// Scores every stage of `estimator` on simulated records.
pub fn score(
    estimator: &Estimator,
    plan: &MonteCarlo,
    progress: &Progress,
) -> Result<Vec<MethodScore>, MonteCarloError> {
    let stage = progress.stage("records", plan.runs);
    let runs: Vec<Run> = (0..plan.runs)
        .map(|run| {
            let scores = one(estimator, plan, run)?;
            stage.tick()?;
            Ok(scores)
        })
        .collect::<Result<_, MonteCarloError>>()?;
    let methods = [
        Method::TsPre,
        Method::GaussNewton,
        Method::TsFine,
        Method::Final,
    ];
    Ok((methods.into_iter().enumerate())
        .map(|(m, method)| {
            let mean = |of: fn(&(f64, f64)) -> f64| {
                runs.iter().map(|run| of(&run[m])).sum::<f64>() / runs.len().max(1) as f64
            };
            let errors: Vec<f64> = runs.iter().map(|run| run[m].0).collect();
            MethodScore {
                method,
                mse: mean(|run| run.0),
                median: crate::math::median(&errors).unwrap_or(f64::NAN),
                milliseconds: mean(|run| run.1),
            }
        })
        .collect())
}

fn one(estimator: &Estimator, plan: &MonteCarlo, run: usize) -> Result<Run, MonteCarloError> {
    let study = estimator.study();
    let noise = Noise::new(plan.seed, "record", run as u64);
    let (truth, drive) = scenario(study, plan.scenario, noise)
        .ok_or_else(|| MonteCarloError::NoScenario(study.name().into()))?
        .map_err(RecordError::from)?;
    let outputs = study.twin().simulate(&truth, &drive, noise)?;
    let record = Record::new(drive, outputs)?;
    let options = EstimateOptions {
        seed: noise.seed().unwrap_or(plan.seed),
        always_refine: true,
        ..EstimateOptions::default()
    };
    let estimate =
        (estimator.estimate(&record, &options, &Progress::silent())).map_err(|error| {
            MonteCarloError::Estimate {
                run,
                error: Box::new(error),
            }
        })?;
    let error = |theta: &[f64]| {
        let squares = theta.iter().zip(&truth).map(|(a, b)| (a - b).powi(2));
        squares.sum::<f64>() / truth.len() as f64
    };
    let of = |theta: &Option<Vec<f64>>| theta.as_deref().map_or(f64::NAN, error);
    let seconds = &estimate.seconds;
    let gauss_newton = seconds.predict + seconds.gate + seconds.gauss_newton.unwrap_or(0.0);
    let fine = gauss_newton + seconds.cloud.unwrap_or(0.0) + seconds.tune.unwrap_or(0.0);
    // What would have been answered without being told to refine.
    let (last, last_time) = if estimate.gate.out_of_distribution {
        (&estimate.theta, seconds.total)
    } else {
        (&estimate.initial, seconds.predict + seconds.gate)
    };
    let milliseconds = 1000.0;
    Ok([
        (error(&estimate.initial), seconds.predict * milliseconds),
        (of(&estimate.gauss_newton), gauss_newton * milliseconds),
        (of(&estimate.fine), fine * milliseconds),
        (error(last), last_time * milliseconds),
    ])
}
