//! What the engine of hypotheses finds, as evidence over that of the twin.

use super::found::Found;
use crate::hypothesis::explanation::Explanation;
use crate::hypothesis::model::Model;
use crate::hypothesis::term::Term;
use crate::hypothesis::{leave_valleys as leave, search};
use crate::study::StudyError;
use std::sync::Arc;

pub(in crate::diagnose) use crate::hypothesis::search::{Breadth, FEW};

impl Found {
    fn of_explanation(explanation: Explanation, origin: f64) -> Self {
        Self {
            gain: explanation.log_z - origin,
            terms: explanation.terms,
            model: explanation.model,
        }
    }

    fn explanation(&self, origin: f64) -> Explanation {
        Explanation {
            terms: self.terms.clone(),
            log_z: self.gain + origin,
            model: self.model.clone(),
        }
    }
}

/// Listed effects beside a model, refitted; best first. `origin` is log Z of the twin; `thetas` are further starts of the twin's own θ.
pub(in crate::diagnose) fn listed(
    model: &Model,
    terms: &[Arc<Term>],
    origin: f64,
    thetas: &[Vec<f64>],
    breadth: Breadth,
) -> Result<Vec<Found>, StudyError> {
    let all = search::listed(model, terms, thetas, breadth)?.into_iter();
    Ok(all.map(|one| Found::of_explanation(one, origin)).collect())
}

/// Unknown functions beside a model; best first.
pub(in crate::diagnose) fn unknown(
    model: &Model,
    terms: &[Arc<Term>],
    origin: f64,
    breadth: Breadth,
) -> Result<Vec<Found>, StudyError> {
    let all = search::unknown(model, terms, breadth)?.into_iter();
    Ok(all.map(|one| Found::of_explanation(one, origin)).collect())
}

/// Fits effects again that may be better from where other laws ended.
pub(super) fn leave_valleys(
    model: &Model,
    all: &mut [Found],
    origin: f64,
) -> Result<(), StudyError> {
    let mut found: Vec<Explanation> = all.iter().map(|one| one.explanation(origin)).collect();
    leave(model, &mut found, model.log_evidence)?;
    for (old, new) in all.iter_mut().zip(found) {
        *old = Found::of_explanation(new, origin);
    }
    Ok(())
}
