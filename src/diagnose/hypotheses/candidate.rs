//! Candidates for a gap: listed effects, and disturbances for everything else.

use crate::diagnose::error::DiagnoseError;
use crate::diagnose::hypotheses::disturbed_equations::disturbed;
use crate::diagnose::hypotheses::entry::Entry;
use crate::diagnose::thresholds::Thresholds;
use crate::effect::{Effect, EffectKey, EffectPattern, Magnitude, augment_short};
use crate::record::Signals;
use crate::study::Study;
use crate::twin::{Outline, Role, Twin, fix, is_memory};
use std::collections::BTreeMap;

/// A listed effect, or a catch-all.
#[derive(Debug, Clone)]
pub(in crate::diagnose) enum Kind {
    Listed(Effect),
    CatchAll(Entry, f64),
}

/// One explanation of a gap.
#[derive(Debug, Clone)]
pub(in crate::diagnose) struct Candidate {
    /// Id of the effect; of a catch-all, `disturbance`.
    pub id: String,
    /// Sensor, actuator, state or parameter.
    pub target: String,
    pub kind: Kind,
}

impl Candidate {
    /// `id@target`.
    pub fn key(&self) -> String {
        EffectKey::new(&self.id, &self.target).to_string()
    }

    pub fn is_listed(&self) -> bool {
        matches!(self.kind, Kind::Listed(_))
    }

    /// Returns true where only the noise changes, so that no free run moves.
    pub fn is_noise(&self) -> bool {
        match &self.kind {
            Kind::Listed(effect) => effect.law().is_noise(),
            Kind::CatchAll(..) => true,
        }
    }

    /// The numbers of the law; of a catch-all, its strength.
    pub fn magnitudes(&self) -> Vec<Magnitude> {
        match &self.kind {
            Kind::Listed(effect) => effect.magnitudes().to_vec(),
            Kind::CatchAll(..) => vec![Magnitude::positive("std", "", &[0.05])],
        }
    }
}

/// An effect with those of its magnitudes that are held at their off value.
#[derive(Debug, Clone)]
pub(in crate::diagnose) struct Addition {
    pub effect: Effect,
    pub held: BTreeMap<String, f64>,
    /// Memory values that filters keep of a delay.
    pub kept: Option<usize>,
}

/// The twin with some effects, for filters: delays are cut short.
pub(in crate::diagnose) fn with(
    base: &Twin,
    additions: &[Addition],
) -> Result<Twin, DiagnoseError> {
    let (mut effects, mut memories) = (vec![], vec![]);
    let mut held = BTreeMap::new();
    for addition in additions {
        let effect = &addition.effect;
        effects.push(effect.clone());
        memories.push(addition.kept.unwrap_or(effect.kind().memories().1));
        held.extend((addition.held.iter()).map(|(name, v)| (effect.key().magnitude(name), *v)));
    }
    Ok(fix(augment_short(base.clone(), effects, memories)?, &held)?)
}

/// The twin with a catch-all on top.
pub(in crate::diagnose) fn with_disturbance(base: &Twin, entry: Entry, memory: f64) -> Twin {
    disturbed(base.clone(), entry, memory)
}

/// Every listed effect that the study lets a diagnosis name and a filter knows; then a catch-all for each state, sensor and
/// own parameter.
pub(in crate::diagnose) fn candidates(
    study: &Study,
    without: &[EffectPattern],
) -> Result<Vec<Candidate>, DiagnoseError> {
    if let Some(name) = without.iter().find(|name| !study.knows_effect(name)) {
        return Err(DiagnoseError::Without(study.with_nearest_effect(name)));
    }
    let twin = study.twin();
    let already = already(study);
    let mut all: Vec<Candidate> = (study.candidates().into_iter())
        .filter(|effect| !without.iter().any(|pattern| pattern.matches(effect.key())))
        .map(|effect| Candidate {
            id: effect.id().into(),
            target: effect.target().into(),
            kind: Kind::Listed(effect),
        })
        .filter(|c| !already.contains(&c.key()))
        .collect();
    all.extend(match twin.outline() {
        Some(outline) => catch_alls(&outline),
        None => catch_alls_of_signals(&twin.signals()),
    });
    Ok(all)
}

/// Effects that the twin may lack beside these candidates and its own effects.
pub(in crate::diagnose) fn not_tested(study: &Study, candidates: &[Candidate]) -> Vec<String> {
    let known: Vec<String> = candidates
        .iter()
        .map(Candidate::key)
        .chain(already(study))
        .collect();
    let mut keys: Vec<String> = (study.effects().iter())
        .map(|e| e.key().to_string())
        .filter(|key| !known.contains(key))
        .collect();
    keys.dedup();
    keys
}

/// Effects that the study has added to its twin.
fn already(study: &Study) -> Vec<String> {
    (study.file().effect.iter())
        .map(|e| EffectKey::new(&e.id, &e.target).to_string())
        .collect()
}

fn catch_alls(outline: &Outline) -> Vec<Candidate> {
    let states = (outline.states.iter().enumerate())
        .filter(|(_, s)| !is_memory(&s.name))
        .map(|(i, s)| (Entry::State(i), s.name.clone()));
    let sensors = numbered("sensor", outline.outputs.len(), Entry::Sensor);
    let parameters = (outline.parameters.iter().enumerate())
        .filter(|(_, p)| p.role == Role::Parameter)
        .map(|(i, p)| (Entry::Parameter(i), p.name.clone()));
    disturbances(states.chain(sensors).chain(parameters))
}

/// Disturbances of a twin without equations.
fn catch_alls_of_signals(signals: &Signals) -> Vec<Candidate> {
    let sensors = numbered("sensor", signals.outputs.len(), Entry::Sensor);
    let actuators = numbered("actuator", signals.inputs.len(), Entry::Actuator);
    disturbances(sensors.chain(actuators))
}

/// Places and targets of all sensors or actuators.
fn numbered(
    word: &str,
    count: usize,
    entry: fn(usize) -> Entry,
) -> impl Iterator<Item = (Entry, String)> {
    (0..count).map(move |j| match count {
        1 => (entry(j), word.to_owned()),
        _ => (entry(j), format!("{word}{}", j + 1)),
    })
}

fn disturbances(entries: impl Iterator<Item = (Entry, String)>) -> Vec<Candidate> {
    entries
        .flat_map(|(entry, target)| {
            Thresholds::MEMORIES.map(|memory| Candidate {
                id: "disturbance".into(),
                target: target.clone(),
                kind: Kind::CatchAll(entry, memory),
            })
        })
        .collect()
}
