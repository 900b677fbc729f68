//! Every reader of files and lines from elsewhere as a function of bytes. The targets of `fuzz/` are these, too.

use ndarray::array;
use safetensors::SafeTensors;
use serde_json::Value;
use sha2::{Digest, Sha256};
use std::collections::HashMap;
use std::fs;
use std::io::{Cursor, Write};
use std::path::{Path, PathBuf};
use std::sync::OnceLock;
use truetwin::effect::{Catalogue, augment};
use truetwin::estimator::Estimator;
use truetwin::estimator::Project;
use truetwin::evaluate::paper::reference_projects;
use truetwin::fuzzing::banks::{self, Bank as _};
use truetwin::fuzzing::{programs as program, runs, work};
use truetwin::network::HeadArchitecture;
use truetwin::network::layers::*;
use truetwin::progress::Progress;
use truetwin::record::{Drive, Record};
use truetwin::study::{RecordPlan, Study, StudyFile};
use truetwin::twin::{Noise, Parameter, ParameterSpace};
use truetwin::twins::VanDerPol;

/// Reader of bytes: `Ok`, or the message that a user would see.
pub type Reader = fn(&[u8]) -> Result<(), String>;

/// All of them, by name.
#[allow(dead_code)]
pub fn readers() -> Vec<(&'static str, Reader)> {
    vec![
        ("record", record),
        ("study", study),
        ("equations", equations),
        ("effect", effect),
        ("estimator", estimator),
        ("manifest", manifest),
        ("piece", piece),
        ("bank", bank),
        ("description", description),
        ("answer", answer),
        #[cfg(feature = "fmi")]
        ("fmu", fmu),
    ]
}

fn text(error: impl ToString) -> String {
    error.to_string()
}

/// A folder of this thread for a reader that wants files.
fn place() -> PathBuf {
    thread_local! {
        static PLACE: tempfile::TempDir = tempfile::tempdir().expect("a temporary folder");
    }
    PLACE.with(|place| place.path().to_owned())
}

/// The path of a file with these bytes.
fn file(name: &str, bytes: &[u8]) -> PathBuf {
    let path = place().join(name);
    fs::write(&path, bytes).expect("the temporary folder takes files");
    path
}

/// Reads a record, and the same file as inputs alone, which refuses outputs.
pub fn record(data: &[u8]) -> Result<(), String> {
    let path = file("record.csv", data);
    hold_message("record", Drive::read(&path));
    Record::read(&path).map(|_| ()).map_err(text)
}

fn projects() -> &'static [Project] {
    static PROJECTS: OnceLock<Vec<Project>> = OnceLock::new();
    PROJECTS.get_or_init(|| {
        let mut projects = reference_projects().expect("the reference twins");
        projects.push(tiny());
        projects
    })
}

/// A study file, up to the study that it makes.
pub fn study(data: &[u8]) -> Result<(), String> {
    let found = StudyFile::read(&file("study.toml", data)).map_err(text)?;
    match projects().iter().find(|p| p.study().name() == found.twin) {
        Some(project) => project.configure(&found).map(|_| ()).map_err(text),
        None => Ok(()),
    }
}

/// A study file with equations, up to a short simulation of the study that it makes.
pub fn equations(data: &[u8]) -> Result<(), String> {
    let found = StudyFile::read(&file("equations.toml", data)).map_err(text)?;
    if found.own_equations().is_none() {
        return Ok(());
    }
    let study = Study::of_file(&found).map_err(text)?;
    let twin = study.twin();
    let inputs = ndarray::Array2::ones((4, twin.signals().inputs.len()));
    let drive = Drive::new(0.1, inputs).map_err(text)?;
    // It may diverge.
    let _ = twin.simulate(
        &twin.parameters().centre(),
        &drive,
        Noise::new(1, "fuzz", 0),
    );
    Ok(())
}

/// An effect file, up to the twin that has the effects.
pub fn effect(data: &[u8]) -> Result<(), String> {
    let found = Catalogue::default()
        .read(&file("effect.toml", data), 1.0)
        .map_err(text)?;
    let Some(study) = projects()
        .iter()
        .map(Project::study)
        .find(|s| s.name() == "tanks")
    else {
        return Ok(());
    };
    augment(study.twin().clone(), found)
        .map(|_| ())
        .map_err(text)
}

