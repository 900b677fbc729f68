//! `fit` as a user meets it.

use super::{done, json, refused, truetwin};
use serde_json::Value;
use std::fs;
use tempfile::TempDir;

fn place() -> TempDir {
    tempfile::tempdir().unwrap()
}

#[test]
fn a_record_is_fitted_and_bad_calls_are_refused() {
    let place = place();
    let at = |name: &str| place.path().join(name).display().to_string();
    let study = |name: &str, tables: &str| {
        fs::write(place.path().join(name), format!("twin = 'tanks'\n{tables}")).unwrap();
        at(name)
    };
    let (record, out) = (at("r.csv"), at("out"));
    let truth = "k1=0.6,k2=0.5,k3=0.55,k4=1";
    done(&[
        "simulate", "--twin", "tanks", "--theta", truth, "--out", &record,
    ]);

    let value = json(&["fit", &record, "--twin", "tanks", "--out", &out, "--json"]);
    valid(&value);
    assert_eq!(value["parameters"].as_array().unwrap().len(), 4);
    assert_eq!(value["noise"].as_array().unwrap().len(), 3);
    assert_eq!(value["convergence"]["converged"], true);
    let k1 = &value["parameters"][0];
    assert!((k1["value"].as_f64().unwrap() - 0.6).abs() < 5.0 * k1["std_error"].as_f64().unwrap());
    assert!(
        place.path().join("out/fit.json").exists() && place.path().join("out/overlay.svg").exists()
    );
    let text = done(&["fit", &record, "--twin", "tanks"]);
    for part in [
        "k1",
        "noise of",
        "one-step error",
        "Converged",
        "Log evidence",
    ] {
        assert!(text.contains(part), "{part}: {text}");
    }

    let drawn = at("drawn");
    let drawn = ["--draws", "20", "--out", &drawn, "--json"];
    let drawn = json(&[&["fit", &record, "--twin", "tanks"], &drawn[..]].concat());
    valid(&drawn);
    assert_eq!(drawn["posterior"]["draws"], 20);

    // Known levels and starts are no part of the fit.
    let held = study(
        "held.toml",
        "[noise]\nh1 = { std = 0.1, known = true }\ny = { std = 0.15, known = true }\n[start]\nh1 = 0.0\n",
    );
    let value = json(&["fit", &record, "--study", &held, "--json"]);
    valid(&value);
    assert_eq!(value["noise"].as_array().unwrap().len(), 1);
    assert_eq!(value["starts"][0]["std_error"].as_f64(), Some(0.0));
    let fixed = study(
        "fixed.toml",
        "[fixed]\nk1 = 0.6\nk2 = 0.5\nk3 = 0.55\nk4 = 1.0\n",
    );
    // Nothing to estimate: the record is tested, noise alone is fitted; an estimator has nothing to learn.
    let value = json(&["fit", &record, "--study", &fixed, "--json"]);
    valid(&value);
    assert_eq!(value["parameters"].as_array().unwrap().len(), 0);
    assert_eq!(value["noise"].as_array().unwrap().len(), 3);
    let text = done(&["fit", &record, "--study", &fixed, "--out", &at("tested")]);
    assert!(text.contains("All parameters are fixed"), "{text}");
    let text = done(&["check", &record, "--study", &fixed]);
    assert!(text.contains("none to estimate"), "{text}");
    refused(
        &["pretrain", "--study", &fixed, "--out", &at("none.est")],
        &["nothing is left to estimate", "truetwin fit"],
    );

    // A start that is integrated stands once, among the starts.
    let started = study("started.toml", "[start]\nh1 = 'estimate'\n");
    let value = json(&["fit", &record, "--study", &started, "--json"]);
    let names: Vec<&str> = (value["parameters"].as_array().unwrap().iter())
        .map(|p| p["name"].as_str().unwrap())
        .collect();
    assert_eq!(names, ["k1", "k2", "k3", "k4"]);
    assert_eq!(value["starts"][0]["name"], "h1");

    refused(
        &["fit", &record, "--twin", "tanks", "--out", &out],
        &["out", "exists"],
    );
    for (tables, parts) in [
        ("[noise]\nh1 = -0.1\n", ["-0.1", "0 or more"]),
        (
            "[noise]\nh1 = { std = 0.1, factor = 0.5 }\n",
            ["0.5", "above 1"],
        ),
        (
            "[noise]\ny = 'estimate'\n[prior]\nnoise.y = [-0.2, 0.3]\n",
            ["noise.y", "begin at 0"],
        ),
        (
            "[start]\nh1 = { mean = 1.0, std = -1.0 }\n",
            ["-1", "0 or more"],
        ),
    ] {
        let study = study("bad.toml", tables);
        refused(&["fit", &record, "--study", &study], &parts);
    }
}

