//! Sources of true parameters and inputs of simulated records.

use super::Benchmark;
use crate::evaluate::EvaluateError;
use crate::fit::least_squares::{Bounds, space_filling};
use crate::record::{Drive, Record, RecordError, Signal};
use crate::study::{DriveSource, RecordPlan, Study};
use crate::twin::{Interval, Noise, Parameter, ParameterSpace};
use nalgebra::DVector;

/// Source of true parameters.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Scenario {
    /// Uniform in the prior, where the network was trained.
    InDistribution,
    /// The paper's OOD 1.
    First,
    /// The paper's OOD 2.
    Second,
    /// Uniform in the physical bounds.
    Uniform,
    /// Fixed points, half of them in the prior and half outside it, one after the other: errors and coverage are not averaged over θ.
    Grid,
}

/// Points of the grid on either side of the prior's border.
const POINTS: usize = 6;
/// Space-filling points of the bounds that are looked at for some outside the prior.
const LOOKED_AT: usize = 200;
/// Draws of θ that are tried before a diverging twin is given up.
const ATTEMPTS: u64 = 20;

impl Scenario {
    /// Its number in `truetwin.reproduce/1`.
    pub fn number(self) -> u8 {
        match self {
            Self::InDistribution => 0,
            Self::First => 1,
            Self::Second => 2,
            Self::Uniform => 3,
            Self::Grid => 4,
        }
    }

    /// Returns true if every record has the same true parameters.
    pub fn is_point(self) -> bool {
        matches!(self, Self::First | Self::Second)
    }
}

/// A simulated record and what it came from.
pub(super) struct SimulatedRecord {
    pub(super) truth: Vec<f64>,
    pub(super) record: Record,
    pub(super) noise: Noise,
}

/// A scenario of one study, ready to be drawn from.
pub(super) struct ScenarioDraws<'a> {
    study: &'a Study,
    scenario: Scenario,
    /// Values that are not drawn, in the order of θ.
    held: Vec<Option<f64>>,
    /// Points of [`Scenario::Grid`].
    grid: Vec<Vec<f64>>,
    /// The inputs of all records; none where each has its own, drawn from the study's plan.
    inputs: Option<Drive>,
    drives: DriveSource,
}

impl<'a> ScenarioDraws<'a> {
    /// Checks that the study has such a scenario.
    pub(super) fn new(
        study: &'a Study,
        benchmark: &Benchmark,
        scenario: Scenario,
    ) -> Result<Self, EvaluateError> {
        if scenario.is_point() && benchmark.points.is_empty() {
            return Err(EvaluateError::NoPoint(study.name().into()));
        }
        let held = (study.twin().parameters().iter())
            .map(|p| {
                let point = benchmark.points.iter().find(|(name, _)| *name == p.name);
                let (name, value) = match (point, scenario) {
                    (Some((name, [first, _])), Scenario::First) => (*name, *first),
                    (Some((name, [_, second])), Scenario::Second) => (*name, *second),
                    _ => return Ok(None),
                };
                let bounds = p.bounds;
                if !bounds.contains(value) {
                    return Err(EvaluateError::Outside {
                        name,
                        value,
                        bounds,
                    });
                }
                Ok(Some(value))
            })
            .collect::<Result<_, _>>()?;
        // A study that says what its records look like means its own.
        let own = benchmark.levels.is_empty() || study.file().record.is_plan();
        let plan = study.plan().filter(|_| !own);
        let channels = study.twin().signals().inputs.len();
        let inputs = plan.map(|plan| staircase(plan, channels, benchmark));
        let grid = match scenario {
            Scenario::Grid => grid(&study.twin().parameters())?,
            _ => vec![],
        };
        Ok(Self {
            study,
            scenario,
            grid,
            held,
            inputs: inputs.transpose()?,
            drives: study.drives()?,
        })
    }

