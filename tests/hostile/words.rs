//! What is said of odd calls is true: effects, starts, columns, lines and pieces of work are named as they are, and the remedy helps.

use crate::calls::{TRUETWIN, run, told};
use serde_json::Value;
use std::fs;
use std::path::Path;
use std::process::Command;

/// A first-order lag in equations, with one parameter and a known start.
const LAG: &str = "[parameters]\na = { prior = [0.2, 2.0], bounds = [0.05, 5.0] }\n\
    [states]\nx = { rate = \"a*(push - x)\", start = 0.0 }\n[inputs]\npush = {}\n\
    [outputs]\nlevel = { value = \"x\", noise = 0.05 }\n[noise]\nprocess = \"none\"\n\
    [record]\nstep = 0.2\nsamples = 60\ninput = { levels = [0.0, 2.0], hold = 10 }\n";

fn write(at: &Path, name: &str, text: &str) {
    fs::write(at.join(name), text).unwrap();
}

fn done(at: &Path, words: &str) -> String {
    let output = run(at, words);
    assert!(output.status.success(), "{words}: {output:?}");
    String::from_utf8(output.stdout).unwrap()
}

fn refused(at: &Path, words: &str, parts: &[&str]) {
    let output = run(at, words);
    let line = told(&output);
    assert_eq!(output.status.code(), Some(2), "{words}: {line}");
    assert_eq!(line.lines().count(), 1, "{words}: {line}");
    for part in parts {
        assert!(line.contains(part), "{words}: {line}");
    }
}

fn json(at: &Path, words: &str) -> Value {
    serde_json::from_str(&done(at, &format!("{words} --json"))).unwrap()
}

/// A file that adds what the study has already would have the law act twice.
#[test]
fn an_effect_is_given_once() {
    let place = tempfile::tempdir().unwrap();
    let at = place.path();
    let effect = "[[effect]]\nid = \"sensor-bias\"\ntarget = \"sensor\"\n";
    write(at, "lag.toml", LAG);
    write(at, "biased.toml", &format!("{LAG}{effect}"));
    write(
        at,
        "bias.toml",
        &format!("{effect}magnitudes = {{ offset = 20.0 }}\n"),
    );
    let call = "simulate --noise-free --effect bias.toml --theta a=0.7";
    refused(
        at,
        &format!("{call} --study biased.toml"),
        &["bias.toml: the study has sensor-bias@sensor already"],
    );
    refused(
        at,
        &format!("{call},sensor-bias@sensor.offset=3 --study lag.toml"),
        &["the effect file gives sensor-bias@sensor.offset already"],
    );
    let answer = json(at, &format!("{call} --study lag.toml"));
    assert_eq!(answer["y"][0][0], 20.0);
    for key in ["t", "u", "y"] {
        assert_eq!(answer[key].as_array().unwrap().len(), 60, "{key}");
    }
}

/// The end of a range that readings do not show is held at the end of its bounds: draws of all else are drawn beside it, intervals have two sides, and
/// an estimator has a reference.
#[test]
fn what_readings_show_stands_aside() {
    let place = tempfile::tempdir().unwrap();
    let at = place.path();
    let effect = "[[effect]]\nid = \"sensor-saturation\"\ntarget = \"sensor\"\n";
    write(at, "lag.toml", LAG);
    let prior = "[prior]\n\"sensor-saturation@sensor.low\" = [-3, -1]\n\"sensor-saturation@sensor.high\" = [1, 3]\n";
    write(at, "range.toml", &format!("{LAG}{effect}{prior}"));
    write(
        at,
        "range-at.toml",
        &format!("{effect}magnitudes = {{ low = -9.0, high = 1.2 }}\n"),
    );
    done(
        at,
        "simulate --study lag.toml --theta a=0.7 --effect range-at.toml --out r.csv",
    );
    let fit = json(at, "fit r.csv --study range.toml --draws 50 --out f");
    assert_eq!(fit["posterior"]["draws"], 50);
    let table = fs::read_to_string(at.join("f/posterior.csv")).unwrap();
    assert_eq!(table.lines().count(), 51);
    let columns: Vec<&str> = table.lines().next().unwrap().split(',').collect();
    assert!(
        columns.contains(&"sensor-saturation@sensor.high")
            && !columns.contains(&"sensor-saturation@sensor.low"),
        "{columns:?}"
    );
    let found = json(at, "diagnose r.csv --study range.toml --quick");
    for all in [&fit, &found] {
        let a = &all["parameters"][0];
        let [low, high] = [0, 1].map(|end| a["interval"][end].as_f64().unwrap());
        let value = a.get("value").unwrap_or(&a["alone"]).as_f64().unwrap();
        assert!(
            low > 0.6 && low < value - 0.02 && high > value + 0.02,
            "{a}"
        );
    }
    done(
        at,
        "pretrain --study range.toml --bank-size 200 --epochs 2 --out r.est",
    );
    let estimate = json(at, "estimate r.csv --estimator r.est");
    let a = estimate["theta"]["final"][0].as_f64().unwrap();
    assert!((0.6..0.85).contains(&a), "{estimate}");
    assert!(estimate["nuisance"][0]["high"].is_number(), "{estimate}");
}

