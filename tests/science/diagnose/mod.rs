//! False-alarm rates and named effects of diagnoses.

mod black_box;
mod complete;
mod memory;
mod share;
mod study_of_many;
mod swallowed;
pub(crate) mod trials;

use crate::binomial_bounds;
use std::path::Path;
use std::sync::Arc;
use trials::*;
use truetwin::diagnose::{Decision, DiagnoseSettings, Diagnosis, Verdict, diagnose};
use truetwin::progress::{Listener, Progress};
use truetwin::record::{Drive, Record, Signal};
use truetwin::study::{Study, StudyFile};
use truetwin::twin::{Integrator, Noise, Twin};

/// Rate of false alarms that the tests of it claim. Measured: none in 251 sealed trials (docs/withheld.md).
pub const FALSE_ALARMS: f64 = 0.01;

/// Checks that records of the twins themselves, half of them with θ outside the prior, are rarely called a gap, and that nothing is named
/// of the first of each twin.
fn rarely_accused(records: u64) {
    let verdict_alone = DiagnoseSettings {
        detection_only: true,
        ..DiagnoseSettings::default()
    };
    let mut alarms = 0;
    for name in ["van-der-pol", "tanks"] {
        let study = study(name);
        for i in 0..records / 2 {
            let noise = Noise::new(31, name, i);
            let theta = theta(&study, i % 2 == 1, noise);
            let record = record(study.twin(), "", &theta, drive(&study, noise), noise);
            let found = match i < 1 {
                true => found(&study, record, None),
                false => with_settings(&study, record, &verdict_alone),
            };
            alarms += u64::from(found.verdict == Verdict::StructuralGap);
            if found.verdict != Verdict::StructuralGap {
                assert!(found.cause.accepted.is_empty() && found.location.targets.is_empty());
            }
        }
    }
    let most = *binomial_bounds(records, FALSE_ALARMS, 0.99).end();
    assert!(alarms <= most, "{alarms} of {records}, at most {most}");
}

/// Of 6 records at most 1 alarm: a version that accuses every other perfect twin fails with a probability of 0.89, one in three with 0.65.
#[test]
fn a_perfect_twin_is_rarely_accused() {
    rarely_accused(6);
}

/// Of 400 records at most 10 alarms: a version that accuses one perfect twin in twenty fails with a probability of 0.99.
#[test]
#[ignore = "minutes; run it in release"]
fn a_perfect_twin_is_rarely_accused_over_many_records() {
    rarely_accused(400);
}

/// Effects that a record shows clearly are detected, located, and named or among the rivals of the whole library.
fn found_and_named(keys: &[&str]) {
    let study = study("van-der-pol");
    let effects = clear("van-der-pol");
    for &key in keys {
        let (_, text) = effects.iter().find(|(k, _)| *k == key).unwrap();
        let noise = Noise::new(32, key, 0);
        let text = format!("[[effect]]\n{text}\n");
        let drive = drive(&study, noise);
        let record = record(study.twin(), &text, &[1.4], drive, noise);
        let found = found(&study, record, None);
        println!("{}", line(key, &found));
        assert_eq!(found.verdict, Verdict::StructuralGap, "{key}");
        assert!(
            found.cause.class.iter().any(|c| c == key),
            "{key}: {:?}",
            found.cause.class
        );
        assert_eq!(found.location.target.as_deref(), key.split('@').nth(1));
        let shares: f64 = found.location.targets.iter().map(|t| t.probability).sum();
        assert!(shares <= 1.0 + 1e-9);
    }
}

/// One effect: a version that looks at the wrong place or ranks the effects wrongly fails.
#[test]
fn a_clear_effect_is_found_and_named() {
    found_and_named(&["sensor-rectification@sensor"]);
}

/// An effect of the sensor, of a rate and of a parameter.
#[test]
#[ignore = "a minute; run it in release"]
fn clear_effects_are_found_and_named() {
    found_and_named(&[
        "cubic-stiffness@x2",
        "sensor-rectification@sensor",
        "parameter-step@nu",
    ]);
}

/// Effects that the error of a coarse step passes for, and those of the records.
const LIKE_A_STEP: [&str; 5] = [
    "cubic-stiffness",
    "linear-loss",
    "sensor-delay",
    "sensor-gain",
    "sensor-lag",
];

