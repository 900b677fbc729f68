//! Evidence of explanations from the engine of hypotheses.

use super::budget::Budget;
use super::evidence::{Change, Evidence, Purpose, Question};
use super::explanations::{Class, Explanations};
use crate::diagnose::base::Base;
use crate::diagnose::candidates;
use crate::diagnose::feedback::explains_noise;
use crate::diagnose::prior::inside;
use crate::diagnose::settings::{Ablation, DiagnoseSettings};
use crate::diagnose::step::{OtherStep, other_step};
use crate::diagnose::thresholds::THRESHOLDS;
use crate::fit::Passes;
use crate::hypothesis::noise::kinds;
use crate::hypothesis::scales::Scales;
use crate::hypothesis::search::explanation::Explanation;
use crate::hypothesis::search::model::Model;
use crate::hypothesis::search::{Before, Breadth, listed, unknown as functions};
use crate::hypothesis::shared;
use crate::hypothesis::term::Term;
use crate::hypothesis::unknown::unknown;
use crate::parallel::try_each;
use crate::record::Record;
use crate::study::{Study, StudyError};
use std::collections::BTreeSet;
use std::sync::Arc;

/// A study, all its records, and the settings of a search.
#[derive(Clone)]
struct Task<'s> {
    study: &'s Study,
    settings: &'s DiagnoseSettings,
    budget: Budget,
    records: Arc<[Record]>,
    /// Number of rows that the search sees, where it does not see all.
    searched: Option<usize>,
    passes: Passes,
}

/// A fitted twin, and the terms that are looked for beside it.
pub(in crate::diagnose) struct Setup<'s> {
    task: Task<'s>,
    pub base: Base,
    pub listed: Vec<Arc<Term>>,
    noise: Vec<Arc<Term>>,
    /// The twin with θ inside its prior, if its fit has left that.
    inside: Option<Model>,
}

impl<'s> Setup<'s> {
    /// Fits the twin to the records, to their first rows where they are long, with a finer step where the records ask for it at once; passes
    /// are added to these.
    pub fn new(
        study: &'s Study,
        records: Arc<[Record]>,
        settings: &'s DiagnoseSettings,
        budget: &Budget,
        passes: Passes,
    ) -> Result<Self, StudyError> {
        let task = Task {
            study,
            settings,
            budget: budget.clone(),
            records,
            searched: None,
            passes,
        };
        let is_long = task.rows() >= budget.long_rows && study.twin().outline().is_some();
        task.setup(if is_long {
            budget.first_rows
        } else {
            task.rows()
        })
    }

    /// Number of rows that the search saw, where it did not see all.
    pub fn searched(&self) -> Option<usize> {
        self.task.searched
    }
}

impl<'s> Task<'s> {
    /// Rows of all records together.
    fn rows(&self) -> usize {
        self.records.iter().map(Record::samples).sum()
    }

