//! `diagnose` as a user meets it.

use super::{done, json, refused};
use std::fs;
use std::path::{Path, PathBuf};

fn place() -> PathBuf {
    let name = format!("diagnose-{}", std::process::id());
    let place = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    fs::create_dir_all(&place).unwrap();
    place
}

#[test]
fn a_lacking_spring_is_reported_and_bad_calls_are_refused() {
    let place = place();
    let at = |name: &str| place.join(name).display().to_string();
    fs::write(
        place.join("e.toml"),
        "[[effect]]\nid = 'cubic-stiffness'\ntarget = 'x2'\nfrom = 'x1'\nmagnitudes = { coefficient = 0.15 }\n",
    )
    .unwrap();
    let twin = ["--twin", "van-der-pol"];
    let simulated = |seed: &str, out: &str| {
        let call = [
            "simulate",
            "--theta",
            "nu=1.4",
            "--effect",
            &at("e.toml"),
            "--seed",
            seed,
            "--out",
            out,
        ];
        done(&[&call[..], &twin].concat());
    };
    simulated("1", &at("r.csv"));
    simulated("2", &at("v.csv"));
    let (record, validation, out) = (at("r.csv"), at("v.csv"), at("out"));
    let call = [
        "diagnose",
        &record,
        "--validation",
        &validation,
        "--out",
        &out,
    ];
    let text = done(&[&call[..], &twin].concat());
    assert!(
        text.starts_with("Structural gap: the twin lacks cubic stiffness at x2"),
        "{text}"
    );
    assert!(text.lines().count() <= 36, "{text}");
    let report = fs::read_to_string(place.join("out/report.json")).unwrap();
    let report: serde_json::Value = serde_json::from_str(&report).unwrap();
    assert_eq!(report["verdict"], "structural-gap");
    assert_eq!(report["where"]["target"], "x2");
    let magnitude = report["which"]["effects"][0]["magnitudes"]["coefficient"]
        .as_f64()
        .unwrap();
    assert!((magnitude - 0.15).abs() < 0.03, "{magnitude}");
    assert_eq!(report["shrinkage"]["held_out"], "validation record");
    let page = fs::read_to_string(place.join("out/report.html")).unwrap();
    assert!(page.contains("Structural gap: the twin lacks cubic stiffness at x2"));
    // What is to be measured next lies beside the page, where something is.
    let next = place.join("out/next-input.csv");
    assert_eq!(next.exists(), !report["which"]["next_input"].is_null());

    refused(&[&call[..], &twin].concat(), &["exists already"]);

    let quick = json(&[&["diagnose", &record, "--quick", "--json"][..], &twin].concat());
    assert_eq!(quick["which"]["accepted"][0], "cubic-stiffness@x2");
    assert_eq!(quick["quick"], true);
    assert!(quick["power"].as_array().unwrap().is_empty());
}

/// A record of the oscillator, so long, with its path.
fn oscillation(name: &str, samples: usize, step: f64) -> String {
    let place = place();
    let clock = place.join(format!("clock-{name}"));
    let times: String = (0..samples)
        .map(|k| format!("{}\n", k as f64 * step))
        .collect();
    fs::write(&clock, format!("t\n{times}")).unwrap();
    let out = place.join(name).display().to_string();
    let clock = clock.display().to_string();
    done(&[
        "simulate",
        "--twin",
        "van-der-pol",
        "--theta",
        "nu=1.4",
        "--seed",
        "5",
        "--input",
        &clock,
        "--out",
        &out,
    ]);
    out
}

