//! The verbs.

use std::path::Path;
use std::process::{Command, Output};

fn truetwin(folder: &Path, arguments: &str) -> Output {
    Command::new(env!("CARGO_BIN_EXE_truetwin"))
        .current_dir(folder)
        .args(arguments.split_whitespace())
        .output()
        .unwrap()
}

fn done(folder: &Path, arguments: &str) -> serde_json::Value {
    let output = truetwin(folder, arguments);
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{arguments}: {said}");
    serde_json::from_slice(&output.stdout).unwrap_or_default()
}

fn refused(folder: &Path, arguments: &str) -> String {
    let output = truetwin(folder, arguments);
    let said = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(2), "{arguments}: {said}");
    assert_eq!(said.trim().lines().count(), 1, "{said}");
    said
}

#[test]
fn a_job_array_is_merged_and_trained_on() {
    let place = tempfile::tempdir().unwrap();
    let at = place.path();
    let bank = "bank --twin van-der-pol --preset paper --size 120 --seed 5 --json";
    let first = done(at, &format!("{bank} --shard 1/2 --out one"));
    assert_eq!(first["schema"], "truetwin.bank/1");
    assert_eq!(first["shards"], serde_json::json!({ "there": 4, "of": 8 }));
    assert_eq!(first["simulated"], 56, "the last shard is shorter");
    done(at, &format!("{bank} --shard 2/2 --out two"));
    assert_eq!(done(at, "merge one two --out bank --json")["count"], 8);
    let again = done(at, &format!("{bank} --out bank"));
    assert_eq!(again["simulated"], 0);
    done(at, "merge bank --out bank.npz");
    done(at, "merge one two --out bank.csv");
    let pretrain = "pretrain --twin van-der-pol --preset paper --epochs 2 --seed 5 --json";
    for (source, out) in [
        ("--bank bank", "a.est"),
        ("--bank bank.npz", "b.est"),
        ("--bank bank.csv", "c.est"),
        ("--bank-size 120", "d.est"),
    ] {
        assert_eq!(
            done(at, &format!("{pretrain} {source} --out {out}"))["bank_size"],
            120
        );
    }
    let bytes = |name: &str| std::fs::read(at.join(name)).unwrap();
    for name in ["b.est", "c.est", "d.est"] {
        assert_eq!(bytes(name), bytes("a.est"), "{name}");
    }
}

#[test]
fn wrong_calls_are_refused_with_the_remedy() {
    let place = tempfile::tempdir().unwrap();
    let at = place.path();
    let bank = "bank --twin van-der-pol --size 40";
    done(at, &format!("{bank} --shard 1/2 --out half"));
    for (call, hint) in [
        ("bank --twin van-der-pol --size 0 --out x", "at least 1"),
        (&format!("{bank} --out a/b"), "make it first"),
        (&format!("{bank} --shard 3/2 --out x"), "write i/n"),
        (
            &format!("{bank} --seed 2 --out half"),
            "seed was 1, now it is 2",
        ),
        ("merge half --out whole", "1 of 3 shards"),
        ("merge half --out half", "exists already"),
        ("merge nowhere --out x", "no bank folder"),
        (
            "pretrain --twin van-der-pol --bank half --out x.est",
            "1 of 3 shards",
        ),
        (
            "pretrain --twin van-der-pol --bank nowhere --out x.est",
            "no bank folder",
        ),
        (
            "pretrain --twin van-der-pol --bank no.npz --out x.est",
            "no.npz",
        ),
        (
            "pretrain --twin van-der-pol --bank half --bank-size 9 --out x.est",
            "cannot be used with",
        ),
    ] {
        let said = refused(at, call);
        assert!(said.contains(hint), "{call}: {said}");
    }
    done(at, &format!("{bank} --out half"));
    let manifest = || std::fs::read(at.join("half/manifest.json")).unwrap();
    let before = manifest();
    let said = refused(at, &format!("{bank} --seed 2 --out half"));
    assert!(said.contains("seed was 1, now it is 2"), "{said}");
    assert_eq!(manifest(), before, "a finished bank stays what it is");
    let said = refused(
        at,
        "pretrain --twin van-der-pol --preset paper --bank half --out x.est",
    );
    assert!(said.contains("features"), "{said}");
}

