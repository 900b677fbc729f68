//! Hostile calls that once failed: each ends in one line that names the problem, the place and the remedy.

use crate::calls::{TRUETWIN, run};
use crate::files::files;
use crate::studies::short;
use std::fs;
use std::path::Path;
use std::process::{Command, Output};
use tempfile::TempDir;

/// Name of a file that a killed process has left.
const LEFTOVER: &str = ".truetwin-unfinished-4711-a1B2c3";

/// Runs a call that fails with code 2 and one line with all of these parts.
fn refused(folder: &Path, words: &str, parts: &[&str]) {
    let output = run(folder, words);
    one_line(words, &output, parts);
    assert_eq!(output.status.code(), Some(2), "{words}");
}

fn one_line(words: &str, output: &Output, parts: &[&str]) {
    let text = String::from_utf8_lossy(&output.stderr);
    assert_eq!(text.trim().lines().count(), 1, "{words}: {text}");
    for part in parts {
        assert!(text.contains(part), "{words}: {part} in {text}");
    }
}

/// A folder with a record of the oscillator.
fn with_record() -> TempDir {
    let place = tempfile::tempdir().unwrap();
    let made = run(
        place.path(),
        "simulate --twin van-der-pol --theta nu=1 --out r.csv",
    );
    assert!(made.status.success());
    place
}

/// Names in a folder that begin as unfinished files do.
fn leftovers(folder: &Path) -> Vec<String> {
    let names = fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().file_name());
    let names = names.map(|name| name.into_string().unwrap());
    names
        .filter(|name| name.starts_with(".truetwin-"))
        .collect()
}

#[test]
fn odd_record_files_are_named_as_such() {
    let place = tempfile::tempdir().unwrap();
    let utf16 = "t,y\n0,1\n".encode_utf16().flat_map(u16::to_le_bytes);
    let utf16: Vec<u8> = [0xff, 0xfe].into_iter().chain(utf16).collect();
    let stamp = "2024-03-31T00:00:00";
    let zones = format!("t,y\n{stamp}Z,1\n{stamp},2\n");
    let order = format!("t,y\n{stamp}+01:00,1\n{stamp}+02:00,2\n");
    let no_stamp = format!("t,y\n{stamp},1\n31.03.2024 00:01,2\n");
    let kinds = format!("t,y\n0,1\n{stamp},2\n");
    let cases: [(&[u8], &[&str]); 24] = [
        (b"", &["the file is empty"]),
        (b"t,u,y\n0,1,2\n", &["1 row of data", "at least 2"]),
        (
            b"t;u;y\n0,1,2\n",
            &["row 2 has 1 cell", "separated by semicolons"],
        ),
        (
            b"t\tu\ty\n0\t1\t2\t3\n",
            &["row 2 has 4 cells", "separated by tabs"],
        ),
        (
            b"t;y\n0;1,5\n1;1.5\n",
            &["row 3, column y", "decimal point, row 2 a decimal comma"],
        ),
        (
            b"t;y\n0;1.000,5\n",
            &["row 2, column y", "no finite number"],
        ),
        (
            b"t,u,y\n0,\"1,5\",2\n",
            &["decimal comma", "columns by semicolons"],
        ),
        (zones.as_bytes(), &["row 3, column t", "has no time zone"]),
        (
            order.as_bytes(),
            &["row 3, column t", "-3600 s follows 0 s", "must increase"],
        ),
        (
            no_stamp.as_bytes(),
            &["row 3, column t", "2024-03-31T14:00:00.5"],
        ),
        (
            kinds.as_bytes(),
            &["row 3, column t", "earlier times are seconds"],
        ),
        (b"t,y\n01.03.2024,1\n", &["row 2, column t", "ISO 8601"]),
        (b"t,y\n0,1,5\n", &["row 2 has 3 cells", "decimal points"]),
        (b"t,y\n0,\"1,5\"\n", &["row 2, column y", "decimal comma"]),
        (&utf16, &["1 row of data"]),
        (b"t\0,\0y\0", &["UTF-16", "UTF-8"]),
        (b"t,u,y,y\n0,1,2,3\n", &["\"y\" appears twice", "t,u,y1,y2"]),
        (b"t,t,y\n0,0,2\n", &["t appears twice"]),
        (
            b"t,y,y2\n0,0,2\n",
            &["2 outputs (y,y2)", "the twin has 1 (y)"],
        ),
        (b"y\n0\n", &["column t is missing"]),
        ("t,\u{200b}y\n0,1\n".as_bytes(), &["\\u{200b}y"]),
        ("t,y\n0,1\u{a0}000\n".as_bytes(), &["1\\u{a0}000"]),
        (
            b"t,y\n0,1\n0,2\n",
            &["all rows have the time 0 s", "at least two times"],
        ),
        (
            b"t,y\n0,1\n1,1e300\n",
            &["row 3, column y", "largest value"],
        ),
    ];
    for (bytes, parts) in cases {
        fs::write(place.path().join("a.csv"), bytes).unwrap();
        let parts: Vec<&str> = ["a.csv"].iter().chain(parts).copied().collect();
        refused(place.path(), "diagnose a.csv --twin van-der-pol", &parts);
    }
}

