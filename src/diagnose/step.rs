//! The step of a twin's own integrator as a rival of every gap: what a finer step explains, the system does not lack.

use super::error::DiagnoseError;
use super::model::Model;
use super::thresholds::Thresholds;
use crate::fit::reference::Reference;
use crate::likelihood::kalman::recoverable;
use crate::twin::{Integrator, MOST_SUBSTEPS, Twin};
use nalgebra::DVector;

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

/// The cheapest finer step from which an exact one cannot be told, beside a model that explains so many nats; `None` where its twin's own
/// step cannot be told from an exact one, or by no more than integrators differ anyway, and for a black box.
pub(in crate::diagnose) fn finer_step(
    model: &Model<'_>,
    explained: f64,
) -> Result<Option<FinerStep>, DiagnoseError> {
    let Some((integrator, stepping)) = model.base.integration() else {
        return Ok(None);
    };
    let theta = &model.fitted.theta;
    let Some(reference) = recoverable(Reference::new(&model.problem, theta))?.flatten() else {
        return Ok(None);
    };
    let direction = |step: FinerStep| -> Result<_, DiagnoseError> {
        let Some(twin) = step.of(model.base) else {
            return Ok(None);
        };
        let filtered = recoverable(model.problem_of(&twin)?.filtered(theta))?;
        Ok(filtered.map(|filtered| reference.direction(&filtered)))
    };
    let least = Thresholds::STEP_SHOWS.max(Thresholds::FINE_PRINT * explained);
    let shows = |direction: &DVector<f64>| 0.5 * reference.own(direction) > least;
    let candidates = FinerStep::candidates(integrator, stepping.substeps);
    let Some((&last, cheaper)) = candidates.split_last() else {
        return Ok(None);
    };
    let Some(exact) = direction(last)?.filter(shows) else {
        return Ok(None);
    };
    for &step in cheaper {
        let there = direction(step)?;
        if there.is_some_and(|there| !shows(&(&exact - there))) {
            return Ok(Some(step));
        }
    }
    Ok(Some(last))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::fixture::{self, tanks};
    use crate::diagnose::{DiagnoseSettings, Verdict, diagnose};
    use crate::progress::Progress;
    use crate::record::Record;
    use crate::study::Study;

    fn record(twin: &Twin, study: &Study, seed: u64) -> [Record; 1] {
        let theta = twin.parameters().centre();
        [fixture::record(study, twin, &theta, seed)]
    }

    /// Records that were made with a finer step are told with one, and nothing is missing; the twin's own records keep its own.
    #[test]
    fn a_step_that_shows_is_no_gap_and_an_own_one_stays() {
        let study = tanks(300);
        let exact = study.twin().stepped(|_, to| to.substeps = 64).unwrap();
        let settings = DiagnoseSettings {
            detection_only: true,
            ..DiagnoseSettings::default()
        };
        for (twin, is_finer) in [(&exact, true), (study.twin(), false)] {
            for seed in 0..2 {
                let records = record(twin, &study, seed);
                let found =
                    diagnose(&study, &records, None, &settings, &Progress::silent()).unwrap();
                assert_ne!(found.verdict, Verdict::StructuralGap, "seed {seed}");
                assert_eq!(found.substeps.is_some(), is_finer, "seed {seed}");
            }
        }
    }
}
