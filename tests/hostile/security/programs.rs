//! Programs run only when the command line names them; their words are shown as text.

use super::{done, refused, truetwin};
use std::fs;
use std::path::Path;

/// Neither a study file nor an effect file, whatever key it tries, runs anything.
#[test]
fn files_run_nothing() {
    let place = tempfile::tempdir().unwrap();
    let canary = place.path().join("ran");
    let command = format!("touch {}", canary.display());
    for (key, value) in [
        ("program", format!("'{command}'")),
        ("fmu", "'m.fmu'".into()),
        ("command", format!("['sh', '-c', '{command}']")),
        ("external", format!("{{ program = '{command}' }}")),
        ("twin", format!("'`{command}`'")),
        ("twin", format!("'$({command})'")),
        ("record", format!("{{ input = '|{command}' }}")),
        ("record", format!("{{ input = '$({command})' }}")),
        (
            "features",
            format!("{{ kind = 'program', command = '{command}' }}"),
        ),
        (
            "effect",
            format!("[{{ id = 'program', command = '{command}' }}]"),
        ),
    ] {
        let twin = if key == "twin" {
            ""
        } else {
            "twin = 'tanks'\n"
        };
        fs::write(
            place.path().join("s.toml"),
            format!("{twin}{key} = {value}\n"),
        )
        .unwrap();
        refused(place.path(), &["check", "--study", "s.toml"]);
    }
    assert!(!canary.exists());
}

/// An estimator that was made for a program is of no use without naming it, and does not start it.
#[test]
fn an_estimator_starts_no_program() {
    let Some(python) = python() else { return };
    let place = tempfile::tempdir().unwrap();
    let at = |name: &str| place.path().join(name);
    let text = format!(
        "open({:?}, 'a').write('x')\n{}",
        at("ran").display().to_string(),
        answering("twin", "k", "m")
    );
    fs::write(at("twin.py"), text).unwrap();
    let program = format!("{python} twin.py");
    let with = ["--bank-size", "100", "--epochs", "1", "--program", &program];
    done(
        place.path(),
        &[&["pretrain", "--out", "e.est"], &with[..]].concat(),
    );
    done(
        place.path(),
        &[
            "simulate",
            "--program",
            &program,
            "--theta",
            "k=1",
            "--out",
            "r.csv",
        ],
    );
    fs::remove_file(at("ran")).unwrap();
    let line = refused(place.path(), &["estimate", "r.csv", "--estimator", "e.est"]);
    assert!(
        line.contains("made for twin") && line.contains("--program"),
        "{line}"
    );
    assert!(!at("ran").exists(), "the program was started");
}

/// Python 3, if there is one.
fn python() -> Option<&'static str> {
    let works = |name: &&str| {
        let output = std::process::Command::new(name)
            .args(["-c", "import sys; assert sys.version_info[0] == 3"])
            .output();
        output.is_ok_and(|output| output.status.success())
    };
    let found = ["python3", "python"].into_iter().find(works);
    if found.is_none() {
        eprintln!("skipped: no Python 3 is installed");
    }
    found
}

/// A program with one parameter.
fn answering(twin: &str, parameter: &str, unit: &str) -> String {
    let [twin, parameter, unit] =
        [twin, parameter, unit].map(|t| serde_json::to_string(t).unwrap());
    format!(
        r#"
import json, sys
for line in sys.stdin:
    request = json.loads(line)
    if request["request"] == "describe":
        answer = {{"name": {twin}, "parameters": [{{"name": {parameter}, "unit": {unit}, "prior": [1, 3]}}],
            "outputs": [{{"name": "y"}}], "record": {{"step": 0.5, "samples": 60}}}}
    else:
        k, y, x = request["theta"][{parameter}], [], 1.0
        for i in range(request["samples"]):
            y.append(x)
            x = 0.3 * k * x - 0.1 * k * x * x + 0.1 * ((7 * i + (request["seed"] or 0)) % 5)
        answer = {{"id": request["id"], "outputs": {{"y": y}}}}
    print(json.dumps(answer), flush=True)
"#
    )
}

/// Names that a program may give itself, and names that it may not.
#[test]
fn hostile_names_steer_no_terminal_and_are_no_elements() {
    let Some(python) = python() else { return };
    let place = tempfile::tempdir().unwrap();
    let start = |twin: &str, parameter: &str, unit: &str| {
        fs::write(
            place.path().join("twin.py"),
            answering(twin, parameter, unit),
        )
        .unwrap();
        format!("{python} twin.py")
    };
    for (twin, parameter, unit) in [
        ("\u{1b}[2J", "k", ""),
        ("t", "\u{9b}31m", ""),
        ("t", "k\u{202e}", ""),
        ("t", "k", "\u{1b}]0;title\u{7}"),
        ("t", "k", "m\nforged line"),
    ] {
        let program = start(twin, parameter, unit);
        let line = refused(place.path(), &["twins", "--program", &program]);
        assert!(line.contains("contains"), "{line}");
    }
    let program = start(
        "<script>alert(1)</script>",
        "<b>&k",
        "<img src=x onerror=alert(2)>",
    );
    let text = done(place.path(), &["twins", "--program", &program]);
    assert!(text.contains("<b>&k"), "a terminal knows no elements");
    let with = ["--program", program.as_str()];
    let small = [
        "pretrain",
        "--bank-size",
        "100",
        "--epochs",
        "1",
        "--out",
        "e.est",
    ];
    done(place.path(), &[&small[..], &with].concat());
    done(
        place.path(),
        &[
            &["simulate", "--theta", "<b>&k=1.7", "--out", "r.csv"],
            &with[..],
        ]
        .concat(),
    );
    let estimate = [
        "estimate",
        "r.csv",
        "--estimator",
        "e.est",
        "--out",
        "result",
    ];
    done(place.path(), &[&estimate[..], &with].concat());
    let picture = fs::read_to_string(place.path().join("result/overlay.svg")).unwrap();
    for element in ["<script", "<img", "<b>"] {
        assert!(!picture.contains(element), "{element}");
    }
}

/// Standard error of a program, and its answer instead of a description, are quoted without escapes.
#[test]
fn what_a_program_says_is_quoted_plainly() {
    let Some(python) = python() else { return };
    let place = tempfile::tempdir().unwrap();
    for text in [
        "import sys\nsys.stderr.write('\\x1b[31mred\\n\\x9b2J \\u202e\\n')\n",
        "print('\\x1b[31mred \\x07 \\u202e')\n",
    ] {
        fs::write(place.path().join("twin.py"), text).unwrap();
        let program = format!("{python} twin.py");
        let line = refused(place.path(), &["twins", "--program", &program]);
        assert!(line.contains("31mred"), "{line}");
        assert!(!line.contains('\u{202e}'));
    }
}

/// A name on the command line is quoted plainly, too; so is one from a record.
#[test]
fn what_a_record_holds_is_quoted_plainly() {
    let place = tempfile::tempdir().unwrap();
    for text in [
        "t,\u{1b}[2J\n0,1\n",
        "t,y\n0,1\n1,\u{9b}31m\n2,3\n",
        "t,y\n0,1\n1,\"a\nerror: forged\"\n",
    ] {
        fs::write(place.path().join("r.csv"), text).unwrap();
        let arguments = ["diagnose", "r.csv", "--twin", "van-der-pol", "--out", "gap"];
        let output = truetwin(place.path(), &arguments);
        assert_eq!(output.status.code(), Some(2));
        assert_eq!(String::from_utf8_lossy(&output.stderr).lines().count(), 1);
        refused(place.path(), &arguments);
    }
    assert!(!Path::new(&place.path().join("gap")).exists());
}
