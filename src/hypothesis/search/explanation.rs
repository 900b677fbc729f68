//! One explanation of the records.

use super::model::Model;
use crate::hypothesis::set::TermSet;
use crate::hypothesis::term::Term;
use crate::math::descending;
use std::sync::Arc;

/// A set of terms beside a twin, and how well it explains the records.
#[derive(Clone)]
pub(crate) struct Explanation {
    pub terms: Vec<Arc<Term>>,
    /// log Z in nats: of a term that may be used in several ways, which share its prior.
    pub log_z: f64,
    /// The fit, where it was worth one.
    pub model: Option<Model>,
}

impl Explanation {
    /// Returns what a fit explains.
    pub fn of(model: Model) -> Self {
        Self {
            terms: model.terms.clone(),
            log_z: model.log_evidence,
            model: Some(model),
        }
    }

    /// Keys of the terms.
    pub fn set(&self) -> TermSet {
        TermSet::of(&self.terms)
    }

    /// The term that was added last.
    pub fn last(&self) -> &Arc<Term> {
        &self.terms[self.terms.len() - 1]
    }

    /// Fitted θ of the twin alone.
    pub fn own_theta(&self) -> Option<Vec<f64>> {
        let model = self.model.as_ref()?;
        let d = model.base.parameters().len();
        Some(model.theta()[..d].to_vec())
    }

    /// Fitted magnitudes of the effect that was added last.
    pub(super) fn magnitudes(&self) -> Option<Vec<f64>> {
        let model = self.model.as_ref()?;
        let (theta, space) = (model.theta(), model.problem.twin.parameters());
        (self.last().names().iter())
            .map(|name| Some(theta[space.position(name).ok()?]))
            .collect()
    }
}

/// Best first.
pub(super) fn sort(all: &mut [Explanation]) {
    descending(all, |a| a.log_z);
}
