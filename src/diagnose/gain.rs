//! What a known effect would gain: the yardstick of trials whose truth is known.

use super::attribute::explanations;
use super::base_fit::base_fit;
use super::black_box::measured;
use super::candidate::{Candidate, candidates};
use super::decide::grown;
use super::problem::Problem;
use super::run::{check, without_process_noise};
use super::{DiagnoseError, DiagnoseSettings, Setting};
use crate::progress::Progress;
use crate::study::Study;
use crate::twin::{Noise, Record};

/// Nats over the refitted twin that the listed effects `id@target` gain together on the records and, if there is one, on the
/// validation record, each fitted with θ as the explanations of a diagnosis are. `None` where the study does not list one of
/// them, or where the twin cannot be fitted.
///
/// An effect whose gain is a few nats cannot be told from noise, whoever looks.
///
/// # Errors
///
/// As [`diagnose`](super::diagnose).
pub fn gain_of(
    study: &Study,
    records: &[Record],
    validation: Option<&Record>,
    effects: &[String],
    settings: &DiagnoseSettings,
    progress: &Progress,
) -> Result<Option<f64>, DiagnoseError> {
    check(study, records, validation, settings)?;
    let (twin, silent) = &measured(study.twin(), records)?;
    let named: Vec<Candidate> = (candidates(study, &settings.without)?.into_iter())
        .filter(|c| c.is_listed() && effects.contains(&c.key()))
        .collect();
    if !effects
        .iter()
        .all(|key| named.iter().any(|c| c.key() == *key))
    {
        return Ok(None);
    }
    let validation: Option<Vec<Record>> = validation.map(|v| vec![v.clone()]);
    let setting = Setting {
        twin,
        validation: validation.as_deref(),
        together: None,
        follows: *silent || without_process_noise(twin.as_ref(), &records[0]),
        silent: *silent,
    };
    let problem = Problem::of_twin(twin, records);
    let noise = Noise::new(settings.seed, "diagnose", 0);
    let Some(fitted) = base_fit(&problem, settings, noise)? else {
        return Ok(None);
    };
    let Some(mut bench) = setting.bench(problem, fitted, &[], named)? else {
        return Ok(None);
    };
    let mut accepted = vec![];
    let mut gain = 0.0;
    let stage = progress.unseen();
    for left in (0..effects.len()).rev() {
        let Some(look) = bench.own_look()? else {
            return Ok(None);
        };
        let found = explanations(&bench, &look, setting.validation, None, &stage)?;
        let Some(best) = found.first() else {
            return Ok(None);
        };
        gain += best.gain + best.validation.unwrap_or(0.0);
        if left > 0 {
            let Some(step) = grown(&setting, &bench, &accepted, best)? else {
                return Ok(None);
            };
            (bench, accepted) = (step.bench, step.accepted);
        }
    }
    Ok(Some(gain))
}
