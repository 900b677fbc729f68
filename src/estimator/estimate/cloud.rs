//! The cloud of fresh simulations around θ_GN.

use crate::estimator::bank::{Draw, Draws, FeatureSimulator};
use crate::estimator::error::EstimatorError;
use crate::estimator::refine::Refined;
use crate::estimator::sample::{EigenBox, Sampler};
use crate::estimator::settings::Settings;
use crate::fit::posterior::Region;
use crate::progress::Progress;
use crate::record::Drive;
use crate::twin::{Interval, Noise};
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
    /// Where the record puts θ, if the features are about its mean.
    pub region: Option<&'a Region>,
    /// Settings.
    pub settings: &'a Settings,
}

/// The cloud: M_FT simulations around the estimate under the record's own input, and some more for calibration; row i
/// depends on the seed and i alone.
pub fn cloud(
    around: &Around<'_>,
    noise: Noise,
    progress: &Progress,
) -> Result<Draws, EstimatorError> {
    let Around {
        simulator,
        drive,
        refined,
        settings,
        ..
    } = *around;
    let space = simulator.twin().parameters();
    let spread = settings.cloud.spread;
    let sampler: Box<dyn Sampler> = match around.region {
        Some(region) => Box::new(EigenBox::of_spread(&region.theta, &region.axes, spread)),
        None => settings.cloud.sampler.around(refined, &space, spread)?,
    };
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
