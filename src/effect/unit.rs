//! Units of magnitudes at a target of a twin.

use super::law::TargetKind;
use super::placed::Effect;
use crate::record::{Quantity, Signals};

/// Returns the unit of a magnitude in those of a twin: the words `signal`, `state` and `from` of the library stand for the unit of what is
/// bent, and of the other state. Empty where it has none.
pub(crate) fn magnitude_unit(
    effect: &Effect,
    unit: &str,
    states: &[Quantity],
    signals: &Signals,
) -> String {
    let of_state = |name: &str| {
        let state = states.iter().find(|q| q.name == name);
        state.map_or("", |q| q.unit.as_str())
    };
    let of = |channels| channel(channels, effect.target()).map_or("", |q: &Quantity| &q.unit);
    let bent = match effect.law().target() {
        TargetKind::Sensor => of(&signals.outputs),
        TargetKind::Actuator => of(&signals.inputs),
        TargetKind::State => of_state(effect.target()),
        TargetKind::Parameter => "",
    };
    let other = effect.other().map_or("", of_state);
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

/// Returns the channel of `sensor`, or of `sensor2`.
pub(crate) fn channel<'a>(channels: &'a [Quantity], target: &str) -> Option<&'a Quantity> {
    let number = target.trim_start_matches(|c: char| !c.is_ascii_digit());
    let index = number.parse().unwrap_or(1_usize).saturating_sub(1);
    channels.get(index)
}
