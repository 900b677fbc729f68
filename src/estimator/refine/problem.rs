//! The residual that Gauss–Newton makes small, and its Jacobian by paired differences.

use crate::estimator::bank::FeatureSimulator;
use crate::estimator::error::EstimatorError;
use crate::fit::least_squares::ResidualProblem;
use crate::math::{MathError, Stencil, Whitening};
use crate::progress::Progress;
use crate::record::Drive;
use crate::twin::Noise;
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

/// r(θ) = [ S^{-1/2}(f̄(θ) − x_obs) ;  √γ·(θ − θ_init)/width ].
pub(super) struct FeatureResidual<'a> {
    pub simulator: &'a FeatureSimulator,
    pub drive: &'a Drive,
    pub observed: &'a DVector<f64>,
    pub noise: Noise,
    pub progress: &'a Progress,
    pub seeds: usize,
    /// Set before the residual is asked for.
    pub whitening: Option<Whitening>,
    /// √γ.
    pub pull: f64,
    pub initial: DVector<f64>,
    pub widths: DVector<f64>,
    pub steps: Vec<f64>,
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
    /// f̄(θ).
    pub fn mean_features(&self, theta: &DVector<f64>) -> Result<DVector<f64>, MathError> {
        self.progress.checkpoint().map_err(MathError::fatal)?;
        let noise = |i| self.noise.sample(i);
        let mean =
            (self.simulator).mean_features(theta.as_slice(), self.drive, noise, self.seeds)?;
        Ok(mean)
    }

    /// ∂f/∂θ of each seed by itself.
    pub fn jacobians(&self, theta: &DVector<f64>) -> Result<Vec<DMatrix<f64>>, MathError> {
        let stencil = Stencil::new(theta.as_slice(), &self.steps, &self.lower, &self.upper)?;
        let one = |seed: u64| {
            self.progress.checkpoint().map_err(MathError::fatal)?;
            let points = stencil.points();
            let noise = self.noise.sample(seed);
            let all: Vec<_> = (points.iter())
                .map(|point| (&point[..], self.drive, noise))
                .collect();
            let found = self.simulator.features(&all).into_iter();
            let values: Vec<DVector<f64>> = found
                .map(|features| Ok(DVector::from_vec(features?)))
                .collect::<Result<_, EstimatorError>>()?;
            Ok(stencil.assemble(&values))
        };
        (0..self.seeds as u64).into_par_iter().map(one).collect()
    }

    /// ∂f̄/∂θ: the same seeds on both sides of θ.
    pub fn feature_jacobian(&self, theta: &DVector<f64>) -> Result<DMatrix<f64>, MathError> {
        let stencil = Stencil::new(theta.as_slice(), &self.steps, &self.lower, &self.upper)?;
        let values: Vec<DVector<f64>> = (stencil.points().par_iter())
            .map(|point| self.mean_features(&DVector::from_column_slice(point)))
            .collect::<Result<_, _>>()?;
        Ok(stencil.assemble(&values))
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
            .apply(&(self.mean_features(theta)? - self.observed));
        let prior = (theta - &self.initial).component_div(&self.widths) * self.pull;
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
            all[(n + j, j)] = self.pull / self.widths[j];
        }
        Ok(all)
    }
}