/// A declared start that the record contradicts stands, and is named; a state that no output shows is not to blame.
#[test]
fn a_start_that_stands_is_told() {
    let place = tempfile::tempdir().unwrap();
    let at = place.path();
    done(
        at,
        "simulate --twin van-der-pol --theta nu=1.7 --seed 4 --out v.csv",
    );
    write(at, "v.toml", "twin = \"van-der-pol\"\n[start]\nx1 = -1.0\n");
    let fit = json(at, "fit v.csv --study v.toml");
    let warnings = fit["warnings"].as_array().unwrap();
    let start = warnings.iter().find(|w| w["code"] == "start-elsewhere");
    let what = start.unwrap()["what"].as_str().unwrap();
    assert!(
        what.contains("that of x1 is declared, and stands"),
        "{what}"
    );
    assert_eq!(fit["starts"][1]["value"], 0.0, "{}", fit["starts"]);
}

/// A start that nobody declares is found wherever the record begins: here four thousand times the motion that the input causes.
#[test]
fn a_start_is_found_however_far() {
    let place = tempfile::tempdir().unwrap();
    let at = place.path();
    let far = LAG.replace("start = 0.0", "start = 5000.0");
    write(at, "far.toml", &far);
    write(at, "open.toml", &LAG.replace(", start = 0.0", ""));
    done(at, "simulate --study far.toml --theta a=0.7 --out far.csv");
    let [declared, found] = ["far", "open"].map(|name| {
        let fit = json(at, &format!("fit far.csv --study {name}.toml"));
        fit["evidence"]["log_evidence"].as_f64().unwrap()
    });
    assert!(found > declared - 20.0, "{declared} {found}");
}

/// The noise of the van der Pol oscillator is one of its step, as its text then says.
#[test]
fn an_exported_twin_has_the_noise_of_its_step() {
    let place = tempfile::tempdir().unwrap();
    let at = place.path();
    let study = "twin = \"van-der-pol\"\n[record]\nstep = 0.1\nsamples = 50\n";
    write(at, "v.toml", study);
    write(at, "text.toml", &done(at, "export --study v.toml"));
    let [own, text] = ["v", "text"].map(|name| {
        let call = format!("simulate --study {name}.toml --theta nu=1.7");
        json(at, &call)["y"].clone()
    });
    assert_eq!(own, text);
}

/// A parameter of a usual name has a column and a prior of its own.
#[test]
fn parameters_may_have_any_name() {
    let place = tempfile::tempdir().unwrap();
    let at = place.path();
    for name in ["mode", "trust"] {
        let text = LAG
            .replace("a = {", &format!("{name} = {{"))
            .replace("a*(", &format!("{name}*("));
        write(
            at,
            "m.toml",
            &format!("{text}[prior]\n{name} = [0.3, 1.5]\n"),
        );
        let call = format!("simulate --study m.toml --theta {name}=0.7 --out {name}.csv");
        done(at, &call);
        let call = format!("fit {name}.csv --study m.toml --draws 5 --out f-{name}");
        done(at, &call);
        let table = fs::read_to_string(at.join(format!("f-{name}/posterior.csv"))).unwrap();
        let mut columns: Vec<&str> = table.lines().next().unwrap().split(',').collect();
        columns.sort_unstable();
        let all = columns.len();
        columns.dedup();
        assert_eq!(columns.len(), all, "{columns:?}");
    }
}

