//! Expected information of a departure: how much the best possible diagnoser could learn of it.
//!
//! With innovations e of the twin's own filter at the true θ and the true noise levels, and S = C·Cᵀ their covariance,
//!
//! ```text
//! d = C⁻¹·(e of the record with the departure − e of the same record without)
//! d⊥ = d less what a change of θ or of the noise levels does to C⁻¹e
//! information = ½·‖d⊥‖²   in nats
//! ```
//!
//! That is a linear measure. Noise levels and a distant θ may take more of a departure, so what the best fit of the twin loses bounds it:
//!
//! ```text
//! lost = mean of max ll(record without) − max ll(record with)      ll: log-likelihood of the twin, maximised over θ and noise levels
//! ```
//!
//! over a record and the same with all noise of the other sign, so that no product of noise and departure counts.
//!
//! The two records of a pair share all noise. Two pairs with the same process noise and different measurement noise are made, and the square is
//! taken across them: what only the noise decides, as the rounding of a sensor, then counts for nothing.

use super::world::System;
use crate::evaluate::trials::numbers::TRIAL;
use crate::fit::axis::Axis;
use crate::fit::climb::fit;
use crate::fit::problem::Problem;
use crate::fit::reference::{Reference, weak};
use crate::likelihood::kalman::{FilterError, recoverable};
use crate::likelihood::measured;
use crate::record::Record;
use crate::study::Study;
use crate::twin::{MOST_SUBSTEPS, Role, Twin};
use nalgebra::DVector;

/// Whitened change of the innovations of two records.
pub(super) struct InnovationChange([DVector<f64>; 2]);

impl InnovationChange {
    /// Returns the part of this change that another one does not make.
    pub fn without(&self, other: &Self) -> Self {
        Self([0, 1].map(|i| &self.0[i] - &other.0[i]))
    }
}

/// Match of one change by a multiple of another.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Match {
    pub multiple: f64,
    /// Share of the information that is left.
    pub unexplained: f64,
}

/// Filter at the truth of one record without departures.
pub(super) struct Information {
    problem: Problem,
    theta: Vec<f64>,
    first: Reference,
    again: Reference,
    /// Log-likelihood of the best fit without departures, mean over both signs of the noise; 0 where nothing is fitted.
    alone: f64,
    /// True where each likelihood costs an ensemble, that of a black box with noise of its own: nothing is fitted, and no effect compared.
    pub costs_ensembles: bool,
}

/// θ and noise levels as they are in a world.
fn truth(twin: &Twin, system: System<'_>, declared: &[(String, f64)]) -> Vec<f64> {
    let outputs = twin.signals().outputs;
    let (space, conditions) = (twin.parameters(), system.conditions);
    (space.iter().enumerate())
        .map(|(j, p)| match system.theta.get(j) {
            Some(value) => *value,
            None if p.role == Role::Noise => {
                let level = (declared.iter()).find(|(name, _)| *name == p.name);
                let level = level.map_or(0.0, |(_, level)| *level);
                let output = outputs.iter().position(|o| o.name == p.target());
                let level = match output {
                    Some(j) => conditions.measurement * level.hypot(conditions.added_to(j)),
                    None => conditions.process * level,
                };
                p.bounds.clamp(level)
            }
            None => p.prior.centre(),
        })
        .collect()
}

/// The problem of a twin on these records, and the truth in it.
pub(super) fn problem(
    twin: &Twin,
    study: &Study,
    system: System<'_>,
    records: &[Record],
) -> Result<(Problem, Vec<f64>), FilterError> {
    let measured = measured(twin, records, &study.beliefs())?;
    let (twin, levels) = (measured.twin, measured.levels);
    let declared: Vec<(String, f64)> = (levels.iter())
        .map(|level| (level.parameter.name.clone(), level.declared.unwrap_or(0.0)))
        .collect();
    let truth = truth(&twin, system, &declared);
    if levels.is_empty() {
        return Ok((Problem::of_twin(&twin, records), truth));
    }
    let space = twin.parameters();
    let own = space.len() - levels.len();
    let axes = (space.iter().take(own).map(Axis::of))
        .chain(levels.iter().map(Axis::of_level))
        .collect();
    Ok((Problem::new(twin, axes, records), truth))
}

