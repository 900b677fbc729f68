//! The twin as it is, fitted: where a diagnosis begins.

use super::candidates;
use super::feedback::reacting;
use super::settings::{Ablation, DiagnoseSettings};
use super::step::OtherStep;
use crate::effect::{TargetKind, targets};
use crate::fit::climb::{climb, fit};
use crate::fit::problem::Problem;
use crate::fit::starts::growing::base_fit;
use crate::fit::starts::thorough;
use crate::fit::{ITERATIONS, Passes};
use crate::hypothesis::listed::Library;
use crate::hypothesis::scales::Scales;
use crate::hypothesis::search::SEARCH;
use crate::hypothesis::search::effects::searched;
use crate::hypothesis::search::frequencies::frequencies;
use crate::hypothesis::search::model::Model;
use crate::hypothesis::shared;
use crate::hypothesis::term::{Part, Term};
use crate::likelihood::measured;
use crate::math::descending;
use crate::record::Record;
use crate::study::{Study, StudyError};
use crate::twin::{Noise, Role, Twin};
use std::sync::Arc;

/// The fitted twin and the units of its records.
pub(in crate::diagnose) struct Base {
    pub model: Model,
    pub theta: Vec<f64>,
    pub scales: Scales,
    pub frequencies: Vec<f64>,
    /// Inputs that react to an output of the same row.
    pub reacting: Vec<usize>,
    /// Places whose noise level is fitted.
    pub noisy: Vec<String>,
    /// `true` for a black box without noise of its own.
    pub is_silent: bool,
    /// Kinds of noise that the records asked for.
    pub noises: Vec<Arc<Term>>,
    /// Nats of evidence that these kinds gained.
    pub noise_gain: f64,
    /// The finer step that the records asked for.
    pub step: Option<OtherStep>,
}

impl Base {
    /// Places of the kinds of noise that the records asked for.
    pub fn noise_at(&self, is_kind: impl Fn(&Part) -> bool) -> Vec<String> {
        (self.noises.iter())
            .filter(|term| is_kind(&term.part))
            .map(|term| term.target.clone())
            .collect()
    }

    /// Fits the twin of a study, or the same with another step; passes are added to these.
    pub fn new(
        study: &Study,
        twin: &Twin,
        records: Arc<[Record]>,
        settings: &DiagnoseSettings,
        passes: &Passes,
    ) -> Result<Self, StudyError> {
        let measured = measured(twin, &records, &settings.beliefs(study))?;
        let twin = &measured.twin;
        let space = twin.parameters();
        let own = space.len() - measured.levels.len();
        let initial = settings.initial.as_ref().map(|initial| {
            let levels = measured.levels.iter().map(|level| level.median);
            let theta: Vec<f64> = initial.iter().copied().take(own).chain(levels).collect();
            theta
        });
        let problem = Problem::of_measured(&measured, records.clone()).counted_with(passes);
        // The same starts whatever the seed: which optimum is found must not depend on it.
        let starts = Noise::new(0, "diagnose/starts", 0);
        let has_effects = space.iter().any(|p| p.role == Role::Magnitude);
        let fitted = if has_effects && !problem.is_simulated() {
            // As a fit of the study has them: the same starts, and the same ends of ranges that readings show.
            let effects = study.added_effects()?;
            let mut searched = searched(&measured, &effects, records, starts, passes)?;
            let problem = searched.problem;
            if let Some((theta, best)) = initial.as_ref().zip(searched.fits.first()) {
                let mut start = problem.clamp(&problem.full(theta));
                for j in (0..start.len()).filter(|&j| problem.axes[j].held) {
                    start[j] = best.theta[j];
                }
                searched.fits.extend(climb(&problem, &start, ITERATIONS)?);
            }
            descending(&mut searched.fits, |fit| fit.objective);
            let best = searched.fits.into_iter().next();
            best.map(|fitted| (problem, fitted))
        } else if !problem.is_simulated() {
            let initial: Vec<Vec<f64>> = initial.iter().map(|theta| problem.full(theta)).collect();
            let found = thorough(&problem, &initial, starts)?;
            found.into_iter().next().map(|fitted| (problem, fitted))
        } else {
            let problem = Problem::of_twin(twin, records).counted_with(passes);
            base_fit(&problem, initial.as_deref(), settings.noise())?
                .map(|fitted| (problem, fitted))
        };
        let (problem, fitted) = fitted.ok_or(StudyError::NO_FIT)?;
        let model = Model::bare(
            twin.clone(),
            problem,
            fitted,
            settings.lacks(Ablation::Evidence),
        )
        .ok_or(StudyError::NO_FIT)?;
        let outline = model.problem.outline();
        let outputs = &outline.outputs;
        let sensors = targets(TargetKind::Sensor, None, &twin.signals());
        let place = |name: &str| match outputs.iter().position(|o| o.name == name) {
            Some(j) => sensors[j].clone(),
            None => name.to_owned(),
        };
        let own = (space.iter()).filter(|parameter| parameter.role == Role::Noise);
        let following = measured.levels.iter().flat_map(|level| &level.following);
        let noisy = own
            .map(|parameter| place(parameter.target()))
            .chain(following.map(|level| level.state.clone()))
            .collect();
        Ok(Self {
            noisy,
            is_silent: measured.is_silent,
            ..Self::of(model)?
        })
    }

