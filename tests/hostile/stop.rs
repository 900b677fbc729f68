//! Ctrl-C: a clean end, the call that goes on; `kill -9` at any moment: the same call goes on all the same. Then the bytes are those
//! of an undisturbed run.

use crate::calls::{self, start};
use crate::files::files;
use crate::studies::short;
use crate::timeless::timeless;
use std::fs;
use std::path::Path;
use std::process::Command;
use std::time::{Duration, Instant};

fn entries(folder: &Path) -> usize {
    fs::read_dir(folder).map_or(0, |folder| folder.count())
}

/// Number of named entries of a folder; a process that dies while it makes a folder leaves a nameless one beside its place.
fn named(folder: &Path) -> usize {
    let unnamed = |entry: &fs::DirEntry| {
        let name = entry.file_name();
        name.to_string_lossy().starts_with(".truetwin-")
    };
    let all = fs::read_dir(folder).unwrap().flatten();
    all.filter(|entry| !unnamed(entry)).count()
}

/// Sends a signal once `ready`, and waits for the end, whose code is 130; returns what is said.
fn interrupted(folder: &Path, arguments: &str, signal: &str, ready: impl Fn() -> bool) -> String {
    let child = start(folder, arguments);
    let since = Instant::now();
    while !ready() && since.elapsed() < Duration::from_secs(60) {
        std::thread::sleep(Duration::from_millis(2));
    }
    calls::signal(&child, signal);
    let output = child.wait_with_output().unwrap();
    let said = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(130), "{said}");
    said
}

