//! FMUs for model exchange, made of our own C: tanks that are those of the reference twin, and a ball that bounces.

use super::{fmu, open, place, truetwin};
use rayon::prelude::*;
use std::fs;
use std::path::PathBuf;
use std::sync::Arc;
use truetwin::record::{Drive, Signal};
use truetwin::twin::{Noise, SimulationError, StateSpace, Twin};
use truetwin::twins::CascadedTanks;

const TANKS: &str = r#"<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="FmuTanks" guid="{tanks}" numberOfEventIndicators="0">
  <ModelExchange modelIdentifier="model"/>
  <CoSimulation modelIdentifier="model"/>
  <DefaultExperiment startTime="0" stopTime="200" stepSize="0.5"/>
  <ModelVariables>
    <ScalarVariable name="h1" valueReference="0" initial="exact" description="upper tank"><Real start="0" unit="V" min="0" max="10"/></ScalarVariable>
    <ScalarVariable name="h2" valueReference="1" initial="exact" description="lower tank"><Real start="0" unit="V" min="0" max="10"/></ScalarVariable>
    <ScalarVariable name="der(h1)" valueReference="20"><Real derivative="1"/></ScalarVariable>
    <ScalarVariable name="der(h2)" valueReference="21"><Real derivative="2"/></ScalarVariable>
    <ScalarVariable name="k1" valueReference="2" causality="parameter" variability="fixed"><Real start="0.6" unit="-" min="0.1" max="1.5"/></ScalarVariable>
    <ScalarVariable name="k2" valueReference="3" causality="parameter" variability="fixed"><Real start="0.6" unit="-" min="0.1" max="1.5"/></ScalarVariable>
    <ScalarVariable name="k3" valueReference="4" causality="parameter" variability="fixed"><Real start="0.6" unit="-" min="0.1" max="1.5"/></ScalarVariable>
    <ScalarVariable name="k4" valueReference="5" causality="parameter" variability="fixed"><Real start="1" unit="-" min="0.5" max="1.5"/></ScalarVariable>
    <ScalarVariable name="u" valueReference="6" causality="input"><Real start="0" unit="V"/></ScalarVariable>
    <ScalarVariable name="y" valueReference="7" causality="output"><Real unit="V"/></ScalarVariable>
  </ModelVariables>
  <ModelStructure><Derivatives><Unknown index="3"/><Unknown index="4"/></Derivatives></ModelStructure>
</fmiModelDescription>"#;

const BALL: &str = r#"<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="Ball" guid="{ball}" numberOfEventIndicators="1">
  <ModelExchange modelIdentifier="model"/>
  <DefaultExperiment startTime="0" stopTime="2.5" stepSize="0.05"/>
  <ModelVariables>
    <ScalarVariable name="h" valueReference="0" causality="output"><Real start="1" unit="m"/></ScalarVariable>
    <ScalarVariable name="v" valueReference="1"><Real start="0" unit="m/s"/></ScalarVariable>
    <ScalarVariable name="der(h)" valueReference="20"><Real derivative="1"/></ScalarVariable>
    <ScalarVariable name="der(v)" valueReference="21"><Real derivative="2"/></ScalarVariable>
    <ScalarVariable name="e" valueReference="2" causality="parameter" variability="fixed"><Real start="0.8" min="0.5" max="0.95"/></ScalarVariable>
    <ScalarVariable name="kick" valueReference="3" causality="parameter" variability="fixed"><Real start="0" min="0" max="4"/></ScalarVariable>
  </ModelVariables>
  <ModelStructure><Derivatives><Unknown index="3"/><Unknown index="4"/></Derivatives></ModelStructure>
</fmiModelDescription>"#;

fn tanks() -> Option<PathBuf> {
    fmu("tanks", "tanks2.c", TANKS, &[])
}

fn drive() -> Drive {
    let pump = Signal::from_shape_fn((120, 1), |(k, _)| 1.0 + ((k / 15) % 3) as f64 * 0.5);
    Drive::new(0.5, pump).unwrap()
}

fn largest(y: &Signal) -> f64 {
    y.iter().fold(0.0, |most, y| most.max(y.abs()))
}