    /// True parameters and drive of record `run` with this noise.
    pub(super) fn draw(
        &self,
        run: usize,
        noise: Noise,
    ) -> Result<(Vec<f64>, Drive), EvaluateError> {
        let space = self.study.twin().parameters();
        let drawn = match self.scenario {
            Scenario::Uniform => space.draw_bounds(noise),
            Scenario::Grid => self.grid[run % self.grid.len()].clone(),
            // What a study has beyond the paper's parameters is drawn from its prior.
            _ => space.draw_prior(noise),
        };
        let theta = (self.held.iter().zip(drawn))
            .map(|(held, drawn)| held.unwrap_or(drawn))
            .collect();
        let drive = match &self.inputs {
            Some(drive) => drive.clone(),
            None => self.drives.draw(noise)?,
        };
        Ok((theta, drive))
    }

    /// Record number `run` under `seed`. Where θ is drawn, a draw that diverges is drawn again.
    pub(super) fn simulated(
        &self,
        seed: u64,
        run: usize,
    ) -> Result<SimulatedRecord, EvaluateError> {
        let first = Noise::new(seed, "record", run as u64);
        let can_redraw = !self.scenario.is_point() && self.scenario != Scenario::Grid;
        let mut attempt = 0;
        loop {
            let noise = match attempt {
                0 => first,
                _ => first.child("again").sample(attempt),
            };
            attempt += 1;
            let (truth, drive) = self.draw(run, noise)?;
            match self.study.twin().simulate(&truth, &drive, noise) {
                Ok(outputs) => {
                    return Ok(SimulatedRecord {
                        truth,
                        record: Record::complete(drive, outputs)?,
                        noise,
                    });
                }
                Err(error) if error.costs_one_run() && can_redraw && attempt < ATTEMPTS => {}
                Err(error) => return Err(error.into()),
            }
        }
    }
}

/// Space-filling points of the prior, then of the bounds outside it.
fn grid(space: &ParameterSpace) -> Result<Vec<Vec<f64>>, EvaluateError> {
    let points = |of: &dyn Fn(&Parameter) -> Interval, count: usize| {
        let side = |end: fn(Interval) -> f64| {
            DVector::from_iterator(space.len(), space.iter().map(|p| end(of(p))))
        };
        let bounds = Bounds::new(side(Interval::low), side(Interval::high))?;
        let points = space_filling(&bounds, count, 0).into_iter();
        Ok::<_, EvaluateError>(points.map(|p| p.as_slice().to_vec()).collect::<Vec<_>>())
    };
    let mut all = points(&|p| p.prior, POINTS)?;
    let outside = points(&|p| p.bounds, LOOKED_AT)?;
    let is_outside =
        |theta: &Vec<f64>| (space.iter().zip(theta)).any(|(p, value)| !p.prior.contains(*value));
    all.extend(outside.into_iter().filter(is_outside).take(POINTS));
    Ok(all)
}

