//! Golden answers of simulated records.
//!
//! ```console
//! $ cargo test --release --test science golden -- --include-ignored --nocapture     # all of them, minutes
//! ```

#[path = "../common/golden.rs"]
mod common;
#[path = "../../examples/own_twin.rs"]
#[allow(dead_code, unreachable_pub)]
mod own_twin;

use crate::agreement::rooms::Rooms;
use common::Asks::{Diagnosis, Fit, QuickDiagnosis};
use common::{Asks, Case, with_tables, worse};
use own_twin::Tank;
use std::path::Path;
use truetwin::effect::{Catalogue, augment};
use truetwin::evaluate::paper::reference_studies;
use truetwin::external::program::{ProgramSettings, ProgramTwin};
use truetwin::prelude::*;

const OSCILLATOR: &str = "[record]\nintegrator = 'runge-kutta-4'\nsubsteps = 2\n[noise]\ny = 0.01";
const CEILING: &str = "[[effect]]\nid = 'state-ceiling'\ntarget = 'h1'\nto = 'h2'";
const DELAY: &str = "[[effect]]\nid = 'sensor-delay'\ntarget = 'sensor2'";

/// Answers that were right stay, and no search ends lower than it did: a fit and a diagnosis without a gap, and a fit with a threshold.
#[test]
fn golden_answers_stay() {
    let (oscillator, tanks) = (reference("van-der-pol"), reference("tanks"));
    let worse = worse(&[
        case("pol-fit", &oscillator, &["pol-null"], Fit),
        case("pol-null", &oscillator, &["pol-null"], Diagnosis),
        case(
            "tanks-ceiling-fit",
            &with_tables(&tanks, CEILING),
            &["tanks-ceiling"],
            Fit,
        ),
    ]);
    assert!(worse.is_empty(), "{}", worse.join("\n"));
}

/// The same of records that take longer.
#[test]
#[ignore = "minutes: run it in release"]
fn golden_answers_of_longer_records_stay() {
    let tanks = reference("tanks");
    let oscillator = with_tables(&reference("van-der-pol"), OSCILLATOR);
    let mut cases = vec![
        case("tanks-fit", &tanks, &["tanks-null"], Fit),
        case("own-leak", &tank(), &["own-leak"], Diagnosis),
        case(
            "rooms-delay-fit",
            &with_tables(&rooms(), DELAY),
            &["rooms-delay"],
            Fit,
        ),
        case("pol-drag", &oscillator, &["pol-drag"], Diagnosis),
        case("tanks-null", &tanks, &["tanks-null"], Diagnosis),
        case("tanks-ceiling", &tanks, &["tanks-ceiling"], Diagnosis),
        case(
            "tanks-two",
            &tanks,
            &["tanks-ceiling", "tanks-null"],
            QuickDiagnosis,
        ),
        case("rooms-lag", &rooms(), &["rooms-lag"], Diagnosis),
        case("program-fit", &pendulum(), &["program"], Fit),
        case(
            "program-diagnose",
            &pendulum(),
            &["program"],
            QuickDiagnosis,
        ),
    ];
    cases.push(Case {
        name: "tanks-long",
        study: tanks,
        records: vec![long_record()],
        asks: QuickDiagnosis,
    });
    let worse = worse(&cases);
    assert!(worse.is_empty(), "{}", worse.join("\n"));
}

/// A case of records in `tests/golden/records`.
fn case(name: &'static str, study: &Study, records: &[&str], asks: Asks) -> Case {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/golden/records");
    let read = |name: &&str| Record::read(&folder.join(name).with_extension("csv")).unwrap();
    Case {
        name,
        study: study.clone(),
        records: records.iter().map(read).collect(),
        asks,
    }
}

/// A reference twin's study.
fn reference(name: &str) -> Study {
    let mut all = reference_studies().unwrap().into_iter();
    all.find(|study| study.name() == name).unwrap()
}

fn rooms() -> Study {
    Study::new("rooms", Rooms, RecordPlan::levels(0.1, 200, 0.0, 1.0, 25)).unwrap()
}

fn tank() -> Study {
    Study::new("tank", Tank, RecordPlan::levels(0.1, 300, 0.0, 1.0, 20)).unwrap()
}

/// The program of `examples/pendulum.py`.
fn pendulum() -> Study {
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/examples/pendulum.py");
    let twin = ProgramTwin::start("python3", [script], ProgramSettings::default());
    Study::of(twin.unwrap()).unwrap()
}

/// Tanks with a ceiling.
fn long_record() -> Record {
    let text = format!("{CEILING}\nmagnitudes = {{ level = 3.0, spill = 0.5 }}");
    let effects = Catalogue::default().parse(&text).unwrap();
    let twin = augment(reference("tanks").twin().clone(), effects).unwrap();
    let noise = Noise::new(1, "golden", 0);
    let drive = RecordPlan::levels(0.5, 20_000, 0.0, 3.0, 30).drive(&twin.signals(), noise);
    let drive = drive.unwrap();
    let outputs = twin
        .simulate(&[0.6, 0.6, 0.6, 1.0, 3.0, 0.5], &drive, noise)
        .unwrap();
    Record::new(drive, outputs).unwrap()
}
