//! The command line as a user meets it: exit codes, one-line messages, JSON, nothing half-written.

mod diagnose;
mod fit;
mod newcomers;
mod records;
mod reproduce;
mod shell;
mod withheld;

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::OnceLock;

fn truetwin(arguments: &[&str]) -> Output {
    (Command::new(env!("CARGO_BIN_EXE_truetwin"))
        .args(arguments)
        .output())
    .unwrap()
}

/// Exit 2, nothing on standard output, one line on standard error that has these parts.
fn refused(arguments: &[&str], parts: &[&str]) {
    let output = truetwin(arguments);
    let message = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(2), "{arguments:?}: {message}");
    assert!(output.stdout.is_empty(), "{arguments:?}");
    assert_eq!(message.trim_end().lines().count(), 1, "{message}");
    for part in parts {
        assert!(
            message.contains(part),
            "{arguments:?}: \"{part}\" is not in: {message}"
        );
    }
}

fn done(arguments: &[&str]) -> String {
    let output = truetwin(arguments);
    let message = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(0), "{arguments:?}: {message}");
    String::from_utf8(output.stdout).unwrap()
}

fn json(arguments: &[&str]) -> serde_json::Value {
    serde_json::from_str(&done(arguments)).unwrap()
}

/// A folder with a small oscillator estimator and a record, made once.
fn workplace() -> &'static Path {
    static PLACE: OnceLock<PathBuf> = OnceLock::new();
    PLACE.get_or_init(|| {
        let place =
            Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("cli-{}", std::process::id()));
        fs::create_dir_all(&place).unwrap();
        let at = |name: &str| place.join(name).display().to_string();
        done(&[
            "pretrain",
            "--twin",
            "van-der-pol",
            "--bank-size",
            "500",
            "--epochs",
            "10",
            "--out",
            &at("v.est"),
        ]);
        done(&[
            "simulate",
            "--twin",
            "van-der-pol",
            "--theta",
            "nu=3",
            "--out",
            &at("r.csv"),
        ]);
        place
    })
}

fn at(name: &str) -> String {
    workplace().join(name).display().to_string()
}

/// A file in the workplace.
fn file(name: &str, text: &str) -> String {
    fs::write(workplace().join(name), text).unwrap();
    at(name)
}

#[test]
fn twins_effects_and_check_tell_what_there_is() {
    assert!(done(&["twins"]).contains("nu"));
    let twins = json(&["twins", "--json"]);
    let tanks = &twins["twins"][1];
    assert_eq!(tanks["name"], "tanks");
    assert_eq!(
        tanks["parameters"][3]["prior"],
        serde_json::json!([0.8, 1.2])
    );
    assert_eq!(tanks["states"][0]["name"], "h1");
    let effects = json(&["effects", "--twin", "tanks", "--json"]);
    assert!(effects["effects"].as_array().unwrap().len() > 25);
    assert_eq!(
        json(&["check", "--twin", "tanks", "--json"])["passed"],
        true
    );
    assert!(done(&["--help"]).contains("Calibrate simulators"));
    assert!(done(&["estimate", "--help"]).contains("--validation"));
}

#[test]
fn simulations_repeat_whatever_the_threads() {
    let simulate = |seed: &str, threads: &str| {
        done(&[
            "simulate",
            "--twin",
            "tanks",
            "--theta",
            "k1=0.6,k2=0.5,k3=0.55,k4=1",
            "--seed",
            seed,
            "--threads",
            threads,
        ])
    };
    assert_eq!(simulate("4", "1"), simulate("4", "2"));
    assert_ne!(simulate("4", "1"), simulate("5", "1"));
    assert_eq!(simulate("4", "1").lines().count(), 401);
}

