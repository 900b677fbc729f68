//! The step of a twin's own integrator as a rival of every gap: what a finer step explains, the system does not lack.

use super::error::DiagnoseError;
use super::model::Model;
use super::thresholds::Thresholds;
use crate::fit::climb::climb;
use crate::fit::problem::Problem;
use crate::fit::reference::Reference;
use crate::likelihood::kalman::recoverable;

/// Finer steps that are tried, as parts of the twin's own. The second stands for an exact one: it leaves 1/256 of the nats of Euler's rule.
const PARTS: [usize; 2] = [4, 16];
/// Iterations of a fit with the finer step.
const ITERATIONS: usize = 40;

/// Substeps of a sample with which a model explains its records better than with those of its twin; `None` where the step does not show,
/// or shows for the better, and for a black box.
pub(in crate::diagnose) fn finer_step(model: &Model<'_>) -> Result<Option<usize>, DiagnoseError> {
    let [near, exact] = PARTS.map(|parts| model.stepped(parts));
    let (Some(near), Some(exact)) = (near?, exact?) else {
        return Ok(None);
    };
    let theta = &model.fitted.theta;
    let Some(reference) = recoverable(Reference::new(&model.problem, theta))?.flatten() else {
        return Ok(None);
    };
    let change = |problem: &Problem<'_>| -> Result<_, DiagnoseError> {
        let filtered = recoverable(problem.filtered(theta))?;
        Ok(filtered.map(|filtered| reference.direction(&filtered)))
    };
    let (Some(by_near), Some(by_exact)) = (change(&near.1)?, change(&exact.1)?) else {
        return Ok(None);
    };
    let shows = |change: &_| 0.5 * reference.own(change) > Thresholds::STEP_SHOWS;
    if !shows(&by_exact) {
        return Ok(None);
    }
    let (substeps, problem) = match shows(&(by_near - &by_exact)) {
        true => exact,
        false => near,
    };
    let finer = climb(&problem, theta, ITERATIONS)?.and_then(|fitted| {
        let model = Model {
            problem,
            ..model.clone()
        };
        model.refitted(fitted)
    });
    let least = model.log_evidence + Thresholds::STEP_WINS;
    Ok(finer
        .filter(|finer| finer.log_evidence > least)
        .map(|_| substeps))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::base::Base;
    use crate::diagnose::{DiagnoseSettings, Verdict, diagnose};
    use crate::likelihood::measured;
    use crate::progress::Progress;
    use crate::record::Record;
    use crate::study::{RecordPlan, Study};
    use crate::twin::{Noise, Twin};
    use crate::twins::CascadedTanks;

    fn record(twin: &Twin, study: &Study, seed: u64) -> [Record; 1] {
        let drives = study.drives().unwrap();
        let drive = drives.draw(Noise::new(seed, "drive", 0)).unwrap();
        let theta = twin.parameters().centre();
        let outputs = twin.simulate(&theta, &drive, Noise::new(seed, "record", 0));
        [Record::new(drive, outputs.unwrap()).unwrap()]
    }

    /// A finer step is asked for where the records were made with one, and then nothing is missing; the twin's own records keep its own.
    #[test]
    fn a_step_that_shows_is_no_gap_and_an_own_one_stays() {
        let plan = RecordPlan::levels(4.0, 400, 0.5, 3.0, 20);
        let study = Study::new("tanks", CascadedTanks, plan).unwrap();
        let exact = study.twin().stepped(|to| to.substeps = 64).unwrap();
        let settings = DiagnoseSettings::default();
        let asked = |records: &[Record]| {
            let measured = measured(study.twin(), records, &study.beliefs()).unwrap();
            let noise = Noise::new(0, "step", 0);
            let base = Base::new(&measured, records, &settings, noise).unwrap();
            finer_step(&base.model).unwrap()
        };
        for seed in 0..4 {
            assert!(
                asked(&record(&exact, &study, seed)).is_some(),
                "seed {seed}"
            );
            assert_eq!(
                asked(&record(study.twin(), &study, seed)),
                None,
                "seed {seed}"
            );
        }
        let records = record(&exact, &study, 0);
        let found = diagnose(&study, &records, None, &settings, &Progress::silent()).unwrap();
        assert_ne!(found.verdict, Verdict::StructuralGap);
        assert!(found.substeps.is_some());
    }
}
