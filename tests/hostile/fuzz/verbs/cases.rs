//! Cases of calls: a study, records of it and the words of a call, nearly right.

use crate::fuzz::mutate;
use rand::Rng;
use rand::seq::SliceRandom;
use rand_chacha::ChaCha8Rng;
use std::fmt::Write;
use std::path::Path;
use truetwin::record::Record;
use truetwin::study::{Study, StudyFile};
use truetwin::twin::Noise;

/// Numbers that people, programs and other units make.
const NUMBERS: [&str; 24] = [
    "0",
    "-1",
    "1",
    "0.5",
    "-0.0",
    "2",
    "3",
    "7",
    "100",
    "1e-3",
    "1e-9",
    "1e-30",
    "1e-160",
    "1e-300",
    "1e9",
    "1e30",
    "1e99",
    "1e101",
    "1e160",
    "1e300",
    "-1e6",
    "nan",
    "inf",
    "123456789.12345",
];

/// Expressions in place of a number or a name.
const EXPRESSIONS: [&str; 16] = [
    "\"t\"",
    "\"1/t\"",
    "\"sqrt(t - 1)\"",
    "\"ln(0)\"",
    "\"exp(exp(t))\"",
    "\"1/0\"",
    "\"0/0\"",
    "\"if(t > 1, 1e200, -1e200)\"",
    "\"sign(sin(1e9*t))\"",
    "\"mod(t, 0)\"",
    "\"abs(t)^-3\"",
    "\"(-1)^0.5\"",
    "\"atan2(0, 0)\"",
    "\"clamp(t, 2, 1)\"",
    "\"min(t)\"",
    "\"1e-320*t\"",
];

/// Tables and keys that a study may have besides.
const TABLES: [&str; 30] = [
    "[noise]\nprocess = \"none\"",
    "[noise]\nprocess = \"fitted\"",
    "[noise]\ny = \"estimate\"",
    "[noise]\ny = { std = 0.1, known = true }",
    "[noise]\ny = { std = 0.1, share = 0.2 }",
    "[noise]\ny = { std = 1e-12, factor = 1.001 }",
    "[start]\nx = \"estimate\"",
    "[start]\nh = { mean = 1, std = 1e3 }",
    "[limits]\nx = [0, 1e-9]",
    "[limits]\nh = [1, 2]",
    "[fixed]\nk = 1",
    "[fixed]\na = 0",
    "[features]\nkind = \"arx\"\noutputs = 3\ninputs = 3",
    "[features]\nkind = \"deviation\"\nblocks = 9",
    "[features]\nkind = \"armax\"\noutputs = 2\ninputs = 1\nnoise = 1",
    "[library]\nonly = [\"sensor-bias\", \"sensor-lag\"]",
    "[library]\nwithout = [\"sensor-bias\"]",
    "[[effect]]\nid = \"sensor-lag\"\ntarget = \"sensor\"\nmagnitudes = { tau = 0.3 }",
    "[[effect]]\nid = \"sensor-saturation\"\ntarget = \"sensor\"\nmagnitudes = { low = 0, high = 1e-9 }",
    "[[effect]]\nid = \"sensor-delay\"\ntarget = \"sensor\"",
    "[[event]]\nwhen = \"t > 1\"\nset = { x = 0 }",
    "[[event]]\nwhen = \"x < 0.1\"\nadd = { x = 0 }",
    "[[event]]\nwhen = \"h < 0.1\"\nset = { h = \"h\" }",
    "[[event]]\nat = [0.1, 0.1, 1.0]\nadd = { x = 1e9 }",
    "[[event]]\nwhen = \"sin(100*t) > 0\"\nadd = { x = 0.01, h = 0.01 }",
    "[prior]\na = [0, 1e-9]",
    "[bounds]\nk = [-1, 1]",
    "[constants]\nzero = 0",
    "[define]\nloop = \"loop + 1\"",
    "[prior]\nstart.x = [0, 1]",
];