#[test]
fn studies_that_score_the_same_have_no_winner() {
    let text = |name: &str| {
        format!(
            "[twin]\nname = \"{name}\"\n[parameters]\nk = {{ prior = [0.1, 1.0] }}\n[states]\nx = {{ rate = \"-k*x\", start = 1.0 }}\n\
             [outputs]\ny = {{ value = \"x\", noise = 0.01 }}\n[record]\nstep = 0.5\nsamples = 30\n"
        )
    };
    let (a, b) = (
        file("tie-a.toml", &text("a")),
        file("tie-b.toml", &text("b")),
    );
    let slow = text("slow").replace("-k*x", "-0.01*k*x");
    let (slow, record) = (file("tie-slow.toml", &slow), at("tie.csv"));
    done(&[
        "simulate", "--study", &a, "--theta", "k=0.5", "--out", &record,
    ]);
    let compared =
        |studies: [&str; 2]| done(&["compare", studies[0], studies[1], "--validation", &record]);
    let tied = compared([&a, &b]);
    assert!(
        tied.starts_with("tie-a and tie-b predict equally well:"),
        "{tied}"
    );
    let won = compared([&slow, &a]);
    assert!(won.starts_with("tie-a predicts best:"), "{won}");
}

#[test]
fn an_input_file_and_an_effect_shape_the_record() {
    let input = file("u.csv", "t,u\n0,1\n0.5,1\n1,2\n1.5,0\n");
    let effect = file(
        "e.toml",
        "[[effect]]\nid = 'sensor-bias'\ntarget = 'sensor'\nmagnitudes = { offset = 0.5 }\n",
    );
    let common = [
        "simulate",
        "--twin",
        "tanks",
        "--theta",
        "k1=0.6,k2=0.5,k3=0.55,k4=1",
        "--noise-free",
        "--input",
        &input,
    ];
    let plain = done(&common);
    let biased = done(&[&common[..], &["--effect", &effect]].concat());
    assert!(plain.starts_with("t,u,y\n0,1,0\n"), "{plain}");
    assert!(biased.starts_with("t,u,y\n0,1,0.5\n"), "{biased}");
}

#[test]
fn an_estimate_repeats_fits_its_schema_and_writes_its_folder() {
    let (record, estimator, out) = (at("r.csv"), at("v.est"), at("out"));
    let run = |threads: &str| {
        let mut value = json(&[
            "estimate",
            &record,
            "--estimator",
            &estimator,
            "--json",
            "--threads",
            threads,
        ]);
        value["seconds"] = serde_json::Value::Null;
        value
    };
    let value = run("1");
    assert_eq!(value, run("2"));
    assert_eq!(value["gate"]["out_of_distribution"], true);
    let theta = value["theta"]["final"][0].as_f64().unwrap();
    assert!((theta - 3.0).abs() < 0.06, "{theta}");
    let text = done(&[
        "estimate",
        &record,
        "--estimator",
        &estimator,
        "--validation",
        &record,
        "--out",
        &out,
    ]);
    assert!(text.contains("nu"), "{text}");
    let mut names: Vec<_> = fs::read_dir(&out)
        .unwrap()
        .map(|e| e.unwrap().file_name())
        .collect();
    names.sort();
    assert_eq!(
        names,
        [
            "cloud.npz",
            "estimate.json",
            "overlay.svg",
            "report.html",
            "trajectories.csv"
        ]
    );
    assert!(
        fs::read_to_string(format!("{out}/overlay.svg"))
            .unwrap()
            .starts_with("<svg")
    );
    let (several, second) = (at("several"), at("second.csv"));
    let theta = ["--theta", "nu=3", "--seed", "9", "--out", &second];
    done(&[&["simulate", "--twin", "van-der-pol"], &theta[..]].concat());
    let two = ["estimate", &record, &second, "--estimator", &estimator];
    let value = json(&[&two[..], &["--json", "--out", &several]].concat());
    assert_eq!(value["schema"], "truetwin.estimates/1");
    assert_eq!(value["records"].as_array().unwrap().len(), 2);
    assert!(value["std_error"][0].as_f64() < value["records"][0]["std_error"][0].as_f64());
    assert!(fs::exists(format!("{several}/report-2.html")).unwrap());
    let text = done(&two);
    assert!(text.contains("The records agree"), "{text}");
    refused(
        &[&two[..], &["--draws", "10", "--out", &at("drawn")]].concat(),
        &["truetwin fit"],
    );
    refused(
        &[
            "estimate",
            &record,
            "--estimator",
            &estimator,
            "--out",
            &out,
        ],
        &["exists already"],
    );
}

