//! Where the cloud of fresh simulations around an estimate is drawn from.
//!
//! Another sampler is a function here, its variant of [`CloudSampler`] and its arm in [`CloudSampler::around`].
//!
//! Source of all but the box: Lakshminarayanan, Guerrero & Rojas, section IV-B.

use crate::estimator::error::EstimatorError;
use crate::estimator::refine::Refined;
use crate::math::{median, principal_axes};
use crate::twin::{Noise, ParameterSpace};
use nalgebra::{DMatrix, DVector};
use serde::{Deserialize, Serialize};

/// Half-width of the box, in standard deviations of a cloud of spread 1.
const BOX_REACH: f64 = 1.8;

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
        let centre = &refined.theta;
        let ellipsoid = || ellipsoid(centre, &refined.information.matrix / spread.powi(2));
        let sensitivity = || {
            let jacobian = refined.whitened_jacobian();
            let length = median(&refined.spread).unwrap_or(1.0) * refined.residual.norm();
            let radius = |(j, p): (usize, &crate::twin::Parameter)| {
                // An insensitive parameter gives an infinite radius.
                let sensitivity = jacobian.column(j).norm().max(f64::MIN_POSITIVE);
                (length / sensitivity).min(0.5 * p.start_range().width())
            };
            sensitivity(centre, space.iter().enumerate().map(radius).collect())
        };
        Ok(match self {
            Self::Ellipsoid => Box::new(ellipsoid()?),
            Self::Sensitivity => Box::new(sensitivity()),
            Self::Box => {
                let axes = principal_axes(refined.information.covariance.clone());
                Box::new(EigenBox::of_spread(centre.as_slice(), &axes, spread))
            }
            Self::Hybrid => {
                let (even, odd) = (ellipsoid()?, sensitivity());
                Box::new(move |index: u64, noise| match index.is_multiple_of(2) {
                    true => even(index, noise),
                    false => odd(index, noise),
                })
            }
        })
    }
}

/// Draws parameters around an estimate: draw number `index` depends on it and on `noise` alone.
///
/// A sampler ignores bounds: the cloud rejects draws outside, draws again with other noise, and counts them.
pub trait Sampler: Send + Sync {
    /// Returns draw number `index`.
    fn draw(&self, index: u64, noise: Noise) -> DVector<f64>;
}

impl<F: Fn(u64, Noise) -> DVector<f64> + Send + Sync> Sampler for F {
    fn draw(&self, index: u64, noise: Noise) -> DVector<f64> {
        self(index, noise)
    }
}

/// Gaussian draws whose covariance is the inverse of an information matrix G = L Lᵀ (d × d, inverse square units):
///
/// ```text
/// θ = centre + L⁻ᵀ z,   z ~ N(0, I),   so that   Cov θ = G⁻¹
/// ```
///
/// `(θ − centre)ᵀ G (θ − centre)` follows χ² with d degrees of freedom.
fn ellipsoid(
    centre: &DVector<f64>,
    information: DMatrix<f64>,
) -> Result<impl Fn(u64, Noise) -> DVector<f64> + use<>, EstimatorError> {
    let centre = centre.clone();
    let factor = information
        .cholesky()
        .ok_or_else(|| EstimatorError::Cloud("the information is not positive definite".into()))?;
    Ok(move |_, noise: Noise| {
        let mut source = noise.source("ellipsoid");
        let z = DVector::from_fn(centre.len(), |_, _| source.normal());
        let step = factor.l_dirty().ad_solve_lower_triangular(&z);
        &centre + step.expect("a Cholesky factor has a positive diagonal")
    })
}

/// One parameter at a time, with a spread inverse to its sensitivity, so that directions with little information are
/// explored without an ill-conditioned factor:
///
/// ```text
/// θ = centre + ζ·eᵢ,   i ~ Unif{1 … d},   ζ ~ N(0, rᵢ²),   rᵢ = d_med·Δ_misfit / ‖J eᵢ‖
/// ```
///
/// with the whitened Jacobian J (n × d), the whitened misfit Δ_misfit at the centre and the median whitened distance
/// d_med of simulations from their mean. A radius never exceeds the half-width of the parameter's bounds: beyond it
/// every draw would be rejected.
fn sensitivity(
    centre: &DVector<f64>,
    radii: Vec<f64>,
) -> impl Fn(u64, Noise) -> DVector<f64> + use<> {
    let centre = centre.clone();
    move |_, noise: Noise| {
        let mut source = noise.source("sensitivity");
        let d = centre.len();
        let axis = ((source.uniform() * d as f64) as usize).min(d - 1);
        let mut theta = centre.clone();
        theta[axis] += radii[axis] * source.normal();
        theta
    }
}

