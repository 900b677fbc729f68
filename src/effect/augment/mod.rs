//! Twins with effects: the one door, with a type for equations and one for black boxes behind it.

mod black_box;
mod equations;
mod outliers;

use crate::effect::{EffectError, Effects, Law, UnmodelledEffect, check_effects};
use crate::twin::{Interval, Parameter, ParameterSpace, Role, SimulationError, Twin};
use black_box::AugmentedBlackBox;
use equations::AugmentedEquations;
use std::collections::BTreeMap;
use std::sync::Arc;

/// The twin with `effects` added: a twin, its θ longer by their magnitudes, named `id@target.magnitude`.
///
/// With every magnitude at its off value, trajectories agree with the twin's to the bit. Sensor and actuator
/// effects serve every twin, the others need equations.
///
/// Order along a signal is [`UnmodelledEffect::order`]; in a step come equations and forces, then noise, then
/// ceilings, then the twin's own limits. A black box's outputs already contain its noise.
///
/// # Errors
///
/// [`EffectError`] where a target, a magnitude or the equations are missing.
///
/// ```
/// use std::sync::Arc;
/// use truetwin::effect::SensorBias;
/// use truetwin::effect::{Given, augment};
/// use truetwin::record::Drive;
/// use truetwin::twin::{DigitalTwin, Noise};
/// use truetwin::twins::VanDerPol;
///
/// let bias = SensorBias { target: "sensor".into(), magnitudes: Given::default() };
/// let twin = augment(Arc::new(VanDerPol), vec![Arc::new(bias)])?;
/// assert_eq!(twin.parameters().names(), ["nu", "sensor-bias@sensor.offset"]);
///
/// let drive = Drive::autonomous(0.05, 10)?;
/// let plain = VanDerPol.simulate(&[1.0], &drive, Noise::OFF)?;
/// let biased = twin.simulate(&[1.0, 0.5], &drive, Noise::OFF)?;
/// assert_eq!(biased, plain + 0.5);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn augment(base: impl Into<Twin>, effects: Effects) -> Result<Twin, EffectError> {
    let whole = effects.iter().map(|e| (e.clone(), e.memory())).collect();
    augment_short(base.into(), whole)
}

/// [`augment`], with so many memory values for each effect; no fewer than [`UnmodelledEffect::least_memory`], no more than it has.
///
/// A filter's cost grows with the square of the states, and a delay's register is longer than most delays.
pub(crate) fn augment_short(
    base: Twin,
    effects: Vec<(Arc<dyn UnmodelledEffect>, usize)>,
) -> Result<Twin, EffectError> {
    if effects.is_empty() {
        return Ok(base);
    }
    let outline = base.outline();
    let (all, memories): (Effects, Vec<usize>) = effects.into_iter().unzip();
    check_effects(&all, outline.as_ref(), &base.signals())?;
    let slots = Slots::of(&base, all, &memories);
    Ok(match base {
        Twin::Equations(base) => Twin::Equations(Arc::new(AugmentedEquations::new(base, slots))),
        Twin::BlackBox(base) => Twin::BlackBox(Arc::new(AugmentedBlackBox::new(base, slots))),
    })
}

/// Magnitudes that effects' files give, by the names that [`augment`] gives their parameters.
///
/// ```
/// use std::sync::Arc;
/// use truetwin::effect::SensorBias;
/// use truetwin::effect::{Effects, Given, given_magnitudes};
///
/// let bias = SensorBias { target: "sensor".into(), magnitudes: Given::new([("offset", 0.5)]) };
/// let effects: Effects = vec![Arc::new(bias)];
/// assert_eq!(given_magnitudes(&effects)["sensor-bias@sensor.offset"], 0.5);
/// ```
pub fn given_magnitudes(effects: &[Arc<dyn UnmodelledEffect>]) -> BTreeMap<String, f64> {
    let named = effects.iter().flat_map(|effect| {
        effect.magnitudes().into_iter().filter_map(move |m| {
            let value = effect.given().get(m.name)?;
            Some((parameter_name(effect.as_ref(), m.name), value))
        })
    });
    named.collect()
}