#[test]
fn wrong_records_are_named_by_file_row_column_value_and_remedy() {
    let estimator = at("v.est");
    let estimate = |record: &str, parts: &[&str]| {
        refused(&["estimate", record, "--estimator", &estimator], parts);
    };
    let rows = |change: &dyn Fn(usize) -> String| {
        (0..300).fold("t,y\n".to_owned(), |text, k| text + &change(k) + "\n")
    };
    let row = |k: usize| format!("{},{}", k as f64 / 20.0, (k as f64).sin());
    let with = |cell: &str| {
        let text = rows(&|k| match k == 40 {
            true => format!("2,{cell}"),
            false => row(k),
        });
        file("cell.csv", &text)
    };
    estimate(&with("broken"), &["cell.csv, row 42, column y", "correct"]);
    for missing in ["NaN", ""] {
        estimate(
            &with(missing),
            &["cell.csv: row 42, column y is missing", "truetwin diagnose"],
        );
    }
    estimate(
        &file("extra.csv", "t,y,temperature\n0,1,2\n1,1,2\n"),
        &["extra.csv", "\"temperature\"", "remove"],
    );
    estimate(
        &file("missing.csv", "t\n0\n1\n"),
        &["missing.csv", "no output column"],
    );
    let jump = |k: usize| if k < 50 { row(k) } else { row(k + 1) };
    estimate(
        &file("jump.csv", &rows(&jump)),
        &[
            "jump.csv: row 52, column t: a step of 0.1 s in place of 0.05 s",
            "resample",
        ],
    );
    let back = |k: usize| if k == 9 { "0.1,1".into() } else { row(k) };
    estimate(
        &file("back.csv", &rows(&back)),
        &["back.csv, row 11, column t", "increase"],
    );
    estimate(
        &file("short.csv", "t,y\n0,1\n0.05,2\n0.1,1\n"),
        &["short.csv", "3 samples", "need"],
    );
    let flat = |k: usize| format!("{},1.5", k as f64 / 20.0);
    estimate(
        &file("flat.csv", &rows(&flat)),
        &["flat.csv", "y is constant (1.5)", "check the sensor"],
    );
    let slow = |k: usize| format!("{k},{}", (k as f64).sin());
    estimate(
        &file("slow.csv", &rows(&slow)),
        &["slow.csv", "step is 1 s", "0.05 s", "pretrain again"],
    );
    estimate(
        &file("driven.csv", "t,u,y\n0,1,1\n0.05,1,2\n"),
        &["driven.csv", "1 input, the twin has 0"],
    );
    estimate(&at("nowhere.csv"), &["nowhere.csv", "No such file"]);
    estimate(&file("binary.csv", "\u{0}\u{1}PNG"), &["binary.csv"]);
}

#[test]
fn wrong_calls_are_refused_with_the_remedy() {
    let new = at("never.est");
    let theta = "k1=0.6,k2=0.5,k3=0.55,k4=1";
    refused(
        &["simulate", "--twin", "tank", "--theta", "a=1"],
        &["\"tank\"", "van-der-pol, tanks"],
    );
    refused(
        &["simulate", "--twin", "tanks", "--theta", "k1=0.6"],
        &["no value for k2; give k2, k3, k4"],
    );
    refused(
        &["simulate", "--twin", "tanks", "--theta", "k9=0.6"],
        &["--theta"],
    );
    refused(
        &[
            "simulate",
            "--twin",
            "tanks",
            "--theta",
            &theta.replace("0.6", "9"),
        ],
        &["k1 = 9", "[0.1, 1.5]"],
    );
    refused(
        &["simulate", "--twin", "tanks", "--theta", "k1"],
        &["\"k1\" is not name=value"],
    );
    refused(&["pretrain", "--twin", "tanks"], &["--out"]);
    refused(
        &[
            "pretrain",
            "--twin",
            "tanks",
            "--out",
            &at("no/such/folder.est"),
        ],
        &["does not exist"],
    );
    refused(
        &[
            "pretrain",
            "--twin",
            "tanks",
            "--out",
            &new,
            "--bank-size",
            "3",
        ],
        &["bank size = 3", "100"],
    );
    refused(
        &[
            "pretrain",
            "--twin",
            "tanks",
            "--out",
            &new,
            "--threads",
            "0",
        ],
        &["--threads 0"],
    );
    let mut call = Command::new(env!("CARGO_BIN_EXE_truetwin"));
    let call = call.args(["effects", "--twin", "tanks"]);
    let output = call.env("RAYON_NUM_THREADS", "100000").output().unwrap();
    assert_eq!(output.status.code(), Some(2));
    let message = String::from_utf8(output.stderr).unwrap();
    assert!(message.starts_with("error: RAYON_NUM_THREADS=100000: choose between 1 and 1024"));
    refused(
        &["estimate", &at("r.csv"), "--estimator", &at("r.csv")],
        &["r.csv", "truetwin pretrain"],
    );
    refused(
        &["estimate", &at("r.csv"), "--estimator", &at("none.est")],
        &["none.est"],
    );
    refused(&["conjure"], &["conjure", "--help"]);
    refused(
        &[
            "simulate",
            "--twin",
            "tanks",
            "--theta",
            theta,
            "--threads",
            "1000000",
        ],
        &["1024"],
    );
    refused(
        &[
            "pretrain",
            "--twin",
            "tanks",
            "--out",
            &new,
            "--bank-size",
            "99999999999",
        ],
        &["truetwin bank"],
    );
    refused(
        &["reproduce", "--twin", "tanks", "--runs", "0"],
        &["at least 1"],
    );
    refused(
        &["reproduce", "--twin", "tanks", "--estimator", &at("v.est")],
        &["made for twin van-der-pol"],
    );
    refused(&[], &["no verb", "--help"]);
    assert!(
        !Path::new(&new).exists(),
        "a refused call leaves nothing behind"
    );
}