/// A network of a few weights, so that a whole estimator is a few kilobytes.
struct Tiny;
impl HeadArchitecture for Tiny {
    const ID: &'static str = "tiny";
    type Features = Const<4>;
    type Hidden = Const<4>;
    type Trunk = (Linear<4, 4>, Tanh);
    type Head = Linear<4, 1>;
}

/// The project of the estimators among the seeds.
pub fn tiny() -> Project {
    let plan = RecordPlan::autonomous(0.05, 60);
    let study = Study::new("tiny", VanDerPol, plan).expect("a study");
    let features = truetwin::feature::Ar { order: 3 };
    Project::from(study)
        .with_features(features)
        .with_architecture::<Tiny>()
}

/// An estimator file as it is, and as it would be if whoever changed it had made the checksum fit.
pub fn estimator(data: &[u8]) -> Result<(), String> {
    let load = |bytes: &[u8]| {
        let path = file("tiny.est", bytes);
        Estimator::load(&path, projects()).map(|_| ()).map_err(text)
    };
    let as_it_is = load(data);
    match signed(data) {
        Some(bytes) => load(&bytes),
        None => as_it_is,
    }
}

/// The same container with a checksum that fits.
fn signed(bytes: &[u8]) -> Option<Vec<u8>> {
    let (_, metadata) = SafeTensors::read_metadata(bytes).ok()?;
    let container = SafeTensors::deserialize(bytes).ok()?;
    let header = metadata.metadata().as_ref()?.get("truetwin")?;
    let mut header: Value = serde_json::from_str(header).ok()?;
    *header.get_mut("sha256")? = "".into();
    let mut tensors = container.tensors();
    tensors.sort_by(|a, b| a.0.cmp(&b.0));
    let mut hash = Sha256::new();
    hash.update(serde_json::to_string(&header).ok()?);
    for (name, view) in &tensors {
        hash.update(format!("\n{name} {:?} {:?}\n", view.dtype(), view.shape()));
        hash.update(view.data());
    }
    let digest = hash.finalize();
    let sum: String = digest.iter().map(|b| format!("{b:02x}")).collect();
    *header.get_mut("sha256")? = sum.into();
    let metadata = HashMap::from([("truetwin".to_owned(), header.to_string())]);
    safetensors::serialize(tensors, &Some(metadata)).ok()
}

/// Separator between the text of a manifest and names in the folder of shards.
pub const NAMES: &str = "\n=== shards\n";

/// A folder of a bank: the text of its manifest, then the names of what lies among its shards.
pub fn manifest(data: &[u8]) -> Result<(), String> {
    let folder = place().join("bank");
    let _ = fs::remove_dir_all(&folder);
    fs::create_dir_all(folder.join("shards")).map_err(text)?;
    let at = (data.windows(NAMES.len())).position(|w| w == NAMES.as_bytes());
    let (manifest, names) = match at {
        Some(at) => (&data[..at], &data[at + NAMES.len()..]),
        None => (data, &[][..]),
    };
    fs::write(folder.join("manifest.json"), manifest).map_err(text)?;
    for name in String::from_utf8_lossy(names).lines().take(20) {
        if !name.contains(['/', '\0']) {
            // A name that the system refuses is none that a folder can have.
            let _ = fs::write(folder.join("shards").join(name), b"x");
        }
    }
    for verb in ["reproduce", "withheld"] {
        hold_message("manifest", work::manifest(&folder, verb));
    }
    let from = [folder.clone()];
    let out = place().join("merged");
    let _ = fs::remove_dir_all(&out);
    let silent = Progress::silent();
    hold_message("manifest", banks::merge(&from, &out, &silent));
    let table = place().join("merged.csv");
    let merged = banks::merge_into_file(&from, &table, &silent);
    hold_message("manifest", merged);
    let bank = banks::ShardedBank::open(&folder).map_err(text)?;
    for part in 0..bank.parts().len().min(3) {
        hold_message("manifest", bank.part(part));
    }
    Ok(())
}