    /// Fits the twin to so many first rows, or to more where nothing moves in them yet.
    fn setup(&self, rows: usize) -> Result<Setup<'s>, StudyError> {
        let all = self.rows();
        let part = (self.budget.more_rows * rows <= all).then(|| self.first_rows(rows));
        let seeing = |searched| Self {
            searched,
            ..self.clone()
        };
        let Some(part) = part.flatten() else {
            return seeing(None).fitted(self.records.clone());
        };
        match seeing(Some(rows)).fitted(part) {
            Err(StudyError::NoFit { .. }) => self.setup(self.budget.more_rows * rows),
            other => other,
        }
    }

    /// The same share of each record, so many rows in all; `None` where an output has no value in them.
    fn first_rows(&self, rows: usize) -> Option<Arc<[Record]>> {
        let all = self.rows();
        (self.records.iter())
            .map(|record| record.first_part((record.samples() * rows).div_ceil(all)))
            .collect()
    }

    /// The twin of the study with its own step, fitted.
    fn own(&self, records: Arc<[Record]>) -> Result<Base, StudyError> {
        let twin = self.study.twin();
        Base::new(self.study, twin, records, self.settings, &self.passes)
    }

    fn fitted(&self, records: Arc<[Record]>) -> Result<Setup<'s>, StudyError> {
        let base = self.own(records)?;
        match self.step_at_once(&base)? {
            Some(step) => self.with_step(&base, step, &[]),
            None => self.with_base(base),
        }
    }

    /// The finer step that the records ask for beside the twin alone. A gap may pass for one: an effect that is more probable, as one of all
    /// that are listed, is asked first.
    fn step_at_once(&self, base: &Base) -> Result<Option<OtherStep>, StudyError> {
        let (model, least) = (&base.model, THRESHOLDS.step_shows);
        let asks_hold = self.study.asks_hold();
        let Some((step, gain)) = other_step(model, (least, 0.0), asks_hold)? else {
            return Ok(None);
        };
        let terms = base.listed(self.study, self.settings)?;
        let breadth = Breadth {
            listed: self.budget.starts,
            ..Breadth::of(model, self.settings.quick)
        };
        let effects = listed(model, &terms, Before::default(), breadth)?;
        let price = (effects.len() as f64 / THRESHOLDS.listed).ln();
        let best = (effects.first()).filter(|e| e.log_z - model.log_evidence - price > gain);
        match best.and_then(|effect| effect.model.as_ref()) {
            Some(beside) => Ok(other_step(beside, (least, 0.0), asks_hold)?.map(|(step, _)| step)),
            None => Ok(Some(step)),
        }
    }

    /// The twin of the study with a finer step, fitted from where another one is and from these θ.
    fn with_step(
        &self,
        base: &Base,
        step: OtherStep,
        thetas: &[Vec<f64>],
    ) -> Result<Setup<'s>, StudyError> {
        let own = self.study.twin();
        let twin = step.of(own).unwrap_or_else(|| own.clone());
        let begin = DiagnoseSettings {
            initial: Some(base.theta.clone()),
            ..self.settings.clone()
        };
        let records = base.model.problem.records.clone();
        let base = Base {
            step: Some(step),
            ..Base::new(self.study, &twin, records, &begin, &self.passes)?
        };
        let better = base.fitted_from(thetas)?;
        self.with_base(better.unwrap_or(base))
    }

    fn with_base(&self, base: Base) -> Result<Setup<'s>, StudyError> {
        let listed = base.listed(self.study, self.settings)?;
        let mut noise = vec![];
        if base.noises.len() < self.budget.kinds_of_noise {
            let outliers = candidates::outliers(self.study, &self.settings.without);
            noise = shared(kinds(&outliers, &base.library(), &base.noisy)?);
            noise.retain(|term| !base.noises.iter().any(|own| own.key() == term.key()));
        }
        Ok(Setup {
            task: self.clone(),
            inside: inside(&base.model)?,
            base,
            listed,
            noise,
        })
    }
}

impl<'s> Setup<'s> {
    /// Unknown functions that a question is about, over the states of the twin and of the models that it names.
    fn functions(
        &self,
        question: &Question,
        known: &Explanations,
    ) -> Result<Vec<Arc<Term>>, StudyError> {
        if self.task.settings.lacks(Ablation::UnknownFunctions) {
            return Ok(vec![]);
        }
        let models = question.from.iter().filter_map(|set| known.model(set));
        let seen = models.map(states).collect::<Result<Vec<_>, _>>()?;
        let mut all = unknown(&self.base.library(), &seen);
        all.retain(|term| !explains_noise(term, &self.base.reacting));
        Ok(chosen(shared(all), question))
    }

    /// The same from the twin with θ inside its prior: what those promise that are not fitted counts what θ gains on its way back.
    fn answer_inside(
        &self,
        question: &Question,
        terms: &[Arc<Term>],
    ) -> Result<Vec<Explanation>, StudyError> {
        let Some(inside) = &self.inside else {
            return Ok(vec![]);
        };
        let breadth = question.breadth;
        let mut found = match question.purpose {
            Purpose::Functions => functions(inside, terms, breadth.few())?,
            Purpose::Effects | Purpose::AllEffects => {
                let afresh = false;
                listed(
                    inside,
                    terms,
                    Before::default(),
                    Breadth { afresh, ..breadth },
                )?
            }
            _ => vec![],
        };
        found.retain(|e| e.model.is_some());
        Ok(found)
    }

