//! Records as data loggers write them: other names, separators, encodings, time stamps, steps.

use super::{done, json, refused, truetwin};
use sha2::{Digest, Sha256};
use std::fs;
use tempfile::TempDir;

struct Place(TempDir);

impl Place {
    /// A folder with a record of the tanks.
    fn new() -> Self {
        let place = Self(tempfile::tempdir().unwrap());
        let theta = "k1=0.6,k2=0.5,k3=0.55,k4=1";
        let out = place.at("r.csv");
        done(&[
            "simulate", "--twin", "tanks", "--theta", theta, "--out", &out,
        ]);
        place
    }

    fn at(&self, name: &str) -> String {
        self.0.path().join(name).display().to_string()
    }

    fn write(&self, name: &str, bytes: impl AsRef<[u8]>) -> String {
        fs::write(self.0.path().join(name), bytes).unwrap();
        self.at(name)
    }

    /// Rows of the record, the header left out.
    fn rows(&self) -> Vec<Vec<String>> {
        let text = fs::read_to_string(self.at("r.csv")).unwrap();
        let rows = text.lines().skip(1);
        rows.map(|row| row.split(',').map(str::to_owned).collect())
            .collect()
    }
}

const COLUMNS: [&str; 2] = ["--columns", "t=time (s),u=pump,y=level"];

#[test]
fn the_same_record_is_read_from_any_dialect() {
    let place = Place::new();
    let expected = done(&["features", &place.at("r.csv"), "--twin", "tanks"]);
    let with = |separator: &str, header: &[&str], cell: &dyn Fn(&str) -> String| {
        let mut lines = vec![header.join(separator)];
        for row in place.rows() {
            let cells: Vec<String> = row.iter().map(|value| cell(value)).collect();
            let [t, u, y] = &cells[..] else {
                panic!("{row:?}")
            };
            let all = [y, "ok", t, u];
            lines.push(all.join(separator));
        }
        lines.join("\n") + "\n"
    };
    let same = |value: &str| value.to_owned();
    let comma = |value: &str| value.replace('.', ",");
    let header = ["level", "note", "time (s)", "pump"];
    let german = with(";", &header, &comma);
    let utf16: Vec<u8> = "\u{feff}"
        .chars()
        .chain(german.chars())
        .flat_map(|c| {
            let mut units = [0; 2];
            c.encode_utf16(&mut units)
                .iter()
                .flat_map(|u| u.to_le_bytes())
                .collect::<Vec<_>>()
        })
        .collect();
    for (name, bytes) in [
        ("german.csv", german.clone().into_bytes()),
        ("tabs.txt", with("\t", &header, &same).into_bytes()),
        ("mark.csv", [b"\xef\xbb\xbf", german.as_bytes()].concat()),
        ("utf16.csv", utf16),
        ("plain.csv", with(",", &header, &same).into_bytes()),
    ] {
        let file = place.write(name, bytes);
        let call = ["features", &file, "--twin", "tanks"];
        assert_eq!(done(&[&call[..], &COLUMNS].concat()), expected, "{name}");
    }
    // The columns of a study, and those of the call before them.
    let study = "twin = 'tanks'\n[record.columns]\nt = 'time (s)'\nu = 'pump'\ny = 'level'\n";
    let study = place.write("s.toml", study);
    let german = place.at("german.csv");
    assert_eq!(done(&["features", &german, "--study", &study]), expected);
    let note = [
        "features",
        &german,
        "--study",
        &study,
        "--columns",
        "y=note",
    ];
    refused(
        &note,
        &["german.csv: column t is missing", "--columns t=NAME"],
    );
    let note = [&note[..5], &["t=time (s),u=pump,y=note"]].concat();
    refused(&note, &["german.csv, row 2, column note", "\"ok\""]);
}