/// Rates, outputs and limits of the reference twin, at many θ on many threads.
#[test]
fn equations_are_those_of_the_reference_twin() {
    let Some(path) = tanks() else { return };
    let twin = Twin::new(open(&path));
    let outline = twin
        .outline()
        .expect("an FMU for model exchange shows its equations");
    let reference = CascadedTanks.outline();
    assert_eq!(outline.states, reference.states);
    let fine = {
        let text = "twin = 't'\n[record]\nintegrator = 'adaptive'\n";
        let file = truetwin::study::StudyFile::parse(text, "t.toml".as_ref()).unwrap();
        let plan = truetwin::study::RecordPlan::levels(0.5, 120, 0.0, 1.0, 10);
        let study = truetwin::study::Study::new("t", CascadedTanks, plan).unwrap();
        study.configure(&file).unwrap().twin().clone()
    };
    (0..60).into_par_iter().for_each(|i| {
        let theta = [0.5 + 0.005 * f64::from(i), 0.6, 0.55, 1.0];
        let found = twin.simulate(&theta, &drive(), Noise::OFF).unwrap();
        let expected = fine.simulate(&theta, &drive(), Noise::OFF).unwrap();
        let off = largest(&(&found - &expected));
        assert!(off < 1e-12, "{off} at {theta:?}");
    });
}

#[test]
fn what_the_fmu_refuses_costs_its_run() {
    let Some(path) = fmu("fragile", "tanks2.c", TANKS, &["-DFRAGILE"]) else {
        return;
    };
    let twin = Twin::new(open(&path));
    let run = |k1: f64, k4: f64| twin.simulate(&[k1, 0.6, 0.6, k4], &drive(), Noise::OFF);
    let fine = run(0.6, 1.0).unwrap();
    let lost = run(1.45, 1.0).unwrap_err();
    assert!(matches!(lost, SimulationError::Diverged { .. }), "{lost}");
    let none = run(0.6, 1.45).unwrap_err();
    assert!(none.to_string().contains("the initialisation"), "{none}");
    assert_eq!(run(0.6, 1.0).unwrap(), fine);
}

/// An FMU that has outputs behind complete steps alone is told of them, unless its description says that it needs not be.
#[test]
fn complete_steps_are_told_where_the_fmu_needs_it() {
    let told = |name: &str, tag: &str| {
        let text = TANKS.replace("<ModelExchange ", &format!("<ModelExchange {tag} "));
        let path = fmu(name, "tanks2.c", &text, &["-DTOLD"])?;
        let twin = Twin::new(open(&path));
        Some(twin.simulate(&[0.6, 0.6, 0.55, 1.0], &drive(), Noise::OFF))
    };
    let Some(path) = tanks() else { return };
    let plain = Twin::new(open(&path)).simulate(&[0.6, 0.6, 0.55, 1.0], &drive(), Noise::OFF);
    let needs = told("told", "").unwrap();
    assert_eq!(needs.unwrap(), plain.unwrap());
    let not = told("untold", "completedIntegratorStepNotNeeded=\"true\"").unwrap();
    assert!(not.is_err(), "it is not told what it says it does not need");
}

/// Heights of the ball in closed form.
fn heights(e: f64, kick: f64, times: impl Iterator<Item = f64>) -> Vec<f64> {
    const G: f64 = 9.81;
    let at = |t: f64| {
        let (mut from, mut h, mut v, mut is_kicked) = (0.0, 1.0f64, 0.0f64, false);
        loop {
            let floor = from + (v + (v * v + 2.0 * G * h).sqrt()) / G;
            let next = if is_kicked { floor } else { floor.min(2.0) };
            if t <= next {
                return h + v * (t - from) - 0.5 * G * (t - from).powi(2);
            }
            let length = next - from;
            (h, v) = (h + v * length - 0.5 * G * length * length, v - G * length);
            if next == floor {
                (h, v) = (0.0, -e * v);
            } else {
                (v, is_kicked) = (v + kick, true);
            }
            from = next;
        }
    };
    times.map(at).collect()
}

