//! FMUs made of our own C: both versions of the standard. Needs a C compiler; without one, says so and passes.

mod exchange;

use rayon::prelude::*;
use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::OnceLock;
use truetwin::external::fmu::{FmuSettings, FmuTwin};
use truetwin::record::{Drive, Quantity, Signal};
use truetwin::study::StudyError;
use truetwin::twin::conformance::{Severity, check};
use truetwin::twin::{DigitalTwin, Interval, Noise, Parameter, SimulationError};

const TWO: &str = r#"<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="Spring" guid="{spring &amp; mass}">
  <CoSimulation modelIdentifier="model"/>
  <TypeDefinitions><SimpleType name="Stiffness"><Real unit="N/m" min="1" max="9"/></SimpleType></TypeDefinitions>
  <DefaultExperiment startTime="0" stopTime="12" stepSize="0.05"/>
  <ModelVariables>
    <ScalarVariable name="stiffness" valueReference="0" causality="parameter" variability="fixed"><Real start="4" declaredType="Stiffness"/></ScalarVariable>
    <ScalarVariable name="damping" valueReference="1" causality="parameter" variability="tunable"><Real start="0.5" unit="N.s/m"/></ScalarVariable>
    <ScalarVariable name="mass" valueReference="2" causality="parameter" variability="fixed"><Real start="1" unit="kg"/></ScalarVariable>
    <ScalarVariable name="force" valueReference="3" causality="input"><Real start="0" unit="N" min="-1" max="1"/></ScalarVariable>
    <ScalarVariable name="place" valueReference="4" causality="output"><Real unit="m"/></ScalarVariable>
    <ScalarVariable name="speed" valueReference="5" causality="output"><Real unit="m/s"/></ScalarVariable>
  </ModelVariables>
  <ModelStructure/>
</fmiModelDescription>"#;

const THREE: &str = r#"<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="3.0" modelName="Spring" instantiationToken="{spring}">
  <CoSimulation modelIdentifier="model"/>
  <TypeDefinitions><Float64Type name="Stiffness" unit="N/m" min="1" max="9"/></TypeDefinitions>
  <DefaultExperiment startTime="0" stopTime="12" stepSize="0.05"/>
  <ModelVariables>
    <Float64 name="stiffness" valueReference="0" causality="parameter" variability="fixed" start="4" declaredType="Stiffness"/>
    <Float64 name="damping" valueReference="1" causality="parameter" variability="tunable" start="0.5" unit="N.s/m"/>
    <Float64 name="mass" valueReference="2" causality="parameter" variability="fixed" start="1" unit="kg"/>
    <Float64 name="force" valueReference="3" causality="input" start="0" unit="N" min="-1" max="1"/>
    <Float64 name="place" valueReference="4" causality="output" unit="m"/>
    <Float64 name="speed" valueReference="5" causality="output" unit="m/s"/>
  </ModelVariables>
  <ModelStructure/>
</fmiModelDescription>"#;

/// Where the FMUs of this run lie.
fn place() -> &'static PathBuf {
    static PLACE: OnceLock<PathBuf> = OnceLock::new();
    PLACE.get_or_init(|| {
        let place =
            PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(format!("fmu-{}", std::process::id()));
        fs::create_dir_all(&place).unwrap();
        place
    })
}

/// Compiles a source of ours into an FMU; `None` without a compiler.
fn fmu(name: &str, source: &str, description: &str, flags: &[&str]) -> Option<PathBuf> {
    let library = place().join(format!("{name}{}", std::env::consts::DLL_SUFFIX));
    let source = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("tests/command_line/fmu")
        .join(source);
    let compiled = (Command::new("cc")
        .args(["-shared", "-fPIC", "-O1", "-o"])
        .arg(&library))
    .arg(source)
    .args(flags)
    .arg("-lm")
    .output();
    let Ok(compiled) = compiled else {
        eprintln!("skipped: no C compiler is installed");
        return None;
    };
    let said = String::from_utf8_lossy(&compiled.stderr);
    assert!(compiled.status.success(), "{said}");
    Some(packed(name, description, &fs::read(library).unwrap()))
}

