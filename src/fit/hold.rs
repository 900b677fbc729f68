//! Inputs between samples, asked of the records.
//!
//! Rules are compared with a step that is fine: with a coarse one, the error of one rule may cancel that of the step.

use super::climb::{Fitted, reach};
use super::problem::Problem;
use super::reference::Reference;
use super::starts::growing::sketch;
use crate::fit::budget::BUDGET;
use crate::fit::budget::ITERATIONS;
use crate::likelihood::kalman::{FilterError, Filtered, recoverable};
use crate::record::Drive;
use crate::twin::{Hold, Integrator, MOST_SUBSTEPS, Stepping};

/// Another rule for inputs between samples, and the substeps beside it, with which a fit explains its records better.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct OtherHold {
    pub stepping: Stepping,
    /// Nats of posterior density that it gains.
    pub gain: f64,
}

/// The rule for inputs between samples that explains the records of a fit best, if it is another than that of the twin; `None` where the own
/// one does, and for a black box.
pub(crate) fn other_hold(
    problem: &Problem,
    fitted: &Fitted,
) -> Result<Option<OtherHold>, FilterError> {
    // Nothing is between the samples of discrete time.
    let rule = problem.twin.integration();
    let Some((integrator, own)) = rule.filter(|(rule, _)| *rule != Integrator::Discrete) else {
        return Ok(None);
    };
    let moves = problem.records.iter().any(|record| moves(record.drive()));
    if !moves {
        return Ok(None);
    }
    let theta = &fitted.theta;
    // Gains grow with the rows: those over the beginning of a long record tell which rules are worth a search over all of it.
    let sketched = sketch(problem);
    let short = sketched.as_ref().unwrap_or(problem);
    let share = short.samples() as f64 / problem.samples() as f64;
    let Some(reference) = Reference::new(short, theta)? else {
        return Ok(None);
    };
    let mut shown = vec![];
    for hold in [Hold::Zero, Hold::Linear, Hold::Spline, Hold::Nearest] {
        let other = short.stepped(Stepping { hold, ..own });
        let Some(other) = other.filter(|_| hold != own.hold) else {
            continue;
        };
        let filtered = recoverable(other.filtered(theta))?;
        let gain = |f: &Vec<Filtered>| 0.5 * reference.own(&reference.direction(f)) / share;
        let shows = |f: &Vec<Filtered>| gain(f) > BUDGET.hold_shows;
        if filtered.as_ref().is_some_and(shows) {
            shown.push(hold);
        }
    }
    if shown.is_empty() {
        return Ok(None);
    }
    let factor = match integrator {
        Integrator::Euler => BUDGET.finer_step * BUDGET.finer_step,
        Integrator::Adaptive | Integrator::Stiff => 1,
        _ => BUDGET.finer_step,
    };
    let substeps = (factor * own.substeps).min(MOST_SUBSTEPS);
    let carried = |hold: Hold| -> Result<Option<f64>, FilterError> {
        let Some(finer) = problem.stepped(Stepping {
            substeps,
            hold,
            ..own
        }) else {
            return Ok(None);
        };
        Ok(reach(&finer, theta, ITERATIONS)?.map(|end| end.objective))
    };
    let least = carried(own.hold)?.map_or(fitted.objective, |own| own.max(fitted.objective));
    let mut best: Option<OtherHold> = None;
    for hold in shown {
        let gain = carried(hold)?.map_or(f64::NEG_INFINITY, |objective| objective - least);
        if gain > best.map_or(BUDGET.hold_wins, |best| best.gain) {
            let stepping = Stepping {
                substeps,
                hold,
                ..own
            };
            best = Some(OtherHold { stepping, gain });
        }
    }
    Ok(best)
}