/// Keys of the table of records.
const RECORD: [&str; 17] = [
    "substeps = 7",
    "substeps = 0",
    "tolerance = 1e-14",
    "tolerance = 1",
    "integrator = \"stiff\"",
    "integrator = \"euler\"",
    "integrator = \"runge-kutta-4\"",
    "integrator = \"discrete\"",
    "hold = \"linear\"",
    "hold = \"nearest\"",
    "hold = \"spline\"",
    "hold = \"impulse\"",
    "hold = { u = \"impulse\" }",
    "samples = 3",
    "samples = 2",
    "step = 1e-9",
    "step = 1e7",
];

/// Twins as text whose records are short.
const STUDIES: [&str; 8] = [
    "[parameters]\na = { prior = [0.5, 2.0], bounds = [0.1, 5.0] }\n[states]\nx = { rate = \"-a*x + u\", start = 1.0 }\n\
     [inputs]\nu = { unit = \"V\" }\n[outputs]\ny = { value = \"x\", noise = 0.02 }\n\
     [record]\nstep = 0.1\nsamples = 40\ninput = { levels = [-1, 1], hold = 5 }\n",
    "[parameters]\nk = { unit = \"1/s\", prior = [0.2, 1.0] }\n[states]\nh = { unit = \"m\", rate = \"-k*h\", start = 1.0, noise = 0.01, \
     limits = [0, 10] }\n[outputs]\ny = { unit = \"m\", value = \"h\", noise = 0.02 }\n[record]\nstep = 0.1\nsamples = 30\n",
    "[parameters]\ne = { prior = [0.5, 0.95], bounds = [0.1, 1.0] }\n[states]\nh = { rate = \"v\", start = 2.0 }\n\
     v = { rate = \"-9.81\", start = 0.0 }\n[outputs]\ny = { value = \"h\", noise = 0.01 }\n[[event]]\nwhen = \"h < 0\"\n\
     set = { h = 0, v = \"-e*v\" }\n[record]\nstep = 0.05\nsamples = 40\n",
    "[parameters]\nlow = { prior = [16.0, 20.0], bounds = [10.0, 25.0] }\nk = { prior = [0.1, 1.0], bounds = [0.01, 5.0] }\n[states]\n\
     T = { rate = \"-k*(T - 5) + 12*on\", start = 17.0 }\non = { rate = \"0\", start = 1 }\n[outputs]\ny = { value = \"T\", noise = 0.1 }\n\
     [[event]]\nwhen = \"T < low\"\nset = { on = 1 }\n[[event]]\nwhen = \"T > low + 2\"\nset = { on = 0 }\n[noise]\nprocess = \"none\"\n\
     [record]\nstep = 0.1\nsamples = 50\n",
    "[parameters]\nr = { prior = [1.0, 3.0] }\n[states]\nx = { next = \"r*x*(1 - x)\", start = 0.3, noise = 0.001, limits = [0, 1] }\n\
     [outputs]\ny = { value = \"x\", noise = { std = \"0.01 + 0.1*abs(x)\" } }\n[record]\nstep = 1\nsamples = 25\n",
    "[parameters]\nke = { unit = \"1/h\", prior = [0.1, 1.0], bounds = [0.01, 3.0] }\nV = { unit = \"L\", prior = [5, 20], bounds = [1, 50] }\n\
     [states]\nc = { rate = \"-ke*c\", start = 0.0 }\n[inputs]\ndose = { unit = \"mg\", hold = \"impulse\" }\n[outputs]\nconc = { value = \"c/V\", noise = 0.01 }\n\
     [record]\nstep = 0.5\nsamples = 30\ninput = { levels = [0, 10], hold = 8 }\n",
    "[parameters]\na = { prior = [0.5, 2.0], bounds = [0.1, 5.0] }\nb = { prior = [-1, 1], bounds = [-5, 5] }\n[states]\n\
     x = { rate = \"a*(u1 - x)\" }\nz = { rate = \"b*u2 - z\", start = 0 }\n[inputs]\nu2 = {}\nu1 = {}\n[outputs]\n\
     y2 = { value = \"x\", noise = 0.02 }\ny1 = { value = \"x + z\", noise = 0.05 }\n[record]\nstep = 0.2\nsamples = 30\n\
     input = { u1 = { levels = [-1, 1], hold = 5 }, u2 = 0.5 }\n",
    "twin = 'van-der-pol'\n[record]\nstep = 0.05\nsamples = 60\n[prior]\nnu = [0.5, 2.5]\n",
];

