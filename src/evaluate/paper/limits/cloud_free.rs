//! Fine-tuning without a cloud: the heads are moved until their own answer to the record has the smallest feature misfit.
//!
//! ```text
//! L(heads) = ½‖S^{-1/2}(f̄(θ̂) − x)‖²,   θ̂ = heads(trunk(x))
//! ```
//!
//! The gradient reaches the heads through θ̂ alone, by the chain rule. Each round takes a Gauss–Newton step of L in θ̂, and
//! trains the heads on the record alone until they say the new θ̂.

use super::{mean, pretrained, records, refined, runs, square, study};
use crate::estimator::Estimator;
use crate::estimator::gate::GateSettings;
use crate::estimator::refine::{RefineSettings, Refinement};
use crate::evaluate::paper::Scenario;
use crate::math::one_row;
use crate::network::Training;
use crate::progress::Progress;
use crate::record::Record;
use crate::twin::Noise;
use rayon::prelude::*;

const ROUNDS: usize = 8;
/// Longest step, in widths of the prior.
const LONGEST: f64 = 0.5;

fn cloud_free(estimator: &Estimator, record: &Record, run: usize) -> Vec<f64> {
    let (silent, noise) = (Progress::silent(), Noise::new(run as u64, "cloud-free", 0));
    let simulator = estimator.simulator().unwrap();
    let features = simulator.observe(record).unwrap();
    let row = one_row(features.as_slice());
    let readout = &estimator.readout;
    let z = readout.inputs.apply(&row);
    let mut theta = estimator.predict_one(&features).unwrap();
    let (centred, _) = simulator.centred(record, &theta, noise).unwrap().unwrap();
    let observed = centred.observe(record).unwrap();
    let (settings, gate) = (RefineSettings::default().centred(), GateSettings::default());
    let refinement = Refinement {
        simulator: &centred,
        drive: record.drive(),
        observed: &observed,
        settings: &settings,
        gate: &gate,
        noise,
        progress: &silent,
    };
    let training = Training {
        epochs: 100,
        holdout: 0.0,
        patience: 0,
        weight_decay: 0.0,
        ..estimator.settings().tuning.clone()
    };
    let space = estimator.study().twin().parameters();
    let mut network = estimator.network().clone();
    for _ in 0..ROUNDS {
        let Ok(there) = refinement.describe_at(&theta) else {
            break;
        };
        let jacobian = there.whitened_jacobian();
        let mut step = -(&there.information.covariance * jacobian.tr_mul(&there.residual));
        let longest =
            (step.iter().zip(space.widths())).fold(0.0f64, |l, (s, w)| l.max((s / w).abs()));
        if longest > LONGEST {
            step *= LONGEST / longest;
        }
        let goal: Vec<f64> = theta.iter().zip(&step).map(|(t, s)| t + s).collect();
        let goal = space.clamp(&goal);
        let y = readout.targets.apply(&one_row(&goal));
        (network, _) = network.tune_heads(&z, &y, &training, 1, &silent).unwrap();
        let said = readout.targets.invert(&network.predict(&z).unwrap());
        theta = space.clamp(&said.row(0).to_vec());
    }
    theta
}

#[test]
#[ignore = "a study"]
fn heads_moved_by_the_misfit_alone_end_at_gauss_newton() {
    for twin in ["van-der-pol", "tanks"] {
        let study = study(twin, "");
        let estimator = pretrained(&study);
        let records = records(&study, Scenario::First, runs());
        let rows: Vec<[f64; 3]> = (records.par_iter().enumerate())
            .map(|(run, (truth, record))| {
                let estimate = refined(&estimator, record, run);
                [
                    square(&cloud_free(&estimator, record, run), truth),
                    square(&estimate.gauss_newton.unwrap(), truth),
                    square(&estimate.fine.unwrap(), truth),
                ]
            })
            .collect();
        let [free, newton, fine] = [0, 1, 2].map(|k| mean(rows.iter().map(|r| r[k])));
        println!(
            "{twin}: without a cloud {free:.2e}, Gauss–Newton {newton:.2e}, with a cloud {fine:.2e}"
        );
        assert!(free.is_finite());
    }
}