/// θ = centre + A·u, u uniform in [−reach, reach]^d, where the columns of A are principal axes one standard deviation
/// long. A training set that is flat over the region teaches an estimator that is the same everywhere in it.
#[derive(Debug, Clone)]
pub struct EigenBox {
    centre: DVector<f64>,
    axes: DMatrix<f64>,
    reach: f64,
}

impl EigenBox {
    /// The box of a cloud of this spread around `centre`; `axes` are d × d, in parameter units.
    pub fn of_spread(centre: &[f64], axes: &DMatrix<f64>, spread: f64) -> Self {
        Self {
            centre: DVector::from_column_slice(centre),
            axes: axes.clone(),
            reach: BOX_REACH * spread,
        }
    }
}

impl Sampler for EigenBox {
    fn draw(&self, _: u64, noise: Noise) -> DVector<f64> {
        let mut source = noise.source("box");
        let u = DVector::from_fn(self.centre.len(), |_, _| {
            self.reach * (2.0 * source.uniform() - 1.0)
        });
        &self.centre + &self.axes * u
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use statrs::distribution::{ChiSquared, ContinuousCDF};

    fn draws(sampler: &dyn Sampler, n: u64) -> impl Iterator<Item = DVector<f64>> {
        (0..n).map(|i| sampler.draw(i, Noise::new(7, "test", i)))
    }

    /// The squared distance is χ²_d: the empirical and exact distributions differ by less than the Kolmogorov–Smirnov bound at 1e-4.
    #[test]
    fn squared_distance_in_the_ellipsoid_is_chi_squared() {
        let (n, information) = (
            4000,
            DMatrix::from_row_slice(2, 2, &[50.0, -30.0, -30.0, 20.0]),
        );
        let sampler = ellipsoid(&DVector::zeros(2), information.clone()).unwrap();
        let mut distance: Vec<f64> = draws(&sampler, n)
            .map(|theta| (theta.transpose() * &information * theta)[0])
            .collect();
        distance.sort_by(f64::total_cmp);
        let exact = ChiSquared::new(2.0).unwrap();
        let gap = (distance.iter().enumerate())
            .map(|(i, s)| (exact.cdf(*s) - (i as f64 + 0.5) / n as f64).abs())
            .fold(0.0, f64::max);
        assert!(gap < 2.23 / (n as f64).sqrt(), "Kolmogorov–Smirnov {gap}");
    }

    /// A uniform variable on [−r, r] has variance r²/3; axes carry it over.
    #[test]
    fn covariance_of_the_box_follows_the_axes() {
        let axes = DMatrix::from_row_slice(2, 2, &[2.0, -0.5, 1.0, 1.0]);
        let (n, sampler) = (6000, EigenBox::of_spread(&[0.0; 2], &axes, 3.0 / BOX_REACH));
        let mut covariance = DMatrix::zeros(2, 2);
        for theta in draws(&sampler, n) {
            covariance += &theta * theta.transpose() / n as f64;
        }
        let exact = &axes * axes.transpose() * 3.0;
        assert!((covariance - &exact).amax() < 0.05 * exact.amax());
    }

    #[test]
    fn each_axis_in_turn_with_its_own_spread() {
        let radii = [0.5, 2.0, 4.0];
        let sampler = sensitivity(&DVector::zeros(3), radii.to_vec());
        let (mut count, mut square) = ([0.0; 3], [0.0; 3]);
        for theta in draws(&sampler, 6000) {
            let axis = theta.iter().position(|v| *v != 0.0).unwrap();
            assert_eq!(theta.iter().filter(|v| **v != 0.0).count(), 1);
            count[axis] += 1.0;
            square[axis] += theta[axis].powi(2);
        }
        for j in 0..3 {
            // Binomial sd of a third of 6000: 36; relative sd of a variance from 2000: 0.032.
            assert!((count[j] - 2000.0f64).abs() < 160.0, "{count:?}");
            let ratio = square[j] / count[j] / radii[j].powi(2);
            assert!((ratio - 1.0).abs() < 0.15, "axis {j}: {ratio}");
        }
    }
}