/// The files and the words of one call.
pub struct Case {
    pub study: Vec<u8>,
    pub records: [Vec<u8>; 2],
    /// Description of a program, in one line.
    pub description: Vec<u8>,
    pub words: Vec<String>,
}

/// Text and record of each study, without a fault.
pub struct Seeds(Vec<[String; 2]>);

impl Seeds {
    /// Simulates a record of each study in the middle of its prior.
    pub fn new(place: &Path, known: &Study) -> Self {
        Self(
            (STUDIES.iter())
                .map(|text| {
                    let file = StudyFile::parse(text, "s.toml".as_ref()).unwrap();
                    let study = match file.own_equations() {
                        Some(_) => Study::of_file(&file).unwrap(),
                        None => known.configure(&file).unwrap(),
                    };
                    let noise = Noise::new(1, "seed", 0);
                    let drive = study.drive(noise).unwrap();
                    let twin = study.twin();
                    let centre = twin.parameters().centre();
                    let outputs = twin.simulate(&centre, &drive, noise).unwrap();
                    let path = place.join("seed.csv");
                    let _ = std::fs::remove_file(&path);
                    Record::new(drive, outputs).unwrap().write(&path).unwrap();
                    [(*text).to_owned(), std::fs::read_to_string(path).unwrap()]
                })
                .collect(),
        )
    }

    /// The case of a number; the same number gives the same case.
    pub fn case(&self, random: &mut ChaCha8Rng) -> Case {
        let [study, record] = self.0.choose(random).unwrap();
        let other = self.0.choose(random).unwrap();
        let mut text = study.clone();
        for _ in 0..random.gen_range(0..4) {
            text = changed_study(&text, random);
        }
        let mut records = [record.clone(), record.clone()];
        for record in &mut records {
            for _ in 0..random.gen_range(0..3) {
                *record = changed_record(record, random);
            }
        }
        let bytes = |text: &str, other: &str, random: &mut ChaCha8Rng| match random.gen_ratio(1, 12)
        {
            true => mutate::mutated(text.as_bytes(), other.as_bytes(), random),
            false => text.as_bytes().to_vec(),
        };
        let [a, b] = &records;
        Case {
            study: bytes(&text, &other[0], random),
            records: [bytes(a, &other[1], random), bytes(b, a, random)],
            description: described(&text, random),
            words: words(&text, random),
        }
    }
}

/// One change in the text of a study, which mostly stays well-formed.
fn changed_study(text: &str, random: &mut ChaCha8Rng) -> String {
    let mut lines: Vec<String> = text.lines().map(str::to_owned).collect();
    let at = random.gen_range(0..lines.len());
    match random.gen_range(0..10) {
        0..=3 => replace_token(&mut lines[at], random),
        4 => drop(lines.remove(at)),
        5 => {
            let line = lines[at].clone();
            lines.push(line);
        }
        6 | 7 => lines.push((*TABLES.choose(random).unwrap()).to_owned()),
        8 => {
            let table = lines.iter().position(|line| line == "[record]");
            let key = (*RECORD.choose(random).unwrap()).to_owned();
            let name = key.split(' ').next().unwrap().to_owned();
            if let Some(table) = table {
                // A key that is there already is replaced: twice is one refusal alone.
                lines.retain(|line| !line.starts_with(&format!("{name} =")));
                lines.insert((table + 1).min(lines.len()), key);
            }
        }
        _ => {
            let other = random.gen_range(0..lines.len());
            lines.swap(at, other);
        }
    }
    lines.join("\n") + "\n"
}

