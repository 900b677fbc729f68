//! The refit of a record: Gauss–Newton, cloud, tuned heads, gate again.

use super::EstimateRun;
use super::outcome::{PointEstimate, Refit, RefitSeconds};
use super::tune::{Tuning, tune};
use crate::estimator::bank::FeatureSimulator;
use crate::estimator::cloud::Cloud;
use crate::estimator::error::EstimatorError;
use crate::estimator::readout::{INTERVAL_LEVEL, Spread};
use crate::estimator::refine::{RefinedEstimate, Refinement};
use crate::fit::posterior::PosteriorRegion;
use statrs::distribution::{ChiSquared, ContinuousCDF};
use std::time::Instant;

/// The tuned estimate is kept within this quantile of χ²_d: of its squared distance from the record's posterior, or of its whitened misfit.
const KEEP_TUNED: f64 = 0.999;

impl EstimateRun<'_> {
    /// Refits from the network's estimate; where the record's fit has a `region` and the features have a reference, about its mean.
    pub(super) fn refit(
        &self,
        simulator: &FeatureSimulator,
        initial: &[f64],
        region: Option<&PosteriorRegion>,
    ) -> Result<Refit, EstimatorError> {
        let (settings, progress) = (self.settings, self.progress);
        let lap = Instant::now();
        // Features with a reference are taken about the record's own θ from here on.
        let about = region.and_then(|region| Some((simulator.about(&region.theta)?, region)));
        let (simulator, initial, refine) = match &about {
            Some((simulator, region)) => {
                let refine = settings.refine.centred();
                (simulator, region.theta.as_slice(), refine)
            }
            None => (simulator, initial, settings.refine.clone()),
        };
        let observed = simulator.observe(self.record)?;
        let refinement = self.refinement(simulator, &observed, &refine);
        let refined = refinement.run(initial)?;
        let gauss_newton = lap.elapsed().as_secs_f64();
        let lap = Instant::now();
        let region = about.as_ref().map(|(_, region)| *region);
        let cloud = Cloud {
            simulator,
            drive: self.record.drive(),
            refined: &refined,
            region,
            settings: &settings.cloud,
        };
        let draws = cloud.draw(self.noise.child("cloud"), progress)?;
        let cloud_seconds = lap.elapsed().as_secs_f64();
        let lap = Instant::now();
        let tuned = tune(&Tuning {
            estimator: self.estimator,
            draws: &draws,
            refined: &refined,
            observed: &observed,
            settings,
            seed: self.seed,
            progress,
        })?;
        let seconds = RefitSeconds {
            gauss_newton,
            cloud: cloud_seconds,
            tune: lap.elapsed().as_secs_f64(),
        };
        let gauss_newton = refined.theta.as_slice().to_vec();
        // Whether the tuned estimate is kept, and what stands in for it otherwise.
        let (keeps, instead, std_error) = match region {
            Some(region) => (
                is_likely(region.squared_distance(&tuned.theta), tuned.theta.len()),
                &region.theta,
                region.std_errors(),
            ),
            None => (
                keeps(&refinement, &refined, &tuned.theta),
                &gauss_newton,
                refined.information.std_error.clone(),
            ),
        };
        let space = simulator.twin().parameters();
        let answer = match tuned.spread {
            Some(spread) if keeps => PointEstimate::new(tuned.theta.clone(), spread, &space),
            _ => {
                let spread = Spread::normal(std_error, INTERVAL_LEVEL);
                PointEstimate::new(instead.clone(), spread, &space)
            }
        };
        Ok(Refit {
            after: self.after(simulator, &answer.theta, &refined, &observed)?,
            answer,
            gauss_newton,
            fine: tuned.theta,
            contributions: tuned.contributions,
            information: refined.information,
            is_refused: false,
            tracking_initial: None,
            cloud: draws,
            seconds,
        })
    }
}

/// Returns whether the tuned estimate stays within the misfit that θ could still explain by chance: the part of its whitened
/// residual in the Jacobian's column space against χ²_d(0.999).
fn keeps(refinement: &Refinement<'_>, refined: &RefinedEstimate, theta: &[f64]) -> bool {
    (refinement.whitened_residual(refined, theta))
        .map(|residual| refined.explainable_misfit(&residual))
        .is_ok_and(|misfit| is_likely(misfit, theta.len()))
}

/// Returns whether a squared distance of this many degrees of freedom is one of chance.
fn is_likely(square: f64, freedom: usize) -> bool {
    ChiSquared::new(freedom as f64).is_ok_and(|chi| square <= chi.inverse_cdf(KEEP_TUNED))
}
