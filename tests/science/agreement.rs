//! One engine: what a fit with an effect in its study gains in evidence, and what a diagnosis says of the same effect.

use crate::fit::rigs::{Drives, Heater};
use crate::real_records::data;
use truetwin::diagnose::{DiagnoseSettings, Diagnosis, diagnose};
use truetwin::effect::{Effect, augment};
use truetwin::evaluate::paper::reference_studies;
use truetwin::prelude::*;
use truetwin::study::StudyFile;

#[path = "../../examples/rooms.rs"]
#[allow(dead_code, unreachable_pub, clippy::duplicate_mod)]
mod rooms;

/// Evidence of an effect over that of the twin alone, in nats.
struct Compared {
    key: String,
    diagnosed: f64,
    fitted: f64,
}

fn reference(name: &str) -> Study {
    let mut all = reference_studies().unwrap().into_iter();
    all.find(|study| study.name() == name).unwrap()
}

/// A simulated record of a twin with an effect.
fn simulated(study: &Study, id: &str, target: &str, m: &[f64], theta: &[f64]) -> Record {
    let noise = Noise::new(5, "agreement", 0);
    let effect = study.catalogue().effect(id, target).unwrap();
    let twin = augment(study.twin().clone(), vec![effect]).unwrap();
    let drive = study.drive(noise).unwrap();
    let outputs = twin.simulate(&[theta, m].concat(), &drive, noise).unwrap();
    Record::new(drive, outputs).unwrap()
}

/// log Z of a fit with these effects in the study.
fn log_evidence(study: &Study, effects: &str, record: &Record) -> f64 {
    let text = format!("twin = '{}'\n{effects}", study.name());
    let file = StudyFile::parse(&text, "agreement.toml".as_ref()).unwrap();
    let study = study.configure(&file).unwrap();
    let fit = study.fit(std::slice::from_ref(record));
    let evidence = fit.ok().and_then(|fit| fit.evidence);
    evidence.map_or(f64::NAN, |evidence| evidence.log_evidence)
}

/// The tables of an effect's ways: of several thresholds, one is used at a time.
fn ways(effect: &Effect) -> Vec<String> {
    let entry = effect.entry();
    let mut table = format!(
        "[[effect]]\nid = '{}'\ntarget = '{}'\n",
        entry.id, entry.target
    );
    for (key, other) in [("from", entry.from), ("to", entry.to)] {
        if let Some(other) = other {
            table += &format!("{key} = '{other}'\n");
        }
    }
    let thresholds: Vec<_> = (effect.magnitudes().iter())
        .filter(|m| m.is_threshold())
        .collect();
    if thresholds.len() < 2 {
        return vec![table];
    }
    (thresholds.iter())
        .map(|used| {
            let held: Vec<String> = (thresholds.iter().filter(|m| m.name != used.name))
                .map(|m| {
                    format!(
                        "{} = {}",
                        m.name,
                        if m.off > Some(0.0) { "inf" } else { "-inf" }
                    )
                })
                .collect();
            format!("{table}magnitudes = {{ {} }}\n", held.join(", "))
        })
        .collect()
}

/// Effects that a diagnosis reports, fitted with each in the study; those that outputs bear a mark of are left out, as a fit reads no marks.
fn compared(study: &Study, record: &Record, without: &[&str]) -> Vec<Compared> {
    let settings = DiagnoseSettings {
        without: without.iter().map(|id| (*id).into()).collect(),
        ..DiagnoseSettings::default()
    };
    let records = std::slice::from_ref(record);
    let found: Diagnosis = diagnose(study, records, None, &settings, &Progress::silent()).unwrap();
    if found.integrator.is_some() || !found.correlated_noise.is_empty() {
        println!("another step or another kind of noise: not compared");
        return vec![];
    }
    let alone = log_evidence(study, "", record);
    let accepted = &found.cause.accepted;
    (found.cause.effects.iter())
        .filter(|e| e.id != "sensor-quantization" && e.id != "sensor-saturation")
        .filter(|e| accepted.len() < 2 || !accepted.contains(&e.key()))
        .map(|e| {
            let same = study.effects().into_iter();
            let all: Vec<String> = (same.filter(|effect| effect.key().to_string() == e.key()))
                .flat_map(|effect| ways(&effect))
                .collect();
            let best = (all.iter())
                .map(|effects| log_evidence(study, effects, record))
                .fold(f64::NEG_INFINITY, f64::max);
            Compared {
                key: e.key(),
                diagnosed: e.log_evidence,
                fitted: best - alone - (all.len() as f64).ln(),
            }
        })
        .collect()
}

