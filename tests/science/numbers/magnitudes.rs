//! The same system in other units: the same answers, up to the units.

use super::chain::{Chain, Units};
use truetwin::diagnose::{DiagnoseSettings, Diagnosis, diagnose};
use truetwin::estimator::{Estimate, EstimateOptions, Estimator, PretrainOptions, pretrain};
use truetwin::progress::Progress;
use truetwin::record::{Record, Signal};

const SAMPLES: usize = 240;

/// Everything at once: parameters around 1e-9 and 1e9, outputs around 1e-6 and 1e6, steps of nanoseconds and of months.
const UNITS: [Units; 2] = [
    Units {
        parameters: 1e9,
        states: 1e-9,
        inputs: 1e6,
        outputs: 1e-6,
        seconds: 1e-9,
    },
    Units {
        parameters: 1e-9,
        states: 1e9,
        inputs: 1e-6,
        outputs: 1e6,
        seconds: 1e8,
    },
];

fn estimator(units: Units) -> Estimator {
    let options = PretrainOptions {
        bank_size: Some(1500),
        epochs: Some(15),
        seed: 1,
        ..PretrainOptions::default()
    };
    let study = Chain::pair(units).study(SAMPLES);
    pretrain(&study, &options, &Progress::silent()).unwrap().0
}

/// `given` in other units is `plain`, within a share of itself.
fn same(what: &str, units: Units, given: f64, plain: f64, tolerance: f64) {
    let error = (given - plain).abs() / plain.abs().max(f64::MIN_POSITIVE);
    assert!(
        error < tolerance,
        "{what}: {given} for {plain}, in {units:?}"
    );
}

fn all(what: &str, units: Units, given: &[f64], plain: &[f64], unit: f64, tolerance: f64) {
    assert_eq!(given.len(), plain.len());
    for (given, plain) in given.iter().zip(plain) {
        same(what, units, given / unit, *plain, tolerance);
    }
}

/// Far from the prior, so that all steps of an estimate are taken; the network learns in 32 bits, and differs in the last of them.
/// Estimates of the default recipe: the paper's adds ε in squared units of the features to their covariance, and so depends on units.
#[test]
fn estimates_do_not_depend_on_units() {
    let estimate = |units: Units| -> Estimate {
        let record = Chain::pair(units).record(1.7, SAMPLES, 5);
        let options = EstimateOptions::default();
        (estimator(units).estimate_with(&record, &options, &Progress::silent())).unwrap()
    };
    let plain = estimate(Units::PLAIN);
    assert!(plain.refit().is_some(), "nothing but the network was tried");
    for units in UNITS {
        let given = estimate(units);
        assert!(given.refit().is_some());
        let unit = units.parameters;
        let [g, p] = [&given, &plain].map(|e| e.refit().unwrap().gauss_newton.clone());
        for (what, given, plain, tolerance) in [
            ("θ_init", &given.initial.theta, &plain.initial.theta, 1e-2),
            ("θ_GN", &g, &p, 1e-6),
            ("θ", &given.theta, &plain.theta, 1e-3),
            // Of a cloud whose heads learn in 32 bits.
            ("standard error", &given.std_error, &plain.std_error, 3e-2),
            ("low", &given.low, &plain.low, 1e-2),
            ("high", &given.high, &plain.high, 1e-2),
        ] {
            all(what, units, given, plain, unit, tolerance);
        }
    }
}

/// Without a gap, and with a sensor that sticks at a ceiling, each in one of the units: a threshold of any unit would answer otherwise.
#[test]
fn diagnoses_do_not_depend_on_units() {
    for (ceiling, units) in [(None, UNITS[0]), (Some(1.2), UNITS[1])] {
        same_diagnosis(ceiling, &[units]);
    }
}

/// Each in both units.
#[test]
#[ignore = "a minute; run it in release"]
fn diagnoses_do_not_depend_on_any_units() {
    for ceiling in [None, Some(1.2)] {
        same_diagnosis(ceiling, &UNITS);
    }
}

fn same_diagnosis(ceiling: Option<f64>, all: &[Units]) {
    let diagnosis = |units: Units| -> Diagnosis {
        let chain = Chain::pair(units);
        let record = chain.record(1.2, SAMPLES, 7);
        let top = ceiling.map_or(f64::INFINITY, |level| level * units.outputs);
        let outputs: Signal = record.outputs().mapv(|y| y.min(top));
        let record = Record::new(record.drive().clone(), outputs).unwrap();
        let study = chain.study(SAMPLES);
        let settings = DiagnoseSettings::default();
        diagnose(&study, &[record], None, &settings, &Progress::silent()).unwrap()
    };
    let plain = diagnosis(Units::PLAIN);
    for &units in all {
        let given = diagnosis(units);
        assert_eq!(given.verdict, plain.verdict, "{units:?}");
        let evidence = |d: &Diagnosis| d.detection.log_evidence;
        assert!(
            (evidence(&given) - evidence(&plain)).abs() < 0.05 * evidence(&plain).abs() + 0.2,
            "{units:?}"
        );
        for (g, p) in given.parameters.iter().zip(&plain.parameters) {
            same("θ", units, g.refitted / units.parameters, p.refitted, 1e-3);
            // The likelihood of a clipped sensor has kinks: within its roughness, fits end at different points, and a standard error
            // from a few hundred draws around them differs by its Monte-Carlo error.
            let roughness = if ceiling.is_some() { 0.12 } else { 1e-6 };
            let sd = g.std_error / units.parameters;
            same("sd", units, sd, p.std_error, roughness);
        }
        assert_eq!(given.cause.decision, plain.cause.decision, "{units:?}");
        let named = |d: &Diagnosis| (d.cause.accepted.clone(), d.cause.class.clone());
        assert_eq!(named(&given), named(&plain), "{units:?}");
    }
}