#[test]
fn time_stamps_are_seconds_from_the_first() {
    let place = Place::new();
    let expected = done(&["features", &place.at("r.csv"), "--twin", "tanks"]);
    let mut text = String::from("time;u;y\n");
    for (k, row) in place.rows().iter().enumerate() {
        // The hour at which clocks go forward, every other row in another zone.
        let (half, seconds) = (k % 2 * 5, k / 2);
        let (hour, zone) = if k % 3 == 0 {
            (1, "+01:00")
        } else {
            (2, "+02:00")
        };
        let (minute, second) = (seconds / 60, seconds % 60);
        text += &format!(
            "2024-03-31T{hour:02}:{minute:02}:{second:02},{half}{zone};{};{}\n",
            row[1], row[2]
        );
    }
    let file = place.write("stamps.csv", text);
    let call = ["features", &file, "--twin", "tanks", "--columns", "t=time"];
    assert_eq!(done(&call), expected);
}

#[test]
fn wrong_columns_are_refused_in_one_line() {
    let place = Place::new();
    let record = place.at("r.csv");
    let call = |columns: &str, parts: &[&str]| {
        refused(
            &["fit", &record, "--twin", "tanks", "--columns", columns],
            parts,
        );
    };
    call(
        "t=time",
        &[
            "r.csv: no column is called \"time\"",
            "the columns are t, u, y",
        ],
    );
    call(
        "t=t,u=t",
        &["r.csv: column \"t\" is to be both", "own column"],
    );
    call("y2=y", &["no channel is called \"y2\""]);
    call(
        "level=y",
        &["no channel is called \"level\"", "there are t, u, y"],
    );
    call("t", &["\"t\" is not name=column"]);
    call("t=t,t=t", &["t is given twice"]);
    let study = place.write("s.toml", "twin = 'tanks'\n[record]\ncolumns = { t = 3 }\n");
    refused(&["fit", &record, "--study", &study], &["s.toml, line 3"]);
}

/// Features need one step and all outputs; the message offers the verb that makes such a record, and `estimate` takes it.
#[test]
fn gaps_and_varying_steps_are_resampled() {
    let place = Place::new();
    let mut rows = place.rows();
    rows.remove(200);
    rows[100][2].clear();
    let lines: Vec<String> = rows.iter().map(|row| row.join(",")).collect();
    let gaps = place.write("gaps.csv", format!("t,u,y\n{}\n", lines.join("\n")));
    let features = |record: &str| {
        [
            "features".into(),
            record.into(),
            "--twin".into(),
            "tanks".into(),
        ]
    };
    let words: [String; 4] = features(&gaps);
    let words: Vec<&str> = words.iter().map(String::as_str).collect();
    refused(
        &words,
        &[
            "row 102, column y",
            "`truetwin resample R.csv --step S --out R2.csv`",
        ],
    );
    let out = place.at("even.csv");
    let text = done(&["resample", &gaps, "--step", "0.5", "--out", &out]);
    for part in [
        "gaps.csv: 399 samples, steps of 0.5 to 1 s, 1 missing output",
        "even.csv: 400 samples, a step of 0.5 s, 0 missing outputs",
        "inputs: mean over each step",
        "outputs: 2 interpolated, over at most 2 s between measured ones",
    ] {
        assert!(text.contains(part), "{text}");
    }
    let estimator = place.at("small.est");
    let train = ["pretrain", "--twin", "tanks", "--out", &estimator];
    done(&[&train[..], &["--bank-size", "200", "--epochs", "1"]].concat());
    let estimate = ["estimate", "--estimator", &estimator];
    let of_gaps = [&estimate[..], &[&gaps]].concat();
    refused(&of_gaps, &["gaps.csv: row 102, column y is missing"]);
    assert!(done(&[&estimate[..], &[&out]].concat()).contains("k4"));
    let open = place.at("open.csv");
    let call = ["resample", &gaps, "--step", "0.5", "--longest-gap"];
    let text = done(&[&call[..], &["0.9", "--out", &open]].concat());
    let parts = [
        "outputs: 0 interpolated, over at most 0.9 s",
        "2 outputs left empty: in longer gaps (--longest-gap SECONDS closes them)",
    ];
    assert!(parts.iter().all(|part| text.contains(part)), "{text}");
    let none = place.at("none.csv");
    refused(
        &[&call[..], &["-1", "--out", &none]].concat(),
        &["gaps.csv: a longest gap of -1 s; choose a positive number"],
    );
    let parquet = place.at("none.parquet");
    let few = place.write("few.csv", "t,u,y\n0,1,\n1,2,2\n2,1,3\n3,2,4\n4,1,5\n5,2,\n");
    let coarse = ["resample", &few, "--step", "4.5", "--out"];
    let parts = ["few.csv: a step of 4.5 s leaves 0 rows with an output of a record of 5 s"];
    refused(&[&coarse[..], &[&none]].concat(), &parts);
    refused(
        &[&coarse[..], &[&parquet]].concat(),
        &["none.parquet: records are written as CSV"],
    );
    let out = place.at("coarse.csv");
    let call = [
        "resample", &gaps, "--step", "1", "--inputs", "hold", "--out", &out, "--json",
    ];
    let value = json(&call);
    assert_eq!(value["schema"], "truetwin.resample/1");
    assert_eq!(value["after"]["samples"], 200);
    assert_eq!(value["after"]["missing"], 0);
    refused(&call, &["coarse.csv exists already"]);
    let study = place.write("s.toml", "twin = 'tanks'\n[record]\nstep = 1\n");
    done(&["features", &out, "--study", &study]);
    let slow = ["features", &out, "--twin", "tanks"];
    refused(
        &slow,
        &[
            "step is 1 s, the study's 0.5 s",
            "truetwin resample R.csv --step 0.5",
        ],
    );
    let other = place.at("x.csv");
    for (step, part) in [
        ("0", "step = 0 s"),
        ("1e9", "leaves 1 sample"),
        ("1e-9", "longer step"),
    ] {
        refused(
            &["resample", &gaps, "--step", step, "--out", &other],
            &[part],
        );
    }
}