/// A checksum of the manifest that is no shard's, and parameters of another twin's range.
#[test]
fn banks_that_are_not_what_they_say_are_refused() {
    let place = tempfile::tempdir().unwrap();
    let at = place.path();
    done(at, "bank --twin van-der-pol --size 120 --out bank");
    done(at, "merge bank --out bank.csv");
    let csv = std::fs::read_to_string(at.join("bank.csv")).unwrap();
    let (head, rows) = csv.split_once('\n').unwrap();
    let (_, others) = rows.split_once(',').unwrap();
    let train = "pretrain --twin van-der-pol --epochs 1 --out x.est --bank";
    // Rows as an editor counts them, blank lines included.
    std::fs::write(at.join("far.csv"), format!("{head}\n\n1e5,{others}")).unwrap();
    let said = refused(at, &format!("{train} far.csv"));
    assert!(said.contains("far.csv: no bank (row 3: nu = "), "{said}");
    let narrow = |line: &str| {
        line.rsplit_once(',')
            .map_or("", |(start, _)| start)
            .to_owned()
    };
    let lines: Vec<String> = csv.lines().map(narrow).collect();
    std::fs::write(at.join("narrow.csv"), lines.join("\n") + "\n").unwrap();
    let said = refused(at, &format!("{train} narrow.csv"));
    assert!(
        said.contains("narrow.csv: ") && said.contains("features"),
        "{said}"
    );

    let path = at.join("bank/manifest.json");
    let mut manifest: serde_json::Value =
        serde_json::from_slice(&std::fs::read(&path).unwrap()).unwrap();
    for sum in manifest["checksums"].as_array_mut().unwrap() {
        *sum = sum.as_str().unwrap().replace('1', "2").into();
    }
    std::fs::write(&path, manifest.to_string()).unwrap();
    for call in [&format!("{train} bank"), "merge bank --out again.npz"] {
        let said = refused(at, call);
        assert!(said.contains("bank"), "{call}: {said}");
    }
}

/// An estimator carries its setting: a call that names another one is not answered by the estimator's.
#[test]
fn reproduce_refuses_an_estimator_of_another_study() {
    let place = tempfile::tempdir().unwrap();
    let at = place.path();
    let study = |name: &str, prior: &str| {
        let text = format!("twin = 'van-der-pol'\n[prior]\nnu = {prior}\n");
        std::fs::write(at.join(name), text).unwrap();
    };
    study("one.toml", "[1.0, 2.0]");
    study("two.toml", "[0.5, 1.5]");
    done(
        at,
        "pretrain --study one.toml --bank-size 100 --epochs 1 --out e.est",
    );
    let call = "reproduce --scenario 0 --runs 1 --estimator e.est";
    let said = refused(at, &format!("{call} --study two.toml"));
    assert!(said.contains("e.est: made for another setting"), "{said}");
    done(at, &format!("{call} --study one.toml"));
    done(at, &format!("{call} --twin van-der-pol"));
}

#[test]
fn texts_that_steer_a_terminal_are_refused() {
    let place = tempfile::tempdir().unwrap();
    let at = place.path();
    let twin = |name: &str, unit: &str| {
        format!(
            "[twin]\nname = \"{name}\"\n[parameters]\na = {{ prior = [0.5, 2.0] }}\n[states]\n\
             x = {{ rate = \"-a*x\", start = 1.0, unit = \"{unit}\" }}\n[outputs]\ny = {{ value = \"x\", noise = 0.1 }}\n\
             [record]\nstep = 0.1\nsamples = 20\n"
        )
    };
    for (name, unit) in [("p\\u202Eq", "m"), ("p", "m\\u001b[31m")] {
        std::fs::write(at.join("s.toml"), twin(name, unit)).unwrap();
        let said = refused(at, "check --study s.toml");
        assert!(said.contains("s.toml, line "), "{said}");
        assert!(said.contains("hidden characters"), "{said}");
    }
}
