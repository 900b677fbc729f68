//! Records that no twin has made: an answer of finite numbers, or an error that says why there is none.

use super::chain::{Chain, Units};
use truetwin::diagnose::{DiagnoseSettings, diagnose};
use truetwin::estimator::{PretrainOptions, pretrain};
use truetwin::progress::Progress;
use truetwin::record::{Record, Signal};

const SAMPLES: usize = 100;

/// Change of sample k.
type Change = fn(usize, f64) -> f64;

#[test]
fn odd_records_give_numbers_or_reasons() {
    let chain = Chain::pair(Units::PLAIN);
    let study = chain.study(SAMPLES);
    let options = PretrainOptions {
        bank_size: Some(500),
        epochs: Some(5),
        ..PretrainOptions::default()
    };
    let silent = Progress::silent();
    let (estimator, _) = pretrain(&study, &options, &silent).unwrap();
    let plain = chain.record(1.0, SAMPLES, 1);
    let odd: [(&str, Change); 9] = [
        ("zero", |_, _| 0.0),
        ("constant", |_, _| 7.0),
        ("tiny", |_, y| y * 1e-300),
        ("huge", |_, y| y * 1e150),
        ("as large as numbers are", |k, _| {
            if k % 2 == 0 { 1e308 } else { -1e308 }
        }),
        ("one spike", |k, y| if k == 90 { 1e12 } else { y }),
        ("negative", |_, y| -y),
        ("a ramp", |k, _| k as f64),
        ("stuck", |k, y| if k > 20 { 0.25 } else { y }),
    ];
    for (name, change) in odd {
        let outputs = plain.outputs();
        let changed = Signal::from_shape_fn(outputs.dim(), |(k, j)| change(k, outputs[[k, j]]));
        let record = Record::new(plain.drive().clone(), changed).unwrap();
        match estimator.estimate(&record) {
            Ok(estimate) => {
                assert!(
                    estimate.theta.iter().all(|v| v.is_finite()),
                    "{name}: {:?}",
                    estimate.theta
                );
                assert!(!estimate.gate.p_value.is_nan(), "{name}");
                let ends = estimate.low.iter().chain(&estimate.high);
                assert!(ends.into_iter().all(|v| v.is_finite()), "{name}");
                assert!(
                    estimate.gate.out_of_distribution,
                    "{name} passes for a simulation"
                );
            }
            Err(error) => println!("{name}, estimate: {error}"),
        }
        let settings = DiagnoseSettings {
            detection_only: true,
            quick: true,
            ..DiagnoseSettings::default()
        };
        match diagnose(&study, &[record], None, &settings, &silent) {
            Ok(diagnosis) => {
                let detection = diagnosis.detection;
                assert!(detection.log_evidence.is_finite(), "{name}: {detection:?}");
                for p in diagnosis.parameters {
                    assert!(
                        p.refitted.is_finite() && p.std_error.is_finite(),
                        "{name}: {p:?}"
                    );
                }
                for fit in diagnosis.cause.effects {
                    assert!(
                        !fit.log_evidence.is_nan() && !fit.probability.is_nan(),
                        "{name}"
                    );
                }
            }
            Err(error) => println!("{name}, diagnose: {error}"),
        }
    }
}