    /// The twin with another kind of noise, fitted.
    pub fn with_noise(&self, found: &Model) -> Result<Option<Self>, StudyError> {
        let Some(model) = Model::bare(
            found.problem.twin.clone(),
            found.problem.clone(),
            found.fitted.clone(),
            found.by_bic,
        ) else {
            return Ok(None);
        };
        let noises = self.noises.iter().chain(&found.terms).cloned().collect();
        let noise_gain = self.noise_gain + found.log_evidence - self.model.log_evidence;
        let base = self.carried_on(model, noises)?;
        Ok(Some(Base { noise_gain, ..base }))
    }

    /// The twin fitted again from other θ; `None` where that is no better.
    pub fn fitted_from(&self, thetas: &[Vec<f64>]) -> Result<Option<Base>, StudyError> {
        let problem = &self.model.problem;
        let starts: Vec<Vec<f64>> = thetas.iter().map(|theta| problem.full(theta)).collect();
        let fitted = fit(problem, &starts, ITERATIONS)?;
        let better = (fitted.and_then(|fitted| self.model.refitted(fitted)))
            .filter(|model| model.log_evidence > self.model.log_evidence + SEARCH.better);
        let Some(model) = better else {
            return Ok(None);
        };
        self.carried_on(model, self.noises.clone()).map(Some)
    }

    /// The same twin fitted to other records from where it is; `None` where that cannot be done.
    pub fn on(&self, records: Arc<[Record]>) -> Result<Option<Self>, StudyError> {
        let problem = self.model.problem.on(records).until(SEARCH.better);
        let start = problem.full(&self.theta);
        let fitted = climb(&problem, &start, ITERATIONS)?;
        let model = fitted.and_then(|fitted| {
            Model::bare(self.model.base.clone(), problem, fitted, self.model.by_bic)
        });
        (model.map(|model| self.carried_on(model, self.noises.clone()))).transpose()
    }

    /// The fitted twin with its units, as terms are made from it.
    pub fn library(&self) -> Library<'_> {
        Library {
            twin: &self.model.base,
            theta: &self.theta,
            scales: &self.scales,
            frequencies: &self.frequencies,
        }
    }

    /// Every listed effect that may be named.
    pub fn listed(
        &self,
        study: &Study,
        settings: &DiagnoseSettings,
    ) -> Result<Vec<Arc<Term>>, StudyError> {
        let terms = candidates::listed(study, &settings.without, &self.library(), &self.noisy)?;
        Ok(shared(terms))
    }

    /// The same records, places and step with another fitted model, and these kinds of noise.
    fn carried_on(&self, model: Model, noises: Vec<Arc<Term>>) -> Result<Base, StudyError> {
        Ok(Base {
            noisy: self.noisy.clone(),
            is_silent: self.is_silent,
            noises,
            noise_gain: self.noise_gain,
            step: self.step,
            ..Base::of(model)?
        })
    }

    /// A fitted model in units of its records, of which nothing else is known yet.
    fn of(model: Model) -> Result<Self, StudyError> {
        let theta = model.theta();
        let records = model.problem.records.clone();
        let seen = model.problem.states(&model.fitted.theta)?;
        let (filtered, states): (Vec<_>, Vec<_>) = seen.into_iter().unzip();
        Ok(Self {
            reacting: reacting(&filtered, &records),
            scales: Scales::new(&model.base, &theta, &model.problem, states),
            frequencies: frequencies(&model)?,
            noisy: vec![],
            is_silent: false,
            noises: vec![],
            noise_gain: 0.0,
            step: None,
            theta,
            model,
        })
    }
}

/// A model with its fit carried on to its end: the search stops where a hypothesis is known well enough to be compared.
pub(in crate::diagnose) fn finished(model: &Model) -> Result<Model, StudyError> {
    let fitted = climb(&model.problem, &model.fitted.theta, ITERATIONS)?;
    let finished = fitted.and_then(|fitted| model.refitted(fitted));
    Ok(finished.unwrap_or_else(|| model.clone()))
}
