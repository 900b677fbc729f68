//! Twins with effects: one entry, with a type for equations and one for black boxes behind it.

mod black_box;
mod equations;
mod finish;

use super::batch::Pair;
use super::check::{check_effects, targets};
use super::kind::EffectKind;
use super::law::{Instant, Law, NOISE_ENTERS, SignalLaw};
use super::placed::Effect;
use super::unit::magnitude_unit;
use crate::record::{Drive, Quantity, RecordError, Signal, Signals};
use crate::twin::{
    Interval, Modified, Parameter, ParameterSpace, Role, SimulationError, Twin, TwinError,
};
use black_box::AugmentedBlackBox;
use equations::AugmentedEquations;
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
/// place of outputs, which would take noise out of these, as a lag does.
pub(crate) fn augment_late(base: Twin, effects: Vec<Effect>) -> Result<Twin, TwinError> {
    augmented(base, effects, true)
}

fn augmented(base: Twin, effects: Vec<Effect>, may_be_late: bool) -> Result<Twin, TwinError> {
    if effects.is_empty() {
        return Ok(base);
    }
    let outline = base.outline();
    check_effects(&effects, outline.as_ref(), &base.signals())?;
    let slots = Slots::of(&base, &effects, may_be_late);
    Ok(match base {
        Twin::Equations(base) => {
            Twin::Equations(Arc::new(Modified(AugmentedEquations::new(base, slots))))
        }
        Twin::BlackBox(base) => Twin::BlackBox(Arc::new(AugmentedBlackBox::new(base, slots))),
    })
}

/// Where the numbers of an effect stand.
#[derive(Debug, Clone)]
struct Place {
    /// Magnitudes in θ.
    magnitudes: Range<usize>,
    /// Index of the target among channels, states or parameters.
    target: usize,
    /// Index of the other state.
    other: Option<usize>,
    /// True of a delay of the only sensor that makes the whole twin late.
    late: bool,
}

impl Place {
    /// Target and other state.
    fn pair(&self) -> Pair {
        Pair {
            target: self.target,
            other: self.other,
        }
    }

    fn m<'a>(&self, theta: &'a [f64]) -> &'a [f64] {
        &theta[self.magnitudes.clone()]
    }
}

/// An effect and its place.
#[derive(Debug, Clone)]
struct Slot {
    effect: Effect,
    place: Place,
}

impl Slot {
    /// Returns whether the effect acts on readings, which contain the noise of measurement.
    fn is_of_readings(&self) -> bool {
        self.effect.kind().position() > NOISE_ENTERS
    }

    /// Passes the channel of a whole signal through a law.
    fn pass(&self, law: &SignalLaw, theta: &[f64], drive: &Drive, signal: &mut Signal) {
        let m = self.place.m(theta);
        let mut channel = signal.column_mut(self.place.target);
        let mut memory = vec![channel[0]; self.effect.kind().memory_values()];
        for (k, value) in channel.iter_mut().enumerate() {
            let now = Instant {
                t: drive.time(k),
                dt: drive.step(k),
            };
            *value = law(m, now, &mut memory, *value);
        }
    }
}

/// The function of a law, and its place.
struct Placed<L: ?Sized> {
    law: Arc<L>,
    at: Place,
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
    fn of(base: &Twin, effects: &[Effect], may_be_late: bool) -> Self {
        let outline = base.outline();
        let signals = base.signals();
        let states = outline.as_ref().map_or(&[][..], |o| &o.states);
        let base = base.parameters().len();
        let mut parameters = Vec::new();
        let mut all: Vec<Slot> = Vec::new();
        for effect in effects {
            let known = targets(effect.law().target(), outline.as_ref(), &signals);
            let index = |name: &str| known.iter().position(|k| k == name);
            let from = base + parameters.len();
            parameters.extend(magnitude_parameters(effect, states, &signals));
            let place = Place {
                magnitudes: from..base + parameters.len(),
                target: index(effect.target()).unwrap_or(0),
                other: effect.other().and_then(index),
                late: may_be_late
                    && effect.kind().is_dead_time()
                    && matches!(effect.law(), Law::Sensor(_))
                    && signals.outputs.len() == 1,
            };
            let effect = effect.clone();
            all.push(Slot { effect, place });
        }
        all.sort_by_key(|slot| slot.effect.kind().position());
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

    /// The functions of one kind of law.
    fn of_law<L: ?Sized>(&self, pick: impl Fn(&EffectKind) -> Option<&Arc<L>>) -> Vec<Placed<L>> {
        (self.all.iter())
            .filter_map(|slot| {
                Some(Placed {
                    law: pick(slot.effect.kind())?.clone(),
                    at: slot.place.clone(),
                })
            })
            .collect()
    }

    /// The drive behind the actuator effects; `None` without any.
    fn actuated(&self, theta: &[f64], drive: &Drive) -> Result<Option<Drive>, SimulationError> {
        let mut inputs: Option<Signal> = None;
        for slot in &self.all {
            if let Law::Actuator(law) = slot.effect.law() {
                let inputs = inputs.get_or_insert_with(|| drive.inputs().clone());
                slot.pass(law.as_ref(), theta, drive, inputs);
            }
        }
        let Some(inputs) = inputs else {
            return Ok(None);
        };
        match drive.with_inputs(inputs) {
            Ok(actuated) => Ok(Some(actuated)),
            Err(RecordError::NotFinite { sample, .. }) => Err(SimulationError::Diverged {
                at: drive.time(sample),
            }),
            Err(error) => Err(SimulationError::Fatal(error.into())),
        }
    }

    fn check(&self, theta: &[f64], dt: f64) -> Result<(), SimulationError> {
        for Slot { effect, place } in &self.all {
            (effect.kind().check_values(place.m(theta), dt)).map_err(|problem| {
                SimulationError::fatal(format!("effect {}: {problem}", effect.id()))
            })?;
        }
        Ok(())
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
