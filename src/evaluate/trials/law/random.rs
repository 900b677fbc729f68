//! Laws that nobody listed: a new function for each trial.

use super::functions::{Tree, Waves};
use super::{DeparturePlace, Moment};
use crate::math::{ascending, nearest};
use crate::twin::{Noise, Source};
use serde::de::IntoDeserializer;
use serde::de::value::Error as ValueError;
use serde::{Deserialize, Serialize};
use std::fmt;
use std::str::FromStr;

/// Source of the functions.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(in crate::evaluate::trials) enum Generator {
    /// Small expression trees.
    Tree,
    /// Samples of Gaussian processes.
    Process,
}

/// Shape of the functions.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(in crate::evaluate::trials) enum LawShape {
    Smooth,
    /// With corners.
    Kinked,
    /// Depends on an argument with play.
    Hysteretic,
    /// Depends on an argument's fading mean.
    Memory,
}

/// Family of random functions.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(in crate::evaluate::trials) struct LawFamily {
    pub generator: Generator,
    pub shape: LawShape,
}

impl LawFamily {
    /// All families.
    pub fn all() -> Vec<Self> {
        let shapes = [
            LawShape::Smooth,
            LawShape::Kinked,
            LawShape::Hysteretic,
            LawShape::Memory,
        ];
        [Generator::Tree, Generator::Process]
            .into_iter()
            .flat_map(|generator| shapes.map(|shape| Self { generator, shape }))
            .collect()
    }

    /// Returns true if a law depends on what was before.
    pub fn has_memory(self) -> bool {
        matches!(self.shape, LawShape::Hysteretic | LawShape::Memory)
    }
}

impl fmt::Display for LawFamily {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.shape.serialize(&mut *f)?;
        f.write_str("-")?;
        self.generator.serialize(f)
    }
}

/// Signal that a law depends on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(in crate::evaluate::trials) enum LawVariable {
    State(usize),
    Input(usize),
    Time,
    /// The signal at the place of the departure.
    Own,
}

/// A signal, standardised to about −1 … 1.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(in crate::evaluate::trials) struct Argument {
    pub variable: LawVariable,
    pub centre: f64,
    pub half_width: f64,
}

impl Argument {
    fn at(&self, now: &Moment<'_>) -> f64 {
        let value = match self.variable {
            LawVariable::State(i) => now.x[i],
            LawVariable::Input(j) => now.u[j],
            LawVariable::Time => now.t,
            LawVariable::Own => now.own,
        };
        (value - self.centre) / self.half_width
    }
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
enum RandomFunction {
    Tree(Tree),
    Process(Waves),
    /// The larger of two samples: smooth but for a corner.
    Larger(Waves, Waves),
}

/// A random function at a place, in units of the place.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(in crate::evaluate::trials) struct RandomLaw {
    pub family: LawFamily,
    pub arguments: Vec<Argument>,
    function: RandomFunction,
    /// Play of the first argument, or time constant of its mean in seconds.
    keeps: f64,
    /// Mean and deviation of the function over a record of the twin.
    mean: f64,
    deviation: f64,
    /// Root mean square of the law over that record.
    pub amount: f64,
}

impl RandomLaw {
    /// Draws a law of these arguments; `duration` is that of a record, in seconds.
    pub fn draw(
        family: LawFamily,
        arguments: Vec<Argument>,
        duration: f64,
        source: &mut Source,
    ) -> Self {
        let (n, kinked) = (arguments.len(), family.shape == LawShape::Kinked);
        let waves = |source: &mut Source| Waves::draw(n, 0.3 + 0.5 * source.uniform(), source);
        let function = match family.generator {
            Generator::Tree => RandomFunction::Tree(Tree::draw(n, kinked, source)),
            Generator::Process if kinked => RandomFunction::Larger(waves(source), waves(source)),
            Generator::Process => RandomFunction::Process(waves(source)),
        };
        let part = source.uniform();
        Self {
            family,
            arguments,
            function,
            keeps: match family.shape {
                LawShape::Hysteretic => 0.3 + 0.5 * part,
                LawShape::Memory => duration * (0.02 + 0.1 * part),
                LawShape::Smooth | LawShape::Kinked => 0.0,
            },
            mean: 0.0,
            deviation: 1.0,
            amount: 1.0,
        }
    }

