//! Four ranks on this machine: the same bytes as alone, and a rank that dies loses what it had not finished, nothing else.
//!
//! Without `mpirun` these tests say that they skipped, unless `TRUETWIN_MPI=required`.

use crate::files::files;
use crate::studies::short;
use crate::timeless::timeless;
use serde_json::Value;
use std::fs;
use std::path::Path;
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

const PROGRAM: &str = env!("CARGO_BIN_EXE_truetwin");

/// `mpirun`, where there is one.
fn launcher() -> bool {
    let found = Command::new("mpirun").arg("--version").output().is_ok();
    let required = std::env::var_os("TRUETWIN_MPI").is_some_and(|v| v == "required");
    assert!(found || !required, "no mpirun; install an MPI library");
    if !found {
        println!("skipped: no mpirun");
    }
    found
}

fn ranks(number: usize, arguments: &[&str]) -> Command {
    let mut command = Command::new("mpirun");
    command
        .env("OMPI_ALLOW_RUN_AS_ROOT", "1")
        .env("OMPI_ALLOW_RUN_AS_ROOT_CONFIRM", "1")
        .args(["--oversubscribe", "-n", &number.to_string(), PROGRAM])
        .args(["--threads", "1"])
        .args(arguments);
    command
}

fn alone(arguments: &[&str]) -> Command {
    let mut command = Command::new(PROGRAM);
    command.args(arguments);
    command
}

fn done(mut command: Command) -> Output {
    let output = command.output().unwrap();
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{command:?}: {said}");
    output
}

#[test]
fn four_ranks_make_the_bank_of_one() {
    if !launcher() {
        return;
    }
    let place = tempfile::tempdir().unwrap();
    let [one, four] = ["one", "four"].map(|name| place.path().join(name));
    let bank = |out: &'static str| {
        [
            "bank",
            "--twin",
            "van-der-pol",
            "--size",
            "500",
            "--json",
            "--out",
            out,
        ]
    };
    let mut command = alone(&bank("one"));
    command.current_dir(place.path());
    done(command);
    let mut command = ranks(4, &bank("four"));
    command.current_dir(place.path());
    let said: Value = serde_json::from_slice(&done(command).stdout).unwrap();
    assert_eq!(said["simulated"], 500, "one rank speaks for all");
    assert_eq!(files(&four), files(&one));
}

/// Processes that `parent` started.
fn children(parent: &Child) -> Vec<u32> {
    let status = |pid: u32| fs::read_to_string(format!("/proc/{pid}/stat")).unwrap_or_default();
    let is_child = |pid: &u32| {
        let stat = status(*pid);
        let fields: Vec<&str> = stat
            .rsplit(')')
            .next()
            .unwrap_or("")
            .split_whitespace()
            .collect();
        fields.get(1) == Some(&parent.id().to_string().as_str())
    };
    (fs::read_dir("/proc").unwrap())
        .filter_map(|entry| entry.unwrap().file_name().to_str()?.parse().ok())
        .filter(is_child)
        .collect()
}

#[cfg(target_os = "linux")]
#[test]
fn a_rank_that_dies_loses_its_unfinished_shard_and_nothing_else() {
    if !launcher() {
        return;
    }
    let place = tempfile::tempdir().unwrap();
    let [whole, killed] = ["whole", "killed"].map(|name| place.path().join(name));
    fn bank(out: &Path) -> [&str; 7] {
        let out = out.to_str().unwrap();
        [
            "bank",
            "--twin",
            "van-der-pol",
            "--size",
            "6000",
            "--out",
            out,
        ]
    }
    let shards = || fs::read_dir(killed.join("shards")).map_or(0, |folder| folder.count());
    let mut job = (ranks(4, &bank(&killed))
        .stdout(Stdio::null())
        .stderr(Stdio::null()))
    .spawn()
    .unwrap();
    let since = Instant::now();
    while shards() < 8 && since.elapsed() < Duration::from_secs(60) {
        std::thread::sleep(Duration::from_millis(2));
    }
    let victim = children(&job)[2].to_string();
    assert!(
        Command::new("kill")
            .args(["-9", &victim])
            .status()
            .unwrap()
            .success()
    );
    assert!(!job.wait().unwrap().success());
    let kept = files(&killed);
    let there = kept
        .keys()
        .filter(|name| name.starts_with("shards"))
        .count();
    assert!((8..63).contains(&there), "{there} shards were there");
    done(ranks(4, &bank(&killed)));
    done(alone(&bank(&whole)));
    let whole = files(&whole);
    for (name, bytes) in &kept {
        if name.starts_with("shards") && name.extension().is_some_and(|e| e == "npz") {
            assert_eq!(Some(bytes), whole.get(name), "what was there is right");
        }
    }
    assert_eq!(files(&killed), whole, "half-written files are gone, too");
}

#[test]
fn ranks_share_records_and_trials() {
    if !launcher() {
        return;
    }
    let place = tempfile::tempdir().unwrap();
    let few = short(place.path());
    let calls: [(&str, &[&str]); 2] = [
        (
            "reproduce.json",
            &[
                "reproduce",
                "--twin",
                "van-der-pol",
                "--runs",
                "3",
                "--bank-size",
                "300",
                "--epochs",
                "2",
            ],
        ),
        (
            "scorecard.json",
            &[
                "withheld",
                "--study",
                &few,
                "--trials",
                "4",
                "--kinds",
                "none,outside",
                "--detection-only",
            ],
        ),
    ];
    for (result, call) in calls {
        let folder = |name: &str| place.path().join(format!("{name}-{}", call[0]));
        for (name, number) in [("alone", 0), ("ranks", 4)] {
            let out = folder(name);
            let call: Vec<&str> = [call, &["--out", out.to_str().unwrap()]].concat();
            done(match number {
                0 => alone(&call),
                number => ranks(number, &call),
            });
        }
        let [alone, ranks] = ["alone", "ranks"].map(|name| timeless(&folder(name).join(result)));
        assert_eq!(alone, ranks, "{result}");
    }
}

#[test]
fn a_wrong_call_ends_every_rank_with_one_message() {
    if !launcher() {
        return;
    }
    for (call, hint) in [
        (&["twins"][..], "one process"),
        (
            &[
                "bank", "--twin", "tanks", "--size", "9", "--shard", "1/2", "--out", "x",
            ],
            "ranks share",
        ),
        (&["reproduce", "--twin", "tanks"], "--out"),
    ] {
        let output = ranks(3, call).output().unwrap();
        let said = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{said}");
        assert!(said.contains(hint), "{call:?}: {said}");
    }
}
