//! Many simulations, row by row.

use super::simulator::FeatureSimulator;
use crate::estimator::error::EstimatorError;
use crate::progress::Stage;
use crate::record::Drive;
use crate::twin::Noise;
use ndarray::{Array2, s};
use rayon::prelude::*;
use std::borrow::Cow;
use std::ops::Range;

/// Failures of one sample before the draws count as hopeless; a twin that fails nine times in ten passes.
const ATTEMPTS: usize = 200;
/// Share of failed draws beyond which the work stops.
const HOPELESS: f64 = 0.9;

/// Where to simulate.
#[derive(Debug, Clone)]
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

impl Draws {
    /// The rows of several parts, one after another, `rows` of them at most; parts beyond these are not asked for. `odd` is the
    /// error of a part whose rows have another width than those of the first.
    pub(crate) fn stacked<'a, E>(
        rows: usize,
        parts: impl IntoIterator<Item = Result<Cow<'a, Self>, E>>,
        odd: impl Fn(usize) -> E,
    ) -> Result<Self, E> {
        let mut all: Option<[Array2<f64>; 2]> = None;
        let (mut filled, mut redrawn) = ([0; 2], 0);
        for (index, part) in parts.into_iter().enumerate() {
            let part = part?;
            let sources = [&part.theta, &part.features];
            let all = all.get_or_insert_with(|| sources.map(|m| Array2::zeros((rows, m.ncols()))));
            for ((all, source), filled) in all.iter_mut().zip(sources).zip(&mut filled) {
                if source.ncols() != all.ncols() {
                    return Err(odd(index));
                }
                let to = rows.min(*filled + source.nrows());
                let taken = source.slice(s![..to - *filled, ..]);
                all.slice_mut(s![*filled..to, ..]).assign(&taken);
                *filled = to;
            }
            redrawn += part.redrawn;
            if filled[0] == rows {
                break;
            }
        }
        let [theta, features] = all.unwrap_or_default();
        Ok(Self {
            theta: theta.slice_move(s![..filled[0], ..]),
            features: features.slice_move(s![..filled[1], ..]),
            redrawn,
        })
    }
}

/// Simulations that need not fit into memory at once: rows of parameters and features, in parts.
///
/// Rows are independent draws, so that any set of parts is a sample of the whole.
pub trait Bank: Sync {
    /// Rows of each part, in order.
    fn parts(&self) -> Vec<usize>;

    /// Part number `index`.
    fn part(&self, index: usize) -> Result<Cow<'_, Draws>, EstimatorError>;

    /// All rows.
    fn rows(&self) -> usize {
        self.parts().iter().sum()
    }
}

/// A bank in memory: one part.
impl Bank for Draws {
    fn parts(&self) -> Vec<usize> {
        vec![self.theta.nrows()]
    }

    fn part(&self, _: usize) -> Result<Cow<'_, Draws>, EstimatorError> {
        Ok(Cow::Borrowed(self))
    }
}

/// One simulation of a set, or the draws so far that gave none.
#[derive(Default)]
struct DrawnRow {
    theta: Vec<f64>,
    features: Option<Vec<f64>>,
    /// Draws that were out of bounds.
    rejected: usize,
    /// Draws that diverged or had no features.
    failed: usize,
    /// Why the last of these failed.
    reason: Option<String>,
}

impl DrawnRow {
    fn check(&self) -> Result<(), EstimatorError> {
        if self.failed < ATTEMPTS && self.rejected < ATTEMPTS {
            return Ok(());
        }
        let tried = self.failed + self.rejected;
        let reason = self.reason.clone();
        Err(EstimatorError::Hopeless {
            failed: tried,
            tried,
            reason: reason.unwrap_or_else(|| "out of bounds".into()),
        })
    }
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
        let rows: Vec<DrawnRow> = (numbers.par_chunks(self.at_once()))
            .map(|numbers| {
                let rows = self.some(numbers, &noise, &draw)?;
                numbers.iter().try_for_each(|_| stage.tick())?;
                Ok(rows)
            })
            .collect::<Result<Vec<_>, EstimatorError>>()?
            .into_iter()
            .flatten()
            .collect();
        let size = rows.len();
        let failed: usize = rows.iter().map(|row| row.failed).sum();
        if failed as f64 > HOPELESS * (size + failed) as f64 {
            let reason = rows.iter().rev().find_map(|row| row.reason.clone());
            return Err(EstimatorError::Hopeless {
                failed,
                tried: size + failed,
                reason: reason.unwrap_or_default(),
            });
        }
        let stack = |of: &dyn Fn(&DrawnRow) -> &[f64], width: usize| {
            let mut all = Array2::zeros((size, width));
            for (mut to, row) in all.rows_mut().into_iter().zip(&rows) {
                to.assign(&ndarray::ArrayView1::from(of(row)));
            }
            all
        };
        Ok(Draws {
            theta: stack(&|row| &row.theta, self.twin().parameters().len()),
            features: stack(&|row| row.features.as_deref().unwrap_or(&[]), self.dim()),
            redrawn: failed + rows.iter().map(|row| row.rejected).sum::<usize>(),
        })
    }

    /// Rows of these numbers, the features of all that are drawn found at once.
    fn some<'a>(
        &self,
        numbers: &[u64],
        noise: &impl Fn(u64) -> Noise,
        draw: &impl Fn(u64, usize, Noise) -> Result<Option<Draw<'a>>, EstimatorError>,
    ) -> Result<Vec<DrawnRow>, EstimatorError> {
        let mut rows: Vec<DrawnRow> = numbers.iter().map(|_| DrawnRow::default()).collect();
        while rows.iter().any(|row| row.features.is_none()) {
            let mut drawn: Vec<(usize, Draw<'a>, Noise)> = vec![];
            for (k, row) in rows.iter_mut().enumerate() {
                if row.features.is_some() {
                    continue;
                }
                row.check()?;
                let attempt = row.rejected + row.failed;
                let noise = match attempt {
                    0 => noise(numbers[k]),
                    _ => noise(numbers[k]).child(&format!("attempt {attempt}")),
                };
                match draw(numbers[k], attempt, noise)? {
                    Some(draw) => drawn.push((k, draw, noise)),
                    None => row.rejected += 1,
                }
            }
            let all: Vec<_> = (drawn.iter())
                .map(|(_, draw, noise)| (&draw.theta[..], &*draw.drive, *noise))
                .collect();
            let found = self.features(&all);
            for ((k, draw, _), found) in drawn.into_iter().zip(found) {
                let row = &mut rows[k];
                match found {
                    Ok(features) => (row.theta, row.features) = (draw.theta, Some(features)),
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
        let draw = |_, _, _| {
            Ok(Some(Draw {
                theta: theta.to_vec(),
                drive: Cow::Borrowed(drive),
            }))
        };
        Ok(self.draws(0..size as u64, noise, draw, stage)?.features)
    }
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
        assert!(matches!(error, EstimatorError::Hopeless { .. }), "{error}");
    }
}
