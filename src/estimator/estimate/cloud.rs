//! The cloud of fresh simulations around an estimate, which the heads are tuned on.
//!
//! Another sampler is a function here, its variant of [`CloudSampler`] and its arm in [`sampler`].
//!
//! Source of all but the box: Lakshminarayanan, Guerrero & Rojas, section IV-B.

use super::EstimateRun;
use crate::estimator::bank::{Draws, FeatureSimulator};
use crate::estimator::budget::BUDGET;
use crate::estimator::error::EstimatorError;
use crate::estimator::refine::RefinedEstimate;
use crate::estimator::settings::CloudSampler;
use crate::fit::posterior::PosteriorRegion;
use crate::math::{MathError, median, principal_axes};
use crate::twin::{Interval, Noise, Parameter, ParameterSpace};
use nalgebra::{DMatrix, DVector};
use std::borrow::Cow;

/// Draws parameters around an estimate: draw number i depends on i and on its noise alone. Bounds are ignored: the cloud rejects
/// draws outside, draws again with other noise, and counts them.
type Sampler = Box<dyn Fn(u64, Noise) -> DVector<f64> + Send + Sync>;

/// The sampler of this kind around an estimate, `spread` times as wide as its covariance says.
fn sampler(
    kind: CloudSampler,
    refined: &RefinedEstimate,
    space: &ParameterSpace,
    spread: f64,
) -> Result<Sampler, EstimatorError> {
    let centre = &refined.theta;
    let widths = DVector::from_vec(space.widths());
    let ellipsoid = || {
        let information = &refined.information.matrix / spread.powi(2);
        ellipsoid(centre, &widths, information)
    };
    let sensitivity = || {
        let jacobian = refined.whitened_jacobian();
        let length = median(&refined.spread).unwrap_or(1.0) * refined.residual.norm();
        let radius = |(j, p): (usize, &Parameter)| {
            // An insensitive parameter gives an infinite radius.
            let sensitivity = jacobian.column(j).norm().max(f64::MIN_POSITIVE);
            (length / sensitivity * widths[j]).min(0.5 * p.start_range().width())
        };
        sensitivity(centre, space.iter().enumerate().map(radius).collect())
    };
    Ok(match kind {
        CloudSampler::Ellipsoid => ellipsoid()?,
        CloudSampler::Sensitivity => sensitivity(),
        CloudSampler::Box => {
            let axes = principal_axes(refined.information.covariance.clone());
            let axes = DMatrix::from_diagonal(&widths) * axes;
            in_box(centre.as_slice(), &axes, spread)
        }
        CloudSampler::Hybrid => {
            let (even, odd) = (ellipsoid()?, sensitivity());
            Box::new(move |index, noise| match index.is_multiple_of(2) {
                true => even(index, noise),
                false => odd(index, noise),
            })
        }
    })
}

/// Gaussian draws whose covariance is the inverse of an information matrix G = L Lᵀ (d × d) of θ over its widths w:
///
/// ```text
/// θ = centre + w ⊙ L⁻ᵀ z,   z ~ N(0, I),   so that   Cov (θ ⊘ w) = G⁻¹
/// ```
///
/// `δᵀ G δ` of δ = (θ − centre) ⊘ w follows χ² with d degrees of freedom.
fn ellipsoid(
    centre: &DVector<f64>,
    widths: &DVector<f64>,
    information: DMatrix<f64>,
) -> Result<Sampler, EstimatorError> {
    let singular = || MathError::fatal("the information is not positive definite");
    let factor = information.cholesky().ok_or_else(singular)?;
    // L⁻¹; a Cholesky factor has a positive diagonal.
    let identity = DMatrix::identity(centre.len(), centre.len());
    let inverse = factor.l_dirty().solve_lower_triangular(&identity);
    let (inverse, centre) = (inverse.ok_or_else(singular)?, centre.clone());
    let widths = widths.clone();
    Ok(Box::new(move |_, noise| {
        let mut source = noise.source("ellipsoid");
        let z = DVector::from_fn(centre.len(), |_, _| source.normal());
        &centre + inverse.tr_mul(&z).component_mul(&widths)
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
            BUDGET.box_reach * spread * (2.0 * source.uniform() - 1.0)
        });
        &centre + &axes * u
    })
}

impl EstimateRun<'_> {
    /// Simulates M_FT draws around Gauss–Newton's estimate, or in the region where the record puts θ, under the record's own input, and some
    /// more for calibration; row i depends on the seed and i alone.
    pub(super) fn cloud(
        &self,
        simulator: &FeatureSimulator,
        refined: &RefinedEstimate,
        region: Option<&PosteriorRegion>,
    ) -> Result<Draws, EstimatorError> {
        let settings = &self.settings.cloud;
        let (space, spread) = (simulator.twin().parameters(), settings.spread);
        let sampler = match region {
            Some(region) => in_box(&region.theta, &region.axes, spread),
            None => sampler(settings.sampler, refined, &space, spread)?,
        };
        let size = settings.draws(space.len());
        let size = size + (size / BUDGET.cloud_calibration).max(BUDGET.least_cloud_calibration);
        let stage = self.progress.stage("cloud", size);
        let draw = |i, attempt, noise| {
            let mut theta = sampler(i, noise).as_slice().to_vec();
            if attempt >= BUDGET.redraws {
                reflect(&mut theta, &space.bounds());
            }
            let is_inside = space.check_point(&theta).is_ok();
            Ok(is_inside.then_some((theta, Cow::Borrowed(self.record.drive()))))
        };
        let noise = self.noise.child("cloud");
        simulator.draws(0..size as u64, |i| noise.sample(i), draw, &stage)
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
        let widths = DVector::from_vec(vec![2.0, 1e-200]);
        let sampler = ellipsoid(&DVector::zeros(2), &widths, information.clone()).unwrap();
        let mut distance: Vec<f64> = draws(&sampler, n)
            .map(|theta| theta.component_div(&widths))
            .map(|off| (off.transpose() * &information * off)[0])
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
        let (n, sampler) = (6000, in_box(&[0.0; 2], &axes, 3.0 / BUDGET.box_reach));
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
