//! SIGINT and SIGTERM at random times in every verb that works for a while: it ends within two seconds with exit code 130, and what it says
//! of what is kept is true.

use crate::calls::{self, TRUETWIN, run, start, told};
use crate::studies::short;
use rand::seq::SliceRandom;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::collections::BTreeSet;
use std::fmt::Write;
use std::fs;
use std::path::Path;
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant};

/// Two seconds are documented; the rest is for a loaded machine.
const HEARD: Duration = Duration::from_secs(2 + 2);
/// Time within which a program has begun to listen: before, a signal ends it as it ends any program.
const BEGUN: Duration = Duration::from_millis(20);
/// Time within which a call that is done ends.
const JUST_ENDED: Duration = Duration::from_millis(20);

/// Calls that take a second or more, and what they write.
const CALLS: [(&str, &str); 12] = [
    ("check long.csv --twin tanks", "-"),
    (
        "simulate --study slow.toml --theta k1=0.6,k2=0.6,k3=0.6,k4=1 --out sim.csv",
        "sim.csv",
    ),
    ("fit tanks.csv --twin tanks --profile --out fit", "fit"),
    (
        "diagnose tanks.csv --twin tanks --calibrate 20 --out gap",
        "gap",
    ),
    ("estimate tanks.csv --estimator t.est --out est", "est"),
    ("pretrain --twin tanks --out p.est", "p.est"),
    ("bank --twin tanks --size 200000 --out bank", "bank"),
    ("features long.csv --twin tanks --out f.csv", "f.csv"),
    (
        "resample long.csv --step 1.3 --inputs hold --out r.csv",
        "r.csv",
    ),
    ("reproduce --twin van-der-pol --runs 100 --out rep", "rep"),
    ("withheld --study short.toml --trials 60 --out wh", "wh"),
    (
        "compare short.toml van.toml --validation vdp.csv --out c",
        "c",
    ),
];

fn prepare(at: &Path, copies: usize) {
    short(at);
    fs::write(
        at.join("van.toml"),
        "twin = 'van-der-pol'\n[prior]\nnu = [0.6, 1.9]\n",
    )
    .unwrap();
    fs::write(
        at.join("slow.toml"),
        "twin = 'tanks'\n[record]\nsamples = 20000000\n",
    )
    .unwrap();
    for words in [
        "simulate --twin tanks --theta k1=0.6,k2=0.6,k3=0.6,k4=1 --out tanks.csv",
        "simulate --study short.toml --theta nu=1.2 --out vdp.csv",
        "pretrain --twin tanks --bank-size 300 --epochs 2 --out t.est",
    ] {
        let output = run(at, words);
        assert!(output.status.success(), "{words}: {output:?}");
    }
    let rows = fs::read_to_string(at.join("tanks.csv")).unwrap();
    let rows: Vec<&str> = rows.lines().skip(1).collect();
    let mut long = String::from("t,u,y\n");
    for number in 0..copies * rows.len() {
        let (_, values) = rows[number % rows.len()].split_once(',').unwrap();
        let _ = writeln!(long, "{},{values}", 0.5 * number as f64);
    }
    fs::write(at.join("long.csv"), long).unwrap();
}

fn names(at: &Path) -> BTreeSet<String> {
    let names = fs::read_dir(at).unwrap().map(|e| e.unwrap().file_name());
    names.map(|name| name.into_string().unwrap()).collect()
}

fn remove(at: &Path, out: &str) {
    for path in [at.join(out), at.join(format!("{out}.part"))] {
        let _ = fs::remove_file(&path).or_else(|_| fs::remove_dir_all(&path));
    }
}

/// Time that a call takes, cut off at `most`.
fn time_of(at: &Path, call: &str, most: Duration) -> Duration {
    let (clock, mut child) = (Instant::now(), start(at, call));
    while clock.elapsed() < most && child.try_wait().unwrap().is_none() {
        std::thread::sleep(Duration::from_millis(5));
    }
    let time = clock.elapsed();
    let _ = child.kill();
    child.wait().unwrap();
    time
}

/// Starts a call, sends a signal after a time, and returns how long it took to end; `None` if it ended before.
fn stopped(at: &Path, call: &str, signal: &str, after: Duration) -> Option<(Duration, Output)> {
    let mut child = start(at, call);
    std::thread::sleep(after);
    if child.try_wait().unwrap().is_some() {
        return None;
    }
    calls::signal(&child, signal);
    let clock = Instant::now();
    let output = child.wait_with_output().unwrap();
    let took = clock.elapsed();
    // Its work was done when the signal came.
    let had_ended = output.status.success() && took < JUST_ENDED;
    (!had_ended).then_some((took, output))
}

