//! Verbs on studies, records and descriptions that are nearly right, within this process. A call ends with a result or with one line that
//! says what is wrong, where, and what to do; it never panics, and leaves nothing half-written. Work that takes long is cancelled, and hears that.
//!
//! Case by case the same in every run. `TRUETWIN_FUZZ=FROM,SECONDS` begins at another number and takes another time:
//!
//! ```console
//! $ TRUETWIN_FUZZ=0,600 cargo test --test hostile verbs -- --ignored
//! ```

mod cases;

use cases::{Case, Seeds};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use std::collections::BTreeMap;
use std::ffi::OsString;
use std::fs;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};
use truetwin::estimator::Project;
use truetwin::evaluate::paper::reference_projects;
use truetwin::fuzzing::calls::{self, Ended};

/// Time after which the work of a call is cancelled.
const PATIENCE: Duration = Duration::from_millis(700);
/// Time that a call may take to hear that: two seconds are documented, the rest is for a loaded machine.
const HEARD: Duration = Duration::from_secs(8);
/// Longest line of a refusal.
const LONGEST: usize = 2100;

/// Estimator of the oscillator, for all cases.
const ESTIMATOR: &str = "e.est";

/// Puts the files of a case into a folder and runs its call there.
fn run(place: &Path, case: &Case, projects: &[Project]) -> Ended {
    let names = [
        "s.toml",
        "s2.toml",
        "r.csv",
        "r2.csv",
        "p.line",
        "p.sh",
        "o",
        "o.csv",
        "o.est",
        "o.est.part",
        ESTIMATOR,
    ];
    let at = |name: &str| place.join(name);
    for name in names.into_iter().filter(|name| *name != ESTIMATOR) {
        let _ = fs::remove_file(at(name));
        let _ = fs::remove_dir_all(at(name));
    }
    let [first, second] = &case.records;
    // The same line for each request; a program that says nothing is waited for, which a signal alone ends.
    let line = match case.description.trim_ascii() {
        b"" => b"-",
        line => line,
    };
    let script = format!(
        "#!/bin/sh\nwhile read line; do cat {0}; echo; done\n",
        at("p.line").display()
    );
    for (name, bytes) in [
        ("s.toml", &case.study[..]),
        ("s2.toml", &case.study[..]),
        ("r.csv", first),
        ("r2.csv", second),
        ("p.line", line),
        ("p.sh", script.as_bytes()),
    ] {
        fs::write(at(name), bytes).unwrap();
    }
    let words =
        std::iter::once("truetwin".to_owned()).chain(case.words.iter().map(|word| match word {
            word if names.contains(&word.as_str()) => at(word).to_str().unwrap().to_owned(),
            word if word == "./p.sh" => format!("sh {}", at("p.sh").display()),
            word => word.clone(),
        }));
    let words: Vec<OsString> = words.map(OsString::from).collect();
    calls::run(&words, projects, PATIENCE)
}

/// What is wrong with the end of a call, if anything is.
fn fault(place: &Path, case: &Case, ended: &Ended, took: Duration) -> Option<String> {
    // What reads and writes alone is left by its process, not cancelled within it.
    let is_cancelled = case.words[0] != "resample";
    if is_cancelled && took > PATIENCE + HEARD {
        return Some(format!("it does not hear that it is to stop: {took:.1?}"));
    }
    let said = ended.said.trim_end();
    let errors: Vec<&str> = said
        .lines()
        .filter(|line| line.starts_with("error: "))
        .collect();
    let is_of_check = ended.code == 1 && case.words[0] == "check" && errors.is_empty();
    match ended.code {
        0 if errors.is_empty() => {}
        1 if is_of_check => {}
        // The command line says more of a call that is stopped.
        1 if matches!(errors[..], [error] if error.ends_with(": cancelled")) && took > PATIENCE => {
        }
        130 if took > PATIENCE => {}
        2 if errors.len() == 1 && said.ends_with(errors[0]) => {}
        code => return Some(format!("code {code}: {said}")),
    }
    for line in said.lines() {
        let odd = |c: char| c.is_control() || matches!(c, '\u{202a}'..='\u{202e}');
        if line.contains(odd) || line.chars().count() > LONGEST {
            return Some(format!("no single plain line: {line:?}"));
        }
    }
    let has_remedy = |line: &&str| line.contains([';', '(']);
    if ended.code == 2 && !errors.iter().all(has_remedy) {
        return Some(format!("no remedy: {said}"));
    }
    let is_number_file = ["simulate", "features", "resample", "export"].contains(&&*case.words[0]);
    let printed = if is_number_file || case.words.contains(&"--json".into()) {
        ""
    } else {
        &ended.printed
    };
    // What a parser read is quoted as it writes it.
    let own = |line: &&str| {
        !line.starts_with("truetwin 0")
            && !line.contains("stopped")
            && !line.contains("found floating point")
    };
    let lines = said.lines().chain(printed.lines()).filter(own);
    let given = String::from_utf8_lossy(
        &[&case.study[..], &case.records.concat(), &case.description].concat(),
    )
    .into_owned()
        + &case.words.join(" ");
    if let Some((number, line)) = lines
        .filter_map(|line| Some((long_number(line, &given)?, line)))
        .next()
    {
        return Some(format!("{number} has more than eight digits: {line}"));
    }
    let left = fs::read_dir(place)
        .unwrap()
        .flatten()
        .map(|entry| entry.file_name());
    let left: Vec<OsString> = left
        .filter(|name| name.to_string_lossy().starts_with(".truetwin-"))
        .collect();
    if !left.is_empty() {
        return Some(format!("{left:?} stays"));
    }
    let has_out = place.join("o").exists() || place.join("o.csv").exists();
    // Work keeps the pieces that are done, whatever ends it; a diagnosis that is stopped writes what it has.
    let keeps = ["bank", "withheld", "reproduce"].contains(&&*case.words[0]) || ended.code == 130;
    (has_out && !is_of_check && ended.code != 0 && !keeps)
        .then(|| format!("code {}, and something is written: {said}", ended.code))
}