/// Euler's error and a stiffer spring together, seen almost without noise: the spring alone is named, with a step that is no longer Euler's.
/// Four of Euler's substeps leave an error that passes for a lag of the sensor.
fn no_rest_is_named(seeds: u64, found: impl Fn(&Study, Record) -> Diagnosis) {
    let whole = study("van-der-pol");
    let configured = |record: &str| {
        let text = format!("twin = 'van-der-pol'\n{record}\n[noise]\ny = 0.01\n");
        let file = StudyFile::parse(&text, Path::new("study.toml")).unwrap();
        whole.configure(&file).unwrap()
    };
    let (coarse, fine) = (configured(""), configured("[record]\nsubsteps = 64"));
    let spring = "[[effect]]\nid = 'cubic-stiffness'\ntarget = 'x2'\nfrom = 'x1'\nmagnitudes = { coefficient = 0.17 }\n";
    for seed in 0..seeds {
        let noise = Noise::new(36, "coarse", seed);
        let record = record(fine.twin(), spring, &[1.24], drive(&coarse, noise), noise);
        let found = found(&coarse, record);
        println!("{}", line("cubic-stiffness@x2", &found));
        assert_eq!(found.cause.accepted, ["cubic-stiffness@x2"], "seed {seed}");
        assert_eq!(
            found.integrator,
            Some(Integrator::RungeKutta4),
            "seed {seed}"
        );
    }
}

/// One record, few rivals: a version that keeps Euler's step names a lag as well.
#[test]
fn the_rest_of_a_coarse_step_is_not_named() {
    no_rest_is_named(1, |study, record| found_among(study, record, &LIKE_A_STEP));
}

/// Two records, the whole library.
#[test]
#[ignore = "a minute; run it in release"]
fn the_rest_of_a_coarse_step_is_not_named_by_the_library() {
    no_rest_is_named(2, |study, record| found(study, record, None));
}

/// A delay of a sensor without noise: once it is known, the step that looked fine enough is not, and its error passes for a lag. A
/// version that refines the step once names the lag.
#[test]
fn a_finer_step_is_asked_for_as_often_as_it_shows() {
    let study = study("van-der-pol");
    let text = "twin = 'van-der-pol'\n[record]\nsubsteps = 64\n";
    let file = StudyFile::parse(text, Path::new("study.toml")).unwrap();
    let exact = study.configure(&file).unwrap();
    let delay =
        "[[effect]]\nid = 'sensor-delay'\ntarget = 'sensor'\nmagnitudes = { delay = 0.75 }\n";
    let noise = Noise::new(37, "late", 0);
    let record = record(exact.twin(), delay, &[1.1], drive(&study, noise), noise);
    let found = found_among(&study, record, &["sensor-delay", "sensor-lag"]);
    println!("{}", line("sensor-delay@sensor", &found));
    assert_eq!(found.cause.accepted, ["sensor-delay@sensor"]);
    let (_, delay) = found.cause.effects[0].magnitudes[0];
    assert!((delay - 0.75).abs() < 0.02, "{delay}");
}

/// The diagnosis of a record of the tanks at the centre of the prior, with an effect, by these effects.
fn found_in_tanks(key: &str, magnitudes: &str, among: &[&str]) -> Diagnosis {
    let study = study("tanks");
    let (id, target) = key.split_once('@').unwrap();
    let text = format!("[[effect]]\nid='{id}'\ntarget='{target}'\nmagnitudes={{{magnitudes}}}\n");
    let noise = Noise::new(33, key, 0);
    let theta = study.twin().parameters().centre();
    let record = record(study.twin(), &text, &theta, drive(&study, noise), noise);
    let found = found_among(&study, record, among);
    println!("{}", line(key, &found));
    found
}

