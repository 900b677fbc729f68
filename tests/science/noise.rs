//! Noise of other kinds than constant, independent noise: growing with the signal, none in the states, correlated from step to step.

use truetwin::diagnose::{DiagnoseSettings, Verdict, diagnose};
use truetwin::fit::Fit;
use truetwin::prelude::*;
use truetwin::study::{ProcessNoise, StudyFile};

/// A substance that decays from 2: ẋ = −k·x. No noise is declared.
struct Decay;
impl StateSpace for Decay {
    fn outline(&self) -> Outline {
        Outline::new()
            .parameter(Parameter::new("k", "1/s", 0.1, 5.0).within(0.01, 20.0))
            .state("x", "g")
            .output("y", "g")
    }
    fn drift(&self, now: &Now<'_>, x: &[f64], dx: &mut [f64]) {
        dx[0] = -now.theta[0] * x[0];
    }
    fn observe(&self, _: &Now<'_>, x: &[f64], y: &mut [f64]) {
        y[0] = x[0];
    }
    fn start(&self, _: &Now<'_>, x: &mut [f64]) {
        x[0] = 2.0;
    }
}

/// 160 readings of a decay over 4 s with an error of this share of each, or of 0.05 g.
fn decayed(share: Option<f64>, seed: u64) -> Record {
    let drive = Drive::autonomous(0.025, 160).unwrap();
    let mut outputs = Decay.simulate(&[1.2], &drive, Noise::OFF).unwrap();
    let mut source = Noise::new(seed, "decay", 0).source("readings");
    outputs.mapv_inplace(|y| y + share.map_or(0.05, |share| share * y) * source.normal());
    Record::new(drive, outputs).unwrap()
}

fn level<'f>(fit: &'f Fit, name: &str) -> Option<&'f truetwin::fit::FittedNoise> {
    fit.noise.iter().find(|level| level.name == name)
}

/// A fit finds noise that grows with the signal where it does, and leaves constant noise as it is.
#[test]
fn a_fit_asks_whether_noise_grows_with_the_signal() {
    let study = Study::of(Decay).unwrap();
    let study = study.with_process_noise(ProcessNoise::None).unwrap();
    for seed in 0..3 {
        let fit = study.fit(&[decayed(Some(0.05), seed)]).unwrap();
        let share = level(&fit, "y.share").unwrap();
        assert!((share.value / 0.05).ln().abs() < 0.3, "{share:?}");
        // The error of k is a fifth of that by constant noise, which believes large readings too little and small ones too much.
        let k = &fit.parameters[0];
        assert!(
            (k.value - 1.2).abs() < 4.0 * k.std_error && k.std_error < 0.006,
            "{k:?}"
        );
        let score = study.score(&fit, &decayed(Some(0.05), 100 + seed)).unwrap();
        assert!((score.log_score - fit.log_likelihood / 160.0).abs() < 0.3);
        let constant = study.fit(&[decayed(None, seed)]).unwrap();
        assert!(level(&constant, "y.share").is_none());
        assert!((level(&constant, "y").unwrap().value / 0.05).ln().abs() < 0.3);
    }
}

/// Declared noise that grows with the signal is simulated and fitted by one factor.
#[test]
fn a_share_is_declared() {
    let text = "twin = 'decay'\n[noise]\nprocess = 'none'\ny = { std = 0.001, share = 0.05 }";
    let file = StudyFile::parse(text, "decay.toml".as_ref()).unwrap();
    let plan = RecordPlan::autonomous(0.025, 160);
    let study = Study::new("decay", Decay, plan)
        .unwrap()
        .configure(&file)
        .unwrap();
    let drive = Drive::autonomous(0.025, 160).unwrap();
    let clean = Decay.simulate(&[1.2], &drive, Noise::OFF).unwrap();
    let noisy = study
        .twin()
        .simulate(&[1.2], &drive, Noise::new(1, "share", 0))
        .unwrap();
    let errors = (&noisy - &clean) / clean.mapv(|y| 0.001 + 0.05 * y);
    let square = errors.mapv(|e| e * e).mean().unwrap();
    assert!((0.7..1.4).contains(&square), "{square}");
    let fit = study.fit(&[Record::new(drive, noisy).unwrap()]).unwrap();
    let y = level(&fit, "y").unwrap();
    let declared = y.declared.unwrap();
    assert!((y.value / declared).ln().abs() < 0.3, "{y:?}");
    assert!(level(&fit, "y.share").is_none());
}

/// An exact twin whose noise grows with the signal has no gap, and its noise is said to grow.
#[test]
fn noise_that_grows_is_no_gap() {
    let study = Study::of(Decay).unwrap();
    let settings = DiagnoseSettings {
        detection_only: true,
        ..DiagnoseSettings::default()
    };
    let record = decayed(Some(0.05), 0);
    let found = diagnose(&study, &[record], None, &settings, &Progress::silent()).unwrap();
    assert_eq!(
        found.verdict,
        Verdict::NoGap,
        "{}",
        found.detection.log_evidence
    );
    assert_eq!(found.proportional_noise, ["sensor"]);
}
