//! `diagnose` as a user meets it.

use super::{done, refused};
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
        text.starts_with("Structural gap: the twin lacks cubic-stiffness@x2"),
        "{text}"
    );
    assert!(text.lines().count() <= 15, "{text}");
    let report = fs::read_to_string(place.join("out/report.json")).unwrap();
    let report: serde_json::Value = serde_json::from_str(&report).unwrap();
    assert_eq!(report["verdict"], "structural-gap");
    assert_eq!(report["where"]["target"], "x2");
    let magnitude = report["which"]["effects"][0]["magnitudes"]["coefficient"]
        .as_f64()
        .unwrap();
    assert!((magnitude - 0.15).abs() < 0.03, "{magnitude}");
    assert_eq!(report["shrinkage"]["held_out"], "validation record");
    assert!(place.join("out/report.html").exists());

    refused(&[&call[..], &twin].concat(), &["exists already"]);
    refused(
        &["diagnose", &at("none.csv"), "--twin", "van-der-pol"],
        &["none.csv"],
    );
    refused(
        &["diagnose", &record, "--twin", "tanks"],
        &["r.csv", "inputs"],
    );
    let without = ["diagnose", &record, "--without", "cubic"];
    refused(
        &[&without[..], &twin].concat(),
        &["cubic", "truetwin effects"],
    );
}
