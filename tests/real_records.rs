//! Measured records, where they are at hand: `../shared/data`, or the folder that `TRUETWIN_DATA` names.

use std::path::{Path, PathBuf};
use truetwin::experiment::reference_studies;
use truetwin::progress::Progress;
use truetwin::study::StudyFile;
use truetwin::twin::read_record;
use truetwin::two_stage::{EstimateOptions, PretrainOptions, pretrain};

fn data(name: &str) -> Option<PathBuf> {
    let folder = std::env::var_os("TRUETWIN_DATA").map_or_else(
        || Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/data"),
        PathBuf::from,
    );
    let path = folder.join(name);
    if !path.exists() {
        println!("skipped: no {}", path.display());
        return None;
    }
    Some(path)
}

/// Four k and two start levels cannot explain these tanks, which overflow; but they can follow them to 0.69 V.
#[test]
fn the_cascaded_tanks_are_followed_on_a_record_never_seen() {
    let (Some(measured), Some(validation)) = (
        data("cascaded-tanks-estimation.csv"),
        data("cascaded-tanks-validation.csv"),
    ) else {
        return;
    };
    let example = Path::new(env!("CARGO_MANIFEST_DIR")).join("examples/cascaded-tanks.toml");
    let file = StudyFile::read(&example).unwrap();
    let study = reference_studies()
        .unwrap()
        .remove(1)
        .configure(&file)
        .unwrap();
    let options = PretrainOptions {
        bank_size: Some(2000),
        epochs: Some(20),
        seed: 1,
        ..PretrainOptions::default()
    };
    let (estimator, _) = pretrain(&study, &options, &Progress::silent()).unwrap();
    let options = EstimateOptions {
        validation: Some(read_record(&validation).unwrap()),
        ..EstimateOptions::default()
    };
    let record = read_record(&measured).unwrap();
    let estimate = estimator
        .estimate(&record, &options, &Progress::silent())
        .unwrap();
    let after = estimate.tracking.as_ref().unwrap().rmse;
    let unseen = estimate.validation.as_ref().map(|v| v.rmse).unwrap();
    println!("free-run RMSE {after:.3} V, on the validation record {unseen:.3} V");
    assert!(estimate.gate.out_of_distribution);
    assert!(unseen <= 0.69, "{unseen}");
    assert!(
        estimate.after.is_some_and(|after| after.p_value <= 0.05),
        "no parameters make this twin right, and it must say so"
    );
    let nuisance: Vec<_> = estimate
        .nuisance()
        .into_iter()
        .map(|n| (n.name, n.role))
        .collect();
    assert_eq!(nuisance, [("h1".into(), "start"), ("h2".into(), "start")]);
}
