//! Interface between a search and the records: questions, changes of the twin, answers.

use super::explanations::{Class, Explanations};
use crate::diagnose::step::OtherStep;
use crate::diagnose::thresholds::THRESHOLDS;
use crate::hypothesis::search::Breadth;
use crate::hypothesis::search::explanation::Explanation;
use crate::hypothesis::set::TermSet;
use crate::study::StudyError;

/// Purpose of a question; each is asked once beside a set.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(in crate::diagnose) enum Purpose {
    /// Unknown functions alone.
    Functions,
    /// Listed effects alone.
    Effects,
    /// All listed effects alone, where one explains what no function does.
    AllEffects,
    /// Functions of the range that the corrected twin goes through, which the misfitted one may not.
    WiderFunctions,
    /// Other kinds of noise alone.
    Noise,
    /// A second kind of noise.
    NoisePairs,
    /// Outliers beside the best effect.
    Outliers,
    /// Unknown functions beside a set.
    Remains,
    /// A second effect beside one.
    Pairs,
    /// The second effect of the best pair beside rivals of the first.
    RivalPairs,
    /// The effects of the best pair alone, from where that ended: the fits alone may have stopped early.
    Singles,
    /// Noise in the place of the second effect of a pair.
    NoiseInstead,
    /// A finer step beside a set.
    Step,
}

/// A question: how well do a set's explanations with one more term do?
#[derive(Debug, Clone)]
pub(in crate::diagnose) struct Question {
    pub purpose: Purpose,
    pub beside: TermSet,
    /// Keys of the terms that are asked about; all of the class if `None`.
    pub only: Option<Vec<String>>,
    /// Sets from whose θ fits begin as well, and whose states functions must cover.
    pub from: Vec<TermSet>,
    pub breadth: Breadth,
}

impl Question {
    /// The question about these terms alone.
    pub fn only(self, keys: Vec<String>) -> Self {
        let only = Some(keys);
        Self { only, ..self }
    }

    /// The question with fits from θ of these sets as well.
    pub fn from(self, from: Vec<TermSet>) -> Self {
        Self { from, ..self }
    }

    /// The question with another effort.
    pub fn with(self, change: impl FnOnce(Breadth) -> Breadth) -> Self {
        let breadth = change(self.breadth);
        Self { breadth, ..self }
    }

    /// Class of the terms that are added.
    pub fn class(&self) -> Class {
        use Purpose::*;
        match self.purpose {
            Functions | WiderFunctions | Remains => Class::Unknown,
            Effects | AllEffects | Pairs | RivalPairs | Singles | Step => Class::Listed,
            Noise | NoisePairs | Outliers | NoiseInstead => Class::Noise,
        }
    }
}

/// A change of the twin, or of the rows that are seen.
#[derive(Debug, Clone, PartialEq)]
pub(in crate::diagnose) enum Change {
    /// Another kind of noise in the place of the twin's own.
    Noise(TermSet),
    /// The twin's own step, where a search began with a finer one.
    OwnStep,
    /// A finer step.
    Step {
        step: OtherStep,
        /// True where it matters little beside what was found: explanations are carried on.
        is_minor: bool,
    },
    /// All rows: explanations are carried on.
    AllRows,
    /// More of the first rows.
    MoreRows,
}

impl Change {
    /// Nats by which the change must raise log Z of all hypotheses together.
    pub fn least_gain(&self) -> f64 {
        match self {
            Self::Noise(_) => 0.0,
            Self::Step { .. } => THRESHOLDS.step_wins,
            Self::OwnStep => -THRESHOLDS.step_wins,
            // Of other records.
            Self::AllRows | Self::MoreRows => f64::NEG_INFINITY,
        }
    }

    /// Returns whether explanations are carried on.
    pub fn carries(&self) -> bool {
        matches!(self, Self::AllRows | Self::Step { is_minor: true, .. })
    }
}

/// Evidence of explanations, for one twin and some records.
pub(in crate::diagnose) trait Evidence: Sized + Sync {
    /// The twin alone, fitted.
    fn twin(&self) -> Explanation;

    /// Explanations of a set by one more term; `None` where the set has no fit to begin with.
    fn answer(
        &self,
        question: &Question,
        known: &Explanations,
    ) -> Result<Option<Vec<Explanation>>, StudyError>;

    /// The twin fitted again from θ of these explanations, where that is better.
    fn fitted_from(&self, explanations: &[&Explanation]) -> Result<Option<Self>, StudyError>;

    /// The twin with a change, fitted; `None` where it cannot be fitted.
    fn changed(&self, change: &Change, known: &Explanations) -> Result<Option<Self>, StudyError>;

    /// An explanation of another twin or fewer records, fitted on from where it is.
    fn carried(&self, other: &Explanation) -> Result<Option<Explanation>, StudyError>;

    /// The finer step that the records ask for beside an explanation, and the nats that it adds there.
    fn finer_step(
        &self,
        beside: &Explanation,
        known: &Explanations,
    ) -> Result<Option<(OtherStep, f64)>, StudyError>;

    /// Effort with which the search begins.
    fn breadth(&self) -> Breadth;

    /// Rows that are seen, and all rows.
    fn rows(&self) -> (usize, usize);

    /// Returns whether the twin has the step of the study.
    fn has_own_step(&self) -> bool;

    /// Returns whether the twin has its own kind of noise.
    fn has_own_noise(&self) -> bool;
}
