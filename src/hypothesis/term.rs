//! One hypothesis of what a twin lacks: a term that is added to it.

use super::entry::{Entered, Entry, disturbed, with_function};
use super::trace::Trail;
use crate::effect::{Effect, EffectKey, Magnitude, Shape, augment_late};
use crate::fit::axis::Axis;
use crate::likelihood::kalman::FilterError;
use crate::likelihood::with_share;
use crate::twin::{Twin, fix};
use std::collections::BTreeMap;
use std::sync::Arc;

/// Kind of hypothesis.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Nature {
    /// An effect of the library.
    Listed,
    /// An unknown function of states, inputs, signals or time.
    Function,
    /// An unknown function of a state or an input at an output.
    Reading,
    /// An unknown answer to the past of a signal.
    Past,
    /// An unknown function of time that wanders.
    Time,
    /// An unknown function of time that repeats.
    Periodic,
    /// Another kind of noise than independent normal one: no gap.
    Noise,
}

/// Addition to the twin.
#[derive(Debug, Clone)]
pub(crate) enum Part {
    /// An effect, some magnitudes of which may be held at their off value.
    Effect {
        effect: Effect,
        held: BTreeMap<String, f64>,
    },
    /// A disturbance that keeps a share `memory` of itself at each step.
    Disturbance { entry: Entry, memory: f64 },
    /// Noise of an output that grows with its signal.
    Share { output: usize },
    /// A function that enters at an output or in a parameter.
    Function(Entered),
}

/// Values of a term's magnitudes at which a search looks.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Start {
    pub m: Vec<f64>,
    /// True where the first magnitude is a size: a small value of it gives a direction, and the best multiple is the start.
    pub scales: bool,
}

impl Start {
    /// These values as they are.
    pub fn at(m: Vec<f64>) -> Self {
        Self { m, scales: false }
    }
}

/// A term that a twin may lack.
#[derive(Debug, Clone)]
pub(crate) struct Term {
    /// Id of the effect, or a word for the unknown.
    pub id: String,
    /// State, sensor, actuator or parameter.
    pub target: String,
    pub nature: Nature,
    pub part: Part,
    /// Entries of θ of the free magnitudes, where the twin has the effect already: those of its study.
    pub entries: Option<Vec<usize>>,
    /// One for each free magnitude.
    pub axes: Vec<Axis>,
    /// Weights of an unknown function's coefficients, and its largest size.
    pub family: Option<(Vec<Vec<f64>>, f64)>,
    pub starts: Vec<Start>,
    /// Variables of a function, with the range that it is drawn over.
    pub variables: Vec<(String, f64, f64)>,
    /// Nats that the outputs themselves speak for it.
    pub mark: f64,
    /// Listed effects that do the same in this twin: other names of this term.
    pub also: Vec<EffectKey>,
    /// Trace that an unknown function is of: one of a grid of time constants or widths, of which a search keeps the best.
    pub trail: Option<Trail>,
}

/// Nats that the outputs themselves speak for terms together. Repeated values are one mark of a sensor, whatever limits or rounds it.
pub(crate) fn marks<'t>(terms: impl IntoIterator<Item = &'t Arc<Term>>) -> f64 {
    let mut clearest: BTreeMap<&str, f64> = BTreeMap::new();
    for term in terms {
        let mark = clearest.entry(&term.target).or_default();
        *mark = mark.max(term.mark);
    }
    clearest.values().sum()
}

impl Term {
    /// A term without magnitudes, starts and variables.
    pub fn new(id: &str, target: &str, nature: Nature, part: Part) -> Self {
        Self {
            id: id.into(),
            target: target.into(),
            nature,
            part,
            entries: None,
            axes: vec![],
            family: None,
            starts: vec![],
            variables: vec![],
            mark: 0.0,
            also: vec![],
            trail: None,
        }
    }

    /// `id@target`.
    pub fn key(&self) -> String {
        EffectKey::new(&self.id, &self.target).to_string()
    }

    /// Its own key and those of its other names.
    pub fn keys(&self) -> Vec<String> {
        let others = self.also.iter().map(EffectKey::to_string);
        std::iter::once(self.key()).chain(others).collect()
    }

    /// Places of all its names, each once.
    pub fn places(&self) -> Vec<&str> {
        let mut places = vec![self.target.as_str()];
        for other in &self.also {
            if !places.contains(&other.target.as_str()) {
                places.push(&other.target);
            }
        }
        places
    }

    /// Returns whether only noise changes, so that no free run moves.
    pub fn is_noise(&self) -> bool {
        match &self.part {
            Part::Effect { effect, .. } => effect.law().is_noise(),
            Part::Disturbance { .. } | Part::Share { .. } => true,
            Part::Function(_) => false,
        }
    }

