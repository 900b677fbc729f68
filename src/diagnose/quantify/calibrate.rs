//! Calibration: evidence for a gap in records that the fitted twin itself has made.

use crate::hypothesis::search::model::Model;
use crate::progress::Stage;
use crate::record::Record;
use crate::study::StudyError;
use crate::twin::Noise;
use rayon::prelude::*;

/// Returns the evidence for a gap in each simulated record.
pub(in crate::diagnose) fn calibrate(
    model: &Model,
    count: usize,
    log_odds: impl Fn(&[Record]) -> Result<f64, StudyError> + Sync,
    noise: Noise,
    stage: &Stage,
) -> Result<Vec<f64>, StudyError> {
    let theta = &model.fitted.theta;
    let problem = &model.problem;
    let values: Vec<Option<f64>> = (0..count as u64)
        .into_par_iter()
        .map(|i| {
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
                Err(StudyError::NoStart) => None,
                Err(error) => return Err(error),
            };
            stage.tick()?;
            Ok(value)
        })
        .collect::<Result<_, StudyError>>()?;
    Ok(values.into_iter().flatten().collect())
}

/// p-value of measured evidence among simulated, and whether it is as small as so many simulations allow; `None` without any.
pub(in crate::diagnose) fn p_value(own: f64, simulated: &[f64]) -> Option<(f64, bool)> {
    let above = simulated.iter().filter(|v| **v >= own).count();
    let p = (above as f64 + 1.0) / (simulated.len() as f64 + 1.0);
    (!simulated.is_empty()).then_some((p, above == 0))
}
