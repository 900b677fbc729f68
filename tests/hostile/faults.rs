//! Disks that are full, folders that cannot be written, processes that meet: one line that says so, nothing lost, and the same call
//! goes on once there is room. On small file systems of our own, in a name space of our own.

use crate::calls::{TRUETWIN, run};
use crate::files::files;
use crate::studies::short;
use std::fs;
use std::path::Path;
use std::process::{Command, Output, Stdio};

/// Runs a script as a root who has nothing but mounts of its own; `None` where the system does not let us.
pub(crate) fn in_name_space(folder: &Path, script: &str) -> Option<Output> {
    let unshare = |script: &str| {
        Command::new("unshare")
            .args(["--user", "--map-root-user", "--mount", "sh", "-euc", script])
            .current_dir(folder)
            .env("TRUETWIN", TRUETWIN)
            .output()
    };
    let allowed = unshare("mkdir -p probe; mount -t tmpfs none probe; umount probe; rmdir probe");
    if allowed.is_ok_and(|output| output.status.success()) {
        return Some(unshare(script).unwrap());
    }
    assert!(
        std::env::var("TRUETWIN_FAULTS").as_deref() != Ok("required"),
        "no name spaces here"
    );
    eprintln!("skipped: no mounts of our own here");
    None
}

/// One line of an error that says all of this.
fn said(text: &[u8], words: &[&str]) {
    let text = String::from_utf8_lossy(text);
    assert_eq!(text.trim().lines().count(), 1, "{text}");
    for word in words {
        assert!(text.contains(word), "{word} in {text}");
    }
}

/// One call of each verb that writes.
const WRITERS: [&str; 8] = [
    "bank --twin van-der-pol --size 4000 --out disk/new",
    "pretrain --twin van-der-pol --bank-size 4000 --epochs 2 --checkpoint 0 --out disk/new",
    "simulate --twin van-der-pol --theta nu=1 --out disk/new",
    "features r.csv --twin van-der-pol --out disk/new.npy",
    "estimate r.csv --estimator v.est --out disk/new",
    "diagnose r.csv --twin van-der-pol --out disk/new",
    "withheld --study short.toml --trials 4 --kinds none,outside --detection-only --out disk/new",
    "reproduce --twin van-der-pol --estimator v.est --runs 2 --out disk/new",
];

/// A study, a record and an estimator.
fn prepare(at: &Path) {
    short(at);
    for words in [
        "simulate --twin van-der-pol --theta nu=1 --out r.csv",
        "pretrain --twin van-der-pol --bank-size 300 --epochs 2 --out v.est",
    ] {
        assert!(run(at, words).status.success(), "{words}");
    }
    fs::create_dir(at.join("disk")).unwrap();
}

/// Each verb refuses to write onto a disk that `mount` makes, in one line that says this, and leaves nothing there but `left`.
fn each_writer_says(mount: &str, words: &[&str], left: &str) {
    let place = tempfile::tempdir().unwrap();
    prepare(place.path());
    for call in WRITERS {
        let script = format!(
            "{mount}
             $TRUETWIN {call} > out.txt 2> err.txt && code=0 || code=$?
             echo $code; ls -A disk"
        );
        let Some(output) = in_name_space(place.path(), &script) else {
            return;
        };
        let told = String::from_utf8_lossy(&output.stdout);
        assert!(
            told.starts_with(&format!("2\n{left}")),
            "{call}: {output:?}"
        );
        assert!(!told.contains(".truetwin-"), "{call}: {told}");
        let error = fs::read(place.path().join("err.txt")).unwrap();
        let mut lines = error.trim_ascii_end().rsplit(|b| *b == b'\n');
        said(
            lines.next().unwrap(),
            &[&["error: disk/new"], words].concat(),
        );
    }
}

#[test]
fn a_full_disk_is_said_and_leaves_nothing_half_written() {
    let full = "mount -t tmpfs -o size=4k none disk; head -c 4096 /dev/zero > disk/all";
    each_writer_says(full, &["make room"], "all\n");
}

#[test]
fn a_folder_that_cannot_be_written_is_said() {
    let read_only = "mount -t tmpfs -o ro none disk";
    each_writer_says(read_only, &["ead-only", "choose another place"], "");
}

/// A result is not lost with its disk: the answer is printed, and kept where there is room.
#[test]
fn an_answer_without_room_is_kept_elsewhere() {
    let place = tempfile::tempdir().unwrap();
    let at = place.path();
    prepare(at);
    let full = "mount -t tmpfs -o size=8k none disk; head -c 4096 /dev/zero > disk/all";
    for (call, kept) in [
        (
            "fit r.csv --twin van-der-pol --out disk/it",
            "truetwin-fit.json",
        ),
        (
            "estimate r.csv --estimator v.est --out disk/it",
            "truetwin-estimate.json",
        ),
        (
            "simulate --twin van-der-pol --theta nu=1 --out disk/it",
            "it",
        ),
    ] {
        let script = format!(
            "{full}; $TRUETWIN {call} > out.txt 2> err.txt && exit 71 || test $? = 2; ls -A disk"
        );
        let Some(output) = in_name_space(at, &script) else {
            return;
        };
        assert_eq!(output.stdout, b"all\n", "{call}: {output:?}");
        let error = fs::read_to_string(at.join("err.txt")).unwrap();
        assert!(
            error.contains("make room") && error.trim_end().ends_with(&format!("is in {kept}")),
            "{error}"
        );
        let text = fs::read_to_string(at.join(kept)).unwrap();
        match kept.ends_with(".json") {
            true => {
                serde_json::from_str::<serde_json::Value>(&text).unwrap();
                let printed = fs::read_to_string(at.join("out.txt")).unwrap();
                assert!(printed.contains("nu"), "{printed}");
            }
            false => assert!(text == fs::read_to_string(at.join("r.csv")).unwrap()),
        }
    }
}