/// The first number of more than eight significant digits that the files of the call do not hold.
fn long_number(line: &str, given: &str) -> Option<String> {
    let is_part = |c: char| c.is_ascii_alphanumeric() || c == '.' || c == '_';
    (line.split(|c| !is_part(c)))
        .filter(|word| word.starts_with(|c: char| c.is_ascii_digit()))
        .find(|word| {
            let mantissa = word.split(['e', 'E']).next().unwrap_or(word);
            let digits = mantissa.replace('.', "");
            let is_number = digits.chars().all(|c| c.is_ascii_digit());
            let significant = digits.trim_start_matches('0').trim_end_matches('0').len();
            // Written by hand, or a number with all its zeros.
            let is_long = significant > 8 || mantissa.trim_start_matches('0').len() > 12;
            is_number && is_long && !given.contains(*word)
        })
        .map(str::to_owned)
}

/// A fault without what differs from case to case.
fn kind(fault: &str) -> String {
    let words = fault.split_whitespace().map(|word| {
        let is_word = word
            .chars()
            .all(|c| c.is_alphabetic() || ",;:'-".contains(c));
        if is_word { word } else { "_" }
    });
    words.take(24).collect::<Vec<_>>().join(" ")
}

/// Keeps the files of a case that fails.
fn keep(case: &Case, number: u64) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("fuzz/verbs-{number}"));
    fs::create_dir_all(&folder).unwrap();
    let [first, second] = &case.records;
    for (name, bytes) in [
        ("s.toml", &case.study),
        ("r.csv", first),
        ("r2.csv", second),
        ("p.line", &case.description),
        ("call", &case.words.join(" ").into_bytes()),
    ] {
        fs::write(folder.join(name), bytes).unwrap();
    }
    folder
}

/// Runs cases from a number on, for a time.
fn fuzz(from: u64, time: Duration) {
    let place = tempfile::tempdir().unwrap();
    let projects = reference_projects().unwrap();
    let known = projects
        .iter()
        .find(|p| p.study().name() == "van-der-pol")
        .unwrap();
    let seeds = Seeds::new(place.path(), known.study());
    let _ = fs::remove_file(place.path().join("seed.csv"));
    let made = "truetwin pretrain --twin van-der-pol --bank-size 100 --epochs 1 --out";
    let mut made: Vec<OsString> = made.split(' ').map(OsString::from).collect();
    made.push(place.path().join(ESTIMATOR).into());
    let made = calls::run(&made, &projects, HEARD);
    assert_eq!(made.code, 0, "{}", made.said);
    let mut faults: BTreeMap<String, (usize, String)> = BTreeMap::new();
    let mut ends: BTreeMap<(String, u8), usize> = BTreeMap::new();
    let (begun, mut number) = (Instant::now(), from);
    while begun.elapsed() < time {
        let case = seeds.case(&mut ChaCha8Rng::seed_from_u64(number));
        let clock = Instant::now();
        let ended = run(place.path(), &case, &projects);
        *ends.entry((case.words[0].clone(), ended.code)).or_default() += 1;
        if let Some(fault) = fault(place.path(), &case, &ended, clock.elapsed()) {
            let entry = faults.entry(kind(&fault)).or_insert_with(|| {
                let folder = keep(&case, number);
                (
                    0,
                    format!("{}: {}\n  {fault}", folder.display(), case.words.join(" ")),
                )
            });
            entry.0 += 1;
        }
        number += 1;
    }
    eprintln!("cases {from} to {number}; verb, code, number: {ends:?}");
    // Cases must reach the work now and then, and must not all be harmless.
    let of = |wanted: u8| -> usize {
        let ends = ends.iter().filter(|((_, code), _)| *code == wanted);
        ends.map(|(_, number)| number).sum()
    };
    assert!(of(0) > 0 && of(2) > 0, "{ends:?}");
    let all: Vec<String> = (faults.values())
        .map(|(count, first)| format!("{count} times; {first}"))
        .collect();
    assert!(all.is_empty(), "{} kinds:\n{}", all.len(), all.join("\n"));
}

/// The number of the first case, and the time.
fn asked(seconds: u64) -> (u64, Duration) {
    let asked = std::env::var("TRUETWIN_FUZZ").ok();
    let asked = asked.as_deref().and_then(|text| text.split_once(','));
    let (from, seconds) = asked.map_or((0, seconds), |(from, seconds)| {
        (from.parse().unwrap(), seconds.parse().unwrap())
    });
    (from, Duration::from_secs(seconds))
}

#[test]
fn verbs_briefly() {
    fuzz(0, Duration::from_secs(12));
}

#[test]
#[ignore = "ten minutes; TRUETWIN_FUZZ=FROM,SECONDS"]
fn verbs_for_long() {
    let (from, time) = asked(600);
    fuzz(from, time);
}
