//! `Study::fit` of measured records.

use crate::records::measured;
use crate::rigs::{Carriage, Heater};
use truetwin::evaluate::paper::reference_studies;
use truetwin::fit::Fit;
use truetwin::prelude::*;
use truetwin::study::StudyFile;

const CEILING: &str = "[[effect]]\nid = 'state-ceiling'\ntarget = 'h1'\nto = 'h2'\n";
const DRAG: &str = "[[effect]]\nid = 'power-law'\ntarget = 'h2'\n";

fn tanks() -> Study {
    let mut all = reference_studies().unwrap().into_iter();
    all.find(|study| study.name() == "tanks").unwrap()
}

fn fitted(study: &Study, records: &[Record]) -> Fit {
    study.fit(records).unwrap()
}

fn value(fit: &Fit, name: &str) -> f64 {
    let found = fit.parameters.iter().find(|p| p.name == name);
    found.unwrap_or_else(|| panic!("{name}")).value
}

/// A fit of the tanks of Schoukens et al., whose upper one overflows, with these effects.
fn tanks_with(effects: &str) -> Fit {
    let records = [measured("cascaded-tanks-estimation.csv")];
    let example =
        std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("examples/cascaded-tanks.toml");
    let text = std::fs::read_to_string(example).unwrap();
    let file = StudyFile::parse(&format!("{text}\n{effects}"), "tanks.toml".as_ref()).unwrap();
    fitted(&tanks().configure(&file).unwrap(), &records)
}

/// A free ceiling is found: a search that ends before it gains nothing.
pub fn the_overflow_of_real_tanks_is_found() {
    let (base, free) = (tanks_with(""), tanks_with(CEILING));
    let all = [&base, &free].map(|fit| fit.log_likelihood);
    assert!(free.log_likelihood > base.log_likelihood + 200.0, "{all:?}");
    // Where the twin stops at its own limit, measurement noise stays at the least that stopped outputs need.
    assert!(base.noise.iter().any(|level| level.at_bound.is_some()));
    assert!(base.warnings.iter().any(|w| w.code == "noise-at-bound"));
}

/// It is as high as one that is held at its place, and a law beside it does not hide it.
pub fn the_overflow_of_real_tanks_is_found_beside_others() {
    let held = "magnitudes = { level = 10.0, spill = 0.33 }\n";
    let (held, free) = (tanks_with(&format!("{CEILING}{held}")), tanks_with(CEILING));
    let both = tanks_with(&format!("{CEILING}{DRAG}"));
    let all = [&held, &free, &both].map(|fit| fit.log_likelihood);
    println!("{all:?}");
    assert!(free.log_likelihood > held.log_likelihood - 5.0, "{all:?}");
    assert!(both.log_likelihood > free.log_likelihood - 0.5, "{all:?}");
}

/// The carriage's record at 20 ms: forces averaged over each step, every other position.
fn carriage() -> Record {
    let record = measured("emps-estimation.csv");
    let n = record.samples() / 2;
    let mean =
        |k: usize| 0.5 * (record.drive().input(2 * k)[0] + record.drive().input(2 * k + 1)[0]);
    let inputs = Signal::from_shape_fn((n, 1), |(k, _)| mean(k));
    let outputs = Signal::from_shape_fn((n, 1), |(k, _)| record.outputs()[[2 * k, 0]]);
    Record::new(Drive::new(0.02, inputs).unwrap(), outputs).unwrap()
}

fn positioning(effects: &str) -> Study {
    let plan = RecordPlan::levels(0.02, 1242, -100.0, 100.0, 50);
    let file = StudyFile::parse(
        &format!("twin = 'positioning'\n{effects}"),
        "s.toml".as_ref(),
    );
    Study::new("positioning", Carriage, plan)
        .unwrap()
        .configure(&file.unwrap())
        .unwrap()
}

fn effect(id: &str, rest: &str) -> String {
    format!("[[effect]]\nid = '{id}'\ntarget = 'v'\n{rest}\n")
}

