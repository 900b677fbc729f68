//! Simulations compressed to features: banks for training, clouds around an estimate, nulls for tests.

use crate::feature::{Centred, FeatureError, FeatureMap, FeatureRecipe};
use crate::progress::{Cancelled, Stage};
use crate::twin::{
    DigitalTwin, Drive, Noise, ParameterSpace, Record, Signal, Signals, SimulationError, StateSpace,
};
use nalgebra::DVector;
use ndarray::Array2;
use rayon::prelude::*;
use std::borrow::Cow;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Failures of one sample before the draws count as hopeless; a twin that fails nine times in ten passes.
const ATTEMPTS: usize = 200;
/// Share of failed draws beyond which the work stops.
const HOPELESS: f64 = 0.9;

/// A twin seen through its features; counts every simulation, also those that the features make.
pub struct FeatureSimulator {
    twin: Arc<Counted>,
    map: Arc<dyn FeatureMap>,
}

/// A twin that counts its calls.
struct Counted {
    inner: Arc<dyn DigitalTwin>,
    calls: AtomicUsize,
}

impl DigitalTwin for Counted {
    fn parameters(&self) -> ParameterSpace {
        self.inner.parameters()
    }
    fn signals(&self) -> Signals {
        self.inner.signals()
    }
    fn state_space(&self) -> Option<&dyn StateSpace> {
        self.inner.state_space()
    }
    fn simulate(
        &self,
        theta: &[f64],
        drive: &Drive,
        noise: Noise,
    ) -> Result<Signal, SimulationError> {
        self.calls.fetch_add(1, Ordering::Relaxed);
        self.inner.simulate(theta, drive, noise)
    }
}

/// Why one simulation gave no features.
#[derive(Debug, thiserror::Error)]
pub enum DrawError {
    /// This point cannot be used; others can.
    #[error("{0}")]
    Rejected(String),
    /// No point will help.
    #[error(transparent)]
    Fatal(#[from] BankError),
}

/// Why a set of simulations could not be made.
#[derive(Debug, thiserror::Error)]
pub enum BankError {
    /// The simulator failed for good.
    #[error(transparent)]
    Simulation(SimulationError),
    /// The features cannot be extracted from any run.
    #[error(transparent)]
    Feature(FeatureError),
    /// Nearly all draws failed.
    #[error(
        "{failed} of {tried} draws failed ({reason}); shrink the prior, the bounds or the step, or mend the twin"
    )]
    Hopeless {
        /// Failed draws.
        failed: usize,
        /// All draws.
        tried: usize,
        /// What the last failure said.
        reason: String,
    },
    /// The draw of an input failed.
    #[error("the input cannot be made: {0}")]
    Input(String),
    /// Stopped from outside.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

/// Where to simulate.
pub struct Draw<'a> {
    /// Parameters.
    pub theta: Vec<f64>,
    /// Time grid and inputs.
    pub drive: Cow<'a, Drive>,
}

/// Parameters and the features simulated there, row by row.
#[derive(Debug, Clone, PartialEq)]
pub struct Draws {
    /// Parameters, M × d.
    pub theta: Array2<f64>,
    /// Features, M × n.
    pub features: Array2<f64>,
    /// Draws that were out of bounds, diverged or had no features, and were drawn again.
    pub redrawn: usize,
}

/// One simulation of a set.
struct Row {
    theta: Vec<f64>,
    features: Vec<f64>,
    /// Draws before that were out of bounds.
    rejected: usize,
    /// Draws before that diverged or had no features.
    failed: usize,
    /// Why the last of these failed.
    reason: Option<String>,
}

impl FeatureSimulator {
    /// Couples a twin with features, which are bound to it here.
    ///
    /// # Errors
    ///
    /// Features that this twin cannot have.
    pub fn new(
        twin: Arc<dyn DigitalTwin>,
        features: &dyn FeatureRecipe,
    ) -> Result<Self, FeatureError> {
        let twin = Arc::new(Counted {
            inner: twin,
            calls: AtomicUsize::new(0),
        });
        let counted: Arc<dyn DigitalTwin> = twin.clone();
        Ok(Self {
            map: features.bind(&counted)?,
            twin,
        })
    }

    /// The twin.
    pub fn twin(&self) -> &dyn DigitalTwin {
        self.twin.as_ref()
    }

    /// Number of features.
    pub fn dim(&self) -> usize {
        self.map.dim()
    }

    /// Simulator calls so far.
    pub fn calls(&self) -> usize {
        self.twin.calls.load(Ordering::Relaxed)
    }