/// Findings about a record end with 0, one line each; only a file that cannot be read ends with 2.
#[test]
fn a_record_is_checked_against_a_twin() {
    let place = Place::new();
    let record = place.at("r.csv");
    let call = ["check", &record, "--twin", "tanks"];
    let text = done(&call);
    let (headline, findings) = text.split_once("result   check        finding\n").unwrap();
    assert!(headline.starts_with("tanks: all"), "{text}");
    assert!(
        findings.lines().all(|line| line.starts_with("pass")) && text.contains("expected errors"),
        "{text}"
    );
    let value = json(&[&call[..], &["--json"]].concat());
    assert_eq!(value["schema"], "truetwin.suitability/1");
    assert_eq!(value["suits"], true);
    assert_eq!(value["parameters"][0]["name"], "k1");
    let rows = place.rows();
    let lines: Vec<String> = (rows.iter())
        .map(|row| {
            format!(
                "{};{};{}",
                1e3 * row[0].parse::<f64>().unwrap(),
                row[1],
                row[2]
            )
        })
        .collect();
    let slow = place.write("ms.csv", format!("ms;u;y\n{}\n", lines.join("\n")));
    let columns = ["check", &slow, "--twin", "tanks", "--columns", "t=ms"];
    let text = done(&columns);
    let first = text
        .lines()
        .find(|line| line.starts_with("warning"))
        .unwrap();
    assert!(
        first.contains("t seems to be in milliseconds; divide it by 1000"),
        "{text}"
    );
    let value = json(&[&columns[..], &["--json"]].concat());
    assert_eq!(value["suits"], false);
    let few = format!("ms;u;y\n{}\n", lines[..20].join("\n"));
    let few = place.write("few.csv", few);
    let fit = json(&[
        "fit",
        &few,
        "--twin",
        "tanks",
        "--columns",
        "t=ms",
        "--json",
    ]);
    let warnings = fit["warnings"].as_array().unwrap();
    let warning = warnings.iter().find(|w| w["code"] == "time-unit").unwrap();
    assert_eq!(
        warning["what"],
        "a step of 500 s, 0.5 s in the study: t seems to be in milliseconds"
    );
    let other = done(&["check", &record, "--twin", "van-der-pol"]);
    assert!(
        other.contains("failure   channels") && other.contains("1 input, the twin has 0"),
        "{other}"
    );
    let one = place.write("one.csv", "t,u,y\n0,1,2\n");
    refused(&["check", &one, "--twin", "tanks"], &["1 row of data"]);
    refused(&["check", &record], &["no twin given"]);
}

