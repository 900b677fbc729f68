//! Effects that a study lets a diagnosis name.

use crate::effect::{Effect, EffectKey, EffectPattern};
use crate::hypothesis::listed::Library;
use crate::hypothesis::merged;
use crate::hypothesis::term::Term;
use crate::study::{Study, StudyError};
use crate::twin::Law;
use std::sync::Arc;

/// Every listed effect that the study lets a diagnosis name, in the units of the record.
pub(super) fn listed(
    study: &Study,
    without: &[EffectPattern],
    library: &Library<'_>,
    fitted_noise: &[String],
) -> Result<Vec<Term>, StudyError> {
    if let Some(name) = without.iter().find(|name| !study.knows_effect(name)) {
        return Err(StudyError::Without(format!(
            "{}{}",
            name.as_str(),
            study.nearest_effect(name)
        )));
    }
    let already = already(study);
    let mut terms = vec![];
    for effect in study.candidates() {
        let key = effect.key().to_string();
        if without.iter().any(|pattern| pattern.matches(effect.key())) || already.contains(&key) {
            continue;
        }
        if effect.law().is_noise() && fitted_noise.contains(&effect.target().to_owned()) {
            // Levels are fitted in every hypothesis; outliers are a kind of noise.
            continue;
        }
        terms.extend(library.terms(&effect)?);
    }
    Ok(merged(terms, library)?)
}

/// Effects with rare large errors: kinds of noise.
pub(super) fn outliers(study: &Study, without: &[EffectPattern]) -> Vec<Effect> {
    (study.candidates().into_iter())
        .filter(|effect| matches!(effect.law(), Law::Outliers(_)))
        .filter(|effect| !without.iter().any(|pattern| pattern.matches(effect.key())))
        .collect()
}

/// Effects that the study has added to its twin.
fn already(study: &Study) -> Vec<String> {
    (study.file().effect.iter())
        .map(|e| EffectKey::new(&e.id, &e.target).to_string())
        .collect()
}

/// Effects that the twin may lack beside these and its own effects.
pub(super) fn not_tested(study: &Study, terms: &[Arc<Term>]) -> Vec<String> {
    let known: Vec<String> = (terms.iter().flat_map(|t| t.keys()))
        .chain(already(study))
        .collect();
    let mut keys: Vec<String> = (study.effects().iter())
        .map(|e| e.key().to_string())
        .filter(|key| !known.contains(key))
        .collect();
    keys.dedup();
    keys
}