/// Steps of a converter that louder noise could pass for are told by the values themselves; few levels are no limited range, and no twin that
/// is quiet at one of them is any likelier.
#[test]
fn a_rounded_sensor_is_known_by_its_values() {
    let key = "sensor-quantization@sensor";
    for step in ["0.4", "2.5"] {
        let rivals = [
            "sensor-quantization",
            "sensor-noise",
            "sensor-saturation",
            "sensor-backlash",
        ];
        let found = found_in_tanks(key, &format!("step={step}"), &rivals);
        assert_eq!(found.verdict, Verdict::StructuralGap);
        assert_eq!(found.cause.accepted, [key], "step {step}");
        assert!(found.cause.effects[0].probability > 0.9);
    }
}

/// A parameter that jumps late in a record: the likelihood as a function of the time has a valley at each sample and a plateau before, where a
/// search from one start ends. `complete::a_gap_begins_where_it_begins` finds another among the whole library.
#[test]
fn a_step_is_found_at_its_time() {
    let key = "parameter-step@k3";
    let rivals = [
        "parameter-step",
        "parameter-drift",
        "linear-loss",
        "sensor-drift",
    ];
    let found = found_in_tanks(key, "size=-0.5,time=119.0", &rivals);
    assert_eq!(found.cause.effects[0].key(), key);
    let (name, at) = &found.cause.effects[0].magnitudes[1];
    assert_eq!(name, "time");
    assert!((at - 119.0).abs() < 1.5, "{at} s in place of 119 s");
}

/// A sensor that reads 6 % too little, which the parameters imitate outside their prior: beside those, the gain promises nothing, and a
/// ceiling of the lower tank was named with certainty.
#[test]
fn an_effect_is_found_that_drove_the_parameters_out() {
    let study = study("tanks");
    let gain =
        "[[effect]]\nid = 'sensor-gain'\ntarget = 'sensor'\nmagnitudes = { error = -0.06 }\n";
    let noise = Noise::new(38, "gain", 0);
    let theta = [0.72, 1.03, 0.484, 0.72];
    let record = record(study.twin(), gain, &theta, drive(&study, noise), noise);
    let rivals = ["sensor-gain", "sensor-bias", "sensor-lag", "state-ceiling"];
    let found = found_among(&study, record, &rivals);
    println!("{}", line("sensor-gain@sensor", &found));
    let (best, class) = (&found.cause.effects[0], &found.cause.class);
    assert_eq!(best.target, "sensor", "{class:?}");
    assert!(class.contains(&"sensor-gain@sensor".into()), "{class:?}");
}

/// A delay of thirty samples, far longer than any register of a filter: actuators are computed before it.
#[test]
fn a_long_delay_of_an_actuator_is_named() {
    let key = "actuator-delay@actuator";
    let rivals = [
        "actuator-delay",
        "actuator-lag",
        "sensor-delay",
        "sensor-lag",
        "parameter-drift",
    ];
    let found = found_in_tanks(key, "delay=15.0", &rivals);
    assert_eq!(found.cause.accepted, [key]);
    let (_, delay) = found.cause.effects[0].magnitudes[0];
    assert!((delay - 15.0).abs() < 1.0, "{delay}");
}

/// A gain of the pump is nothing but another k4: no structural gap.
#[test]
fn what_parameters_absorb_is_no_structural_gap() {
    let study = study("tanks");
    let effect =
        "[[effect]]\nid = 'actuator-gain'\ntarget = 'actuator'\nmagnitudes = { error = 0.2 }\n";
    let noise = Noise::new(33, "absorbed", 0);
    let theta = [0.6, 0.5, 0.55, 1.1];
    let record = record(study.twin(), effect, &theta, drive(&study, noise), noise);
    let found = found(&study, record, None);
    assert_ne!(
        found.verdict,
        Verdict::StructuralGap,
        "{}",
        line("absorbed", &found)
    );
}