/// The benchmark's levels, over and over, as every input of the study's records.
fn staircase(
    plan: &RecordPlan,
    channels: usize,
    benchmark: &Benchmark,
) -> Result<Drive, RecordError> {
    let levels = Signal::from_shape_fn((plan.samples, channels), |(k, _)| {
        benchmark.levels[(k / benchmark.hold.max(1)) % benchmark.levels.len()]
    });
    Drive::new(plan.step, levels)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evaluate::paper::reference_studies;
    use crate::study::StudyFile;
    use crate::twins::CascadedTanks;
    use std::path::Path;

    fn tanks(file: &str) -> Study {
        let file = StudyFile::parse(file, Path::new("s.toml")).unwrap();
        (reference_studies().unwrap()[1].configure(&file)).unwrap()
    }

    fn draws(study: &Study, scenario: Scenario) -> Result<ScenarioDraws<'_>, EvaluateError> {
        ScenarioDraws::new(study, &Benchmark::of(study), scenario)
    }

    #[test]
    fn the_papers_points_and_input_are_the_same_for_every_record() {
        let study = tanks("twin = 'tanks'");
        let noise = |run| Noise::new(1, "record", run);
        let first = draws(&study, Scenario::First).unwrap();
        let (theta, drive) = first.draw(0, noise(0)).unwrap();
        assert_eq!(theta, [1.2, 1.2, 0.9, 1.0]);
        assert_eq!(drive.input(29), [1.81107]);
        assert_eq!(drive.input(30), [0.892673]);
        let second = draws(&study, Scenario::Second).unwrap();
        assert_eq!(
            second.draw(9, noise(9)).unwrap(),
            (vec![1.3, 1.3, 0.6, 0.7], drive)
        );
    }

    /// Beyond the prior and within the bounds in every parameter; both halves of the bounds are met.
    #[test]
    fn uniform_fills_the_bounds() {
        let study = tanks("twin = 'tanks'");
        let space = study.twin().parameters();
        let uniform = draws(&study, Scenario::Uniform).unwrap();
        let prior = draws(&study, Scenario::InDistribution).unwrap();
        let mut low = [0; 4];
        for run in 0..200 {
            let noise = Noise::new(1, "record", run);
            let (theta, _) = uniform.draw(0, noise).unwrap();
            space.check_point(&theta).unwrap();
            for (j, p) in space.iter().enumerate() {
                low[j] += u32::from(theta[j] < p.bounds.centre());
            }
            let (theta, _) = prior.draw(0, noise).unwrap();
            assert!(space.iter().zip(theta).all(|(p, v)| p.prior.contains(v)));
        }
        assert!(low.iter().all(|n| (65..=135).contains(n)), "{low:?}");
    }

    #[test]
    fn a_twin_of_ones_own_has_no_points_and_its_own_inputs() {
        let plan = RecordPlan::levels(0.5, 100, 0.0, 3.0, 30);
        let study = Study::new("mine", CascadedTanks, plan).unwrap();
        let error = draws(&study, Scenario::First).err().unwrap().to_string();
        assert!(
            error.contains("\"mine\"") && error.contains("the bounds"),
            "{error}"
        );
        let uniform = draws(&study, Scenario::Uniform).unwrap();
        let drive = |run| uniform.draw(0, Noise::new(1, "record", run)).unwrap().1;
        assert_ne!(drive(0), drive(1));
    }

    #[test]
    fn a_study_with_its_own_records_and_bounds_keeps_them() {
        let study = tanks("twin = 'tanks'\n[record]\nsamples = 60\n");
        let first = draws(&study, Scenario::First).unwrap();
        let (_, drive) = first.draw(0, Noise::new(1, "record", 0)).unwrap();
        assert!(drive.samples() == 60 && drive.input(0) != [1.81107]);
        let study = tanks("twin = 'tanks'\n[bounds]\nk1 = [0.3, 1.0]\n");
        let error = draws(&study, Scenario::First).err().unwrap().to_string();
        assert!(
            error.contains("k1 = 1.2") && error.contains("[0.3, 1]"),
            "{error}"
        );
        assert!(draws(&study, Scenario::Uniform).is_ok());
    }

    /// Half of the points lie in the prior, half outside, all in the bounds; record 12 is at the first point again.
    #[test]
    fn the_grid_has_points_on_both_sides() {
        let study = tanks("twin = 'tanks'");
        let space = study.twin().parameters();
        let grid = draws(&study, Scenario::Grid).unwrap();
        let theta = |run| {
            grid.draw(run, Noise::new(1, "record", run as u64))
                .unwrap()
                .0
        };
        let inside = |theta: &[f64]| space.iter().zip(theta).all(|(p, v)| p.prior.contains(*v));
        for run in 0..2 * POINTS {
            space.check_point(&theta(run)).unwrap();
            assert_eq!(inside(&theta(run)), run < POINTS);
        }
        assert_eq!(theta(0), theta(2 * POINTS));
    }
}
