//! Programs that show their equations: as text, or served for blocks of points on binary frames.

use super::command_line::{done, refused};
use super::{file, impatient, place, python, started};
use rayon::prelude::*;
use std::fs;
use truetwin::external::program::ProgramSettings;
use truetwin::likelihood::kalman::{Coordinates, FilterSettings, Kalman, Score};
use truetwin::record::{Drive, Record, Signal};
use truetwin::study::{Study, StudyFile};
use truetwin::twin::{Composed, Noise, Twin};

/// A pendulum as text.
const TEXT: &str = r#"
[twin]
name = "swing"
[parameters]
l = { unit = "m", prior = [0.5, 2.0], bounds = [0.1, 5.0] }
c = { unit = "1/s", prior = [0.1, 1.0], bounds = [0.01, 3.0] }
[states]
q = { unit = "rad", rate = "v", start = 0.3 }
v = { unit = "rad/s", rate = "-9.81/l*sin(q) - c*v + u", start = 0.0, noise = 0.01 }
[inputs]
u = { unit = "1/s2" }
[outputs]
y = { unit = "rad", value = "q", noise = 0.02 }
[record]
step = 0.05
samples = 120
integrator = "INTEGRATOR"
input = { levels = [-2, 2], hold = 10 }
"#;

/// The same as a program without any library; `BEFORE` is run before each exchange, with `count` at hand.
const SERVED: &str = r#"
import json, math, os, sys
from array import array
count = 0
pipe, out = sys.stdin.buffer, sys.stdout.buffer
DESCRIPTION = {"name": "swing", "serves": SERVES, "parameters": [
    {"name": "l", "unit": "m", "prior": [0.5, 2.0], "bounds": [0.1, 5.0]},
    {"name": "c", "unit": "1/s", "prior": [0.1, 1.0], "bounds": [0.01, 3.0]}],
    "states": [{"name": "q", "unit": "rad", "start": 0.3},
               {"name": "v", "unit": "rad/s", "start": 0.0, "noise": 0.01}],
    "inputs": [{"name": "u", "unit": "1/s2"}], "outputs": [{"name": "y", "unit": "rad", "noise": 0.02, "value": "q"}],
    "record": {"step": 0.05, "samples": 120, "integrator": "INTEGRATOR", "input": {"levels": [-2, 2], "hold": 10}}}
if "observe" in DESCRIPTION["serves"]:
    del DESCRIPTION["outputs"][0]["value"]
for line in pipe:
    request = json.loads(line)
    if request["request"] == "describe":
        print(json.dumps(DESCRIPTION), flush=True)
        continue
    count += 1
    n = request["points"]
    table = array("d", pipe.read(request["bytes"]))
    t, u, l, c, q, v = [table[i * n:(i + 1) * n] for i in range(6)]
    if request["request"] == "drift":
        answer = v + array("d", [-9.81 / l[i] * math.sin(q[i]) - c[i] * v[i] + u[i] for i in range(n)])
    else:
        answer = q
    BEFORE
    body = answer.tobytes()
    out.write(json.dumps({"id": request["id"], "bytes": len(body)}).encode() + b"\n" + body)
    out.flush()
"#;

fn served(serves: &str, integrator: &str, before: &str) -> String {
    SERVED
        .replace("SERVES", serves)
        .replace("INTEGRATOR", integrator)
        .replace("BEFORE", before)
}

fn workers() -> ProgramSettings {
    ProgramSettings {
        workers: Some(2),
        ..ProgramSettings::default()
    }
}

fn text(integrator: &str) -> Composed {
    let text = TEXT.replace("INTEGRATOR", integrator);
    let file = StudyFile::parse(&text, "swing.toml".as_ref()).unwrap();
    equations(Study::of_file(&file).unwrap().twin())
}

fn equations(twin: &Twin) -> Composed {
    twin.equations().unwrap().clone()
}

fn record() -> Record {
    let inputs = Signal::from_shape_fn((60, 1), |(k, _)| ((k / 10) % 3) as f64 - 1.0);
    let drive = Drive::new(0.05, inputs).unwrap();
    let twin = Twin::Equations(text("euler"));
    let outputs = twin.simulate(&[1.0, 0.4], &drive, Noise::new(2, "swing", 0));
    Record::new(drive, outputs.unwrap()).unwrap()
}

/// log-likelihood and its gradient, several passes of which go in one exchange.
fn score(twin: Composed) -> (f64, Vec<f64>) {
    let record = record();
    let coordinates = Coordinates::new(&twin.outline().parameters);
    let settings = FilterSettings::default();
    let kalman = Kalman::new(twin, &record, &settings).unwrap();
    let score = Score::forward(&kalman, &[1.1, 0.5], &coordinates).unwrap();
    (
        score.log_likelihood,
        score.gradient.iter().copied().collect(),
    )
}

fn assert_near((a, b): (f64, f64)) {
    assert!((a - b).abs() <= 1e-6 * (1.0 + b.abs()), "{a}, {b}");
}

