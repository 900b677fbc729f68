//! Names and places that a system allows: bytes that are no text, pipes, links to nothing, a user's own dotfiles, places that are taken
//! while the work goes on. No answer is lost to them.

use crate::calls::{TRUETWIN, run, told};
use crate::studies::short;
use std::ffi::{OsStr, OsString};
use std::fs;
use std::os::unix::ffi::OsStrExt;
use std::os::unix::fs::symlink;
use std::path::Path;
use std::process::{Command, Output, Stdio};

fn call<'a>(folder: &Path, words: &str, more: impl IntoIterator<Item = &'a OsStr>) -> Output {
    let mut command = Command::new(TRUETWIN);
    command.args(words.split_whitespace()).args(more);
    command.current_dir(folder).output().unwrap()
}

/// A folder with a short record of the oscillator and its study.
fn with_record() -> tempfile::TempDir {
    let place = tempfile::tempdir().unwrap();
    short(place.path());
    let made = run(
        place.path(),
        "simulate --study short.toml --theta nu=1 --out r.csv",
    );
    assert!(made.status.success(), "{made:?}");
    place
}

fn json(output: &Output) -> serde_json::Value {
    assert!(output.status.success(), "{}", told(output));
    serde_json::from_slice(&output.stdout).unwrap()
}

/// A Latin-1 name: the answer has it with a replacement character, its call with the very bytes.
#[test]
fn names_are_bytes() {
    let place = with_record();
    let at = place.path();
    let name = OsString::from(OsStr::from_bytes(b"Messung_f\xfcr.csv"));
    if fs::copy(at.join("r.csv"), at.join(&name)).is_err() {
        return;
    }
    for verb in ["fit", "check"] {
        let words = format!("{verb} --study short.toml --json");
        let answer = json(&call(at, &words, [&*name]));
        let provenance = &answer["provenance"];
        let files = provenance["files"].as_array().unwrap();
        let record = files.iter().find(|file| file["role"] == "record").unwrap();
        assert_eq!(record["path"], "Messung_f\u{fffd}r.csv");
        assert_eq!(record["sha256"].as_str().unwrap().len(), 64);
        let said = provenance["call"].as_str().unwrap();
        assert!(said.contains(r"$'Messung_f\374r.csv'"), "{said}");
    }
    let out = OsString::from(OsStr::from_bytes(b"\xfc.csv"));
    for words in [
        "simulate --study short.toml --theta nu=1 --json --out",
        "resample r.csv --step 0.1 --json --out",
    ] {
        let answer = json(&call(at, words, [&*out]));
        assert_eq!(answer["record"], "\u{fffd}.csv", "{words}");
        fs::remove_file(at.join(&out)).unwrap();
    }
    let study = OsString::from(OsStr::from_bytes(b"\xe9tude.toml"));
    fs::copy(at.join("short.toml"), at.join(&study)).unwrap();
    json(&call(at, "fit r.csv --json --study", [&*study]));
}

/// A pipe is one record, and its checksum is that of the bytes that came through it.
#[test]
fn pipes_are_read_once() {
    let place = with_record();
    let at = place.path();
    let made = Command::new("mkfifo").arg(at.join("pipe")).status();
    assert!(made.unwrap().success());
    let feed = |from: &'static str, to: &'static str| {
        let (from, to) = (at.join(from), at.join(to));
        std::thread::spawn(move || fs::copy(from, to).map(drop))
    };
    let direct = json(&run(at, "fit r.csv --study short.toml --json"));
    let sum = |answer: &serde_json::Value| {
        let files = answer["provenance"]["files"].as_array().unwrap();
        let record = files.iter().find(|file| file["role"] == "record").unwrap();
        record["sha256"].clone()
    };
    let writer = feed("r.csv", "pipe");
    let piped = json(&run(at, "fit pipe --study short.toml --json"));
    writer.join().unwrap().unwrap();
    assert_eq!(sum(&piped), sum(&direct));
    let mut command = Command::new(TRUETWIN);
    command.args("fit /dev/stdin --study short.toml --json".split(' '));
    command.current_dir(at).stdin(Stdio::piped());
    let mut child = command.stdout(Stdio::piped()).spawn().unwrap();
    let bytes = fs::read(at.join("r.csv")).unwrap();
    std::io::Write::write_all(&mut child.stdin.take().unwrap(), &bytes).unwrap();
    assert_eq!(sum(&json(&child.wait_with_output().unwrap())), sum(&direct));
    let writer = feed("r.csv", "pipe");
    let twice = run(at, "fit pipe pipe --study short.toml");
    writer.join().unwrap().unwrap();
    assert_eq!(twice.status.code(), Some(2));
    assert!(
        told(&twice).contains("pipe: it is a pipe, which can be read once"),
        "{}",
        told(&twice)
    );
    // Several studies read one record: what came through the pipe is kept.
    let writer = feed("r.csv", "pipe");
    let compared = "compare short.toml short.toml --record r.csv --validation pipe --json";
    let compared = json(&run(at, compared));
    writer.join().unwrap().unwrap();
    assert_eq!(compared["studies"].as_array().unwrap().len(), 2);
}