impl Information {
    /// Filters two records without departures, one each, that share their process noise, and fits the first one and the same with all
    /// noise of the other sign; `None` where the filter fails.
    pub fn new(
        study: &Study,
        system: System<'_>,
        [record, again, mirrored]: &[Record; 3],
    ) -> Result<Option<Self>, FilterError> {
        let records = std::slice::from_ref(record);
        let (problem, theta) = problem(study.twin(), study, system, records)?;
        let known = weak(&problem) * TRIAL.known_share;
        let Some(first) = Reference::knowing(&problem, &theta, &known)? else {
            return Ok(None);
        };
        let Some(again) = recoverable(problem.on([again.clone()]).filtered(&theta))? else {
            return Ok(None);
        };
        let costs_ensembles =
            problem.is_simulated() && (problem.twin.known_noise(&theta, record.drive())?).is_none();
        let mut information = Self {
            again: Reference::bare(again),
            alone: 0.0,
            costs_ensembles,
            first,
            problem,
            theta,
        };
        if !information.costs_ensembles {
            let Some(alone) = information.best([record, mirrored])? else {
                return Ok(None);
            };
            information.alone = alone;
        }
        Ok(Some(information))
    }

    /// Log-likelihood of the best fit of the twin to each of these records, their mean; `None` where the filter fails.
    fn best(&self, records: [&Record; 2]) -> Result<Option<f64>, FilterError> {
        let mut sum = 0.0;
        for record in records {
            let problem = self.problem.on(std::slice::from_ref(record));
            // Loud noise leads to a distant θ that answers a departure: quiet noise has narrow valleys.
            let starts = [self.theta.clone(), problem.begin(&self.theta)];
            let Some(fitted) = fit(&problem, &starts, TRIAL.truth_iterations)? else {
                return Ok(None);
            };
            sum += fitted.log_likelihood;
        }
        Ok(Some(0.5 * sum))
    }

    /// Nats that the best fit loses by departures, from a record with them and the same with all noise of the other sign; `None` where
    /// the filter fails. What a black box with noise of its own loses is not known: each of its fits costs ensembles.
    pub fn lost(&self, records: [&Record; 2]) -> Result<Option<f64>, FilterError> {
        if self.costs_ensembles {
            return Ok(Some(f64::INFINITY));
        }
        let best = self.best(records)?;
        Ok(best.map(|best| (self.alone - best).max(0.0)))
    }

    /// The change that departures make in the innovations, from the records with them; `None` where the filter fails.
    pub fn change(
        &self,
        [record, again]: [Record; 2],
    ) -> Result<Option<InnovationChange>, FilterError> {
        let filtered =
            |record: Record| recoverable(self.problem.on([record]).filtered(&self.theta));
        let (Some(record), Some(again)) = (filtered(record)?, filtered(again)?) else {
            return Ok(None);
        };
        Ok(Some(InnovationChange([
            self.first.direction(&record),
            self.again.direction(&again),
        ])))
    }

    /// Expected information of a change, in nats.
    pub fn nats(&self, change: &InnovationChange) -> f64 {
        0.5 * self.product(&change.0[0], &change.0[1]).max(0.0)
    }

    /// Share of a change's information that no multiple of another one explains.
    pub fn unexplained(&self, change: &InnovationChange, by: &InnovationChange) -> f64 {
        self.matched(change, by).unexplained
    }

