//! The same question asked otherwise: an answer that depends on the asking is none.

use super::answer::{Question, Repeat};
use super::units::rescaled;
use crate::diagnose::DiagnoseSettings;
use crate::evaluate::EvaluateError;
use crate::evaluate::trials::numbers::TRIAL;
use crate::progress::Progress;
use crate::record::Record;

/// Answers under other seeds, from a record twice as long, in other units, and with the library in another order.
pub(super) fn repeats(
    question: &Question<'_>,
    doubled: Option<&Record>,
    progress: &Progress,
) -> Result<Vec<Repeat>, EvaluateError> {
    let (study, own) = (question.study, &question.settings);
    let seeds = (1..=TRIAL.other_seeds).map(|seed| DiagnoseSettings {
        seed: own.seed.wrapping_add(seed),
        ..own.clone()
    });
    let with = |settings| Question {
        settings,
        ..question.clone()
    };
    let mut questions: Vec<(&str, Question<'_>)> = seeds.map(|s| ("seed", with(s))).collect();
    if let Some(record) = doubled {
        let longer = Question {
            record,
            ..question.clone()
        };
        questions.push(("record twice as long", longer));
    }
    let scaled = rescaled(study, question.record, question.validation)?;
    if let Some((study, record, validation)) = &scaled {
        let scaled = Question {
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
    let reordered = Question {
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
