//! Units of everything that a diagnosis names, as far as the twin tells them.

use super::digits::{short, unit_suffix};
use crate::diagnose::EffectFit;
use crate::study::Study;
use crate::twin::{Effects, Law, Quantity, UnmodelledEffect};

/// The quantities of a twin, and the effects that it may lack.
pub(super) struct Units {
    pub(super) inputs: Vec<Quantity>,
    pub(super) outputs: Vec<Quantity>,
    states: Vec<Quantity>,
    effects: Effects,
}

impl Units {
    pub(super) fn of(study: &Study) -> Self {
        let signals = study.twin().signals();
        let outline = study.twin().state_space().map(|twin| twin.outline());
        Self {
            inputs: signals.inputs,
            outputs: signals.outputs,
            states: outline.map_or_else(Vec::new, |outline| outline.states),
            effects: study.effects(),
        }
    }

    /// The effect that was fitted.
    pub(super) fn effect(&self, fit: &EffectFit) -> Option<&dyn UnmodelledEffect> {
        (self.effects.iter())
            .find(|e| e.typetag_name() == fit.id && e.target() == fit.target)
            .map(|e| e.as_ref())
    }

    /// Of a state, an input or a black box's output.
    pub(super) fn variable(&self, name: &str) -> &str {
        let known = self
            .states
            .iter()
            .chain(&self.inputs)
            .chain(&self.outputs)
            .find(|q| q.name == name);
        known.map_or("", |q| &q.unit)
    }

    /// `level 3.00 V, spill 0.500`; values held at infinity are left out.
    pub(super) fn magnitudes(&self, fit: &EffectFit) -> String {
        let effect = self.effect(fit);
        let unit = |name: &str| {
            let known = effect?.magnitudes().into_iter().find(|m| m.name == name)?;
            Some(self.magnitude(effect?, known.unit))
        };
        let finite = fit.magnitudes.iter().filter(|(_, value)| value.is_finite());
        let all: Vec<String> = finite
            .map(|(name, value)| {
                let unit = unit(name).unwrap_or_default();
                format!("{name} {}{}", short(*value), unit_suffix(&unit))
            })
            .collect();
        all.join(", ")
    }

    /// A unit of the library in those of the twin: its words `signal`, `state` and `from` stand for the unit of what is
    /// bent, and of the other state.
    fn magnitude(&self, effect: &dyn UnmodelledEffect, unit: &str) -> String {
        let bent = match effect.law() {
            Law::Sensor | Law::MeasurementNoise | Law::Outliers => {
                channel(&self.outputs, effect.target())
            }
            Law::Actuator => channel(&self.inputs, effect.target()),
            Law::Force | Law::Limit | Law::ProcessNoise => self.variable(effect.target()),
            Law::Parameter => "",
        };
        let other = effect.other().map_or("", |name| self.variable(name));
        let inside = |word: &str, own: &str| match own {
            "" | "-" | "1" => "1".to_owned(),
            own if unit == word || own.chars().all(char::is_alphanumeric) => own.to_owned(),
            own => format!("({own})"),
        };
        let text = (unit.replace("signal", &inside("signal", bent)))
            .replace("state", &inside("state", bent))
            .replace("from", &inside("from", other));
        match text.replace("1·", "").replace("·1", "").as_str() {
            "1" | "1/1" => String::new(),
            text => text.replace("/(1/s)", "·s").replace("(s)", "s"),
        }
    }
}

/// The unit of `sensor`, or of `sensor2`.
fn channel<'a>(channels: &'a [Quantity], target: &str) -> &'a str {
    let number = target.trim_start_matches(|c: char| !c.is_ascii_digit());
    let index = number.parse().unwrap_or(1_usize).saturating_sub(1);
    channels.get(index).map_or("", |q| &q.unit)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiment::reference_studies;

    fn fit(id: &str, target: &str, magnitudes: &[(&str, f64)]) -> EffectFit {
        EffectFit {
            id: id.into(),
            target: target.into(),
            probability: 1.0,
            magnitudes: magnitudes.iter().map(|(n, v)| ((*n).into(), *v)).collect(),
            log_score_gain: 1.0,
            p_value: None,
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
}