#[test]
fn a_likelihood_of_served_blocks_is_that_of_the_text() {
    if python().is_none() {
        return;
    }
    for (integrator, serves) in [
        ("euler", "[\"drift\"]"),
        ("euler", "[\"drift\", \"observe\"]"),
        ("adaptive", "[\"drift\"]"),
        ("runge-kutta-4", "[\"observe\", \"drift\"]"),
    ] {
        let program = served(serves, integrator, "pass");
        let twin = started("served.py", &program, workers()).unwrap();
        let study = twin.into_study().unwrap();
        let (own, other) = (score(equations(study.twin())), score(text(integrator)));
        assert_near((own.0, other.0));
        for pair in own.1.into_iter().zip(other.1) {
            assert_near(pair);
        }
    }
}

/// All points of a pass, and all passes of a score that go side by side, are in one exchange.
#[test]
fn exchanges_are_few() {
    if python().is_none() {
        return;
    }
    let log = place().join("exchanges.txt");
    let before = format!(
        "open({:?}, \"w\").write(f\"{{count}} {{n}}\")",
        log.display().to_string()
    );
    let twin = started(
        "few.py",
        &served("[\"drift\"]", "euler", &before),
        workers(),
    );
    let study = twin.unwrap().into_study().unwrap();
    score(equations(study.twin()));
    let seen = fs::read_to_string(log).unwrap();
    let (count, points) = seen.split_once(' ').unwrap();
    // 60 rows; five points for two states; the centre and two neighbours for each parameter.
    assert!(count.parse::<usize>().unwrap() <= 2 * 60, "{seen}");
    assert!(points.parse::<usize>().unwrap() >= 3 * 5, "{seen}");
}

/// Log-likelihoods of a program's equations at many θ: one after the other, then all at once; and the numbers of exchanges of both.
fn passes_of(name: &str, before: &str, lengths: &[f64]) -> [(Vec<Option<f64>>, usize); 2] {
    let log = place().join(format!("{name}.txt"));
    let logged = format!(
        "open({:?}, 'a').write('x'); {before}",
        log.display().to_string()
    );
    let settings = ProgramSettings {
        workers: Some(1),
        ..ProgramSettings::default()
    };
    let program = served("[\"drift\"]", "euler", &logged);
    let twin = started(&format!("{name}.py"), &program, settings).unwrap();
    let twin = equations(twin.into_study().unwrap().twin());
    let record = record();
    let filter = FilterSettings::default();
    let pass = |l: &f64| {
        let kalman = Kalman::new(twin.clone(), &record, &filter).unwrap();
        kalman.log_likelihood(&[*l, 0.5]).ok()
    };
    let exchanges = || fs::metadata(&log).map_or(0, |data| data.len() as usize);
    let alone: Vec<_> = lengths.iter().map(pass).collect();
    let first = exchanges();
    let pool = rayon::ThreadPoolBuilder::new().num_threads(lengths.len());
    let together = (pool.build().unwrap()).install(|| lengths.par_iter().map(pass).collect());
    [(alone, first), (together, exchanges() - first)]
}

fn lengths(count: u32) -> Vec<f64> {
    (0..count).map(|i| 0.8 + 0.02 * f64::from(i)).collect()
}

/// Passes of many threads share exchanges, and none of their bits depends on it; where a point's answer depends on others, none is shared.
#[test]
fn passes_side_by_side_share_exchanges_and_change_no_bit() {
    if python().is_none() {
        return;
    }
    let [alone, together] = passes_of("shared", "pass", &lengths(32));
    assert_eq!(alone.0, together.0);
    assert!(5 * together.1 < alone.1, "{} of {}", together.1, alone.1);
    let odd = "answer = array('d', [a * (1 + 1e-9 * n) for a in answer])";
    let [alone, together] = passes_of("odd", odd, &lengths(4));
    assert_eq!(alone.0, together.0);
    assert!(together.1 >= alone.1, "{} of {}", together.1, alone.1);
}

/// A copy that ends takes no pass along that shared the exchange.
#[test]
fn an_end_in_a_shared_exchange_costs_the_pass_that_it_is_of() {
    if python().is_none() {
        return;
    }
    let [alone, together] = passes_of("long", "max(l) > 0.95 and os._exit(3)", &lengths(9));
    assert_eq!(alone.0, together.0);
    let worked: Vec<bool> = together.0.iter().map(Option::is_some).collect();
    assert_eq!(worked, [vec![true; 8], vec![false]].concat());
}

