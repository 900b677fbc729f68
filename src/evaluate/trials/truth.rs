//! The truth of one trial.

#[cfg(test)]
mod tests;

use super::Kind;
use super::listed::{Form, Scene};
use super::unlisted::index;
use super::world::{MissingEffect, Perturbation, World};
use crate::evaluate::EvaluateError;
use crate::record::{Drive, Record, Signal};
use crate::study::{DriveSource, Study};
use crate::twin::{Noise, ParameterSpace, Source};
use serde::{Deserialize, Serialize};

/// Draws before a trial is given up.
const ATTEMPTS: u64 = 200;
/// θ outside the prior stays in this part of the bounds: beyond, tanks run dry or over and show nothing.
const MIDDLE: (f64, f64) = (0.1, 0.75);
/// Least strength of effects that are to be told from each other, not only to be seen.
const CLEAR: f64 = 0.5;

/// Difference between system and twin in a trial: the key that is sealed.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Truth {
    pub trial: usize,
    pub kind: Kind,
    /// True parameters of the twin.
    pub theta: Vec<f64>,
    /// Euler steps a sample.
    pub substeps: usize,
    /// Listed effects that are there, as `id@target`.
    pub effects: Vec<String>,
    /// Every listed effect that is a right answer.
    pub right: Vec<String>,
    /// Name of an unlisted departure.
    pub unlisted: Option<String>,
    /// Places where the twin is wrong.
    pub targets: Vec<String>,
    /// From 0, hardly visible, to 1, obvious; of a pair, that of the weaker effect.
    pub strength: Option<f64>,
    /// The departures, in order.
    #[serde(rename = "bends")]
    pub perturbations: Vec<Perturbation>,
}

/// A truth with its records.
pub(super) struct Drawn {
    pub truth: Truth,
    pub record: Record,
    pub validation: Option<Record>,
    /// Noise of everything random in it.
    noise: Noise,
}

/// A record of a world beside that of the same world without its departures: same input, same noise.
pub(super) struct PairedRecord {
    pub perturbed: Record,
    pub plain: Record,
}

fn no_reference(twin: String) -> EvaluateError {
    EvaluateError::NoReference {
        twin,
        known: World::known().join(" or "),
    }
}

/// Source of truths and their records.
pub(super) struct TruthSampler<'a> {
    pub world: &'static World,
    pub space: ParameterSpace,
    drives: DriveSource,
    /// Keys of the effects that the study lists.
    library: Vec<String>,
    study: &'a Study,
}

impl<'a> TruthSampler<'a> {
    /// Creates a sampler for a study whose twin has a world and is as it is in that world.
    pub fn new(study: &'a Study) -> Result<Self, EvaluateError> {
        let world = World::of(study.name()).ok_or_else(|| no_reference(study.name().into()))?;
        let file = study.file();
        let changed = [
            ("[fixed]", !file.fixed.is_empty()),
            ("[limits]", !file.limits.is_empty()),
            ("[noise]", !file.noise.is_empty()),
            ("[start]", !file.start.is_empty()),
            ("[[effect]]", !file.effect.is_empty()),
        ];
        if let Some((table, _)) = changed.into_iter().find(|(_, changed)| *changed) {
            return Err(EvaluateError::Changed(table));
        }
        let space = study.twin().parameters();
        // A twin of the same name that is another one.
        if space.names() != world.parameters {
            return Err(no_reference(format!("this {}", study.name())));
        }
        let library = (study.candidates().iter())
            .map(|e| e.key().to_string())
            .collect();
        Ok(Self {
            world,
            space,
            drives: study.drives()?,
            library,
            study,
        })
    }

    /// Checks that a truth of this kind can be drawn.
    pub fn check(&self, kind: Kind) -> Result<(), EvaluateError> {
        let enough = match kind {
            Kind::None | Kind::Outside | Kind::Unlisted => true,
            Kind::Listed | Kind::Parametrised => !self.missing_effects().is_empty(),
            Kind::Pair => (self.missing_effects().iter())
                .any(|l| l.target != self.missing_effects()[0].target),
            Kind::Confounded => !self.doubles().is_empty(),
            Kind::Absorbed => !self.world.absorbed.is_empty(),
        };
        if !enough {
            return Err(EvaluateError::NoEffect(kind.id()));
        }
        Ok(())
    }

