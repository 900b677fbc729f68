//! Estimates that the tests of this module render: a small estimator of the oscillator, really trained.

pub(super) mod made;
pub(super) mod made_scores;

use crate::diagnose::{
    Band, Channel, Decision, Detection, DiagnoseSettings, Diagnosis, Discovery, EffectFit,
    Equation, FittedNuisance, FittedParameter, FreeRuns, Lag, Maps, NextInput, Onset, Region,
    Shrinkage, TargetShare, Term, TermRange, Verdict, Visible, Where, Which, Window, diagnose,
};
use crate::estimator::{Estimate, EstimateOptions, PretrainOptions, pretrain};
use crate::evaluate::trials::{Kind, Named, Outcome, Row, Scorecard};
use crate::progress::Progress;
use crate::record::{Drive, Record, Signal};
use crate::study::{RecordPlan, Study, StudyFile};
use crate::twin::{Interval, Noise};
use crate::twins::VanDerPol;
use std::path::Path;
use std::sync::OnceLock;

/// A study, one record, and two estimates from it.
pub(super) struct Estimates {
    pub(super) study: Study,
    pub(super) record: Record,
    /// The gate kept the network's estimate.
    pub(super) kept: Estimate,
    /// Refined, and scored on a validation record.
    pub(super) refined: Estimate,
}

/// Made once.
pub(super) fn estimates() -> &'static Estimates {
    static MADE: OnceLock<Estimates> = OnceLock::new();
    MADE.get_or_init(make)
}

/// The schema of `tests/contract/{name}.schema.json`.
pub(super) fn validator(name: &str) -> jsonschema::Validator {
    let path =
        Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("tests/contract/{name}.schema.json"));
    let text = std::fs::read_to_string(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    jsonschema::validator_for(&serde_json::from_str(&text).unwrap()).unwrap()
}

/// A record of the study's twin at `theta`.
pub(super) fn simulated(study: &Study, theta: &[f64], sample: u64) -> Record {
    let noise = Noise::new(7, "report", sample);
    let drive = study.drives().unwrap().draw(noise).unwrap();
    let outputs = study.twin().simulate(theta, &drive, noise).unwrap();
    Record::new(drive, outputs).unwrap()
}

/// The study of [`diagnoses`].
pub(super) fn oscillator() -> Study {
    Study::new("van-der-pol", VanDerPol, RecordPlan::autonomous(0.05, 300)).unwrap()
}

/// The study of [`made::tanks_class`].
pub(super) fn tanks() -> Study {
    let studies = crate::evaluate::paper::reference_studies().unwrap();
    studies.into_iter().find(|s| s.name() == "tanks").unwrap()
}

/// Diagnoses without a gap, with a named effect and a validation record, with a parameter gap.
pub(super) fn diagnoses() -> &'static [Diagnosis] {
    static MADE: OnceLock<Vec<Diagnosis>> = OnceLock::new();
    MADE.get_or_init(|| {
        let study = oscillator();
        let effects = "[[effect]]\nid = 'cubic-stiffness'\ntarget = 'x2'\nfrom = 'x1'\n";
        let effects = crate::effect::parse_effects(effects).unwrap();
        let stiff = crate::effect::augment(study.twin().clone(), effects).unwrap();
        let stiff_record = |sample| {
            let noise = Noise::new(7, "report", sample);
            let drive = study.drives().unwrap().draw(noise).unwrap();
            let outputs = stiff.simulate(&[1.5, 0.15], &drive, noise).unwrap();
            Record::new(drive, outputs).unwrap()
        };
        let settings = DiagnoseSettings {
            replicates: 30,
            unexplained: 50,
            ..DiagnoseSettings::default()
        };
        let found = |record: Record, validation: Option<Record>| {
            let silent = Progress::silent();
            diagnose(&study, &[record], validation.as_ref(), &settings, &silent).unwrap()
        };
        vec![
            found(simulated(&study, &[1.5], 1), None),
            found(stiff_record(2), Some(stiff_record(3))),
            found(simulated(&study, &[4.0], 4), None),
        ]
    })
}

fn make() -> Estimates {
    let file = StudyFile::parse(
        "twin = 'van-der-pol'\n[start]\nx1 = 'estimate'\n[prior]\nstart.x1 = [0.5, 1.5]\n",
        Path::new("study.toml"),
    );
    let registered = Study::new("van-der-pol", VanDerPol, RecordPlan::autonomous(0.05, 200));
    let study = registered.unwrap().configure(&file.unwrap()).unwrap();
    let options = PretrainOptions {
        bank_size: Some(200),
        epochs: Some(2),
        ..PretrainOptions::default()
    };
    let (estimator, _) = pretrain(&study, &options, &Progress::silent()).unwrap();
    let estimate = |record: &Record, options: &EstimateOptions| {
        estimator
            .estimate(record, options, &Progress::silent())
            .unwrap()
    };
    let record = simulated(&study, &[1.2, 1.1], 0);
    let refined = estimate(
        &record,
        &EstimateOptions {
            always_refine: true,
            validation: Some(simulated(&study, &[1.2, 1.1], 1)),
            ..EstimateOptions::default()
        },
    );
    // Two epochs teach little: records at a fixed point of the network are those that the gate keeps.
    let mut guess = vec![1.25, 1.0];
    for _ in 0..10 {
        let features = estimator.observe(&simulated(&study, &guess, 2)).unwrap();
        guess = estimator.predict_one(&features).unwrap();
    }
    let kept = (2..20)
        .map(|sample| simulated(&study, &guess, sample))
        .map(|record| estimate(&record, &EstimateOptions::default()))
        .find(|estimate| !estimate.refitted)
        .unwrap();
    Estimates {
        study,
        record,
        kept,
        refined,
    }
}

/// A scorecard with a right answer and a failure, and one of no trials.
pub(super) fn scorecards() -> [Scorecard; 2] {
    let named = Row {
        trial: 0,
        kind: Kind::Listed,
        truth: "sensor-lag@sensor".into(),
        right: vec!["sensor-lag@sensor".into()],
        effects: vec!["sensor-lag@sensor".into()],
        targets: vec!["sensor".into()],
        strength: Some(0.7),
        gain: Some(30.0),
        added: None,
        shortfall: None,
        share: Some(0.9),
        outcome: Some(Outcome {
            verdict: Verdict::StructuralGap,
            p_value: 0.02,
            decision: Decision::Named,
            target: Some("sensor".into()),
            effects: vec![Named {
                key: "sensor-lag@sensor".into(),
                probability: 0.9,
                gain: 30.0,
            }],
            accepted: vec!["sensor-lag@sensor".into()],
            class: vec!["sensor-lag@sensor".into()],
            before: Some(0.5),
            floor: Some(0.1),
            closed: Some(0.9),
            interval: Some([0.8, 1.0]),
        }),
        failure: None,
        seconds: 1.5,
    };
    let failed = Row {
        trial: 1,
        kind: Kind::None,
        truth: "none".into(),
        right: vec![],
        effects: vec![],
        targets: vec![],
        strength: None,
        gain: None,
        share: None,
        outcome: None,
        failure: Some("no fit".into()),
        ..named.clone()
    };
    [vec![named, failed], vec![]].map(|rows| Scorecard::new("tanks", 1, 0.05, "abc", rows))
}
