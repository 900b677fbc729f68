//! The step of a twin's own integrator, and its inputs between samples, as rivals of every gap: what a finer step or another rule for inputs
//! explains, the system does not lack.

use super::thresholds::THRESHOLDS;
use crate::fit::other_hold;
use crate::fit::problem::Problem;
use crate::hypothesis::search::model::Model;
use crate::likelihood::kalman::recoverable;
use crate::study::StudyError;
use crate::twin::{Integrator, MOST_SUBSTEPS, Stepping, Twin};
use nalgebra::DVector;

/// A finer step than a twin's own, or another rule for inputs between samples.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::diagnose) struct OtherStep {
    pub integrator: Integrator,
    pub stepping: Stepping,
}

impl OtherStep {
    /// Finer steps from the cheapest to the last, which stands for an exact one. A Runge–Kutta step takes four rates, and is given the time
    /// of four of Euler's; limits of states act once a substep, so that only more of them help a state that runs into its limits.
    fn candidates(integrator: Integrator, stepping: Stepping) -> Vec<Self> {
        use Integrator::{Adaptive, Discrete, Euler, RungeKutta4, Stiff};
        let own = stepping.substeps;
        let all = match integrator {
            Euler => vec![
                (RungeKutta4, own.div_ceil(4)),
                (Euler, 4 * own),
                (Euler, 16 * own),
                (RungeKutta4, own.max(16)),
            ],
            // Steps to a tolerance are as fine as they need be.
            Discrete | Adaptive | Stiff => vec![],
            rule => vec![(rule, 2 * own), (rule, 4 * own), (rule, 16 * own)],
        };
        (all.into_iter())
            .map(|(integrator, substeps)| Self {
                integrator,
                stepping: Stepping {
                    substeps: substeps.min(MOST_SUBSTEPS),
                    ..stepping
                },
            })
            .collect()
    }

    /// The twin with this step; `None` for a black box.
    pub fn of(self, twin: &Twin) -> Option<Twin> {
        twin.stepped(|integrator, stepping| {
            (*integrator, *stepping) = (self.integrator, self.stepping);
        })
    }
}

/// The cheapest finer step from which an exact one cannot be told, where it explains a model's records better than its twin's own, and how
/// much better, in nats; `None` where the step does not show, or shows for the better, and for a black box.
///
/// First it is asked, where the study leaves it open, whether another rule for inputs between samples explains the records better; that is
/// then a part of the step.
///
/// A step shows from `least` nats on. Which finer one, the innovations say, not evidence: an error of a coarser one may imitate what is
/// missing. Beside a model that explains so many nats, an error below a law's fine print is none.
pub(in crate::diagnose) fn other_step(
    model: &Model,
    (least, explained): (f64, f64),
    asks_hold: bool,
) -> Result<Option<(OtherStep, f64)>, StudyError> {
    let Some((integrator, stepping)) = model.base.integration() else {
        return Ok(None);
    };
    if asks_hold && let Some(other) = other_hold(&model.problem, &model.fitted)? {
        let stepping = other.stepping;
        let held = OtherStep {
            integrator,
            stepping,
        };
        let (base, problem) = (held.of(&model.base), model.problem.stepped(stepping));
        let (Some(base), Some(problem)) = (base, problem) else {
            return Ok(None);
        };
        let held_model = Model {
            base,
            problem,
            ..model.clone()
        };
        let finer = held_model.carried_on()?.unwrap_or(held_model);
        let finer = other_step(&finer, (least, explained), false)?;
        return Ok(Some(match finer {
            Some((step, more)) => (step, other.gain + more),
            None => (held, other.gain),
        }));
    }
    let theta = &model.fitted.theta;
    let Some(reference) = model.reference()? else {
        return Ok(None);
    };
    let problem = |step: OtherStep| -> Result<Option<Problem>, StudyError> {
        let twin = step.of(&model.base);
        Ok(twin.map(|twin| model.problem_of(&twin)).transpose()?)
    };
    let direction = |step: OtherStep| -> Result<Option<DVector<f64>>, StudyError> {
        let Some(problem) = problem(step)? else {
            return Ok(None);
        };
        let filtered = recoverable(problem.filtered(theta))?;
        Ok(filtered.map(|filtered| reference.direction(&filtered)))
    };
    let nats = |direction: &DVector<f64>| 0.5 * reference.own(direction);
    let near = THRESHOLDS.step_shows.max(THRESHOLDS.fine_print * explained);
    let candidates = OtherStep::candidates(integrator, stepping);
    let Some((&last, cheaper)) = candidates.split_last() else {
        return Ok(None);
    };
    let Some(exact) = direction(last)?.filter(|exact| nats(exact) > least) else {
        return Ok(None);
    };
    let mut chosen = last;
    for &step in cheaper {
        let there = direction(step)?;
        if there.is_some_and(|there| nats(&(&exact - there)) <= near) {
            chosen = step;
            break;
        }
    }
    // A search stops before the end of a climb: with its own step, too, the model is carried on.
    let own = model.carried_on()?.unwrap_or_else(|| model.clone());
    let Some(problem) = problem(chosen)? else {
        return Ok(None);
    };
    let finer = Model {
        problem,
        ..own.clone()
    };
    let Some(carried) = finer.carried_on()? else {
        return Ok(None);
    };
    let gain = carried.log_evidence - own.log_evidence.max(model.log_evidence);
    if gain <= THRESHOLDS.step_wins {
        return Ok(None);
    }
    // With less noise than the own step needs, an error of the finer one may show as well.
    let twin = chosen.of(&model.base);
    let further = match twin {
        Some(base) => other_step(&Model { base, ..carried }, (least, explained), false)?,
        None => None,
    };
    Ok(Some(match further {
        Some((step, more)) => (step, gain + more),
        None => (chosen, gain),
    }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::base::Base;
    use crate::diagnose::fixture::{self, tanks};
    use crate::diagnose::{DiagnoseSettings, Verdict, diagnose};
    use crate::fit::Passes;
    use crate::progress::Progress;
    use crate::record::Record;
    use crate::study::Study;

    fn record(twin: &Twin, study: &Study, seed: u64) -> [Record; 1] {
        let theta = twin.parameters().centre();
        [fixture::record(study, twin, &theta, seed)]
    }

    /// A finer step is asked for where the records were made with one, and then nothing is missing; the twin's own records keep its own.
    #[test]
    fn a_step_that_shows_is_no_gap_and_an_own_one_stays() {
        let study = tanks(300);
        let exact = study.twin().stepped(|_, to| to.substeps = 64).unwrap();
        let settings = DiagnoseSettings::default();
        let asked = |records: &[Record]| {
            let passes = Passes::default();
            let base = Base::new(&study, study.twin(), records.into(), &settings, &passes);
            let base = base.unwrap();
            other_step(&base.model, (THRESHOLDS.step_shows, 0.0), true).unwrap()
        };
        for seed in 0..2 {
            assert!(
                asked(&record(&exact, &study, seed)).is_some(),
                "seed {seed}"
            );
            assert!(
                asked(&record(study.twin(), &study, seed)).is_none(),
                "seed {seed}"
            );
        }
        let records = record(&exact, &study, 0);
        let verdict = DiagnoseSettings {
            detection_only: true,
            ..settings
        };
        let found = diagnose(&study, &records, None, &verdict, &Progress::silent()).unwrap();
        assert_ne!(found.verdict, Verdict::StructuralGap);
        assert!(found.substeps.is_some());
    }
}
