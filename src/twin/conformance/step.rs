//! Check of the step: half of it, or of the mean one where steps are adaptive, moves no output by more than its noise.

use super::{Finding, Outcome, warned};
use crate::math::{deviation, three_digits};
use crate::record::{Drive, LARGEST, Signal};
use crate::setting::{number, unit_suffix};
use crate::twin::{
    Composed, Integrator, MOST_SUBSTEPS, Noise, SimulationError, StepsTaken, TOLERANCES, Twin,
};

/// Largest error of the step where no noise is declared, as a share of an output's deviation.
const STEP_SHARE: f64 = 0.01;
/// Share of the tolerance of adaptive steps that stands for exact ones.
const FINER: f64 = 0.01;
/// Rules that may do where a fixed step is too long.
const RULES: [(Integrator, &str); 2] = [
    (Integrator::RungeKutta4, "runge-kutta-4"),
    (Integrator::Adaptive, "adaptive"),
];
/// Fault and remedy of a step that makes runs diverge.
const DIVERGES: &str = "too long: the run diverges, with steps to a tolerance it does not; give the study the integrator adaptive";
/// Runs that show what process noise does to an output without measurement noise: its scatter is known to a quarter.
const NOISY_RUNS: u64 = 8;

/// Differences of the noise-free outputs at θ between the steps taken and half of them, rms by output; none for a black box.
pub(crate) fn step_error(
    twin: &Twin,
    theta: &[f64],
    drive: &Drive,
) -> Result<Vec<(String, f64)>, SimulationError> {
    // A tolerance alone changes no step that has another reason.
    let taken = twin.steps_taken(theta, drive).map_or(1, StepsTaken::mean);
    let finer = twin.stepped(|_, stepping| {
        stepping.substeps = (2 * stepping.substeps.max(taken)).min(2 * MOST_SUBSTEPS);
        stepping.tolerance *= FINER;
    });
    let Some(finer) = finer else {
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
    let outcome: Outcome = match step_length(twin, theta, drive)? {
        StepLength::Coarse(fault) => warned(fault),
        StepLength::Fine => Ok(match twin.steps_taken(theta, drive) {
            Some(taken) => taken.text(),
            None => "half the step moves no output by more than its noise".into(),
        }),
        StepLength::Unknown(error) => warned(format!("not known: {error}")),
    };
    Some(Finding::of("step", outcome))
}

/// The step's fault and remedy where a run at θ diverges or grows beyond records with the twin's own fixed steps, and one to a tolerance does not.
pub(crate) fn blamed_step(twin: &Twin, theta: &[f64], drive: &Drive) -> Option<&'static str> {
    let (own, _) = twin.integration()?;
    if !matches!(own, Integrator::Euler | Integrator::RungeKutta4) {
        return None;
    }
    let adaptive = twin.stepped(|rule, _| *rule = Integrator::Adaptive)?;
    let is_held = |run: &Signal| run.iter().all(|y| y.abs() <= LARGEST);
    let is_blown = match twin.free_run(theta, drive) {
        Ok(run) => !is_held(&run),
        Err(error) => error.costs_one_run(),
    };
    (is_blown
        && adaptive
            .free_run(theta, drive)
            .is_ok_and(|run| is_held(&run)))
    .then_some(DIVERGES)
}

/// Outcome of a comparison of a step with half of it.
pub(crate) enum StepLength {
    /// It moves no output by more than its noise.
    Fine,
    /// The step is too long: the outputs that half of it moves, with the remedy.
    Coarse(String),
    /// A run failed.
    Unknown(SimulationError),
}

/// Compares runs with the steps taken and half of them; `None` for a black box and in discrete time.
pub(crate) fn step_length(twin: &Twin, theta: &[f64], drive: &Drive) -> Option<StepLength> {
    let equations = (twin.equations()).filter(|own| own.integrator() != Integrator::Discrete)?;
    let known = step_error(twin, theta, drive)
        .and_then(|errors| Ok((errors, step_levels(equations, theta, drive)?)));
    let (errors, levels) = match known {
        Ok(known) => known,
        Err(error) => {
            let blamed = blamed_step(twin, theta, drive);
            return Some(blamed.map_or(StepLength::Unknown(error), |fault| {
                StepLength::Coarse(fault.into())
            }));
        }
    };
    if errors.iter().any(|(_, error)| !error.is_finite()) {
        return Some(StepLength::Coarse(DIVERGES.into()));
    }
    let units = twin.signals().outputs.into_iter().map(|output| output.unit);
    let coarse: Vec<String> = (errors.iter().zip(&levels).zip(units))
        .filter(|((error, (level, _)), _)| error.1 > *level)
        .map(|(((name, error), (level, source)), unit)| {
            let [error, level] = [*error, *level].map(|v| number(three_digits(v)));
            let unit = unit_suffix(&unit);
            format!("{name} moves by {error}{unit} rms, {source} is {level}{unit}")
        })
        .collect();
    if coarse.is_empty() {
        return Some(StepLength::Fine);
    }
    let settles = |finer: &Twin| {
        let errors = step_error(finer, theta, drive);
        errors.is_ok_and(|errors| {
            let mut all = errors.iter().zip(&levels);
            all.all(|((_, error), (level, _))| error <= level)
        })
    };
    let remedies: Vec<String> = finer_steps(twin, theta, drive)
        .into_iter()
        .filter_map(|kind| kind.into_iter().find(|(_, finer)| settles(finer)))
        .map(|(remedy, _)| remedy)
        .collect();
    let remedy = match remedies.is_empty() {
        false => format!("give the study {}", remedies.join(", or ")),
        true => "no finer step that was tried settles it: rates may jump there, or runs of this twin follow their smallest errors".into(),
    };
    let finer = match equations.workspace().steps_taken() {
        Some(_) => "finer ones",
        None => "half the step",
    };
    Some(StepLength::Coarse(format!(
        "too long: with {finer}, {}; {remedy}",
        coarse.join("; ")
    )))
}

