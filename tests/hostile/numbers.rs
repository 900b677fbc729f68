//! Numbers of users and of their programs that computations cannot take: no call ends by a fault of the program.

use std::fs;
use std::path::Path;
use std::process::{Command, Output};

fn run(folder: &Path, words: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_truetwin"));
    command.args(words).current_dir(folder).output().unwrap()
}

fn told(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

/// Noise that is declared far below what a record with a stop can tell: the range of the fitted level keeps its ends in order.
#[test]
fn noise_that_is_declared_tiny_turns_no_range_around() {
    let place = tempfile::tempdir().unwrap();
    let at = place.path();
    let study = |noise: f64| {
        format!("twin = 'van-der-pol'\n[record]\nsamples = 100\n[noise]\ny = {noise:e}\n")
    };
    fs::write(at.join("plain.toml"), study(0.02)).unwrap();
    fs::write(at.join("tiny.toml"), study(1e-10)).unwrap();
    let made = run(
        at,
        &[
            "simulate",
            "--study",
            "plain.toml",
            "--theta",
            "nu=1",
            "--out",
            "r.csv",
        ],
    );
    assert!(made.status.success(), "{}", told(&made));
    // A sensor that stops at 1.
    let text = fs::read_to_string(at.join("r.csv")).unwrap();
    let clipped = text.lines().map(|line| match line.split_once(',') {
        Some((t, y)) => match y.parse::<f64>() {
            Ok(y) => format!("{t},{}\n", y.clamp(-1.0, 1.0)),
            Err(_) => format!("{line}\n"),
        },
        None => format!("{line}\n"),
    });
    fs::write(at.join("clipped.csv"), clipped.collect::<String>()).unwrap();
    for verb in ["fit", "check"] {
        for record in ["clipped.csv", "r.csv"] {
            let output = run(at, &[verb, record, "--study", "tiny.toml"]);
            assert!(
                output.status.success(),
                "{verb} {record}: {}",
                told(&output)
            );
        }
    }
}

/// A program may answer any finite numbers.
#[test]
fn outputs_that_overflow_are_a_finding() {
    let place = tempfile::tempdir().unwrap();
    let at = place.path();
    fs::write(
        at.join("huge.py"),
        r#"
import sys, json
for line in sys.stdin:
    r = json.loads(line)
    if r["request"] == "describe":
        print(json.dumps({"name": "huge", "parameters": [{"name": "a", "prior": [0.5, 1.5], "bounds": [0.1, 4.0]}, {"name": "b", "prior": [0.5, 1.5], "bounds": [0.1, 4.0]}],
            "inputs": [], "outputs": [{"name": "x"}], "record": {"step": 0.1, "samples": 20}}), flush=True)
    else:
        a = r["theta"]["a"]
        print(json.dumps({"id": r["id"], "outputs": {"x": [a * 1e308 * (-1) ** k for k in range(r["samples"])]}}), flush=True)
"#,
    )
    .unwrap();
    let output = run(at, &["check", "--program", "python3 huge.py"]);
    assert!(matches!(output.status.code(), Some(0 | 1)), "{output:?}");
    let (text, errors) = (String::from_utf8_lossy(&output.stdout), told(&output));
    assert!(text.contains("identifiable"), "{text}{errors}");
    assert!(
        !errors.contains("fault of this program") && !errors.contains("panicked"),
        "{errors}"
    );
}
