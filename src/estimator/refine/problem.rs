//! The residual that Gauss–Newton makes small, and its Jacobian by paired differences.

use super::Refinement;
use crate::estimator::error::EstimatorError;
use crate::fit::least_squares::{Bounds, ResidualProblem};
use crate::math::{MathError, Stencil, Whitening};
use crate::twin::Noise;
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

/// r(θ) = [ S^{-1/2}(f̄(θ) − x_obs) ;  √γ·(θ − θ_init)/width ].
pub(super) struct FeatureResidual<'a> {
    pub refinement: &'a Refinement<'a>,
    /// Runs that f̄ averages.
    pub seeds: usize,
    /// Set before the residual is asked for.
    pub whitening: Option<Whitening>,
    /// θ_init.
    pub initial: DVector<f64>,
    /// Widths of the prior.
    pub widths: DVector<f64>,
    pub lower: Vec<f64>,
    pub upper: Vec<f64>,
}

impl From<EstimatorError> for MathError {
    fn from(error: EstimatorError) -> Self {
        match error {
            EstimatorError::Rejected(reason) => Self::rejected(reason),
            error => Self::fatal(error),
        }
    }
}

impl FeatureResidual<'_> {
    /// Bounds of θ, as the search takes them.
    pub fn bounds(&self) -> Result<Bounds, MathError> {
        let [lower, upper] =
            [&self.lower, &self.upper].map(|side| DVector::from_column_slice(side));
        Bounds::new(lower, upper)
    }

    fn noise(&self) -> Noise {
        self.refinement.noise.child("mean features")
    }

    /// f̄(θ).
    pub fn mean_features(&self, theta: &DVector<f64>) -> Result<DVector<f64>, MathError> {
        let Refinement {
            simulator,
            drive,
            progress,
            ..
        } = self.refinement;
        progress.checkpoint().map_err(MathError::fatal)?;
        let noise = self.noise();
        let sample = |i| noise.sample(i);
        Ok(simulator.mean_features(theta.as_slice(), drive, sample, self.seeds)?)
    }

    fn stencil(&self, theta: &DVector<f64>) -> Result<Stencil, MathError> {
        let steps = &self.widths * self.refinement.settings.step;
        let (lower, upper) = (&self.lower, &self.upper);
        Stencil::new(theta.as_slice(), steps.as_slice(), lower, upper)
    }

    /// ∂f/∂θ of each seed by itself.
    pub fn jacobians(&self, theta: &DVector<f64>) -> Result<Vec<DMatrix<f64>>, MathError> {
        let (stencil, noise) = (self.stencil(theta)?, self.noise());
        let &Refinement {
            simulator,
            drive,
            progress,
            ..
        } = self.refinement;
        let one = |seed: u64| {
            progress.checkpoint().map_err(MathError::fatal)?;
            let all: Vec<_> = (stencil.points().iter())
                .map(|point| (&point[..], drive, noise.sample(seed)))
                .collect();
            let values: Vec<DVector<f64>> = (simulator.features(&all).into_iter())
                .map(|features| Ok(DVector::from_vec(features?)))
                .collect::<Result<_, EstimatorError>>()?;
            Ok(stencil.assemble(&values))
        };
        (0..self.seeds as u64).into_par_iter().map(one).collect()
    }

    /// ∂f̄/∂θ: the same seeds on both sides of θ.
    pub fn feature_jacobian(&self, theta: &DVector<f64>) -> Result<DMatrix<f64>, MathError> {
        let stencil = self.stencil(theta)?;
        let values: Vec<DVector<f64>> = (stencil.points().par_iter())
            .map(|point| self.mean_features(&DVector::from_column_slice(point)))
            .collect::<Result<_, _>>()?;
        Ok(stencil.assemble(&values))
    }

    /// √γ.
    fn pull(&self) -> f64 {
        self.refinement.settings.pull.sqrt()
    }

    fn whitening(&self) -> Result<&Whitening, MathError> {
        (self.whitening.as_ref()).ok_or_else(|| MathError::fatal("no covariance was simulated"))
    }
}

impl ResidualProblem for FeatureResidual<'_> {
    fn dimension(&self) -> usize {
        self.initial.len()
    }

    fn residual(&self, theta: &DVector<f64>) -> Result<DVector<f64>, MathError> {
        let misfit = self
            .whitening()?
            .apply(&(self.mean_features(theta)? - self.refinement.observed));
        let prior = (theta - &self.initial).component_div(&self.widths) * self.pull();
        let rows = misfit.iter().chain(prior.iter()).copied();
        Ok(DVector::from_iterator(misfit.len() + prior.len(), rows))
    }

    fn jacobian(&self, theta: &DVector<f64>) -> Result<DMatrix<f64>, MathError> {
        let whitened = self
            .whitening()?
            .apply_columns(&self.feature_jacobian(theta)?);
        let (n, d) = whitened.shape();
        let mut all = whitened.resize_vertically(n + d, 0.0);
        for j in 0..d {
            all[(n + j, j)] = self.pull() / self.widths[j];
        }
        Ok(all)
    }
}
