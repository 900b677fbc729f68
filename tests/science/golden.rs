//! Golden answers: what commit 8961e62 said of twenty records, before the search, the twins and the answer were drawn anew.
//!
//! A log-likelihood or a log evidence may be higher than its golden value, since a search may arrive farther up; it may not be lower by more
//! than 0.1 nat. `tests/golden/answers.json` was written by that commit's command line, seed 1, from the records beside it.
//!
//! ```console
//! $ cargo test --release --test science golden -- --ignored --nocapture     # all of them, minutes; real rigs where they are at hand
//! ```

use crate::agreement::rooms::Rooms;
use crate::fit::rigs::{Carriage, Heater};
use crate::real_records::data;
use serde_json::Value;
use std::collections::BTreeMap;
use std::path::Path;
use truetwin::diagnose::{DiagnoseSettings, diagnose};
use truetwin::evaluate::paper::reference_studies;
use truetwin::external::program::{ProgramSettings, ProgramTwin};
use truetwin::prelude::*;
use truetwin::study::StudyFile;

/// Nats by which an answer may lie below its golden value.
const BELOW: f64 = 0.1;

/// A record, the study that it is given to, and what is asked.
struct Case {
    name: &'static str,
    twin: &'static str,
    /// Tables of the study file.
    study: &'static str,
    records: &'static [&'static str],
    asks: Asks,
}

#[derive(Clone, Copy, PartialEq)]
enum Asks {
    Fit,
    Diagnosis,
    QuickDiagnosis,
}
use Asks::{Diagnosis, Fit, QuickDiagnosis};

const OSCILLATOR: &str =
    "[record]\nintegrator = 'runge-kutta-4'\nsubsteps = 2\n[noise]\ny = 0.01";
const CEILING: &str = "[[effect]]\nid = 'state-ceiling'\ntarget = 'h1'\nto = 'h2'";
const DELAY: &str = "[[effect]]\nid = 'sensor-delay'\ntarget = 'sensor2'";
const FRICTION: &str = "[[effect]]\nid = 'coulomb-friction'\ntarget = 'v'\n[[effect]]\nid = 'constant-forcing'\ntarget = 'v'";

/// Seconds each: these always run.
const SHORT: &[Case] = &[
    case("pol-fit", "van-der-pol", "", &["pol-null"], Fit),
    case("pol-null", "van-der-pol", "", &["pol-null"], Diagnosis),
    case("tanks-fit", "tanks", "", &["tanks-null"], Fit),
    case("tanks-ceiling-fit", "tanks", CEILING, &["tanks-ceiling"], Fit),
    case("own-leak", "tank", "", &["own-leak"], Diagnosis),
    case("rooms-delay-fit", "rooms", DELAY, &["rooms-delay"], Fit),
];

/// Up to minutes each.
const LONG: &[Case] = &[
    case("pol-drag", "van-der-pol", OSCILLATOR, &["pol-drag"], Diagnosis),
    case("tanks-null", "tanks", "", &["tanks-null"], Diagnosis),
    case("tanks-ceiling", "tanks", "", &["tanks-ceiling"], Diagnosis),
    case("tanks-two", "tanks", "", &["tanks-ceiling", "tanks-null"], QuickDiagnosis),
    case("rooms-lag", "rooms", "", &["rooms-lag"], Diagnosis),
    case("program-fit", "pendulum", "", &["program"], Fit),
    case("program-diagnose", "pendulum", "", &["program"], QuickDiagnosis),
    case("tanks-long", "tanks", "", &["20000 rows"], QuickDiagnosis),
];

/// Real rigs.
const RIGS: &[Case] = &[
    case("real-tanks-fit", "cascaded-tanks", "", &["cascaded-tanks-estimation.csv"], Fit),
    case("real-tanks", "cascaded-tanks", "", &["cascaded-tanks-estimation.csv"], Diagnosis),
    case("tclab-1", "heater", "", &["tclab-first.csv"], Diagnosis),
    case("tclab-2", "heater", "", &["tclab-second.csv"], Diagnosis),
    case("emps-fit", "positioning", FRICTION, &["emps-estimation.csv"], Fit),
    case("emps20", "positioning", "", &["emps-estimation.csv"], Diagnosis),
];

