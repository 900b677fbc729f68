use super::*;
use crate::evaluate::paper::reference_studies;
use crate::storage::files::sha256;
use crate::study::StudyFile;
use std::fs;

fn oscillator() -> Study {
    reference_studies().unwrap().swap_remove(0)
}

fn two() -> Settings {
    Settings {
        trials: 2,
        kinds: vec![Kind::None],
        ..Settings::default()
    }
}

fn sealed<'a>(
    study: &'a Study,
    settings: Settings,
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
    assert_eq!(first.seal, sha256(&keys));
    assert_eq!(
        fs::read_to_string(path.join("seal.txt")).unwrap().trim(),
        first.seal
    );
    // Kept answers give the same bytes; an answer that is missing is given again.
    assert_eq!(score().unwrap(), first);
    let answer = path.join("answers/0001.json");
    fs::remove_file(&answer).unwrap();
    let mut second = score().unwrap();
    second.rows[1].seconds = first.rows[1].seconds;
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
}

#[test]
fn keys_stay_sealed_until_every_share_has_answered() {
    let study = oscillator();
    let place = tempfile::tempdir().unwrap();
    let sealed = sealed(&study, two(), &place.path().join("trials")).unwrap();
    let silent = Progress::silent();
    let [first, second] = ["1/2", "2/2"].map(|share| share.parse().unwrap());
    assert_eq!(sealed.answer(first, &silent).unwrap().len(), 1);
    let error = sealed.open_keys(first, &silent).unwrap_err().to_string();
    assert!(error.contains("1 of 2 trials answered"), "{error}");
    assert_eq!(sealed.answer(second, &silent).unwrap().len(), 2);
    assert_eq!(sealed.open_keys(first, &silent).unwrap(), 1);
    assert_eq!(sealed.score(&silent).unwrap().rows.len(), 2);
}

#[test]
fn the_same_seed_seals_the_same_keys_and_other_calls_are_refused() {
    let study = oscillator();
    let place = tempfile::tempdir().unwrap();
    let at = |name: &str| place.path().join(name);
    let all = |trials| Settings {
        trials,
        ..Settings::default()
    };
    let one = sealed(&study, all(20), &at("one")).unwrap();
    let two = sealed(&study, all(20), &at("two")).unwrap();
    assert_eq!(one.seal(), two.seal());
    let refused = |settings: Settings, path: &Path| match sealed(&study, settings, path) {
        Ok(_) => panic!("{} was taken", path.display()),
        Err(error) => error.to_string(),
    };
    let seed = Settings { seed: 2, ..all(20) };
    assert!(refused(seed, &at("one")).contains("seed was 1, now it is 2"));
    assert!(refused(all(21), &at("one")).contains("trials was 20, now it is 21"));
    assert!(refused(all(1), place.path()).contains("no folder of `truetwin withheld`"));
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
    let settings = Settings {
        trials: 5,
        kinds: vec![Kind::None, Kind::Listed],
        without: true,
        ..Settings::default()
    };
    let sealed = sealed(&study, settings, &place.path().join("t")).unwrap();
    let left_out = sealed.folder.left_out(5).unwrap();
    let keys = sealed.folder.keys(5).unwrap();
    for (left_out, key) in left_out.iter().zip(&keys) {
        assert_eq!(left_out, &key.effects);
    }
    assert!(left_out.iter().any(Vec::is_empty) && !left_out.iter().all(Vec::is_empty));
}

#[test]
fn studies_that_change_the_twin_or_leave_nothing_to_name_are_refused() {
    let refused = |toml: &str| {
        let text = format!("twin = 'van-der-pol'\n{toml}");
        let file = StudyFile::parse(&text, Path::new("s.toml")).unwrap();
        let study = oscillator().configure(&file).unwrap();
        match Withheld::new(&study, Settings::default()) {
            Ok(_) => panic!("{toml} was taken"),
            Err(error) => error.to_string(),
        }
    };
    assert!(refused("[noise]\ny = 0.1").contains("changes [noise]"));
    assert!(refused("[library]\nonly = ['actuator-gain']").contains("kind listed"));
}

#[test]
fn a_verdict_alone_is_the_verdict_of_the_whole() {
    let study = oscillator();
    let place = tempfile::tempdir().unwrap();
    let card = |detection_only, name: &str| {
        let settings = Settings {
            kinds: vec![Kind::Unlisted, Kind::Pair],
            detection_only,
            ..two()
        };
        let sealed = sealed(&study, settings, &place.path().join(name)).unwrap();
        sealed.score(&Progress::silent()).unwrap()
    };
    let (whole, verdicts) = (card(false, "whole"), card(true, "verdicts"));
    for (whole, alone) in whole.rows.iter().zip(&verdicts.rows) {
        let (all, only) = (
            whole.outcome.as_ref().unwrap(),
            alone.outcome.as_ref().unwrap(),
        );
        assert_eq!((all.verdict, all.p_value), (only.verdict, only.p_value));
        assert!(only.accepted.is_empty() && only.before.is_none());
        // What the key adds is made of the records: the weaker effect of a pair, how far listed effects fall short.
        match whole.kind {
            Kind::Pair => assert!(whole.added.is_some() && whole.gain >= whole.added),
            _ => assert!(whole.shortfall.is_some() && alone.shortfall.is_none()),
        }
    }
}
