//! Search for what explains the records: one map of explanations, and one loop that asks what is not known yet.
//!
//! ```text
//! stages    unknown functions ▸ listed effects ▸ kinds of noise ▸ what effects leave ▸ pairs      again from the start if the twin fits better
//! changes   the twin's own step | another kind of noise | a finer step | all rows      kept where log Z of all hypotheses together rises
//! rest      what the best sets leave, once the twin stays as it is
//! ```
//!
//! | file | holds |
//! |---|---|
//! | `explanations.rs` | the map, and lists as queries of it |
//! | `agenda.rs` | the next question of each stage |
//! | `change.rs` | changes that the records ask for |
//! | `evidence.rs` | the interface to the records: questions and answers |
//! | `setup.rs` | that interface over the engine of hypotheses |
//! | `carry.rs` | explanations carried on to another step or to all rows |
//! | `budget.rs` | numbers of rows, sets, starts |

mod agenda;
mod budget;
mod carry;
mod change;
mod evidence;
mod explanations;
mod setup;

use self::agenda::{Begin, Stage};
use self::budget::{BUDGET, Budget};
use self::evidence::{Change, Evidence, Purpose};
use super::settings::DiagnoseSettings;
use super::thresholds::THRESHOLDS;
use crate::fit::Passes;
use crate::hypothesis::set::TermSet;
use crate::progress::Progress;
use crate::record::Record;
use crate::study::{Study, StudyError};
use std::collections::BTreeSet;

pub(in crate::diagnose) use explanations::Explanations;
pub(in crate::diagnose) use setup::Setup;

/// Stages of a search for one twin.
const STAGES: [Stage; 5] = [
    Stage::Functions,
    Stage::Effects,
    Stage::Noise,
    Stage::Remains,
    Stage::Pairs,
];

/// A search: the twin and the records, and everything that is known of them.
pub(in crate::diagnose) struct Search<E> {
    pub evidence: E,
    pub known: Explanations,
    /// True where the search was cancelled: what is known is all that was found until then.
    pub is_partial: bool,
    begin: Begin,
    asked: BTreeSet<(Purpose, TermSet)>,
    refused: Vec<Change>,
    /// False where the twin was given a finer step before anything was searched with its own.
    is_own_step_searched: bool,
    /// log Z of the explanations from which the twin was fitted again last, to no avail.
    tried: Vec<f64>,
    budget: Budget,
    detection_only: bool,
}

/// Settings of a search and its progress.
#[derive(Clone, Copy)]
pub(in crate::diagnose) struct Watch<'w> {
    pub settings: &'w DiagnoseSettings,
    pub progress: &'w Progress,
}

impl Watch<'_> {
    /// Returns whether an answer is there; not where the work was stopped and the search ends with what it found before.
    fn is_there(&self, answer: Result<(), StudyError>, is_known: bool) -> Result<bool, StudyError> {
        match answer {
            Err(StudyError::Cancelled(_)) if self.settings.give_partial && is_known => Ok(false),
            answer => answer.map(|()| true),
        }
    }
}

/// Fits the twin of a study, and searches for what explains the records beside it.
pub(in crate::diagnose) fn searched<'s>(
    study: &'s Study,
    records: &[Record],
    watch: Watch<'s>,
) -> Result<Search<Setup<'s>>, StudyError> {
    let stage = watch.progress.stage("fit", 1);
    let budget = BUDGET;
    let passes = Passes::heard_by(watch.progress);
    let setup = Setup::new(study, records.into(), watch.settings, &budget, passes)?;
    stage.tick()?;
    search(setup, budget, watch)
}

/// Searches with one twin, then with each change that the records ask for, and keeps those that raise log Z.
fn search<E: Evidence>(
    evidence: E,
    budget: Budget,
    watch: Watch<'_>,
) -> Result<Search<E>, StudyError> {
    let mut best = Search::new(evidence, budget, watch).settled(watch)?;
    while let Some(change) = best.asks_for_rows() {
        let next = best.with(&change, watch).and_then(|next| match next {
            Some(all) if change == Change::AllRows => all.ended(best.is_partial, watch).map(Some),
            Some(more) => more.settled(watch).map(Some),
            None => Ok(None),
        });
        match next {
            Ok(Some(next)) => best = next,
            Ok(None) => best.refused.push(change),
            Err(StudyError::Cancelled(_)) if watch.settings.give_partial => {
                best.is_partial = true;
                break;
            }
            Err(error) => return Err(error),
        }
    }
    Ok(best)
}

impl<E: Evidence> Search<E> {
    fn new(evidence: E, budget: Budget, watch: Watch<'_>) -> Self {
        Self {
            known: Explanations::new(evidence.twin()),
            is_own_step_searched: evidence.has_own_step(),
            evidence,
            is_partial: false,
            begin: Begin::Afresh,
            asked: BTreeSet::new(),
            refused: vec![],
            tried: vec![],
            budget,
            detection_only: watch.settings.detection_only,
        }
    }

    /// Searches these rows until they ask for no change, and then for what the best sets leave.
    fn settled(self, watch: Watch<'_>) -> Result<Self, StudyError> {
        let mut best = self.run(watch)?;
        while let Some(change) = best.asked_for(watch)? {
            let next = match best.with(&change, watch) {
                Ok(Some(next)) => next.run(watch),
                Ok(None) => Err(StudyError::NO_FIT),
                Err(error) => Err(error),
            };
            match next {
                Ok(next) if best.is_beaten_by(&next, &change) => best = next,
                // A twin that its own step holds together may go nowhere with a finer one.
                Ok(_) | Err(StudyError::NoFit { .. }) => {
                    best.refused.push(change);
                    best = best.run(watch)?;
                }
                Err(StudyError::Cancelled(_)) if watch.settings.give_partial => {
                    best.is_partial = true;
                }
                Err(error) => return Err(error),
            }
        }
        best.finish(watch)
    }

