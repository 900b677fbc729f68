//! Terms that are searched, and unknown functions beside what was found of them.

use super::found::Found;
use super::search::{Breadth, unknown};
use crate::hypothesis::scales::Scales;
use crate::hypothesis::term::Term;
use crate::study::StudyError;
use std::sync::Arc;

/// Terms of a diagnosis.
pub(in crate::diagnose) struct Terms<'t> {
    pub listed: &'t [Arc<Term>],
    /// Kinds of noise other than the twin's.
    pub noise: &'t [Arc<Term>],
    /// Unknown functions whose range covers these models' states as well.
    pub unknown: &'t dyn Fn(&[Scales]) -> Vec<Arc<Term>>,
}

/// Terms of these hypotheses, in every way that they may be used: a hypothesis pays for all its ways.
pub(super) fn of_keys(terms: &[Arc<Term>], keys: &[String]) -> Vec<Arc<Term>> {
    (terms.iter())
        .filter(|term| keys.contains(&term.key()))
        .cloned()
        .collect()
}

/// Unknown functions on top of fitted effects.
pub(super) fn on_top(
    found: &Found,
    terms: &Terms<'_>,
    origin: f64,
    breadth: Breadth,
) -> Result<Option<Vec<Found>>, StudyError> {
    let Some(model) = &found.model else {
        return Ok(None);
    };
    let seen = scales(std::slice::from_ref(found))?;
    Ok(Some(unknown(
        model,
        &(terms.unknown)(&seen),
        origin,
        breadth,
    )?))
}

/// Sizes of the states along fitted models.
pub(super) fn scales(found: &[Found]) -> Result<Vec<Scales>, StudyError> {
    let mut all = vec![];
    for model in found.iter().filter_map(|f| f.model.as_ref()) {
        all.push(Scales {
            records: model.problem.records.clone(),
            states: model.states()?,
            outline: model.problem.outline(),
            rates: vec![],
            defined: vec![],
        });
    }
    Ok(all)
}