/// An error on the way to the answer is held to the same rules.
fn hold_message<T, E: ToString>(reader: &str, outcome: Result<T, E>) {
    if let Err(error) = outcome {
        check_message(reader, &error.to_string());
    }
}

/// A piece of work that was kept.
pub fn piece(data: &[u8]) -> Result<(), String> {
    runs::run(&place().join("work"), data).map_err(text)
}

/// Parameters a and b of any value.
pub fn ab() -> ParameterSpace {
    ParameterSpace::new(["a", "b"].map(|name| Parameter::new(name, "1", f64::MIN, f64::MAX)))
}

/// A bank in one file: an archive, an array that is put into one, or a table.
pub fn bank(data: &[u8]) -> Result<(), String> {
    let path = match data {
        [b'P', b'K', ..] => file("bank.npz", data),
        [0x93, b'N', ..] => file("bank.npz", &archive(data)),
        _ => file("bank.csv", data),
    };
    banks::read(&path, &ab()).map(|_| ()).map_err(text)
}

/// An archive with sound `theta` and these bytes as `features`.
fn archive(features: &[u8]) -> Vec<u8> {
    let theta = npy([1.0, 2.0, 3.0, 4.0]);
    let mut archive = zip::ZipWriter::new(Cursor::new(Vec::new()));
    for (name, bytes) in [("theta.npy", theta.as_slice()), ("features.npy", features)] {
        let options = zip::write::SimpleFileOptions::default();
        archive.start_file(name, options).expect("into memory");
        archive.write_all(bytes).expect("into memory");
    }
    archive.finish().expect("into memory").into_inner()
}

/// The bytes of a 2 × 2 matrix as NumPy writes them.
pub fn npy(numbers: [f64; 4]) -> Vec<u8> {
    let mut bytes = b"\x93NUMPY\x01\x00\x76\x00".to_vec();
    bytes.extend(b"{'descr': '<f8', 'fortran_order': False, 'shape': (2, 2), }");
    bytes.resize(127, b' ');
    bytes.push(b'\n');
    bytes.extend(numbers.map(f64::to_le_bytes).concat());
    bytes
}

/// Writes a small bank, for a seed.
#[allow(dead_code)]
pub fn write_bank(path: &Path) {
    let theta = array![[1.0, 2.0], [3.0, 4.0]];
    let features = array![[0.5, 0.25, 1.0], [1e-9, -3.0, 7.0]];
    let draws = banks::Draws {
        theta,
        features,
        redrawn: 0,
    };
    banks::write(path, &draws, &["a", "b"]).expect("a new file");
}

/// A line, as a worker hands it on.
fn line(data: &[u8]) -> Result<&str, String> {
    str::from_utf8(data).map_err(text)
}

/// Reads a program's description of itself.
pub fn description(data: &[u8]) -> Result<(), String> {
    program::description(line(data)?)
}

/// Reads a program's answer.
pub fn answer(data: &[u8]) -> Result<(), String> {
    program::answer(line(data)?)
}

/// Reads an FMU's description of itself.
#[cfg(feature = "fmi")]
pub fn fmu(data: &[u8]) -> Result<(), String> {
    truetwin::fuzzing::fmus::description(line(data)?)
}

/// A reader on one input: it reads, or says in such a message why not. For the targets of `fuzz/`.
#[allow(dead_code)]
pub fn hold(name: &str, read: Reader, data: &[u8]) {
    if let Err(message) = read(data) {
        check_message(name, &message);
    }
}

/// Checks a message: one line, not endless, without what steers a terminal; of readers that a user calls, with a remedy.
pub fn check_message(reader: &str, message: &str) {
    assert!(!message.is_empty(), "an empty message");
    let odd = |c: char| c.is_control() || matches!(c, '\u{202a}'..='\u{202e}');
    assert!(!message.contains(odd), "no single plain line: {message:?}");
    assert!(message.chars().count() < 5000, "a message without end");
    // Those of lines are put into a sentence that has it.
    if !["description", "answer", "fmu"].contains(&reader) {
        assert!(message.contains(';'), "no remedy: {message}");
    }
}
