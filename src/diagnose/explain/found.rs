//! One explanation of the records.

use crate::hypothesis::model::Model;
use crate::hypothesis::term::Term;
use std::sync::Arc;

/// One explanation beside a model.
#[derive(Clone)]
pub(in crate::diagnose) struct Found {
    pub terms: Vec<Arc<Term>>,
    /// log Z over that of the twin, in nats: one term's may be used in several ways, which share its prior.
    pub gain: f64,
    /// The fit, where it was worth one.
    pub model: Option<Model>,
}

impl Found {
    /// Evidence over another twin, of this log Z instead of `old`.
    pub fn beside(self, old: f64, origin: f64) -> Self {
        Self {
            gain: self.gain + old - origin,
            ..self
        }
    }

    /// Terms and evidence without the fit, which belongs to its twin.
    pub fn promised(&self) -> Found {
        Found {
            terms: self.terms.clone(),
            gain: self.gain,
            model: None,
        }
    }

    /// Keys of the terms.
    pub fn keys(&self) -> Vec<String> {
        self.terms.iter().map(|t| t.key()).collect()
    }

    /// The term that was added last.
    pub fn last(&self) -> &Arc<Term> {
        &self.terms[self.terms.len() - 1]
    }
}

/// Best first.
pub(in crate::diagnose) fn sort(all: &mut [Found]) {
    all.sort_by(|a, b| b.gain.total_cmp(&a.gain));
}

/// Fitted θ of the twin alone.
pub(in crate::diagnose) fn own_theta(found: &Found) -> Option<Vec<f64>> {
    let model = found.model.as_ref()?;
    let d = model.base.parameters().len();
    Some(model.theta()[..d].to_vec())
}

/// Those that were fitted, of fits from another θ: what those promise counts what θ gains on its way back.
pub(super) fn fitted(all: Vec<Found>) -> impl Iterator<Item = Found> {
    all.into_iter().filter(|found| found.model.is_some())
}

/// Takes the better ones of the same terms, and adds none; best first.
pub(super) fn improve(all: &mut [Found], others: impl IntoIterator<Item = Found>) {
    for found in others {
        let keys = found.keys();
        let own = all.iter_mut().find(|own| own.keys() == keys);
        if let Some(own) = own.filter(|own| own.gain < found.gain) {
            *own = found;
        }
    }
    sort(all);
}

/// Adds fitted pairs, of two of the same effects the better one; best first.
pub(super) fn keep(all: &mut Vec<Found>, found: Vec<Found>) {
    for pair in found.into_iter().filter(|f| f.model.is_some()) {
        let keys = pair.keys();
        let same = |p: &&mut Found| p.keys().iter().all(|k| keys.contains(k));
        match all.iter_mut().find(same) {
            Some(old) if old.gain >= pair.gain => {}
            Some(old) => *old = pair,
            None => all.push(pair),
        }
    }
    sort(all);
}