    /// Returns whether the twin or one of the best explanations, each carried on with a finer step, is likelier than all are with their own.
    fn helps(&self, step: OtherStep, known: &Explanations) -> Result<bool, StudyError> {
        let Some(twin) = step.of(&self.base.model.base) else {
            return Ok(false);
        };
        let trials = |all: Vec<&Explanation>| -> Vec<Model> {
            let models = all.into_iter().filter_map(|e| e.model.clone());
            models.take(self.task.budget.step_trials).collect()
        };
        let mut models = vec![self.base.model.clone()];
        for all in [known.listed(), known.unknown(), known.pairs()] {
            models.extend(trials(all));
        }
        let own = models.iter().map(|model| model.log_evidence);
        let least = own.fold(f64::NEG_INFINITY, f64::max);
        let is_likelier = try_each(models, |model| {
            let problem = model.problem_of(&twin)?;
            let finer = Model { problem, ..model }.carried_on()?;
            Ok::<_, StudyError>(finer.is_some_and(|finer| finer.log_evidence > least))
        })?;
        Ok(is_likelier.contains(&true))
    }
}

impl Evidence for Setup<'_> {
    fn twin(&self) -> Explanation {
        Explanation::of(self.base.model.clone())
    }

    fn answer(
        &self,
        question: &Question,
        known: &Explanations,
    ) -> Result<Option<Vec<Explanation>>, StudyError> {
        let Some(model) = known.model(&question.beside) else {
            return Ok(None);
        };
        let (class, breadth) = (question.class(), question.breadth);
        let terms = match class {
            Class::Unknown => self.functions(question, known)?,
            Class::Listed => chosen(self.listed.clone(), question),
            Class::Noise => chosen(self.noise.clone(), question),
        };
        let mut found = match class {
            Class::Unknown => functions(model, &terms, breadth)?,
            Class::Listed => listed(model, &terms, before(question, &terms, known), breadth)?,
            Class::Noise => listed(model, &terms, Before::default(), breadth)?,
        };
        if matches!(
            question.purpose,
            Purpose::Pairs | Purpose::RivalPairs | Purpose::WiderFunctions
        ) {
            found.retain(|e| e.model.is_some());
        }
        found.extend(self.answer_inside(question, &terms)?);
        Ok(Some(found))
    }

    fn fitted_from(&self, explanations: &[&Explanation]) -> Result<Option<Self>, StudyError> {
        let thetas: Vec<Vec<f64>> = explanations.iter().filter_map(|e| e.own_theta()).collect();
        let better = self.base.fitted_from(&thetas)?;
        better.map(|base| self.task.with_base(base)).transpose()
    }

    fn changed(&self, change: &Change, known: &Explanations) -> Result<Option<Self>, StudyError> {
        let base = match change {
            Change::MoreRows => {
                let rows = self.task.budget.more_rows * self.rows().0;
                return self.task.setup(rows).map(Some);
            }
            Change::Step { step, .. } => {
                let best = known.starts(self.task.budget.starts);
                let thetas: Vec<Vec<f64>> = best.iter().filter_map(|e| e.own_theta()).collect();
                return self.task.with_step(&self.base, *step, &thetas).map(Some);
            }
            Change::OwnStep => Some(self.task.own(self.base.model.problem.records.clone())?),
            Change::Noise(set) => match known.model(set) {
                Some(model) => self.base.with_noise(model)?,
                None => None,
            },
            Change::AllRows => self.base.on(self.task.records.clone())?,
        };
        base.map(|base| self.task.with_base(base)).transpose()
    }

    fn carried(&self, other: &Explanation) -> Result<Option<Explanation>, StudyError> {
        let Some(old) = &other.model else {
            return Ok(None);
        };
        let new = old.beside_twin(&self.base.model)?;
        Ok(new.map(|new| Explanation {
            terms: other.terms.clone(),
            log_z: other.log_z + new.log_evidence - old.log_evidence,
            model: Some(new),
        }))
    }

    fn finer_step(
        &self,
        beside: &Explanation,
        known: &Explanations,
    ) -> Result<Option<(OtherStep, f64)>, StudyError> {
        let Some(model) = &beside.model else {
            return Ok(None);
        };
        let top = known.top();
        let is_twin = beside.terms.is_empty();
        let least = match is_twin {
            true => THRESHOLDS.step_shows.max(THRESHOLDS.fine_print * top),
            false => THRESHOLDS.step_shows,
        };
        let asks_hold = self.task.study.asks_hold();
        let finer = other_step(model, (least, top), asks_hold)?;
        let finer = finer.filter(|(step, _)| self.base.step != Some(*step));
        match finer {
            Some((step, _)) if is_twin && !self.helps(step, known)? => Ok(None),
            finer => Ok(finer),
        }
    }

    fn breadth(&self) -> Breadth {
        Breadth::of(&self.base.model, self.task.settings.quick)
    }

    fn rows(&self) -> (usize, usize) {
        let seen = self.base.model.problem.samples();
        (seen, self.task.rows())
    }

    fn has_own_step(&self) -> bool {
        self.base.step.is_none()
    }

    fn has_own_noise(&self) -> bool {
        self.base.noises.is_empty()
    }
}