const fn case(
    name: &'static str,
    twin: &'static str,
    study: &'static str,
    records: &'static [&'static str],
    asks: Asks,
) -> Case {
    Case {
        name,
        twin,
        study,
        records,
        asks,
    }
}

/// The study of a case.
fn study(case: &Case) -> Study {
    let plan = |step, samples, low, high, hold| RecordPlan::levels(step, samples, low, high, hold);
    let study = match case.twin {
        "tank" => Study::new("tank", Tank, plan(0.1, 300, 0.0, 1.0, 20)),
        "rooms" => Study::new("rooms", Rooms, plan(0.1, 200, 0.0, 1.0, 25)),
        "heater" => Study::new("heater", Heater, plan(1.0, 600, 0.0, 100.0, 60)),
        "positioning" => Study::new("positioning", Carriage, plan(0.02, 1242, -100.0, 100.0, 50)),
        "pendulum" => {
            let script = concat!(env!("CARGO_MANIFEST_DIR"), "/examples/pendulum.py");
            let settings = ProgramSettings::default();
            let twin = ProgramTwin::start(&format!("python3 '{script}'"), &settings);
            Study::of(twin.unwrap())
        }
        "cascaded-tanks" => {
            let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("examples/cascaded-tanks.toml");
            return reference("tanks").configure(&StudyFile::read(&path).unwrap()).unwrap();
        }
        name => Ok(reference(name)),
    };
    let study = study.unwrap();
    let text = format!("twin = '{}'\n{}", study.name(), case.study);
    study.configure(&StudyFile::parse(&text, Path::new("golden")).unwrap()).unwrap()
}

fn reference(name: &str) -> Study {
    let mut all = reference_studies().unwrap().into_iter();
    all.find(|study| study.name() == name).unwrap()
}

/// The leaking tank of `examples/own_twin.rs`.
struct Tank;

impl StateSpace for Tank {
    fn outline(&self) -> Outline {
        Outline::new()
            .parameter(Parameter::new("k", "m²/s", 0.2, 1.0).within(0.01, 3.0))
            .parameter(Parameter::new("area", "m²", 0.5, 1.5).within(0.2, 5.0))
            .state("h", "m")
            .input("u", "m³/s")
            .output("y", "m")
    }
    fn drift(&self, now: &Now, x: &[f64], dx: &mut [f64]) {
        let (k, area) = (now.theta[0], now.theta[1]);
        dx[0] = (now.u[0] - k * x[0]) / area;
    }
    fn observe(&self, _: &Now, x: &[f64], y: &mut [f64]) {
        y[0] = x[0];
    }
    fn noise(&self, _: &Now, process: &mut [f64], measurement: &mut [f64]) {
        (process[0], measurement[0]) = (0.01, 0.02);
    }
}

/// The records of a case; `None` where those of a real rig are not at hand.
fn records(case: &Case) -> Option<Vec<Record>> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/golden/records");
    (case.records.iter())
        .map(|name| match *name {
            "20000 rows" => Some(long_record()),
            "emps-estimation.csv" => Some(every_other_row(&Record::read(&data(name)?).unwrap())),
            rig if rig.ends_with(".csv") => Some(Record::read(&data(rig)?).unwrap()),
            own => Some(Record::read(&folder.join(own).with_extension("csv")).unwrap()),
        })
        .collect()
}