    /// Number `trial`, of this kind: the same for the same noise.
    pub fn draw(
        &self,
        trial: usize,
        kind: Kind,
        validation: bool,
        noise: Noise,
    ) -> Result<Drawn, EvaluateError> {
        for attempt in 0..ATTEMPTS {
            let noise = noise.child("attempt").sample(attempt);
            if let Some(drawn) = self.attempt(trial, kind, validation, noise)? {
                return Ok(drawn);
            }
        }
        Err(EvaluateError::Runaway(trial))
    }

    /// `None` where a record runs away or θ cannot be used.
    fn attempt(
        &self,
        trial: usize,
        kind: Kind,
        validation: bool,
        noise: Noise,
    ) -> Result<Option<Drawn>, EvaluateError> {
        let Some(theta) = self.theta(kind, noise) else {
            return Ok(None);
        };
        let drive = self.drives.draw(noise)?;
        let Some(scene) = Scene::of(self.world, &theta, &drive) else {
            return Ok(None);
        };
        let mut source = noise.source("truth");
        let substeps = match kind {
            // Far from the prior levels run low, where √h is steep and another step another system.
            Kind::Outside | Kind::Absorbed => 1,
            _ => self.world.substeps[index(&mut source, self.world.substeps.len())],
        };
        let mut truth = Truth {
            trial,
            kind,
            theta,
            substeps,
            effects: vec![],
            right: vec![],
            unlisted: None,
            targets: vec![],
            strength: None,
            perturbations: vec![],
        };
        if self.depart(&mut truth, &scene, &mut source).is_none() {
            return Ok(None);
        }
        let Some(record) = self.record(&truth, drive, noise)? else {
            return Ok(None);
        };
        let validation = match validation {
            false => None,
            true => {
                let noise = noise.child("validation");
                match self.record(&truth, self.drives.draw(noise)?, noise)? {
                    None => return Ok(None),
                    found => found,
                }
            }
        };
        Ok(Some(Drawn {
            truth,
            record,
            validation,
            noise,
        }))
    }

    /// The record of a trial and a held-out one, each beside what would have been measured without the departures; `None`
    /// where such a record runs away.
    pub fn paired(
        &self,
        truth: &Truth,
        validation: bool,
        noise: Noise,
    ) -> Result<Option<[PairedRecord; 2]>, EvaluateError> {
        let drawn = self.draw(truth.trial, truth.kind, validation, noise)?;
        let plain = Truth {
            perturbations: vec![],
            ..truth.clone()
        };
        let both = |drive: Drive, noise: Noise| -> Result<Option<PairedRecord>, EvaluateError> {
            let perturbed = self.record(truth, drive.clone(), noise)?;
            let plain = self.record(&plain, drive, noise)?;
            Ok(perturbed
                .zip(plain)
                .map(|(perturbed, plain)| PairedRecord { perturbed, plain }))
        };
        let own = both(drawn.record.drive().clone(), drawn.noise)?;
        let noise = drawn.noise.child("held out");
        let held_out = both(self.drives.draw(noise)?, noise)?;
        Ok(own.zip(held_out).map(|(own, held_out)| [own, held_out]))
    }

    /// The record of a truth under an input; `None` where it runs away.
    pub fn record(
        &self,
        truth: &Truth,
        drive: Drive,
        noise: Noise,
    ) -> Result<Option<Record>, EvaluateError> {
        let run = (self.world).run(
            &truth.theta,
            &drive,
            &truth.perturbations,
            truth.substeps,
            noise,
        );
        let Some(y) = run else { return Ok(None) };
        let outputs = Signal::from_shape_fn((y.len(), 1), |(k, _)| y[k]);
        Ok(Some(Record::complete(drive, outputs)?))
    }

