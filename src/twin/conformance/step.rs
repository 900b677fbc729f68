//! Check of the step: half of it moves no output by more than its noise.

use super::finding::Finding;
use crate::math::{deviation, three_digits};
use crate::record::Drive;
use crate::twin::{MOST_SUBSTEPS, Noise, Now, SimulationError, StateSpace, Twin};

/// Largest error of the step where no measurement noise is declared, as a share of an output's deviation.
const STEP_SHARE: f64 = 0.01;

/// Differences of the noise-free outputs at θ between one step and half of it, rms by output; none for a black box.
pub(crate) fn step_error(
    twin: &Twin,
    theta: &[f64],
    drive: &Drive,
) -> Result<Vec<(String, f64)>, SimulationError> {
    let Some(finer) = twin.stepped(|stepping| stepping.substeps *= 2) else {
        return Ok(vec![]);
    };
    let difference = twin.free_run(theta, drive)? - finer.free_run(theta, drive)?;
    let squares = difference.mapv(|d| d * d);
    Ok((twin.signals().outputs.into_iter().zip(squares.columns()))
        .map(|(output, squares)| (output.name, squares.mean().unwrap_or(0.0).sqrt()))
        .collect())
}

/// Compares the [`step_error`] at θ with the measurement noise of each output; `None` for a black box.
pub(crate) fn check_step(twin: &Twin, theta: &[f64], drive: &Drive) -> Option<Finding> {
    const CHECK: &str = "step";
    let equations = twin.equations()?;
    let errors = match step_error(twin, theta, drive) {
        Ok(errors) => errors,
        Err(error) => return Some(Finding::warning(CHECK, format!("not known: {error}"))),
    };
    let levels = match step_levels(equations, theta, drive) {
        Ok(levels) => levels,
        Err(error) => return Some(Finding::warning(CHECK, format!("not known: {error}"))),
    };
    let units = twin.signals().outputs.into_iter().map(|output| output.unit);
    let coarse: Vec<String> = (errors.iter().zip(&levels).zip(units))
        .filter(|((error, (level, _)), _)| error.1 > *level)
        .map(|(((name, error), (level, source)), unit)| {
            let (error, level) = (three_digits(*error), three_digits(*level));
            format!("{name} moves by {error} {unit} rms, {source} is {level} {unit}")
        })
        .collect();
    if coarse.is_empty() {
        return Some(Finding::pass(
            CHECK,
            "half the step moves no output by more than its noise",
        ));
    }
    let substeps = (4 * equations.stepping().substeps).min(MOST_SUBSTEPS);
    Some(Finding::warning(
        CHECK,
        format!(
            "too long: with half the step, {}; set [record] substeps = {substeps} in a study file, or use another integrator",
            coarse.join("; ")
        ),
    ))
}

/// Limit of each output's move, and the limit's name.
fn step_levels(
    twin: &dyn StateSpace,
    theta: &[f64],
    drive: &Drive,
) -> Result<Vec<(f64, &'static str)>, SimulationError> {
    let outline = twin.outline();
    let mut process = vec![0.0; outline.states.len()];
    let mut measurement = vec![0.0; outline.outputs.len()];
    let now = Now::new(0.0, drive.step(0), drive.input(0), theta);
    twin.noise(&now, &mut process, &mut measurement);
    let run = twin.run(theta, drive, Noise::OFF)?;
    let levels = measurement.iter().zip(run.columns());
    Ok(levels
        .map(|(noise, column)| match noise.abs() {
            noise if noise > 0.0 => (noise, "its noise"),
            _ => (
                STEP_SHARE * deviation(&column.to_vec()),
                "1 % of its deviation",
            ),
        })
        .collect())
}