/// What a study's columns are called is what is written, and what messages say.
#[test]
fn columns_have_the_names_of_the_file() {
    let place = tempfile::tempdir().unwrap();
    let at = place.path();
    write(at, "lag.toml", LAG);
    let columns = "[record.columns]\nt = \"time\"\npush = \"pump, V\"\nlevel = 'h \"in\"'\n";
    write(at, "log.toml", &format!("{LAG}{columns}"));
    done(at, "simulate --study log.toml --theta a=0.7 --out log.csv");
    let header = fs::read_to_string(at.join("log.csv")).unwrap();
    assert_eq!(
        header.lines().next().unwrap(),
        r#"time,"pump, V","h ""in""""#
    );
    done(at, "fit log.csv --study log.toml");
    let mut named = Command::new(TRUETWIN);
    let columns = r#"t=time,push="pump, V",level="h ""in""""#;
    named.args([
        "fit",
        "log.csv",
        "--study",
        "lag.toml",
        "--columns",
        columns,
    ]);
    assert!(named.current_dir(at).status().unwrap().success());
    write(
        at,
        "same.csv",
        "t,push,level\n0,1,0\n0.1,1,0.1\n0.1,0,0.2\n0.3,0,0.3\n0.4,0,0.3\n",
    );
    refused(
        at,
        "fit same.csv --study lag.toml",
        &["same.csv, row 4, column push: input 1 is 0"],
    );
    refused(
        at,
        "simulate --study lag.toml --theta a=0.7 --input same.csv",
        &["same.csv: level: an input file"],
    );
    for columns in [
        "push = \"y\"",
        "t = \"time\"\npush = \"time\"",
        "push = \" \"",
    ] {
        write(
            at,
            "two.toml",
            &format!("{LAG}[record.columns]\n{columns}\n"),
        );
        let call = "simulate --study two.toml --theta a=0.7";
        refused(at, call, &["two.toml", "a column of its own"]);
    }
    let two = LAG.replace("push = {}", "push = {}\nheat = {}");
    write(at, "two.toml", &two);
    write(at, "one.csv", "t,u2,y\n0,1,1\n1,1,2\n2,1,2\n");
    refused(
        at,
        "fit one.csv --study two.toml",
        &["the record has 1 input (u2), the twin has 2 (u1,u2)"],
    );
    let times = (0..30).map(|k| f64::from(k) - if k > 5 { 0.5 } else { 0.0 });
    let rows = times.map(|t| format!("{t},1,0.5\n"));
    write(at, "v.csv", &format!("t,u,y\n{}", rows.collect::<String>()));
    refused(
        at,
        "features v.csv --study lag.toml",
        &["column t: a step of 1 s in place of 0.2 s"],
    );
    write(at, "p.PARQUET", "PAR1PAR1");
    refused(
        at,
        "fit p.PARQUET --study lag.toml",
        &["no whole Parquet file"],
    );
}

/// Lines and columns are those of an editor, however keys are written and lines end.
#[test]
fn faults_of_a_study_are_where_an_editor_finds_them() {
    let place = tempfile::tempdir().unwrap();
    let at = place.path();
    let deep = ["a"; 90].join(".");
    let returns = LAG.replace("\"a*(push - x)\"", "'''\na*(push\n - QQ)'''");
    for (text, part) in [
        (format!("twin = \"tanks\"\n\n{deep} = 1\n"), "line 3: "),
        (
            "twin = \"tanks\"\n[prior]\n\n\n\"k\\u0031\" = [0.9, 0.8]\n".into(),
            "line 5: k1",
        ),
        (
            "twin = tanks\n".into(),
            "line 1: a text without quotes; write it in quotes",
        ),
        (returns.clone(), "line 6, column 4: unknown name \"QQ\""),
        (
            returns.replace('\n', "\r\n"),
            "line 6, column 4: unknown name \"QQ\"",
        ),
    ] {
        write(at, "s.toml", &text);
        refused(at, "check --study s.toml", &[part]);
    }
}