/// Steps that are far from the study's are told as another unit of time, but not of time stamps, which have none.
#[test]
fn the_unit_of_time_stamps_is_not_doubted() {
    let place = Place::new();
    let stamped = |row: &Vec<String>| {
        let t = (1e3 * row[0].parse::<f64>().unwrap()).round() as u64;
        let (day, hour, rest) = (1 + t / 86_400, t / 3600 % 24, t % 3600);
        let (minute, second) = (rest / 60, rest % 60);
        format!(
            "2024-01-{day:02}T{hour:02}:{minute:02}:{second:02}Z,{},{}\n",
            row[1], row[2]
        )
    };
    let rows: String = place.rows().iter().take(40).map(stamped).collect();
    let record = place.write("stamped.csv", format!("t,u,y\n{rows}"));
    let text = done(&["check", &record, "--twin", "tanks"]);
    assert!(!text.contains("seems to be in"), "{text}");
}

/// A record keeps the names of its columns, and is what its twin reads; the checksum is that of all bytes, with or without a last end of line.
#[test]
fn a_resampled_record_keeps_its_names() {
    let place = Place::new();
    for (name, header, other) in [
        ("zero.csv", "t,u,y0,y1", "t,u,y1,y0"),
        ("missing.csv", "t,u1,y1,y3", "y3,t,u1,y1"),
        ("plain.csv", "t,u,y", "t,u,y"),
    ] {
        let row = |k: i32| {
            let cells: Vec<String> = (0..header.split(',').count() as i32)
                .map(|j| (10 * j + k).to_string())
                .collect();
            cells.join(",")
        };
        let text = format!("{header}\n{}\n{}\n{}", row(0), row(1), row(2));
        let record = place.write(name, &text);
        let new = place.at(&format!("new-{name}"));
        let told = json(&["resample", &record, "--step", "1", "--out", &new, "--json"]);
        let sum = Sha256::digest(text.as_bytes());
        let sum: String = sum.iter().map(|byte| format!("{byte:02x}")).collect();
        assert_eq!(told["provenance"]["files"][0]["sha256"], sum, "{told}");
        assert_eq!(fs::read_to_string(&new).unwrap(), format!("{text}\n"));
        let turned = place.write(name, text.replacen(header, other, 1));
        if other != header {
            let again = place.at(&format!("turned-{name}"));
            done(&["resample", &turned, "--step", "1", "--out", &again]);
            let first = fs::read_to_string(&again).unwrap();
            assert!(first.starts_with("t,u"), "{first}");
        }
    }
    let twice = place.write("twice.csv", "t,y1,y1\n0,1,1\n1,1,1\n");
    let out = place.at("o.csv");
    let call = ["resample", &twice, "--step", "1", "--out", &out];
    refused(&call, &["\"y1\" appears twice"]);
    let zero = ["resample", &place.at("r.csv"), "--step", "0", "--out", &out];
    refused(&zero, &["--step: ", "0 s"]);
}

/// Lines that hold no sample count: a row of a message is the line of an editor.
#[test]
fn rows_are_counted_as_an_editor_counts_lines() {
    let place = Place::new();
    let mut rows = place.rows();
    rows[100][2] = "1e9".into();
    let rows = rows.iter().map(|row| row.join(","));
    let spaced: String = (rows.enumerate())
        .map(|(k, row)| {
            if k % 10 == 0 {
                format!("\r\n{row}\r\n")
            } else {
                format!("{row}\r\n")
            }
        })
        .collect();
    // An empty line before the header, the header, and eleven empty lines before the sample.
    let line = 1 + 1 + 11 + 101;
    let record = place.write("spaced.csv", format!("\r\nt,u,y\r\n{spaced}"));
    let output = truetwin(&["check", &record, "--twin", "tanks"]);
    let text = String::from_utf8(output.stdout).unwrap();
    let outlying = format!("output y has outlying values in rows {line}:");
    assert!(text.contains(&outlying), "{text}");
    let warning = String::from_utf8(truetwin(&["fit", &record, "--twin", "tanks"]).stderr);
    let expected = format!("spaced.csv, row {line}, column y: 1e9 is an outlier");
    assert!(warning.unwrap().contains(&expected), "{expected}");
}