#[test]
fn an_input_file_has_no_outputs() {
    let place = with_record();
    let call = "simulate --twin van-der-pol --theta nu=1 --input r.csv";
    refused(place.path(), call, &["r.csv", "remove the output columns"]);
}

/// Repeated and outlying data are no error; the lines before the answer name them.
#[test]
fn likely_mistakes_in_records_are_warned_of() {
    let place = with_record();
    let at = |name: &str| place.path().join(name);
    fs::copy(at("r.csv"), at("same.csv")).unwrap();
    let text = fs::read_to_string(at("r.csv")).unwrap();
    let mut rows: Vec<&str> = text.lines().take(60).collect();
    fs::write(at("short.csv"), rows.join("\n")).unwrap();
    let time = rows[30].split(',').next().unwrap();
    let outlier = format!("{time},1e30");
    rows[30] = &outlier;
    fs::write(at("far.csv"), rows.join("\n")).unwrap();
    // The odd last record ends each call at once.
    fs::write(at("odd.csv"), "t,y\n0,1\n0.05,2\n").unwrap();
    for (records, parts) in [
        (
            "r.csv same.csv odd.csv",
            ["r.csv and same.csv", "counts twice"],
        ),
        (
            "r.csv odd.csv --validation same.csv",
            ["same.csv and r.csv", "second measurement"],
        ),
        (
            "far.csv odd.csv",
            ["far.csv, row 31, column y: 1", "outlier"],
        ),
    ] {
        let output = run(
            place.path(),
            &format!("diagnose {records} --twin van-der-pol"),
        );
        let text = String::from_utf8(output.stderr).unwrap();
        let warning = text.lines().find(|line| line.starts_with("warning: "));
        let warning = warning.unwrap_or_else(|| panic!("no warning in {text}"));
        assert!(parts.iter().all(|part| warning.contains(part)), "{text}");
        assert_eq!(text.lines().count(), 2, "{text}");
    }
}

#[test]
fn numbers_beyond_memory_are_refused() {
    let place = tempfile::tempdir().unwrap();
    for (call, value) in [
        (
            "withheld --twin tanks --trials 1000000000000 --out a",
            "'1000000000000' for '--trials",
        ),
        (
            "reproduce --twin tanks --runs 1000000000000 --out a",
            "runs = 1e12;",
        ),
    ] {
        refused(place.path(), call, &[value, "at most 1000000"]);
    }
    assert!(files(place.path()).is_empty());
}

#[cfg(unix)]
#[test]
fn limits_of_the_system_are_named() {
    let place = tempfile::tempdir().unwrap();
    let limited = |limit: &str, words: &str| {
        let script = format!("ulimit {limit}; exec \"$0\" {words}");
        let mut command = Command::new("sh");
        command
            .args(["-c", &script, TRUETWIN])
            .current_dir(place.path());
        command.output().unwrap()
    };
    let call = "bank --twin van-der-pol --size 64 --out bank";
    let output = limited("-f 0", call);
    one_line(call, &output, &["bank", "ulimit -f"]);
    assert_eq!(output.status.code(), Some(2));
    assert!(files(place.path()).is_empty());
    let call = "simulate --twin van-der-pol --theta nu=1 --out s.csv";
    one_line(
        call,
        &limited("-f 0", call),
        &["error: s.csv: File too large (os error 27); raise"],
    );
    let call = "pretrain --twin van-der-pol --bank-size 500 --epochs 1 --out o";
    let output = limited("-n 5", call);
    assert!(leftovers(place.path()).is_empty(), "{output:?}");
    let call = "twins --threads 1024";
    let output = limited("-v 400000", call);
    one_line(call, &output, &["threads", "--threads", "ulimit -v"]);
    assert_eq!(output.status.code(), Some(2));
    let output = limited("-s 64", "effects --twin tanks");
    assert_eq!(output.status.code(), Some(0), "{output:?}");
}

