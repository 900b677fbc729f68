//! `withheld` as a user meets it.

use super::{done, json, refused};
use crate::studies::short;
use std::fs;
use std::path::Path;

#[test]
fn a_few_sealed_trials_are_scored_kept_and_refused_to_another_call() {
    let name = format!("withheld-{}", std::process::id());
    let place = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    fs::create_dir_all(&place).unwrap();
    let out = place.join("trials").display().to_string();
    let few = short(&place);
    let call = |seed: &'static str| {
        [
            "withheld",
            "--study",
            &few,
            "--trials",
            "2",
            "--kinds",
            "none,outside",
            "--out",
            &out,
        ]
        .map(str::to_owned)
        .into_iter()
        .chain(["--seed".to_owned(), seed.to_owned()])
        .collect::<Vec<String>>()
    };
    fn words(call: &[String]) -> Vec<&str> {
        call.iter().map(String::as_str).collect()
    }
    let (first, other) = (call("5"), call("6"));
    let mistyped = [&words(&first)[..], &["--ablate", "evidense"]].concat();
    refused(
        &mistyped,
        &["no part is called \"evidense\" (did you mean \"evidence\"?)"],
    );
    let text = done(&words(&first));
    assert!(
        text.contains("2 withheld trials") && text.contains("nothing missing: gap stated"),
        "{text}"
    );
    let path = place.join("trials/scorecard.json");
    let written = fs::read_to_string(&path).unwrap();
    let printed = json(&[&words(&first)[..], &["--json", "--threads", "1"]].concat());
    assert_eq!(
        printed,
        serde_json::from_str::<serde_json::Value>(&written).unwrap()
    );
    assert_eq!(
        fs::read_to_string(&path).unwrap(),
        written,
        "kept trials give the same bytes"
    );
    assert_eq!(printed["schema"], "truetwin.scorecard/2");
    // The oscillator takes a step so coarse that it shows, in both of these short records.
    assert_eq!(printed["coarse_called_structural"]["of"], 2);
    assert_eq!(printed["families"], "all");
    let seal = fs::read_to_string(place.join("trials/seal.txt")).unwrap();
    assert_eq!(printed["seal"], seal.trim());
    assert!(place.join("trials/scorecard.html").exists());
    refused(
        &words(&other),
        &["seed was 5, now it is 6", "choose another --out"],
    );
    let strange = ["withheld", "--study", &few, "--trials", "2", "--out", &out];
    refused(
        &[&strange[..], &["--kinds", "odd"]].concat(),
        &["there are none, outside"],
    );
    refused(
        &[&strange[..], &["--families", "odd"]].concat(),
        &["none of open, closed, all"],
    );
    refused(
        &["withheld", "--study", &few, "--trials", "0", "--out", &out],
        &["at least 1"],
    );
    fs::remove_dir_all(place).unwrap();
}

/// Trials like a measured record have its length, and no other record's.
#[test]
fn trials_can_be_like_a_measured_record() {
    let name = format!("withheld-like-{}", std::process::id());
    let place = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    fs::create_dir_all(&place).unwrap();
    let [record, out] = ["r.csv", "trials"].map(|name| place.join(name).display().to_string());
    let simulate = [
        "simulate",
        "--twin",
        "tanks",
        "--theta",
        "k1=0.6,k2=0.6,k3=0.6,k4=1.0",
    ];
    done(&[&simulate[..], &["--out", &record]].concat());
    let lines: Vec<String> = (fs::read_to_string(&record).unwrap().lines())
        .take(121)
        .map(str::to_owned)
        .collect();
    fs::write(&record, lines.join("\n") + "\n").unwrap();
    let call = [
        "withheld", "--twin", "tanks", "--trials", "1", "--kinds", "listed",
    ];
    let like = [
        "--detection-only",
        "--families",
        "closed",
        "--like",
        &record,
        "--out",
        &out,
    ];
    let card = json(&[&call[..], &like, &["--json"]].concat());
    assert_eq!(card["like"], true);
    assert!(card["list"][0]["information"].as_f64().unwrap() > 0.0);
    let made = fs::read_to_string(place.join("trials/records/0000.csv")).unwrap();
    assert_eq!(made.lines().count(), 121);
    let other = [
        "withheld",
        "--twin",
        "van-der-pol",
        "--trials",
        "1",
        "--like",
        &record,
    ];
    refused(
        &[&other[..], &["--out", &format!("{out}-2")]].concat(),
        &[
            "r.csv: the record has 1 input",
            "van-der-pol takes the columns t,y",
        ],
    );
    assert!(!Path::new(&format!("{out}-2")).exists());
    fs::remove_dir_all(place).unwrap();
}