/// An effect that would explain a parameter gap as well is listed with its own probability, and only where it is more probable than nothing
/// beside parameters inside the prior. A ceiling is much like other valves.
#[test]
fn what_absorbs_a_parameter_gap_is_no_more_probable_than_all_that_is_listed() {
    let study = study("tanks");
    let effect = "[[effect]]\nid = 'state-ceiling'\ntarget = 'h1'\nto = 'h2'\nmagnitudes = { level = 5.0, spill = 0.0 }\n";
    let theta = [0.6, 0.5, 0.55, 1.0];
    for seed in 63..66 {
        let noise = Noise::new(seed, "parameter-gap", 0);
        let record = record(study.twin(), effect, &theta, drive(&study, noise), noise);
        let settings = DiagnoseSettings {
            quick: true,
            ..DiagnoseSettings::default()
        };
        let found = diagnose(&study, &[record], None, &settings, &Progress::silent());
        let cause = found.unwrap().cause;
        let listed = cause.probabilities.listed + cause.probabilities.partial;
        for effect in &cause.effects {
            assert!(
                effect.probability <= listed + 1e-9,
                "seed {seed}: {cause:?}"
            );
        }
        if cause.decision == Decision::Absorbed {
            let are_likely = cause.effects.iter().all(|e| e.log_evidence > 0.0);
            return assert!(are_likely, "seed {seed}");
        }
    }
    panic!("no record has a parameter gap with a rival");
}

/// A force that nobody listed is detected, and no effect is named for it. `memory::a_response_to_the_own_cycle_is_no_wave` asks the same of
/// another.
#[test]
#[ignore = "half a minute; run it in release"]
fn an_unlisted_force_is_named_by_nobody() {
    let study = study("van-der-pol");
    let noise = Noise::new(34, "unlisted", 0);
    let base = study.twin().clone();
    let twin = Twin::new(Unlisted { base, kind: 3 });
    let record = record(&twin, "", &[1.5], drive(&study, noise), noise);
    let found = found(&study, record, None);
    println!("{}", line("unlisted", &found));
    assert_eq!(found.verdict, Verdict::StructuralGap);
    assert_eq!(found.cause.decision, Decision::NoneOfThese);
    assert!(found.cause.accepted.is_empty());
    assert_eq!(found.location.target.as_deref(), Some("x2"));
}

/// The same seed gives the same bits on one thread and on three; another seed the same answer.
#[test]
fn threads_change_no_bit() {
    let study = study("van-der-pol");
    let noise = Noise::new(35, "threads", 0);
    let (_, text) = clear("van-der-pol")[11];
    let text = format!("[[effect]]\n{text}\n");
    let record = record(study.twin(), &text, &[1.2], drive(&study, noise), noise);
    let run = |threads: usize, seed: u64| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        let settings = DiagnoseSettings {
            seed,
            ..DiagnoseSettings::default()
        };
        let mut found = pool.install(|| {
            diagnose(
                &study,
                std::slice::from_ref(&record),
                None,
                &settings,
                &Progress::silent(),
            )
            .unwrap()
        });
        found.seconds = 0.0;
        found
    };
    let one = run(1, 1);
    assert_eq!(format!("{one:?}"), format!("{:?}", run(3, 1)));
    let other = run(1, 2);
    assert_eq!(one.cause.accepted, other.cause.accepted);
    assert!((one.detection.log_evidence - other.detection.log_evidence).abs() < 0.5);
}

struct Stop;
impl Listener for Stop {
    fn advanced(&self, _: &str, _: u64, _: u64) {}
    fn cancelled(&self) -> bool {
        true
    }
}

#[test]
fn what_cannot_be_diagnosed_is_refused_in_one_line() {
    let study = study("van-der-pol");
    let noise = Noise::new(36, "refused", 0);
    let good = record(study.twin(), "", &[1.2], drive(&study, noise), noise);
    let run = |records: &[Record], settings: &DiagnoseSettings, progress: &Progress| {
        diagnose(&study, records, None, settings, progress)
            .unwrap_err()
            .to_string()
    };
    let (usual, silent) = (DiagnoseSettings::default(), Progress::silent());
    assert!(run(&[], &usual, &silent).contains("at least one"));
    let short = Record::new(Drive::autonomous(0.05, 3).unwrap(), Signal::zeros((3, 1))).unwrap();
    assert!(run(&[short], &usual, &silent).contains("at least 4"));
    let unknown = DiagnoseSettings {
        without: vec!["sensor-lags@sensor".into()],
        ..usual.clone()
    };
    let one = std::slice::from_ref(&good);
    assert!(run(one, &unknown, &silent).contains("sensor-lags@sensor"));
    assert_eq!(
        run(one, &usual, &Progress::new(Arc::new(Stop))),
        "cancelled"
    );
}