#[test]
fn wrong_studies_are_refused_with_file_and_line() {
    let check = |text: &str, parts: &[&str]| {
        refused(
            &["check", "--study", &file("s.toml", text)],
            &[&["s.toml"], parts].concat(),
        );
    };
    check(
        "twin = 'tanks'\n[prior]\nk1 = [0.8, 0.4]\n",
        &["line 3", "k1: invalid interval [0.8, 0.4]"],
    );
    check(
        "twin = 'tanks'\n[prior]\nk7 = [0.4, 0.8]\n",
        &["prior names k7", "k1, k2, k3, k4", "[prior]"],
    );
    check("twin = 'tanks'\nsamples = 3\n", &["line 2", "unknown key"]);
    for (key, parts) in [
        ("substeps = 0", ["substeps = 0", "between 1 and 1000"]),
        ("tolerance = 1e-5", ["tolerance", "steps of one length"]),
        ("substeps = 1001", ["substeps = 1001", "between 1 and 1000"]),
        ("substeps = 1e9", ["line 3", "floating point"]),
        (
            "hold = 'cubic'",
            ["line 3", "`zero`, `linear`, `spline`, `nearest`"],
        ),
    ] {
        check(&format!("twin = 'tanks'\n[record]\n{key}\n"), &parts);
    }
    check(
        "twin = 'tanks'\n[fixed]\nk4 = 9\n",
        &["k4 = 9", "[0.5, 1.5]"],
    );
    check("twin = 'tanks'\n[start]\nh1 = 11\n", &["h1 = 11", "limits"]);
    check(
        "twin = 'tanks'\n[noise]\ny = -1\n",
        &["y = -1", "0 or more"],
    );
    check(
        "twin = 'van-der-pol'\n[start]\nx1 = 'estimate'\n",
        &["line 3", "start.x1", "[prior]"],
    );
    check(
        "twin = 'van-der-pol'\n[noise]\n\ny = 'estimate'\n",
        &["line 4", "noise.y", "[prior]"],
    );
    check("\ntwin = 'reactor'\n", &["line 2", "\"reactor\"", "tanks"]);
    check(
        "twin = 'tanks'\n[record]\n\ninput = 'none.csv'\n",
        &["line 4", "none.csv"],
    );
    check(
        "twin = 'tanks'\n[record.input]\n\nu = 'none.csv'\n",
        &["line 4", "none.csv"],
    );
    check(
        "twin = 'tanks'\n[features]\nkind = 'arma'\n",
        &["line 3", "arma"],
    );
    check(
        "twin = 'tanks'\n[[effect]]\nid = 'sensor-lag'\ntarget = 'h1'\n",
        &["sensor-lag", "\"h1\"", "sensor"],
    );
    check(
        "twin = 'tanks'\n[record]\nsamples = 100000000000\n",
        &["samples = 1e11"],
    );
    check("twin = 'tanks'\n[record]\nstep = 0\n", &["step = 0 s"]);
    check(
        "twin = 'tanks'\n[record]\ninput = { levels = [3, 0], hold = 2 }\n",
        &["levels = [low, high]"],
    );
    check(
        "twin = 'tanks'\n[noise]\ny = 'foo'\n",
        &["line 3", "or \"estimate\""],
    );
    check(
        "twin = 'tanks'\n[prior]\nk1 = [0.5, 9]\n",
        &["k1", "bounds [0.1, 1.5]"],
    );
    check(
        "twin = 'tanks'\n[prior]\nk4 = [0.9, 1]\n[fixed]\nk4 = 1\n",
        &["k4 appears in both fixed and prior", "[fixed] and [prior]"],
    );
    check(
        "twin = 'tanks'\n[library]\nonly = ['magic']\n",
        &["magic", "effects"],
    );
    check(
        "twin = 'van-der-pol'\n[record]\ninput = { levels = [0, 3], hold = 2 }\n",
        &["the twin has none; remove"],
    );
    let deaf = file(
        "deaf.toml",
        "twin = 'tanks'\n[features]\nkind = 'arx'\noutputs = 300\ninputs = 300\n",
    );
    assert_eq!(
        truetwin(&["check", "--study", &deaf]).status.code(),
        Some(1),
        "features are checked"
    );
    let high = file(
        "high.toml",
        "twin = 'tanks'\n[features]\nkind = 'arx'\noutputs = 300\ninputs = 300\n",
    );
    refused(
        &["pretrain", "--study", &high, "--out", &at("h.est")],
        &["600", "128"],
    );
    let short = file(
        "short.toml",
        "twin = 'tanks'\n[record]\nsamples = 30\n[features]\nkind = 'arx'\noutputs = 20\ninputs = 20\n",
    );
    refused(
        &["pretrain", "--study", &short, "--out", &at("h.est")],
        &["30 samples", "features that need fewer"],
    );
}

