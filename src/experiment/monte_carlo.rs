//! Errors of each stage of the estimator over many simulated records.

use super::{Scenario, scenario};
use crate::baseline::{DualFilter, Initialisation, PredictionError};
use crate::progress::{Cancelled, Progress};
use crate::twin::{Noise, Record, RecordError, SimulationError};
use crate::two_stage::{Estimate, EstimateError, EstimateOptions, Estimator};
use std::fmt;
use std::time::Instant;

/// What is scored.
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
    /// The prediction-error method, the paper's six steps.
    PredictionError(Initialisation),
    /// The dual Kalman filter; of twins with equations only.
    DualFilter(Initialisation),
}

impl Method {
    /// Every row, in the order of a table.
    pub fn all() -> Vec<Self> {
        let mut all = vec![Self::TsPre, Self::GaussNewton, Self::TsFine, Self::Final];
        all.extend(Initialisation::ALL.map(Self::PredictionError));
        all.extend(Initialisation::ALL.map(Self::DualFilter));
        all
    }

    /// Where a baseline starts.
    pub fn initialisation(self) -> Option<Initialisation> {
        match self {
            Self::PredictionError(start) | Self::DualFilter(start) => Some(start),
            _ => None,
        }
    }
}

impl fmt::Display for Method {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::TsPre => "TS-pre",
            Self::GaussNewton => "GN",
            Self::TsFine => "TS-fine",
            Self::Final => "final",
            Self::PredictionError(_) => "PEM",
            Self::DualFilter(_) => "dual-EKF",
        })
    }
}

/// Error of one method.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MethodScore {
    /// Method.
    pub method: Method,
    /// Mean over runs and parameters of the squared error; NaN where the method cannot be used or failed on a run.
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

/// Squared error, averaged over parameters, and milliseconds, of each method.
type Run = Vec<(f64, f64)>;

/// Scores every stage of `estimator`, and the baselines, on simulated records.
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
    Ok((Method::all().into_iter().enumerate())
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
    let twin = study.twin().as_ref();
    let start = |from: Initialisation| {
        let noise = noise.child("start");
        (from.theta(&twin.parameters(), &truth, &estimate.initial, noise)).ok()
    };
    Ok((Method::all().into_iter())
        .map(|method| {
            let clock = Instant::now();
            // A baseline that fails on a record scores NaN: its row says that it cannot be relied on here.
            let (theta, seconds) = match method {
                Method::PredictionError(from) => {
                    let fit = start(from).and_then(|start| {
                        PredictionError::default().fit(twin, &record, &start).ok()
                    });
                    (fit.map(|fit| fit.theta), None)
                }
                Method::DualFilter(from) => {
                    let run = start(from)
                        .zip(twin.state_space())
                        .and_then(|(start, equations)| {
                            DualFilter::default().run(equations, &record, &start).ok()
                        });
                    (run.map(|run| run.theta), None)
                }
                stage => of_stage(stage, &estimate),
            };
            let seconds = seconds.unwrap_or_else(|| clock.elapsed().as_secs_f64());
            let error = theta.map_or(f64::NAN, |theta| {
                let squares = theta.iter().zip(&truth).map(|(a, b)| (a - b).powi(2));
                squares.sum::<f64>() / truth.len() as f64
            });
            (error, 1000.0 * seconds)
        })
        .collect())
}

/// Estimate and seconds of one stage of the estimator.
fn of_stage(method: Method, estimate: &Estimate) -> (Option<Vec<f64>>, Option<f64>) {
    let seconds = &estimate.seconds;
    let initial = (Some(estimate.initial.clone()), seconds.predict);
    let gauss_newton = seconds.predict + seconds.gate + seconds.gauss_newton.unwrap_or(0.0);
    let (theta, seconds) = match method {
        Method::GaussNewton => (estimate.gauss_newton.clone(), gauss_newton),
        Method::TsFine => {
            let cloud = seconds.cloud.unwrap_or(0.0) + seconds.tune.unwrap_or(0.0);
            (estimate.fine.clone(), gauss_newton + cloud)
        }
        // What would have been answered without being told to refine.
        Method::Final if estimate.gate.out_of_distribution => {
            (Some(estimate.theta.clone()), seconds.total)
        }
        Method::Final => (initial.0, seconds.predict + seconds.gate),
        _ => initial,
    };
    (theta, Some(seconds))
}
