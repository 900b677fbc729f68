//! Draws truths and their records.

use super::Truth;
use super::imitators::Listed;
use super::imitators::{Imitators, rival};
use super::prior::{conditions, has_room, nuisances, theta};
use super::sizing::Experiment;
use super::{DrawEnd, Reject};
use crate::evaluate::EvaluateError;
use crate::evaluate::trials::draft::{Draft, index};
use crate::evaluate::trials::listed::{LawForm, Variant};
use crate::evaluate::trials::numbers::TRIAL;
use crate::evaluate::trials::places::Structure;
use crate::evaluate::trials::places::TwinPlaces;
use crate::evaluate::trials::scene::Scene;
use crate::evaluate::trials::world::{Conditions, RecordNoise, System, equations, run};
use crate::evaluate::trials::{Families, Kind, NuisanceKind};
use crate::record::{Drive, Record, Signal};
use crate::study::{DriveSource, Study};
use crate::twin::{Noise, ParameterSpace, Source};
use std::collections::BTreeMap;

/// Least and largest expected information that is asked for, in nats.
const INFORMATION: [f64; 2] = [1.0, 300.0];

/// A truth with its records.
pub(in crate::evaluate::trials) struct Drawn {
    pub truth: Truth,
    pub record: Record,
    pub validation: Option<Record>,
    /// The same system, twice as long; none where steps vary.
    pub doubled: Option<Record>,
}

/// Inputs and gaps of records.
enum Plan {
    Study(DriveSource),
    /// Those of a measured record.
    Like(Record),
}

/// Records that a trial has beside its own.
#[derive(Debug, Clone, Copy, Default)]
pub(in crate::evaluate::trials) struct Extra {
    pub validation: bool,
    pub doubled: bool,
}

/// Source of truths and their records.
pub(in crate::evaluate::trials) struct TruthSampler<'a> {
    study: &'a Study,
    places: TwinPlaces,
    space: ParameterSpace,
    plan: Plan,
    listed: Vec<Listed>,
    families: Families,
    /// Those of which each record has one; half of the records have one of all where there are none.
    nuisances: Vec<NuisanceKind>,
    is_silent: bool,
}

impl<'a> TruthSampler<'a> {
    /// Creates a sampler over the study's own twin; inputs and gaps are those of `like`, or else the study's plan.
    pub fn new(
        study: &'a Study,
        (families, nuisances): (Families, Vec<NuisanceKind>),
        like: Option<&Record>,
    ) -> Result<Self, EvaluateError> {
        let twin = study.twin();
        let places = TwinPlaces::new(twin);
        let plan = match like {
            Some(record) => {
                record.check_channels(&twin.signals())?;
                Plan::Like(record.clone())
            }
            None => Plan::Study(study.drives()?),
        };
        let mut sampler = Self {
            study,
            space: twin.parameters(),
            listed: Listed::all(study, &places),
            places,
            plan,
            families,
            nuisances,
            is_silent: false,
        };
        sampler.is_silent = sampler.finds_silence()?;
        Ok(sampler)
    }

    /// Returns true if two records of different noise are the same.
    fn finds_silence(&self) -> Result<bool, EvaluateError> {
        let conditions = Conditions::declared();
        let theta = self.space.centre();
        let system = System::new(&theta, &conditions);
        let noise = Noise::new(1, "silence", 0);
        let drive = self.drive(noise)?;
        let outputs = |i: u64| {
            let draws = RecordNoise::of(noise.sample(i));
            Some(run(self.study.twin(), system, &drive, draws)?.outputs)
        };
        Ok(matches!((outputs(0), outputs(1)), (Some(a), Some(b)) if a == b))
    }

    /// Checks that a truth of this kind can be drawn.
    pub fn check(&self, kind: Kind) -> Result<(), EvaluateError> {
        let first = self.listed.first().map(|listed| listed.place);
        let is_at_one_place = self.listed.iter().all(|l| Some(l.place) == first);
        let reason = match kind {
            _ if kind.is_outside() && !has_room(&self.space) => {
                "the bounds leave no room outside the prior; widen them"
            }
            _ if kind.is_random() && self.places.all().next().is_none() => {
                "the twin has no place for one"
            }
            Kind::None | Kind::Outside | Kind::Random | Kind::Memory => return Ok(()),
            _ if first.is_none() => {
                "the library leaves no effect that trials can make; allow more effects"
            }
            Kind::Pair if is_at_one_place => {
                "the library leaves effects at one place only; allow more effects"
            }
            _ => return Ok(()),
        };
        let kind = kind.id();
        Err(EvaluateError::NoDeparture { kind, reason })
    }