/// Knowledge that bears on a question: θ of the sets that it names, and fits of its own terms.
fn before(question: &Question, terms: &[Arc<Term>], known: &Explanations) -> Before {
    let keys: BTreeSet<String> = terms.iter().map(|term| term.key()).collect();
    let fit = |key: String| {
        let own = question.beside.iter().map(str::to_owned);
        let found = known.get(&own.chain([key.clone()]).collect())?;
        (found.last().key() == key).then(|| found.model.clone())?
    };
    Before {
        thetas: (question.from.iter())
            .filter_map(|set| known.get(set)?.own_theta())
            .collect(),
        fits: keys.into_iter().filter_map(fit).collect(),
    }
}

/// The terms that a question is about, in every way that they may be used: a hypothesis pays for all its ways.
fn chosen(mut terms: Vec<Arc<Term>>, question: &Question) -> Vec<Arc<Term>> {
    terms.retain(|term| {
        let key = term.key();
        let is_asked = question
            .only
            .as_ref()
            .is_none_or(|only| only.contains(&key));
        is_asked && !question.beside.iter().any(|own| own == key)
    });
    terms
}

/// Sizes of the states along a fitted model.
fn states(model: &Model) -> Result<Scales, StudyError> {
    Ok(Scales {
        records: model.problem.records.clone(),
        states: model.states()?,
        before: vec![],
        outline: model.problem.outline(),
        rates: vec![],
        defined: vec![],
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::fixture::{record, tanks};
    use crate::diagnose::search::budget::BUDGET;
    use crate::diagnose::search::{Watch, search};
    use crate::progress::Progress;

    /// Where the first rows show no clear gap, all rows are searched.
    #[test]
    fn no_gap_is_told_of_all_rows() {
        let budget = Budget {
            long_rows: 1024,
            first_rows: 256,
            ..BUDGET
        };
        let study = tanks(budget.long_rows);
        let theta = study.twin().parameters().centre();
        let records = Arc::from([record(&study, study.twin(), &theta, 3)]);
        let settings = DiagnoseSettings {
            detection_only: true,
            ..DiagnoseSettings::default()
        };
        let setup = Setup::new(&study, records, &settings, &budget, Passes::default()).unwrap();
        let progress = &Progress::silent();
        let watch = Watch {
            settings: &settings,
            progress,
        };
        let found = search(setup, budget, watch).unwrap();
        assert_eq!(found.evidence.searched(), None);
        assert!(found.known.posterior().log_odds < 3.0);
    }
}
