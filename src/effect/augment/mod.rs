//! Twins with effects: each effect is a part of the twin.

use super::Shape;
use super::check::{check_effects, targets};
use super::law::NOISE_ENTERS;
use super::placed::{Effect, magnitude_unit};
use crate::record::{Quantity, Signals};
use crate::twin::{
    Follows, Interval, Law, LawPart, Parameter, Role, Seen, SimulationError, Twin, TwinError,
    TwinPart,
};
use std::ops::Range;
use std::sync::Arc;

/// Adds `effects` to a twin. The result is a twin, its θ longer by their magnitudes, named `id@target.magnitude`.
///
/// With every magnitude at its off value, trajectories agree with the twin's to the bit. Sensor and actuator
/// effects serve every twin, the others need equations.
///
/// In a step come equations and forces, then noise, then ceilings, then the twin's own limits. A black box's outputs already
/// contain its noise.
///
/// # Errors
///
/// [`TwinError`] where a target, a magnitude or the equations are missing.
///
/// ```
/// use std::sync::Arc;
/// use truetwin::effect::{Catalogue, augment};
/// use truetwin::record::Drive;
/// use truetwin::twin::{DigitalTwin, Noise};
/// use truetwin::twins::VanDerPol;
///
/// let bias = Catalogue::default().effect("sensor-bias", "sensor")?;
/// let twin = augment(Arc::new(VanDerPol), vec![bias])?;
/// assert_eq!(twin.parameters().names(), ["nu", "sensor-bias@sensor.offset"]);
///
/// let drive = Drive::autonomous(0.05, 10)?;
/// let plain = VanDerPol.simulate(&[1.0], &drive, Noise::OFF)?;
/// let biased = twin.simulate(&[1.0, 0.5], &drive, Noise::OFF)?;
/// assert_eq!(biased, plain + 0.5);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn augment(base: impl Into<Twin>, effects: Vec<Effect>) -> Result<Twin, TwinError> {
    augmented(base.into(), effects, false)
}

/// Adds effects as [`augment`] does; a delay of the only sensor makes the whole twin late: its states stand still until then, its inputs and
/// its time are those of before. A delay of several samples is the same to the last bits. One between samples interpolates inputs in
/// place of outputs, which would take noise out of these, as a lag does. Of a twin that is given doses, outputs are.
pub(crate) fn augment_late(base: Twin, effects: Vec<Effect>) -> Result<Twin, TwinError> {
    augmented(base, effects, true)
}

fn augmented(base: Twin, effects: Vec<Effect>, may_be_late: bool) -> Result<Twin, TwinError> {
    if effects.is_empty() {
        return Ok(base);
    }
    let outline = base.outline();
    let signals = base.signals();
    check_effects(&effects, outline.as_ref(), &signals)?;
    let states = outline.as_ref().map_or(&[][..], |o| &o.states);
    let mut parameters = Vec::new();
    let mut placed: Vec<(Effect, Range<usize>)> = Vec::new();
    for effect in effects {
        let from = base.entries() + parameters.len();
        parameters.extend(magnitude_parameters(&effect, states, &signals));
        placed.push((effect, from..base.entries() + parameters.len()));
    }
    // Along a signal, in the order of the library.
    placed.sort_by_key(|(effect, _)| effect.kind().position());
    // What waits for its delay would miss a dose, and what begins before its first row has moved by then.
    let misses = base.doses().contains(&true) || base.begins().is_some();
    let may_be_late = may_be_late && signals.outputs.len() == 1 && outline.is_some() && !misses;
    let is_late = |effect: &Effect| {
        may_be_late && effect.kind().is_dead_time() && matches!(effect.law(), Law::Sensor(_))
    };
    let late = placed.iter().filter(|(effect, _)| is_late(effect));
    let late: Vec<usize> = late.map(|(_, magnitudes)| magnitudes.start).collect();
    let mut parts: Vec<TwinPart> = (placed.iter().cloned())
        .map(|(effect, magnitudes)| check_of(effect, magnitudes))
        .collect();
    for (effect, magnitudes) in placed.into_iter().filter(|(effect, _)| !is_late(effect)) {
        let known = targets(effect.law().target(), outline.as_ref(), &signals);
        parts.push(TwinPart::Law(part(&base, &effect, magnitudes, &known)));
    }
    if !late.is_empty() {
        parts.push(TwinPart::Late(late));
    }
    Ok(base.with(parameters, parts))
}

