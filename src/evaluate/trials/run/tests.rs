use super::*;
use crate::diagnose::Ablation;
use crate::storage::checksum::sha256;
use crate::study::{RecordPlan, StudyFile};
use crate::twins::VanDerPol;
use std::fs;

/// Short records and few effects: what is tested is the order of work.
fn oscillator() -> Study {
    let study = Study::new("van-der-pol", VanDerPol, RecordPlan::autonomous(0.05, 120)).unwrap();
    let text = "twin = 'van-der-pol'\n[library]\n\
                only = ['sensor-bias', 'sensor-gain', 'coulomb-friction', 'linear-loss']";
    let file = StudyFile::parse(text, Path::new("s.toml")).unwrap();
    study.configure(&file).unwrap()
}

fn two() -> TrialSettings {
    TrialSettings {
        trials: 2,
        kinds: vec![Kind::None],
        detection_only: true,
        ..TrialSettings::default()
    }
}

fn sealed<'a>(
    study: &'a Study,
    settings: TrialSettings,
    path: &Path,
) -> Result<Sealed<'a>, EvaluateError> {
    Withheld::new(study, settings)?.seal(path, &Progress::silent())
}

#[test]
fn trials_are_gone_on_with_and_keys_stay_as_they_were_sealed() {
    let study = oscillator();
    let place = tempfile::tempdir().unwrap();
    let path = place.path().join("trials");
    let score = || sealed(&study, two(), &path)?.score(&Progress::silent());
    let first = score().unwrap();
    let keys = fs::read(path.join("keys.json")).unwrap();
    assert_eq!(first.setup.seal, sha256(&keys));
    assert_eq!(
        fs::read_to_string(path.join("seal.txt")).unwrap().trim(),
        first.setup.seal
    );
    // Kept answers give the same bytes; an answer that is missing is given again.
    assert_eq!(score().unwrap(), first);
    let answer = path.join("answers/0001.json");
    fs::remove_file(&answer).unwrap();
    let mut second = score().unwrap();
    second.rows[1].answer.seconds = first.rows[1].answer.seconds;
    assert_eq!(second.rows, first.rows);
    fs::write(&answer, "{").unwrap();
    let error = score().unwrap_err().to_string();
    assert!(
        error.contains("0001.json") && error.contains("remove it"),
        "{error}"
    );
    fs::copy(path.join("answers/0000.json"), &answer).unwrap();
    let error = score().unwrap_err().to_string();
    assert!(error.contains("holds another number"), "{error}");
    fs::remove_file(&answer).unwrap();
    fs::write(path.join("keys.json"), [&keys[..], b" "].concat()).unwrap();
    let error = score().unwrap_err().to_string();
    assert!(error.contains("SHA-256"), "{error}");
    // The answer was given before the key was looked at.
    assert!(answer.exists());
    // A verdict in an answer, a record without its answer.
    fs::write(path.join("keys.json"), keys).unwrap();
    let text = fs::read_to_string(&answer).unwrap();
    let other = text.replace("\"seconds\": ", "\"seconds\": 1");
    assert_ne!(other, text);
    fs::write(&answer, other).unwrap();
    let error = score().unwrap_err().to_string();
    assert!(
        error.contains("0001.json") && error.contains("checksum"),
        "{error}"
    );
    fs::remove_file(&answer).unwrap();
    let record = path.join("records/0001.csv");
    let text = fs::read_to_string(&record).unwrap();
    fs::write(&record, text.replacen(",0.", ",1.", 3)).unwrap();
    let error = score().unwrap_err().to_string();
    assert!(
        error.contains("records/0001.csv") && error.contains("SHA-256"),
        "{error}"
    );
}

/// Sealed records stay what they were, though their trials are answered: a share looks at its own, a score at all.
#[test]
fn records_of_answered_trials_are_refused_where_they_are_altered_or_gone() {
    let study = oscillator();
    let place = tempfile::tempdir().unwrap();
    let path = place.path().join("trials");
    let settings = || TrialSettings {
        validation: true,
        ..two()
    };
    let silent = Progress::silent();
    let score = || sealed(&study, settings(), &path)?.score(&silent);
    let first = score().unwrap();
    let refused = |name: &str, reason: &str| {
        let error = score().unwrap_err().to_string();
        assert!(error.contains(name) && error.contains(reason), "{error}");
        let sealed = sealed(&study, settings(), &path).unwrap();
        let answered = |share: &str| sealed.answer(share.parse().unwrap(), &silent);
        let error = answered("1/2").unwrap_err().to_string();
        assert!(error.contains(name) && error.contains(reason), "{error}");
        assert_eq!(answered("2/2").unwrap().len(), 2);
    };
    for name in ["records/0001.csv", "records/0001-validation.csv"] {
        let record = path.join(name);
        let text = fs::read(&record).unwrap();
        fs::write(&record, [&text[..], b"\n"].concat()).unwrap();
        refused(name, "its SHA-256 is not that of manifest.json");
        fs::remove_file(&record).unwrap();
        refused(name, "it is missing");
        fs::write(&record, text).unwrap();
    }
    assert_eq!(score().unwrap(), first);
}

#[test]
fn shares_answer_apart_and_are_scored_together() {
    let study = oscillator();
    let place = tempfile::tempdir().unwrap();
    let sealed = sealed(&study, two(), &place.path().join("trials")).unwrap();
    let silent = Progress::silent();
    let [first, second] = ["1/2", "2/2"].map(|share| share.parse().unwrap());
    assert_eq!(sealed.answer(first, &silent).unwrap().len(), 1);
    assert_eq!(sealed.answer(second, &silent).unwrap().len(), 2);
    assert_eq!(sealed.score(&silent).unwrap().rows.len(), 2);
}