/// Another number, expression, operator or name in a line.
fn replace_token(line: &mut String, random: &mut ChaCha8Rng) {
    let is_part = |c: char| c.is_ascii_alphanumeric() || c == '.' || c == '_';
    let starts: Vec<usize> = (line.char_indices())
        .filter(|&(k, c)| is_part(c) && !line[..k].ends_with(is_part))
        .map(|(k, _)| k)
        .collect();
    let Some(&begin) = starts.choose(random) else {
        return;
    };
    let end = line[begin..]
        .find(|c| !is_part(c))
        .map_or(line.len(), |k| begin + k);
    let inside = line[..begin].matches('"').count() % 2 == 1;
    let new = match random.gen_range(0..8) {
        0 if !inside => (*EXPRESSIONS.choose(random).unwrap()).to_owned(),
        0 => EXPRESSIONS
            .choose(random)
            .unwrap()
            .trim_matches('"')
            .to_owned(),
        1 => ["x", "h", "u", "t", "y", "a", "k"]
            .choose(random)
            .unwrap()
            .to_string(),
        2 if inside => format!("({}*1e6)", &line[begin..end]),
        _ => (*NUMBERS.choose(random).unwrap()).to_owned(),
    };
    line.replace_range(begin..end, &new);
}

/// One change in the rows of a record.
fn changed_record(text: &str, random: &mut ChaCha8Rng) -> String {
    let mut rows: Vec<Vec<String>> = (text.lines())
        .map(|line| line.split(',').map(str::to_owned).collect())
        .collect();
    if rows.len() < 2 {
        return text.to_owned();
    }
    let row = random.gen_range(1..rows.len());
    let column = random.gen_range(0..rows[0].len());
    let number = || NUMBERS;
    match random.gen_range(0..12) {
        0 | 1 => set(&mut rows, row, column, number().choose(random).unwrap()),
        2 => set(&mut rows, row, column, ""),
        3 => rows.truncate(random.gen_range(1..rows.len()) + 1),
        4 => drop(rows.remove(row)),
        5 => {
            let copy = rows[row].clone();
            rows.insert(row, copy);
        }
        6 => {
            let value = *number().choose(random).unwrap();
            (1..rows.len()).for_each(|row| set(&mut rows, row, column, value));
        }
        7 => (row..rows.len()).for_each(|row| set(&mut rows, row, column, "")),
        8 | 9 => {
            let factor: f64 = number().choose(random).unwrap().parse().unwrap_or(1.0);
            for row in 1..rows.len() {
                let value = rows[row]
                    .get(column)
                    .and_then(|cell| cell.parse::<f64>().ok());
                if let Some(value) = value {
                    set(&mut rows, row, column, &format!("{:e}", value * factor));
                }
            }
        }
        10 => {
            for row in 1..rows.len() {
                let value = rows[row]
                    .get(column)
                    .and_then(|cell| cell.parse::<f64>().ok());
                if let Some(value) = value {
                    let places = value.mul_add(8.0, 0.5).floor() / 8.0;
                    set(&mut rows, row, column, &places.to_string());
                }
            }
        }
        _ => rows.iter_mut().for_each(|row| row.reverse()),
    }
    rows.iter().map(|row| row.join(",") + "\n").collect()
}

fn set(rows: &mut [Vec<String>], row: usize, column: usize, value: &str) {
    if let Some(cell) = rows[row].get_mut(column) {
        *cell = value.to_owned();
    }
}

