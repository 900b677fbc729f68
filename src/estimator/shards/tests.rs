//! Banks on disk: the same bytes whoever makes them, mended where they are damaged, trained on as in memory.

#[path = "../../../tests/common/files.rs"]
mod files;

use super::{BankPlan, ShardedBank, merge};
use crate::estimator::bank::Bank;
use crate::estimator::{EstimatorError, PresetName};
use crate::progress::{Listener, Progress};
use crate::storage::work::Share;
use crate::study::{RecordPlan, Study};
use crate::twins::VanDerPol;
use files::files;
use std::fs;
use std::path::{Path, PathBuf};

pub(in crate::estimator) fn oscillator() -> Study {
    Study::new("oscillator", VanDerPol, RecordPlan::autonomous(0.05, 60)).unwrap()
}

pub(in crate::estimator) fn plan(study: &Study, size: usize) -> BankPlan {
    BankPlan {
        project: study.into(),
        preset: PresetName::Paper,
        size,
        seed: 3,
    }
}

pub(in crate::estimator) fn fill(
    plan: &BankPlan,
    path: &Path,
    share: &str,
) -> Result<(usize, usize), EstimatorError> {
    let filled = plan.fill(path, share.parse().unwrap(), &Progress::silent())?;
    Ok((filled.there, filled.of))
}

fn shards(folder: &Path) -> Vec<PathBuf> {
    let mut all: Vec<PathBuf> = (fs::read_dir(folder.join("shards")).unwrap())
        .map(|entry| entry.unwrap().path())
        .collect();
    all.sort();
    all
}

#[test]
fn threads_shares_order_and_interruptions_change_no_byte() {
    let (study, place) = (oscillator(), tempfile::tempdir().unwrap());
    let plan = plan(&study, 150);
    let at = |name: &str| place.path().join(name);
    for (name, threads) in [("one", 1), ("three", 3)] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
        let filled = pool.unwrap().install(|| fill(&plan, &at(name), "1/1"));
        assert_eq!(filled.unwrap(), (10, 10));
    }
    // A job array of three into folders of their own, in any order; and into one folder.
    for share in ["2/3", "3/3", "1/3"] {
        let own = at(&share.replace('/', "-"));
        assert!(matches!(fill(&plan, &own, share).unwrap().0, 3 | 4));
        fill(&plan, &at("shared"), share).unwrap();
    }
    let folders: Vec<PathBuf> = ["1-3", "2-3", "3-3"].map(at).into();
    assert_eq!(
        merge(&folders, &at("merged"), &Progress::silent()).unwrap(),
        10
    );
    // Stopped after some rows, and gone on with.
    struct After(std::sync::atomic::AtomicUsize);
    impl Listener for After {
        fn advanced(&self, _: &str, _: u64, _: u64) {}
        fn cancelled(&self) -> bool {
            self.0.fetch_add(1, std::sync::atomic::Ordering::Relaxed) > 60
        }
    }
    let stop = Progress::new(std::sync::Arc::new(After(0.into())));
    let stopped = plan.fill(&at("stopped"), Share::WHOLE, &stop);
    assert!(stopped.is_err());
    let kept = shards(&at("stopped")).len();
    assert!((1..10).contains(&kept), "{kept}");
    fill(&plan, &at("stopped"), "1/1").unwrap();
    let one = files(&at("one"));
    assert_eq!(one.len(), 11, "shards and manifest, nothing else");
    for name in ["three", "shared", "merged", "stopped"] {
        assert_eq!(files(&at(name)), one, "{name}");
    }
}

#[test]
fn rows_depend_on_seed_and_number_alone() {
    let (study, place) = (oscillator(), tempfile::tempdir().unwrap());
    let rows = |size: usize, seed: u64, name: &str| {
        let path = place.path().join(name);
        let plan = BankPlan {
            seed,
            ..plan(&study, size)
        };
        plan.fill(&path, Share::WHOLE, &Progress::silent()).unwrap();
        ShardedBank::open(&path)
            .unwrap()
            .part(0)
            .unwrap()
            .into_owned()
    };
    let (small, large) = (rows(20, 3, "small"), rows(3000, 3, "large"));
    assert_eq!((small.theta.nrows(), large.theta.nrows()), (16, 47));
    assert_eq!(small.theta.row(15), large.theta.row(15));
    assert_eq!(small.features.row(15), large.features.row(15));
    assert_ne!(small, rows(20, 4, "other"));
}

/// Does something to a file.
type Harm = fn(&Path);

#[test]
fn damaged_shards_are_named_and_made_again() {
    let (study, place) = (oscillator(), tempfile::tempdir().unwrap());
    let (plan, path) = (plan(&study, 40), place.path().join("bank"));
    fill(&plan, &path, "1/1").unwrap();
    let whole = files(&path);
    let shard = shards(&path)[1].clone();
    let damage: [(&str, Harm); 3] = [
        ("cut", |p| {
            let bytes = fs::read(p).unwrap();
            fs::write(p, &bytes[..bytes.len() / 2]).unwrap();
        }),
        ("altered", |p| {
            let mut bytes = fs::read(p).unwrap();
            let middle = bytes.len() / 2;
            bytes[middle] ^= 1;
            fs::write(p, bytes).unwrap();
        }),
        ("gone", |p| fs::remove_file(p).unwrap()),
    ];
    for (what, harm) in damage {
        harm(&shard);
        let read = ShardedBank::open(&path).and_then(|bank| {
            bank.part(1)?;
            Ok(())
        });
        let error = read.unwrap_err().to_string();
        assert!(error.contains("again"), "{what}: {error}");
        assert_eq!(fill(&plan, &path, "1/1").unwrap(), (3, 3), "{what}");
        assert_eq!(files(&path), whole, "{what}");
    }
}

#[test]
fn what_does_not_belong_together_is_refused() {
    let (study, place) = (oscillator(), tempfile::tempdir().unwrap());
    let at = |name: &str| place.path().join(name);
    let silent = Progress::silent();
    fill(&plan(&study, 40), &at("half"), "1/2").unwrap();
    fill(&plan(&study, 41), &at("other"), "1/1").unwrap();
    let refused = |result: Result<usize, EstimatorError>| result.unwrap_err().to_string();
    let error = refused(merge(&[at("half")], &at("out"), &silent));
    assert!(
        error.contains("1 of 3 shards") && error.contains("missing: 0, 2"),
        "{error}"
    );
    let error = refused(merge(&[at("half"), at("other")], &at("out"), &silent));
    assert!(error.contains("size is 40 and 41"), "{error}");
    assert!(!at("out").exists());
    // The same numbers, other rows: as from a machine that computes otherwise.
    fill(&plan(&study, 40), &at("whole"), "1/1").unwrap();
    let shard = &shards(&at("half"))[0];
    let name = shard.file_name().unwrap().to_str().unwrap();
    fs::rename(
        shard,
        shard.with_file_name(format!("{}{}.npz", &name[..7], "0".repeat(64))),
    )
    .unwrap();
    let error = refused(merge(&[at("half"), at("whole")], &at("out"), &silent));
    assert!(error.contains("differ"), "{error}");
    // A bank of another prior.
    let narrow = Study::new("oscillator", VanDerPol, RecordPlan::autonomous(0.05, 61)).unwrap();
    let bank = ShardedBank::open(&at("whole")).unwrap();
    assert!(plan(&study, 40).check(&bank).is_ok());
    let error = plan(&narrow, 40).check(&bank).unwrap_err().to_string();
    assert!(
        error.contains("record was [0.05,60], now it is [0.05,61]"),
        "{error}"
    );
}
