//! The refit of a record: Gauss–Newton, cloud, tuned heads, gate again.

use super::EstimateRun;
use super::outcome::{Contributions, Refit, RefitSeconds};
use crate::estimator::bank::{Draws, FeatureSimulator};
use crate::estimator::budget::BUDGET;
use crate::estimator::error::EstimatorError;
use crate::estimator::readout::{
    Calibration, PointEstimate, QuadraticLayer, Readout, Scaler, Standardiser,
};
use crate::estimator::refine::{RefinedEstimate, Refinement};
use crate::fit::posterior::PosteriorRegion;
use crate::math::one_row;
use crate::network::Training;
use nalgebra::DVector;
use ndarray::{Array2, aview1, s};
use statrs::distribution::{ChiSquared, ContinuousCDF};
use std::time::Instant;

/// Heads tuned to one record.
struct Tuned {
    /// θ_fine, within the bounds.
    theta: Vec<f64>,
    /// θ_fine with errors measured on a part of the cloud that the heads never saw.
    answer: Option<PointEstimate>,
    /// `None` without a quadratic layer.
    contributions: Option<Contributions>,
}

impl EstimateRun<'_> {
    /// Refits from the network's estimate; where the record's fit has a `region` and the features have a reference, about its mean.
    pub(super) fn refit(
        &self,
        simulator: &FeatureSimulator,
        initial: &[f64],
        region: Option<&PosteriorRegion>,
    ) -> Result<Refit, EstimatorError> {
        let lap = Instant::now();
        // Features with a reference are taken about the record's own θ from here on.
        let about = region.and_then(|region| Some((simulator.about(&region.theta)?, region)));
        let (simulator, initial, refine) = match &about {
            Some((simulator, region)) => {
                let refine = self.settings.refine.centred();
                (simulator, region.theta.as_slice(), refine)
            }
            None => (simulator, initial, self.settings.refine.clone()),
        };
        let observed = simulator.observe(self.record)?;
        let refinement = self.refinement(simulator, &observed, &refine);
        let refined = refinement.run(initial)?;
        let gauss_newton = lap.elapsed().as_secs_f64();
        let lap = Instant::now();
        let region = about.as_ref().map(|(_, region)| *region);
        let cloud = self.cloud(simulator, &refined, region)?;
        let cloud_seconds = lap.elapsed().as_secs_f64();
        let lap = Instant::now();
        let tuned = self.tune(&cloud, &refined, &observed)?;
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
        let answer = match tuned.answer {
            Some(answer) if keeps => answer,
            _ => PointEstimate::normal(instead.clone(), std_error, &space),
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
            cloud,
            seconds,
        })
    }

    /// Tunes the heads on a cloud, the trunk frozen, and reads the record's features with them.
    ///
    /// Each target's weight is w_j = d·G_jj/Σ G_kk, with G in the units that the targets are standardised in.
    ///
    /// Source: Lakshminarayanan, Guerrero & Rojas, section IV-C; the quadratic layer is ours.
    fn tune(
        &self,
        draws: &Draws,
        refined: &RefinedEstimate,
        observed: &DVector<f64>,
    ) -> Result<Tuned, EstimatorError> {
        let (settings, estimator) = (self.settings, self.estimator);
        let space = estimator.study().twin().parameters();
        let size = (settings.cloud.draws(draws.theta.ncols())).min(draws.theta.nrows());
        let rows =
            |all: &Array2<f64>, from: usize, to: usize| all.slice(s![from..to, ..]).to_owned();
        let (features, theta) = (rows(&draws.features, 0, size), rows(&draws.theta, 0, size));
        // On a cloud that is small against the prior, features and targets standardised as in pretraining are all but
        // constant, and the heads learn little.
        let (inputs, targets) = match settings.cloud.rescale {
            true => {
                let inputs = Standardiser::principal(&features, BUDGET.largest_tuned_input);
                let inputs = inputs.unwrap_or_else(|_| Standardiser::each(&features));
                (inputs, Scaler::fit(&theta))
            }
            false => {
                let Readout {
                    inputs, targets, ..
                } = &estimator.readout;
                (inputs.clone(), targets.clone())
            }
        };
        let (z, y) = (inputs.apply(&features), targets.apply(&theta));
        let mut layer = match settings.cloud.quadratic {
            true => QuadraticLayer::fit(&z, &y),
            false => None,
        };
        let goal = match &layer {
            Some(layer) => layer.rest(&z, &y),
            None => y,
        };
        let training = Training {
            target_weights: weights(refined, &targets, &space.widths()),
            ..settings.tuning.clone()
        };
        let (network, _) =
            estimator
                .readout
                .network
                .tune_heads(&z, &goal, &training, self.seed, self.progress)?;
        let end = draws.theta.nrows();
        let unseen = rows(&draws.features, size, end);
        let truth = rows(&draws.theta, size, end);
        if let Some(layer) = &mut layer {
            let z = inputs.apply(&unseen);
            let said = network.predict(&z)?;
            layer.weigh(&layer.rest(&z, &targets.apply(&truth)), &said);
        }
        let readout = Readout {
            inputs,
            targets,
            layer,
            network,
        };
        let record = one_row(observed.as_slice());
        let theta = space.clamp(&readout.predict(&record)?.row(0).to_vec());
        let calibration = Calibration {
            predicted: readout.predict(&unseen)?,
            truth,
        };
        let contributions = readout.layer.as_ref().map(|layer| {
            let alone = |features| {
                let z = readout.inputs.apply(features);
                readout.targets.invert(&layer.quadratic.predict(&z))
            };
            Contributions {
                alpha: layer.weight.clone(),
                layer: explained(&alone(&unseen), &calibration.truth),
                both: explained(&calibration.predicted, &calibration.truth),
                theta: space.clamp(&alone(&record).row(0).to_vec()),
            }
        });
        Ok(Tuned {
            contributions,
            answer: calibration.estimate(theta.clone(), &readout.targets.scale, &space),
            theta,
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
    ChiSquared::new(freedom as f64).is_ok_and(|chi| square <= chi.inverse_cdf(BUDGET.keep_tuned))
}

/// Share of each column's variance that a prediction explains.
fn explained(predicted: &Array2<f64>, truth: &Array2<f64>) -> Vec<f64> {
    let all = Scaler::fit(truth).scale;
    let errors = (predicted - truth) / aview1(&all);
    (errors.columns().into_iter())
        .map(|errors| 1.0 - errors.dot(&errors) / truth.nrows() as f64)
        .collect()
}

/// w_j for standardised targets.
fn weights(refined: &RefinedEstimate, targets: &Scaler, widths: &[f64]) -> Vec<f64> {
    let information: Vec<f64> = (targets.scale.iter().zip(widths).enumerate())
        .map(|(j, (scale, width))| refined.information.matrix[(j, j)] * (scale / width).powi(2))
        .collect();
    let total: f64 = information.iter().sum();
    let d = information.len() as f64;
    information.iter().map(|g| d * g / total).collect()
}
