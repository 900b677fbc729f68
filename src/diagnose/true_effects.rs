//! The effects that are truly there, fitted: how much evidence the record holds for them, and the share of the gap that they close.

use super::base::{Base, finished};
use super::outcome::Shrinkage;
use super::quantify::share::{Measures, shrinkage};
use super::settings::DiagnoseSettings;
use super::step::other_step;
use super::thresholds::THRESHOLDS;
use crate::fit::Passes;
use crate::hypothesis::search::model::Model;
use crate::hypothesis::search::{Before, Breadth, listed};
use crate::record::Record;
use crate::study::{Study, StudyError};
use crate::twin::Twin;
use std::sync::Arc;

/// A fit of the true effects: what an answer is to be held against.
#[derive(Debug)]
pub(crate) struct TrueFit {
    /// Log evidence of the twin with these effects over that of the twin alone, in nats.
    pub held: f64,
    /// The share that they close; `None` where none can be told.
    pub share: Option<Shrinkage>,
}

/// Fits these effects, of keys `id@target`, beside the twin, whatever a diagnosis would say of them; a finer step stands on both sides
/// where the record asks for one. `None` where an effect cannot be fitted, and for a black box, whose fits would cost as much as its
/// diagnosis.
pub(crate) fn true_fit(
    study: &Study,
    record: &Record,
    validation: Option<&Record>,
    keys: &[String],
    settings: &DiagnoseSettings,
) -> Result<Option<TrueFit>, StudyError> {
    if study.twin().outline().is_none() {
        return Ok(None);
    }
    let fit = |twin: &Twin, settings: &DiagnoseSettings| {
        let (records, passes) = (Arc::from([record.clone()]), Passes::default());
        let base = Base::new(study, twin, records, settings, &passes)?;
        let with = fitted(study, &base, keys, settings)?;
        Ok::<_, StudyError>(with.map(|with| (base, with)))
    };
    let Some(mut found) = fit(study.twin(), settings)? else {
        return Ok(None);
    };
    if let Some((step, _)) = other_step(&found.1, (THRESHOLDS.step_shows, 0.0), study.asks_hold())?
        && let Some(finer) = step.of(study.twin())
    {
        let begin = DiagnoseSettings {
            initial: Some(found.0.theta.clone()),
            ..settings.clone()
        };
        match fit(&finer, &begin)? {
            Some(finer) => found = finer,
            None => return Ok(None),
        }
    }
    let (base, with) = found;
    let accepted = finished(&with)?;
    let measures = Measures {
        base: &base.model,
        accepted: Some(&accepted),
        others: &[],
        class: &[],
        validation: validation.map(std::slice::from_ref),
        initial: None,
    };
    Ok(Some(TrueFit {
        held: with.log_evidence - base.model.log_evidence,
        share: shrinkage(&measures, settings.noise())?,
    }))
}

/// The twin with these effects, added one after the other; `None` where one cannot be fitted.
fn fitted(
    study: &Study,
    base: &Base,
    keys: &[String],
    settings: &DiagnoseSettings,
) -> Result<Option<Model>, StudyError> {
    let terms = base.listed(study, settings)?;
    let mut model = base.model.clone();
    for key in keys {
        let mut ways = terms.clone();
        ways.retain(|term| term.key() == *key);
        let breadth = Breadth {
            least: f64::NEG_INFINITY,
            ..Breadth::of(&model, false).of_all().for_gap(f64::INFINITY)
        };
        let found = listed(&model, &ways, Before::default(), breadth)?;
        match found.into_iter().find_map(|e| e.model) {
            Some(with) => model = with,
            None => return Ok(None),
        }
    }
    Ok(Some(model))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::fixture::{biased_record, tanks};

    /// The true effect closes the gap on a record that it has not seen, an effect of another place next to nothing.
    #[test]
    fn the_true_effect_has_the_evidence_and_closes_the_gap_and_another_does_not() {
        let study = tanks(200);
        let (record, other) = (biased_record(&study, 3.0, 5), biased_record(&study, 3.0, 6));
        let share = |key: &str| {
            let keys = [key.to_owned()];
            let settings = DiagnoseSettings::default();
            let fit = true_fit(&study, &record, Some(&other), &keys, &settings).unwrap();
            fit.map(|fit| (fit.held, fit.share.and_then(|share| share.closed)))
        };
        let (held, own) = share("sensor-bias@sensor").unwrap();
        assert!((0.8..1.2).contains(&own.unwrap()), "{own:?}");
        // A wrong effect may explain so little that no fit of it begins.
        let (less, wrong) = share("actuator-bias@actuator").unwrap_or((0.0, None));
        assert!(wrong.unwrap_or(0.0) < 0.8, "{wrong:?}");
        assert!(held > less + 10.0, "{held} and {less} nats");
    }
}