/// A part of a bank that is gone is made again; a shard of another one is named.
#[test]
fn a_bank_mends_what_is_missing() {
    let place = tempfile::tempdir().unwrap();
    let at = place.path();
    let call = "bank --twin van-der-pol --size 60 --out b";
    done(at, call);
    let shards = || -> Vec<_> {
        let all = fs::read_dir(at.join("b/shards")).unwrap();
        let mut names: Vec<_> = all.map(|entry| entry.unwrap().file_name()).collect();
        names.sort_unstable();
        names
    };
    let whole = shards();
    fs::remove_dir_all(at.join("b/shards")).unwrap();
    refused(at, "merge b --out m.npz", &["shards: is missing"]);
    done(at, call);
    assert_eq!(shards(), whole);
    let [first, second] = [0, 1].map(|at| whole[at].to_str().unwrap());
    let stray = format!("{}{}", &second[..6], &first[6..]);
    fs::copy(
        at.join("b/shards").join(first),
        at.join("b/shards").join(&stray),
    )
    .unwrap();
    refused(at, call, &[&stray, "no shard of this bank; remove it"]);
    fs::remove_file(at.join("b/shards").join(&stray)).unwrap();
    done(at, call);
    done(at, "bank --twin van-der-pol --size 60 --seed 2 --out c");
    refused(
        at,
        "merge b c --out m.npz",
        &["different banks: seed is 1 and 2"],
    );
}

/// A program is simulated with one step; a record with others is named, as is the row of the oddest one.
#[test]
fn a_record_whose_steps_vary_is_named() {
    let place = tempfile::tempdir().unwrap();
    let at = place.path();
    let told = r#"{"name": "lag", "parameters": [{"name": "a", "prior": [0.5, 1.5]}], "inputs": [], "outputs": [{"name": "y"}], "record": {"step": 0.1, "samples": 40}}"#;
    let program =
        format!("import json, sys\nfor line in sys.stdin:\n    print('{told}', flush=True)\n");
    write(at, "p.py", &program);
    let even = (0..8).map(|k| format!("{},{}\n", 0.1 * f64::from(k), k % 3));
    write(
        at,
        "even.csv",
        &format!("t,y\n{}", even.collect::<String>()),
    );
    write(
        at,
        "odd.csv",
        "t,y\n0,0\n0.1,1\n0.2,2\n0.35,1\n0.45,0\n0.55,1\n0.65,2\n0.75,1\n",
    );
    for verb in ["fit", "diagnose"] {
        let mut call = Command::new(TRUETWIN);
        call.args([verb, "even.csv", "odd.csv", "--program", "python3 p.py"]);
        let output = call.current_dir(at).output().unwrap();
        let line = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(2), "{line}");
        let part = "odd.csv: row 5, column t: a step of 0.15 s in place of 0.1 s";
        assert!(line.contains(part), "{line}");
    }
}

/// A start that the twin says stands beside a fitted gain of its sensor, which bends the first row as it does all others.
#[test]
fn a_start_stands_beside_a_fitted_gain() {
    let place = tempfile::tempdir().unwrap();
    let at = place.path();
    let text = "[twin]\nname = \"tank\"\n[parameters]\nk = { prior = [0.2, 1.0] }\nc = { prior = [0.2, 1.0] }\n\
                [states]\nh = { rate = \"k*u - c*h\", start = 2.0 }\n[inputs]\nu = {}\n\
                [outputs]\ny = { value = \"h\", noise = 0.03 }\n[noise]\nprocess = \"none\"\n\
                [record]\nstep = 0.4\nsamples = 150\ninput = { levels = [0.0, 2.0], hold = 12 }\n\
                [[effect]]\nid = \"sensor-gain\"\ntarget = \"sensor\"\n";
    write(at, "free.toml", text);
    write(
        at,
        "held.toml",
        &format!("{text}magnitudes = {{ error = 0.3 }}\n"),
    );
    write(at, "said.toml", &format!("{text}[start]\nh = 2.0\n"));
    done(
        at,
        "simulate --study held.toml --theta k=0.5,c=0.4 --out r.csv",
    );
    for study in ["free", "said"] {
        let fit = json(at, &format!("fit r.csv --study {study}.toml"));
        let of = |name: &str| {
            let all = fit["parameters"].as_array().unwrap();
            all.iter().find(|p| p["name"] == name).unwrap()["interval"].clone()
        };
        for (name, truth) in [("k", 0.5), ("c", 0.4), ("sensor-gain@sensor.error", 0.3)] {
            let interval = of(name);
            let [low, high] = [0, 1].map(|i| interval[i].as_f64().unwrap());
            assert!(low < truth && truth < high, "{study}: {name} {interval}");
            assert!(high - low < 0.1, "{study}: {name} {interval}");
        }
        let codes = fit["warnings"].as_array().unwrap();
        assert!(
            codes.iter().all(|w| w["code"] != "start-elsewhere"),
            "{codes:?}"
        );
    }
}
