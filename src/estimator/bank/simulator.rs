//! A twin seen through its features, and many simulations of it, row by row.

use super::{Draw, Draws};
use crate::estimator::budget::BUDGET;
use crate::estimator::error::EstimatorError;
use crate::feature::{FeatureError, FeatureMap, FeatureRecipe};
use crate::parallel::try_each;
use crate::progress::Stage;
use crate::record::{Drive, Record, Signal, check_sizes};
use crate::twin::{Noise, Twin};
use nalgebra::DVector;
use ndarray::{Array2, aview1};
use std::borrow::Cow;
use std::ops::Range;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

/// A twin seen through its features; counts every simulation, also those that the features make.
#[derive(Clone)]
pub struct FeatureSimulator {
    twin: Twin,
    calls: Arc<AtomicUsize>,
    map: Arc<dyn FeatureMap>,
}

debug_by_name!(FeatureSimulator);

impl FeatureSimulator {
    /// Couples a twin with features, which are bound to it here.
    pub fn new(twin: impl Into<Twin>, features: &dyn FeatureRecipe) -> Result<Self, FeatureError> {
        let calls = Arc::new(AtomicUsize::new(0));
        let twin = counted(&twin.into(), &calls);
        Ok(Self {
            map: features.bind(&twin)?,
            twin,
            calls,
        })
    }

    /// The simulator with another twin over the same θ and signals. Its features stay those of the first twin, unless they are given
    /// to be bound anew. Calls are counted together.
    pub(in crate::estimator) fn of(
        &self,
        twin: &Twin,
        features: Option<&dyn FeatureRecipe>,
    ) -> Result<Self, FeatureError> {
        let twin = counted(twin, &self.calls);
        Ok(Self {
            map: features.map_or_else(|| Ok(self.map.clone()), |features| features.bind(&twin))?,
            twin,
            calls: self.calls.clone(),
        })
    }

    /// The twin.
    pub fn twin(&self) -> &Twin {
        &self.twin
    }

    /// Number of features.
    pub fn dim(&self) -> usize {
        self.map.dim()
    }

    /// Simulator calls so far.
    pub fn calls(&self) -> usize {
        self.calls.load(Ordering::Relaxed)
    }

    /// Features of a record.
    pub fn observe(&self, record: &Record) -> Result<DVector<f64>, FeatureError> {
        record.check_complete()?;
        let mut features = self.map.extract(record.drive(), record.outputs());
        if let Err(FeatureError::Constant { channel, name, .. }) = &mut features {
            *name = self.twin.signals().outputs[*channel - 1].name.clone();
        }
        Ok(DVector::from_vec(features?))
    }

    /// The simulator with its features about θ; `None` for features that have no reference. Calls are counted together.
    pub fn about(&self, theta: &[f64]) -> Option<Self> {
        Some(Self {
            twin: self.twin.clone(),
            calls: self.calls.clone(),
            map: self.map.about(theta)?,
        })
    }

    /// Number of simulations whose features are best found at once.
    pub fn at_once(&self) -> usize {
        self.map.at_once().max(1)
    }

    /// Features of simulations, each of which may be rejected.
    pub fn features(
        &self,
        all: &[(&[f64], &Drive, Noise)],
    ) -> Vec<Result<Vec<f64>, EstimatorError>> {
        let signals = self.twin.signals();
        let outputs: Vec<Result<Signal, EstimatorError>> = (all.iter())
            .map(|&(theta, drive, noise)| {
                let outputs =
                    self.twin.simulate(theta, drive, noise).map_err(|error| {
                        match error.costs_one_run() {
                            true => EstimatorError::Rejected(error.to_string()),
                            false => EstimatorError::Simulation(error),
                        }
                    })?;
                check_sizes(&outputs, "output", &signals.outputs)
                    .map_err(|error| EstimatorError::Rejected(error.to_string()))?;
                Ok(outputs)
            })
            .collect();
        let simulated: Vec<(&Drive, &Signal)> = (all.iter().zip(&outputs))
            .filter_map(|((_, drive, _), outputs)| Some((*drive, outputs.as_ref().ok()?)))
            .collect();
        let mut features = self.map.extract_all(&simulated).into_iter();
        let rejected = |what: &str| EstimatorError::Rejected(what.into());
        (outputs.into_iter())
            .map(|outputs| {
                outputs?;
                let found = features.next();
                let found = found.ok_or_else(|| rejected("the features are missing"))?;
                let found = found.map_err(refused)?;
                match found.iter().all(|v| v.is_finite()) {
                    true => Ok(found),
                    false => Err(rejected("features are not finite")),
                }
            })
            .collect()
    }