/// Step and length come from an input file; a record with another step is refused, also by the estimator.
#[test]
fn a_study_with_an_input_file_has_its_step() {
    let rows: String = (0..60).map(|k| format!("{k},{}\n", k / 10 % 3)).collect();
    file("grid.csv", &format!("t,u\n{rows}"));
    let study = file(
        "grid.toml",
        "twin = 'tanks'\n[record]\ninput = 'grid.csv'\n",
    );
    let estimator = at("grid.est");
    done(&[
        "pretrain",
        "--study",
        &study,
        "--out",
        &estimator,
        "--bank-size",
        "200",
        "--epochs",
        "2",
    ]);
    let theta = "k1=0.6,k2=0.5,k3=0.55,k4=1";
    done(&[
        "simulate",
        "--twin",
        "tanks",
        "--theta",
        theta,
        "--out",
        &at("half.csv"),
    ]);
    refused(
        &["estimate", &at("half.csv"), "--estimator", &estimator],
        &["step is 0.5 s, the study's 1 s"],
    );
    let other = file(
        "other.toml",
        "twin = 'tanks'\n[record]\nstep = 2\ninput = 'grid.csv'\n",
    );
    refused(
        &["check", "--study", &other],
        &["line 3", "step = 2 contradicts", "60 samples, step 1 s"],
    );
}

