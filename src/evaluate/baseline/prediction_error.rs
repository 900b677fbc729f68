//! Fitting the noise-free output.

use crate::evaluate::EvaluateError;
use crate::fit::least_squares::{Bounds, GaussNewton, ResidualProblem};
use crate::math::MathError;
use crate::math::Stencil;
use crate::record::Record;
use crate::setting::SettingError;
use crate::twin::{DigitalTwin, ParameterSpace, SimulationError};
use nalgebra::{DMatrix, DVector};
use serde::{Deserialize, Serialize};

/// Settings of the prediction-error method with the twin's noise-free output as the prediction:
///
/// ```text
/// r(θ) = vec(y − ŷ(θ)),   p = −(JᵀJ + λI)⁻¹Jᵀr,   θ ← clip(θ + t·p),   t = 1, ½, ¼ … until ‖r‖ falls
/// ```
///
/// | setting | default | range | meaning |
/// |---|---|---|---|
/// | `iterations` | 6 | ≥ 0 | steps at most; the paper's six. With `converged`: 200 |
/// | `ridge` | 1e-3 | ≥ 0 | λ, in squared output units by squared parameter units. 0: our own bounded Gauss–Newton, to convergence |
/// | `step` | 1e-4 | (0, 1) | of differences, in prior widths |
/// | `halvings` | 12 | ≥ 0 | of a step before giving up |
///
/// Works on any twin: of a black box, the mean of 32 runs is its noise-free output. Disturbances inside the dynamics
/// are not modelled, so that the fit is neither efficient nor, in weak directions, safe: it drifts along them.
///
/// Source: Ljung, *System Identification* (1999), chapter 7; the numbers are those of the authors' code of
/// Lakshminarayanan, Guerrero & Rojas.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct PredictionErrorMethod {
    /// Steps at most.
    pub iterations: u64,
    /// λ; 0 for the search to convergence.
    pub ridge: f64,
    /// Step of differences, in prior widths.
    pub step: f64,
    /// Halvings of a step before giving up.
    pub halvings: u32,
}

impl Default for PredictionErrorMethod {
    fn default() -> Self {
        Self {
            iterations: 6,
            ridge: 1e-3,
            step: 1e-4,
            halvings: 12,
        }
    }
}

/// Result of the prediction-error method.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct PredictionErrorFit {
    /// θ, within the bounds.
    pub theta: Vec<f64>,
    /// Root mean square of y − ŷ there, in output units.
    pub rmse: f64,
    /// Steps that were taken.
    pub iterations: usize,
}

impl PredictionErrorMethod {
    /// Fits θ from `start`, which is brought into the bounds first.
    ///
    /// # Errors
    ///
    /// [`EvaluateError`]: what does not fit, a twin that fails at the start. A point where it diverges later shortens the step.
    pub fn fit(
        &self,
        twin: &dyn DigitalTwin,
        record: &Record,
        start: &[f64],
    ) -> Result<PredictionErrorFit, EvaluateError> {
        let (ridge, step) = (self.ridge, self.step);
        SettingError::unless(
            ridge >= 0.0,
            "ridge",
            ridge,
            "it must not be negative, such as 1e-3",
        )?;
        let valid = step > 0.0 && step < 1.0;
        SettingError::unless(
            valid,
            "step",
            step,
            "it must lie between 0 and 1 prior widths",
        )?;
        record.check_channels(&twin.signals())?;
        record.check_complete()?;
        let space = twin.parameters();
        let start = space.clamp(start);
        space.check_point(&start)?;
        let problem = OutputError {
            twin,
            record,
            steps: space.widths().iter().map(|w| step * w).collect(),
            lower: space.bounds().iter().map(|b| b.low()).collect(),
            upper: space.bounds().iter().map(|b| b.high()).collect(),
        };
        let (theta, residual, iterations) = if ridge > 0.0 {
            self.ridged(&problem, &space, start)?
        } else {
            let search = GaussNewton {
                max_iterations: self.iterations,
                max_halvings: self.halvings,
                ..GaussNewton::default()
            };
            let vector = |v: &[f64]| DVector::from_column_slice(v);
            let bounds = Bounds::new(vector(&problem.lower), vector(&problem.upper))?;
            let scale = vector(&space.widths());
            let found = search.minimise(&problem, &vector(&start), &bounds, &scale)?;
            let theta = found.theta.as_slice().to_vec();
            (theta, found.residual, found.iterations)
        };
        let count = residual.len().max(1) as f64;
        Ok(PredictionErrorFit {
            theta,
            rmse: (residual.norm_squared() / count).sqrt(),
            iterations,
        })
    }

