//! Effects against the twin that they are added to.

use super::law::{NOISE_ENTERS, TargetKind};
use super::placed::Effect;
use crate::record::Signals;
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
        let (id, target) = (effect.id().to_owned(), effect.target().to_owned());
        let same = effects.iter().filter(|other| other.key() == effect.key());
        if same.count() > 1 {
            return Err(TwinError::DuplicateEffect { id, target });
        }
        check_given(effect)?;
    }
    Ok(())
}

fn check_place(
    effect: &Effect,
    outline: Option<&Outline>,
    signals: &Signals,
) -> Result<(), TwinError> {
    let (id, law) = (effect.id().to_owned(), effect.law());
    let kind = law.target();
    if outline.is_none() && !kind.is_signal() {
        return Err(TwinError::EffectOnBlackBox { id });
    }
    if matches!(law, Law::Sensor(_))
        && effect.kind().memory_values() > 0
        && effect.kind().position() > NOISE_ENTERS
    {
        return Err(TwinError::EffectMemory {
            id,
            limit: NOISE_ENTERS,
        });
    }
    let known = targets(kind, outline, signals);
    for name in [Some(effect.target()), effect.other()]
        .into_iter()
        .flatten()
    {
        if !known.iter().any(|k| k == name) {
            return Err(TwinError::EffectTarget {
                id,
                what: kind.name(),
                name: name.into(),
                known: if known.is_empty() {
                    "none: there is nothing of the kind".into()
                } else {
                    known.join(", ")
                },
            });
        }
    }
    // A twin of a single state has no other one: there, what a limit takes is lost.
    let alone = known.iter().filter(|name| !is_memory(name)).count() == 1;
    let lost = matches!(law, Law::Limit(_)) && alone;
    if effect.other() == Some(effect.target()) && !lost {
        let target = effect.target().to_owned();
        return Err(TwinError::EffectOnItself { id, target });
    }
    Ok(())
}

fn check_given(effect: &Effect) -> Result<(), TwinError> {
    let declared = effect.magnitudes();
    for (name, &value) in effect.all_given() {
        let id = effect.id().to_owned();
        let Some(magnitude) = declared.iter().find(|m| m.name == name.as_str()) else {
            let known: Vec<_> = declared.iter().map(|m| m.name).collect();
            return Err(TwinError::UnknownMagnitude {
                id,
                name: name.into(),
                known: known.join(", "),
            });
        };
        if !magnitude.limits.contains(value) {
            return Err(TwinError::MagnitudeValue {
                id,
                name: name.into(),
                value,
                limits: magnitude.limits.to_string(),
            });
        }
    }
    Ok(())
}
