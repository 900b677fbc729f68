//! Where the cloud of fresh simulations around an estimate is drawn from: one sampler a file.
//!
//! Another one is a file, its `mod`, its variant of [`CloudSampler`] and its arm in [`CloudSampler::around`].

mod eigenbox;
mod ellipsoid;
mod hybrid;
mod sampler;
mod sensitivity;

pub use eigenbox::EigenBox;
pub use sampler::Sampler;

use crate::estimator::error::EstimatorError;
use crate::estimator::refine::Refined;
use crate::math::median;
use crate::twin::ParameterSpace;
use ellipsoid::Ellipsoid;
use hybrid::Hybrid;
use nalgebra::{DMatrix, SymmetricEigen};
use sensitivity::Sensitivity;
use serde::{Deserialize, Serialize};

/// Sampler of the cloud.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum CloudSampler {
    /// The confidence ellipsoid alone.
    #[default]
    Ellipsoid,
    /// Along sensitivities alone.
    Sensitivity,
    /// The paper's alternation of both.
    Hybrid,
    /// Uniform in the box of the principal axes, ±1.8·`spread` standard deviations: flat over the region.
    Box,
}

impl CloudSampler {
    /// This sampler around an estimate, `spread` times as wide as its covariance says.
    pub(crate) fn around(
        self,
        refined: &Refined,
        space: &ParameterSpace,
        spread: f64,
    ) -> Result<Box<dyn Sampler>, EstimatorError> {
        let centre = refined.theta.clone();
        let ellipsoid = || {
            let information = &refined.information.matrix / spread.powi(2);
            Ellipsoid::new(centre.clone(), information)
        };
        let sensitivity = || {
            let jacobian = refined.whitened_jacobian();
            let sensitivities: Vec<f64> = jacobian.column_iter().map(|c| c.norm()).collect();
            let typical = median(&refined.spread).unwrap_or(1.0);
            let reach: Vec<f64> = (space.iter())
                .map(|p| 0.5 * p.start_range().width())
                .collect();
            let length = typical * refined.residual.norm();
            Sensitivity::new(centre.clone(), &sensitivities, length, &reach)
        };
        Ok(match self {
            Self::Ellipsoid => Box::new(ellipsoid()?),
            Self::Sensitivity => Box::new(sensitivity()),
            Self::Box => {
                let eigen = SymmetricEigen::new(refined.information.covariance.clone());
                let lengths = eigen.eigenvalues.map(|v| v.max(0.0).sqrt());
                let axes = eigen.eigenvectors * DMatrix::from_diagonal(&lengths);
                Box::new(EigenBox::of_spread(centre.as_slice(), &axes, spread))
            }
            Self::Hybrid => Box::new(Hybrid::new(ellipsoid()?, sensitivity())),
        })
    }
}
