//! Units of everything that a diagnosis names, as far as the twin tells them.

use super::digits::{named, with_unit};
use crate::diagnose::EffectFit;
use crate::effect::{Effect, channel, magnitude_unit};
use crate::record::{Quantity, Signals};
use crate::study::Study;

/// The quantities of a twin, and the effects that it may lack.
pub(super) struct Units {
    pub(super) signals: Signals,
    states: Vec<Quantity>,
    effects: Vec<Effect>,
}

impl Units {
    pub(super) fn of(study: &Study) -> Self {
        let outline = study.twin().outline();
        Self {
            signals: study.twin().signals(),
            states: outline.map_or_else(Vec::new, |outline| outline.states),
            effects: study.effects(),
        }
    }

    /// The effect of this id and target.
    pub(super) fn effect(&self, id: &str, target: &str) -> Option<&Effect> {
        (self.effects.iter()).find(|e| e.id() == id && e.target() == target)
    }

    /// Returns the unit of a state, an input, an output or time.
    pub(super) fn variable(&self, name: &str) -> &str {
        let signals = self.signals.inputs.iter().chain(&self.signals.outputs);
        let known = (self.states.iter().chain(signals)).find(|q| q.name == name);
        let other = if name == "t" { "s" } else { "" };
        known.map_or(other, |q| &q.unit)
    }

    /// Tells whether the name is a state's: its equation gives a rate.
    fn is_state(&self, name: &str) -> bool {
        self.states.iter().any(|q| q.name == name)
    }

    /// Tells whether the name is a parameter's: no state, sensor or actuator has it.
    pub(super) fn is_parameter(&self, name: &str) -> bool {
        !self.is_state(name) && self.signal(name).is_none()
    }

    /// `h1 in V`.
    pub(super) fn named(&self, variable: &str) -> String {
        named(&Quantity::new(variable, self.variable(variable)))
    }

    /// Returns the unit of what joins a state's rate, or a signal.
    pub(super) fn place_unit(&self, name: &str) -> String {
        let unit = match self.signal(name) {
            Some((_, signal)) => signal.unit.as_str(),
            None => self.variable(name),
        };
        match self.is_state(name) {
            true => Quantity::new(name, unit).rate_unit(),
            false => unit.into(),
        }
    }

    /// The quantity that an unknown function joins: `rate of h1`, `output y` of a sensor, `input u` of an actuator, `logarithm of k1`.
    pub(super) fn place_name(&self, name: &str) -> String {
        match self.signal(name) {
            Some((kind, signal)) => format!("{kind} {}", signal.name),
            None if self.is_state(name) => format!("rate of {name}"),
            None => format!("logarithm of {name}"),
        }
    }

    /// `rate of h1 in V/s`, or `output y in V`.
    pub(super) fn place(&self, name: &str) -> String {
        named(&Quantity::new(
            &self.place_name(name),
            &self.place_unit(name),
        ))
    }

    /// `the upper tank (h1)`, `the sensor of y`, or the name alone of what is not described.
    pub(super) fn in_words(&self, place: &str) -> String {
        let described = |q: &Quantity| match q.description.as_str() {
            "" => q.name.clone(),
            text => format!("the {text} ({})", q.name),
        };
        match self.signal(place) {
            Some(("output", signal)) => format!("the sensor of {}", described(signal)),
            Some((_, signal)) => format!("the actuator of {}", described(signal)),
            None => match self.states.iter().find(|q| q.name == place) {
                Some(state) => described(state),
                None => place.to_owned(),
            },
        }
    }

    /// Returns the signal of a sensor or an actuator, and its kind.
    pub(super) fn signal(&self, place: &str) -> Option<(&'static str, &Quantity)> {
        if self.is_state(place) {
            return None;
        }
        match place.trim_end_matches(|c: char| c.is_ascii_digit()) {
            "sensor" => Some(("output", channel(&self.signals.outputs, place)?)),
            "actuator" => Some(("input", channel(&self.signals.inputs, place)?)),
            _ => None,
        }
    }