/// Returns whether an input moves in most steps. One that rests is held: on a line from one level to the next, rows would lie between them.
fn moves(drive: &Drive) -> bool {
    drive.inputs().columns().into_iter().any(|u| {
        let steps = u.iter().zip(u.iter().skip(1));
        2 * steps.filter(|(a, b)| a != b).count() > u.len()
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::record::{Drive, Record, Signal};
    use crate::study::Study;
    use crate::twin::fixture::OneState;
    use crate::twin::{Noise, Parameter, Twin};

    /// A room that is heated: τ·ẋ = K·u − x.
    fn room() -> OneState {
        let gain = Parameter::new("K", "K/W", 0.5, 4.0);
        let tau = Parameter::new("tau", "s", 1.0, 8.0);
        OneState {
            noise: [0.0, 0.02],
            integrator: Integrator::RungeKutta4,
            ..OneState::new([gain, tau], |theta, u, x| (theta[0] * u[0] - x) / theta[1])
        }
    }

    /// The rule that a fit asks for of a record that was made with another.
    fn asked(made_with: Hold, u: impl Fn(f64) -> f64, seed: u64) -> Option<Hold> {
        let inputs = Signal::from_shape_fn((150, 1), |(k, _)| u(2.0 * k as f64));
        let drive = Drive::new(2.0, inputs).unwrap();
        let stepping = Stepping {
            substeps: 16,
            hold: made_with,
            ..Stepping::default()
        };
        let world = (Twin::new(room()).stepped(|_, own| *own = stepping)).unwrap();
        let outputs = world.simulate(&[2.0, 3.0], &drive, Noise::new(seed, "held", 0));
        let record = Record::new(drive, outputs.unwrap()).unwrap();
        let fit = Study::of(room()).unwrap().fit(&[record]).unwrap();
        fit.stepping.map(|stepping| stepping.hold)
    }

    #[test]
    fn records_say_how_their_inputs_move() {
        let smooth = |t: f64| 1.0 + (0.7 * t).sin();
        for seed in 0..3 {
            assert_eq!(asked(Hold::Linear, smooth, seed), Some(Hold::Linear));
            assert_eq!(asked(Hold::Spline, smooth, seed), Some(Hold::Spline));
            assert_eq!(asked(Hold::Zero, smooth, seed), None);
            assert_eq!(asked(Hold::Linear, |_| 1.0, seed), None);
            assert_eq!(asked(Hold::Zero, |t| (t / 20.0).floor() % 2.0, seed), None);
        }
    }

    /// Two sines, of nine and of four samples a period, act as they are, and are known at samples alone: nothing is missing, and parameters are
    /// those of the system. A line between samples takes a tenth off the gain.
    #[test]
    fn a_smooth_input_that_was_sampled_takes_nothing_off_the_parameters() {
        const EACH: usize = 20;
        let of = |t: f64| (0.35 * t).sin() + 0.8 * (0.78 * t + 1.0).sin();
        let fine = Signal::from_shape_fn((150 * EACH, 1), |(k, _)| of(0.1 * (k as f64 + 0.5)));
        let (fine, twin) = (Drive::new(0.1, fine).unwrap(), Twin::new(room()));
        let truth = [2.0, 3.0];
        for seed in 0..3 {
            let run = twin.simulate(&truth, &fine, Noise::new(seed, "smooth", 0));
            let outputs = run.unwrap().slice(ndarray::s![..;EACH, ..]).to_owned();
            let inputs = Signal::from_shape_fn((150, 1), |(k, _)| of(2.0 * k as f64));
            let record = Record::new(Drive::new(2.0, inputs).unwrap(), outputs).unwrap();
            let study = Study::of(room()).unwrap();
            let fit = study.fit(std::slice::from_ref(&record)).unwrap();
            let hold = fit.stepping.map(|stepping| stepping.hold);
            assert_eq!(hold, Some(Hold::Spline));
            for (parameter, truth) in fit.parameters.iter().zip(truth) {
                let off = (parameter.value - truth).abs();
                assert!(off < 4.0 * parameter.std_error, "{parameter:?}");
            }
        }
    }
}
