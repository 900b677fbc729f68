//! The step of a twin's own integrator as a rival of every gap: what a finer step explains, the system does not lack.

use super::error::DiagnoseError;
use super::model::Model;
use super::thresholds::Thresholds;
use crate::fit::reference::Reference;
use crate::likelihood::kalman::recoverable;
use crate::twin::{Integrator, MOST_SUBSTEPS, Twin};

/// A finer step than a twin's own.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::diagnose) struct FinerStep {
    pub integrator: Integrator,
    pub substeps: usize,
}

impl FinerStep {
    /// Finer steps from the cheapest to the last, which stands for an exact one. A Runge–Kutta step takes four rates, and is given the time
    /// of four of Euler's; limits of states act once a substep, so that only more of them help a state that runs into its limits.
    fn candidates(integrator: Integrator, own: usize) -> Vec<Self> {
        use Integrator::{Euler, RungeKutta4};
        let all = match integrator {
            Euler => vec![
                (RungeKutta4, own.div_ceil(4)),
                (Euler, 4 * own),
                (Euler, 16 * own),
                (RungeKutta4, 16 * own),
            ],
            rule => vec![(rule, 2 * own), (rule, 4 * own), (rule, 16 * own)],
        };
        (all.into_iter())
            .map(|(integrator, substeps)| Self {
                integrator,
                substeps: substeps.min(MOST_SUBSTEPS),
            })
            .collect()
    }

    /// The twin with this step; `None` for a black box.
    pub fn of(self, twin: &Twin) -> Option<Twin> {
        twin.stepped(|integrator, stepping| {
            *integrator = self.integrator;
            stepping.substeps = self.substeps;
        })
    }
}

/// The cheapest step that explains a model's records as well as the best, where that is better than its twin's own, and how much better,
/// in nats; `None` where the step does not show, or shows for the better, and for a black box.
pub(in crate::diagnose) fn finer_step(
    model: &Model<'_>,
) -> Result<Option<(FinerStep, f64)>, DiagnoseError> {
    let Some((integrator, stepping)) = model.base.integration() else {
        return Ok(None);
    };
    let theta = &model.fitted.theta;
    let Some(reference) = recoverable(Reference::new(&model.problem, theta))?.flatten() else {
        return Ok(None);
    };
    let mut finer = vec![];
    for step in FinerStep::candidates(integrator, stepping.substeps) {
        let Some(twin) = step.of(model.base) else {
            return Ok(None);
        };
        finer.push((model.problem_of(&twin)?, step));
    }
    let Some((exact, _)) = finer.last() else {
        return Ok(None);
    };
    let Some(filtered) = recoverable(exact.filtered(theta))? else {
        return Ok(None);
    };
    if 0.5 * reference.own(&reference.direction(&filtered)) <= Thresholds::STEP_SHOWS {
        return Ok(None);
    }
    // A search stops before the end of a climb: with its own step, too, the model is carried on.
    let mut last = model.carried_on()?.unwrap_or_else(|| model.clone());
    let own = last.log_evidence.max(model.log_evidence);
    let mut fitted = vec![];
    for (problem, step) in finer {
        let begin = Model {
            problem,
            ..last.clone()
        };
        if let Some(model) = begin.carried_on()? {
            fitted.push((step, model.log_evidence - own));
            last = model;
        }
    }
    let best = (fitted.iter()).fold(f64::NEG_INFINITY, |best, (_, gain)| best.max(*gain));
    let enough = (best - Thresholds::STEP_SHOWS).max(Thresholds::STEP_WINS);
    Ok((fitted.into_iter()).find(|(_, gain)| *gain > enough))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::base::Base;
    use crate::diagnose::fixture::{self, tanks};
    use crate::diagnose::{DiagnoseSettings, Verdict, diagnose};
    use crate::likelihood::measured;
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
            let measured = measured(study.twin(), records, &study.beliefs()).unwrap();
            let base = Base::new(&measured, records, &settings).unwrap();
            finer_step(&base.model).unwrap()
        };
        for seed in 0..3 {
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