    /// The paper's steps.
    fn ridged(
        &self,
        problem: &OutputError<'_>,
        space: &ParameterSpace,
        mut theta: Vec<f64>,
    ) -> Result<(Vec<f64>, DVector<f64>, usize), EvaluateError> {
        let mut residual = problem.at(&theta)?;
        let mut taken = 0;
        for _ in 0..self.iterations {
            let jacobian = match problem.slopes(&theta) {
                Ok(jacobian) => jacobian,
                Err(EvaluateError::Simulation(error)) if error.costs_one_run() => break,
                Err(error) => return Err(error),
            };
            let d = theta.len();
            let normal = jacobian.tr_mul(&jacobian) + DMatrix::identity(d, d) * self.ridge;
            let Some(factor) = normal.cholesky() else {
                break;
            };
            let mut step = factor.solve(&-jacobian.tr_mul(&residual));
            let mut better = None;
            for _ in 0..=self.halvings {
                let moved: Vec<f64> = theta.iter().zip(&step).map(|(a, b)| a + b).collect();
                let to = space.clamp(&moved);
                match problem.at(&to) {
                    Ok(found) if found.norm_squared() < residual.norm_squared() => {
                        better = Some((to, found));
                        break;
                    }
                    Ok(_) => {}
                    Err(EvaluateError::Simulation(error)) if error.costs_one_run() => {}
                    Err(error) => return Err(error),
                }
                step *= 0.5;
            }
            let Some((to, found)) = better else { break };
            (theta, residual) = (to, found);
            taken += 1;
        }
        Ok((theta, residual, taken))
    }
}

/// ŷ(θ) − y, channel by channel.
struct OutputError<'a> {
    twin: &'a dyn DigitalTwin,
    record: &'a Record,
    steps: Vec<f64>,
    lower: Vec<f64>,
    upper: Vec<f64>,
}

impl OutputError<'_> {
    fn at(&self, theta: &[f64]) -> Result<DVector<f64>, EvaluateError> {
        let run = self.twin.free_run(theta, self.record.drive())?;
        let outputs = self.record.outputs();
        let pairs = run.iter().zip(outputs).map(|(a, b)| a - b);
        let residual = DVector::from_iterator(outputs.len(), pairs);
        if residual.iter().all(|v| v.is_finite()) {
            Ok(residual)
        } else {
            Err(SimulationError::Diverged { at: 0.0 }.into())
        }
    }

    fn slopes(&self, theta: &[f64]) -> Result<DMatrix<f64>, EvaluateError> {
        let stencil = Stencil::new(theta, &self.steps, &self.lower, &self.upper)?;
        stencil.jacobian(|point| self.at(point))
    }
}

impl From<EvaluateError> for MathError {
    fn from(error: EvaluateError) -> Self {
        match &error {
            EvaluateError::Simulation(cause) if cause.costs_one_run() => Self::rejected(error),
            _ => Self::fatal(error),
        }
    }
}

impl ResidualProblem for OutputError<'_> {
    fn dimension(&self) -> usize {
        self.steps.len()
    }
    fn residual(&self, theta: &DVector<f64>) -> Result<DVector<f64>, MathError> {
        Ok(self.at(theta.as_slice())?)
    }
    fn jacobian(&self, theta: &DVector<f64>) -> Result<DMatrix<f64>, MathError> {
        Ok(self.slopes(theta.as_slice())?)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evaluate::baseline::tests::converged;
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
            for (settings, tolerance) in [
                (PredictionErrorMethod::default(), 1e-3),
                (converged(), 1e-6),
            ] {
                let fit = settings.fit(&VanDerPol, &record, &[1.03 * nu]).unwrap();
                let error = (fit.theta[0] - nu).abs();
                assert!(error < tolerance, "nu {nu}: {error}, {settings:?}");
                assert!(fit.iterations > 0 && fit.rmse < 0.01);
            }
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
        for (settings, tolerance) in [
            (PredictionErrorMethod::default(), 2e-3),
            (converged(), 1e-4),
        ] {
            let fit = settings.fit(&CascadedTanks, &record, &start).unwrap();
            for (found, true_value) in invariants(&fit.theta).iter().zip(invariants(&truth)) {
                assert!((found - true_value).abs() < tolerance, "{fit:?}");
            }
            assert!((fit.theta[3] - truth[3]).abs() < 0.15, "{fit:?}");
        }
    }

    #[test]
    fn estimates_stay_in_the_bounds() {
        let drive = Drive::autonomous(0.05, 60).unwrap();
        let record = noise_free(&VanDerPol, &[0.0], drive);
        for settings in [PredictionErrorMethod::default(), converged()] {
            let fit = settings.fit(&VanDerPol, &record, &[9.0]).unwrap();
            assert!((0.0..=7.0).contains(&fit.theta[0]), "{fit:?}");
        }
        let bad = PredictionErrorMethod {
            ridge: -1.0,
            ..PredictionErrorMethod::default()
        };
        let error = bad.fit(&VanDerPol, &record, &[1.0]).unwrap_err();
        assert!(error.to_string().starts_with("ridge = -1"));
    }
}
