//! First mistakes: each message names the place and a remedy that works, in words of the program.

use super::{at, done, file, refused};
use std::fs;

/// Words of the standard library and of other crates.
const FOREIGN: [&str; 4] = ["invalid digit", "fit in target", "float literal", "Header"];

fn told(arguments: &[&str], parts: &[&str]) {
    refused(arguments, parts);
    let message = String::from_utf8(super::truetwin(arguments).stderr).unwrap();
    assert!(
        FOREIGN.iter().all(|word| !message.contains(word)),
        "{message}"
    );
}

#[test]
fn a_record_of_another_twin_is_named_as_such() {
    let tanks = file("of-tanks-1.csv", "t,u,y\n0,1,1\n0.5,2,2\n1,1,3\n");
    let parts = [
        "of-tanks-1.csv: the record has 1 input, the twin has 0",
        "van-der-pol takes the columns t,y",
        "choose the twin that this record is of",
    ];
    let out = at("never");
    for verb in [
        &["fit", &tanks][..],
        &["diagnose", &tanks],
        &["features", &tanks],
        &["withheld", "--trials", "1", "--out", &out, "--like", &tanks],
    ] {
        told(&[verb, &["--twin", "van-der-pol"]].concat(), &parts);
    }
    let record = at("r.csv");
    told(
        &["fit", &record, "--twin", "tanks"],
        &[
            "r.csv: the record has 0 inputs, the twin has 1 (u)",
            "tanks takes the columns t,u,y",
        ],
    );
}

#[test]
fn a_number_is_asked_for_in_plain_words() {
    let (record, out) = (at("r.csv"), at("never"));
    let whole = "expected a whole number in digits";
    told(&["twins", "--seed", "abc"], &["--seed", "'abc'", whole]);
    told(
        &["twins", "--seed", "-1"],
        &["--seed", "'-1'", whole, "without sign"],
    );
    told(&["twins", "--seed", ""], &["--seed", whole]);
    told(
        &["twins", "--seed", "18446744073709551616"],
        &["a smaller whole number"],
    );
    told(
        &[
            "diagnose",
            &record,
            "--twin",
            "van-der-pol",
            "--calibrate",
            "1e9",
        ],
        &["--calibrate", "'1e9'", whole],
    );
    let trials = ["withheld", "--twin", "tanks", "--out", &out, "--trials"];
    told(
        &[&trials[..], &["1e12"]].concat(),
        &["--trials", "choose at most 1000000"],
    );
    told(&[&trials[..], &["-5"]].concat(), &["--trials", whole]);
    told(&[&trials[..], &["0"]].concat(), &["choose at least 1"]);
    told(
        &["resample", &record, "--out", &out, "--step", "half"],
        &["--step", "expected a number, such as 0.5"],
    );
}

#[test]
fn a_file_of_another_kind_is_no_estimator() {
    let record = at("r.csv");
    let text = file("words.est", "not an estimator at all, but some words");
    let weights = file("short.est", "\u{8}\0\0");
    for other in [&record, &text, &weights] {
        told(
            &["estimate", &record, "--estimator", other],
            &[other, "not an estimator file", "truetwin pretrain"],
        );
    }
    let whole = std::fs::read(at("v.est")).unwrap();
    std::fs::write(at("half.est"), &whole[..whole.len() / 2]).unwrap();
    told(
        &["estimate", &record, "--estimator", &at("half.est")],
        &[
            "half.est",
            "not a whole estimator file (it is cut off, or goes on behind its end)",
        ],
    );
}

#[test]
fn a_study_without_a_twin_says_so() {
    let remedy = ["the key twin is missing", "truetwin twins"];
    for (name, text) in [("none.toml", ""), ("other.toml", "[record]\nstep = 0.1\n")] {
        let study = file(name, text);
        told(
            &["check", "--study", &study],
            &[&[name][..], &remedy].concat(),
        );
    }
}

#[test]
fn a_file_without_header_or_with_decimal_commas_says_so() {
    let bare = file("bare.csv", "0,1,1\n0.5,2,2\n1,1,3\n");
    told(
        &["fit", &bare, "--twin", "tanks"],
        &["bare.csv: row 1 holds numbers", "t,u,y"],
    );
    let commas = file("commas.csv", "t,u,y\n0,1,1,5\n0,5,2,2,5\n");
    told(
        &["fit", &commas, "--twin", "tanks"],
        &["commas.csv", "by semicolons"],
    );
}

/// A study that names a reference twin is exported with its settings: what it simulates stays the same.
#[test]
fn an_export_has_the_settings_of_its_study() {
    let place = tempfile::tempdir().unwrap();
    let inside = |name: &str| place.path().join(name).display().to_string();
    let study = "twin = 'van-der-pol'\n[record]\nsamples = 50\nsubsteps = 3\nintegrator = 'runge-kutta-4'\n\
                 [noise]\ny = 0.01\n[fixed]\nnu = 1.2\n[[effect]]\nid = 'sensor-bias'\ntarget = 'sensor'\n";
    fs::write(inside("s.toml"), study).unwrap();
    let text = done(&["export", "--study", &inside("s.toml")]);
    fs::write(inside("e.toml"), &text).unwrap();
    let simulated = |study: &str| {
        let theta = "sensor-bias@sensor.offset=0.1";
        let out = inside(&format!("{study}.csv"));
        done(&[
            "simulate",
            "--study",
            &inside(study),
            "--theta",
            theta,
            "--out",
            &out,
        ]);
        fs::read_to_string(out).unwrap()
    };
    assert_eq!(simulated("e.toml"), simulated("s.toml"), "{text}");
    // Without settings, the text is the one with its comments.
    let bare = done(&["export", "--twin", "van-der-pol"]);
    assert!(bare.contains('#'), "{bare}");
}

/// Rows between doses are no inputs outside the study's range.
#[test]
fn records_of_doses_pass() {
    let place = tempfile::tempdir().unwrap();
    let record = place.path().join("pk.csv").display().to_string();
    let study = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/examples/pharmacokinetics.toml"
    );
    let theta = "ka=1,CL=5,V=20,Q=3";
    done(&[
        "simulate", "--study", study, "--theta", theta, "--out", &record,
    ]);
    let text = done(&["check", &record, "--study", study]);
    assert!(!text.contains("outside"), "{text}");
}