    /// Returns whether this is an unknown function that a parameter follows.
    pub fn is_in_parameter(&self) -> bool {
        matches!(&self.part, Part::Function(function) if matches!(function.entry, Entry::Parameter(_)))
    }

    /// Returns whether this is a law of the library with a frequency.
    pub fn is_listed_wave(&self) -> bool {
        match &self.part {
            Part::Effect { effect, .. } => {
                self.nature == Nature::Listed
                    && (effect.magnitudes().iter())
                        .any(|m| m.shape == Shape::Frequency && m.off.is_none())
            }
            Part::Disturbance { .. } | Part::Share { .. } | Part::Function(_) => false,
        }
    }

    /// Returns whether this is a law with a frequency, listed or not.
    pub fn is_wave(&self) -> bool {
        self.nature == Nature::Periodic || self.is_listed_wave()
    }

    /// Free magnitudes of an effect, in the order of the axes; none of other terms.
    pub(super) fn free(&self) -> Vec<&Magnitude> {
        match &self.part {
            Part::Effect { effect, held, .. } => (effect.magnitudes().iter())
                .filter(|m| !held.contains_key(m.name))
                .collect(),
            Part::Disturbance { .. } | Part::Share { .. } | Part::Function(_) => vec![],
        }
    }

    /// Names of the free magnitudes of an effect of which more than the size is to be found, as a time or a delay.
    pub fn shape(&self) -> Option<Vec<&'static str>> {
        let free = self.free();
        let is_size = free.len() == 1 && self.starts.iter().all(|start| start.scales);
        (!free.is_empty() && !is_size).then(|| free.iter().map(|m| m.name).collect())
    }

    /// Entries of the free magnitudes that are times in the record.
    pub fn times(&self) -> Vec<usize> {
        (self.free().iter().enumerate())
            .filter(|(_, m)| m.shape == Shape::Time)
            .map(|(i, _)| i)
            .collect()
    }

    /// Entries of the free magnitudes at which the likelihood has a kink at each sample: times in the record and delays.
    pub fn kinked(&self) -> Vec<usize> {
        match &self.part {
            Part::Effect { effect, .. } if effect.kind().is_dead_time() => vec![0],
            _ => self.times(),
        }
    }

    /// Names of an effect's free magnitudes in θ, in the order of the axes.
    pub fn names(&self) -> Vec<String> {
        match &self.part {
            Part::Effect { effect, .. } => (self.free().iter())
                .map(|m| effect.key().magnitude(m.name))
                .collect(),
            Part::Disturbance { .. } | Part::Share { .. } | Part::Function(_) => vec![],
        }
    }
}

/// The twin with terms: effects first, a disturbance or a function that is no effect last.
pub(crate) fn with_terms<'t>(
    base: &Twin,
    terms: impl Iterator<Item = &'t Term> + Clone,
) -> Result<Twin, FilterError> {
    let mut effects = vec![];
    let mut off = BTreeMap::new();
    for term in terms.clone().filter(|term| term.entries.is_none()) {
        if let Part::Effect { effect, held } = &term.part {
            effects.push(effect.clone());
            off.extend((held.iter()).map(|(name, v)| (effect.key().magnitude(name), *v)));
        }
    }
    let twin = fix(augment_late(base.clone(), effects)?, &off)?;
    Ok(terms.fold(twin, |twin, term| match term.part {
        Part::Effect { .. } => twin,
        Part::Disturbance { entry, memory } => disturbed(&twin, entry, memory),
        Part::Share { output } => with_share(&twin, output),
        Part::Function(function) => with_function(&twin, function),
    }))
}

#[cfg(test)]
pub(crate) mod fixture {
    use super::*;
    use crate::effect::Catalogue;

    /// A term of this nature without magnitudes, which outputs speak for by so many nats.
    pub fn wave(nature: Nature, target: &str, mark: f64) -> Term {
        let effect = Catalogue::default().effect("periodic-disturbance", "h1");
        let part = Part::Effect {
            effect: effect.unwrap(),
            held: BTreeMap::new(),
        };
        Term {
            mark,
            ..Term::new("wave", target, nature, part)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A rounded output repeats its highest value, too: that counts once, for rounding or for a limit.
    #[test]
    fn a_sensor_bears_one_mark() {
        let term = |target, mark| Arc::new(fixture::wave(Nature::Listed, target, mark));
        let terms = [term("a", 12.0), term("a", 12.0), term("b", 5.0)];
        assert_eq!(marks(&terms), 17.0);
        assert_eq!(marks(&terms[..1]), 12.0);
    }
}
