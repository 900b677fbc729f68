//! The cloud of fresh simulations around θ_GN.

use super::EstimateError;
use crate::bank::{Draw, Draws, FeatureSimulator};
use crate::feature::Centred;
use crate::math::median;
use crate::progress::Progress;
use crate::refine::Refined;
use crate::sample::{EigenBox, Ellipsoid, Hybrid, Sampler, Sensitivity};
use crate::study::{CloudSampler, Settings};
use crate::twin::{Drive, Interval, Noise, ParameterSpace};
use nalgebra::{DMatrix, DVector, SymmetricEigen};
use std::borrow::Cow;

/// Draws out of bounds before a draw is reflected at them: where the estimate lies in a corner of many dimensions, hardly
/// any draw falls inside by itself.
const REDRAWS: usize = 10;

/// Part of the cloud that is simulated beyond M_FT, to measure the error of the tuned heads, and its least size.
const CALIBRATION_SHARE: usize = 5;
const CALIBRATION: usize = 200;

/// Where a cloud is drawn.
pub struct Around<'a> {
    /// Twin and features.
    pub simulator: &'a FeatureSimulator,
    /// The record's input.
    pub drive: &'a Drive,
    /// Gauss–Newton's estimate.
    pub refined: &'a Refined,
    /// Where the features themselves put θ, if they can tell.
    pub region: Option<&'a Centred>,
    /// Settings.
    pub settings: &'a Settings,
}

/// The cloud: M_FT simulations around the estimate under the record's own input, and some more for calibration; row i
/// depends on the seed and i alone.
pub fn cloud(
    around: &Around<'_>,
    noise: Noise,
    progress: &Progress,
) -> Result<Draws, EstimateError> {
    let Around {
        simulator,
        drive,
        settings,
        ..
    } = *around;
    let space = simulator.twin().parameters();
    let sampler = sampler(&space, around)?;
    let size = settings.cloud.draws(space.len());
    let size = size + (size / CALIBRATION_SHARE).max(CALIBRATION);
    let stage = progress.stage("cloud", size);
    let draws = simulator.draws(
        0..size as u64,
        |i| noise.sample(i),
        |i, attempt, noise| {
            let mut theta = sampler.draw(i, noise).as_slice().to_vec();
            if attempt >= REDRAWS {
                reflect(&mut theta, &space.bounds());
            }
            Ok(space.check_point(&theta).is_ok().then_some(Draw {
                theta,
                drive: Cow::Borrowed(drive),
            }))
        },
        &stage,
    )?;
    Ok(draws)
}

/// Folds each value into its bounds, as light between two mirrors.
fn reflect(theta: &mut [f64], bounds: &[Interval]) {
    for (value, bounds) in theta.iter_mut().zip(bounds) {
        let width = bounds.width();
        let phase = (*value - bounds.low()).rem_euclid(2.0 * width);
        let inside = bounds.low()
            + if phase > width {
                2.0 * width - phase
            } else {
                phase
            };
        // Rounding may leave the box by a bit.
        *value = bounds.clamp(inside);
    }
}

/// Half-width of the box, in standard deviations of a cloud of spread 1.
const BOX_REACH: f64 = 1.8;

/// The sampler of the settings around the estimate.
fn sampler(space: &ParameterSpace, around: &Around<'_>) -> Result<Box<dyn Sampler>, EstimateError> {
    let Around {
        refined, settings, ..
    } = *around;
    let reach = BOX_REACH * settings.cloud.spread;
    if let Some(region) = around.region {
        let centre = DVector::from_column_slice(&region.theta);
        return Ok(Box::new(EigenBox::new(centre, region.axes.clone(), reach)));
    }
    let centre = refined.theta.clone();
    let ellipsoid = || {
        let information = &refined.information.matrix / settings.cloud.spread.powi(2);
        Ellipsoid::new(centre.clone(), information)
    };
    let sensitivity = || {
        let jacobian = refined.whitened_jacobian();
        let sensitivities: Vec<f64> = jacobian.column_iter().map(|c| c.norm()).collect();
        let typical = median(&refined.spread).unwrap_or(1.0);
        let reach: Vec<f64> = space.bounds().iter().map(|b| 0.5 * b.width()).collect();
        let spread = typical * refined.residual.norm();
        Sensitivity::new(centre.clone(), &sensitivities, spread, &reach)
    };
    Ok(match settings.cloud.sampler {
        CloudSampler::Ellipsoid => Box::new(ellipsoid()?),
        CloudSampler::Sensitivity => Box::new(sensitivity()),
        CloudSampler::Box => {
            let eigen = SymmetricEigen::new(refined.information.covariance.clone());
            let lengths = eigen.eigenvalues.map(|v| v.max(0.0).sqrt());
            let axes = eigen.eigenvectors * DMatrix::from_diagonal(&lengths);
            Box::new(EigenBox::new(centre, axes, reach))
        }
        CloudSampler::Hybrid => Box::new(Hybrid::new(ellipsoid()?, sensitivity())),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reflection_ends_inside_and_leaves_the_inside_alone() {
        let bounds = [Interval::new(1.0, 3.0).unwrap(); 5];
        let mut theta = [2.5, 3.5, 0.25, 5.5, -40.0];
        reflect(&mut theta, &bounds);
        assert_eq!(theta[..4], [2.5, 2.5, 1.75, 1.5]);
        assert!(bounds[4].contains(theta[4]));
    }
}