#[test]
fn a_bank_that_is_stopped_says_how_to_go_on_and_does() {
    let place = tempfile::tempdir().unwrap();
    let at = place.path();
    let bank = "bank --twin van-der-pol --size 20000";
    for (signal, name) in [("-INT", "int"), ("-TERM", "term")] {
        let call = format!("{bank} --out {name}");
        let shards = at.join(name).join("shards");
        let said = interrupted(at, &call, signal, || entries(&shards) > 3);
        assert_eq!(said.trim().lines().count(), 1, "{said}");
        assert!(said.contains("stopped") && said.contains(&call), "{said}");
        assert!((4..64).contains(&entries(&shards)));
        // The words of the message, run.
        let words = said.trim().rsplit("resume with: ").next().unwrap();
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
fn a_training_that_is_stopped_says_how_to_go_on() {
    let place = tempfile::tempdir().unwrap();
    let at = place.path();
    let call = "pretrain --twin van-der-pol --bank-size 20000 --epochs 5000 --out v.est";
    let shards = at.join("v.est.part/bank/shards");
    let said = interrupted(at, call, "-INT", || entries(&shards) > 0);
    assert!(
        said.contains("resume with: ") && said.contains(call),
        "{said}"
    );
    assert_eq!(named(at), 1, "the work, and no estimator");
    // Another call does not go on with it.
    let other = call.replace("5000", "4000");
    let output = start(at, &other).wait_with_output().unwrap();
    let said = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(2), "{said}");
    assert!(
        said.contains("v.est.part holds the work of another call"),
        "{said}"
    );
}

/// A fit ends with what its search has found, or with nothing; what is said is true, and nothing else stays behind.
#[test]
fn a_fit_ends_within_two_seconds() {
    let place = tempfile::tempdir().unwrap();
    let at = place.path();
    short(at);
    let made = start(at, "simulate --study short.toml --theta nu=1 --out r.csv");
    assert!(made.wait_with_output().unwrap().status.success());
    let begun = Instant::now();
    let later = || begun.elapsed() > Duration::from_millis(1500);
    let call = "fit r.csv --study short.toml --draws 1000000 --out o";
    let said = interrupted(at, call, "-TERM", later);
    // Two seconds are documented; the rest is for a loaded machine.
    assert!(begun.elapsed() < Duration::from_millis(1500 + 2000 + 2000));
    if said.contains("error:") {
        assert_eq!(said.trim(), "error: stopped; nothing was written");
        assert_eq!(entries(at), 2, "the study and the record");
        return;
    }
    let json = std::fs::read_to_string(at.join("o/fit.json")).unwrap();
    assert!(json.contains("\"interrupted\": true"), "{json}");
    assert!(json.contains("the fit was stopped before"), "{json}");
    assert_eq!(entries(at), 3, "the study, the record, and the answer");
}

/// An estimator that is trained on the way is a piece of the work, not its result.
#[test]
fn a_reproduction_that_is_stopped_says_how_to_go_on() {
    let place = tempfile::tempdir().unwrap();
    let at = place.path();
    let call = "reproduce --twin van-der-pol --runs 500 --bank-size 200 --epochs 2 --out rep";
    let runs = at.join("rep/runs");
    let said = interrupted(at, call, "-INT", || entries(&runs) > 0);
    assert!(
        said.contains("finished work is kept in rep; resume with: "),
        "{said}"
    );
    assert!(!said.contains("is complete"), "{said}");
}

#[test]
fn work_that_has_kept_nothing_yet_does_not_say_so() {
    let place = tempfile::tempdir().unwrap();
    let at = place.path();
    let call = "bank --twin tanks --size 10000000 --threads 1 --out b";
    let manifest = at.join("b/manifest.json");
    let said = interrupted(at, call, "-TERM", || manifest.exists());
    let none = "error: stopped; no piece of the work was finished yet; begin again with: ";
    assert!(
        entries(&at.join("b/shards")) > 0 || said.starts_with(none),
        "{said}"
    );
    fs::remove_dir_all(at.join("b")).unwrap();
    let begun = Instant::now();
    let soon = || begun.elapsed() > Duration::from_millis(300);
    let call = "withheld --twin tanks --trials 100000 --out w";
    let said = interrupted(at, call, "-INT", soon);
    assert_eq!(said.trim(), "error: stopped; nothing was written");
    assert_eq!(entries(at), 0);
}

/// Moments in milliseconds up to `longest`, drawn once and for all; others with `TRUETWIN_MOMENTS=1`, 2, …
fn moments(longest: u64) -> impl Iterator<Item = u64> {
    let others = std::env::var("TRUETWIN_MOMENTS").ok();
    let mut state: u64 = others.map_or(7, |seed| seed.parse().unwrap());
    std::iter::repeat_with(move || {
        state =
            (state.wrapping_mul(6_364_136_223_846_793_005)).wrapping_add(1_442_695_040_888_963_407);
        5 + (state >> 33) % longest
    })
}

/// Kills a call again and again until it is done; how often it was killed. On a slow machine the longest piece of work may not fit into
/// the first moments: they grow by a tenth from one to the next after the first ten.
fn killed(folder: &Path, arguments: &str, longest: u64, done: impl Fn() -> bool) -> i32 {
    let mut kills: i32 = 0;
    for moment in moments(longest) {
        if done() {
            return kills;
        }
        let mut child = start(folder, arguments);
        let longer = 1.1_f64.powi((kills - 10).max(0));
        let by = Instant::now() + Duration::from_millis(moment).mul_f64(longer);
        while Instant::now() < by && child.try_wait().unwrap().is_none() {
            std::thread::sleep(Duration::from_millis(1));
        }
        match child.try_wait().unwrap() {
            Some(status) => {
                let said = child.wait_with_output().unwrap().stderr;
                let said = String::from_utf8_lossy(&said).into_owned();
                assert!(status.success(), "after {kills} kills: {said}");
                return kills;
            }
            None => {
                child.kill().unwrap();
                child.wait().unwrap();
                kills += 1;
                assert!(kills < 100, "it does not come forward");
            }
        }
    }
    unreachable!("moments do not end")
}

#[test]
fn a_bank_survives_kills_at_any_moment() {
    let place = tempfile::tempdir().unwrap();
    let at = place.path();
    let bank = "bank --twin van-der-pol --size 6000";
    let kills = killed(at, &format!("{bank} --out killed"), 160, || false);
    assert!(kills >= 5, "only {kills}");
    assert!(
        start(at, &format!("{bank} --out whole"))
            .wait()
            .unwrap()
            .success()
    );
    assert_eq!(
        files(&at.join("killed/shards")),
        files(&at.join("whole/shards"))
    );
    let manifest = |name: &str| fs::read(at.join(name).join("manifest.json")).unwrap();
    assert_eq!(manifest("killed"), manifest("whole"));
    println!("{kills} kills survived");
}

/// The bank, the training, the estimator file: the same bytes, and no trace of the work.
#[test]
fn a_pretraining_survives_kills_at_any_moment() {
    let place = tempfile::tempdir().unwrap();
    let at = place.path();
    let call = "pretrain --twin van-der-pol --bank-size 3000 --epochs 20 --checkpoint 0";
    let kills = killed(at, &format!("{call} --out killed.est"), 400, || {
        // A kill between the last step and the end of the process: the same call says that it is there.
        at.join("killed.est").exists() && !at.join("killed.est.part").exists() && {
            let again = start(at, &format!("{call} --out killed.est")).wait_with_output();
            String::from_utf8_lossy(&again.unwrap().stderr).contains("exists already")
        }
    });
    assert!(kills >= 5, "only {kills}");
    let whole = start(at, &format!("{call} --out whole.est")).wait();
    assert!(whole.unwrap().success());
    let [killed, whole] = ["killed.est", "whole.est"].map(|name| fs::read(at.join(name)).unwrap());
    assert!(killed == whole, "other bytes after {kills} kills");
    assert_eq!(named(at), 2);
    println!("{kills} kills survived");
}

#[test]
fn a_pretraining_that_cannot_begin_leaves_nothing() {
    let place = tempfile::tempdir().unwrap();
    let at = place.path();
    let call = "pretrain --twin van-der-pol --bank-size 5 --out v.est";
    let output = start(at, call).wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(2));
    let study = "twin = 'tanks'\n[features]\nkind = 'arx'\noutputs = 300\ninputs = 300\n";
    fs::write(at.join("high.toml"), study).unwrap();
    let call = "pretrain --study high.toml --out v.est";
    let output = start(at, call).wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(2));
    assert_eq!(named(at), 1, "the study alone");
}

