//! Numbers of users and of their programs that computations cannot take: no call ends by a fault of the program.

use crate::calls::told;
use std::fs;
use std::path::Path;
use std::process::{Command, Output};

fn run(folder: &Path, words: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_truetwin"));
    command.args(words).current_dir(folder).output().unwrap()
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
    assert_eq!(output.status.code(), Some(1), "{output:?}");
    let (text, errors) = (String::from_utf8_lossy(&output.stdout), told(&output));
    assert!(text.contains("choose a unit"), "{text}{errors}");
    assert!(
        !errors.contains("fault of this program") && !errors.contains("panicked"),
        "{errors}"
    );
}

/// A first-order lag whose parameter has this size, and whose output has that one.
fn lag(parameter: f64, output: f64) -> String {
    format!(
        "[parameters]\na = {{ prior = [{:e}, {:e}], bounds = [{:e}, {:e}] }}\n[states]\nx = {{ rate = \"u - x*a/{parameter:e}\", start = 0.0 }}\n\
         [inputs]\nu = {{}}\n[outputs]\ny = {{ value = \"x*{output:e}\", noise = {:e} }}\n[record]\nstep = 0.1\nsamples = 60\n\
         input = {{ levels = [-1, 1], hold = 10 }}\n",
        0.5 * parameter,
        1.5 * parameter,
        0.1 * parameter,
        4.0 * parameter,
        0.01 * output
    )
}

/// Answers do not depend on the unit of a parameter, where its squares overflow or vanish, either.
#[test]
fn parameters_and_outputs_of_any_size_are_estimated_alike() {
    let place = tempfile::tempdir().unwrap();
    let at = place.path();
    let (mut answers, mut fits) = (vec![], vec![]);
    let sizes = [1.0, 1e160, 1e-160, 1e300, 1e-290].map(|size| (size, 1.0));
    for (size, output) in sizes.into_iter().chain([(1.0, 1e-90), (1.0, 1e90)]) {
        let name = |ending: &str| format!("{size:e}-{output:e}.{ending}");
        fs::write(at.join(name("toml")), lag(size, output)).unwrap();
        let (study, record, estimator) = (name("toml"), name("csv"), name("est"));
        let (theta, study) = (format!("a={size:e}"), ["--study", &study]);
        for (verb, rest) in [
            ("simulate", vec!["--theta", &theta, "--out", &record]),
            (
                "pretrain",
                vec!["--bank-size", "200", "--epochs", "1", "--out", &estimator],
            ),
        ] {
            let output = run(at, &[&[verb], &study[..], &rest].concat());
            assert!(output.status.success(), "{size:e}: {}", told(&output));
        }
        let output = run(
            at,
            &["estimate", &record, "--estimator", &estimator, "--json"],
        );
        assert!(output.status.success(), "{size:e}: {}", told(&output));
        let json: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
        let number = |value: &serde_json::Value| value.as_f64().unwrap_or(f64::NAN);
        let output = run(at, &["fit", &record, study[0], study[1], "--json"]);
        assert!(output.status.success(), "{size:e}: {}", told(&output));
        let fit: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
        let fitted = &fit["parameters"][0];
        fits.push([
            number(&fitted["value"]) / size,
            number(&fitted["std_error"]) / size,
            number(&fitted["prior_share"]),
        ]);
        answers.push([
            number(&json["theta"]["final"][0]) / size,
            number(&json["std_error"][0]) / size,
            number(&json["interval"]["low"][0]) / size,
            number(&json["gate"]["p_value"]),
            number(&json["after"]["p_value"]),
            number(&json["gate"]["statistic"]),
        ]);
    }
    for fit in &fits {
        let pairs = fit.iter().zip(&fits[0]);
        assert!(
            { pairs }.all(|(own, first)| (own / first - 1.0).abs() < 1e-6),
            "{fits:?}"
        );
    }
    let [value, ..] = answers[0];
    assert!((value - 1.0).abs() < 0.1, "{answers:?}");
    // The network computes with 32 bits, and is trained on 200 simulations.
    for answer in &answers {
        let [value, error, low, gate, after, statistic] = *answer;
        let first = &answers[0];
        assert!((value - first[0]).abs() < 0.1 * first[1], "{answers:?}");
        assert!((error / first[1] - 1.0).abs() < 0.05, "{answers:?}");
        assert!((low - first[2]).abs() < 0.2 * first[1], "{answers:?}");
        assert!(gate > 0.1 && after > 0.1, "{answers:?}");
        // It belongs to the network, which rounding may train a little differently; a unit in it would show by orders of magnitude.
        assert!((statistic / first[5] - 1.0).abs() < 0.3, "{answers:?}");
    }
}