    /// Mean features over noise samples 0 … `seeds` − 1 of `noise`: the same draws at every θ (common random
    /// numbers), so that differences between parameters are not drowned by noise.
    pub fn mean_features(
        &self,
        theta: &[f64],
        drive: &Drive,
        noise: impl Fn(u64) -> Noise + Sync,
        seeds: usize,
    ) -> Result<DVector<f64>, EstimatorError> {
        let samples: Vec<u64> = (0..seeds as u64).collect();
        let runs = try_each(samples.chunks(self.at_once()), |samples| {
            let all: Vec<_> = (samples.iter())
                .map(|&sample| (theta, drive, noise(sample)))
                .collect();
            let features = self.features(&all).into_iter();
            features.collect::<Result<Vec<_>, EstimatorError>>()
        })?;
        // Summed in order: the same bits for any number of threads.
        let mut mean = DVector::zeros(self.dim());
        for run in runs.into_iter().flatten() {
            mean += DVector::from_vec(run);
        }
        Ok(mean / seeds as f64)
    }
}

/// One simulation of a set, or the draws so far that gave none.
#[derive(Default)]
struct DrawnRow {
    /// θ and its features.
    drawn: Option<[Vec<f64>; 2]>,
    /// Draws that were out of bounds.
    rejected: usize,
    /// Draws that diverged or had no features.
    failed: usize,
    /// Why the last of these failed.
    reason: Option<String>,
}