    /// Standardises the law over the moments of a record; `None` where it is constant there.
    pub fn standardised(mut self, moments: &[Moment<'_>], dt: f64) -> Option<Self> {
        let mut memory = vec![];
        let values: Vec<f64> = (moments.iter())
            .map(|now| {
                self.remember(now, dt, &mut memory);
                self.raw(now, &memory)
            })
            .collect();
        let n = values.len() as f64;
        self.mean = values.iter().sum::<f64>() / n;
        let square: f64 = values.iter().map(|v| (v - self.mean).powi(2)).sum();
        self.deviation = (square / n).sqrt();
        (self.deviation > 1e-6 && self.deviation.is_finite()).then_some(self)
    }

    /// Moves the memory on, once a sample, before the law is asked.
    pub fn remember(&self, now: &Moment<'_>, dt: f64, memory: &mut Vec<f64>) {
        let z = self.arguments[0].at(now);
        if memory.is_empty() {
            memory.push(z);
        }
        match self.family.shape {
            LawShape::Hysteretic => memory[0] = nearest(memory[0], z - self.keeps, z + self.keeps),
            LawShape::Memory => memory[0] += (1.0 - (-dt / self.keeps).exp()) * (z - memory[0]),
            LawShape::Smooth | LawShape::Kinked => {}
        }
    }

    /// The law at a moment.
    pub fn at(&self, now: &Moment<'_>, memory: &[f64]) -> f64 {
        self.amount * (self.raw(now, memory) - self.mean) / self.deviation
    }

    fn raw(&self, now: &Moment<'_>, memory: &[f64]) -> f64 {
        // Outside of what the record visits, functions stay where they are: squares would run away.
        let mut z = [0.0; 3];
        for (z, argument) in z.iter_mut().zip(&self.arguments) {
            *z = argument.at(now).clamp(-2.0, 2.0);
        }
        if self.family.has_memory() {
            z[0] = memory.first().map_or(z[0], |m| m.clamp(-2.0, 2.0));
        }
        let z = &z[..self.arguments.len()];
        match &self.function {
            RandomFunction::Tree(tree) => tree.at(z),
            RandomFunction::Process(waves) => waves.at(z),
            RandomFunction::Larger(a, b) => a.at(z).max(b.at(z)),
        }
    }

    /// Returns the expression of a tree, in standardised arguments z1, z2, …
    pub fn formula(&self) -> Option<String> {
        match &self.function {
            RandomFunction::Tree(tree) => Some(tree.to_string()),
            RandomFunction::Process(_) | RandomFunction::Larger(..) => None,
        }
    }
}

/// Seed of the split. Another one makes closed families open.
const SPLIT: u64 = 20_261_121;

/// Families of random laws that a call draws from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Families {
    /// The half that constants may be chosen on.
    Open,
    /// The half for reports.
    Closed,
    /// Both halves.
    #[default]
    All,
}

impl fmt::Display for Families {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.serialize(f)
    }
}

impl FromStr for Families {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        Self::deserialize(text.into_deserializer())
            .map_err(|_: ValueError| format!("{text} is none of open, closed, all"))
    }
}

impl Families {
    /// Families of this half at a place. Each kind of place has half of them in either half.
    pub(in crate::evaluate::trials) fn at(self, place: DeparturePlace) -> Vec<LawFamily> {
        let mut all: Vec<(f64, LawFamily)> = (LawFamily::all().into_iter())
            .map(|family| {
                let name = format!("{family}/{}", place.kind().name());
                let lot = Noise::new(SPLIT, "families", 0).source(&name).uniform();
                (lot, family)
            })
            .collect();
        ascending(&mut all, |a| a.0);
        let half = all.len() / 2;
        let all = all.into_iter().map(|(_, family)| family);
        match self {
            Self::Open => all.take(half).collect(),
            Self::Closed => all.skip(half).collect(),
            Self::All => all.collect(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_family_has_the_size_that_it_is_given() {
        let states: Vec<[f64; 1]> = (0..300).map(|k| [(0.07 * f64::from(k)).sin()]).collect();
        let moments: Vec<Moment<'_>> = (states.iter().enumerate())
            .map(|(k, x)| Moment {
                t: 0.1 * k as f64,
                x,
                u: &[],
                own: 0.0,
            })
            .collect();
        let argument = |variable, centre, half_width| Argument {
            variable,
            centre,
            half_width,
        };
        for (i, family) in LawFamily::all().into_iter().enumerate() {
            let arguments = vec![
                argument(LawVariable::State(0), 0.0, 1.0),
                argument(LawVariable::Time, 15.0, 15.0),
            ];
            let mut source = Noise::new(3, "families", i as u64).source("law");
            let law = RandomLaw::draw(family, arguments, 30.0, &mut source);
            let mut law = law.standardised(&moments, 0.1).unwrap();
            law.amount = 0.4;
            let mut memory = vec![];
            let squares: f64 = (moments.iter())
                .map(|now| {
                    law.remember(now, 0.1, &mut memory);
                    law.at(now, &memory).powi(2)
                })
                .sum();
            let size = (squares / 300.0).sqrt();
            assert!((size - 0.4).abs() < 1e-9, "{family}: {size}");
            let text = serde_json::to_string(&law).unwrap();
            assert_eq!(serde_json::from_str::<RandomLaw>(&text).unwrap(), law);
        }
    }

    #[test]
    fn halves_share_no_family_and_leave_none_out() {
        for place in [
            DeparturePlace::State(0),
            DeparturePlace::Sensor(1),
            DeparturePlace::Actuator(0),
            DeparturePlace::Parameter(2),
        ] {
            let (open, closed) = (Families::Open.at(place), Families::Closed.at(place));
            assert_eq!((open.len(), closed.len()), (4, 4));
            assert!(open.iter().all(|family| !closed.contains(family)));
        }
        assert_eq!(
            Families::Open.at(DeparturePlace::State(0)),
            Families::Open.at(DeparturePlace::State(5))
        );
        assert!("odd".parse::<Families>().is_err());
        assert_eq!("closed".parse::<Families>(), Ok(Families::Closed));
    }
}
