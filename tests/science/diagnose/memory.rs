//! Laws that remember: those that the library lists are named, those that it does not are told with their place.

use super::trials::*;
use truetwin::diagnose::{Decision, Diagnosis, Verdict};
use truetwin::record::{Drive, Record, Signal};
use truetwin::study::{Study, StudyFile};
use truetwin::twin::Noise;

/// What a force on the oscillator's velocity remembers of its position.
type Memory = fn(&mut f64, f64) -> f64;

/// A first-order lag of 1.1 s in a smooth relay.
fn lagged(z: &mut f64, x: f64) -> f64 {
    *z += (0.05 / 1.1) * (x - *z);
    (2.0 * *z).tanh()
}

/// A relay that switches at ±0.9, each way at the other end.
fn relay(z: &mut f64, x: f64) -> f64 {
    if x.abs() > 0.9 {
        *z = x.signum();
    }
    *z
}

/// A play of ±0.8.
fn play(z: &mut f64, x: f64) -> f64 {
    *z = z.clamp(x - 0.8, x + 0.8);
    *z
}

/// The reference oscillator in Euler's steps, its velocity driven by a memory of its position; an output with noise of 0.02.
fn remembering(memory: Memory, force: f64, samples: usize, noise: Noise) -> Record {
    let (mut x, mut z) = ([1.0, 0.0f64], 0.0);
    let (mut process, mut sensor) = (noise.source("process"), noise.source("sensor"));
    let outputs = Signal::from_shape_fn((samples, 1), |_| {
        let y = x[0] + 0.02 * sensor.normal();
        let rate = 1.3 * (1.0 - x[0] * x[0]) * x[1] - x[0] + force * memory(&mut z, x[0]);
        let w = [process.normal(), process.normal()];
        x = [
            x[0] + 0.05 * x[1] + 0.01 * w[0],
            x[1] + 0.05 * rate + 0.01 * w[1],
        ];
        y
    });
    Record::new(Drive::autonomous(0.05, samples).unwrap(), outputs).unwrap()
}

/// What a law of the position remembers drives the velocity. A wave at the oscillator's own frequency imitates it: it is not named, and the
/// place is told.
fn no_wave(laws: &[(&str, Memory, f64)]) {
    let file =
        StudyFile::parse("twin = 'van-der-pol'\n[noise]\ny = 0.02", "s.toml".as_ref()).unwrap();
    let study = study("van-der-pol").configure(&file).unwrap();
    for &(name, memory, force) in laws {
        let record = remembering(memory, force, 300, Noise::new(61, name, 0));
        let found = found(&study, record, None);
        println!("{}", line(name, &found));
        assert_eq!(found.verdict, Verdict::StructuralGap, "{name}");
        let is_wave = |key: &String| key.starts_with("periodic");
        assert!(!found.cause.accepted.iter().any(is_wave), "{name}");
        // A lag of a position is nearly a friction, which the library has.
        if name != "lag" {
            assert_eq!(found.cause.decision, Decision::NoneOfThese, "{name}");
        }
        assert_eq!(found.location.target.as_deref(), Some("x2"), "{name}");
    }
}

/// A relay with hysteresis, and the whole library: a version that names whatever fits fails.
#[test]
fn a_response_to_the_own_cycle_is_no_wave() {
    no_wave(&[("relay", relay, 0.7)]);
}

/// A lag, a relay and a play.
#[test]
#[ignore = "a minute; run it in release"]
fn responses_to_the_own_cycle_are_no_waves() {
    no_wave(&[
        ("lag", lagged, 0.9),
        ("relay", relay, 0.7),
        ("play", play, 0.7),
    ]);
}

/// Listed laws with a memory, a mode, a floor and Stribeck's friction.
const LISTED: [(&str, &str, &str); 5] = [
    (
        "van-der-pol",
        "sensor-backlash@sensor",
        "id='sensor-backlash'\ntarget='sensor'\nmagnitudes={width=0.8}",
    ),
    (
        "van-der-pol",
        "sensor-mode@sensor",
        "id='sensor-mode'\ntarget='sensor'\nmagnitudes={frequency=1.2,damping=0.05}",
    ),
    (
        "van-der-pol",
        "state-hysteresis@x2",
        "id='state-hysteresis'\ntarget='x2'\nfrom='x1'\nmagnitudes={force=0.5,width=0.4}",
    ),
    (
        "van-der-pol",
        "stribeck-friction@x2",
        "id='stribeck-friction'\ntarget='x2'\nmagnitudes={force=0.2,excess=1.0,velocity=0.5}",
    ),
    (
        "tanks",
        "state-floor@h1",
        "id='state-floor'\ntarget='h1'\nmagnitudes={level=3.0}",
    ),
];

/// They are named where a record of the reference twins shows them clearly, at their own place.
fn named(laws: &[(&str, &str, &str)], found: impl Fn(&Study, Record) -> Diagnosis) {
    for &(twin, key, text) in laws {
        let study = study(twin);
        let noise = Noise::new(62, key, 0);
        let theta: &[f64] = if twin == "tanks" {
            &[0.6, 0.6, 0.6, 1.0]
        } else {
            &[1.4]
        };
        let text = format!("[[effect]]\n{text}\n");
        let record = record(study.twin(), &text, theta, drive(&study, noise), noise);
        let found = found(&study, record);
        println!("{}", line(key, &found));
        assert!(
            found.cause.class.iter().any(|k| k == key),
            "{key}: {:?}",
            found.cause.class
        );
    }
}

/// A hysteresis of a rate, beside what imitates it: a version whose filter forgets names another.
#[test]
fn a_law_that_remembers_is_named() {
    let rivals = [
        "sensor-backlash",
        "sensor-lag",
        "state-hysteresis",
        "periodic-disturbance",
        "coulomb-friction",
    ];
    named(&LISTED[2..3], |study, record| {
        found_among(study, record, &rivals)
    });
}

/// All of them, in the whole library.
#[test]
#[ignore = "minutes; run it in release"]
fn laws_that_remember_are_named() {
    named(&LISTED, |study, record| found(study, record, None));
}
