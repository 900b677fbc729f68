//! Fitting the noise-free output.

use super::BASELINE;
use crate::evaluate::EvaluateError;
use crate::math::Stencil;
use crate::record::Record;
use crate::twin::{DigitalTwin, SimulationError};
use nalgebra::{DMatrix, DVector};

/// Fits θ from `start`, brought into the bounds, with the twin's noise-free output as the prediction:
///
/// ```text
/// r(θ) = vec(y − ŷ(θ)),   p = −(JᵀJ + λI)⁻¹Jᵀr,   θ ← clip(θ + t·p),   t = 1, ½, ¼ … until ‖r‖ falls
/// ```
///
/// Works on any twin: of a black box, the mean of 32 runs is its noise-free output. Disturbances inside the dynamics
/// are not modelled, so that the fit is neither efficient nor, in weak directions, safe: it drifts along them. A point
/// where the twin diverges shortens the step.
///
/// Source: Ljung, *System Identification* (1999), chapter 7; the numbers are those of the authors' code of
/// Lakshminarayanan, Guerrero & Rojas.
pub fn prediction_error(
    twin: &dyn DigitalTwin,
    record: &Record,
    start: &[f64],
) -> Result<Vec<f64>, EvaluateError> {
    record.check_channels(&twin.signals())?;
    record.check_complete()?;
    let space = twin.parameters();
    let mut theta = space.clamp(start);
    space.check_point(&theta)?;
    let steps: Vec<f64> = space.widths().iter().map(|w| BASELINE.step * w).collect();
    let lower: Vec<f64> = space.bounds().iter().map(|b| b.low()).collect();
    let upper: Vec<f64> = space.bounds().iter().map(|b| b.high()).collect();
    let residual = |theta: &[f64]| residual(twin, record, theta);

    let mut here = residual(&theta)?;
    for _ in 0..BASELINE.iterations {
        let stencil = Stencil::new(&theta, &steps, &lower, &upper)?;
        let Some(jacobian) = unless_diverged(stencil.jacobian(residual))? else {
            break;
        };
        let d = theta.len();
        let normal = jacobian.tr_mul(&jacobian) + DMatrix::identity(d, d) * BASELINE.ridge;
        let Some(factor) = normal.cholesky() else {
            break;
        };
        let mut step = factor.solve(&-jacobian.tr_mul(&here));
        let mut better = None;
        for _ in 0..=BASELINE.halvings {
            let moved: Vec<f64> = theta.iter().zip(&step).map(|(a, b)| a + b).collect();
            let to = space.clamp(&moved);
            let there = unless_diverged(residual(&to))?;
            if let Some(there) = there.filter(|r| r.norm_squared() < here.norm_squared()) {
                better = Some((to, there));
                break;
            }
            step *= 0.5;
        }
        let Some(better) = better else { break };
        (theta, here) = better;
    }
    Ok(theta)
}

/// ŷ(θ) − y, channel by channel.
fn residual(
    twin: &dyn DigitalTwin,
    record: &Record,
    theta: &[f64],
) -> Result<DVector<f64>, EvaluateError> {
    let run = twin.free_run(theta, record.drive())?;
    let outputs = record.outputs();
    let pairs = run.iter().zip(outputs).map(|(a, b)| a - b);
    let residual = DVector::from_iterator(outputs.len(), pairs);
    match residual.iter().all(|v| v.is_finite()) {
        true => Ok(residual),
        false => Err(SimulationError::Diverged { at: 0.0 }.into()),
    }
}

/// `None` where the twin failed at this θ alone.
fn unless_diverged<T>(result: Result<T, EvaluateError>) -> Result<Option<T>, EvaluateError> {
    match result {
        Ok(value) => Ok(Some(value)),
        Err(EvaluateError::Simulation(error)) if error.costs_one_run() => Ok(None),
        Err(error) => Err(error),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::record::{Drive, Signal};
    use crate::twin::Noise;
    use crate::twins::{CascadedTanks, VanDerPol};

    fn noise_free(twin: &dyn DigitalTwin, theta: &[f64], drive: Drive) -> Record {
        let outputs = twin.simulate(theta, &drive, Noise::OFF).unwrap();
        Record::new(drive, outputs).unwrap()
    }

    #[test]
    fn van_der_pol_is_recovered_from_nearby() {
        let drive = Drive::autonomous(0.05, 300).unwrap();
        for nu in [0.8, 3.0] {
            let record = noise_free(&VanDerPol, &[nu], drive.clone());
            let theta = prediction_error(&VanDerPol, &record, &[1.03 * nu]).unwrap();
            assert!((theta[0] - nu).abs() < 1e-3, "nu {nu}: {theta:?}");
        }
    }

    /// One direction of the tanks changes no noise-free output: it stays where it started, the others are found.
    #[test]
    fn tanks_are_recovered_up_to_their_scale() {
        let inputs =
            Signal::from_shape_fn((400, 1), |(k, _)| [1.8, 0.9, 2.1, 2.2, 0.3][k / 30 % 5]);
        let drive = Drive::new(0.5, inputs).unwrap();
        let truth = [0.6, 0.5, 0.55, 1.0];
        let record = noise_free(&CascadedTanks, &truth, drive);
        let invariants = |k: &[f64]| [k[0] * k[1], k[2], k[1].powi(2) * k[3]];
        let start = [0.63, 0.48, 0.57, 0.97];
        let theta = prediction_error(&CascadedTanks, &record, &start).unwrap();
        for (found, true_value) in invariants(&theta).iter().zip(invariants(&truth)) {
            assert!((found - true_value).abs() < 2e-3, "{theta:?}");
        }
        assert!((theta[3] - truth[3]).abs() < 0.15, "{theta:?}");
    }

    #[test]
    fn estimates_stay_in_the_bounds() {
        let drive = Drive::autonomous(0.05, 60).unwrap();
        let record = noise_free(&VanDerPol, &[0.0], drive);
        let theta = prediction_error(&VanDerPol, &record, &[9.0]).unwrap();
        assert!((0.0..=7.0).contains(&theta[0]), "{theta:?}");
    }
}