#[test]
fn wrong_calls_are_refused_in_one_line_that_names_what_and_where() {
    let record = oscillation("whole.csv", 300, 0.05);
    let twin = ["--twin", "van-der-pol"];
    let refuses = |arguments: &[&str], parts: &[&str]| {
        refused(&[&["diagnose"], arguments, &twin].concat(), parts);
    };
    let tanks = tanks_record();
    refuses(&["none.csv"], &["none.csv"]);
    refuses(&[&tanks], &["of-tanks.csv: the record has 1 input"]);
    refuses(
        &[&record, "--without", "cubic"],
        &["unknown effect cubic", "truetwin effects"],
    );
    refuses(
        &[&record, "--without", "cubic-stiffness@h7"],
        &["cubic-stiffness@h7", "truetwin effects"],
    );
    refuses(
        &[&record, "--out", "no/such/folder"],
        &["no/such", "make it first"],
    );

    let rows: String = (0..60).map(|k| format!("{k}e-312,{}\n", k % 7)).collect();
    let tiny = place().join("tiny.csv").display().to_string();
    fs::write(&tiny, format!("t,y\n{rows}")).unwrap();
    refuses(
        &[&tiny],
        &[
            "tiny.csv: column t: a step of 1e-312 s is too small",
            "write t in seconds",
        ],
    );
    refused(
        &["simulate", "--theta", "nu=1e308", "--twin", "van-der-pol"],
        &["nu = 1e308 is outside"],
    );

    let other = [&record, "--validation", &tanks];
    refuses(
        &other,
        &["of-tanks.csv: the record has 1 input, the twin has 0"],
    );
    let slow = oscillation("slow.csv", 300, 0.1);
    let remedy = "step of 0.1 s, the first record 0.05 s; resample it";
    refuses(
        &[&record, "--validation", &slow],
        &["slow.csv: the validation record", remedy],
    );
    refuses(&[&record, &slow], &["slow.csv: record 2", remedy]);
    refuses(
        &[&slow],
        &["slow.csv: the record's step is 0.1 s", "--step-of-record"],
    );
    let brief = oscillation("brief.csv", 3, 0.05);
    refuses(
        &[&brief],
        &["brief.csv: record 1 has 3 samples", "at least 4"],
    );
    refuses(
        &[&record, "--validation", &brief],
        &["brief.csv: the validation record has 3 samples"],
    );
}

fn tanks_record() -> String {
    let out = place().join("of-tanks.csv").display().to_string();
    let theta = "k1=0.6,k2=0.6,k3=0.6,k4=1.0";
    done(&[
        "simulate", "--twin", "tanks", "--theta", theta, "--out", &out,
    ]);
    out
}

#[test]
fn an_unknown_effect_is_answered_with_the_known_ones() {
    let place = place();
    let at = |name: &str| place.join(name).display().to_string();
    let effect = "[[effect]]\nid = 'cubic-stifness'\ntarget = 'x2'\n";
    fs::write(place.join("typo.toml"), effect).unwrap();
    fs::write(
        place.join("study.toml"),
        format!("twin = 'van-der-pol'\n{effect}"),
    )
    .unwrap();
    let record = oscillation("known.csv", 60, 0.05);
    let known = ["cubic-stifness", "cubic-stiffness", "state-ceiling"];
    let simulate = [
        "simulate",
        "--twin",
        "van-der-pol",
        "--theta",
        "nu=1",
        "--effect",
    ];
    refused(
        &[&simulate[..], &[&at("typo.toml")]].concat(),
        &[&known[..], &["unknown effect id", "typo.toml, line 2"]].concat(),
    );
    refused(
        &["diagnose", &record, "--study", &at("study.toml")],
        &[&known[..], &["study.toml, line 3: unknown effect id"]].concat(),
    );
}

#[test]
fn a_record_too_short_to_hold_anything_back_is_diagnosed_without_a_share() {
    let record = oscillation("short.csv", 120, 0.05);
    let out = place().join("short").display().to_string();
    let text = done(&["diagnose", &record, "--twin", "van-der-pol", "--out", &out]);
    let says = "No share of the gap closed: the record is too short";
    assert!(text.contains(says), "{text}");
    let read = |name: &str| fs::read_to_string(Path::new(&out).join(name)).unwrap();
    let report: serde_json::Value = serde_json::from_str(&read("report.json")).unwrap();
    assert!(report["shrinkage"].is_null());
    assert!(read("report.html").contains(says));
}

#[test]
fn records_that_never_move_are_refused() {
    let moving = oscillation("moving.csv", 60, 0.05);
    let still = place().join("still.csv").display().to_string();
    let rows: String = (0..60)
        .map(|k| format!("{},2.5\n", 0.05 * f64::from(k)))
        .collect();
    fs::write(&still, format!("t,y\n{rows}")).unwrap();
    let out = place().join("never").display().to_string();
    let to = ["--twin", "van-der-pol", "--out", &out];
    let refused = |records: &[&str], of: &str| {
        let told = format!("no output of the {of} ever changes");
        refused(&[&["diagnose"], records, &to].concat(), &[&told]);
    };
    refused(&[&still], "records");
    refused(&[&moving, "--validation", &still], "validation record");
}