    /// Returns the best multiple of one change in place of another, and what that leaves.
    pub fn matched(&self, change: &InnovationChange, by: &InnovationChange) -> Match {
        let own = |a: &InnovationChange| self.product(&a.0[0], &a.0[1]).max(0.0);
        let (a, b) = (own(change), own(by));
        let both =
            0.5 * (self.product(&change.0[0], &by.0[1]) + self.product(&change.0[1], &by.0[0]));
        let (multiple, unexplained) = match a == 0.0 || b == 0.0 {
            true => (0.0, 1.0),
            false => (both / b, (1.0 - both * both / (a * b)).max(0.0)),
        };
        Match {
            multiple,
            unexplained,
        }
    }

    /// Nats of the difference of two changes: what one in place of the other leaves.
    pub fn left(&self, change: &InnovationChange, by: &InnovationChange) -> f64 {
        self.nats(&change.without(by))
    }

    /// Product of two directions without what θ and noise levels imitate.
    fn product(&self, a: &DVector<f64>, b: &DVector<f64>) -> f64 {
        0.25 * (self.first.own(&(a + b)) - self.first.own(&(a - b)))
    }

    /// Nats by which the twin's own step shows: as a departure, against twenty times as many substeps. 0 for a black box.
    pub fn step(&self, study: &Study, system: System<'_>) -> Result<f64, FilterError> {
        let fine = (study.twin())
            .stepped(|_, to| to.substeps = (TRIAL.exact_substeps * to.substeps).min(MOST_SUBSTEPS));
        let Some(fine) = fine else {
            return Ok(0.0);
        };
        let (problem, theta) = problem(&fine, study, system, &self.problem.records)?;
        let filtered = recoverable(problem.filtered(&theta))?;
        Ok(filtered.map_or(0.0, |there| {
            let direction = self.first.direction(&there);
            0.5 * self.first.own(&direction)
        }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evaluate::trials::world::Conditions;
    use crate::record::{Drive, Signal};
    use crate::study::RecordPlan;
    use crate::twin::{Noise, Parameter, ParameterSpace, SimulationError};
    use std::sync::atomic::{AtomicU64, Ordering};

    /// Runs of the simulator so far.
    static RUNS: AtomicU64 = AtomicU64::new(0);

    /// y = gain·u + noise, with runs counted.
    struct Counted;
    impl crate::twin::DigitalTwin for Counted {
        fn parameters(&self) -> ParameterSpace {
            ParameterSpace::new([Parameter::new("gain", "1", 0.5, 1.5).within(0.2, 3.0)])
        }
        fn simulate(
            &self,
            theta: &[f64],
            drive: &Drive,
            noise: Noise,
        ) -> Result<Signal, SimulationError> {
            RUNS.fetch_add(1, Ordering::Relaxed);
            let mut source = noise.source("v");
            Ok((drive.inputs()).mapv(|u| theta[0] * u + 0.05 * source.normal()))
        }
    }

    /// No record of a black box with noise is fitted for its information: each fit costs ensembles.
    #[test]
    fn a_noisy_black_box_is_filtered_and_not_fitted() {
        let plan = RecordPlan::levels(0.1, 60, 0.0, 1.0, 5);
        let study = Study::new("counted", Counted, plan).unwrap();
        let drive = study.drives().unwrap().draw(Noise::new(1, "b", 0)).unwrap();
        let mut conditions = Conditions::declared();
        conditions.added = vec![0.05];
        let record = |seed| {
            let mut source = Noise::new(seed, "b", 0).source("v");
            let outputs = drive.inputs().mapv(|u| u + 0.05 * source.normal());
            Record::new(drive.clone(), outputs).unwrap()
        };
        let records = [1, 2, 3].map(record);
        let system = System::new(&[1.0], &conditions);
        let information = Information::new(&study, system, &records);
        let information = information.unwrap().unwrap();
        RUNS.store(0, Ordering::Relaxed);
        let [a, _, c] = &records;
        assert_eq!(information.lost([a, c]).unwrap(), Some(f64::INFINITY));
        assert_eq!(RUNS.load(Ordering::Relaxed), 0);
        information.best([a, c]).unwrap();
        assert!(RUNS.load(Ordering::Relaxed) > 0);
        assert_eq!(information.alone, 0.0);
    }
}