#[test]
fn an_input_that_never_moves_is_warned_of() {
    let place = place();
    let at = |name: &str| place.path().join(name).display().to_string();
    let rows: String = (0..200)
        .map(|k| format!("{},2\n", 0.5 * f64::from(k)))
        .collect();
    fs::write(place.path().join("still-input.csv"), format!("t,u\n{rows}")).unwrap();
    let (input, record) = (at("still-input.csv"), at("still.csv"));
    let theta = "k1=0.6,k2=0.5,k3=0.55,k4=1";
    let simulate = ["simulate", "--twin", "tanks", "--theta", theta];
    done(&[&simulate[..], &["--input", &input, "--out", &record]].concat());
    let fitted = truetwin(&["fit", &record, "--twin", "tanks"]);
    let said = String::from_utf8_lossy(&fitted.stdout);
    assert!(
        said.contains("Warning: the input u never changes;"),
        "{said}"
    );
    let value = json(&["fit", &record, "--twin", "tanks", "--json"]);
    assert!(codes(&value).contains(&"constant-input"), "{value}");
}

/// Asked for, the profile of a parameter is in the JSON, with an interval that holds the truth and the fit.
#[test]
fn profiles_are_asked_for() {
    let place = place();
    let record = place.path().join("R.csv").display().to_string();
    let simulate = ["simulate", "--twin", "van-der-pol", "--theta", "nu=1.3"];
    done(&[&simulate[..], &["--out", &record]].concat());
    let call = ["fit", &record, "--twin", "van-der-pol", "--json"];
    assert_eq!(json(&call)["profiles"], serde_json::json!([]));
    let fit = json(&[&call[..], &["--profile"]].concat());
    let profile = &fit["profiles"][0];
    assert_eq!(profile["name"], "nu");
    let [low, high] = ["low", "high"].map(|end| profile[end].as_f64().unwrap());
    let value = fit["parameters"][0]["value"].as_f64().unwrap();
    assert!(
        low < value && value < high && low < 1.3 && 1.3 < high,
        "{profile}"
    );
    assert_eq!(fit["parameters"][0]["by_profile"], false);
}

/// Half of a step of 2 s moves the tanks by more than their noise.
#[test]
fn a_long_step_is_told() {
    let place = place();
    let at = |name: &str| place.path().join(name).display().to_string();
    let study = |name: &str, tables: &str| {
        fs::write(place.path().join(name), format!("twin = 'tanks'\n{tables}")).unwrap();
        at(name)
    };
    let theta = "k1=0.6,k2=0.5,k3=0.55,k4=1";
    let coarse = study("coarse.toml", "[record]\nstep = 2.0\nsamples = 100\n");
    let record = at("coarse.csv");
    let simulate = ["simulate", "--study", &coarse, "--theta", theta];
    done(&[&simulate[..], &["--out", &record]].concat());
    let value = json(&["fit", &record, "--study", &coarse, "--json"]);
    assert!(codes(&value).contains(&"step-matters"), "{value}");
}

/// Compares a fit as the program prints it with its contract.
fn valid(value: &Value) {
    let text = include_str!("../../contract/fit.schema.json");
    let schema = serde_json::from_str(text).unwrap();
    assert!(jsonschema::is_valid(&schema, value), "{value:#}");
}

/// Codes of the warnings of a fit.
fn codes(fit: &Value) -> Vec<&str> {
    let all = fit["warnings"].as_array().unwrap().iter();
    all.map(|w| w["code"].as_str().unwrap()).collect()
}
