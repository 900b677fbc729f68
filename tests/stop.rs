//! Ctrl-C: a clean end, the call that goes on, and then the same bytes as of an undisturbed run.
#![cfg(unix)]

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant};

fn start(folder: &Path, arguments: &str) -> std::process::Child {
    Command::new(env!("CARGO_BIN_EXE_truetwin"))
        .current_dir(folder)
        .args(arguments.split_whitespace())
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap()
}

fn entries(folder: &Path) -> usize {
    fs::read_dir(folder).map_or(0, |folder| folder.count())
}

/// Sends a signal once `ready`, and waits for the end.
fn interrupted(folder: &Path, arguments: &str, signal: &str, ready: impl Fn() -> bool) -> Output {
    let child = start(folder, arguments);
    let since = Instant::now();
    while !ready() && since.elapsed() < Duration::from_secs(60) {
        std::thread::sleep(Duration::from_millis(2));
    }
    let pid = child.id().to_string();
    assert!(
        Command::new("kill")
            .args([signal, &pid])
            .status()
            .unwrap()
            .success()
    );
    child.wait_with_output().unwrap()
}

fn files(folder: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    (fs::read_dir(folder).unwrap())
        .map(|entry| entry.unwrap().path())
        .map(|path| (path.file_name().unwrap().into(), fs::read(&path).unwrap()))
        .collect()
}

#[test]
fn a_bank_that_is_stopped_says_how_to_go_on_and_does() {
    let place = tempfile::tempdir().unwrap();
    let at = place.path();
    let bank = "bank --twin van-der-pol --size 20000";
    for (signal, name) in [("-INT", "int"), ("-TERM", "term")] {
        let call = format!("{bank} --out {name}");
        let shards = at.join(name).join("shards");
        let output = interrupted(at, &call, signal, || entries(&shards) > 3);
        let said = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(130), "{said}");
        assert_eq!(said.trim().lines().count(), 1, "{said}");
        assert!(said.contains("stopped") && said.contains(&call), "{said}");
        assert!((4..64).contains(&entries(&shards)));
        // The words of the message, run.
        let words = said.trim().rsplit("goes on: ").next().unwrap();
        let words = shell_words::split(words).unwrap();
        let again = Command::new(&words[0])
            .args(&words[1..])
            .current_dir(at)
            .output();
        assert!(again.unwrap().status.success());
    }
    assert!(
        start(at, &format!("{bank} --out whole"))
            .wait()
            .unwrap()
            .success()
    );
    let whole = files(&at.join("whole/shards"));
    for name in ["int", "term"] {
        assert_eq!(files(&at.join(name).join("shards")), whole, "{name}");
    }
}

#[test]
fn a_training_that_is_stopped_leaves_nothing() {
    let place = tempfile::tempdir().unwrap();
    let at = place.path();
    let call = "pretrain --twin van-der-pol --bank-size 20000 --epochs 5000 --out v.est";
    let since = Instant::now();
    let later = || since.elapsed() > Duration::from_millis(1500);
    let output = interrupted(at, call, "-INT", later);
    let said = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(130), "{said}");
    assert!(said.contains("nothing was written"), "{said}");
    assert_eq!(entries(at), 0);
}