#[test]
fn the_same_seed_seals_the_same_keys_and_other_calls_are_refused() {
    let study = oscillator();
    let place = tempfile::tempdir().unwrap();
    let at = |name: &str| place.path().join(name);
    let all = |trials| TrialSettings {
        trials,
        ..TrialSettings::default()
    };
    let one = sealed(&study, all(20), &at("one")).unwrap();
    let two = sealed(&study, all(20), &at("two")).unwrap();
    assert_eq!(one.seal(), two.seal());
    let refused = |settings: TrialSettings, path: &Path| match sealed(&study, settings, path) {
        Ok(_) => panic!("{} was taken", path.display()),
        Err(error) => error.to_string(),
    };
    let seed = TrialSettings { seed: 2, ..all(20) };
    assert!(refused(seed, &at("one")).contains("seed was 1, now it is 2"));
    assert!(refused(all(21), &at("one")).contains("trials was 20, now it is 21"));
    assert!(refused(all(1), place.path()).contains("no withheld folder"));
    assert!(refused(all(1), &at("a/b")).contains("make it first"));
    assert!(refused(all(0), &at("three")).contains("no trials"));
    assert_eq!(
        fs::read_dir(place.path()).unwrap().count(),
        2,
        "nothing is left over"
    );
}

#[test]
fn what_a_library_leaves_out_is_known_before_the_keys_are() {
    let study = oscillator();
    let place = tempfile::tempdir().unwrap();
    let settings = TrialSettings {
        trials: 5,
        kinds: vec![Kind::None, Kind::Listed],
        without: true,
        ..TrialSettings::default()
    };
    let sealed = sealed(&study, settings, &place.path().join("t")).unwrap();
    let left_out = sealed.folder.left_out(5).unwrap();
    let keys = sealed.folder.keys(5).unwrap();
    for (left_out, key) in left_out.iter().zip(&keys) {
        assert_eq!(left_out, &key.effects);
    }
    assert!(left_out.iter().any(Vec::is_empty) && !left_out.iter().all(Vec::is_empty));
    sealed.folder.check_left_out(&keys).unwrap();
    sealed
        .write("left-out.json", "[[], [], [], [], []]")
        .unwrap();
    let error = sealed.folder.check_left_out(&keys).unwrap_err().to_string();
    assert!(
        error.contains("left-out.json") && error.contains("keys.json"),
        "{error}"
    );
}

#[test]
fn calls_that_cannot_be_made_are_refused_with_the_limit() {
    let study = oscillator();
    let refused = |settings: TrialSettings| match Withheld::new(&study, settings) {
        Ok(_) => panic!("taken"),
        Err(error) => error.to_string(),
    };
    let many = TrialSettings {
        trials: 1_000_000_000_000,
        ..two()
    };
    assert!(refused(many).contains("at most 1000000"));
    let no_kinds = TrialSettings {
        kinds: vec![],
        ..two()
    };
    assert!(refused(no_kinds).contains("no kinds"));
    let text = "twin = 'van-der-pol'\n[library]\nonly = ['actuator-gain']";
    let file = StudyFile::parse(text, Path::new("s.toml")).unwrap();
    let study = oscillator().configure(&file).unwrap();
    let error = match Withheld::new(&study, TrialSettings::default()) {
        Ok(_) => panic!("taken"),
        Err(error) => error.to_string(),
    };
    assert!(error.contains("kind listed"), "{error}");
}

/// A verdict alone is that of the whole diagnosis; parts that are taken out are stated. Neither changes the trial.
#[test]
fn parts_of_a_diagnosis_change_no_trial() {
    let study = oscillator();
    let place = tempfile::tempdir().unwrap();
    let card = |detection_only, ablated: &[Ablation], name: &str| {
        let settings = TrialSettings {
            trials: 1,
            kinds: vec![Kind::Listed],
            detection_only,
            ablated: ablated.to_vec(),
            ..TrialSettings::default()
        };
        let sealed = sealed(&study, settings, &place.path().join(name)).unwrap();
        sealed.score(&Progress::silent()).unwrap()
    };
    let (whole, alone) = (card(false, &[], "whole"), card(true, &[], "verdicts"));
    let outcome = |card: &Scorecard| card.rows[0].outcome().cloned().unwrap();
    let (all, only) = (outcome(&whole), outcome(&alone));
    assert_eq!((all.verdict, all.p_value), (only.verdict, only.p_value));
    assert!(only.accepted.is_empty());
    assert_eq!(whole.rows[0].truth, alone.rows[0].truth);
    assert!(whole.rows[0].answer.greedy.is_some() && whole.setup.settings.ablated.is_empty());
    let without = card(false, &Ablation::ALL, "without");
    assert_eq!(without.rows[0].truth, whole.rows[0].truth);
    let all = "without fitted-noise, unknown-functions, evidence";
    assert!(
        without.json()["ablated"].as_array().unwrap().len() == 3 && without.html().contains(all)
    );
}

/// Every change of the question is asked, and counted.
#[test]
fn steadiness_asks_every_question_again() {
    let study = oscillator();
    let place = tempfile::tempdir().unwrap();
    let settings = TrialSettings {
        trials: 1,
        steadiness: 1,
        ..two()
    };
    let sealed = sealed(&study, settings, &place.path().join("t")).unwrap();
    let card = sealed.score(&Progress::silent()).unwrap();
    let repeats = card.breakdown("steadiness").unwrap();
    let asked: Vec<(&str, u64)> = (repeats.lines.iter())
        .map(|line| {
            (
                line.label("change").as_str().unwrap(),
                line.counts[0].unwrap().of,
            )
        })
        .collect();
    assert_eq!(
        asked,
        [
            ("order of the library", 1),
            ("record twice as long", 1),
            ("seed", 4),
            ("units", 1)
        ]
    );
}
