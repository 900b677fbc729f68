//! Calibration: evidence for a gap in records that the fitted twin itself has made.

use crate::diagnose::settings::DiagnoseSettings;
use crate::hypothesis::search::model::Model;
use crate::parallel::try_each;
use crate::progress::Stage;
use crate::record::Record;
use crate::study::StudyError;
use crate::twin::Noise;
use std::sync::atomic::{AtomicBool, Ordering};

/// Returns the evidence for a gap in each simulated record, and whether the work was stopped before the last: those that were done are
/// given where the settings allow.
pub(in crate::diagnose) fn calibrate(
    model: &Model,
    settings: &DiagnoseSettings,
    log_odds: impl Fn(&[Record]) -> Result<f64, StudyError> + Sync,
    noise: Noise,
    stage: &Stage,
) -> Result<(Vec<f64>, bool), StudyError> {
    let is_cut = AtomicBool::new(false);
    let theta = &model.fitted.theta;
    let problem = &model.problem;
    let values = try_each(0..settings.calibrate as u64, |i| {
        if is_cut.load(Ordering::Relaxed) {
            return Ok(None);
        }
        let mut records = vec![];
        for (r, record) in problem.records.iter().enumerate() {
            let noise = noise
                .child("record")
                .sample(i * problem.records.len() as u64 + r as u64);
            let outputs =
                match problem
                    .twin
                    .simulate(&problem.of_record(r, theta), record.drive(), noise)
                {
                    Ok(outputs) => outputs,
                    Err(error) if error.costs_one_run() => return Ok(None),
                    Err(error) => return Err(error.into()),
                };
            records.push(Record::new(
                record.drive().clone(),
                record.with_gaps_in(outputs),
            )?);
        }
        let value = match log_odds(&records) {
            Ok(value) => Some(value),
            Err(StudyError::NoFit { .. }) => None,
            Err(StudyError::Cancelled(_)) if settings.give_partial => {
                is_cut.store(true, Ordering::Relaxed);
                return Ok(None);
            }
            Err(error) => return Err(error),
        };
        if settings.ends(stage.tick())? {
            is_cut.store(true, Ordering::Relaxed);
        }
        Ok::<_, StudyError>(value)
    })?;
    Ok((values.into_iter().flatten().collect(), is_cut.into_inner()))
}

/// p-value of measured evidence among simulated, and whether it is as small as so many simulations allow; `None` without any.
pub(in crate::diagnose) fn p_value(own: f64, simulated: &[f64]) -> Option<(f64, bool)> {
    let above = simulated.iter().filter(|v| **v >= own).count();
    let p = (above as f64 + 1.0) / (simulated.len() as f64 + 1.0);
    (!simulated.is_empty()).then_some((p, above == 0))
}