/// A file that is another one by the end of the work is told: the answer is of the bytes that were read.
#[test]
fn a_file_that_changes_meanwhile_is_told() {
    let place = with_record();
    let at = place.path();
    for (change, words) in [("echo '# more' >> r.csv", true), ("touch r.csv", false)] {
        let fit =
            format!("{TRUETWIN} fit r.csv --study short.toml --draws 20000 --out told-{words}");
        let script = format!("(sleep 0.3; {change}) & {fit}");
        let output = Command::new("sh")
            .args(["-c", &script])
            .current_dir(at)
            .output()
            .unwrap();
        let is_told = told(&output).contains("warning: r.csv has changed since it was read");
        assert!(
            output.status.success() && is_told == words,
            "{change}: {output:?}"
        );
    }
}

/// What begins as our unfinished files do, and is a user's.
#[test]
fn dotfiles_of_users_stay() {
    let place = with_record();
    let at = place.path();
    fs::create_dir(at.join(".truetwin-cache")).unwrap();
    fs::copy(at.join("short.toml"), at.join(".truetwin-study.toml")).unwrap();
    let made = run(
        at,
        "simulate --study .truetwin-study.toml --theta nu=1 --out s.csv",
    );
    assert!(made.status.success(), "{}", told(&made));
    assert!(at.join(".truetwin-cache").exists() && at.join(".truetwin-study.toml").exists());
    for call in [
        "simulate --study short.toml --theta nu=1 --out .truetwin-s.csv",
        "fit r.csv --study short.toml --out .truetwin-gap",
        "bank --study short.toml --size 8 --out .truetwin-bank",
        "pretrain --study short.toml --out .truetwin-est",
    ] {
        let refused = run(at, call);
        assert_eq!(refused.status.code(), Some(2), "{call}");
        assert!(
            told(&refused).contains("choose another name"),
            "{}",
            told(&refused)
        );
    }
}

#[test]
fn links_to_nothing_are_told_as_such() {
    let place = with_record();
    let at = place.path();
    symlink("/nowhere/at/all", at.join("link")).unwrap();
    for call in [
        "fit link --study short.toml",
        "fit r.csv --study link",
        "fit r.csv --study short.toml --out link",
        "simulate --study short.toml --theta nu=1 --out link",
    ] {
        let refused = run(at, call);
        assert_eq!(refused.status.code(), Some(2), "{call}");
        let text = told(&refused);
        assert!(text.contains("a link to /nowhere/at/all"), "{call}: {text}");
    }
}

/// `out/.` is `out`; a file whose place names a folder is refused before the work.
#[test]
fn places_with_a_dot_at_their_end() {
    let place = with_record();
    let at = place.path();
    let made = run(at, "fit r.csv --study short.toml --out result/.");
    assert!(made.status.success(), "{}", told(&made));
    assert!(at.join("result/fit.json").exists());
    for out in ["s.csv/", "s.csv/."] {
        let call = format!("simulate --study short.toml --theta nu=1 --out {out}");
        let refused = run(at, &call);
        assert_eq!(refused.status.code(), Some(2));
        assert!(told(&refused).contains("name a file"), "{}", told(&refused));
    }
    let long = "a".repeat(255);
    let made = run(at, &format!("fit r.csv --study short.toml --out {long}"));
    assert!(made.status.success(), "{}", told(&made));
}