/// Returns the check of an effect's magnitudes before a run.
fn check_of(effect: Effect, magnitudes: Range<usize>) -> TwinPart {
    TwinPart::Check(Arc::new(move |theta: &[f64], dt| {
        let check = effect.kind().check_values(&theta[magnitudes.clone()], dt);
        check
            .map_err(|problem| SimulationError::fatal(format!("effect {}: {problem}", effect.id())))
    }))
}

/// Returns the part that an effect is; `known` are the targets of its kind.
fn part(base: &Twin, effect: &Effect, magnitudes: Range<usize>, known: &[String]) -> LawPart {
    let index = |name: &str| known.iter().position(|k| k == name);
    let (kind, target) = (effect.kind(), index(effect.target()).unwrap_or(0));
    let (law, target) = match effect.law() {
        Law::Parameter(_) => (effect.law().clone(), base.entry(target)),
        Law::Sensor(law) if kind.position() > NOISE_ENTERS => (Law::Reading(law.clone()), target),
        law => (law.clone(), target),
    };
    LawPart {
        other: effect.other().and_then(index),
        memory: kind.memory_values(),
        follows: kind.remembers().map(|by| Follows {
            of: Seen::State(effect.other().and_then(index).unwrap_or(target)),
            by: by.clone(),
        }),
        is_dead_time: kind.is_dead_time(),
        time: (kind.magnitudes().iter()).position(|m| m.shape == Shape::Time),
        ..LawPart::new(law, effect.key().to_string(), target, magnitudes)
    }
}

/// Bounds of a magnitude whose limits are open, in multiples of its largest start. Starts are for a signal of size 1; a
/// sensor may read pascals or nanometres, so that the bounds must be wide. They are finite for the sake of differences near
/// them; fits start within the prior ([`Parameter::start_range`]).
const WIDE: f64 = 1e15;

/// Returns the magnitudes as parameters, their units those of the twin.
fn magnitude_parameters(effect: &Effect, states: &[Quantity], signals: &Signals) -> Vec<Parameter> {
    (effect.magnitudes().iter())
        .map(|m| {
            let reach = m.starts.iter().fold(1e-6, |a: f64, s| a.max(s.abs()));
            let finite = |limit: f64, open: f64| if limit.is_finite() { limit } else { open };
            let low = finite(m.limits.low(), -WIDE * reach);
            let high = finite(m.limits.high(), WIDE * reach);
            // What a file holds is within bounds, however far from the starts.
            let given = effect.given(m.name).filter(|v| v.is_finite());
            let bounds = Interval::unchecked(
                given.map_or(low, |v| low.min(v)),
                given.map_or(high, |v| high.max(v)),
            );
            let near = |v: f64| bounds.clamp(v);
            let prior = match m.limits.low() {
                0.0.. => Interval::unchecked(near(0.0), near(2.0 * reach)),
                _ => Interval::unchecked(near(-2.0 * reach), near(2.0 * reach)),
            };
            Parameter {
                name: effect.key().magnitude(m.name),
                unit: match magnitude_unit(effect, m.unit, states, signals) {
                    unit if unit.is_empty() => "-".into(),
                    unit => unit,
                },
                prior: if prior.check().is_ok() { prior } else { bounds },
                bounds,
                role: Role::Magnitude,
            }
        })
        .collect()
}

#[cfg(test)]
mod tests;