    /// As [`asks_for`](Self::asks_for); a search that is stopped meanwhile asks for nothing.
    fn asked_for(&mut self, watch: Watch<'_>) -> Result<Option<Change>, StudyError> {
        let mut change = None;
        let asked = self.asks_for().map(|asked| change = asked);
        self.is_partial |= !watch.is_there(asked, true)?;
        Ok(change)
    }

    /// Asks all stages, again from the start where the twin fits better from θ of an explanation than from its own.
    fn run(mut self, watch: Watch<'_>) -> Result<Self, StudyError> {
        let mut progress = watch.progress.stage("explain", STAGES.len());
        let mut stages = STAGES.into_iter();
        while let Some(stage) = stages.next().filter(|_| !self.is_partial) {
            let asked = self.ask_all(stage);
            let asked = asked.and_then(|()| Ok(progress.tick()?));
            let is_known = !self.known.listed().is_empty();
            self.is_partial = !watch.is_there(asked, is_known)?;
            let may_be_better = matches!(stage, Stage::Effects | Stage::Pairs);
            if may_be_better && !self.is_partial && self.fits_better(watch)? {
                progress = watch.progress.stage("explain", STAGES.len());
                stages = STAGES.into_iter();
            }
        }
        progress.finish();
        Ok(self)
    }

    /// As [`fit_again`](Self::fit_again); a search that is stopped meanwhile stays as it is.
    fn fits_better(&mut self, watch: Watch<'_>) -> Result<bool, StudyError> {
        let mut is_better = false;
        let fitted = self.fit_again().map(|better| is_better = better);
        self.is_partial = !watch.is_there(fitted, true)?;
        Ok(is_better)
    }

    /// The search whose explanations are carried on to all rows: nothing more is asked.
    fn ended(self, is_partial: bool, watch: Watch<'_>) -> Result<Self, StudyError> {
        let progress = watch.progress.stage("all rows", 1);
        let is_cancelled = watch.settings.ends(progress.tick())?;
        Ok(Self {
            is_partial: is_partial || is_cancelled,
            ..self
        })
    }

    /// Asks what the best sets leave.
    fn finish(mut self, watch: Watch<'_>) -> Result<Self, StudyError> {
        if !self.is_partial && self.next(Stage::Rest).is_some() {
            let progress = watch.progress.stage("what is left", 1);
            let asked = self.ask_all(Stage::Rest);
            let asked = asked.and_then(|()| Ok(progress.tick()?));
            self.is_partial = !watch.is_there(asked, true)?;
        }
        Ok(self)
    }

    fn ask_all(&mut self, stage: Stage) -> Result<(), StudyError> {
        while let Some(question) = self.next(stage) {
            let answer = self.evidence.answer(&question, &self.known)?;
            let (purpose, beside) = (question.purpose, question.beside);
            match answer {
                Some(found) if purpose == Purpose::Remains => {
                    self.known.extend(beside.clone(), found);
                }
                found => (found.into_iter().flatten()).for_each(|e| self.known.add(e)),
            }
            self.asked.insert((purpose, beside));
        }
        Ok(())
    }

    /// Fits the twin again from θ of the best explanations, beside which it may have gone further; returns whether that is better.
    fn fit_again(&mut self) -> Result<bool, StudyError> {
        let starts = self.known.starts(self.budget.starts);
        let tried: Vec<f64> = starts.iter().map(|e| e.log_z).collect();
        if tried == self.tried {
            return Ok(false);
        }
        let Some(evidence) = self.evidence.fitted_from(&starts)? else {
            self.tried = tried;
            return Ok(false);
        };
        self.known.set_twin(evidence.twin());
        self.evidence = evidence;
        self.begin = Begin::WithFits;
        self.asked.clear();
        Ok(true)
    }

    /// The search with a change of the twin or the records, and what is carried on to it; `None` where the twin cannot be fitted.
    fn with(&self, change: &Change, watch: Watch<'_>) -> Result<Option<Self>, StudyError> {
        let Some(evidence) = self.evidence.changed(change, &self.known)? else {
            return Ok(None);
        };
        let mut next = Self::new(evidence, self.budget.clone(), watch);
        if *change != Change::MoreRows {
            next.is_own_step_searched |= self.is_own_step_searched;
        }
        if change.carries() {
            next.known = self.carried(&next.evidence)?;
            next.begin = Begin::Carried;
        }
        Ok(Some(next))
    }

    /// Returns whether all hypotheses together are likelier with a change. Where explanations were carried on to it, those alone count that
    /// both searches have weighed: functions beside a set are asked again only once the change is kept.
    fn is_beaten_by(&self, next: &Self, change: &Change) -> bool {
        let [own, other] = match change.carries() {
            true => [
                self.known.among(&next.known).log_z(),
                next.known.among(&self.known).log_z(),
            ],
            false => [self.known.log_z(), next.known.log_z()],
        };
        other > own + change.least_gain()
    }

    /// Returns whether something is missing.
    fn is_gap(&self) -> bool {
        self.known.posterior().log_odds > THRESHOLDS.gap
    }
}

#[cfg(test)]
mod tests;
