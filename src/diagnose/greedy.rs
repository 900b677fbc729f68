//! Forward selection by BIC, noise levels as declared: what a diagnosis is to be held against.

use super::base::Base;
use super::settings::{Ablation, DiagnoseSettings};
use super::thresholds::THRESHOLDS;
use crate::effect::EffectPattern;
use crate::fit::Passes;
use crate::hypothesis::search::{Before, Breadth, listed};
use crate::record::Record;
use crate::study::{Study, StudyError};
use std::sync::Arc;

/// Adds the listed effect that raises BIC most, one after the other, while one does; returns their keys. `None` for a black box, whose
/// likelihoods would cost as much as its diagnosis.
pub(crate) fn greedy(
    study: &Study,
    record: &Record,
    without: &[EffectPattern],
) -> Result<Option<Vec<String>>, StudyError> {
    if study.twin().outline().is_none() {
        return Ok(None);
    }
    let settings = DiagnoseSettings {
        without: without.to_vec(),
        ablated: Ablation::ALL.to_vec(),
        quick: true,
        ..DiagnoseSettings::default()
    };
    let records = Arc::from([record.clone()]);
    let passes = Passes::default();
    let base = Base::new(study, study.twin(), records, &settings, &passes)?;
    let mut terms = base.listed(study, &settings)?;
    let mut model = base.model.clone();
    let breadth = Breadth::of(&model, settings.quick);
    let mut keys = vec![];
    while keys.len() < THRESHOLDS.selected {
        let found = listed(&model, &terms, Before::default(), breadth)?;
        let best = (found.into_iter().next()).filter(|best| best.log_z > model.log_evidence);
        let Some((key, better)) = best.and_then(|best| Some((best.last().key(), best.model?)))
        else {
            break;
        };
        terms.retain(|term| term.key() != key);
        keys.push(key);
        model = better;
    }
    Ok(Some(keys))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::fixture::{biased_record, tanks};

    /// A bias that is plain is selected, or another effect of its sensor; nothing on a record of the twin itself.
    #[test]
    fn a_plain_effect_is_selected() {
        let study = tanks(200);
        let selected = |bias: f64| {
            let record = biased_record(&study, bias, 5);
            greedy(&study, &record, &[]).unwrap().unwrap()
        };
        assert_eq!(selected(0.0), Vec::<String>::new());
        assert!(selected(3.0)[0].ends_with("@sensor"));
    }
}
