//! The cloud around θ_GN, and heads tuned on it.

use super::estimate::INTERVAL_LEVEL;
use super::estimator::one_row;
use super::{Calibration, EstimateError, Estimator, Scaler, Spread};
use crate::bank::{Draw, Draws, FeatureSimulator};
use crate::feature::Centred;
use crate::math::median;
use crate::network::{History, Network, Training};
use crate::progress::Progress;
use crate::refine::Refined;
use crate::sample::{EigenBox, Ellipsoid, Hybrid, Sampler, Sensitivity};
use crate::study::{CloudSampler, Settings};
use crate::twin::{Drive, Interval, Noise, ParameterSpace};
use nalgebra::{DMatrix, DVector, SymmetricEigen};
use ndarray::{Array2, s};
use std::borrow::Cow;
use std::sync::Arc;

/// Heads tuned to one record.
#[derive(Debug, Clone)]
pub struct Tuned {
    /// θ_fine, within the bounds.
    pub theta: Vec<f64>,
    /// Errors to expect, measured on a part of the cloud that the heads never saw.
    pub spread: Option<Spread>,
    /// Tuned network; its trunk is the pretrained one's.
    pub network: Arc<dyn Network>,
    /// Losses.
    pub history: History,
}

/// Draws out of bounds before a draw is reflected at them: where the estimate lies in a corner of many dimensions, hardly
/// any draw falls inside by itself.
const REDRAWS: usize = 10;

/// Part of the cloud that is simulated beyond M_FT, to measure the error of the tuned heads.
const CALIBRATION_SHARE: usize = 5;

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

/// The cloud: M_FT simulations around the estimate under the record's own input, and a fifth more for calibration; row i
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
    let size = settings.cloud.size + settings.cloud.size / CALIBRATION_SHARE;
    let stage = progress.stage("cloud", size);
    let draws = simulator.draws(
        size,
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

/// Tunes the heads on a cloud, the trunk frozen, and reads the record with them.
///
/// Each target's weight is w_j = d·G_jj/Σ G_kk, with G in the units that the targets are standardised in.
///
/// Source: Lakshminarayanan, Guerrero & Rojas, section IV-C.
pub fn tune(
    estimator: &Estimator,
    draws: &Draws,
    refined: &Refined,
    observed: &DVector<f64>,
    settings: &Settings,
    seed: u64,
    progress: &Progress,
) -> Result<Tuned, EstimateError> {
    let size = settings.cloud.size.min(draws.theta.nrows());
    let rows = |all: &Array2<f64>, from: usize, to: usize| all.slice(s![from..to, ..]).to_owned();
    let (features, theta) = (rows(&draws.features, 0, size), rows(&draws.theta, 0, size));
    // On a cloud that is small against the prior, features and targets standardised as in pretraining are all but
    // constant, and the heads learn little.
    let (inputs, targets) = if settings.cloud.rescale {
        (Scaler::fit(&features), Scaler::fit(&theta))
    } else {
        (estimator.features.clone(), estimator.targets.clone())
    };
    let information: Vec<f64> = (targets.scale.iter().enumerate())
        .map(|(j, scale)| refined.information.matrix[(j, j)] * scale * scale)
        .collect();
    let total: f64 = information.iter().sum();
    let d = information.len() as f64;
    let training = Training {
        target_weights: information.iter().map(|g| d * g / total).collect(),
        ..settings.tuning.clone()
    };
    let (network, history) = estimator.network.tune_heads(
        &inputs.apply(&features),
        &targets.apply(&theta),
        &training,
        seed,
        progress,
    )?;
    let read = |features: &Array2<f64>| -> Result<Array2<f64>, EstimateError> {
        Ok(targets.invert(&network.predict(&inputs.apply(features))?))
    };
    let space = estimator.study.twin().parameters();
    let theta = space.clamp(&read(&one_row(observed))?.row(0).to_vec());
    let end = draws.theta.nrows();
    let calibration = Calibration {
        predicted: read(&rows(&draws.features, size, end))?,
        truth: rows(&draws.theta, size, end),
    };
    Ok(Tuned {
        spread: calibration.spread(&theta, &targets.scale, INTERVAL_LEVEL),
        theta,
        network,
        history,
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