    /// Draws trial number `trial`: the same for the same noise.
    pub fn draw(
        &self,
        trial: usize,
        kind: Kind,
        extra: Extra,
        noise: Noise,
    ) -> Result<Drawn, EvaluateError> {
        let mut rejected: BTreeMap<Reject, u64> = BTreeMap::new();
        for redraws in 0..TRIAL.truth_attempts {
            let noise = noise.child("attempt").sample(redraws);
            match self.attempt(trial, kind, extra, noise) {
                Ok(mut drawn) => {
                    drawn.truth.redraws = redraws;
                    return Ok(drawn);
                }
                Err(DrawEnd::Rejected(reject)) => *rejected.entry(reject).or_default() += 1,
                Err(DrawEnd::Failed(error)) => return Err(error),
            }
        }
        let counts = (rejected.iter())
            .map(|(reject, count)| format!("{count} {}", reject.text()))
            .collect::<Vec<_>>();
        Err(EvaluateError::NoTruth {
            trial,
            kind: kind.id(),
            of: TRIAL.truth_attempts,
            reasons: counts.join(", "),
        })
    }

    fn attempt(
        &self,
        trial: usize,
        kind: Kind,
        extra: Extra,
        noise: Noise,
    ) -> Result<Drawn, DrawEnd> {
        let source = &mut noise.source("truth");
        let theta = theta(kind, &self.space, self.space.draw_prior(noise), source);
        let drive = self.drive(noise)?;
        let scene = Scene::new(self.study.twin(), &theta, &drive, RecordNoise::of(noise));
        let scene = scene.ok_or(Reject::Diverged)?;
        if scene.is_still() {
            return Err(Reject::Still.into());
        }
        let is_noisy = self.is_silent || equations(self.study.twin()).is_some();
        let mut allowed = nuisances(&scene, is_noisy);
        let mut probability = TRIAL.nuisance_probability;
        if !self.nuisances.is_empty() {
            allowed.push(NuisanceKind::None);
            allowed.retain(|kind| self.nuisances.contains(kind));
            probability = 1.0;
        }
        if allowed.is_empty() {
            return Err(Reject::NoNuisance.into());
        }
        let conditions = conditions(&scene, self.is_silent, (&allowed, probability), source);
        let system = System::new(&theta, &conditions);
        let experiment = Experiment::new(self.study, system, &scene)?;
        let mut truth = Truth {
            trial,
            kind,
            theta: theta.clone(),
            conditions: conditions.clone(),
            departures: vec![],
            labels: vec![],
            formulas: vec![],
            effects: vec![],
            right: vec![],
            rival: None,
            targets: vec![],
            places: vec![],
            information: None,
            step: experiment.information.step(self.study, system)?,
            redraws: 0,
        };
        let drafts = self.drafts(kind, &scene, source).ok_or(Reject::NoLaw)?;
        let [low, high] = INFORMATION;
        let wanted: Vec<f64> = (drafts.iter())
            .map(|_| low * (high / low).powf(source.uniform()))
            .collect();
        let own: Vec<&Draft> = drafts.iter().map(|(draft, _)| draft).collect();
        let all = experiment.all_sized(&own, &wanted)?;
        for ((draft, effect), sized) in drafts.iter().zip(&all) {
            let target = self.places.name(sized.departure.place).to_owned();
            truth.labels.push(draft.label(&target));
            truth.formulas.extend(draft.formula());
            truth.effects.extend(effect.clone());
            truth.targets.push(target);
            truth.departures.push(sized.departure.clone());
        }
        truth.information = all.iter().map(|sized| sized.nats).reduce(f64::min);
        let imitators = (all.iter().enumerate())
            .map(|(i, sized)| {
                let own = truth.effects.get(i);
                Imitators::of(&experiment, sized, own, &self.listed)
            })
            .collect::<Result<Vec<_>, _>>()?;
        truth.rival = rival(&imitators);
        truth.right = imitators.into_iter().map(|i| i.right).collect();
        truth.places = self.true_places(&truth, &scene);
        self.drawn(truth, extra, noise, &scene)
    }

