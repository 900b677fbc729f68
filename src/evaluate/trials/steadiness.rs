//! The same question asked otherwise: an answer that depends on the asking is none.

use super::answer::{Repeat, ask};
use super::units::rescaled;
use crate::diagnose::DiagnoseSettings;
use crate::evaluate::EvaluateError;
use crate::progress::Progress;
use crate::record::Record;
use crate::study::Study;

/// Seeds besides the trial's own.
const SEEDS: u64 = 4;

/// Answers under other seeds, from a record twice as long, in other units, and with the library in another order.
pub(super) fn repeats(
    study: &Study,
    (record, validation): (&Record, Option<&Record>),
    doubled: Option<&Record>,
    settings: &DiagnoseSettings,
    progress: &Progress,
) -> Result<Vec<Repeat>, EvaluateError> {
    let mut repeats = Vec::new();
    let mut again = |change: &str,
                     study: &Study,
                     record: &Record,
                     validation: Option<&Record>,
                     settings: &DiagnoseSettings| {
        let outcome = ask(study, record, validation, settings, progress)?.ok();
        repeats.push(Repeat {
            change: change.into(),
            outcome,
        });
        Ok::<(), EvaluateError>(())
    };
    for seed in 1..=SEEDS {
        let other = DiagnoseSettings {
            seed: settings.seed.wrapping_add(seed),
            ..settings.clone()
        };
        again("seed", study, record, validation, &other)?;
    }
    if let Some(doubled) = doubled {
        again("record twice as long", study, doubled, validation, settings)?;
    }
    if let Some((study, record, validation)) = rescaled(study, record, validation)? {
        again("units", &study, &record, validation.as_ref(), settings)?;
    }
    let kinds: Vec<_> = study.catalogue().kinds().iter().rev().cloned().collect();
    let reordered = study
        .clone()
        .with_effects(kinds.iter().map(|kind| kind.as_ref().clone()));
    again(
        "order of the library",
        &reordered,
        record,
        validation,
        settings,
    )?;
    Ok(repeats)
}
