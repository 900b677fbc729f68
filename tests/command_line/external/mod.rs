//! Twins that are programs: what honest and hostile ones do. Needs Python 3; without one, says so and passes.

mod command_line;
mod honest;
mod hostile;
mod inside;

use std::path::PathBuf;
use std::process::Command;
use std::sync::OnceLock;
use std::time::Duration;
use truetwin::external::program::{ProgramSettings, ProgramTwin};
use truetwin::record::{Drive, Signal};
use truetwin::study::StudyError;
use truetwin::twin::{DigitalTwin, Noise, SimulationError};

/// Python 3, if there is one.
fn python() -> Option<&'static str> {
    static FOUND: OnceLock<Option<&str>> = OnceLock::new();
    *FOUND.get_or_init(|| {
        let works = |name: &&str| {
            let mut command = Command::new(name);
            command.args(["-c", "import sys; assert sys.version_info[0] == 3"]);
            command.output().is_ok_and(|output| output.status.success())
        };
        let found = ["python3", "python"].into_iter().find(works);
        if found.is_none() {
            eprintln!("skipped: no Python 3 is installed");
        }
        found
    })
}

/// A first-order lag in Python; `before` is run before each answer to a simulation, with `request` and `count` at hand.
fn lag(before: &str) -> String {
    LAG.replace(
        "        BEFORE\n",
        &before
            .lines()
            .fold(String::new(), |all, line| all + "        " + line + "\n"),
    )
}
const LAG: &str = r#"
import json, math, os, random, sys, time
count = 0
for line in sys.stdin:
    request = json.loads(line)
    if request["request"] == "describe":
        assert request["truetwin"] == 1
        answer = {"name": "lag", "parameters": [
            {"name": "tau", "unit": "s", "prior": [1, 3], "bounds": [0.2, 10]},
            {"name": "gain", "unit": "K/V", "prior": [0.5, 2], "bounds": [0.1, 5]}],
            "inputs": [{"name": "u", "unit": "V"}], "outputs": [{"name": "y", "unit": "K"}],
            "record": {"step": 0.5, "samples": 200, "input": {"levels": [-1, 1], "hold": 10}}}
    else:
        count += 1
        theta = request["theta"]
        BEFORE
        keep = math.exp(-request["step"] / theta["tau"])
        noise = random.Random(request["seed"]) if request["seed"] is not None else None
        x, y = 0.0, []
        for u in request["inputs"]["u"]:
            y.append(x + (0.02 * noise.gauss(0, 1) if noise else 0.0))
            x = keep * x + (1 - keep) * theta["gain"] * u
        answer = {"id": request["id"], "outputs": {"y": y}}
    print(json.dumps(answer), flush=True)
"#;

/// A folder for the programs of this run.
fn place() -> &'static PathBuf {
    static PLACE: OnceLock<PathBuf> = OnceLock::new();
    PLACE.get_or_init(|| {
        let place = PathBuf::from(env!("CARGO_TARGET_TMPDIR"))
            .join(format!("external-{}", std::process::id()));
        std::fs::create_dir_all(&place).unwrap();
        place
    })
}

/// The path of a file with this text.
fn file(name: &str, text: &str) -> String {
    let path = place().join(name);
    std::fs::write(&path, text).unwrap();
    path.display().to_string()
}

/// The twin of a Python program.
fn started(name: &str, text: &str, settings: ProgramSettings) -> Result<ProgramTwin, StudyError> {
    let script = file(name, text);
    ProgramTwin::start(python().unwrap(), [script], settings)
}

fn twin(name: &str, before: &str, settings: ProgramSettings) -> ProgramTwin {
    started(name, &lag(before), settings).unwrap()
}

/// Short time-outs for programs that hang on purpose; Python must start within one.
fn impatient() -> ProgramSettings {
    ProgramSettings {
        workers: Some(2),
        timeout: Duration::from_millis(1500),
        retries: 0,
    }
}

fn drive() -> Drive {
    let inputs = Signal::from_shape_fn((60, 1), |(k, _)| ((k / 10) % 3) as f64 / 3.0 - 0.4);
    Drive::new(0.5, inputs).unwrap()
}

/// One run at the prior's centre.
fn run(twin: &ProgramTwin, sample: u64) -> Result<Signal, SimulationError> {
    twin.simulate(&[2.0, 1.25], &drive(), Noise::new(1, "test", sample))
}