/// A program that simulates otherwise than its equations say is told where.
#[test]
fn runs_of_a_program_are_compared_with_its_equations() {
    let Some(python) = python() else { return };
    let program = r#"
import json, sys
for line in sys.stdin:
    request = json.loads(line)
    if request["request"] == "describe":
        print(json.dumps({"name": "lag", "serves": ["simulate"], "parameters": {"k": {"unit": "1/s", "prior": [0.4, 0.8]}},
            "states": {"h": {"rate": "u - k*h", "start": 0.5}}, "inputs": {"u": {}}, "outputs": {"y": {"unit": "m", "value": "h"}},
            "record": {"step": 0.1, "samples": 80, "integrator": "euler", "input": {"levels": [0, 1], "hold": 20}}}), flush=True)
        continue
    h, y = 0.5, []
    for u in request["inputs"]["u"]:
        y.append(h)
        h += request["step"] * (u - FACTOR * request["theta"]["k"] * h)
    print(json.dumps({"id": request["id"], "outputs": {"y": y}}), flush=True)
"#;
    for (factor, parts) in [
        ("1.0", &["runs are those of its equations"][..]),
        (
            "1.2",
            &["y differs from 0.1 s on", "simulate answers", "k = 0.6"],
        ),
    ] {
        file("lag.py", &program.replace("FACTOR", factor));
        let said = done(&["check", "--program", &format!("{python} lag.py")]);
        let said = said.split_whitespace().collect::<Vec<_>>().join(" ");
        for part in parts {
            assert!(said.contains(part), "{said}");
        }
    }
}

#[test]
fn a_copy_that_ends_is_replaced_and_changes_nothing() {
    if python().is_none() {
        return;
    }
    let run = |before: &str| {
        let program = served("[\"drift\"]", "euler", before);
        let study = started("ends.py", &program, workers())
            .unwrap()
            .into_study();
        let twin = study.unwrap().twin().clone();
        twin.simulate(&[1.0, 0.4], record().drive(), Noise::new(3, "ends", 0))
    };
    let whole = run("pass").unwrap();
    assert_eq!(run("if count == 20: os._exit(3)").unwrap(), whole);
    let twin = Twin::Equations(text("euler"));
    let own = twin.simulate(&[1.0, 0.4], record().drive(), Noise::new(3, "ends", 0));
    for pair in own.unwrap().iter().zip(&whole) {
        assert_near((*pair.0, *pair.1));
    }
}

#[test]
fn a_wrong_answer_is_one_line_that_names_the_method() {
    if python().is_none() {
        return;
    }
    let long = "import time; time.sleep(9)";
    for (before, parts) in [
        ("answer = answer[:1]", &["2 rows of 1 number are 16;"][..]),
        (
            "answer[1] = math.nan",
            &["answered drift with NaN for v at t = 0 s, q = 0.3, v = 0"],
        ),
        (
            "print(json.dumps({'id': request['id'], 'error': 'no licence'}), flush=True); continue",
            &["says: no licence"],
        ),
        ("sys.exit('gone')", &["ended (exit status: 1)", "gone"]),
        (long, &["gave no answer within 1.5 s"]),
    ] {
        let program = served("[\"drift\"]", "euler", before);
        let study = started("wrong.py", &program, impatient())
            .unwrap()
            .into_study();
        let run = study
            .unwrap()
            .twin()
            .simulate(&[1.0, 0.4], record().drive(), Noise::OFF);
        let message = run.unwrap_err().to_string();
        assert_eq!(message.lines().count(), 1, "{message}");
        for part in parts {
            assert!(message.contains(part), "\"{part}\" is not in: {message}");
        }
    }
}

/// A description as text: the program is asked nothing more.
#[test]
fn a_text_in_a_description_is_a_twin_with_states() {
    let Some(python) = python() else { return };
    let description = r#"{"name": "swing", "parameters": {"l": {"prior": [0.5, 2.0]}, "c": {"prior": [0.1, 1.0]}},
        "states": {"q": {"rate": "v", "start": 0.3}, "v": {"rate": "-9.81/l*sin(q) - c*v + u", "start": 0.0, "noise": 0.01}},
        "inputs": [{"name": "u"}], "outputs": {"y": {"value": "q", "noise": 0.02}},
        "record": {"step": 0.05, "samples": 120, "integrator": "euler", "input": {"levels": [-2, 2], "hold": 10}}}"#;
    let one_line = description.replace('\n', " ");
    let program = |line: &str| format!("input()\nprint({line:?}, flush=True)\n");
    let twin = started("text.py", &program(&one_line), workers()).unwrap();
    let written = twin.into_study().unwrap().text().unwrap();
    assert!(Study::of_file(&StudyFile::parse(&written, "w.toml".as_ref()).unwrap()).is_ok());
    let command = format!("{python} text.py");
    let with = |arguments: &[&str]| done(&[arguments, &["--program", &command]].concat());
    let effects = with(&["effects"]);
    assert!(effects.contains("on q, v; magnitudes force"), "{effects}");
    let simulate = ["simulate", "--theta", "l=1,c=0.4", "--out"];
    with(&[&simulate[..], &["swing.csv"]].concat());
    with(&["fit", "swing.csv", "--out", "swing-fit"]);
    file("swing.toml", &TEXT.replace("INTEGRATOR", "euler"));
    done(&[&simulate[..], &["text.csv", "--study", "swing.toml"]].concat());
    let read = |name: &str| fs::read_to_string(place().join(name)).unwrap();
    assert_eq!(read("swing.csv"), read("text.csv"));
    let wrong = one_line.replace("\"rate\": \"v\"", "\"rate\": \"vv\"");
    file("wrong-text.py", &program(&wrong));
    let command = format!("{python} wrong-text.py");
    let parts = ["states: q: unknown name", "did you mean"];
    refused(&["check", "--program", &command], &parts);
}
