//! Calibration: how much evidence for a gap do records show that the fitted twin itself has made?

use crate::hypothesis::model::Model;
use crate::progress::Stage;
use crate::record::Record;
use crate::study::StudyError;
use crate::twin::Noise;
use rayon::prelude::*;

/// Evidence of simulated records, and the p-value of the measured ones: (p, at its floor).
pub(in crate::diagnose) fn calibrate(
    model: &Model,
    count: usize,
    own: f64,
    log_odds: impl Fn(&[Record]) -> Result<f64, StudyError> + Sync,
    noise: Noise,
    stage: &Stage,
) -> Result<Option<(f64, bool)>, StudyError> {
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
    let all: Vec<f64> = values.into_iter().flatten().collect();
    if all.is_empty() {
        return Ok(None);
    }
    let above = all.iter().filter(|v| **v >= own).count();
    let n = all.len() as f64;
    Ok(Some(((above as f64 + 1.0) / (n + 1.0), above == 0)))
}