#[cfg(unix)]
#[test]
fn leftovers_of_killed_runs_are_removed_by_the_next() {
    let place = with_record();
    let bank = "bank --twin van-der-pol --size 64 --out bank";
    assert!(run(place.path(), bank).status.success());
    for part in [".", "bank", "bank/shards"] {
        fs::write(place.path().join(part).join(LEFTOVER), "half").unwrap();
    }
    let claimed = ".truetwin-unfinished-0123456789abcdef";
    fs::create_dir(place.path().join(claimed)).unwrap();
    assert!(run(place.path(), bank).status.success());
    for part in [".", "bank", "bank/shards"] {
        assert!(leftovers(&place.path().join(part)).is_empty(), "{part}");
    }
    fs::write(place.path().join(LEFTOVER), "half").unwrap();
    let call = "simulate --twin van-der-pol --theta nu=1 --out s.csv";
    assert!(run(place.path(), call).status.success());
    assert!(leftovers(place.path()).is_empty());
}

/// Beside the folder, in it, and in each of its parts; what the run itself has written stays.
#[cfg(unix)]
#[test]
fn leftovers_in_a_folder_of_trials_are_removed_by_the_next_run() {
    let place = tempfile::tempdir().unwrap();
    short(place.path());
    let trials =
        "withheld --study short.toml --trials 1 --kinds none --detection-only --out trials";
    assert!(run(place.path(), trials).status.success());
    let parts = [".", "trials", "trials/records", "trials/answers"];
    for part in parts {
        fs::write(place.path().join(part).join(LEFTOVER), "half").unwrap();
    }
    let read = || fs::read(place.path().join("trials/scorecard.json")).unwrap();
    let before = read();
    assert!(run(place.path(), trials).status.success());
    for part in parts {
        assert!(leftovers(&place.path().join(part)).is_empty(), "{part}");
    }
    assert_eq!(read(), before);
    assert!(place.path().join("trials/records/0000.csv").exists());
}

#[test]
fn a_misspelt_word_is_met_with_the_right_one() {
    let place = with_record();
    for (call, parts) in [
        (
            "diagnos r.csv --twin van-der-pol",
            ["'diagnos'", "did you mean diagnose?"],
        ),
        (
            "pre-train --twin tanks",
            ["'pre-train'", "did you mean pretrain?"],
        ),
        (
            "diagnose r.csv --twin van-der-pol --valdation r.csv",
            ["'--valdation'", "did you mean --validation?"],
        ),
        (
            "fit r.csv --twn van-der-pol",
            ["'--twn'", "did you mean --twin?"],
        ),
        (
            "fit r.csv --twin van-der-pole",
            ["\"van-der-pole\"", "did you mean \"van-der-pol\"?"],
        ),
        (
            "reproduce --twin tanks --scenario unform",
            ["'unform'", "did you mean uniform?"],
        ),
        (
            "diagnose r.csv --twin van-der-pol --without sensor-bais",
            ["sensor-bais", "did you mean \"sensor-bias\"?"],
        ),
    ] {
        refused(place.path(), call, &parts);
    }
}