    /// Features of a record.
    pub fn observe(&self, record: &Record) -> Result<DVector<f64>, FeatureError> {
        let features = self.map.extract(record.drive(), record.outputs())?;
        Ok(DVector::from_vec(features))
    }

    /// The simulator with its features centred on a record, and where the record puts θ; `None` for features that do not
    /// centre themselves. Calls are counted together.
    ///
    /// # Errors
    ///
    /// As [`FeatureMap::centred`].
    pub fn centred(
        &self,
        record: &Record,
        initial: &[f64],
        noise: Noise,
    ) -> Result<Option<(Self, Centred)>, FeatureError> {
        let found = self.map.centred(record, initial, noise)?;
        Ok(found.map(|centred| {
            let simulator = Self {
                twin: self.twin.clone(),
                map: centred.map.clone(),
            };
            (simulator, centred)
        }))
    }

    /// Features of one simulation.
    pub fn features(
        &self,
        theta: &[f64],
        drive: &Drive,
        noise: Noise,
    ) -> Result<Vec<f64>, DrawError> {
        let outputs = match self.twin.simulate(theta, drive, noise) {
            Ok(outputs) => outputs,
            Err(error) if error.costs_one_run() => {
                return Err(DrawError::Rejected(error.to_string()));
            }
            Err(error) => return Err(BankError::Simulation(error).into()),
        };
        let rejected = |text: String| Err(DrawError::Rejected(text));
        match self.map.extract(drive, &outputs) {
            Ok(features) if features.iter().all(|v| v.is_finite()) => Ok(features),
            Ok(_) => rejected("features are not finite".into()),
            Err(
                error @ (FeatureError::Constant { .. }
                | FeatureError::Regression(_)
                | FeatureError::Information),
            ) => rejected(error.to_string()),
            Err(FeatureError::Reference(error)) if error.costs_one_run() => {
                rejected(error.to_string())
            }
            Err(FeatureError::Filter(error)) if error.is_recoverable() => {
                rejected(error.to_string())
            }
            Err(error) => Err(BankError::Feature(error).into()),
        }
    }

    /// Mean features over noise samples 0 … `seeds` − 1 of `noise`: the same draws at every θ (common random
    /// numbers), so that differences between parameters are not drowned by noise.
    pub fn mean_features(
        &self,
        theta: &[f64],
        drive: &Drive,
        noise: impl Fn(u64) -> Noise + Sync,
        seeds: usize,
    ) -> Result<DVector<f64>, DrawError> {
        let runs: Vec<Vec<f64>> = (0..seeds as u64)
            .into_par_iter()
            .map(|sample| self.features(theta, drive, noise(sample)))
            .collect::<Result<_, _>>()?;
        // Summed in order: the same bits for any number of threads.
        let mut mean = DVector::zeros(self.dim());
        for run in runs {
            mean += DVector::from_vec(run);
        }
        Ok(mean / seeds as f64)
    }

