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
    let memories = effects.iter().map(|e| e.kind().memories().1).collect();
    augment_short(base.into(), effects, memories)
}

/// Adds effects as [`augment`] does, with so many memory values for each of them, within what its law allows.
///
/// A filter's cost grows with the square of the states, and a delay's register is longer than most delays. Without any memory, a delay of
/// the only sensor makes the whole twin late: its states stand still until then, its inputs and its time are those of before. A delay of
/// several samples is the same to the last bits, one between samples interpolates inputs in place of outputs.
pub(crate) fn augment_short(
    base: Twin,
    effects: Vec<Effect>,
    memories: Vec<usize>,
) -> Result<Twin, TwinError> {
    if effects.is_empty() {
        return Ok(base);
    }
    let outline = base.outline();
    check_effects(&effects, outline.as_ref(), &base.signals())?;
    let slots = Slots::of(&base, &effects, &memories);
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
    /// Memory values.
    memory: usize,
    /// True of a delay of the only sensor that makes the whole twin late, and needs no memory.
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
        // No filter pays for the states of a long register here.
        let mut memory = vec![channel[0]; self.effect.kind().memories().1];
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
    fn of(base: &Twin, effects: &[Effect], memories: &[usize]) -> Self {
        let outline = base.outline();
        let signals = base.signals();
        let states = outline.as_ref().map_or(&[][..], |o| &o.states);
        let base = base.parameters().len();
        let mut parameters = Vec::new();
        let mut all: Vec<Slot> = Vec::new();
        for (effect, &memory) in effects.iter().zip(memories) {
            let known = targets(effect.law().target(), outline.as_ref(), &signals);
            let index = |name: &str| known.iter().position(|k| k == name);
            let from = base + parameters.len();
            parameters.extend(magnitude_parameters(effect, states, &signals));
            let (least, most) = effect.kind().memories();
            let only = signals.outputs.len() == 1 && matches!(effect.law(), Law::Sensor(_));
            let late = memory == 0 && least < most && only && outline.is_some();
            let place = Place {
                magnitudes: from..base + parameters.len(),
                target: index(effect.target()).unwrap_or(0),
                other: effect.other().and_then(index),
                memory: if late { 0 } else { memory.clamp(least, most) },
                late,
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
mod tests {
    use super::*;
    use crate::effect::{Catalogue, Magnitude, OtherState};
    use crate::twin::{Acting, Hold, Noise, Stepping};
    use crate::twins::CascadedTanks;

    #[test]
    fn delays_that_fit_a_short_register_are_exact() {
        let delay = Catalogue::default()
            .effect("sensor-delay", "sensor")
            .unwrap();
        let base = Twin::new(CascadedTanks);
        let long = augment(base.clone(), vec![delay.clone()]).unwrap();
        let short = augment_short(base, vec![delay], vec![5]).unwrap();
        let states = |twin: &Twin| twin.outline().unwrap().states.len();
        assert_eq!((states(&long), states(&short)), (2 + 64, 2 + 5));
        let u = Signal::from_shape_fn((80, 1), |(k, _)| (k % 17) as f64 / 6.0);
        let drive = Drive::new(0.5, u).unwrap();
        for delay in [0.0, 0.7, 2.0] {
            let theta = [0.6, 0.5, 0.55, 1.0, delay];
            let noise = Noise::new(1, "t", 0);
            let run = |twin: &Twin| twin.simulate(&theta, &drive, noise).unwrap();
            assert_eq!(run(&long), run(&short));
        }
    }

    /// A twin that is late shows what a register shows, while it stands still at the start, too.
    #[test]
    fn a_late_twin_is_a_twin_with_a_late_sensor() {
        let delay = || Catalogue::default().effect("sensor-delay", "sensor");
        let base = Twin::new(CascadedTanks);
        let register = augment(base.clone(), vec![delay().unwrap()]).unwrap();
        let late = augment_short(base, vec![delay().unwrap()], vec![0]).unwrap();
        assert_eq!(late.outline().unwrap().states.len(), 2);
        let u = Signal::from_shape_fn((120, 1), |(k, _)| ((k / 9) % 5) as f64 / 2.0);
        let drive = Drive::new(0.5, u).unwrap();
        for (delay, near) in [(0.0, 1e-12), (10.0, 1e-12), (7.3, 0.1)] {
            let theta = [0.6, 0.5, 0.55, 1.0, delay];
            let run = |twin: &Twin| twin.free_run(&theta, &drive).unwrap();
            let difference = run(&register) - run(&late);
            let most = difference.iter().fold(0.0, |a: f64, d| a.max(d.abs()));
            assert!(most < near, "{delay}: {most}");
        }
    }

    /// Actuators remember nothing in the state: a delay there is the twin with its inputs later, the first one held before.
    #[test]
    fn a_delayed_input_costs_no_state() {
        let delay = Catalogue::default()
            .effect("actuator-delay", "actuator")
            .unwrap();
        let base = Twin::new(CascadedTanks);
        let twin = augment(base.clone(), vec![delay]).unwrap();
        assert_eq!(twin.outline().unwrap().states.len(), 2);
        let input = |k: usize| (k % 17) as f64 / 6.0;
        let drive = |late: usize| {
            let rows = Signal::from_shape_fn((80, 1), |(k, _)| input(k.saturating_sub(late)));
            Drive::new(0.5, rows).unwrap()
        };
        let theta = [0.6, 0.5, 0.55, 1.0];
        let noise = Noise::new(1, "t", 0);
        let later = base.simulate(&theta, &drive(30), noise).unwrap();
        let delayed = twin.simulate(&[&theta[..], &[15.0]].concat(), &drive(0), noise);
        assert_eq!(delayed.unwrap(), later);
    }

    /// A force of one's own sees inputs, parameters bent by other effects, all states and the time.
    #[test]
    fn a_force_sees_the_whole_twin() {
        let kind = EffectKind::force("all", "", |m, at| {
            m[0] * (at.x + at.other + at.t + at.states[1] + at.u[0] + at.theta[3])
        })
        .magnitude(Magnitude::signed("size", "1", &[1.0]))
        .other(OtherState::From);
        let library = Catalogue::default().with(kind);
        let effects = vec![
            library.effect("all", "h1").unwrap().with_other("h2"),
            library.effect("actuator-bias", "actuator").unwrap(),
            library.effect("parameter-drift", "k4").unwrap(),
        ];
        let twin = augment(Twin::new(CascadedTanks), effects).unwrap();
        let equations = twin.equations().unwrap();
        let rate = |size: f64| {
            let theta = [0.6, 0.5, 0.55, 1.0, size, 0.25, 0.5];
            let drive = Drive::new(0.5, Signal::from_elem((5, 1), 3.0)).unwrap();
            let acting = Acting::of(equations, &theta, &drive).unwrap();
            let mut rates = [0.0; 2];
            equations.drift(&acting.at(4, &theta), &[4.0, 7.0], &mut rates);
            rates[0]
        };
        let expected = 4.0 + 7.0 + 2.0 + 7.0 + 3.25 + 1.0 * (1.0 + 0.5 * 2.0);
        assert!((rate(1.0) - rate(0.0) - expected).abs() < 1e-12);
    }

    /// Magnitudes have the units of the twin, not the placeholders of the library.
    #[test]
    fn magnitudes_have_units_of_the_twin() {
        let library = Catalogue::default();
        let effects = [
            "state-ceiling@h1",
            "quadratic-drag@h2",
            "sensor-drift@sensor",
        ];
        let placed = |key: &&str| {
            let (id, target) = key.split_once('@').unwrap();
            library.effect(id, target).unwrap()
        };
        let effects = effects.iter().map(placed);
        let effects = effects.map(|effect| match effect.id() {
            "state-ceiling" => effect.with_other("h2"),
            _ => effect,
        });
        let twin = augment(Twin::new(CascadedTanks), effects.collect()).unwrap();
        let units: Vec<String> = (twin.parameters().iter().skip(4))
            .map(|p| format!("{} {}", p.name, p.unit))
            .collect();
        assert_eq!(
            units,
            [
                "state-ceiling@h1.level V",
                "state-ceiling@h1.spill -",
                "quadratic-drag@h2.coefficient 1/(V·s)",
                "sensor-drift@sensor.rate V/s",
            ]
        );
    }

    /// A sensor in pascals has a bias of thousands; a fraction stays a fraction.
    #[test]
    fn bounds_of_magnitudes_are_the_limits_of_their_law() {
        let library = Catalogue::default();
        let signals = Twin::new(CascadedTanks).signals();
        let of = |id| magnitude_parameters(&library.effect(id, "sensor").unwrap(), &[], &signals);
        assert!(of("sensor-bias")[0].bounds.contains(-1e5));
        let drift = &of("sensor-drift")[0];
        assert!(drift.bounds.contains(1e3) && drift.start_range() == drift.prior);
        let noise = of("sensor-noise")[0].bounds;
        assert_eq!(noise.low(), 0.0);
        assert!(noise.contains(1e4));
        assert_eq!(of("sensor-rectification")[0].bounds.high(), 1.0);
    }

    /// Between samples, effects on inputs leave a line a line: off, no bit changes; a bias moves both ends.
    #[test]
    fn actuator_effects_keep_inputs_on_lines() {
        let linear = |_: &mut _, stepping: &mut Stepping| {
            stepping.hold = Hold::Linear;
            stepping.substeps = 3;
        };
        let base = Twin::new(CascadedTanks).stepped(linear).unwrap();
        let levels = |shift: f64| {
            let levels = |(k, _)| shift + [1.5, 2.5, 0.5][k / 10 % 3];
            Drive::new(0.5, Signal::from_shape_fn((60, 1), levels)).unwrap()
        };
        let theta = [0.6, 0.5, 0.55, 1.0];
        let with = |magnitudes: &[f64]| [&theta[..], magnitudes].concat();
        let plain = base
            .simulate(&theta, &levels(0.0), Noise::new(1, "line", 0))
            .unwrap();
        let run = |ids: &[&str], magnitudes: &[f64]| {
            let library = Catalogue::default();
            let effects = ids.iter().map(|id| library.effect(id, "actuator").unwrap());
            // One after the other, so that one twin holds another.
            let twin = effects.fold(base.clone(), |twin, effect| {
                augment(twin, vec![effect]).unwrap()
            });
            let noise = Noise::new(1, "line", 0);
            twin.simulate(&with(magnitudes), &levels(0.0), noise)
                .unwrap()
        };
        assert_eq!(run(&["actuator-bias"], &[0.0]), plain);
        assert_eq!(run(&["actuator-lag", "actuator-bias"], &[0.0, 0.0]), plain);
        let shifted = base
            .simulate(&theta, &levels(0.25), Noise::new(1, "line", 0))
            .unwrap();
        let biased = run(&["actuator-bias"], &[0.25]);
        assert!((&biased - &shifted).iter().all(|d| d.abs() < 1e-12));
        assert_ne!(
            run(&["actuator-bias", "actuator-lag"], &[0.25, 2.0]),
            biased
        );
    }
}