#[test]
fn events_of_the_fmu_are_located_between_samples() {
    let Some(path) = fmu("ball", "ball2.c", BALL, &[]) else {
        return;
    };
    let twin = Twin::new(open(&path));
    let outline = twin.outline().unwrap();
    assert_eq!(outline.outputs[0].name, "h_output");
    let drive = Drive::autonomous(0.05, 50).unwrap();
    for (e, kick) in [(0.8, 0.0), (0.7, 3.0), (0.9, 1.0)] {
        let run = twin.simulate(&[e, kick], &drive, Noise::OFF).unwrap();
        let expected = heights(e, kick, (0..50).map(|k| 0.05 * f64::from(k)));
        let pairs = run.iter().zip(&expected);
        let off = pairs.fold(0.0f64, |most, (a, b)| most.max((a - b).abs()));
        assert!(off < 1e-9, "{off} at e = {e}, kick = {kick}");
    }
    // The same for whoever asks, whatever was asked before.
    let one = twin.simulate(&[0.8, 2.0], &drive, Noise::OFF).unwrap();
    let twin = Arc::new(twin);
    (0..32).into_par_iter().for_each(|i| {
        twin.simulate(&[0.6 + 0.01 * f64::from(i), 1.0], &drive, Noise::OFF)
            .unwrap();
        assert_eq!(twin.simulate(&[0.8, 2.0], &drive, Noise::OFF).unwrap(), one);
    });
}

/// The answers of both twins about a record whose upper tank overflows.
#[test]
fn an_effect_on_a_state_inside_is_named_as_of_the_reference_twin() {
    let Some(path) = tanks() else { return };
    let path = path.display().to_string();
    let write = |name: &str, text: &str| fs::write(place().join(name), text).unwrap();
    write(
        "ceiling.toml",
        "[[effect]]\nid = 'state-ceiling'\ntarget = 'h1'\nto = 'h2'\nmagnitudes = { level = 3.0, spill = 0.5 }\n",
    );
    let rest = "[noise]\nh1 = 0.1\nh2 = 0.1\ny = 0.15\n[start]\nh1 = 0.0\nh2 = 0.0\n[record]\nintegrator = 'euler'\nsamples = 160\n\
        [prior]\nk1 = [0.4, 0.8]\nk2 = [0.4, 0.8]\nk3 = [0.4, 0.8]\nk4 = [0.8, 1.2]\n";
    write("rust.toml", &format!("twin = 'tanks'\n{rest}"));
    write("fmu.toml", &format!("twin = 'FmuTanks'\n{rest}"));
    let done = |arguments: &[&str]| {
        let output = truetwin(arguments);
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(0), "{arguments:?}: {said}");
        String::from_utf8(output.stdout).unwrap()
    };
    let line = "simulate --study rust.toml --theta k1=0.6,k2=0.6,k3=0.6,k4=1.0 --effect ceiling.toml --seed 1 --out overflow.csv";
    done(&line.split(' ').collect::<Vec<_>>());
    let external = ["--study", "fmu.toml", "--fmu", &path];
    let own = ["--study", "rust.toml"];
    let json = |verb: &[&str], twin: &[&str]| -> serde_json::Value {
        serde_json::from_str(&done(&[verb, twin, &["--json"]].concat())).unwrap()
    };
    let fit = ["fit", "overflow.csv"];
    let (found, expected) = (json(&fit, &external), json(&fit, &own));
    let evidence = |fit: &serde_json::Value| fit["evidence"]["log_evidence"].as_f64().unwrap();
    assert!(
        (evidence(&found) - evidence(&expected)).abs() < 0.5,
        "{found} {expected}"
    );
    let diagnose = ["diagnose", "overflow.csv", "--quick"];
    let (found, expected) = (json(&diagnose, &external), json(&diagnose, &own));
    let named = |report: &serde_json::Value| {
        let effect = &report["which"]["effects"][0];
        (effect["id"].clone(), effect["target"].clone())
    };
    assert_eq!(named(&found), ("state-ceiling".into(), "h1".into()));
    assert_eq!(named(&found), named(&expected));
}