/// Returns twins with finer steps, by kind of remedy, the cheapest first, each with what a study says for it.
fn finer_steps(twin: &Twin, theta: &[f64], drive: &Drive) -> [Vec<(String, Twin)>; 2] {
    let Some((rule, stepping)) = twin.integration() else {
        return [vec![], vec![]];
    };
    let taken = twin.steps_taken(theta, drive);
    let now = taken.map_or(stepping.substeps, |taken| {
        taken.mean().max(stepping.substeps)
    });
    let more = [4, 16].map(|factor| (factor * now).min(MOST_SUBSTEPS));
    let last = (more[0] < more[1]).then_some(more[1]);
    let more = [more[0]].into_iter().chain(last).filter(|many| *many > now);
    let more = more.filter_map(|many| {
        let finer = twin.stepped(|_, stepping| stepping.substeps = many)?;
        Some((format!("{many} substeps"), finer))
    });
    let other: Vec<(String, Twin)> = match taken {
        Some(_) => {
            let tolerance = (stepping.tolerance * FINER).max(*TOLERANCES.start());
            let finer = twin.stepped(|_, stepping| stepping.tolerance = tolerance);
            let finer = finer.filter(|_| tolerance < stepping.tolerance);
            let text = format!("tolerance = {}", number(tolerance));
            finer.map(|finer| (text, finer)).into_iter().collect()
        }
        None => RULES
            .into_iter()
            .filter(|(other, _)| *other != rule)
            .filter_map(|(other, name)| {
                let finer = twin.stepped(|rule, _| *rule = other)?;
                Some((format!("the integrator {name}"), finer))
            })
            .collect(),
    };
    match taken {
        Some(_) => [other, more.collect()],
        None => [more.collect(), other],
    }
}

/// Limit of each output's move, and the limit's name.
fn step_levels(
    twin: &Composed,
    theta: &[f64],
    drive: &Drive,
) -> Result<Vec<(f64, &'static str)>, SimulationError> {
    let [_, measurement] =
        (Twin::Equations(twin.clone()).first_noise(theta, drive)).unwrap_or_default();
    let run = twin.run(theta, drive, Noise::OFF)?;
    let scatter = scatter(twin, theta, drive, &run)?;
    let levels = measurement.iter().zip(scatter).zip(run.columns());
    Ok(levels
        .map(|((noise, scatter), column)| match (noise.abs(), scatter) {
            (noise, _) if noise > 0.0 => (noise, "its noise"),
            (_, scatter) if scatter > 0.0 => (scatter, "its noise"),
            _ => (
                STEP_SHARE * deviation(&column.to_vec()),
                "1 % of its deviation",
            ),
        })
        .collect())
}

/// Root mean square of what noise adds to each output; 0 where every noisy run diverges.
fn scatter(
    twin: &Composed,
    theta: &[f64],
    drive: &Drive,
    run: &Signal,
) -> Result<Vec<f64>, SimulationError> {
    let (mut squares, mut runs) = (vec![0.0; run.ncols()], 0.0);
    for draw in 0..NOISY_RUNS {
        // Loud noise may drive a run out of the numbers that a run without noise keeps: that says nothing of the step.
        let moved = match twin.run(theta, drive, Noise::new(0, "scatter", draw)) {
            Ok(noisy) => noisy - run,
            Err(error) if error.costs_one_run() => continue,
            Err(error) => return Err(error),
        };
        runs += 1.0;
        for (square, column) in squares.iter_mut().zip(moved.columns()) {
            *square += column.mapv(|d| d * d).mean().unwrap_or(0.0);
        }
    }
    let mean = |square: f64| (square / f64::max(runs, 1.0)).sqrt();
    Ok(squares.into_iter().map(mean).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::twin::conformance::Severity;
    use crate::twins::VanDerPol;

    /// The oscillator has process noise alone: what it moves the output by is the measure.
    #[test]
    fn a_step_may_be_wrong_by_less_than_noise() {
        let drive = Drive::autonomous(0.05, 300).unwrap();
        let coarse = Twin::new(VanDerPol);
        let fine = coarse
            .stepped(|_, stepping| stepping.substeps = 16)
            .unwrap();
        let of = |twin: &Twin| check_step(twin, &[3.2], &drive).unwrap().severity;
        assert_eq!(of(&coarse), Severity::Warning);
        assert_eq!(of(&fine), Severity::Pass);
    }
}