/// Description of a program with the tables of a study inside, or of a black box.
fn described(study: &str, random: &mut ChaCha8Rng) -> Vec<u8> {
    let table: toml::Table = study.parse().unwrap_or_default();
    let mut description = match serde_json::to_value(&table) {
        Ok(serde_json::Value::Object(map)) if map.contains_key("states") => map,
        _ => {
            let text = r#"{"parameters":[{"name":"a","prior":[0.5,1.5],"bounds":[0.1,4.0]}],"inputs":[{"name":"u"}],
                "outputs":[{"name":"x"}],"record":{"step":0.1,"samples":20,"input":{"levels":[-1,1],"hold":5}}}"#;
            serde_json::from_str(text).unwrap()
        }
    };
    description.insert("name".into(), "p".into());
    let text = serde_json::Value::Object(description).to_string();
    let text = match random.gen_ratio(1, 3) {
        true => mutate::mutated(text.as_bytes(), b"{}", random),
        false => text.into_bytes(),
    };
    // One line, whatever was changed.
    text.into_iter()
        .map(|b| if b == b'\n' { b' ' } else { b })
        .collect()
}

/// The words of a call about `s.toml`, `r.csv` and `r2.csv`.
fn words(study: &str, random: &mut ChaCha8Rng) -> Vec<String> {
    let twin = match random.gen_range(0..12) {
        0 => "--twin van-der-pol",
        1 => "--program ./p.sh",
        2 => "--program ./p.sh --study s.toml",
        _ => "--study s.toml",
    };
    let mut theta = String::from("a=1");
    if random.gen_ratio(3, 4) {
        theta.clear();
        let names = ["a", "k", "e", "low", "r", "ke", "V", "b", "nu", "p"];
        for name in names
            .iter()
            .filter(|name| study.contains(&format!("\n{name} = {{")))
        {
            let value = match random.gen_range(0..6) {
                0 => NUMBERS.choose(random).unwrap(),
                _ => "0.7",
            };
            let _ = write!(theta, "{name}={value},");
        }
    }
    let mut call = match random.gen_range(0..20) {
        0..=2 => format!("check {twin}"),
        3..=5 => format!("check r.csv {twin}"),
        6..=9 => format!("fit r.csv {twin}"),
        10 => format!("fit r.csv r2.csv {twin} --draws 20"),
        11 | 12 => format!("simulate {twin} --theta {theta}"),
        13 => format!("simulate {twin} --theta {theta} --input r.csv --noise-free"),
        14 => format!("features r.csv {twin}"),
        15 => format!("resample r.csv --step {}", NUMBERS.choose(random).unwrap()),
        16 => format!("bank {twin} --size 6"),
        17 => format!("effects {twin}"),
        18 => match random.gen_range(0..6) {
            0 => "compare s.toml s.toml --record r.csv --validation r2.csv".to_owned(),
            1 => format!("export {twin}"),
            2 => format!("pretrain {twin} --bank-size 100 --epochs 1 --out o.est"),
            3 => "estimate r.csv --estimator e.est".to_owned(),
            4 => format!("withheld {twin} --trials 1 --detection-only --out o"),
            _ => format!("reproduce {twin} --runs 1 --bank-size 100 --epochs 1 --out o"),
        },
        _ => format!("diagnose r.csv {twin} --quick"),
    };
    let takes_out = !call.contains(" --out ")
        && !["check", "effects"]
            .iter()
            .any(|verb| call.starts_with(verb));
    let must = ["bank", "resample", "features"]
        .iter()
        .any(|verb| call.starts_with(verb));
    if takes_out && (must || random.gen_ratio(1, 3)) {
        let is_file = ["simulate", "resample", "features"]
            .iter()
            .any(|verb| call.starts_with(verb));
        call += if is_file { " --out o.csv" } else { " --out o" };
    }
    if random.gen_ratio(1, 8) {
        call += " --json";
    }
    call.split_whitespace().map(str::to_owned).collect()
}