    /// The records of a truth.
    fn drawn(
        &self,
        truth: Truth,
        extra: Extra,
        noise: Noise,
        scene: &Scene,
    ) -> Result<Drawn, DrawEnd> {
        let drive = &scene.run.drive;
        let record = |drive: &Drive, noise: Noise| {
            let record = self.record(&truth, drive, noise, scene);
            record.ok_or(DrawEnd::Rejected(Reject::Diverged))
        };
        let own = record(drive, noise)?;
        let validation = (extra.validation).then(|| {
            let noise = noise.child("validation");
            record(&self.drive(noise)?, noise)
        });
        let doubled = doubled(drive).filter(|_| extra.doubled);
        let doubled = doubled.map(|drive| record(&drive, noise));
        Ok(Drawn {
            record: own,
            validation: validation.transpose()?,
            doubled: doubled.transpose()?,
            truth,
        })
    }

    /// Departures of a kind, not yet sized, with their keys in the library; `None` where none could be drawn.
    fn drafts(
        &self,
        kind: Kind,
        scene: &Scene,
        source: &mut Source,
    ) -> Option<Vec<(Draft, Option<String>)>> {
        let form = match kind {
            Kind::Otherwise => LawForm::Other,
            _ => LawForm::Listed,
        };
        let listed = |among: &[&Listed], source: &mut Source| {
            let chosen = *among.get(index(source, among.len().max(1)))?;
            let draft = chosen.draft(Variant::draw(chosen.law, form, source));
            draft.of_size(0.1, scene)?;
            Some((draft, Some(chosen.key.clone())))
        };
        let all: Vec<&Listed> = self.listed.iter().collect();
        Some(match kind {
            Kind::None | Kind::Outside => vec![],
            Kind::Listed | Kind::Otherwise | Kind::Beside => vec![listed(&all, source)?],
            Kind::Pair => {
                let first = listed(&all, source)?;
                let others: Vec<&Listed> = (all.into_iter())
                    .filter(|l| l.place != first.0.place)
                    .collect();
                let second = listed(&others, source)?;
                vec![first, second]
            }
            Kind::Random | Kind::Memory => {
                let place = self.places.draw(source)?;
                let mut families = self.families.at(place);
                families.retain(|family| kind == Kind::Random || family.has_memory());
                // A half of the families may have none with a memory at this place.
                let family = *families.get(index(source, families.len().max(1)))?;
                vec![(Draft::random(family, place, scene, source)?, None)]
            }
        })
    }

    /// Places of the departures, and those that mean the same by the structure of the equations.
    fn true_places(&self, truth: &Truth, scene: &Scene) -> Vec<String> {
        let mut all = truth.targets.clone();
        if let Some(twin) = equations(self.study.twin()) {
            let structure = Structure::of(twin, &truth.theta, scene);
            for departure in &truth.departures {
                let same = structure.same_as(departure.place).into_iter();
                all.extend(same.map(|place| self.places.name(place).to_owned()));
            }
        }
        // A state that another one defines has no name as a place.
        all.retain(|name| !name.is_empty());
        all.sort();
        all.dedup();
        all
    }

    /// The record of a truth under an input; `None` where it diverges.
    fn record(&self, truth: &Truth, drive: &Drive, noise: Noise, scene: &Scene) -> Option<Record> {
        let system = System {
            theta: &truth.theta,
            departures: &truth.departures,
            conditions: &truth.conditions,
        };
        let run = run(self.study.twin(), system, drive, RecordNoise::of(noise))?;
        if !scene.is_near(&run) {
            return None;
        }
        let outputs = match &self.plan {
            Plan::Like(like) => like.with_gaps_in(run.outputs),
            Plan::Study(_) => run.outputs,
        };
        Record::new(run.drive, outputs).ok()
    }

    fn drive(&self, noise: Noise) -> Result<Drive, EvaluateError> {
        Ok(match &self.plan {
            Plan::Study(drives) => drives.draw(noise)?,
            Plan::Like(record) => record.drive().clone(),
        })
    }

    /// The study that is diagnosed with.
    pub fn study(&self) -> &Study {
        self.study
    }

    /// Names of the twin's parameters.
    pub fn parameters(&self) -> Vec<String> {
        self.space.names().into_iter().map(Into::into).collect()
    }
}

/// The same inputs twice, one after the other; `None` where steps vary.
fn doubled(drive: &Drive) -> Option<Drive> {
    if !drive.is_uniform() {
        return None;
    }
    let (rows, columns) = drive.inputs().dim();
    let inputs = Signal::from_shape_fn((2 * rows, columns), |(k, j)| drive.inputs()[[k % rows, j]]);
    Drive::new(drive.dt(), inputs).ok()
}

#[cfg(test)]
mod tests;
