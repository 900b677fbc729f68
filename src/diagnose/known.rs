//! The effects that are truly there, fitted: how much evidence the record holds for them, and the share of the gap that they close.

use super::base::Base;
use super::explain::search::{Breadth, listed};
use super::outcome::Shrinkage;
use super::quantify::share::{Measures, shrinkage};
use super::run::finished;
use super::settings::DiagnoseSettings;
use super::step::finer_step;
use super::thresholds::Thresholds;
use crate::hypothesis::model::Model;
use crate::likelihood::measured;
use crate::record::Record;
use crate::study::{Study, StudyError};
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
    let records: Arc<[Record]> = Arc::from([record.clone()]);
    let measure = |base: &Base, with: &Model| {
        let accepted = finished(Some(with))?;
        let measures = Measures {
            base: &base.model,
            accepted: accepted.as_ref(),
            others: &[],
            class: &[],
            validation: validation.map(std::slice::from_ref),
            initial: None,
        };
        Ok(Some(TrueFit {
            held: with.log_evidence - base.model.log_evidence,
            share: shrinkage(&measures, settings.noise())?,
        }))
    };
    let own = measured(study.twin(), &records, &settings.beliefs(study))?;
    let base = Base::new(&own, records.clone(), settings)?;
    let Some(with) = fitted(study, &base, keys, settings)? else {
        return Ok(None);
    };
    let finer = match finer_step(&with, Thresholds::STEP_SHOWS, 0.0)? {
        Some((step, _)) => step.of(study.twin()),
        None => None,
    };
    let Some(finer) = finer else {
        return measure(&base, &with);
    };
    let begin = DiagnoseSettings {
        initial: Some(base.theta.clone()),
        ..settings.clone()
    };
    let finer = measured(&finer, &records, &settings.beliefs(study))?;
    let base = Base::new(&finer, records.clone(), &begin)?;
    match fitted(study, &base, keys, settings)? {
        Some(with) => measure(&base, &with),
        None => Ok(None),
    }
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
        let ways: Vec<_> = (terms.iter())
            .filter(|term| term.key() == *key)
            .cloned()
            .collect();
        let breadth = Breadth {
            least: f64::NEG_INFINITY,
            ..Breadth::of(&model, false).of_all().for_gap(f64::INFINITY)
        };
        let found = listed(&model, &ways, model.log_evidence, &[], breadth)?;
        match found.into_iter().find_map(|found| found.model) {
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