impl FeatureSimulator {
    /// Simulations `rows` on all cores of the current rayon pool; row i depends on `noise(i)` alone.
    ///
    /// `draw(i, attempt, noise)` says where to simulate, or rejects (`None`: out of bounds). A rejected or failed draw is
    /// drawn again with the child noise of the next attempt, and counted; failures alone can stop the work.
    pub fn draws<'a>(
        &self,
        rows: Range<u64>,
        noise: impl Fn(u64) -> Noise + Sync,
        draw: impl Fn(u64, usize, Noise) -> Result<Option<Draw<'a>>, EstimatorError> + Sync,
        stage: &Stage,
    ) -> Result<Draws, EstimatorError> {
        let numbers: Vec<u64> = rows.collect();
        let chunks = try_each(numbers.chunks(self.at_once()), |numbers| {
            let rows = self.chunk(numbers, &noise, &draw, stage)?;
            numbers.iter().try_for_each(|_| stage.tick())?;
            Ok::<_, EstimatorError>(rows)
        })?;
        let rows: Vec<DrawnRow> = chunks.into_iter().flatten().collect();
        let failed: usize = rows.iter().map(|row| row.failed).sum();
        let tried = rows.len() + failed;
        if failed as f64 > BUDGET.hopeless * tried as f64 {
            let reason = rows.into_iter().rev().find_map(|row| row.reason);
            return Err(EstimatorError::Hopeless {
                failed,
                tried,
                reason: reason.unwrap_or_default(),
            });
        }
        let mut all = Draws::zeros(rows.len(), self.twin.parameters().len(), self.dim());
        all.redrawn = failed + rows.iter().map(|row| row.rejected).sum::<usize>();
        for (i, [theta, features]) in rows.iter().filter_map(|r| r.drawn.as_ref()).enumerate() {
            all.theta.row_mut(i).assign(&aview1(theta));
            all.features.row_mut(i).assign(&aview1(features));
        }
        Ok(all)
    }

    /// Rows of these numbers, the features of all that are drawn found at once.
    fn chunk<'a>(
        &self,
        numbers: &[u64],
        noise: &impl Fn(u64) -> Noise,
        draw: &impl Fn(u64, usize, Noise) -> Result<Option<Draw<'a>>, EstimatorError>,
        stage: &Stage,
    ) -> Result<Vec<DrawnRow>, EstimatorError> {
        let mut rows: Vec<DrawnRow> = numbers.iter().map(|_| DrawnRow::default()).collect();
        while rows.iter().any(|row| row.drawn.is_none()) {
            stage.checkpoint()?;
            let mut places: Vec<(&mut DrawnRow, Draw<'a>, Noise)> = vec![];
            let missing = rows.iter_mut().zip(numbers);
            for (row, &number) in missing.filter(|(row, _)| row.drawn.is_none()) {
                let attempt = row.rejected + row.failed;
                if row.failed.max(row.rejected) >= BUDGET.attempts {
                    return Err(EstimatorError::Hopeless {
                        failed: attempt,
                        tried: attempt,
                        reason: (row.reason.take()).unwrap_or_else(|| "out of bounds".into()),
                    });
                }
                let noise = match attempt {
                    0 => noise(number),
                    _ => noise(number).child(&format!("attempt {attempt}")),
                };
                match draw(number, attempt, noise)? {
                    Some(draw) => places.push((row, draw, noise)),
                    None => row.rejected += 1,
                }
            }
            let all: Vec<_> = (places.iter())
                .map(|(_, (theta, drive), noise)| (&theta[..], &**drive, *noise))
                .collect();
            let features = self.features(&all);
            for ((row, (theta, _), _), features) in places.into_iter().zip(features) {
                match features {
                    Ok(features) => row.drawn = Some([theta, features]),
                    Err(EstimatorError::Rejected(text)) => {
                        row.failed += 1;
                        row.reason = Some(text);
                    }
                    Err(error) => return Err(error),
                }
            }
        }
        Ok(rows)
    }

    /// `size` simulations at one θ under one drive.
    pub fn repeat(
        &self,
        theta: &[f64],
        drive: &Drive,
        size: usize,
        noise: impl Fn(u64) -> Noise + Sync,
        stage: &Stage,
    ) -> Result<Array2<f64>, EstimatorError> {
        let draw = |_, _, _| Ok(Some((theta.to_vec(), Cow::Borrowed(drive))));
        Ok(self.draws(0..size as u64, noise, draw, stage)?.features)
    }
}

/// Features that are not there for reasons of one simulation reject it.
fn refused(error: FeatureError) -> EstimatorError {
    let is_of_one = match &error {
        FeatureError::Constant { .. } | FeatureError::Regression(_) | FeatureError::Information => {
            true
        }
        FeatureError::Reference(error) => error.costs_one_run(),
        FeatureError::Filter(error) => error.is_recoverable(),
        _ => false,
    };
    match is_of_one {
        true => EstimatorError::Rejected(error.to_string()),
        false => EstimatorError::Feature(error),
    }
}

/// The twin with its runs counted.
fn counted(twin: &Twin, calls: &Arc<AtomicUsize>) -> Twin {
    let counter = calls.clone();
    twin.watched(move || {
        counter.fetch_add(1, Ordering::Relaxed);
        Ok(())
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::feature::Ar;
    use crate::progress::Progress;
    use crate::record::{Signal, Signals};
    use crate::twin::{DigitalTwin, Parameter, ParameterSpace, SimulationError};
    use crate::twins::VanDerPol;
    use std::sync::Arc;

    fn simulator(twin: impl DigitalTwin + 'static) -> FeatureSimulator {
        FeatureSimulator::new(Arc::new(twin), &Ar { order: 2 }).unwrap()
    }

    fn bank(simulator: &FeatureSimulator, size: usize) -> Result<Draws, EstimatorError> {
        let drive = Drive::autonomous(0.05, 60).unwrap();
        let space = simulator.twin().parameters();
        simulator.draws(
            0..size as u64,
            |i| Noise::new(1, "bank", i),
            |_, _, noise| Ok(Some((space.draw_prior(noise), Cow::Borrowed(&drive)))),
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
        assert!(matches!(error, EstimatorError::Hopeless { .. }), "{error}");
    }
}