/// Options and keys that would be ignored are refused before the work.
/// Each of these was accepted, or refused with a word that did not help.
#[test]
fn what_says_nothing_is_refused_with_its_remedy() {
    let place = with_record();
    let write = |name: &str, text: &str| fs::write(place.path().join(name), text).unwrap();
    write("only.toml", "twin = 'van-der-pol'\n[library]\nonly = []\n");
    write("fixed.toml", "twin = 'tanks'\n[fixed]\nk1 = 0.5\n");
    let levels =
        "[record]\nstep = 0.1\nsamples = 20\ninput = { levels = [-1e308, 1e308], hold = 5 }\n";
    write("levels.toml", &format!("twin = 'tanks'\n{levels}"));
    write("none.toml", "# nothing\n");
    let effect = "[[effect]]\nid = 'sensor-clipping'\ntarget = 'sensor'\n";
    write(
        "range.toml",
        &format!("{effect}magnitudes = {{ low = 2, high = 1 }}\n"),
    );
    write("late.toml", &format!("{effect}\n{effect}\nerror = 'x'\n"));
    write(
        "digits.toml",
        "twin = 'van-der-pol'\n[record]\nsamples = 1e300\n",
    );
    let noise = "[twin]\nname = 'n'\n[parameters]\na = { prior = [0.5, 2] }\n[states]\nx = { rate = '-a*x', start = 1 }\n\
        [outputs]\ny = { value = 'x', noise = 'sqrt(-x)' }\n[record]\nstep = 0.1\nsamples = 20\n";
    write("noise.toml", noise);
    write("one.csv", "t,u,y\n3,1,1\n3,1,2\n3,1,3\n");
    let theta = "--theta nu=1";
    for (call, parts) in [
        (
            "effects --study only.toml".to_owned(),
            &["only.toml, line 3", "leave it out for all"][..],
        ),
        (
            "simulate --study fixed.toml --theta k1=1,k2=1".to_owned(),
            &["the study file fixes \"k1\""],
        ),
        (
            "simulate --study levels.toml --theta k1=1,k2=1,k3=1,k4=1".to_owned(),
            &["levels.toml", "levels"],
        ),
        (
            format!("simulate --twin van-der-pol {theta} --effect none.toml"),
            &["none.toml, line 1", "each effect is a table [[effect]]"],
        ),
        (
            format!("simulate --twin van-der-pol {theta} --effect range.toml"),
            &["range.toml", "low = 2 is above high = 1"],
        ),
        (
            format!("simulate --twin van-der-pol {theta} --effect late.toml"),
            &["late.toml, line 9"],
        ),
        (
            format!("simulate --study digits.toml {theta}"),
            &["digits.toml, line 3", "1e300"],
        ),
        (
            "simulate --study noise.toml --theta a=1".to_owned(),
            &["noise.toml", "level of noise is no finite number"],
        ),
        (
            "resample one.csv --step 1 --out o.csv".to_owned(),
            &["one.csv", "at least two times"],
        ),
    ] {
        refused(place.path(), &call, parts);
    }
}

#[test]
fn nothing_is_ignored_without_a_word() {
    let place = with_record();
    let study = "twin = 'van-der-pol'\n[noise]\ny = { std = 0.1, known = true, factor = 2 }\n";
    fs::write(place.path().join("noise.toml"), study).unwrap();
    short(place.path());
    fs::write(place.path().join("bank.csv"), "nu,x1\n1.0,0.5\n99,0.5\n").unwrap();
    assert!(
        run(place.path(), "bank --study short.toml --size 64 --out bank")
            .status
            .success()
    );
    let manifest = place.path().join("bank/manifest.json");
    let text = fs::read_to_string(&manifest).unwrap();
    fs::write(&manifest, text.replace("\"seed\": 1", "\"seed\": 2")).unwrap();
    for (call, parts) in [
        (
            "pretrain --study short.toml --bank bank --epochs 1 --out v.est",
            ["bank: ", "its manifest.json was altered"],
        ),
        (
            "pretrain --study short.toml --bank bank.csv --epochs 1 --out v.est",
            ["bank.csv: ", "row 3: nu = 99 is outside its bounds [0, 7]"],
        ),
        (
            "simulate --twin van-der-pol --theta nu=1 --columns y=level",
            ["--columns", "give --input"],
        ),
        (
            "check --twin van-der-pol --columns y=level",
            ["--columns", "give a record"],
        ),
        (
            "fit r.csv --study noise.toml",
            ["noise.toml", "remove one of known and factor"],
        ),
    ] {
        refused(place.path(), call, &parts);
    }
    let program = concat!(env!("CARGO_MANIFEST_DIR"), "/examples/pendulum.py");
    let compare = "compare short.toml short.toml --record r.csv --validation r.csv --program";
    let mut command = Command::new(TRUETWIN);
    command
        .args(compare.split(' '))
        .arg(format!("python3 '{program}'"));
    let output = command.current_dir(place.path()).output().unwrap();
    let parts = ["none of the studies is of the twin pendulum", "remove it"];
    one_line(compare, &output, &parts);
}