/// The largest difference among effects that a diagnosis fits: what promises less than nothing it does not.
fn differing(name: &str, all: &[Compared]) -> Vec<String> {
    for c in all {
        let Compared {
            key,
            diagnosed,
            fitted,
        } = c;
        println!(
            "{name:12} {key:40} {diagnosed:9.2} {fitted:9.2} {:7.2}",
            fitted - diagnosed
        );
    }
    (all.iter())
        .filter(|c| c.diagnosed > 1.0 && (c.fitted - c.diagnosed).abs() > 0.5)
        .map(|c| format!("{name} {}: {:.2} and {:.2}", c.key, c.diagnosed, c.fitted))
        .collect()
}

#[test]
fn a_fit_and_a_diagnosis_weigh_an_effect_alike() {
    let plan = RecordPlan::levels(4.0, 80, 0.5, 3.0, 20);
    let tanks = Study::new("tanks", truetwin::twins::CascadedTanks, plan).unwrap();
    let record = simulated(
        &tanks,
        "sensor-bias",
        "sensor",
        &[2.0],
        &[0.6, 0.5, 0.55, 1.0],
    );
    let all: Vec<String> = tanks.effects().iter().map(|e| e.id().to_owned()).collect();
    let kept = ["sensor-bias", "sensor-lag", "linear-loss", "parameter-step"];
    let without: Vec<&str> = (all.iter().map(String::as_str))
        .filter(|id| !kept.contains(id))
        .collect();
    let all = compared(&tanks, &record, &without);
    assert!(all.iter().any(|c| c.diagnosed > 10.0));
    let wrong = differing("tanks", &all);
    assert!(wrong.is_empty(), "{wrong:#?}");
}

#[test]
#[ignore = "minutes; run it in release"]
fn fits_and_diagnoses_weigh_the_library_alike() {
    let mut wrong = vec![];
    let tanks = reference("tanks");
    let theta = [0.6, 0.5, 0.55, 1.0];
    let leaking = simulated(&tanks, "linear-loss", "h1", &[0.1], &theta);
    wrong.extend(differing("tanks", &compared(&tanks, &leaking, &[])));
    let oscillator = reference("van-der-pol");
    let dragged = simulated(&oscillator, "quadratic-drag", "x2", &[0.05], &[1.5]);
    wrong.extend(differing(
        "van-der-pol",
        &compared(&oscillator, &dragged, &[]),
    ));
    let rooms = {
        let records = RecordPlan::levels(0.1, 200, 0.0, 1.0, 25);
        Study::new("rooms", rooms::Rooms, records).unwrap()
    };
    let late = simulated(&rooms, "sensor-lag", "sensor2", &[1.5], &[1.0, 0.4]);
    wrong.extend(differing("rooms", &compared(&rooms, &late, &[])));
    let rigs = [
        (
            Study::new(
                "heater",
                Heater,
                RecordPlan::levels(1.0, 600, 0.0, 100.0, 60),
            ),
            "tclab-first.csv",
        ),
        (
            Study::new(
                "drives",
                Drives,
                RecordPlan::levels(0.02, 500, -2.0, 2.0, 25),
            ),
            "drives-2.csv",
        ),
    ];
    for (study, file) in rigs {
        let Some(path) = data(file) else { continue };
        let (study, record) = (study.unwrap(), Record::read(&path).unwrap());
        wrong.extend(differing(study.name(), &compared(&study, &record, &[])));
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
}
