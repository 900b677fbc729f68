//! Since when a record is not what the twin makes: the first block that the twin, fitted to all before it, does not foresee.
//!
//! θ refitted to the whole record is a compromise between before and after, and fails at both. Fitted to the samples before a
//! block, it fails only where something has changed, or where the record comes to states it has not been at. How
//! badly a right twin foresees its blocks, simulations say; p-values are corrected for all blocks.
//!
//! Source: Dawid, "Statistical theory: the prequential approach" (1984).

use crate::diagnose::error::DiagnoseError;
use crate::diagnose::outcome::Onset;
use crate::diagnose::residuals::local::level;
use crate::diagnose::test::fitted_twin::FittedTwin;
use crate::diagnose::test::null::{largest, standardised};
use crate::diagnose::thresholds::Thresholds;
use crate::fit::climb::climb;
use crate::fit::first_part::first_part;
use crate::fit::problem::Problem;
use crate::likelihood::kalman::{FilterError, recoverable};
use crate::math::rank_p_value;
use crate::record::Record;
use crate::twin::Noise;
use rayon::prelude::*;

/// Iterations of a fit that starts where that of a block before ended.
const WARM: usize = 2;

/// Returns the onset of the first record that has one.
pub(in crate::diagnose) fn onset(
    model: &FittedTwin<'_>,
    alpha: f64,
    noise: Noise,
) -> Result<Option<Onset>, DiagnoseError> {
    // Each block would take ensembles of a black box.
    if model.problem.is_simulated() {
        return Ok(None);
    }
    let replicates = (1.0 / alpha + Thresholds::ONSET_BEYOND) as u64;
    let signals = model.problem.twin.signals();
    for (r, record) in model.problem.records.iter().enumerate() {
        let theta = model.problem.of_record(r, &model.fitted.theta);
        let Some(own) = foresight(&model.problem, &theta, record)? else {
            continue;
        };
        let others: Vec<Option<Vec<f64>>> = (0..replicates)
            .into_par_iter()
            .map(|i| {
                let noise = noise
                    .child("onset")
                    .child("record")
                    .sample(i + replicates * r as u64);
                let drive = record.drive();
                let outputs = match model.problem.twin.simulate(&theta, drive, noise) {
                    Ok(outputs) => outputs,
                    Err(error) if error.costs_one_run() => return Ok(None),
                    Err(error) => return Err(error.into()),
                };
                let replicate = Record::new(drive.clone(), record.with_gaps_in(outputs))?;
                foresight(&model.problem, &theta, &replicate)
            })
            .collect::<Result<_, DiagnoseError>>()?;
        let failed = others.iter().filter(|o| o.is_none()).count();
        let rows: Vec<&Vec<f64>> = [&own].into_iter().chain(others.iter().flatten()).collect();
        let z = standardised(&rows);
        let mut null = largest(&z)[1..].to_vec();
        null.extend(std::iter::repeat_n(f64::NAN, failed));
        let channels = signals.outputs.len();
        let first = (z[0].iter().enumerate())
            .map(|(i, z)| (i, rank_p_value(&null, *z)))
            .find(|(_, p)| *p <= alpha);
        if let Some((i, p_value)) = first {
            let block = Thresholds::ONSET_LEARNT + i / channels;
            return Ok(Some(Onset {
                record: r,
                time: record
                    .drive()
                    .time(block * record.samples() / Thresholds::ONSET_BLOCKS),
                channel: signals.outputs[i % channels].name.clone(),
                p_value,
            }));
        }
    }
    Ok(None)
}

/// Returns for each block but the first few and each output √(n·mean² + n/2·(mean square − 1)²) of its innovations at the θ of all
/// samples before; `None` for short records, for those whose start has an output without any value, and where a filter does not work.
fn foresight(
    problem: &Problem<'_>,
    theta: &[f64],
    record: &Record,
) -> Result<Option<Vec<f64>>, DiagnoseError> {
    let samples = record.samples();
    if samples < Thresholds::ONSET_SAMPLES * Thresholds::ONSET_BLOCKS {
        return Ok(None);
    }
    let end = |block: usize| block * samples / Thresholds::ONSET_BLOCKS;
    let mut theta = theta.to_vec();
    let mut all = vec![];
    for block in Thresholds::ONSET_LEARNT..Thresholds::ONSET_BLOCKS {
        let Some(before) = first_part(record, end(block)).map(|part| [part]) else {
            return Ok(None);
        };
        let learnt = problem.on(&before);
        let Some(fitted) = climb(&learnt, &learnt.full(&theta), WARM)? else {
            return Ok(None);
        };
        theta = learnt.of_record(0, &fitted.theta);
        let Some(until) = first_part(record, end(block + 1)).map(|part| [part]) else {
            return Ok(None);
        };
        let seen = problem.on(&until);
        let Some(filtered) = innovations(&seen, &theta)? else {
            return Ok(None);
        };
        for column in filtered {
            let v = &column[end(block)..];
            let n = v.len() as f64;
            let sum: f64 = v.iter().sum();
            let square: f64 = v.iter().map(|v| v * v).sum();
            all.push(level((n, sum, square)).square.sqrt());
        }
    }
    Ok(Some(all))
}

/// Standardised innovations of the one record, by output.
fn innovations(problem: &Problem<'_>, theta: &[f64]) -> Result<Option<Vec<Vec<f64>>>, FilterError> {
    let filtered = recoverable(problem.filtered(&problem.full(theta)))?;
    Ok(filtered.map(|all| {
        let columns = all[0].standardised.columns();
        columns.into_iter().map(|c| c.to_vec()).collect()
    }))
}
