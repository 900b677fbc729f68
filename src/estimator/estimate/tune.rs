//! Heads tuned on the cloud.

use crate::estimator::bank::Draws;
use crate::estimator::error::EstimatorError;
use crate::estimator::estimator::Estimator;
use crate::estimator::readout::{
    Calibration, INTERVAL_LEVEL, QuadraticLayer, Readout, Scaler, Spread, Standardiser,
};
use crate::estimator::refine::RefinedEstimate;
use crate::estimator::settings::Settings;
use crate::math::one_row;
use crate::network::Training;
use crate::progress::Progress;
use nalgebra::DVector;
use ndarray::{Array2, Axis, s};
use serde::{Deserialize, Serialize};

/// Largest network input, in standard deviations of the cloud.
const LIMIT: f64 = 8.0;

/// Contributions of the quadratic layer and the heads to a tuned estimate, by parameter; measured on draws that neither saw.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Contributions {
    /// α, the share of what the heads say that holds; the layer alone has 0.
    pub alpha: Vec<f64>,
    /// Share of the cloud's variance that the layer alone explains.
    pub layer: Vec<f64>,
    /// The same of layer and heads.
    pub both: Vec<f64>,
    /// The layer's estimate alone, within the bounds.
    pub theta: Vec<f64>,
}

/// A cloud with all that its tuning depends on.
pub struct Tuning<'a> {
    /// Network, standardisation.
    pub estimator: &'a Estimator,
    /// The cloud.
    pub draws: &'a Draws,
    /// Gauss–Newton's estimate, whose information weighs the targets.
    pub refined: &'a RefinedEstimate,
    /// The record's features.
    pub observed: &'a DVector<f64>,
    /// Settings of the estimate.
    pub settings: &'a Settings,
    /// Seed of the training.
    pub seed: u64,
    /// Progress sink.
    pub progress: &'a Progress,
}

/// Heads tuned to one record.
#[derive(Debug, Clone)]
pub struct Tuned {
    /// θ_fine, within the bounds.
    pub theta: Vec<f64>,
    /// Errors to expect, measured on a part of the cloud that the heads never saw.
    pub spread: Option<Spread>,
    /// `None` without a quadratic layer.
    pub contributions: Option<Contributions>,
}

/// Tunes the heads on a cloud, the trunk frozen, and reads the record with them.
///
/// Each target's weight is w_j = d·G_jj/Σ G_kk, with G in the units that the targets are standardised in.
///
/// Source: Lakshminarayanan, Guerrero & Rojas, section IV-C; the quadratic layer is ours.
pub fn tune(tuning: &Tuning<'_>) -> Result<Tuned, EstimatorError> {
    let &Tuning {
        estimator,
        draws,
        refined,
        observed,
        settings,
        seed,
        progress,
    } = tuning;
    let size = (settings.cloud.draws(draws.theta.ncols())).min(draws.theta.nrows());
    let rows = |all: &Array2<f64>, from: usize, to: usize| all.slice(s![from..to, ..]).to_owned();
    let (features, theta) = (rows(&draws.features, 0, size), rows(&draws.theta, 0, size));
    // On a cloud that is small against the prior, features and targets standardised as in pretraining are all but
    // constant, and the heads learn little.
    let (inputs, targets) = if settings.cloud.rescale {
        let inputs = Standardiser::principal(&features, LIMIT);
        (
            inputs.unwrap_or_else(|_| Standardiser::each(&features)),
            Scaler::fit(&theta),
        )
    } else {
        (
            estimator.readout.inputs.clone(),
            estimator.readout.targets.clone(),
        )
    };
    let (z, y) = (inputs.apply(&features), targets.apply(&theta));
    let mut layer = (settings
        .cloud
        .quadratic
        .then(|| QuadraticLayer::fit(&z, &y)))
    .flatten();
    let goal = layer
        .as_ref()
        .map_or_else(|| y.clone(), |layer| layer.rest(&z, &y));
    let (network, _) = estimator.readout.network.tune_heads(
        &z,
        &goal,
        &Training {
            target_weights: weights(refined, &targets),
            ..settings.tuning.clone()
        },
        seed,
        progress,
    )?;
    let end = draws.theta.nrows();
    let (unseen, truth) = (
        rows(&draws.features, size, end),
        rows(&draws.theta, size, end),
    );
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
    let space = estimator.study().twin().parameters();
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
        spread: calibration.spread(&theta, &readout.targets.scale, INTERVAL_LEVEL),
        theta,
    })
}

/// Share of each column's variance that a prediction explains.
fn explained(predicted: &Array2<f64>, truth: &Array2<f64>) -> Vec<f64> {
    let errors = (predicted - truth).mapv(|e| e * e).sum_axis(Axis(0));
    let all = truth.var_axis(Axis(0), 0.0) * truth.nrows() as f64;
    (errors.iter().zip(all))
        .map(|(error, all)| 1.0 - error / all)
        .collect()
}

/// w_j for standardised targets.
fn weights(refined: &RefinedEstimate, targets: &Scaler) -> Vec<f64> {
    let information: Vec<f64> = (targets.scale.iter().enumerate())
        .map(|(j, scale)| refined.information.matrix[(j, j)] * scale * scale)
        .collect();
    let total: f64 = information.iter().sum();
    let d = information.len() as f64;
    information.iter().map(|g| d * g / total).collect()
}
