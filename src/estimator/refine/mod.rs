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

pub(crate) use information::FeatureInformation;

use crate::estimator::budget::BUDGET;
use crate::estimator::error::EstimatorError;
use crate::estimator::gate::{GateTest, whiten};
use crate::estimator::settings::RefineSettings;
use crate::fit::least_squares::{Bounds, GaussNewton, ResidualProblem, space_filling};
use crate::math::{MathError, Stencil, Whitening, thin_svd};
use crate::parallel::try_each;
use crate::progress::Stage;
use crate::twin::{Interval, Noise};
use nalgebra::{DMatrix, DVector};

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
    /// Derivatives of f̄ by θ over the prior's widths at θ_GN, n × d.
    pub jacobian: DMatrix<f64>,
    /// S^{-1/2}(f̄ − x_obs) at θ_GN.
    pub residual: DVector<f64>,
    /// G and what follows from it.
    pub information: FeatureInformation,
}

impl RefinedEstimate {
    /// The whitened Jacobian by θ over the prior's widths, rank × d.
    pub fn whitened_jacobian(&self) -> DMatrix<f64> {
        self.whitening.apply_columns(&self.jacobian)
    }

    /// The part of a whitened residual that θ could still remove, ‖P_J r‖²: χ²_d at the true θ.
    pub fn explainable_misfit(&self, residual: &DVector<f64>) -> f64 {
        let svd = thin_svd(&self.whitened_jacobian());
        svd.map_or(0.0, |svd| svd.left.tr_mul(residual).norm_squared())
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
    /// Simulator, the record's input, whitening and noise.
    pub test: GateTest<'a>,
    /// The record's features.
    pub observed: &'a DVector<f64>,
    /// Settings.
    pub settings: &'a RefineSettings,
}

/// A θ, and the features simulated there.
struct Local {
    theta: DVector<f64>,
    whitening: Whitening,
    spread: Vec<f64>,
}

impl Refinement<'_> {
    /// Runs it from `initial`.
    pub fn run(&self, initial: &[f64]) -> Result<RefinedEstimate, EstimatorError> {
        let settings = self.settings;
        let steps = settings.starts + settings.rounds;
        let stage = self.test.progress.stage("Gauss–Newton", steps);
        let features = self.mean_features(initial, settings.seeds)?;
        let local = match (settings.starts, settings.rounds) {
            // Nothing to choose from, and little way to go.
            (1, 1) => self.whiten(features.initial.clone())?,
            _ => self.survey(initial, &stage)?,
        };
        let local = self.polish(&features, local, &stage)?;
        stage.finish();
        self.describe(&features, local)
    }

    /// Returns information and directions at `theta` without a search.
    pub fn describe_at(&self, theta: &[f64]) -> Result<RefinedEstimate, EstimatorError> {
        let features = self.mean_features(theta, self.settings.seeds)?;
        let local = self.whiten(features.initial.clone())?;
        self.describe(&features, local)
    }

    /// S^{-1/2}(f̄(θ) − x_obs) with the covariance at θ_GN.
    pub fn whitened_residual(
        &self,
        refined: &RefinedEstimate,
        theta: &[f64],
    ) -> Result<DVector<f64>, EstimatorError> {
        let features = self.mean_features(refined.theta.as_slice(), self.settings.seeds)?;
        let mean = features.at(theta).map_err(not_evaluated)?;
        Ok(refined.whitening.apply(&(mean - self.observed)))
    }

    /// ∂f/∂θ at `theta`, n × d, of a few seeds, each by itself.
    pub fn jacobians_at(&self, theta: &[f64]) -> Result<Vec<DMatrix<f64>>, EstimatorError> {
        let features = self.mean_features(theta, self.settings.centred_seeds)?;
        Ok((features.jacobians(&features.initial)).map_err(not_evaluated)?)
    }

