//! The same question asked otherwise: an answer that depends on the asking is none.

use super::answer::{Repeat, TrialQuestion};
use crate::diagnose::DiagnoseSettings;
use crate::evaluate::EvaluateError;
use crate::evaluate::trials::numbers::TRIAL;
use crate::progress::Progress;
use crate::record::Record;
use crate::study::{NoiseTable, Study, StudyFile};
use crate::twin::{NoiseLevel, Outline, TwinPart};

/// Answers under other seeds, from a record twice as long, in other units, and with the library in another order.
pub(super) fn repeats(
    question: &TrialQuestion<'_>,
    doubled: Option<&Record>,
    progress: &Progress,
) -> Result<Vec<Repeat>, EvaluateError> {
    let (study, own) = (question.study, &question.settings);
    let seeds = (1..=TRIAL.other_seeds).map(|seed| DiagnoseSettings {
        seed: own.seed.wrapping_add(seed),
        ..own.clone()
    });
    let with = |settings| TrialQuestion {
        settings,
        ..question.clone()
    };
    let mut questions: Vec<(&str, TrialQuestion<'_>)> = seeds.map(|s| ("seed", with(s))).collect();
    if let Some(record) = doubled {
        let longer = TrialQuestion {
            record,
            ..question.clone()
        };
        questions.push(("record twice as long", longer));
    }
    let scaled = rescaled(study, question.record, question.validation)?;
    if let Some((study, record, validation)) = &scaled {
        let scaled = TrialQuestion {
            study,
            record,
            validation: validation.as_ref(),
            settings: own.clone(),
        };
        questions.push(("units", scaled));
    }
    let kinds: Vec<_> = study.catalogue().kinds().iter().rev().cloned().collect();
    let kinds = kinds.iter().map(|kind| kind.as_ref().clone());
    let reordered = study.clone().with_effects(kinds);
    let reordered = TrialQuestion {
        study: &reordered,
        ..question.clone()
    };
    questions.push(("order of the library", reordered));
    (questions.into_iter())
        .map(|(change, question)| {
            let outcome = question.ask(progress)?.ok();
            let change = change.into();
            Ok(Repeat { change, outcome })
        })
        .collect()
}

/// The study and its records with outputs in other units; `None` for a black box, and for a study with starts, effects, or noise that is
/// to be estimated.
pub(super) fn rescaled(
    study: &Study,
    record: &Record,
    validation: Option<&Record>,
) -> Result<Option<(Study, Record, Option<Record>)>, EvaluateError> {
    let file = study.file();
    let Some(twin) = study.twin().equations() else {
        return Ok(None);
    };
    if !file.start.is_empty() || !file.effect.is_empty() {
        return Ok(None);
    }
    let Some(noise) = noise(file, &twin.outline()) else {
        return Ok(None);
    };
    let same = StudyFile {
        twin: study.name().into(),
        noise,
        library: file.library.clone(),
        ..StudyFile::default()
    };
    let twin = study
        .twin()
        .with([], vec![TwinPart::Unit(TRIAL.unit_factor)]);
    let new = study.with_twin(twin)?;
    let kinds = study.catalogue().kinds().iter();
    let new = new.with_effects(kinds.map(|kind| kind.as_ref().clone()));
    let scaled =
        |record: &Record| Record::new(record.drive().clone(), record.outputs() * TRIAL.unit_factor);
    let validation = validation.map(scaled).transpose()?;
    Ok(Some((new.configure(&same)?, scaled(record)?, validation)))
}

/// Returns the declared noise levels in the new units; `None` where one is to be estimated, and so is a parameter in the old ones.
fn noise(file: &StudyFile, outline: &Outline) -> Option<NoiseTable> {
    let scaled = |(name, level): (&String, &NoiseLevel)| {
        let is_output = outline.outputs.iter().any(|output| output.name == *name);
        let mut level = *level;
        let NoiseLevel::Declared(declared) = &mut level else {
            return None;
        };
        declared.std *= if is_output { TRIAL.unit_factor } else { 1.0 };
        Some((name.clone(), level))
    };
    let levels = file
        .noise
        .levels
        .iter()
        .map(scaled)
        .collect::<Option<_>>()?;
    Some(NoiseTable {
        levels,
        ..file.noise.clone()
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evaluate::paper::reference_studies;
    use crate::record::{Drive, Signal};
    use crate::twin::Noise;

    fn configured(text: &str) -> Study {
        let file = StudyFile::parse(text, "s.toml".as_ref()).unwrap();
        let studies = reference_studies().unwrap();
        let mut named = studies.into_iter().filter(|s| s.name() == file.twin);
        named.next().unwrap().configure(&file).unwrap()
    }

    #[test]
    fn a_rescaled_twin_makes_rescaled_records() {
        let mut studies = reference_studies().unwrap();
        studies.push(configured("twin = 'van-der-pol'\n[noise]\ny = 0.01"));
        studies.push(configured(
            "twin = 'tanks'\n[noise]\ny = { std = 0.3, known = true }\nh1 = 0.2",
        ));
        for study in studies {
            let noise = Noise::new(1, "units", 0);
            let theta = study.twin().parameters().draw_prior(noise);
            let drive = study.drives().unwrap().draw(noise).unwrap();
            let outputs = study.twin().simulate(&theta, &drive, noise).unwrap();
            let record = Record::new(drive.clone(), outputs).unwrap();
            let (new, scaled, _) = rescaled(&study, &record, None).unwrap().unwrap();
            let again = new.twin().simulate(&theta, &drive, noise).unwrap();
            for (a, b) in again.iter().zip(scaled.outputs()) {
                assert!((a - b).abs() < 1e-9 * b.abs().max(1.0));
            }
            assert_eq!(new.candidates().len(), study.candidates().len());
            assert_eq!(new.beliefs().known, study.beliefs().known);
        }
    }

    #[test]
    fn what_stands_in_the_old_units_is_not_rescaled() {
        let record = Record::new(
            Drive::new(1.0, Signal::zeros((9, 1))).unwrap(),
            Signal::zeros((9, 1)),
        );
        for table in [
            "[noise]\ny = 'estimate'",
            "[noise]\nh1 = 'estimate'",
            "[start]\nh1 = 1.0",
            "[[effect]]\nid = 'sensor-lag'\ntarget = 'sensor'",
        ] {
            let study = configured(&format!("twin = 'tanks'\n{table}"));
            let rescaled = rescaled(&study, record.as_ref().unwrap(), None).unwrap();
            assert!(rescaled.is_none(), "{table}");
        }
    }
}