#[test]
fn two_processes_do_not_pretrain_one_estimator() {
    let place = tempfile::tempdir().unwrap();
    let at = place.path();
    let call = "pretrain --twin van-der-pol --bank-size 2000 --epochs 5000 --out v.est";
    let mut first = start(at, call);
    while !at.join("v.est.part/training").exists() && !at.join("v.est.part/bank").exists() {
        std::thread::sleep(Duration::from_millis(2));
    }
    let second = start(at, call).wait_with_output().unwrap();
    first.kill().unwrap();
    first.wait().unwrap();
    let said = String::from_utf8(second.stderr).unwrap();
    assert_eq!(second.status.code(), Some(2), "{said}");
    assert!(said.contains("another run is writing to"), "{said}");
}

#[test]
fn trials_and_records_survive_kills_at_any_moment() {
    let place = tempfile::tempdir().unwrap();
    let at = place.path();
    short(at);
    for (call, part, result, longest) in [
        (
            "withheld --study short.toml --trials 4 --kinds none,outside --detection-only",
            "answers",
            "scorecard.json",
            2500,
        ),
        (
            "reproduce --twin van-der-pol --runs 8 --bank-size 200 --epochs 2",
            "runs",
            "reproduce.json",
            2500,
        ),
    ] {
        let verb = call.split(' ').next().unwrap();
        let kills = killed(at, &format!("{call} --out killed-{verb}"), longest, || {
            false
        });
        assert!(
            start(at, &format!("{call} --out whole-{verb}"))
                .wait()
                .unwrap()
                .success()
        );
        let [killed, whole] = ["killed", "whole"].map(|name| at.join(format!("{name}-{verb}")));
        assert_eq!(
            timeless(&killed.join(result)),
            timeless(&whole.join(result)),
            "{verb}"
        );
        assert_eq!(
            entries(&killed.join(part)),
            entries(&whole.join(part)),
            "nothing half-written stays"
        );
        println!("{verb}: {kills} kills survived");
    }
}