/// The place is taken while the work goes on: the answer is printed, its files are beside, and the exit code says so.
#[test]
fn an_answer_outlives_its_place() {
    let place = with_record();
    let at = place.path();
    let mut command = Command::new(TRUETWIN);
    let words = "fit r.csv --study short.toml --out o --json --draws 2000";
    command.args(words.split(' ')).current_dir(at);
    let child = (command.stdout(Stdio::piped()).stderr(Stdio::piped()))
        .spawn()
        .unwrap();
    let is_begun = || {
        let names = fs::read_dir(at).unwrap().map(|e| e.unwrap().file_name());
        names
            .into_iter()
            .any(|n| n.to_string_lossy().starts_with(".truetwin-unfinished-"))
    };
    while !is_begun() {
        std::thread::sleep(std::time::Duration::from_millis(1));
    }
    fs::write(at.join("o"), "another's").unwrap();
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(2));
    let answer: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert!(
        answer["parameters"].is_array() || answer["parameters"].is_object(),
        "{answer}"
    );
    assert!(
        told(&output).contains("the result is in o-2"),
        "{}",
        told(&output)
    );
    assert!(at.join("o-2/fit.json").exists());
    assert_eq!(fs::read(at.join("o")).unwrap(), b"another's");
}

/// A file that appears while a network is trained stays, and the estimator is kept beside it.
#[test]
fn an_estimator_is_kept_beside_what_has_taken_its_place() {
    let place = with_record();
    let at = place.path();
    let beside = || {
        let mut work = Command::new(TRUETWIN)
            .args("pretrain --study short.toml --bank-size 300 --epochs 60 --out p.est".split(' '))
            .current_dir(at)
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        // Its own folder stands while it works; the place of the estimator is free.
        while !at.join("p.est.part").exists() && work.try_wait().unwrap().is_none() {
            std::thread::sleep(std::time::Duration::from_millis(1));
        }
        fs::write(at.join("p.est"), "mine").unwrap();
        let output = work.wait_with_output().unwrap();
        if output.status.success() {
            fs::remove_file(at.join("p.est")).unwrap();
        }
        output
    };
    // On a busy machine the work may be done before the file is there.
    let mut tries = (0..10).map(|_| beside());
    let output = tries.find(|output| !output.status.success()).unwrap();
    assert_eq!(output.status.code(), Some(2), "{}", told(&output));
    assert!(told(&output).contains("p-2.est"), "{}", told(&output));
    assert_eq!(fs::read(at.join("p.est")).unwrap(), b"mine");
    assert!(!at.join("p.est.part").exists());
    json(&run(at, "estimate r.csv --estimator p-2.est --json"));
}

/// What failed before its first piece leaves nothing that a later call would have to be the same as.
#[test]
fn a_bank_that_fails_at_once_leaves_no_folder() {
    let place = tempfile::tempdir().unwrap();
    let at = place.path();
    let program = |outputs: &str| {
        let text = format!(
            "import sys, json, time\n\
             for line in sys.stdin:\n    q = json.loads(line)\n    \
             if q['request'] == 'describe':\n        \
             print(json.dumps({{'name': 'p', 'parameters': [{{'name': 'k', 'prior': [0.5, 2.0]}}], 'outputs': [{{'name': 'y'}}],\n            \
             'record': {{'step': 0.1, 'samples': 20}}}}), flush=True)\n    \
             else:\n        \
             print(json.dumps({{'id': q['id'], {outputs}}}), flush=True)\n"
        );
        fs::write(at.join("p.py"), text).unwrap();
    };
    let bank = || {
        Command::new(TRUETWIN)
            .args([
                "bank",
                "--program",
                "python3 p.py",
                "--size",
                "30",
                "--out",
                "b",
            ])
            .current_dir(at)
            .output()
            .unwrap()
    };
    let refused = |part: &str| {
        let output = bank();
        assert_eq!(output.status.code(), Some(2), "{}", told(&output));
        assert!(told(&output).contains(part), "{}", told(&output));
        assert!(!at.join("b").exists(), "{part}");
    };
    program("'error': 'no licence'");
    refused("no licence");
    program("'outputs': {'y': [time.time() + i for i in range(20)]}");
    refused("two simulations with one seed differ");
    let noisy = "'outputs': {'y': [q['theta']['k'] * (i % 7) + ((q['seed'] * (i + 1)) % 97) / 97 for i in range(20)]}";
    program(noisy);
    let output = bank();
    assert!(output.status.success(), "{}", told(&output));
}
