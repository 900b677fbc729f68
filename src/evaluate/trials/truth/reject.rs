//! Draws that are given up.

use crate::evaluate::EvaluateError;

/// Reason for which a draw was given up.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Reject {
    Diverged,
    Still,
    NoFilter,
    NoLaw,
    TooWeak,
    TooAlike,
}

impl Reject {
    /// Returns what became of the draw, after its count.
    pub fn text(self) -> &'static str {
        match self {
            Self::Diverged => "diverged",
            Self::Still => "had an output that never moves",
            Self::NoFilter => "could not be filtered",
            Self::NoLaw => "had no law that could be made",
            Self::TooWeak => "did not show in the outputs, or diverged before they did",
            Self::TooAlike => "had two departures of which one explains or hides the other",
        }
    }
}

/// End of a draw without a truth: it was given up, or nothing can be drawn any more.
#[derive(Debug)]
pub(super) enum DrawEnd {
    Rejected(Reject),
    Failed(EvaluateError),
}

impl From<Reject> for DrawEnd {
    fn from(reject: Reject) -> Self {
        Self::Rejected(reject)
    }
}

impl<E: Into<EvaluateError>> From<E> for DrawEnd {
    fn from(error: E) -> Self {
        Self::Failed(error.into())
    }
}