/// Levels, a constant and a file, each for its input, in all verbs that simulate records; the estimator keeps the plan.
#[test]
fn each_input_of_a_study_may_have_its_plan() {
    let rows: String = (0..60).map(|k| format!("{k},{}\n", k / 10 % 3)).collect();
    file("wind.csv", &format!("t,wind\n{rows}"));
    let twin = "[twin]\nname = 'three'\n[parameters]\nk = { prior = [0.2, 0.6], bounds = [0.1, 1.0] }\n\
        [states]\nx = { rate = 'hold + 0.1*sun + wind - k*x', start = 0.0, noise = 0.01 }\n\
        [inputs]\nhold = {}\nsun = {}\nwind = {}\n[outputs]\ny = { value = 'x', noise = 0.05 }\n";
    let input = "hold = { levels = [0, 2], hold = 6 }\nsun = 20\nwind = 'wind.csv'\n";
    let good = file("each.toml", &format!("{twin}[record.input]\n{input}"));
    let (record, estimator) = (at("each.csv"), at("each.est"));
    done(&["check", "--study", &good]);
    done(&[
        "simulate", "--study", &good, "--theta", "k=0.4", "--out", &record,
    ]);
    let text = std::fs::read_to_string(&record).unwrap();
    let cells: Vec<Vec<f64>> = (text.lines().skip(1))
        .map(|line| line.split(',').map(|cell| cell.parse().unwrap()).collect())
        .collect();
    assert!(cells.len() == 60 && text.starts_with("t,u1,u2,u3,y\n"));
    for (k, row) in cells.iter().enumerate() {
        assert!((0.0..2.0).contains(&row[1]) && row[1] == cells[k / 6 * 6][1]);
        assert_eq!((row[2], row[3]), (20.0, (k / 10 % 3) as f64));
    }
    let sizes = ["--bank-size", "200", "--epochs", "2"];
    done(
        &[
            &["pretrain", "--study", &good, "--out", &estimator],
            &sizes[..],
        ]
        .concat(),
    );
    done(&["estimate", &record, "--estimator", &estimator]);
    done(&[
        "bank",
        "--study",
        &good,
        "--size",
        "20",
        "--out",
        &at("each.bank"),
    ]);
    for (input, parts) in [
        (
            "hold = 1\nsun = 2\n",
            ["wind has no plan", "each of hold, sun, wind"],
        ),
        (
            "hold = 1\nsun = 2\nwinds = 3\n",
            ["no input \"winds\"", "did you mean \"wind\""],
        ),
        (
            "hold = 1\nsun = 2\nwind = 'no.csv'\n",
            ["no.csv", "No such file"],
        ),
        (
            "hold = 1\nsun = [0, 1]\nwind = 3\n",
            ["wrong.toml, line 1", "sun is a list; write { levels"],
        ),
    ] {
        let text = format!("{twin}[record]\nstep = 1\nsamples = 60\n[record.input]\n{input}");
        let wrong = file("wrong.toml", &text);
        refused(&["check", "--study", &wrong], &parts);
    }
}

/// The twin's own noise level is taken at the study's step.
#[test]
fn an_estimated_noise_level_may_be_the_twins_own() {
    let study = file(
        "level.toml",
        "twin = 'van-der-pol'\n[noise]\nx2 = 'estimate'\n",
    );
    done(&[
        "simulate",
        "--study",
        &study,
        "--theta",
        "nu=1,noise.x2=0.00707",
    ]);
}

#[test]
fn a_study_file_sets_step_prior_noise_limits_and_unknown_start() {
    let study = file(
        "own.toml",
        "twin = 'tanks'\n[record]\nstep = 2\nsamples = 200\ninput = { levels = [0, 3], hold = 20 }\n\
         [prior]\nk1 = [0.2, 0.3]\n[fixed]\nk4 = 1.0\n[limits]\nh1 = [0, 5]\n[noise]\nh1 = 0\ny = 'estimate'\n\
         [start]\nh2 = 'estimate'\n[features]\nkind = 'deviation'\nblocks = 20\n",
    );
    let (estimator, record) = (at("own.est"), at("own.csv"));
    done(&[
        "pretrain",
        "--study",
        &study,
        "--out",
        &estimator,
        "--bank-size",
        "300",
        "--epochs",
        "3",
    ]);
    done(&[
        "simulate",
        "--study",
        &study,
        "--theta",
        "k1=0.25,k2=0.6,k3=0.6,start.h2=4,noise.y=0.2",
        "--out",
        &record,
    ]);
    let value = json(&["estimate", &record, "--estimator", &estimator, "--json"]);
    assert_eq!(value["names"], serde_json::json!(["k1", "k2", "k3"]));
    let roles: Vec<_> = (value["nuisance"].as_array().unwrap().iter())
        .map(|n| (n["name"].as_str().unwrap(), n["role"].as_str().unwrap()))
        .collect();
    assert_eq!(roles, [("y", "noise"), ("h2", "start")]);
}