/// The carriage's fits with effects, and their gains in log evidence over the twin alone.
fn gains_of_the_carriage(effects: &[String]) -> Vec<(f64, Fit)> {
    let records = [carriage()];
    let base = fitted(&positioning(""), &records);
    assert!((value(&base, "M") - 97.0).abs() < 1.5 && (value(&base, "Fv") - 413.0).abs() < 6.0);
    let evidence = |fit: &Fit| fit.evidence.unwrap().log_evidence;
    let gain = |effects: &String| {
        let fit = fitted(&positioning(effects), &records);
        let gain = evidence(&fit) - evidence(&base);
        println!("{gain:.1} nats: {}", effects.replace('\n', " "));
        (gain, fit)
    };
    effects.iter().map(gain).collect()
}

/// One effect explains more than others, and less than two.
pub fn the_carriage_shows_its_friction_among_others() {
    let all = gains_of_the_carriage(&[
        effect("coulomb-friction", ""),
        effect("periodic-disturbance", ""),
        effect("cross-coupling", "from = 'q'"),
        friction_and_offset(),
    ]);
    let gains: Vec<f64> = all.iter().map(|(gain, _)| *gain).collect();
    let [friction, periodic, coupling, both] = gains[..] else {
        panic!("{gains:?}")
    };
    assert!(friction > periodic + 300.0 && periodic > coupling && coupling > 30.0);
    assert!(both > friction + 200.0);
}

fn friction_and_offset() -> String {
    let effects = ["coulomb-friction", "constant-forcing"];
    effects.map(|id| effect(id, "")).concat()
}

/// Nothing declared, nothing tuned: friction and offset of a real carriage, as its authors publish them (95.1 kg, 203.5 N·s/m,
/// 20.4 N, 3.2 N). A search that ends early has another mass, or less evidence.
pub fn the_carriage_shows_its_friction() {
    let all = gains_of_the_carriage(&[friction_and_offset()]);
    let (both, fit) = &all[0];
    assert!(*both > 900.0, "{both}");
    let mass = value(fit, "M");
    assert!((mass - 92.0).abs() < 4.0, "{mass}");
    assert!((value(fit, "Fv") - 197.0).abs() < 20.0);
    assert!((value(fit, "coulomb-friction@v.force") * mass - 21.0).abs() < 2.0);
    assert!((value(fit, "constant-forcing@v.force") * mass - 3.2).abs() < 0.4);
}

/// Gains of a heater's fits in log evidence, of effects and their targets.
fn gains_of_the_heater<const N: usize>(effects: [(&str, &str); N]) -> [f64; N] {
    let records = [measured("tclab-first.csv")];
    let evidence = |effects: &str| {
        let text = format!("twin = 'heater'\n{effects}");
        let file = StudyFile::parse(&text, "s.toml".as_ref()).unwrap();
        let plan = RecordPlan::levels(1.0, 600, 0.0, 100.0, 60);
        let study = Study::new("heater", Heater, plan)
            .unwrap()
            .configure(&file)
            .unwrap();
        fitted(&study, &records).evidence.unwrap().log_evidence
    };
    let base = evidence("");
    effects.map(|(id, target)| {
        let gain = evidence(&format!("[[effect]]\nid = '{id}'\ntarget = '{target}'\n")) - base;
        println!("{gain:.1} nats: {id}@{target}");
        gain
    })
}

/// A real heater lacks a lag, and no loss: evidence that does not pay for a magnitude, or a search that ends early, fails.
pub fn the_heater_shows_its_lag() {
    let [lag, loss] = gains_of_the_heater([("sensor-lag", "sensor"), ("linear-loss", "T")]);
    assert!(lag > 100.0 && loss < 3.0, "{lag} {loss}");
}

/// The lag may be the actuator's, and nothing else is as likely.
pub fn the_heater_shows_its_lag_and_nothing_else() {
    let [lag, actuator, periodic, rest @ ..] = gains_of_the_heater([
        ("sensor-lag", "sensor"),
        ("actuator-lag", "actuator"),
        ("periodic-disturbance", "T"),
        ("quadratic-drag", "T"),
        ("sensor-drift", "sensor"),
        ("actuator-dead-zone", "actuator"),
    ]);
    assert!(lag > 100.0 && actuator > 100.0 && periodic < lag - 50.0);
    assert!(rest.iter().all(|gain| *gain < 3.0), "{rest:?}");
}