/// What is wrong with the end of a stopped call.
fn wrong(
    at: &Path,
    out: &str,
    before: &BTreeSet<String>,
    took: Duration,
    end: &Output,
) -> Vec<String> {
    let said = told(end);
    let is_new = |name: &&String| !before.contains(*name);
    let after = names(at);
    let new: Vec<&String> = after.iter().filter(is_new).collect();
    let is_there = at.join(out).exists();
    let kept = is_there || at.join(format!("{out}.part")).exists();
    let marked = || {
        ["fit/fit.json", "gap/report.json"].iter().all(|name| {
            let text = fs::read_to_string(at.join(name)).unwrap_or_default();
            text.is_empty() || text.contains("\"interrupted\": true")
        })
    };
    let checks = [
        (took <= HEARD, "it takes longer than two seconds"),
        (end.status.code() == Some(130), "no code 130"),
        (
            !said.contains("nothing was written") || new.is_empty(),
            "something is written",
        ),
        (!said.contains("is kept in") || kept, "nothing is kept"),
        (
            !said.contains("is complete") || is_there,
            "nothing is complete",
        ),
        (!new.iter().any(|name| name.starts_with('.')), "leftovers"),
        (new.is_empty() || is_there || kept, "another place"),
        (marked(), "the answer is not marked as interrupted"),
    ];
    let bad = checks.into_iter().filter(|(holds, _)| !holds);
    bad.map(|(_, what)| format!("{what} ({took:.2?}, {new:?}): {said}"))
        .collect()
}

/// Stops each of some calls so many times, within the time that it takes, or within this one.
fn heard(seed: u64, times: usize, copies: usize, within: Duration, wanted: impl Fn(&str) -> bool) {
    let place = tempfile::tempdir().unwrap();
    let at = place.path();
    prepare(at, copies);
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let (mut signals, mut longest, mut bad) = (0, Duration::ZERO, vec![]);
    for (call, out) in CALLS.into_iter().filter(|(call, _)| wanted(call)) {
        let whole = time_of(at, call, within);
        remove(at, out);
        let mut rest = times;
        for _ in 0..4 * times {
            let before = names(at);
            let after = whole.mul_f64(random.gen_range(0.02..0.95)).max(BEGUN);
            let signal = ["-INT", "-TERM"].choose(&mut random).unwrap();
            if let Some((took, end)) = stopped(at, call, signal, after) {
                longest = longest.max(took);
                signals += 1;
                rest -= 1;
                let wrong = wrong(at, out, &before, took, &end);
                bad.extend(
                    wrong
                        .into_iter()
                        .map(|what| format!("{call} after {after:.2?}: {what}")),
                );
            }
            remove(at, out);
            if rest == 0 {
                break;
            }
        }
        println!("{call}: {} signals", times - rest);
    }
    println!("{signals} signals, the longest {longest:.2?}");
    assert!(bad.is_empty() && signals > 0, "{}", bad.join("\n"));
}

#[test]
fn long_work_hears_a_signal_at_any_time() {
    let verbs = ["simulate", "diagnose", "estimate", "bank"];
    let wanted = |call: &str| verbs.iter().any(|verb| call.starts_with(verb));
    heard(1, 1, 1, Duration::from_millis(1500), wanted);
}

#[test]
#[ignore = "240 signals, twenty minutes on a quiet machine"]
fn every_verb_hears_a_signal_at_any_time() {
    heard(2, 20, 6000, Duration::from_secs(6), |_| true);
}

/// A lag with noise that takes its time for each run: the second argument, in seconds.
const SLOW: &str = r#"
import json, random, sys, time
told = {"name": "lag", "parameters": [{"name": "a", "prior": [0.5, 1.5]}], "inputs": [{"name": "u"}], "outputs": [{"name": "y"}],
        "record": {"step": 0.1, "samples": 40, "input": {"levels": [-1, 1], "hold": 10}}}
for line in sys.stdin:
    r = json.loads(line)
    if r["request"] == "describe":
        print(json.dumps(told), flush=True)
        continue
    time.sleep(float(sys.argv[1]))
    x, y, noise = 0.0, [], random.Random(r["seed"])
    for u in r["inputs"]["u"]:
        y.append(x + 0.02 * noise.gauss(0, 1))
        x += r["step"] * (u - r["theta"]["a"] * x)
    print(json.dumps({"id": r["id"], "outputs": {"y": y}}), flush=True)
"#;

/// A pass over a record takes many runs of a program, and one run may take minutes: neither holds up the end.
#[test]
fn a_slow_program_holds_nothing_up() {
    let place = tempfile::tempdir().unwrap();
    let at = place.path();
    fs::write(at.join("slow.py"), SLOW).unwrap();
    let rows = (0..40).map(|k| format!("{},{},{}\n", 0.1 * f64::from(k), k / 10 % 2, k % 7));
    fs::write(
        at.join("r.csv"),
        format!("t,u,y\n{}", rows.collect::<String>()),
    )
    .unwrap();
    for verb in ["fit", "diagnose"] {
        for seconds in ["0.2", "100"] {
            let mut call = Command::new(TRUETWIN);
            let program = format!("python3 slow.py {seconds}");
            call.args([verb, "r.csv", "--threads", "1", "--program", &program]);
            let call = call
                .current_dir(at)
                .stdout(Stdio::null())
                .stderr(Stdio::piped());
            let child = call.spawn().unwrap();
            std::thread::sleep(Duration::from_millis(1500));
            let since = Instant::now();
            calls::signal(&child, "-INT");
            let output = child.wait_with_output().unwrap();
            assert_eq!(
                output.status.code(),
                Some(130),
                "{verb} {seconds}: {output:?}"
            );
            assert!(
                since.elapsed() < HEARD,
                "{verb} {seconds}: {:?}",
                since.elapsed()
            );
        }
    }
}
