//! `--program` as a user meets it.

use super::{file, lag, place, python};
use std::process::{Command, Output};

fn truetwin(arguments: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_truetwin"));
    command
        .args(arguments)
        .current_dir(place())
        .output()
        .unwrap()
}

pub(super) fn done(arguments: &[&str]) -> String {
    let output = truetwin(arguments);
    let message = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(0), "{arguments:?}: {message}");
    String::from_utf8(output.stdout).unwrap()
}

/// Exit 2 and one line with these parts.
pub(super) fn refused(arguments: &[&str], parts: &[&str]) {
    let output = truetwin(arguments);
    let message = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(2), "{arguments:?}: {message}");
    assert!(output.stdout.is_empty(), "{arguments:?}");
    assert_eq!(message.trim_end().lines().count(), 1, "{message}");
    for part in parts {
        assert!(message.contains(part), "\"{part}\" is not in: {message}");
    }
}

#[test]
fn a_program_is_trained_for_estimated_and_diagnosed() {
    let Some(python) = python() else { return };
    file("lag twin.py", &lag("pass"));
    let program = format!("{python} 'lag twin.py'");
    let with = |arguments: &[&str]| done(&[arguments, &["--program", &program]].concat());
    assert!(with(&["check"]).contains("checks passed"));
    // A program that a call would not use is refused.
    let both = ["--program", &program, "--twin", "tanks"];
    let parts = [
        "--twin names the twin tanks",
        "the twin lag",
        "give one of them",
    ];
    refused(&[&["check"][..], &both].concat(), &parts);
    file("tanks.toml", "twin = 'tanks'\n");
    let both = ["--program", &program, "--study", "tanks.toml"];
    refused(
        &[&["check"][..], &both].concat(),
        &["--study names the twin tanks"],
    );
    assert!(with(&["twins"]).contains("tau"));
    assert!(with(&["effects"]).contains("sensor-bias"));
    let small = ["--bank-size", "1000", "--epochs", "20", "--out"];
    with(&[&["pretrain", "--workers", "2"], &small[..], &["lag.est"]].concat());
    with(&["simulate", "--theta", "tau=4,gain=1.5", "--out", "lag.csv"]);
    let estimate = [
        "estimate",
        "lag.csv",
        "--estimator",
        "lag.est",
        "--json",
        "--always-refine",
    ];
    let value: serde_json::Value = serde_json::from_str(&with(&estimate)).unwrap();
    for (j, truth) in [4.0, 1.5].into_iter().enumerate() {
        let found = value["theta"]["final"][j].as_f64().unwrap();
        assert!((found / truth - 1.0).abs() < 0.05, "{found} for {truth}");
    }
    refused(
        &estimate[..4],
        &["lag.est", "made for twin \"lag\"", "--program"],
    );
    // In a setting of one's own, which adds noise; the program's name is the twin's.
    let study =
        "twin = 'lag'\n[fixed]\ntau = 2\n[[effect]]\nid = 'sensor-noise'\ntarget = 'sensor'\n";
    file("lag.toml", study);
    let twice = [
        "simulate",
        "--study",
        "lag.toml",
        "--theta",
        "gain=1,sensor-noise@sensor.std=0.1",
    ];
    assert_eq!(
        with(&twice),
        with(&[&twice[..], &["--workers", "1", "--threads", "1"]].concat())
    );
}

#[test]
fn wrong_calls_are_refused_in_one_line() {
    refused(&["check"], &["--twin", "--study", "--program"]);
    refused(
        &["check", "--twin", "tanks", "--workers", "2"],
        &["--workers", "--program"],
    );
    refused(
        &["check", "--twin", "tanks", "--variables", "k"],
        &["--variables", "--fmu"],
    );
    #[cfg(not(feature = "fmi"))]
    refused(
        &["check", "--fmu", "rig.fmu"],
        &["rig.fmu", "--features fmi"],
    );
    refused(&["check", "--program", ""], &["no program is named"]);
    refused(&["check", "--program", "python3 'x"], &["quote"]);
    refused(
        &["twins", "--program", "./nowhere/to be found"],
        &["./nowhere/to", "cannot be started"],
    );
    let Some(python) = python() else { return };
    file(
        "lag.py",
        &lag("print('the mesh is gone', file=sys.stderr); os._exit(7)"),
    );
    let program = format!("{python} lag.py");
    let with = |arguments: &[&str], parts: &[&str]| {
        refused(&[arguments, &["--program", &program]].concat(), parts);
    };
    with(&["twins", "--timeout=-1"], &["--timeout -1"]);
    with(&["twins", "--workers", "0"], &["workers = 0"]);
    with(
        &["simulate", "--theta", "tau=1,gain=1"],
        &["exit status: 7", "the mesh is gone"],
    );
    with(
        &["pretrain", "--out", "never.est"],
        &["none of 5 simulations worked", "the mesh is gone"],
    );
    with(&["check", "--twin", "lagg"], &["\"lagg\"", "tanks, lag"]);
    file("tanks.py", &lag("pass").replace("\"lag\"", "\"tanks\""));
    let taken = format!("{python} tanks.py");
    refused(
        &["check", "--program", &taken],
        &["\"tanks\"", "another name"],
    );
    file("broken.py", "import no_such_module");
    let broken = format!("{python} broken.py");
    refused(
        &["check", "--program", &broken],
        &["no_such_module", "describe itself"],
    );
    assert!(!place().join("never.est").exists());
}