    /// `size` simulations on all cores of the current rayon pool; row i depends on `noise(i)` alone.
    ///
    /// `draw(i, attempt, noise)` says where to simulate, or rejects (`None`: out of bounds). A rejected or failed draw is
    /// drawn again with the child noise of the next attempt, and counted; failures alone can stop the work.
    pub fn draws<'a>(
        &self,
        size: usize,
        noise: impl Fn(u64) -> Noise + Sync,
        draw: impl Fn(u64, usize, Noise) -> Result<Option<Draw<'a>>, BankError> + Sync,
        stage: &Stage,
    ) -> Result<Draws, BankError> {
        let rows: Vec<Row> = (0..size as u64)
            .into_par_iter()
            .map(|i| {
                let row = self.one(i, noise(i), &draw)?;
                stage.tick()?;
                Ok(row)
            })
            .collect::<Result<_, BankError>>()?;
        let failed: usize = rows.iter().map(|row| row.failed).sum();
        if failed as f64 > HOPELESS * (size + failed) as f64 {
            let reason = rows.iter().rev().find_map(|row| row.reason.clone());
            return Err(BankError::Hopeless {
                failed,
                tried: size + failed,
                reason: reason.unwrap_or_default(),
            });
        }
        let stack = |of: fn(&Row) -> &Vec<f64>, width: usize| {
            let mut all = Array2::zeros((size, width));
            for (mut row, values) in all.rows_mut().into_iter().zip(rows.iter().map(of)) {
                row.assign(&ndarray::ArrayView1::from(values));
            }
            all
        };
        Ok(Draws {
            theta: stack(|row| &row.theta, self.twin.parameters().len()),
            features: stack(|row| &row.features, self.dim()),
            redrawn: failed + rows.iter().map(|row| row.rejected).sum::<usize>(),
        })
    }

    /// One row.
    fn one<'a>(
        &self,
        i: u64,
        noise: Noise,
        draw: &impl Fn(u64, usize, Noise) -> Result<Option<Draw<'a>>, BankError>,
    ) -> Result<Row, BankError> {
        let (mut rejected, mut failed, mut reason) = (0, 0, None);
        while failed < ATTEMPTS && rejected < ATTEMPTS {
            let attempt = rejected + failed;
            let noise = match attempt {
                0 => noise,
                _ => noise.child(&format!("attempt {attempt}")),
            };
            let Some(Draw { theta, drive }) = draw(i, attempt, noise)? else {
                rejected += 1;
                continue;
            };
            match self.features(&theta, &drive, noise) {
                Ok(features) => {
                    return Ok(Row {
                        theta,
                        features,
                        rejected,
                        failed,
                        reason,
                    });
                }
                Err(DrawError::Rejected(text)) => {
                    failed += 1;
                    reason = Some(text);
                }
                Err(DrawError::Fatal(error)) => return Err(error),
            }
        }
        Err(BankError::Hopeless {
            failed: rejected + failed,
            tried: rejected + failed,
            reason: reason.unwrap_or_else(|| "out of bounds".into()),
        })
    }

    /// `size` simulations at one θ under one drive.
    pub fn repeat(
        &self,
        theta: &[f64],
        drive: &Drive,
        size: usize,
        noise: impl Fn(u64) -> Noise + Sync,
        stage: &Stage,
    ) -> Result<Array2<f64>, BankError> {
        let draw = |_, _, _| {
            Ok(Some(Draw {
                theta: theta.to_vec(),
                drive: Cow::Borrowed(drive),
            }))
        };
        Ok(self.draws(size, noise, draw, stage)?.features)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::feature::Ar;
    use crate::progress::Progress;
    use crate::twin::Parameter;
    use crate::twins::VanDerPol;

    fn simulator(twin: impl DigitalTwin + 'static) -> FeatureSimulator {
        FeatureSimulator::new(Arc::new(twin), &Ar { order: 2 }).unwrap()
    }

    fn bank(simulator: &FeatureSimulator, size: usize) -> Result<Draws, BankError> {
        let drive = Drive::autonomous(0.05, 60).unwrap();
        let space = simulator.twin().parameters();
        simulator.draws(
            size,
            |i| Noise::new(1, "bank", i),
            |_, _, noise| {
                Ok(Some(Draw {
                    theta: space.draw_prior(noise),
                    drive: Cow::Borrowed(&drive),
                }))
            },
            &Progress::silent().stage("bank", size),
        )
    }

    #[test]
    fn threads_and_size_change_no_sample() {
        let on = |threads| {
            let pool = rayon::ThreadPoolBuilder::new()
                .num_threads(threads)
                .build()
                .unwrap();
            pool.install(|| bank(&simulator(VanDerPol), 40).unwrap())
        };
        assert_eq!(on(1), on(3));
        let short = bank(&simulator(VanDerPol), 10).unwrap();
        assert_eq!(short.features.row(9), on(2).features.row(9));
    }

    /// Diverges on a share of its prior.
    struct Fragile(f64);
    impl DigitalTwin for Fragile {
        fn parameters(&self) -> ParameterSpace {
            ParameterSpace::new([Parameter::new("a", "", 0.0, 1.0)])
        }
        fn signals(&self) -> Signals {
            Signals {
                inputs: vec![],
                ..Signals::default()
            }
        }
        fn simulate(
            &self,
            theta: &[f64],
            drive: &Drive,
            noise: Noise,
        ) -> Result<Signal, SimulationError> {
            if theta[0] < self.0 {
                return Err(SimulationError::Diverged { at: 0.0 });
            }
            let mut source = noise.source("v");
            Ok(Signal::from_shape_simple_fn((drive.samples(), 1), || {
                source.normal()
            }))
        }
    }

    #[test]
    fn diverged_draws_are_redrawn_and_counted() {
        let simulator = simulator(Fragile(0.5));
        let draws = bank(&simulator, 200).unwrap();
        assert!(draws.theta.iter().all(|a| *a >= 0.5));
        // Failures before 200 successes at ½: mean 200, sd 20.
        assert!((100..300).contains(&draws.redrawn), "{}", draws.redrawn);
        assert_eq!(simulator.calls(), 200 + draws.redrawn);
    }

    #[test]
    fn a_twin_that_nearly_always_diverges_stops_the_work() {
        let error = bank(&simulator(Fragile(0.97)), 50).unwrap_err();
        assert!(matches!(error, BankError::Hopeless { .. }), "{error}");
    }
}