    /// f̄ of so many runs, beside θ_init.
    fn mean_features(&self, initial: &[f64], seeds: usize) -> Result<MeanFeatures<'_>, MathError> {
        let space = self.test.simulator.twin().parameters();
        let side = |end: fn(Interval) -> f64| {
            DVector::from_iterator(space.len(), space.iter().map(|p| end(p.bounds)))
        };
        Ok(MeanFeatures {
            refinement: self,
            seeds,
            initial: DVector::from_vec(space.clamp(initial)),
            widths: DVector::from_vec(space.widths()),
            bounds: Bounds::new(side(Interval::low), side(Interval::high))?,
        })
    }

    /// The best of several starts: θ_init, then space-filling points in the bounds.
    fn survey(&self, initial: &[f64], stage: &Stage) -> Result<Local, EstimatorError> {
        let features = self.mean_features(initial, self.settings.survey_seeds)?;
        let others = space_filling(&features.bounds, self.settings.starts - 1, 0);
        let (mut best, mut last): (Option<(f64, Local)>, _) = (None, String::new());
        for start in [features.initial.clone()].into_iter().chain(others) {
            match self.climb(&features, start) {
                // Ties and equals go to the earlier start: θ_init comes first.
                Ok(found) if best.as_ref().is_none_or(|best| found.0 > best.0) => {
                    best = Some(found);
                }
                Ok(_) => {}
                Err(error) if is_fatal(&error) => return Err(error),
                Err(error) => last = error.to_string(),
            }
            stage.tick()?;
        }
        let starts = self.settings.starts;
        best.map(|(_, local)| local).ok_or_else(|| {
            EstimatorError::Undetermined(format!(
                "Gauss–Newton found no estimate from {starts} starts: {last}; widen the bounds or check the twin"
            ))
        })
    }

    /// One start: whiten there, descend, whiten at the end, score.
    fn climb(
        &self,
        features: &MeanFeatures<'_>,
        start: DVector<f64>,
    ) -> Result<(f64, Local), EstimatorError> {
        let local = self.whiten(start)?;
        let local = self.whiten(self.descend(features, &local)?)?;
        let residual = features.whitened(&local.whitening).residual(&local.theta);
        let square = residual.map_err(not_evaluated)?.norm_squared();
        Ok((-0.5 * (square + local.whitening.log_determinant()), local))
    }

    /// Descends on from the best start with all seeds, simulating S again until θ rests.
    fn polish(
        &self,
        features: &MeanFeatures<'_>,
        mut local: Local,
        stage: &Stage,
    ) -> Result<Local, EstimatorError> {
        for _ in 0..self.settings.rounds {
            let theta = self.descend(features, &local)?;
            let moved = (&theta - &local.theta).component_div(&features.widths);
            // A single round stays so near that S does.
            local = match self.settings.rounds {
                1 => Local { theta, ..local },
                _ => self.whiten(theta)?,
            };
            stage.tick()?;
            if moved.amax() < BUDGET.at_rest {
                break;
            }
        }
        Ok(local)
    }

    fn descend(
        &self,
        features: &MeanFeatures<'_>,
        from: &Local,
    ) -> Result<DVector<f64>, MathError> {
        let search = GaussNewton {
            max_iterations: self.settings.iterations,
            relative_cutoff: self.settings.cutoff,
            tolerance: 1e-6,
            step_tolerance: 1e-5,
            // A step over half the prior's width leaves what the Jacobian knows.
            max_step: Some(0.5),
        };
        let problem = features.whitened(&from.whitening);
        let end = search.minimise(&problem, &from.theta, &features.bounds, &features.widths)?;
        Ok(end.theta)
    }

    /// S at `theta`, from the same noise everywhere.
    fn whiten(&self, theta: DVector<f64>) -> Result<Local, EstimatorError> {
        let test = &self.test;
        let size = test.settings.whitening_simulations(test.simulator.dim());
        let stage = test.progress.unshown().stage("whitening", 0);
        let features = test.repeat(theta.as_slice(), size, "whitening", &stage)?;
        let whitening = whiten(test.settings, &features)?;
        let squares = whitening.squared_distances(&features);
        Ok(Local {
            theta,
            whitening,
            spread: squares.iter().map(|s| s.sqrt()).collect(),
        })
    }

    /// Everything around the estimate.
    fn describe(
        &self,
        features: &MeanFeatures<'_>,
        local: Local,
    ) -> Result<RefinedEstimate, EstimatorError> {
        let Local {
            theta,
            whitening,
            spread,
        } = local;
        let mut jacobian = features.jacobian(&theta).map_err(not_evaluated)?;
        for (mut column, width) in jacobian.column_iter_mut().zip(&features.widths) {
            column *= *width;
        }
        let mean = features.at(theta.as_slice()).map_err(not_evaluated)?;
        let residual = whitening.apply(&(mean - self.observed));
        let information = FeatureInformation::new(
            &whitening.apply_columns(&jacobian),
            &self.test.simulator.twin().parameters(),
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

impl From<EstimatorError> for MathError {
    fn from(error: EstimatorError) -> Self {
        match error {
            EstimatorError::Rejected(reason) => Self::rejected(reason),
            error => Self::fatal(error),
        }
    }
}

/// f̄(θ), the mean of the features over runs of fixed seeds, and its derivatives by paired differences.
struct MeanFeatures<'a> {
    refinement: &'a Refinement<'a>,
    /// Runs that f̄ averages.
    seeds: usize,
    /// θ_init.
    initial: DVector<f64>,
    /// Widths of the prior.
    widths: DVector<f64>,
    bounds: Bounds,
}

impl MeanFeatures<'_> {
    fn noise(&self, seed: u64) -> Noise {
        self.refinement
            .test
            .noise
            .child("mean features")
            .sample(seed)
    }

    /// f̄(θ).
    fn at(&self, theta: &[f64]) -> Result<DVector<f64>, MathError> {
        let &GateTest {
            simulator,
            drive,
            progress,
            ..
        } = &self.refinement.test;
        progress.checkpoint().map_err(MathError::fatal)?;
        Ok(simulator.mean_features(theta, drive, |seed| self.noise(seed), self.seeds)?)
    }

    fn stencil(&self, theta: &DVector<f64>) -> Result<Stencil, MathError> {
        let steps = &self.widths * self.refinement.settings.step;
        let [lower, upper] = [self.bounds.lower(), self.bounds.upper()].map(DVector::as_slice);
        Stencil::new(theta.as_slice(), steps.as_slice(), lower, upper)
    }

    /// ∂f/∂θ of each seed by itself.
    fn jacobians(&self, theta: &DVector<f64>) -> Result<Vec<DMatrix<f64>>, MathError> {
        let stencil = self.stencil(theta)?;
        let &GateTest {
            simulator,
            drive,
            progress,
            ..
        } = &self.refinement.test;
        let one = |seed: u64| {
            progress.checkpoint().map_err(MathError::fatal)?;
            let all: Vec<_> = (stencil.points().iter())
                .map(|point| (&point[..], drive, self.noise(seed)))
                .collect();
            let values: Vec<DVector<f64>> = (simulator.features(&all).into_iter())
                .map(|features| Ok(DVector::from_vec(features?)))
                .collect::<Result<_, EstimatorError>>()?;
            Ok(stencil.assemble(&values))
        };
        try_each(0..self.seeds as u64, one)
    }

    /// ∂f̄/∂θ: the same seeds on both sides of θ.
    fn jacobian(&self, theta: &DVector<f64>) -> Result<DMatrix<f64>, MathError> {
        let stencil = self.stencil(theta)?;
        let values = try_each(stencil.points(), |point| self.at(point))?;
        Ok(stencil.assemble(&values))
    }

    fn whitened<'a>(&'a self, whitening: &'a Whitening) -> FeatureResidual<'a> {
        let features = self;
        FeatureResidual {
            features,
            whitening,
        }
    }

    /// √γ.
    fn pull(&self) -> f64 {
        self.refinement.settings.pull.sqrt()
    }
}

