//! `reproduce`: the table, its folder, going on with it, refusals.

use super::{at, done, file, json, refused};
use serde_json::Value;
use std::fs;
use std::path::Path;

/// The oscillator, paper preset, small enough for a test.
const SMALL: [&str; 11] = [
    "reproduce",
    "--twin",
    "van-der-pol",
    "--preset",
    "paper",
    "--bank-size",
    "200",
    "--epochs",
    "2",
    "--runs",
    "2",
];

fn small<'a>(more: &[&'a str]) -> Vec<&'a str> {
    [&SMALL[..], more].concat()
}

fn valid(value: &Value) {
    let text = include_str!("../../contract/reproduce.schema.json");
    let schema = serde_json::from_str(text).unwrap();
    assert!(jsonschema::is_valid(&schema, value), "{value:#}");
}

fn timeless(mut value: Value) -> Value {
    for method in value["methods"].as_array_mut().unwrap() {
        method["ms"] = Value::Null;
    }
    value
}

/// Every row of the table, in the contract's form, repeating whatever the threads.
#[test]
fn every_method_is_scored_whatever_the_threads() {
    let estimator = at("v.est");
    let run = |threads: &str| {
        json(&[
            "reproduce",
            "--twin",
            "van-der-pol",
            "--estimator",
            &estimator,
            "--runs",
            "3",
            "--json",
            "--threads",
            threads,
        ])
    };
    let value = run("1");
    valid(&value);
    assert_eq!(value["methods"].as_array().unwrap().len(), 10);
    assert!(value["methods"].as_array().unwrap().iter().all(|m| {
        m["mse"].is_number() && m["mse_std_error"].is_number() && m["ms"].is_number()
    }));
    assert_eq!(value["methods"][2]["paper"]["mse"], 0.0005501);
    assert_eq!(timeless(value.clone()), timeless(run("2")));
    assert_eq!(timeless(value), timeless(run("4")));
}

/// As if killed after two records of three, before any result: the folder goes on and ends the same; a whole one ends
/// the same to the last byte, times included.
#[test]
fn a_folder_goes_on_where_it_stopped() {
    let out = at("reproduced");
    let call = [&SMALL[..9], &["--runs", "3", "--out", &out]].concat();
    let inside = |name: &str| format!("{out}/{name}");
    let read = |name: &str| fs::read_to_string(inside(name)).unwrap();
    let results = [
        "first-record.svg",
        "reproduce.json",
        "table.txt",
        "trajectories.svg",
    ];
    let printed = done(&call);
    let mut names: Vec<_> = (fs::read_dir(&out).unwrap())
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    names.sort();
    assert_eq!(
        names,
        [
            "estimator.est",
            "first-record.svg",
            "manifest.json",
            "reproduce.json",
            "runs",
            "table.txt",
            "trajectories.svg"
        ]
    );
    assert!(printed.starts_with(&read("table.txt")), "{printed}");
    let first: Value = serde_json::from_str(&read("reproduce.json")).unwrap();
    valid(&first);
    assert_eq!(
        json(&[&call[..], &["--json", "--threads", "1"]].concat()),
        first
    );

    // Killed after the last run: nothing is run again, and the results are the same bytes.
    let before = results.map(read);
    results
        .iter()
        .for_each(|name| fs::remove_file(inside(name)).unwrap());
    done(&call);
    assert_eq!(results.map(read), before);

    // Killed before it.
    let trained = fs::metadata(inside("estimator.est"))
        .unwrap()
        .modified()
        .unwrap();
    let kept = read("runs/0000.json");
    fs::remove_file(inside("runs/0002.json")).unwrap();
    results
        .iter()
        .for_each(|name| fs::remove_file(inside(name)).unwrap());
    done(&call);
    let second: Value = serde_json::from_str(&read("reproduce.json")).unwrap();
    assert_eq!(timeless(first.clone()), timeless(second));
    assert_eq!(read("runs/0000.json"), kept);
    assert_eq!(
        fs::metadata(inside("estimator.est"))
            .unwrap()
            .modified()
            .unwrap(),
        trained,
        "the estimator is trained once"
    );

    // Without a folder, the same.
    let plain = json(&[&call[..11], &["--json"]].concat());
    assert_eq!(timeless(plain), timeless(first));

    for (change, parts) in [
        (
            ["--seed", "2"],
            ["seed was 1, now it is 2", "another --out"],
        ),
        (
            ["--scenario", "2"],
            ["scenario was 1, now it is 2", "rerun that call"],
        ),
    ] {
        refused(
            &[&call[..], &change].concat(),
            &[&[out.as_str()], &parts[..]].concat(),
        );
    }
    assert_eq!(
        fs::read_dir(&out).unwrap().count(),
        7,
        "a refusal leaves nothing behind"
    );
}