/// Tanks with a ceiling.
fn long_record() -> Record {
    use truetwin::effect::{Catalogue, augment};
    let text = format!("{CEILING}\nmagnitudes = {{ level = 3.0, spill = 0.5 }}");
    let effects = Catalogue::default().parse(&text).unwrap();
    let twin = augment(reference("tanks").twin().clone(), effects).unwrap();
    let noise = Noise::new(1, "golden", 0);
    let drive = RecordPlan::levels(0.5, 20_000, 0.0, 3.0, 30).drive(&twin.signals(), noise);
    let drive = drive.unwrap();
    let outputs = twin.simulate(&[0.6, 0.6, 0.6, 1.0, 3.0, 0.5], &drive, noise).unwrap();
    Record::new(drive, outputs).unwrap()
}

/// A record at twice its step, inputs averaged over it.
fn every_other_row(record: &Record) -> Record {
    let rows = record.samples() / 2;
    let inputs = record.drive().inputs();
    let mean = Signal::from_shape_fn((rows, inputs.ncols()), |(k, i)| {
        0.5 * (inputs[[2 * k, i]] + inputs[[2 * k + 1, i]])
    });
    let outputs = Signal::from_shape_fn((rows, record.outputs().ncols()), |(k, j)| {
        record.outputs()[[2 * k, j]]
    });
    Record::new(Drive::new(2.0 * record.drive().dt(), mean).unwrap(), outputs).unwrap()
}

/// Compares the answers of cases with their golden ones; prints a line for each, and returns those that are worse.
fn compared(cases: &[Case]) -> Vec<String> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/golden/answers.json");
    let golden: BTreeMap<String, Value> =
        serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap();
    let mut worse = vec![];
    for case in cases {
        let Some(records) = records(case) else {
            continue;
        };
        let clock = std::time::Instant::now();
        let (numbers, words) = answer(&study(case), &records, case.asks);
        let mut line = format!("{}: {:.1} s", case.name, clock.elapsed().as_secs_f64());
        let expected = &golden[case.name];
        for (key, value) in numbers {
            let place = key.split('/').fold(expected, |at, part| &at[part]);
            let Some(before) = place.as_f64() else {
                continue;
            };
            line += &format!("; {key} {:+.3}", value - before);
            if !(value > before - BELOW) {
                worse.push(format!("{}: {key} {before:.3} -> {value:.3}", case.name));
            }
        }
        for (key, value) in words {
            if expected[key] != value {
                worse.push(format!("{}: {key} {} -> {value}", case.name, expected[key]));
            }
        }
        println!("{line}");
    }
    worse
}

/// Figures, by their path in the golden answer, and words.
type Answer = (Vec<(String, f64)>, Vec<(&'static str, Value)>);

fn answer(study: &Study, records: &[Record], asks: Asks) -> Answer {
    if asks == Fit {
        let fit = study.fit(records).unwrap();
        let mut figures = vec![("log_likelihood".to_owned(), fit.log_likelihood)];
        figures.extend(fit.evidence.map(|e| ("log_evidence".to_owned(), e.log_evidence)));
        return (figures, vec![]);
    }
    let settings = DiagnoseSettings {
        quick: asks == QuickDiagnosis,
        ..DiagnoseSettings::default()
    };
    let found = diagnose(study, records, None, &settings, &Progress::silent()).unwrap();
    let effects = found.cause.effects.iter();
    let figures = effects.map(|e| (format!("effects/{}", e.key()), e.log_evidence));
    let words = vec![
        ("verdict", Value::from(found.verdict.id())),
        ("decision", Value::from(found.cause.decision.id())),
        ("accepted", Value::from(sorted(found.cause.accepted))),
    ];
    (figures.collect(), words)
}

fn sorted(mut keys: Vec<String>) -> Vec<String> {
    keys.sort();
    keys
}

/// Answers that were right stay, and no search ends lower than it did.
#[test]
fn golden_answers_stay() {
    let worse = compared(SHORT);
    assert!(worse.is_empty(), "{}", worse.join("\n"));
}

/// The same of the longer ones and of real rigs.
#[test]
#[ignore = "minutes: run it in release"]
fn all_golden_answers_stay() {
    let worse = [compared(SHORT), compared(LONG), compared(RIGS)].concat();
    assert!(worse.is_empty(), "{}", worse.join("\n"));
}
