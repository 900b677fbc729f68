//! Departures whose size is not yet chosen.

use super::law::{Departure, DepartureLaw, DeparturePlace, LawFamily, RandomLaw};
use super::listed::{LawForm, ListedLaw, Sign, Sizing, Variant};
use super::scene::Scene;
use crate::effect::EffectKey;
use crate::evaluate::trials::numbers::TRIAL;
use crate::twin::Source;

/// Exponents of power laws that a truth is compared with. 1 and 2 are linear loss and quadratic drag; a quarter is nearly friction.
const EXPONENTS: [f64; 7] = [0.25, 0.5, 1.0, 1.5, 2.0, 2.5, 3.0];

/// A departure with its shape, at any size: 1 is as large as the twin's own terms.
#[derive(Debug, Clone)]
pub(super) struct Draft {
    pub place: DeparturePlace,
    law: DraftLaw,
}

#[derive(Debug, Clone)]
enum DraftLaw {
    Listed {
        law: &'static ListedLaw,
        /// The other state of a law between two.
        other: Option<usize>,
        variant: Variant,
    },
    Random(RandomLaw),
}

impl Variant {
    /// The variants of a law that a truth is compared with, each of positive sign.
    pub fn of(law: &ListedLaw) -> Vec<Self> {
        let with = |exponent, shape| Self {
            form: LawForm::Listed,
            sign: 1.0,
            exponent,
            shapes: [shape; 3],
        };
        match law.id {
            "power-law" => EXPONENTS.map(|exponent| with(exponent, 0.5)).to_vec(),
            // The lower end of the range, and the upper one.
            "sensor-saturation" | "actuator-saturation" => vec![with(1.0, 0.0), with(1.0, 0.5)],
            _ => vec![with(1.0, 0.5)],
        }
    }

    /// Draws the shape of a law.
    pub fn draw(law: &ListedLaw, form: LawForm, source: &mut Source) -> Self {
        let sign = if source.happens(0.5) { -1.0 } else { 1.0 };
        let shapes = [(); 3].map(|()| source.uniform());
        Self {
            form,
            sign: if law.sign == Sign::Both { sign } else { 1.0 },
            // Away from one and two, which have names of their own.
            exponent: match shapes[0] {
                shape if shape < 0.5 => 1.3 + 0.8 * shape,
                shape => 2.0 + shape,
            },
            shapes,
        }
    }
}

impl Draft {
    /// A listed law of a sign and a shape.
    pub fn listed(
        law: &'static ListedLaw,
        place: DeparturePlace,
        other: Option<usize>,
        variant: Variant,
    ) -> Self {
        let law = DraftLaw::Listed {
            law,
            other,
            variant,
        };
        Self { place, law }
    }

    /// A random law of a family at a place; `None` where nothing moves that it could depend on.
    pub fn random(
        family: LawFamily,
        place: DeparturePlace,
        scene: &Scene,
        source: &mut Source,
    ) -> Option<Self> {
        let mut variables = scene.variables(place);
        let mut arguments = Vec::new();
        let wanted = 1 + usize::from(source.happens(0.5));
        while arguments.len() < wanted && !variables.is_empty() {
            let variable = variables.swap_remove(index(source, variables.len()));
            arguments.extend(scene.argument(variable, place));
        }
        if arguments.is_empty() {
            return None;
        }
        let law = RandomLaw::draw(family, arguments, scene.duration, source);
        let law = law.standardised(&scene.moments(place), scene.dt)?;
        let law = DraftLaw::Random(law);
        Some(Self { place, law })
    }

    /// Largest size: beyond, the system is another one.
    pub fn largest(&self) -> f64 {
        match &self.law {
            DraftLaw::Listed { law, .. } => law.largest,
            DraftLaw::Random(_) => TRIAL.largest_law,
        }
    }

    /// Name of what is missing: `id@target` of a listed law, the family of a random one.
    pub fn label(&self, target: &str) -> String {
        match &self.law {
            DraftLaw::Listed { law, .. } => EffectKey::new(law.id, target).to_string(),
            DraftLaw::Random(law) => format!("{} at {target}", law.family),
        }
    }

    /// Expression of a random law that has one.
    pub fn formula(&self) -> Option<String> {
        match &self.law {
            DraftLaw::Listed { .. } => None,
            DraftLaw::Random(law) => law.formula(),
        }
    }

    /// The departure of this size.
    pub fn of_size(&self, size: f64, scene: &Scene) -> Option<Departure> {
        let place = self.place;
        let law = match &self.law {
            DraftLaw::Random(law) => {
                let mut law = law.clone();
                law.amount = size * scene.unit(place);
                DepartureLaw::Random(law)
            }
            DraftLaw::Listed {
                law,
                other,
                variant,
            } => law.at(&Sizing {
                scene,
                place,
                other: *other,
                variant: *variant,
                size,
            })?,
        };
        Some(Departure { place, law })
    }
}

/// A number below `n`.
pub(super) fn index(source: &mut Source, n: usize) -> usize {
    ((source.uniform() * n as f64) as usize).min(n - 1)
}
