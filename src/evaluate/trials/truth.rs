//! The truth of one trial.

use super::listed::{Form, Scene};
use super::unlisted::index;
use super::world::{Bend, Lack, World};
use super::{Kind, WithheldError};
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

/// What is wrong in a trial: the key that is sealed.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Truth {
    pub trial: usize,
    pub kind: Kind,
    /// Of the twin.
    pub theta: Vec<f64>,
    /// Euler steps a sample.
    pub substeps: usize,
    /// Listed effects that are there, as `id@target`.
    pub effects: Vec<String>,
    /// Every listed effect that is a right answer.
    pub right: Vec<String>,
    /// Name of an unlisted departure.
    pub unlisted: Option<String>,
    /// Where the twin is wrong.
    pub targets: Vec<String>,
    /// From 0, hardly visible, to 1, obvious; of a pair, that of the weaker effect.
    pub strength: Option<f64>,
    /// The departures, in order.
    pub bends: Vec<Bend>,
}

/// A truth with its records.
pub(super) struct Drawn {
    pub truth: Truth,
    pub record: Record,
    pub validation: Option<Record>,
    /// Of everything random in it.
    noise: Noise,
}

/// A record of a world beside that of the same world without its departures: same input, same noise.
pub(super) struct Twofold {
    pub bent: Record,
    pub plain: Record,
}

/// Where truths come from.
pub(super) struct Urn<'a> {
    pub world: &'static World,
    pub space: ParameterSpace,
    drives: DriveSource,
    /// Keys of the effects that the study lists.
    library: Vec<String>,
    study: &'a Study,
}

