//! The cloud of fresh simulations around an estimate, which the heads are tuned on.
//!
//! Another sampler is a function here, its variant of [`CloudSampler`] and its arm in [`CloudSampler::around`].
//!
//! Source of all but the box: Lakshminarayanan, Guerrero & Rojas, section IV-B.

use crate::estimator::bank::{Draw, Draws, FeatureSimulator};
use crate::estimator::error::EstimatorError;
use crate::estimator::refine::RefinedEstimate;
use crate::fit::posterior::PosteriorRegion;
use crate::math::{median, principal_axes};
use crate::progress::Progress;
use crate::record::Drive;
use crate::twin::{Interval, Noise, Parameter, ParameterSpace};
use nalgebra::{DMatrix, DVector};
use serde::{Deserialize, Serialize};
use std::borrow::Cow;

/// Half-width of the box, in standard deviations of a cloud of spread 1.
const BOX_REACH: f64 = 1.8;
/// Draws out of bounds before a draw is reflected at them: where the estimate lies in a corner of many dimensions, hardly
/// any draw falls inside by itself.
const REDRAWS: usize = 10;
/// Part of the cloud that is simulated beyond M_FT, to measure the error of the tuned heads, and its least size.
const CALIBRATION_SHARE: usize = 5;
const CALIBRATION: usize = 200;

/// Settings of the cloud.
///
/// | field | default | range | meaning |
/// |---|---|---|---|
/// | `size` | 1000 | ≥ 10 | simulations M_FT, at most |
/// | `per_parameter` | 400 | ≥ 10 | simulations for each parameter, if that is fewer; not in the paper |
/// | `sampler` | ellipsoid | | see [`CloudSampler`] |
/// | `spread` | 2 | > 0 | standard deviations of the ellipsoid over those of the estimate; 1 in the paper |
/// | `quadratic` | true | | a quadratic layer beside the tuned heads; not in the paper |
/// | `rescale` | true | | standardise features and targets anew on the cloud; not in the paper |
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct CloudSettings {
    /// Largest number of simulations.
    pub size: usize,
    /// Simulations for each parameter.
    pub per_parameter: usize,
    /// Where they are drawn.
    pub sampler: CloudSampler,
    /// Scale of the ellipsoid.
    pub spread: f64,
    /// `true` if features and targets are standardised anew on the cloud.
    pub rescale: bool,
    /// `true` if a quadratic layer stands beside the tuned heads.
    pub quadratic: bool,
}

impl Default for CloudSettings {
    fn default() -> Self {
        Self {
            size: 1000,
            per_parameter: 400,
            sampler: CloudSampler::Ellipsoid,
            spread: 2.0,
            rescale: true,
            quadratic: true,
        }
    }
}

impl CloudSettings {
    /// M_FT for `parameters` parameters.
    pub fn draws(&self, parameters: usize) -> usize {
        self.size.min(self.per_parameter.saturating_mul(parameters))
    }
}

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

/// Draws parameters around an estimate: draw number i depends on i and on its noise alone. Bounds are ignored: the cloud rejects
/// draws outside, draws again with other noise, and counts them.
type Sampler = Box<dyn Fn(u64, Noise) -> DVector<f64> + Send + Sync>;

impl CloudSampler {
    /// This sampler around an estimate, `spread` times as wide as its covariance says.
    fn around(
        self,
        refined: &RefinedEstimate,
        space: &ParameterSpace,
        spread: f64,
    ) -> Result<Sampler, EstimatorError> {
        let centre = &refined.theta;
        let ellipsoid = || ellipsoid(centre, &refined.information.matrix / spread.powi(2));
        let sensitivity = || {
            let jacobian = refined.whitened_jacobian();
            let length = median(&refined.spread).unwrap_or(1.0) * refined.residual.norm();
            let radius = |(j, p): (usize, &Parameter)| {
                // An insensitive parameter gives an infinite radius.
                let sensitivity = jacobian.column(j).norm().max(f64::MIN_POSITIVE);
                (length / sensitivity).min(0.5 * p.start_range().width())
            };
            sensitivity(centre, space.iter().enumerate().map(radius).collect())
        };
        Ok(match self {
            Self::Ellipsoid => ellipsoid()?,
            Self::Sensitivity => sensitivity(),
            Self::Box => {
                let axes = principal_axes(refined.information.covariance.clone());
                in_box(centre.as_slice(), &axes, spread)
            }
            Self::Hybrid => {
                let (even, odd) = (ellipsoid()?, sensitivity());
                Box::new(move |index, noise| match index.is_multiple_of(2) {
                    true => even(index, noise),
                    false => odd(index, noise),
                })
            }
        })
    }
}