/// An FMU of a description and a library.
fn packed(name: &str, description: &str, library: &[u8]) -> PathBuf {
    let path = place().join(format!("{name}.fmu"));
    let mut archive = zip::ZipWriter::new(fs::File::create(&path).unwrap());
    let stored =
        zip::write::SimpleFileOptions::default().compression_method(zip::CompressionMethod::Stored);
    let folder = match (
        description.contains("fmiVersion=\"2"),
        std::env::consts::OS,
        std::env::consts::ARCH,
    ) {
        (true, "linux", _) => "linux64".to_owned(),
        (true, "macos", _) => "darwin64".to_owned(),
        (true, ..) => "win64".to_owned(),
        (false, "macos", arch) => format!("{arch}-darwin"),
        (false, os, arch) => format!("{arch}-{os}"),
    };
    let file = format!("binaries/{folder}/model{}", std::env::consts::DLL_SUFFIX);
    for (file, bytes) in [
        ("modelDescription.xml", description.as_bytes()),
        (&file, library),
    ] {
        archive.start_file(file, stored).unwrap();
        archive.write_all(bytes).unwrap();
    }
    archive.finish().unwrap();
    path
}

/// Both versions, and one whose instances cannot be reset.
fn all() -> Vec<PathBuf> {
    static ALL: OnceLock<Vec<PathBuf>> = OnceLock::new();
    let make = || {
        [
            fmu("two", "spring2.c", TWO, &[]),
            fmu("three", "spring3.c", THREE, &[]),
            fmu("stiff", "spring2.c", TWO, &["-DNO_RESET"]),
        ]
    };
    ALL.get_or_init(|| make().into_iter().flatten().collect())
        .clone()
}

fn open(path: &Path) -> FmuTwin {
    FmuTwin::open(path, FmuSettings::default()).unwrap()
}

fn drive() -> Drive {
    let force = Signal::from_shape_fn((100, 1), |(k, _)| ((k / 25) % 2) as f64 - 0.3);
    Drive::new(0.05, force).unwrap()
}

/// The same steps in Rust.
fn expected(theta: &[f64], drive: &Drive) -> Signal {
    let (mut place, mut speed) = (0.0, 0.0);
    let mut signal = Signal::zeros((drive.samples(), 2));
    for k in 0..drive.samples() {
        (signal[[k, 0]], signal[[k, 1]]) = (place, speed);
        for _ in 0..50 {
            speed += 0.001 * (drive.input(k)[0] - theta[0] * place - theta[1] * speed) / theta[2];
            place += 0.001 * speed;
        }
    }
    signal
}

#[test]
fn names_units_and_boxes_are_those_of_the_description() {
    for path in all() {
        let twin = open(&path);
        assert_eq!(twin.name(), "Spring");
        let parameters: Vec<Parameter> = twin.parameters().iter().cloned().collect();
        let damping = Parameter::new("damping", "N.s/m", 0.25, 0.75).within(0.05, 5.0);
        assert_eq!(parameters[0], Parameter::new("stiffness", "N/m", 1.0, 9.0));
        assert_eq!(parameters[1], damping);
        assert_eq!(twin.signals().inputs, [Quantity::new("force", "N")]);
        assert_eq!(twin.signals().outputs[1], Quantity::new("speed", "m/s"));
        assert_eq!((twin.plan().step, twin.plan().samples), (0.05, 241));
        let variables = vec!["stiffness".to_owned(), "place".to_owned()];
        let settings = FmuSettings {
            variables,
            ..FmuSettings::default()
        };
        let chosen = FmuTwin::open(&path, settings).unwrap();
        assert_eq!(chosen.parameters().names(), ["stiffness"]);
        assert_eq!(
            chosen.parameters()[0].bounds,
            Interval::new(1.0, 9.0).unwrap()
        );
        let y = chosen.simulate(&[3.0], &drive(), Noise::OFF).unwrap();
        let all = twin
            .simulate(&[3.0, 0.5, 1.0], &drive(), Noise::OFF)
            .unwrap();
        assert_eq!(y.column(0), all.column(0));
    }
}

#[test]
fn outputs_are_those_of_the_equations_on_any_thread_and_after_any_run() {
    for path in all() {
        let twin = open(&path);
        let theta = |i: usize| vec![1.5 + 0.1 * i as f64, 0.3, 0.8 + 0.01 * i as f64];
        let runs: Vec<Signal> = (0..40usize)
            .into_par_iter()
            .map(|i| twin.simulate(&theta(i), &drive(), Noise::OFF).unwrap())
            .collect();
        for (i, run) in runs.iter().enumerate() {
            let off = (run - &expected(&theta(i), &drive()))
                .mapv(f64::abs)
                .into_iter()
                .fold(0.0, f64::max);
            assert!(off < 1e-12, "{}: {off}", path.display());
        }
    }
}