impl<'a> Urn<'a> {
    /// Of a study whose twin has a world and is as it is in that world.
    pub fn new(study: &'a Study) -> Result<Self, WithheldError> {
        let world =
            World::of(study.name()).ok_or_else(|| WithheldError::NoWorld(study.name().into()))?;
        let file = study.file();
        let changed = [
            ("[fixed]", !file.fixed.is_empty()),
            ("[limits]", !file.limits.is_empty()),
            ("[noise]", !file.noise.is_empty()),
            ("[start]", !file.start.is_empty()),
            ("[[effect]]", !file.effect.is_empty()),
        ];
        if let Some((table, _)) = changed.into_iter().find(|(_, changed)| *changed) {
            return Err(WithheldError::Changed(table));
        }
        let space = study.twin().parameters();
        // A twin of the same name that is another one.
        if space.names() != world.parameters {
            return Err(WithheldError::NoWorld(format!("this {}", study.name())));
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

    /// Whether a truth of this kind can be drawn.
    pub fn check(&self, kind: Kind) -> Result<(), WithheldError> {
        let enough = match kind {
            Kind::None | Kind::Outside | Kind::Unlisted => true,
            Kind::Listed | Kind::Parametrised => !self.lacks().is_empty(),
            Kind::Pair => (self.lacks().iter()).any(|l| l.target != self.lacks()[0].target),
            Kind::Confounded => !self.doubles().is_empty(),
            Kind::Absorbed => !self.world.absorbed.is_empty(),
        };
        match enough {
            true => Ok(()),
            false => Err(WithheldError::NoEffect(kind.id())),
        }
    }

    /// Number `trial`, of this kind: the same for the same noise.
    pub fn draw(
        &self,
        trial: usize,
        kind: Kind,
        validation: bool,
        noise: Noise,
    ) -> Result<Drawn, WithheldError> {
        for attempt in 0..ATTEMPTS {
            let noise = noise.child("attempt").sample(attempt);
            if let Some(drawn) = self.attempt(trial, kind, validation, noise)? {
                return Ok(drawn);
            }
        }
        Err(WithheldError::Runaway(trial))
    }

    /// `None` where a record runs away or θ cannot be used.
    fn attempt(
        &self,
        trial: usize,
        kind: Kind,
        validation: bool,
        noise: Noise,
    ) -> Result<Option<Drawn>, WithheldError> {
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
            bends: vec![],
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
    pub fn twofold(
        &self,
        truth: &Truth,
        validation: bool,
        noise: Noise,
    ) -> Result<Option<[Twofold; 2]>, WithheldError> {
        let drawn = self.draw(truth.trial, truth.kind, validation, noise)?;
        let plain = Truth {
            bends: vec![],
            ..truth.clone()
        };
        let both = |drive: Drive, noise: Noise| -> Result<Option<Twofold>, WithheldError> {
            let bent = self.record(truth, drive.clone(), noise)?;
            let plain = self.record(&plain, drive, noise)?;
            Ok(bent.zip(plain).map(|(bent, plain)| Twofold { bent, plain }))
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
    ) -> Result<Option<Record>, WithheldError> {
        let run = (self.world).run(&truth.theta, &drive, &truth.bends, truth.substeps, noise);
        let Some(y) = run else { return Ok(None) };
        let outputs = Signal::from_shape_fn((y.len(), 1), |(k, _)| y[k]);
        Ok(Some(Record::new(drive, outputs)?))
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

    /// What sets this trial apart from the twin.
    fn depart(&self, truth: &mut Truth, scene: &Scene, source: &mut Source) -> Option<()> {
        let any = |source: &mut Source| source.uniform();
        let clear = |source: &mut Source| CLEAR + (1.0 - CLEAR) * source.uniform();
        let lacks = self.lacks();
        match truth.kind {
            Kind::None | Kind::Outside => {}
            Kind::Listed | Kind::Parametrised => {
                let form = match truth.kind {
                    Kind::Listed => Form::Listed,
                    _ => Form::Other,
                };
                let lack = lacks.get(index(source, lacks.len()))?;
                let strength = any(source);
                self.add(truth, lack, strength, form, scene, source)?;
            }
            Kind::Absorbed => {
                let lack = &self.world.absorbed[index(source, self.world.absorbed.len())];
                let strength = any(source);
                self.add(truth, lack, strength, Form::Listed, scene, source)?;
                // A parameter that has jumped before the record began is another parameter.
                for bend in &mut truth.bends {
                    bend.at_once();
                }
            }
            Kind::Pair => {
                let first = lacks.get(index(source, lacks.len()))?;
                let others: Vec<&&Lack> =
                    lacks.iter().filter(|l| l.target != first.target).collect();
                let second = others.get(index(source, others.len()))?;
                for lack in [first, second] {
                    let strength = clear(source);
                    self.add(truth, lack, strength, Form::Listed, scene, source)?;
                }
            }
            Kind::Confounded => {
                let doubles = self.doubles();
                let (lack, double) = doubles.get(index(source, doubles.len()))?;
                let strength = clear(source);
                self.add(truth, lack, strength, Form::Listed, scene, source)?;
                truth.right.push((*double).into());
            }
            Kind::Unlisted => {
                let strength = any(source);
                let unlisted = self.world.unlisted(strength, scene, source);
                truth.bends.push(unlisted.bend);
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
        lack: &Lack,
        strength: f64,
        form: Form,
        scene: &Scene,
        source: &mut Source,
    ) -> Option<()> {
        let (faint, strong) = lack.range;
        let amount = faint * (strong / faint).powf(strength);
        (truth.bends).push(self.world.listed(lack, amount, form, scene, source)?);
        truth.effects.push(lack.key());
        truth.right.push(lack.key());
        truth.targets.push(lack.target.into());
        truth.strength = Some(truth.strength.map_or(strength, |s| s.min(strength)));
        Some(())
    }

    /// Effects that the world can have and the study lists.
    fn lacks(&self) -> Vec<&'static Lack> {
        (self.world.lacks.iter())
            .filter(|lack| self.library.contains(&lack.key()))
            .collect()
    }

    /// The first of each pair of doubles that the study lists, and the other.
    fn doubles(&self) -> Vec<(&'static Lack, &'static str)> {
        (self.world.doubles.iter())
            .filter_map(|[first, second]| {
                let lack = self.lacks().into_iter().find(|lack| lack.key() == *first)?;
                Some((lack, *second))
            })
            .filter(|(_, second)| self.library.iter().any(|key| key == second))
            .collect()
    }

    /// The study that is diagnosed with.
    pub fn study(&self) -> &Study {
        self.study
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evaluate::paper::reference_studies;

    #[test]
    fn every_kind_can_be_drawn_and_repeats() {
        for study in reference_studies().unwrap() {
            let urn = Urn::new(&study).unwrap();
            for kind in Kind::ALL {
                urn.check(kind).unwrap();
                for trial in 0..10 {
                    let noise = Noise::new(5, "truth", trial as u64);
                    let drawn = urn.draw(trial, kind, true, noise).unwrap();
                    let again = urn.draw(trial, kind, true, noise).unwrap();
                    assert_eq!(drawn.truth, again.truth);
                    assert_eq!(drawn.record, again.record);
                    // The same noise once more, and without departures as many records as with none.
                    if let Some([own, _]) = urn.twofold(&drawn.truth, true, noise).unwrap() {
                        assert_eq!(own.bent, drawn.record);
                        assert_eq!(own.plain == own.bent, drawn.truth.bends.is_empty());
                    }
                    let truth = drawn.truth;
                    let bends = match kind {
                        Kind::None | Kind::Outside => 0,
                        Kind::Pair => 2,
                        _ => 1,
                    };
                    assert_eq!(truth.bends.len(), bends, "{truth:?}");
                    assert_eq!(truth.strength.is_some(), bends > 0);
                    let text = serde_json::to_string(&truth).unwrap();
                    assert_eq!(serde_json::from_str::<Truth>(&text).unwrap(), truth);
                    if kind == Kind::Pair {
                        assert_ne!(truth.targets[0], truth.targets[1]);
                    }
                }
            }
        }
    }

    /// Every effect that a world names is one of the library, at that target.
    #[test]
    fn worlds_and_library_use_the_same_names() {
        for study in reference_studies().unwrap() {
            let urn = Urn::new(&study).unwrap();
            assert_eq!(urn.lacks().len(), urn.world.lacks.len());
            assert_eq!(urn.doubles().len(), urn.world.doubles.len());
            for lack in urn.world.absorbed {
                assert!(urn.library.contains(&lack.key()), "{}", lack.key());
            }
        }
    }
}
