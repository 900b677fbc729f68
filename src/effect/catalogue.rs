//! All effects that a program knows, and where in a twin each can stand.

use super::check::targets;
use super::key::EffectPattern;
use super::kind::{EffectKind, OtherState};
use super::library;
use super::placed::{Effect, EffectEntry};
use crate::setting::did_you_mean;
use crate::twin::{Composed, Outline, ParameterSpace, Role, Twin, TwinError, is_memory};
use std::sync::{Arc, LazyLock};

static LIBRARY: LazyLock<Vec<Arc<EffectKind>>> =
    LazyLock::new(|| library::rows().into_iter().map(Arc::new).collect());

/// The kinds of effects that a program knows: the library's, then its own.
#[derive(Debug, Clone)]
pub struct Catalogue(Vec<Arc<EffectKind>>);

impl Default for Catalogue {
    /// The library alone.
    fn default() -> Self {
        Self(LIBRARY.clone())
    }
}

impl Catalogue {
    /// Adds a kind; one of the same id is replaced.
    #[must_use]
    pub fn with(mut self, kind: EffectKind) -> Self {
        self.0.retain(|known| known.id() != kind.id());
        self.0.push(Arc::new(kind));
        self
    }

    /// Returns all kinds, in the order of the list of `docs/choosing-effects.md`.
    pub fn kinds(&self) -> &[Arc<EffectKind>] {
        &self.0
    }

    fn kind(&self, id: &str) -> Result<&Arc<EffectKind>, TwinError> {
        let known = self.0.iter().find(|kind| kind.id() == id);
        known.ok_or_else(|| {
            let known: Vec<&str> = self.0.iter().map(|kind| kind.id()).collect();
            let meant = did_you_mean(id, known.iter().copied());
            let known = known.join(", ");
            let problem = format!("unknown effect id \"{id}\"{meant}; choose one of {known}");
            TwinError::effect("id", problem)
        })
    }

    /// Returns the effect `id` at `target`, all magnitudes free. A law between two states needs
    /// [`Effect::with_other`], too. Whether the target exists is checked when the effect is added to a twin.
    pub fn effect(&self, id: &str, target: &str) -> Result<Effect, TwinError> {
        Ok(Effect::new(self.kind(id)?.clone(), target, None))
    }

    /// Returns the effect of an `[[effect]]` table.
    pub(crate) fn resolve(&self, entry: &EffectEntry) -> Result<Effect, TwinError> {
        Effect::from_entry(self.kind(&entry.id)?.clone(), entry)
    }

    /// Returns every effect that this twin may lack, once for each target and other state, all magnitudes free.
    ///
    /// Targets are the twin's own states and parameters, not the memories and magnitudes of effects already added.
    /// An effect of [`OtherState::RateOf`] is offered where a state is the rate of another; the drift is probed for that.
    pub fn applicable(&self, twin: &Twin) -> Vec<Effect> {
        let (equations, signals) = (twin.equations(), twin.signals());
        let outline = twin.outline().map(own);
        let rates = equations.map_or_else(Vec::new, rates);
        let mut effects = Vec::new();
        for kind in &self.0 {
            let known = targets(kind.law().target(), outline.as_ref(), &signals);
            for target in known.iter().filter(|target| kind.may_stand_on(target)) {
                let rest = || known.iter().filter(|name| *name != target);
                let others: Vec<Option<&String>> = match kind.other_state() {
                    None => vec![None],
                    Some(OtherState::RateOf) => (rates.iter())
                        .filter(|(rate, _)| rate == target)
                        .map(|(_, of)| Some(of))
                        .collect(),
                    Some(OtherState::RateOfOrItself) => {
                        let of = rates.iter().find(|(rate, _)| rate == target);
                        vec![Some(of.map_or(target, |(_, of)| of))]
                    }
                    // The excess of a single vessel is lost.
                    Some(OtherState::To) if known.len() == 1 => vec![Some(target)],
                    Some(OtherState::From | OtherState::To) => rest().map(Some).collect(),
                };
                effects.extend(
                    (others.into_iter())
                        .map(|other| Effect::new(kind.clone(), target, other.map(String::as_str))),
                );
            }
        }
        effects
    }

    /// Returns whether a pattern names a kind, or a kind at one of the targets of this twin.
    pub(crate) fn knows(&self, pattern: &EffectPattern, twin: &Twin) -> bool {
        let known = || self.applicable(twin);
        self.kind(pattern.as_str()).is_ok() || known().iter().any(|e| pattern.matches(e.key()))
    }
}

/// Returns the outline without the additions of effects and unknown levels. Names of added states hold a slash.
fn own(mut outline: Outline) -> Outline {
    outline.states.retain(|state| !is_memory(&state.name));
    outline.parameters = ParameterSpace::new(
        (outline.parameters.iter())
            .filter(|p| p.role == Role::Parameter)
            .cloned(),
    );
    outline
}

/// Pairs (rate, of) of states by name.
fn rates(twin: &Composed) -> Vec<(String, String)> {
    let states = twin.outline().states;
    let name = |i: usize| states[i].name.clone();
    (crate::twin::rates(twin).into_iter())
        .map(|(i, j)| (name(i), name(j)))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effect::Magnitude;
    use crate::twins::{CascadedTanks, VanDerPol};

    fn magnet() -> EffectKind {
        EffectKind::force("magnet", "", |m, at| -m[0] * at.x).magnitude(Magnitude::positive(
            "strength",
            "1/s",
            &[0.1],
        ))
    }

    fn keys(catalogue: &Catalogue, twin: &Twin) -> Vec<String> {
        let effects = catalogue.applicable(twin).into_iter();
        let magnets = effects.filter(|e| e.id() == "magnet");
        magnets.map(|e| e.key().to_string()).collect()
    }

    #[test]
    fn an_own_effect_is_offered_where_it_can_stand_and_known_to_files() {
        let tanks = Twin::new(CascadedTanks);
        let catalogue = Catalogue::default().with(magnet());
        assert_eq!(keys(&catalogue, &tanks), ["magnet@h1", "magnet@h2"]);
        let effects = catalogue.parse("[[effect]]\nid = 'magnet'\ntarget = 'h2'");
        assert_eq!(effects.unwrap()[0].target(), "h2");
        let only = Catalogue::default().with(magnet().only_on(["h2"]));
        assert_eq!(keys(&only, &tanks), ["magnet@h2"]);
        assert!(keys(&only, &Twin::new(VanDerPol)).is_empty());
        assert_eq!(only.with(magnet()).kinds().len(), 38, "one of an id");
    }

    #[test]
    fn an_unknown_id_is_answered_with_the_known_ones() {
        let error = Catalogue::default().effect("sensor-bais", "sensor");
        let message = error.unwrap_err().to_string();
        for word in ["did you mean \"sensor-bias\"", "parameter-step"] {
            assert!(message.contains(word), "{message}");
        }
    }
}