    fn theta(&self, kind: Kind, noise: Noise) -> Option<Vec<f64>> {
        if kind != Kind::Outside {
            return Some(self.space.draw_prior(noise));
        }
        let theta = self.space.draw_bounds(noise);
        let outside = self
            .space
            .iter()
            .zip(&theta)
            .any(|(p, v)| !p.prior.contains(*v));
        let middle = self.space.iter().zip(&theta).all(|(p, v)| {
            let place = (v - p.bounds.low()) / p.bounds.width();
            (MIDDLE.0..=MIDDLE.1).contains(&place)
        });
        (outside && middle).then_some(theta)
    }

    /// Adds the departures of this trial to its truth.
    fn depart(&self, truth: &mut Truth, scene: &Scene, source: &mut Source) -> Option<()> {
        let any = |source: &mut Source| source.uniform();
        let clear = |source: &mut Source| CLEAR + (1.0 - CLEAR) * source.uniform();
        let missing_effects = self.missing_effects();
        match truth.kind {
            Kind::None | Kind::Outside => {}
            Kind::Listed | Kind::Parametrised => {
                let form = match truth.kind {
                    Kind::Listed => Form::Listed,
                    _ => Form::Other,
                };
                let missing = missing_effects.get(index(source, missing_effects.len()))?;
                let strength = any(source);
                self.add(truth, missing, strength, form, scene, source)?;
            }
            Kind::Absorbed => {
                let missing = &self.world.absorbed[index(source, self.world.absorbed.len())];
                let strength = any(source);
                self.add(truth, missing, strength, Form::Listed, scene, source)?;
                // A parameter that has jumped before the record began is another parameter.
                for perturbation in &mut truth.perturbations {
                    perturbation.at_once();
                }
            }
            Kind::Pair => {
                let first = missing_effects.get(index(source, missing_effects.len()))?;
                let others: Vec<&&MissingEffect> = missing_effects
                    .iter()
                    .filter(|l| l.target != first.target)
                    .collect();
                let second = others.get(index(source, others.len()))?;
                for missing in [first, second] {
                    let strength = clear(source);
                    self.add(truth, missing, strength, Form::Listed, scene, source)?;
                }
            }
            Kind::Confounded => {
                let doubles = self.doubles();
                let (missing, double) = doubles.get(index(source, doubles.len()))?;
                let strength = clear(source);
                self.add(truth, missing, strength, Form::Listed, scene, source)?;
                truth.right.push((*double).into());
            }
            Kind::Unlisted => {
                let strength = any(source);
                let unlisted = self.world.unlisted(strength, scene, source);
                truth.perturbations.push(unlisted.perturbation);
                truth.unlisted = Some(unlisted.name.into());
                truth.targets.push(unlisted.target);
                truth.strength = Some(strength);
            }
        }
        Some(())
    }

    /// Adds a listed effect to the truth.
    fn add(
        &self,
        truth: &mut Truth,
        missing: &MissingEffect,
        strength: f64,
        form: Form,
        scene: &Scene,
        source: &mut Source,
    ) -> Option<()> {
        let (faint, strong) = missing.range;
        let amount = faint * (strong / faint).powf(strength);
        (truth.perturbations).push(self.world.listed(missing, amount, form, scene, source)?);
        truth.effects.push(missing.key());
        truth.right.push(missing.key());
        truth.targets.push(missing.target.into());
        truth.strength = Some(truth.strength.map_or(strength, |s| s.min(strength)));
        Some(())
    }

    /// Effects that the world can have and the study lists.
    fn missing_effects(&self) -> Vec<&'static MissingEffect> {
        (self.world.missing_effects.iter())
            .filter(|missing| self.library.contains(&missing.key()))
            .collect()
    }

    /// The first of each pair of doubles that the study lists, and the other.
    fn doubles(&self) -> Vec<(&'static MissingEffect, &'static str)> {
        (self.world.doubles.iter())
            .filter_map(|[first, second]| {
                let missing = self
                    .missing_effects()
                    .into_iter()
                    .find(|missing| missing.key() == *first)?;
                Some((missing, *second))
            })
            .filter(|(_, second)| self.library.iter().any(|key| key == second))
            .collect()
    }

    /// The study that is diagnosed with.
    pub fn study(&self) -> &Study {
        self.study
    }
}
