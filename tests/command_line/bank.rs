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
