//! Effects against the twin that they are added to.

use super::kind::OtherState;
use super::law::{NOISE_ENTERS, TargetKind};
use super::placed::Effect;
use crate::record::Signals;
use crate::setting::{did_you_mean, number};
use crate::twin::{Law, Outline, TwinError, is_memory};

/// Returns the names of all targets of a kind, in a twin with these equations (none: a black box) and signals.
pub(crate) fn targets(
    kind: TargetKind,
    outline: Option<&Outline>,
    signals: &Signals,
) -> Vec<String> {
    let numbered = |word: &str, n: usize| match n {
        1 => vec![word.to_owned()],
        _ => (1..=n).map(|j| format!("{word}{j}")).collect(),
    };
    match kind {
        TargetKind::Sensor => numbered("sensor", signals.outputs.len()),
        TargetKind::Actuator => numbered("actuator", signals.inputs.len()),
        TargetKind::State => outline.map_or_else(Vec::new, |o| {
            o.states.iter().map(|s| s.name.clone()).collect()
        }),
        TargetKind::Parameter => outline.map_or_else(Vec::new, |o| {
            o.parameters.iter().map(|p| p.name.clone()).collect()
        }),
    }
}

/// Checks that each effect can be added to a twin with these equations (none: a black box) and signals.
pub(crate) fn check_effects(
    effects: &[Effect],
    outline: Option<&Outline>,
    signals: &Signals,
) -> Result<(), TwinError> {
    for effect in effects {
        check_place(effect, outline, signals)?;
        let same = effects.iter().filter(|other| other.key() == effect.key());
        if same.count() > 1 {
            let problem = format!(" on {} is given twice; give it once", effect.target());
            return Err(refused(effect, "target", &problem));
        }
        check_given(effect)?;
    }
    Ok(())
}

/// Creates the error of an effect, at a key of its table.
fn refused(effect: &Effect, key: &str, problem: &str) -> TwinError {
    TwinError::effect(key, format!("effect {}{problem}", effect.id()))
}

fn check_place(
    effect: &Effect,
    outline: Option<&Outline>,
    signals: &Signals,
) -> Result<(), TwinError> {
    let (kind, target) = (effect.law().target(), effect.target());
    if outline.is_none() && !kind.is_signal() {
        let problem = " bends the equations, which a black-box twin does not show; only sensor and actuator effects can be added";
        return Err(refused(effect, "id", problem));
    }
    if matches!(effect.law(), Law::Sensor(_))
        && effect.kind().memory_values() > 0
        && effect.kind().position() > NOISE_ENTERS
    {
        let problem =
            format!(" remembers and stands after the noise; give it an order below {NOISE_ENTERS}");
        return Err(refused(effect, "id", &problem));
    }
    let known = targets(kind, outline, signals);
    let other = effect.kind().other_state().map_or("from", OtherState::key);
    let places = [("target", Some(target)), (other, effect.other())];
    for (key, name) in places.into_iter().filter_map(|(k, name)| Some((k, name?))) {
        if !known.iter().any(|k| k == name) {
            let known = match known.is_empty() {
                true => "none: there is nothing of the kind".to_owned(),
                false => known.join(", "),
            };
            let (what, meant) = (kind.name(), did_you_mean(name, known.split(", ")));
            let problem =
                format!(": the twin has no {what} \"{name}\"{meant}; choose one of {known}");
            return Err(refused(effect, key, &problem));
        }
    }
    // A twin of a single state has no other one: there, what a limit takes is lost.
    let has_one = known.iter().filter(|name| !is_memory(name)).count() == 1;
    let lost = matches!(effect.law(), Law::Limit(_)) && has_one;
    let of_itself = effect.kind().other_state() == Some(OtherState::RateOfOrItself);
    if effect.other() == Some(target) && !lost && !of_itself {
        let problem = match has_one {
            true => format!(" goes from {target} to itself, the only state; leave the effect out"),
            false => format!(" goes from {target} to itself; name another state"),
        };
        return Err(refused(effect, other, &problem));
    }
    Ok(())
}

/// Checks that an effect has the magnitudes that it is given, within their limits.
pub(super) fn check_given(effect: &Effect) -> Result<(), TwinError> {
    let declared = effect.magnitudes();
    for (name, &value) in effect.all_given() {
        let problem = match declared.iter().find(|m| m.name == name.as_str()) {
            Some(magnitude) if magnitude.limits.contains(value) => continue,
            Some(magnitude) => format!(
                ": {name} = {} is outside {}; choose a value inside",
                number(value),
                magnitude.limits
            ),
            None => {
                let known: Vec<_> = declared.iter().map(|m| m.name).collect();
                let meant = did_you_mean(name, known.iter().copied());
                let known = known.join(", ");
                format!(" has no magnitude \"{name}\"{meant}; it has {known}")
            }
        };
        return Err(refused(effect, name, &problem));
    }
    check_range(effect)
}

/// Checks magnitudes that are all given at a step in seconds, as a delay, which a register of so many samples keeps.
pub(super) fn check_at(effect: &Effect, step: f64) -> Result<(), TwinError> {
    let given = effect.magnitudes().iter().map(|m| effect.given(m.name));
    let Some(values) = given.collect::<Option<Vec<f64>>>() else {
        return Ok(());
    };
    let first = effect.magnitudes().first().map_or("id", |m| m.name);
    let check = effect.kind().check_values(&values, step);
    check.map_err(|problem| refused(effect, first, &format!(": {problem}")))
}

/// Checks that the ends of a range, which are off at −∞ and at ∞, are in order where both are given.
fn check_range(effect: &Effect) -> Result<(), TwinError> {
    let end = |off: f64| {
        let mut ends = effect.magnitudes().iter().filter(|m| m.off == Some(off));
        let name = ends.next()?.name;
        Some((name, *effect.all_given().get(name)?))
    };
    match end(f64::NEG_INFINITY).zip(end(f64::INFINITY)) {
        Some(((low, below), (high, above))) if below > above => {
            let (below, above) = (number(below), number(above));
            let problem = format!(": {low} = {below} is above {high} = {above}; swap them");
            Err(refused(effect, low, &problem))
        }
        _ => Ok(()),
    }
}