/// Outputs whose squares overflow or vanish are refused with the remedy, wherever they come from.
#[test]
fn outputs_of_such_a_size_ask_for_another_unit() {
    let place = tempfile::tempdir().unwrap();
    let at = place.path();
    for size in [1e160, 1e-160] {
        fs::write(at.join("s.toml"), lag(1.0, size)).unwrap();
        let rows =
            (0..60).map(|k| format!("{},1,{:e}\n", 0.1 * f64::from(k), size * f64::from(k % 7)));
        fs::write(
            at.join("r.csv"),
            "t,u,y\n".to_owned() + &rows.collect::<String>(),
        )
        .unwrap();
        for (words, code) in [
            ("simulate --study s.toml --theta a=1", 2),
            ("fit r.csv --study s.toml", 2),
            ("diagnose r.csv --study s.toml --quick", 2),
            (
                "pretrain --study s.toml --bank-size 200 --epochs 1 --out e.est",
                2,
            ),
            ("check --study s.toml", 1),
        ] {
            let output = run(at, &words.split(' ').collect::<Vec<_>>());
            let said = told(&output) + &String::from_utf8_lossy(&output.stdout);
            assert_eq!(output.status.code(), Some(code), "{words}: {said}");
            let (unit, largest) = (
                said.contains("choose a unit"),
                said.contains("largest value of a record"),
            );
            assert!(unit || largest, "{words}: {said}");
        }
        assert!(!at.join("e.est").exists());
    }
}

/// States are no outputs that a record shows, and have squares, too.
#[test]
fn states_of_such_a_size_ask_for_another_unit() {
    let place = tempfile::tempdir().unwrap();
    let at = place.path();
    for size in [1e170, 1e-170] {
        let study = format!(
            "[parameters]\na = {{ prior = [0.5, 2.0], bounds = [0.1, 9.0] }}\n[states]\nx = {{ rate = \"a*({size:e}*u - x)\", noise = {:e} }}\n\
             [inputs]\nu = {{}}\n[outputs]\ny = {{ value = \"x/{size:e}\", noise = 0.05 }}\n[record]\nstep = 0.2\nsamples = 60\n\
             input = {{ levels = [0, 1], hold = 10 }}\n",
            0.01 * size
        );
        fs::write(at.join("s.toml"), study).unwrap();
        let made = "simulate --study s.toml --theta a=1.3 --out r.csv";
        let output = run(at, &made.split(' ').collect::<Vec<_>>());
        assert!(output.status.success(), "{}", told(&output));
        for verb in ["fit", "diagnose"] {
            let output = run(at, &[verb, "r.csv", "--study", "s.toml"]);
            assert_eq!(output.status.code(), Some(2), "{output:?}");
            let said = told(&output);
            // What is too large diverges before it has a size.
            let part = if size < 1.0 {
                "state x is"
            } else {
                "check units"
            };
            assert!(said.contains(part), "{said}");
        }
        fs::remove_file(at.join("r.csv")).unwrap();
    }
}

/// A record in another unit, far beyond all that the bounds allow: the fit ends, says what lies at a bound, and stays within them.
#[test]
fn a_record_beyond_all_bounds_is_fitted_at_them() {
    let place = tempfile::tempdir().unwrap();
    let at = place.path();
    let study = "[parameters]\na = { prior = [0.5, 2], bounds = [0.1, 5] }\n[states]\nx = { rate = 'a - x', start = 0 }\n[outputs]\ny = { value = 'x', noise = 0.05 }\n[record]\nstep = 0.2\nsamples = 30\n";
    fs::write(at.join("s.toml"), study).unwrap();
    for spread in [0, 1] {
        let rows = (0..30).map(|k| {
            let off = spread * ((7 * k) % 11);
            format!("{},{}e5\n", 0.2 * f64::from(k), 30 + off)
        });
        let record = "t,y\n".to_owned() + &rows.collect::<String>();
        fs::write(at.join("r.csv"), record).unwrap();
        let output = run(at, &["fit", "r.csv", "--study", "s.toml", "--json"]);
        assert!(output.status.success(), "{}", told(&output));
        let fit: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
        let value = fit["parameters"][0]["value"].as_f64().unwrap();
        assert!((0.1..=5.0).contains(&value), "{fit}");
        let warnings = fit["warnings"].as_array().unwrap();
        assert!(
            warnings.iter().any(|w| w["code"] == "noise-at-bound"),
            "{fit}"
        );
    }
}