#[test]
fn failures_cost_their_run() {
    for path in all() {
        let twin = open(&path);
        let lost = twin
            .simulate(&[-900.0, 0.0, 1.0], &drive(), Noise::OFF)
            .unwrap_err();
        assert!(
            matches!(lost, SimulationError::Diverged { at } if at > 0.0),
            "{lost}"
        );
        let none = twin
            .simulate(&[4.0, 0.5, -1.0], &drive(), Noise::OFF)
            .unwrap_err();
        assert!(matches!(none, SimulationError::Failed(_)), "{none}");
        assert!(none.to_string().contains("the initialisation"), "{none}");
        let fine = twin
            .simulate(&[4.0, 0.5, 1.0], &drive(), Noise::OFF)
            .unwrap();
        assert_eq!(
            fine,
            open(&path)
                .simulate(&[4.0, 0.5, 1.0], &drive(), Noise::OFF)
                .unwrap()
        );
    }
}

#[test]
fn a_check_finds_nothing_but_that_there_is_no_noise() {
    for path in all() {
        let study = open(&path).into_study().unwrap();
        let drive = study.drive(Noise::new(1, "input", 0)).unwrap();
        let findings = check(study.twin(), &drive, 1);
        assert!(
            findings.iter().all(|f| f.severity < Severity::Failure),
            "{findings:?}"
        );
    }
}

#[test]
fn what_is_no_fmu_is_named() {
    let message = |path: &Path| match FmuTwin::open(path, FmuSettings::default()) {
        Err(error) => error.to_string(),
        Ok(_) => panic!("{} was opened", path.display()),
    };
    assert!(message(Path::new("nowhere.fmu")).contains("nowhere.fmu: No such file"));
    let text = place().join("text.fmu");
    fs::write(&text, "no archive").unwrap();
    assert!(message(&text).contains("no usable FMU"));
    let exchange = packed(
        "exchange",
        &TWO.replace("CoSimulation", "ModelExchange"),
        b"",
    );
    assert!(message(&exchange).contains("no continuous states; export it for co-simulation"));
    assert!(message(&packed("empty", TWO, b"")).contains("cannot be instantiated"));
    let Some(other) = fmu("other", "spring3.c", TWO, &[]) else {
        return;
    };
    assert!(message(&other).contains("no fmi2Instantiate"));
    let settings = FmuSettings {
        variables: vec!["inertia".into()],
        ..FmuSettings::default()
    };
    let error = FmuTwin::open(&all()[0], settings).unwrap_err();
    assert!(matches!(error, StudyError::Simulator(_)));
    assert!(
        error
            .to_string()
            .contains("called \"inertia\"; there are stiffness"),
        "{error}"
    );
}

fn truetwin(arguments: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_truetwin"));
    command
        .args(arguments)
        .current_dir(place())
        .output()
        .unwrap()
}

#[test]
fn an_fmu_is_checked_trained_and_estimated_from_the_command_line() {
    let Some(path) = all().first().cloned() else {
        return;
    };
    let path = path.display().to_string();
    let study = "twin = 'Spring'\n[fixed]\nmass = 1\n[[effect]]\nid = 'sensor-noise'\ntarget = 'sensor1'\nmagnitudes = { std = 0.01 }\n\
        [[effect]]\nid = 'sensor-noise'\ntarget = 'sensor2'\nmagnitudes = { std = 0.01 }\n";
    fs::write(place().join("spring.toml"), study).unwrap();
    let done = |arguments: &[&str]| {
        let output = truetwin(&[arguments, &["--fmu", &path]].concat());
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(0), "{arguments:?}: {said}");
        String::from_utf8(output.stdout).unwrap()
    };
    let checked = done(&["check", "--study", "spring.toml"]);
    assert!(
        !checked.contains("failure") && !checked.contains("warning"),
        "{checked}"
    );
    done(&[
        "pretrain",
        "--study",
        "spring.toml",
        "--bank-size",
        "500",
        "--epochs",
        "20",
        "--out",
        "spring.est",
    ]);
    done(&[
        "simulate",
        "--study",
        "spring.toml",
        "--theta",
        "stiffness=3,damping=1.5",
        "--out",
        "spring.csv",
    ]);
    let estimate = [
        "estimate",
        "spring.csv",
        "--estimator",
        "spring.est",
        "--json",
        "--always-refine",
    ];
    let value: serde_json::Value = serde_json::from_str(&done(&estimate)).unwrap();
    for (j, truth) in [3.0, 1.5].into_iter().enumerate() {
        let found = value["theta"]["final"][j].as_f64().unwrap();
        assert!((found / truth - 1.0).abs() < 0.05, "{found} for {truth}");
    }
    let refused = truetwin(&["check", "--fmu", "nowhere.fmu"]);
    assert_eq!(refused.status.code(), Some(2));
    let both = truetwin(&["--fmu", &path, "check", "--program", "true"]);
    assert_eq!(both.status.code(), Some(2));
}