/// r(θ) = [ S^{-1/2}(f̄(θ) − x_obs) ;  √γ·(θ − θ_init)/width ].
struct FeatureResidual<'a> {
    features: &'a MeanFeatures<'a>,
    whitening: &'a Whitening,
}

impl ResidualProblem for FeatureResidual<'_> {
    fn dimension(&self) -> usize {
        self.features.initial.len()
    }

    fn residual(&self, theta: &DVector<f64>) -> Result<DVector<f64>, MathError> {
        let features = self.features;
        let mean = features.at(theta.as_slice())?;
        let misfit = self.whitening.apply(&(mean - features.refinement.observed));
        let off = (theta - &features.initial).component_div(&features.widths);
        let prior = off * features.pull();
        let rows = misfit.iter().chain(prior.iter()).copied();
        Ok(DVector::from_iterator(misfit.len() + prior.len(), rows))
    }

    fn jacobian(&self, theta: &DVector<f64>) -> Result<DMatrix<f64>, MathError> {
        let jacobian = self.features.jacobian(theta)?;
        let whitened = self.whitening.apply_columns(&jacobian);
        let (n, d) = whitened.shape();
        let mut all = whitened.resize_vertically(n + d, 0.0);
        for j in 0..d {
            all[(n + j, j)] = self.features.pull() / self.features.widths[j];
        }
        Ok(all)
    }
}

#[cfg(test)]
mod tests;
