//! Gauss–Newton in whitened feature space: from the network's first estimate to one that explains the record.
//!
//! ```text
//! v(θ) = ½‖S^{-1/2}(f̄(θ) − x_obs)‖² + γ/2·‖(θ − θ_init)/width‖²
//! ```
//!
//! f̄ is the mean of the features over fixed seeds (common random numbers), S their covariance, simulated again as θ
//! moves; `width` is that of the prior. Starts are θ_init and space-filling points in the bounds; among their ends the
//! one with the largest synthetic likelihood −½‖r‖² − ½ log|S| is taken, since ‖r‖ under different S cannot be compared.
//!
//! Source: Lakshminarayanan, Guerrero & Rojas, section IV-B; Wood, "Statistical inference for noisy nonlinear
//! ecological dynamic systems", Nature 466 (2010), for the synthetic likelihood.

mod information;
mod problem;
mod settings;
#[cfg(test)]
mod tests;

pub(crate) use information::FeatureInformation;
pub use settings::RefineSettings;

use crate::estimator::bank::FeatureSimulator;
use crate::estimator::error::EstimatorError;
use crate::estimator::gate::GateSettings;
use crate::fit::least_squares::{GaussNewton, ResidualProblem, space_filling};
use crate::math::{MathError, Whitening};
use crate::progress::{Progress, Stage};
use crate::record::Drive;
use crate::twin::Noise;
use nalgebra::{DMatrix, DVector};
use problem::FeatureResidual;

/// Largest move, in prior widths, of an estimate that rests.
const AT_REST: f64 = 1e-3;

/// The refined estimate, with what was simulated around it.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub struct RefinedEstimate {
    /// θ_GN.
    pub theta: DVector<f64>,
    /// μ and S^{-1/2} at θ_GN; after a single round, where it began.
    pub whitening: Whitening,
    /// Whitened distances ‖S^{-1/2}(x_k − μ)‖ of the simulations there.
    pub spread: Vec<f64>,
    /// ∂f̄/∂θ at θ_GN, n × d, features over parameters.
    pub jacobian: DMatrix<f64>,
    /// S^{-1/2}(f̄ − x_obs) at θ_GN.
    pub residual: DVector<f64>,
    /// G and what follows from it.
    pub information: FeatureInformation,
}

impl RefinedEstimate {
    /// S^{-1/2} ∂f̄/∂θ, rank × d.
    pub fn whitened_jacobian(&self) -> DMatrix<f64> {
        self.whitening.apply_columns(&self.jacobian)
    }

    /// The part of a whitened residual that θ could still remove, ‖P_J r‖²: χ²_d at the true θ.
    pub fn explainable_misfit(&self, residual: &DVector<f64>) -> f64 {
        let svd = self.whitened_jacobian().svd(true, false);
        svd.u.map_or(0.0, |u| u.tr_mul(residual).norm_squared())
    }
}

/// Returns whether an error ends the search for a better start.
fn is_fatal(error: &EstimatorError) -> bool {
    use EstimatorError::{Hopeless, Search, Undetermined, Whitening};
    match error {
        Search(error) => matches!(error, MathError::Fatal(_)),
        error => !matches!(error, Hopeless { .. } | Undetermined(_) | Whitening(_)),
    }
}

/// Record, simulator and settings of a refinement.
pub struct Refinement<'a> {
    /// Twin and features.
    pub simulator: &'a FeatureSimulator,
    /// The record's input.
    pub drive: &'a Drive,
    /// The record's features.
    pub observed: &'a DVector<f64>,
    /// Settings.
    pub settings: &'a RefineSettings,
    /// Whitening of the features.
    pub gate: &'a GateSettings,
    /// Randomness.
    pub noise: Noise,
    /// Progress sink, asked at every simulation.
    pub progress: &'a Progress,
}

