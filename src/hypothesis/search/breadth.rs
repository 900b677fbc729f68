//! Breadth of a search, and the evidence from which it becomes wider.

use super::model::Model;
use crate::hypothesis::limits::SEARCH;

/// Numbers of hypotheses that are refitted.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Breadth {
    /// Listed effects in the first round.
    pub listed: usize,
    /// Listed effects that are fitted from loud noise.
    pub annealed: usize,
    /// Functions; of those of an output, of the past and of time, half as many.
    pub functions: usize,
    /// Nats that a screened hypothesis must promise.
    pub least: f64,
    /// True where much is missing, so that fits begin with loud noise, too.
    pub deep: bool,
    /// True if fits of listed effects begin at the prior's centre, too.
    pub afresh: bool,
    /// True if pairs of effects are searched.
    pub pairs: bool,
}

impl Breadth {
    /// As many as a twin's likelihood allows: that of a black box costs an ensemble. Few for a quick look.
    pub fn of(model: &Model, quick: bool) -> Self {
        let few = model.problem.is_simulated() || quick;
        Self {
            listed: 6,
            annealed: if few { 0 } else { usize::MAX },
            functions: if few { 2 } else { SEARCH.functions },
            least: 2.5,
            deep: false,
            afresh: false,
            pairs: !quick,
        }
    }

    /// The same for a gap of so many nats, as unknown functions tell it.
    pub fn for_gap(self, nats: f64) -> Self {
        Self {
            deep: nats > SEARCH.deep && self.annealed > 0,
            ..self
        }
    }

    /// The same, fits from the prior's centre as well, where a likelihood is cheap.
    pub fn afresh(self) -> Self {
        Self {
            afresh: self.annealed > 0,
            ..self
        }
    }

    /// The same, every fit of every term where a likelihood is cheap.
    pub fn thorough(self) -> Self {
        Self {
            deep: self.annealed > 0,
            least: f64::NEG_INFINITY,
            ..self.afresh().of_all()
        }
    }

    /// The same, fewer functions: where it is known about what is missing.
    pub fn few(self) -> Self {
        Self {
            functions: SEARCH.few_functions.min(self.functions),
            ..self
        }
    }

    /// The same, every listed effect that promises something refitted.
    pub fn of_all(self) -> Self {
        Self {
            listed: usize::MAX,
            ..self
        }
    }
}
