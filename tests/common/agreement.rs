//! One engine: what a fit with an effect in its study gains in evidence, and what a diagnosis says of the same effect.

use truetwin::diagnose::{DiagnoseSettings, Diagnosis, diagnose};
use truetwin::effect::{Effect, augment};
use truetwin::prelude::*;
use truetwin::study::StudyFile;

/// Evidence of an effect over that of the twin alone, in nats.
pub(crate) struct Compared {
    pub key: String,
    pub diagnosed: f64,
    pub fitted: f64,
    /// `true` where the effect may be what is missing, so that a diagnosis fits it to its end.
    pub is_candidate: bool,
}

/// A simulated record of a twin with an effect.
pub(crate) fn simulated(study: &Study, id: &str, target: &str, m: &[f64], theta: &[f64]) -> Record {
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
    // That of a diagnosis is not corrected by draws.
    evidence.map_or(f64::NAN, |evidence| evidence.laplace)
}

/// The tables of an effect's ways: of several thresholds, each is used alone, and all together.
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
    // Where readings stop, the ends that are used are shown.
    if thresholds.len() < 2 || entry.id == "sensor-saturation" {
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
        .chain([table.clone()])
        .collect()
}

/// Effects that a diagnosis reports, fitted with each in the study.
pub(crate) fn compared(study: &Study, record: &Record, without: &[&str]) -> Vec<Compared> {
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
    let best = (found.cause.effects.iter()).map(|e| e.log_evidence);
    let best = best.fold(0.0, f64::max);
    (found.cause.effects.iter())
        .filter(|e| accepted.len() < 2 || !accepted.contains(&e.key()))
        .map(|e| {
            let same = study.effects().into_iter();
            let all: Vec<String> = (same.filter(|effect| effect.key().to_string() == e.key()))
                .flat_map(|effect| ways(&effect))
                .collect();
            let fitted = (all.iter())
                .map(|effects| log_evidence(study, effects, record))
                .fold(f64::NEG_INFINITY, f64::max);
            Compared {
                key: e.key(),
                diagnosed: e.log_evidence,
                fitted: fitted - alone - (all.len() as f64).ln(),
                is_candidate: e.log_evidence > best - CANDIDATES,
            }
        })
        .collect()
}

/// Nats from the best effect within which another may still be what is missing.
const CANDIDATES: f64 = 6.0;
/// Nats by which a diagnosis may say more of another: 1.5 that it credits a fit with that it gave up before its end, one by which its fit of the
/// twin alone may be short, and what a fit with a kink ends below the top: 3.2 for dry friction of two motors on a belt.
const GIVEN_UP: f64 = 6.0;

/// Effects that may be what is missing and of which both do not say the same, and others of which a diagnosis says too much.
pub(crate) fn differing(name: &str, all: &[Compared]) -> Vec<String> {
    for c in all {
        let Compared {
            key,
            diagnosed,
            fitted,
            ..
        } = c;
        println!(
            "{name:12} {key:40} {diagnosed:9.2} {fitted:9.2} {:7.2}",
            fitted - diagnosed
        );
    }
    (all.iter())
        .filter(|c| {
            let least = if c.is_candidate { -0.5 } else { -GIVEN_UP };
            let most = if c.is_candidate { 0.5 } else { f64::INFINITY };
            let difference = c.fitted - c.diagnosed;
            c.diagnosed > 1.0 && !(least..=most).contains(&difference)
        })
        .map(|c| format!("{name} {}: {:.2} and {:.2}", c.key, c.diagnosed, c.fitted))
        .collect()
}