    /// The unit of one magnitude of a listed effect; none where the effect is not known.
    pub(super) fn of_magnitude(&self, id: &str, target: &str, name: &str) -> Option<String> {
        let effect = self.effect(id, target)?;
        let known = effect.magnitudes().iter().find(|m| m.name == name)?;
        Some(magnitude_unit(
            effect,
            known.unit,
            &self.states,
            &self.signals,
        ))
    }

    /// `level 3.00 V, spill 0.500`; values held at infinity are left out.
    pub(super) fn magnitudes(&self, fit: &EffectFit) -> String {
        let finite = fit.magnitudes.iter().filter(|(_, value)| value.is_finite());
        let all: Vec<String> = finite
            .map(|(name, value)| {
                let unit = self.of_magnitude(&fit.id, &fit.target, name);
                format!("{name} {}", with_unit(*value, &unit.unwrap_or_default()))
            })
            .collect();
        all.join(", ")
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evaluate::paper::reference_studies;

    fn fit(id: &str, target: &str, magnitudes: &[(&str, f64)]) -> EffectFit {
        EffectFit {
            id: id.into(),
            target: target.into(),
            probability: 1.0,
            magnitudes: magnitudes.iter().map(|(n, v)| ((*n).into(), *v)).collect(),
            log_evidence: 1.0,
            also: vec![],
        }
    }

    #[test]
    fn magnitudes_are_in_the_units_of_the_twin() {
        let studies = reference_studies().unwrap();
        for (study, fit, expected) in [
            (
                1,
                fit("state-ceiling", "h1", &[("level", 3.0), ("spill", 0.5)]),
                "level 3.00 V, spill 0.500",
            ),
            (
                1,
                fit("cross-coupling", "h2", &[("rate", 0.1)]),
                "rate 0.100 V/(V·s)",
            ),
            (
                1,
                fit("quadratic-drag", "h2", &[("coefficient", 0.1)]),
                "coefficient 0.100 1/(V·s)",
            ),
            (
                1,
                fit(
                    "actuator-saturation",
                    "actuator",
                    &[("low", f64::NEG_INFINITY), ("high", 2.0)],
                ),
                "high 2.00 V",
            ),
            (
                1,
                fit("parameter-step", "k1", &[("size", 0.5), ("time", 20.0)]),
                "size 0.500, time 20.0 s",
            ),
            (
                0,
                fit("sensor-bias", "sensor", &[("offset", 0.5)]),
                "offset 0.500",
            ),
            (
                0,
                fit("constant-forcing", "x2", &[("force", 0.5)]),
                "force 0.500 (1/s)/s",
            ),
            (0, fit("magnet", "x2", &[("pull", 0.5)]), "pull 0.500"),
        ] {
            assert_eq!(Units::of(&studies[study]).magnitudes(&fit), expected);
        }
    }

    #[test]
    fn places_are_named_with_the_unit_of_what_joins_them() {
        let studies = reference_studies().unwrap();
        let [oscillator, tanks] = [0, 1].map(|i| Units::of(&studies[i]));
        assert_eq!(tanks.place("h1"), "rate of h1 in V/s");
        assert_eq!(tanks.place("sensor"), "output y in V");
        assert_eq!(tanks.place("actuator"), "input u in V");
        assert_eq!(tanks.place("k1"), "logarithm of k1");
        assert_eq!(tanks.named("t"), "t in s");
        assert_eq!(tanks.named("h2"), "h2 in V");
        assert_eq!(oscillator.place("x1"), "rate of x1 in 1/s");
        assert_eq!(oscillator.place("x2"), "rate of x2 in (1/s)/s");
        let level = tanks.of_magnitude("state-ceiling", "h1", "level");
        assert_eq!(level.as_deref(), Some("V"));
        assert_eq!(tanks.of_magnitude("state-ceiling", "h9", "level"), None);
    }
}
