//! Every reader on files that are nearly right: it says what is wrong in one line, or reads; it never panics, and its memory
//! is bounded by the length of the file. Seeds are fixed: the same inputs in every run. `fuzz/` goes further.
//!
//! An input that fails is kept under `target/tmp/fuzz`; mended, it becomes a seed with a name that says what it was.

mod limits;
mod mutate;
mod readers;
mod verbs;

use crate::memory;

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};

/// Inputs for each reader, beside the seeds themselves: a fault that one of 250 meets is found with a probability of 0.98. Another fault is left
/// to `every_reader_on_many_inputs`.
const EACH: u64 = 1000;
/// The most memory that a reader may hold: so many bytes for each byte of the file, and so many more.
const TIMES: usize = 200;
const PLUS: usize = 16 << 20;

fn seeds(reader: &str) -> Vec<(PathBuf, Vec<u8>)> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("tests/hostile/fuzz/seeds")
        .join(reader);
    let mut paths: Vec<PathBuf> = (std::fs::read_dir(&folder)
        .unwrap_or_else(|e| panic!("{}: {e}", folder.display())))
    .map(|entry| entry.unwrap().path())
    .collect();
    paths.sort();
    (paths.into_iter())
        .map(|path| (path.clone(), std::fs::read(path).unwrap()))
        .collect()
}

/// Holds a reader to its word on one input; returns whether it was read.
fn hold(reader: &str, read: readers::Reader, input: &[u8], which: &str) -> bool {
    let checked = catch_unwind(AssertUnwindSafe(|| {
        let (outcome, peak) = memory::peak(|| read(input));
        let most = TIMES * input.len() + PLUS;
        assert!(
            peak <= most,
            "{peak} bytes of memory for {} bytes",
            input.len()
        );
        if let Err(message) = &outcome {
            readers::check_message(reader, message);
        }
        outcome.is_ok()
    }));
    checked.unwrap_or_else(|_| {
        let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("fuzz");
        std::fs::create_dir_all(&folder).unwrap();
        let path = folder.join(format!("{reader}-{}", which.replace('/', "-")));
        std::fs::write(&path, input).unwrap();
        panic!(
            "{reader}, {which}: see above; the input is {}",
            path.display()
        );
    })
}

fn fuzz(name: &str, each: u64) {
    let all = readers::readers();
    let (_, read) = all.into_iter().find(|(reader, _)| *reader == name).unwrap();
    let seeds = seeds(name);
    let whole = seeds.iter().filter(|(path, bytes)| {
        let which = path.file_name().unwrap().to_string_lossy();
        hold(name, read, bytes, &which)
    });
    let mut accepted = whole.count() as u64;
    assert!(accepted > 0, "no seed of {name} is read");
    let mut random = ChaCha8Rng::seed_from_u64(name.bytes().map(u64::from).sum());
    for index in 0..each {
        let seed = &seeds[index as usize % seeds.len()].1;
        let other = &seeds[(index / 7) as usize % seeds.len()].1;
        let input = mutate::mutated(seed, other, &mut random);
        accepted += u64::from(hold(name, read, &input, &index.to_string()));
    }
    // Mutations must get past the first check now and then, and must not all be harmless.
    assert!(
        accepted > each / 200 && accepted < each,
        "{accepted} of {each} inputs of {name} were read"
    );
    eprintln!("{name}: {each} inputs, {accepted} read");
}

macro_rules! fuzzed {
    ($($(#[$attribute:meta])* $reader:ident),*) => {
        $($(#[$attribute])* #[test] fn $reader() { fuzz(stringify!($reader), EACH); })*
    };
}
fuzzed!(
    record,
    study,
    equations,
    effect,
    estimator,
    manifest,
    piece,
    bank,
    description,
    answer,
    #[cfg(feature = "fmi")]
    fmu
);

#[test]
#[ignore = "minutes; run it in release"]
fn every_reader_on_many_inputs() {
    for (reader, _) in readers::readers() {
        fuzz(reader, 20_000);
    }
}

/// Makes the seeds that are not text anew: `cargo test --test hostile -- --ignored seeds`.
#[test]
#[ignore = "writes into tests/hostile/fuzz/seeds"]
fn seeds_that_are_not_text() {
    use truetwin::estimator::{PresetName, PretrainOptions, pretrain};
    use truetwin::fuzzing::banks;
    use truetwin::progress::Progress;
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/hostile/fuzz/seeds");
    let new = |name: &str| {
        let path = root.join(name);
        let _ = std::fs::remove_file(&path);
        path
    };
    readers::write_bank(&new("bank/stored.npz"));
    readers::write_bank(&new("bank/table.csv"));
    std::fs::write(
        new("bank/matrix.npy"),
        readers::npy([0.5, 0.25, 1e-9, -3.0]),
    )
    .unwrap();
    let project = readers::tiny();
    let options = PretrainOptions {
        preset: PresetName::Default,
        bank_size: Some(100),
        epochs: Some(1),
        seed: 1,
    };
    let (estimator, _) = pretrain(project.clone(), &options, &Progress::silent()).unwrap();
    estimator.save(&new("estimator/tiny.est")).unwrap();
    let place = tempfile::tempdir().unwrap();
    let folder = place.path().join("bank");
    let plan = banks::BankPlan {
        project,
        preset: PresetName::Default,
        size: 20,
        seed: 1,
    };
    (plan.fill(&folder, banks::Share::WHOLE, &Progress::silent())).unwrap();
    let mut text = std::fs::read_to_string(folder.join("manifest.json")).unwrap();
    text.push_str(readers::NAMES);
    for entry in std::fs::read_dir(folder.join("shards")).unwrap() {
        text.push_str(&format!(
            "{}\n",
            entry.unwrap().file_name().to_string_lossy()
        ));
    }
    std::fs::write(new("manifest/bank.txt"), text).unwrap();
}