/// Gaussian draws whose covariance is the inverse of an information matrix G = L Lᵀ (d × d, inverse square units):
///
/// ```text
/// θ = centre + L⁻ᵀ z,   z ~ N(0, I),   so that   Cov θ = G⁻¹
/// ```
///
/// `(θ − centre)ᵀ G (θ − centre)` follows χ² with d degrees of freedom.
fn ellipsoid(centre: &DVector<f64>, information: DMatrix<f64>) -> Result<Sampler, EstimatorError> {
    let singular = || EstimatorError::Cloud("the information is not positive definite".into());
    let factor = information.cholesky().ok_or_else(singular)?;
    // L⁻¹; a Cholesky factor has a positive diagonal.
    let identity = DMatrix::identity(centre.len(), centre.len());
    let inverse = factor.l_dirty().solve_lower_triangular(&identity);
    let (inverse, centre) = (inverse.ok_or_else(singular)?, centre.clone());
    Ok(Box::new(move |_, noise| {
        let mut source = noise.source("ellipsoid");
        let z = DVector::from_fn(centre.len(), |_, _| source.normal());
        &centre + inverse.tr_mul(&z)
    }))
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
fn sensitivity(centre: &DVector<f64>, radii: Vec<f64>) -> Sampler {
    let centre = centre.clone();
    Box::new(move |_, noise| {
        let mut source = noise.source("sensitivity");
        let d = centre.len();
        let axis = ((source.uniform() * d as f64) as usize).min(d - 1);
        let mut theta = centre.clone();
        theta[axis] += radii[axis] * source.normal();
        theta
    })
}

/// θ = centre + A·u, u uniform in ±1.8·`spread`, where the columns of A are principal axes one standard deviation long. A training set
/// that is flat over the region teaches an estimator that is the same everywhere in it.
fn in_box(centre: &[f64], axes: &DMatrix<f64>, spread: f64) -> Sampler {
    let (centre, axes) = (DVector::from_column_slice(centre), axes.clone());
    Box::new(move |_, noise| {
        let mut source = noise.source("box");
        let u = DVector::from_fn(centre.len(), |_, _| {
            BOX_REACH * spread * (2.0 * source.uniform() - 1.0)
        });
        &centre + &axes * u
    })
}

/// Where a cloud is drawn.
pub struct Cloud<'a> {
    /// Twin and features.
    pub simulator: &'a FeatureSimulator,
    /// The record's input.
    pub drive: &'a Drive,
    /// Gauss–Newton's estimate.
    pub refined: &'a RefinedEstimate,
    /// Where the record puts θ, if the features are about its mean.
    pub region: Option<&'a PosteriorRegion>,
    /// Settings.
    pub settings: &'a CloudSettings,
}

impl Cloud<'_> {
    /// Simulates M_FT draws around the estimate under the record's own input, and some more for calibration; row i depends on the seed
    /// and i alone.
    pub fn draw(&self, noise: Noise, progress: &Progress) -> Result<Draws, EstimatorError> {
        let space = self.simulator.twin().parameters();
        let spread = self.settings.spread;
        let sampler = match self.region {
            Some(region) => in_box(&region.theta, &region.axes, spread),
            None => (self.settings.sampler).around(self.refined, &space, spread)?,
        };
        let size = self.settings.draws(space.len());
        let size = size + (size / CALIBRATION_SHARE).max(CALIBRATION);
        let stage = progress.stage("cloud", size);
        let draw = |i, attempt, noise| {
            let mut theta = sampler(i, noise).as_slice().to_vec();
            if attempt >= REDRAWS {
                reflect(&mut theta, &space.bounds());
            }
            Ok(space.check_point(&theta).is_ok().then_some(Draw {
                theta,
                drive: Cow::Borrowed(self.drive),
            }))
        };
        let rows = 0..size as u64;
        (self.simulator).draws(rows, |i| noise.sample(i), draw, &stage)
    }
}

/// Folds each value into its bounds, as light between two mirrors.
fn reflect(theta: &mut [f64], bounds: &[Interval]) {
    for (value, bounds) in theta.iter_mut().zip(bounds) {
        let width = bounds.width();
        let phase = (*value - bounds.low()).rem_euclid(2.0 * width);
        // Rounding may leave the box by a bit.
        *value = bounds.clamp(bounds.low() + phase.min(2.0 * width - phase));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use statrs::distribution::{ChiSquared, ContinuousCDF};

    fn draws(sampler: &Sampler, n: u64) -> impl Iterator<Item = DVector<f64>> {
        (0..n).map(|i| sampler(i, Noise::new(7, "test", i)))
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
        let (n, sampler) = (6000, in_box(&[0.0; 2], &axes, 3.0 / BOX_REACH));
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

    #[test]
    fn reflection_ends_inside_and_leaves_the_inside_alone() {
        let bounds = [Interval::new(1.0, 3.0).unwrap(); 5];
        let mut theta = [2.5, 3.5, 0.25, 5.5, -40.0];
        reflect(&mut theta, &bounds);
        assert_eq!(theta[..4], [2.5, 2.5, 1.75, 1.5]);
        assert!(bounds[4].contains(theta[4]));
    }
}