/// A wrong number leaves no folder behind, which would refuse the corrected call.
#[test]
fn wrong_settings_are_refused_before_anything_is_written() {
    let out = at("unwritten");
    let fixed = file(
        "all-fixed.toml",
        "twin = 'van-der-pol'\n[fixed]\nnu = 1.0\n",
    );
    let garbage = file("garbage.est", "no estimator");
    let call = ["reproduce", "--runs", "1", "--out", &out];
    for (more, part) in [
        (["--bank-size", "0"], "bank size = 0;"),
        (["--bank-size", "99"], "bank size = 99;"),
        (["--bank-size", "20000000"], "fit into memory"),
        (["--epochs", "0"], "epochs = 0"),
        (["--threads", "0"], "--threads"),
        (["--shard", "3/2"], "3/2"),
        (["--estimator", &garbage], "garbage.est"),
    ] {
        let call = [&call[..], &["--twin", "van-der-pol"], &more[..]].concat();
        refused(&call, &[part]);
        assert!(!Path::new(&out).exists(), "{more:?}");
    }
    let call = [&call[..], &["--scenario", "0", "--study", &fixed]].concat();
    refused(&call, &["all parameters are fixed"]);
    assert!(!Path::new(&out).exists());
}

#[test]
fn folders_of_others_are_left_alone() {
    let mine = at("mine");
    fs::create_dir_all(&mine).unwrap();
    fs::write(format!("{mine}/notes.txt"), "keep").unwrap();
    refused(
        &small(&["--out", &mine]),
        &["mine exists already", "choose another --out"],
    );
    assert_eq!(fs::read_dir(&mine).unwrap().count(), 1);
    let taken = file("taken", "a file");
    refused(&small(&["--out", &taken]), &["taken exists already"]);
    refused(
        &small(&["--out", &at("no/where")]),
        &["no/where", "make it first"],
    );
}

/// θ anywhere in the bounds; also of a study with its own inputs, which has no test points.
#[test]
fn uniform_scenarios_need_no_test_points() {
    let value = json(&small(&["--scenario", "uniform", "--json"]));
    valid(&value);
    assert_eq!(
        (&value["scenario"], &value["theta_from"]),
        (&3.into(), &"bounds".into())
    );
    assert!(value["methods"][0]["paper"].is_null());
    let narrow = file(
        "narrow.toml",
        "twin = 'van-der-pol'\n[bounds]\nnu = [0.0, 2.9]\n",
    );
    let study = |scenario: &'static str| {
        let mut call = small(&["--scenario", scenario]);
        call.splice(1..3, ["--study", narrow.as_str()]);
        call.into_iter().map(str::to_owned).collect::<Vec<_>>()
    };
    let call = study("1");
    refused(
        &call.iter().map(String::as_str).collect::<Vec<_>>(),
        &["nu = 3", "[0, 2.9]", "--scenario uniform"],
    );
    let call = study("0");
    let text = done(&call.iter().map(String::as_str).collect::<Vec<_>>());
    assert!(
        text.contains("θ from the prior") && !text.contains("paper: MSE"),
        "{text}"
    );
}

#[test]
fn the_help_teaches_and_wrong_scenarios_are_refused() {
    let help = done(&["reproduce", "--help"]);
    for expected in ["uniform", "reproduce.json", "resumes it", "TS-fine"] {
        assert!(help.contains(expected), "{expected} is not in:\n{help}");
    }
    refused(&small(&["--scenario", "5"]), &["--scenario", "uniform"]);
}

/// Records of one folder are all scored with its own estimator.
#[test]
fn a_foreign_estimator_is_refused_and_made_again_where_it_is_removed() {
    let [own, other] = ["sealed", "foreign"].map(at);
    let table = |out: &str| fs::read_to_string(Path::new(out).join("reproduce.json")).unwrap();
    let estimator = |out: &str| Path::new(out).join("estimator.est");
    done(&small(&["--out", &own]));
    done(&small(&["--out", &other, "--seed", "9"]));
    let before: Value = serde_json::from_str(&table(&own)).unwrap();
    fs::copy(estimator(&other), estimator(&own)).unwrap();
    fs::remove_file(Path::new(&own).join("runs/0001.json")).unwrap();
    let again = small(&["--out", &own]);
    refused(&again, &["estimator.est", "cannot be used", "remove it"]);
    fs::remove_file(estimator(&own)).unwrap();
    done(&again);
    let after: Value = serde_json::from_str(&table(&own)).unwrap();
    assert_eq!(timeless(before), timeless(after));
}