debug_by_name!(Refinement<'_>);

/// Where one start has come to.
struct StartEnd {
    theta: DVector<f64>,
    local: Local,
    score: f64,
}

/// Features simulated at one θ.
#[derive(Clone)]
struct Local {
    whitening: Whitening,
    spread: Vec<f64>,
}

impl Refinement<'_> {
    /// Runs it from `initial`.
    pub fn run(&self, initial: &[f64]) -> Result<RefinedEstimate, EstimatorError> {
        let settings = self.settings;
        let steps = settings.starts + settings.rounds;
        let stage = self.progress.stage("Gauss–Newton", steps);
        let mut problem = self.problem(initial, settings.seeds);
        let start = problem.initial.clone();
        let (theta, local) = match (settings.starts, settings.rounds) {
            // Nothing to choose from, and little way to go.
            (1, 1) => (start.clone(), self.whiten(&start)?),
            _ => self.survey(&start, &stage)?,
        };
        let (theta, local) = self.polish(&mut problem, theta, local, &stage)?;
        stage.finish();
        self.describe(&problem, theta, local)
    }

    /// Returns information and directions at `theta` without a search.
    pub fn describe_at(&self, theta: &[f64]) -> Result<RefinedEstimate, EstimatorError> {
        let problem = self.problem(theta, self.settings.seeds);
        let theta = problem.initial.clone();
        let local = self.whiten(&theta)?;
        self.describe(&problem, theta, local)
    }

    /// S^{-1/2}(f̄(θ) − x_obs) with the covariance at θ_GN.
    pub fn whitened_residual(
        &self,
        refined: &RefinedEstimate,
        theta: &[f64],
    ) -> Result<DVector<f64>, EstimatorError> {
        let problem = self.problem(refined.theta.as_slice(), self.settings.seeds);
        let mean = problem
            .mean_features(&DVector::from_column_slice(theta))
            .map_err(not_evaluated)?;
        Ok(refined.whitening.apply(&(mean - self.observed)))
    }

    /// ∂f/∂θ at `theta`, n × d, of a few seeds, each by itself.
    pub fn jacobians_at(&self, theta: &[f64]) -> Result<Vec<DMatrix<f64>>, EstimatorError> {
        let problem = self.problem(theta, self.settings.centred_seeds);
        Ok((problem.jacobians(&problem.initial)).map_err(not_evaluated)?)
    }

    /// The residual that is pulled towards `initial`, with so many runs in each mean.
    fn problem(&self, initial: &[f64], seeds: usize) -> FeatureResidual<'_> {
        let space = self.simulator.twin().parameters();
        let (widths, bounds) = (space.widths(), space.bounds());
        FeatureResidual {
            refinement: self,
            seeds,
            whitening: None,
            initial: DVector::from_vec(space.clamp(initial)),
            lower: bounds.iter().map(|b| b.low()).collect(),
            upper: bounds.iter().map(|b| b.high()).collect(),
            widths: DVector::from_vec(widths),
        }
    }

    /// The best of several starts: θ_init, then space-filling points in the bounds.
    fn survey(
        &self,
        initial: &DVector<f64>,
        stage: &Stage,
    ) -> Result<(DVector<f64>, Local), EstimatorError> {
        let mut problem = self.problem(initial.as_slice(), self.settings.survey_seeds);
        let others = space_filling(&problem.bounds()?, self.settings.starts - 1, 0);
        let (mut best, mut last): (Option<StartEnd>, _) = (None, String::new());
        for start in [initial.clone()].into_iter().chain(others) {
            match self.climb(&mut problem, &start) {
                // Ties and equals go to the earlier start: θ_init comes first.
                Ok(found) if best.as_ref().is_none_or(|best| found.score > best.score) => {
                    best = Some(found);
                }
                Ok(_) => {}
                Err(error) if is_fatal(&error) => return Err(error),
                Err(error) => last = error.to_string(),
            }
            stage.tick()?;
        }
        let starts = self.settings.starts;
        let StartEnd { theta, local, .. } = best.ok_or_else(|| {
            EstimatorError::Undetermined(format!(
                "Gauss–Newton found no estimate from {starts} starts: {last}; widen the bounds or check the twin"
            ))
        })?;
        Ok((theta, local))
    }

    /// One start: whiten there, descend, whiten at the end, score.
    fn climb(
        &self,
        problem: &mut FeatureResidual<'_>,
        start: &DVector<f64>,
    ) -> Result<StartEnd, EstimatorError> {
        problem.whitening = Some(self.whiten(start)?.whitening);
        let theta = self.descend(problem, start)?;
        let local = self.whiten(&theta)?;
        problem.whitening = Some(local.whitening.clone());
        let residual = problem.residual(&theta).map_err(not_evaluated)?;
        Ok(StartEnd {
            score: -0.5 * (residual.norm_squared() + local.whitening.log_determinant()),
            theta,
            local,
        })
    }

    /// Descends on from the best start with all seeds, simulating S again until θ rests.
    fn polish(
        &self,
        problem: &mut FeatureResidual<'_>,
        mut theta: DVector<f64>,
        mut local: Local,
        stage: &Stage,
    ) -> Result<(DVector<f64>, Local), EstimatorError> {
        for _ in 0..self.settings.rounds {
            problem.whitening = Some(local.whitening.clone());
            let next = self.descend(problem, &theta)?;
            let moved = (&next - &theta).component_div(&problem.widths).amax();
            theta = next;
            // A single round stays so near that S does.
            if self.settings.rounds > 1 {
                local = self.whiten(&theta)?;
            }
            stage.tick()?;
            if moved < AT_REST {
                break;
            }
        }
        Ok((theta, local))
    }

    fn descend(
        &self,
        problem: &FeatureResidual<'_>,
        start: &DVector<f64>,
    ) -> Result<DVector<f64>, MathError> {
        let search = GaussNewton {
            max_iterations: self.settings.iterations,
            relative_cutoff: self.settings.cutoff,
            tolerance: 1e-6,
            step_tolerance: 1e-5,
            // A step over half the prior's width leaves what the Jacobian knows.
            max_step: Some(0.5),
        };
        let bounds = problem.bounds()?;
        Ok((search.minimise(problem, start, &bounds, &problem.widths)?).theta)
    }

    /// S at `theta`, from the same noise everywhere.
    fn whiten(&self, theta: &DVector<f64>) -> Result<Local, EstimatorError> {
        let size = self.gate.whitening_simulations(self.simulator.dim());
        let noise = self.noise.child("whitening");
        let stage = self.progress.unshown().stage("whitening", 0);
        let sample = |i| noise.sample(i);
        let features =
            (self.simulator).repeat(theta.as_slice(), self.drive, size, sample, &stage)?;
        let whitening = self.gate.whiten(&features)?;
        let squares = whitening.squared_distances(&features);
        let spread = squares.iter().map(|s| s.sqrt()).collect();
        Ok(Local { whitening, spread })
    }

    /// Everything around the estimate.
    fn describe(
        &self,
        problem: &FeatureResidual<'_>,
        theta: DVector<f64>,
        Local { whitening, spread }: Local,
    ) -> Result<RefinedEstimate, EstimatorError> {
        let jacobian = problem.feature_jacobian(&theta).map_err(not_evaluated)?;
        let mean = problem.mean_features(&theta).map_err(not_evaluated)?;
        let residual = whitening.apply(&(mean - self.observed));
        let information = FeatureInformation::new(
            &whitening.apply_columns(&jacobian),
            &self.simulator.twin().parameters(),
            self.settings.ridge,
            self.settings.seeds,
        )?;
        Ok(RefinedEstimate {
            theta,
            whitening,
            spread,
            jacobian,
            residual,
            information,
        })
    }
}

/// An evaluation that failed outside of a search.
fn not_evaluated(error: MathError) -> MathError {
    match error {
        MathError::Fatal(error) => MathError::Fatal(error),
        MathError::Rejected(_) => MathError::Start(error.into()),
        other => MathError::fatal(other),
    }
}