#[cfg(unix)]
#[test]
fn a_second_run_on_one_output_is_refused() {
    let place = with_record();
    // By the SHA-256 of `gap`.
    let claimed = place.path().join(".truetwin-unfinished-54d5dbf0124e59af");
    fs::create_dir(&claimed).unwrap();
    let lock = fs::File::open(&claimed).unwrap();
    lock.lock().unwrap();
    let call = "diagnose r.csv --twin van-der-pol --out gap";
    refused(
        place.path(),
        call,
        &["another run is writing to gap", "--out"],
    );
    assert!(claimed.exists());
}

#[test]
fn a_damaged_bank_is_named_with_its_remedy() {
    let place = tempfile::tempdir().unwrap();
    assert!(
        run(
            place.path(),
            "bank --twin van-der-pol --size 128 --out bank"
        )
        .status
        .success()
    );
    let train = "pretrain --twin van-der-pol --bank bank --epochs 1 --out v.est";
    let shards = place.path().join("bank/shards");
    let shard = fs::read_dir(&shards)
        .unwrap()
        .next()
        .unwrap()
        .unwrap()
        .path();
    let bytes = fs::read(&shard).unwrap();
    fs::write(&shard, &bytes[..bytes.len() / 2]).unwrap();
    let name = shard.file_name().unwrap().to_str().unwrap();
    refused(place.path(), train, &["bank/shards", name, "truetwin bank"]);
    fs::remove_file(&shard).unwrap();
    refused(place.path(), train, &["bank: ", "truetwin bank"]);
    fs::write(place.path().join("bank/manifest.json"), "{").unwrap();
    refused(
        place.path(),
        train,
        &[
            "bank: ",
            "manifest.json is damaged",
            "remove this and make it again",
        ],
    );
    refused(
        place.path(),
        "pretrain --twin van-der-pol --bank none --epochs 1 --out v.est",
        &["none: ", "does not exist"],
    );
}

/// Features need the study's step: that of a record whose steps vary would be refused next.
#[test]
fn the_step_that_features_need_is_named() {
    let place = tempfile::tempdir().unwrap();
    short(place.path());
    let rows = (0..60).map(|k| format!("{},{}\n", 0.0501 * f64::from(k + k / 30), (k * k) % 7));
    let text = format!("t,y\n{}", rows.collect::<String>());
    fs::write(place.path().join("uneven.csv"), text).unwrap();
    refused(
        place.path(),
        "features uneven.csv --study short.toml",
        &[
            "in place of 0.05 s",
            "`truetwin resample R.csv --step 0.05 --out R2.csv`",
        ],
    );
}

/// A record whose size cannot be computed with is refused by the verb that would write it anew.
#[test]
fn a_vanishing_channel_is_not_resampled() {
    let place = tempfile::tempdir().unwrap();
    fs::write(
        place.path().join("r.csv"),
        "t,y\n0,1e-110\n1,1e-110\n2,1e-110\n",
    )
    .unwrap();
    let call = "resample r.csv --step 0.5 --out r2.csv";
    refused(
        place.path(),
        call,
        &["r.csv: ", "output 1 is 1e-110", "choose a unit"],
    );
    assert!(!place.path().join("r2.csv").exists());
}

/// A folder is no program, whatever its permissions.
#[test]
fn a_folder_as_program_is_told() {
    let place = tempfile::tempdir().unwrap();
    fs::create_dir(place.path().join("models")).unwrap();
    refused(
        place.path(),
        "check --program ./models",
        &["it is a folder", "name the program in it"],
    );
}

/// The next call is one that a shell takes, and a name is one line.
#[cfg(unix)]
#[test]
fn the_next_call_is_one_for_a_shell() {
    let place = tempfile::tempdir().unwrap();
    let printed = |words: &[&str]| {
        let mut command = Command::new(TRUETWIN);
        let output = command
            .args(words)
            .current_dir(place.path())
            .output()
            .unwrap();
        assert!(output.status.success());
        String::from_utf8(output.stdout).unwrap()
    };
    let page = printed(&["man", "--out", "my\npages"]);
    assert!(
        page.starts_with("$'my\\012pages': ") && page.lines().count() == 2,
        "{page}"
    );
    let bank = printed(&[
        "bank",
        "--twin",
        "van-der-pol",
        "--size",
        "64",
        "--out",
        "my bank",
    ]);
    assert!(bank.contains("--bank 'my bank' --out EST"), "{bank}");
}