/// `id@target.magnitude`.
fn parameter_name(effect: &dyn UnmodelledEffect, magnitude: &str) -> String {
    format!("{}@{}.{magnitude}", effect.typetag_name(), effect.target())
}

/// One effect and where its numbers stand.
#[derive(Debug, Clone)]
struct Slot {
    effect: Arc<dyn UnmodelledEffect>,
    /// Magnitudes in θ.
    magnitudes: std::ops::Range<usize>,
    /// Index of the target among channels, states or parameters.
    target: usize,
    /// Index of the other state.
    other: Option<usize>,
    /// Memory values.
    memory: usize,
}

impl Slot {
    fn m<'a>(&self, theta: &'a [f64]) -> &'a [f64] {
        &theta[self.magnitudes.clone()]
    }
}

/// The effects of a twin, sorted along the signal.
#[derive(Debug, Clone)]
struct Slots {
    /// Length of the base twin's θ.
    base: usize,
    all: Vec<Slot>,
    parameters: Vec<Parameter>,
}

impl Slots {
    /// Targets must have been checked.
    fn of(base: &Twin, effects: Effects, memories: &[usize]) -> Self {
        let outline = base.outline();
        let signals = base.signals();
        let base = base.parameters().len();
        let mut parameters = Vec::new();
        let mut all: Vec<Slot> = Vec::new();
        for (effect, &memory) in effects.into_iter().zip(memories) {
            let known = super::targets(effect.law(), outline.as_ref(), &signals);
            let index = |name: &str| known.iter().position(|k| k == name);
            let from = base + parameters.len();
            parameters.extend(magnitude_parameters(effect.as_ref()));
            all.push(Slot {
                magnitudes: from..base + parameters.len(),
                target: index(effect.target()).unwrap_or(0),
                other: effect.other().and_then(index),
                memory: memory.clamp(effect.least_memory().min(effect.memory()), effect.memory()),
                effect,
            });
        }
        all.sort_by_key(|slot| slot.effect.order());
        Self {
            base,
            all,
            parameters,
        }
    }

    /// The base twin's parameters, then the magnitudes.
    fn space(&self, base: &ParameterSpace) -> ParameterSpace {
        ParameterSpace::new(base.iter().chain(&self.parameters).cloned())
    }

    /// Slots of one law, with their place in `all`.
    fn with(&self, law: Law) -> impl Iterator<Item = &Slot> {
        self.all.iter().filter(move |s| s.effect.law() == law)
    }

    fn check(&self, theta: &[f64], dt: f64) -> Result<(), SimulationError> {
        for slot in &self.all {
            (slot.effect.check(slot.m(theta), dt)).map_err(|problem| {
                SimulationError::fatal(format!("effect {}: {problem}", slot.effect.typetag_name()))
            })?;
        }
        Ok(())
    }
}

/// Magnitudes as parameters: bounds from their limits, made finite by the largest start.
fn magnitude_parameters(effect: &dyn UnmodelledEffect) -> Vec<Parameter> {
    (effect.magnitudes().into_iter())
        .map(|m| {
            let reach = m.starts.iter().fold(1e-6, |a: f64, s| a.max(s.abs()));
            let off = m.off.filter(|v| v.is_finite()).unwrap_or(0.0);
            let finite =
                |limit: f64, fallback: f64| if limit.is_finite() { limit } else { fallback };
            let low = finite(m.limits.low(), off.min(0.0) - 10.0 * reach);
            let high = finite(m.limits.high(), off.max(0.0) + 10.0 * reach);
            // What a file holds is within bounds, however far from the starts.
            let given = effect.given().get(m.name).filter(|v| v.is_finite());
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
                name: parameter_name(effect, m.name),
                unit: m.unit.into(),
                prior: if prior.check().is_ok() { prior } else { bounds },
                bounds,
                role: Role::Effect,
            }
        })
        .collect()
}