/// The disk fills up in the middle; with more room the same call ends the work, with the bytes of one that was never disturbed.
#[test]
fn work_goes_on_once_there_is_room() {
    let place = tempfile::tempdir().unwrap();
    let at = place.path();
    for (words, size) in [
        ("bank --twin van-der-pol --size 4000", "160k"),
        (
            "pretrain --twin van-der-pol --bank-size 1500 --epochs 6 --checkpoint 0",
            "400k",
        ),
    ] {
        let verb = words.split(' ').next().unwrap();
        let script = format!(
            "mkdir -p disk; mount -t tmpfs -o size={size} none disk
             $TRUETWIN {words} --out disk/it 2> err.txt && exit 7 || test $? = 2
             ls disk >&2
             mount -o remount,size=100m disk
             $TRUETWIN {words} --out disk/it
             cp -r disk/it {verb}-full
             test $(ls -A disk | wc -l) = 1"
        );
        let Some(output) = in_name_space(at, &script) else {
            return;
        };
        assert!(output.status.success(), "{verb}: {output:?}");
        let error = fs::read(at.join("err.txt")).unwrap();
        said(&error, &["error: disk/it", "make room"]);
        let whole = format!("{words} --out {verb}-whole");
        assert!(run(at, &whole).status.success());
        let [full, whole] = ["full", "whole"].map(|name| at.join(format!("{verb}-{name}")));
        match full.is_dir() {
            true => assert_eq!(files(&full), files(&whole)),
            false => assert!(fs::read(&full).unwrap() == fs::read(&whole).unwrap()),
        }
    }
}

/// Standard output or standard error on a full device, or closed: no panic.
#[test]
fn outputs_that_take_nothing_are_no_panic() {
    let place = tempfile::tempdir().unwrap();
    for (script, code) in [
        ("$TRUETWIN twins > /dev/full", 2),
        ("$TRUETWIN --help > /dev/full", 2),
        ("$TRUETWIN no-verb 2> /dev/full", 2),
        ("$TRUETWIN twins >&-", 0),
        ("$TRUETWIN no-verb 2>&-", 2),
        ("$TRUETWIN effects --twin tanks 2>&- | true", 0),
    ] {
        let output = Command::new("sh")
            .args(["-c", script])
            .current_dir(place.path())
            .env("TRUETWIN", TRUETWIN)
            .output()
            .unwrap();
        assert_eq!(output.status.code(), Some(code), "{script}: {output:?}");
    }
}

/// Both go on with what the other has done.
#[test]
fn two_processes_fill_one_folder() {
    let place = tempfile::tempdir().unwrap();
    let at = place.path();
    short(at);
    for (words, part) in [
        ("bank --twin van-der-pol --size 3000", ""),
        (
            "withheld --study short.toml --trials 2 --kinds none,outside --detection-only",
            "keys",
        ),
        (
            "reproduce --twin van-der-pol --runs 3 --bank-size 300 --epochs 2",
            "estimator.est",
        ),
    ] {
        let verb = words.split(' ').next().unwrap();
        let call = |out: &str| {
            let mut command = Command::new(TRUETWIN);
            command.args(words.split(' ')).args(["--out", out]);
            command
                .current_dir(at)
                .stdout(Stdio::null())
                .spawn()
                .unwrap()
        };
        let two = format!("{verb}-two");
        let both: Vec<_> = (0..3).map(|_| call(&two)).collect();
        for one in both {
            let output = one.wait_with_output().unwrap();
            assert!(output.status.success(), "{verb}: {output:?}");
        }
        let one = format!("{verb}-one");
        assert!(call(&one).wait().unwrap().success());
        let [two, one] = [&two, &one].map(|name| files(&at.join(name)));
        let names = |all: &std::collections::BTreeMap<_, Vec<u8>>| -> Vec<_> {
            all.keys().cloned().collect()
        };
        assert_eq!(names(&two), names(&one), "{verb}");
        for (name, bytes) in &one {
            if part.is_empty() || name.starts_with(part) {
                assert!(two[name] == *bytes, "{verb}: {}", name.display());
            }
        }
    }
}

/// Nothing asks what time it is: a clock that goes backwards cannot be noticed.
#[test]
fn no_source_reads_the_clock_on_the_wall() {
    let sources = files(&Path::new(env!("CARGO_MANIFEST_DIR")).join("src"));
    assert!(sources.len() > 100);
    for (name, bytes) in sources {
        let text = String::from_utf8(bytes).unwrap();
        for clock in ["SystemTime", "UNIX_EPOCH", ".modified()", ".created()"] {
            assert!(!text.contains(clock), "{clock} in {}", name.display());
        }
    }
}
