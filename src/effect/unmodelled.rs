//! What a twin may lack: the trait of an unmodelled effect.

use crate::record::Signals;
use crate::setting::did_you_mean;
use crate::twin::{Interval, Outliers, Outline, Source};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::fmt::Debug;
use std::sync::Arc;

/// The effects added to a twin, in the order in which they lengthen θ.
pub type Effects = Vec<Arc<dyn UnmodelledEffect>>;

/// Position along a sensor's signal at which the measurement noise enters; see [`UnmodelledEffect::order`].
pub const NOISE_ENTERS: u32 = 70;

/// Magnitudes as a file gives them: `magnitudes = { tau = 2.5 }`. What is not given is free, a part of θ.
///
/// ```
/// use truetwin::effect::Given;
///
/// let given = Given::new([("tau", 2.5)]);
/// assert_eq!(given.get("tau"), Some(2.5));
/// assert_eq!(given.get("offset"), None); // free: a part of θ
/// ```
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Given(BTreeMap<String, f64>);

impl Given {
    /// From pairs of name and value.
    pub fn new<'a>(values: impl IntoIterator<Item = (&'a str, f64)>) -> Self {
        Self(values.into_iter().map(|(n, v)| (n.into(), v)).collect())
    }

    /// The value of one magnitude, where the file gives it.
    pub fn get(&self, name: &str) -> Option<f64> {
        self.0.get(name).copied()
    }
}

/// One number of an effect's law.
///
/// ```
/// use truetwin::effect::Magnitude;
///
/// let width = Magnitude::positive("width", "signal", &[0.1, 0.4]);
/// assert_eq!(width.off, Some(0.0));
/// assert!(!width.limits.contains(-1.0));
/// let level = Magnitude::signed("level", "state", &[1.0]).off(f64::INFINITY);
/// assert!(level.is_threshold());
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Magnitude {
    /// Name, as in effect files.
    pub name: &'static str,
    /// Unit, for people.
    pub unit: &'static str,
    /// The value that switches the effect off; none for a *shape*, which has no effect of its own.
    pub off: Option<f64>,
    /// Values that a fit starts from, per unit of the signal or rate that the effect bends.
    pub starts: &'static [f64],
    /// Values that make sense: sign and size.
    pub limits: Interval,
}

impl Magnitude {
    /// Whether the magnitude is a level beyond which something happens: off at infinity.
    pub fn is_threshold(&self) -> bool {
        self.off.is_some_and(f64::is_infinite)
    }

    /// A magnitude that is off at 0, of either sign.
    pub const fn signed(name: &'static str, unit: &'static str, starts: &'static [f64]) -> Self {
        Self {
            name,
            unit,
            off: Some(0.0),
            starts,
            limits: Interval::EVERYTHING,
        }
    }

    /// A magnitude that is off at 0 and never negative.
    pub const fn positive(name: &'static str, unit: &'static str, starts: &'static [f64]) -> Self {
        Self {
            limits: Interval::unchecked(0.0, f64::INFINITY),
            ..Self::signed(name, unit, starts)
        }
    }

    /// With another off value.
    pub const fn off(mut self, off: f64) -> Self {
        self.off = Some(off);
        self
    }

    /// A shape: no value of it alone switches the effect off.
    pub const fn shape(mut self) -> Self {
        self.off = None;
        self
    }

    /// Within `[low, high]`.
    pub const fn within(mut self, low: f64, high: f64) -> Self {
        self.limits = Interval::unchecked(low, high);
        self
    }
}

/// Which law of the twin an effect bends, and so what its target names.
///
/// ```
/// use truetwin::effect::Law;
///
/// assert_eq!(Law::MeasurementNoise.target(), "sensor");
/// assert_eq!(Law::Force.target(), "state");
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Law {
    /// An output signal; target `sensor`, or `sensor1`… where there are several.
    Sensor,
    /// An input signal; target `actuator`, or `actuator1`…
    Actuator,
    /// The rate of a state; target is the state.
    Force,
    /// A limit on a state; target is the state.
    Limit,
    /// A parameter over time; target is the parameter.
    Parameter,
    /// The noise of an output; target as for a sensor.
    MeasurementNoise,
    /// Rare large errors of an output, after everything else; target as for a sensor.
    Outliers,
    /// The noise of a state; target is the state.
    ProcessNoise,
}

impl Law {
    /// What the target of such an effect is: `sensor`, `actuator`, `state` or `parameter`.
    pub fn target(self) -> &'static str {
        match self {
            Self::Sensor | Self::MeasurementNoise | Self::Outliers => "sensor",
            Self::Actuator => "actuator",
            Self::Parameter => "parameter",
            Self::Force | Self::Limit | Self::ProcessNoise => "state",
        }
    }
}

/// What outputs themselves show of an effect, whatever the twin: values that pile up where it would pile them up.
///
/// ```
/// use truetwin::effect::SensorQuantization;
/// use truetwin::effect::{Given, Mark, UnmodelledEffect};
///
/// let rounding = SensorQuantization { target: "sensor".into(), magnitudes: Given::default() };
/// let smooth: Vec<f64> = (0..99).map(|k| f64::from(k).sin()).collect();
/// let rounded: Vec<f64> = smooth.iter().map(|v| (v / 0.3).round() * 0.3).collect();
/// assert_eq!(rounding.mark(&smooth), Mark::Absent);
/// assert!(matches!(rounding.mark(&rounded), Mark::Present(step) if (step[0] - 0.3).abs() < 1e-6));
/// ```
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum Mark {
    /// The effect leaves none.
    Unmarked,
    /// It would leave one, and there is none.
    Absent,
    /// There is one, of these magnitudes.
    Present(Vec<f64>),
}

/// Time of a sample, and the step, in seconds.
///
/// ```
/// use truetwin::effect::SensorDrift;
/// use truetwin::effect::{Given, Instant, UnmodelledEffect};
///
/// let drift = SensorDrift { target: "sensor".into(), magnitudes: Given::default() };
/// let now = Instant { t: 10.0, dt: 0.5 };
/// assert_eq!(drift.signal(&[0.1], now, &mut [], 2.0), 3.0);
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Instant {
    /// Seconds from the first sample.
    pub t: f64,
    /// Step Δt.
    pub dt: f64,
}

/// An effect that a twin may lack: what it bends, by how much, and how.
///
/// Implement the three required methods and the one that belongs to [`law`](Self::law); the rest is provided.
/// Registered with `#[typetag::serde(name = "…")]`, the name is the effect's id in files.
///
/// `m` holds the magnitudes in the order of [`magnitudes`](Self::magnitudes). At the off values an effect must
/// change no bit of a trajectory.
///
/// ```
/// use serde::{Deserialize, Serialize};
/// use truetwin::effect::{Given, Law, Magnitude, UnmodelledEffect};
///
/// /// A push that grows with the square of time.
/// #[derive(Debug, Serialize, Deserialize)]
/// struct Thrust {
///     target: String,
///     #[serde(default)]
///     magnitudes: Given,
/// }
///
/// #[typetag::serde(name = "thrust")]
/// impl UnmodelledEffect for Thrust {
///     fn target(&self) -> &str {
///         &self.target
///     }
///     fn given(&self) -> &Given {
///         &self.magnitudes
///     }
///     fn law(&self) -> Law {
///         Law::Force
///     }
///     fn magnitudes(&self) -> Vec<Magnitude> {
///         vec![Magnitude::signed("growth", "state/s³", &[0.1])]
///     }
///     fn force(&self, m: &[f64], t: f64, _x: f64, _other: f64) -> f64 {
///         m[0] * t * t
///     }
/// }
///
/// let effects = truetwin::effect::parse_effects("[[effect]]\nid = 'thrust'\ntarget = 'x2'")?;
/// assert_eq!(effects[0].force(&[0.5], 2.0, 0.0, 0.0), 2.0);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[typetag::serde(tag = "id")]
pub trait UnmodelledEffect: Debug + Send + Sync {
    /// What is bent: `sensor`, `actuator`, a state or a parameter.
    fn target(&self) -> &str;

    /// The numbers of the law.
    fn magnitudes(&self) -> Vec<Magnitude>;

    /// Which law is bent.
    fn law(&self) -> Law;

    /// Magnitudes that the file fixed.
    fn given(&self) -> &Given;

    /// The other state of a law between two: `from` which it acts, or `to` which it spills.
    fn other(&self) -> Option<&str> {
        None
    }

    /// Where along the signal the effect stands: small first; the measurement noise enters at
    /// [`NOISE_ENTERS`]. Of no meaning outside signals.
    fn order(&self) -> u32 {
        0
    }

    /// Whether these magnitudes can be simulated with step `dt`; the message names the remedy.
    fn check(&self, _m: &[f64], _dt: f64) -> Result<(), String> {
        Ok(())
    }

    /// Number of memory values that a signal law needs.
    fn memory(&self) -> usize {
        0
    }

    /// Memory values that are enough where the magnitudes are small, as for a short delay. With fewer than
    /// [`memory`](Self::memory), a filter has fewer states. The law must then not reach beyond the memory it is given.
    fn least_memory(&self) -> usize {
        self.memory()
    }

    /// The effect's mark on measured outputs of its target; a signal that is clipped or rounded after the noise bears one.
    fn mark(&self, _outputs: &[f64]) -> Mark {
        Mark::Unmarked
    }

    /// Fills the memory before the first sample, whose value is `first`.
    fn begin(&self, _m: &[f64], memory: &mut [f64], first: f64) {
        memory.fill(first);
    }

    /// [`Law::Sensor`], [`Law::Actuator`]: the signal after the effect; `memory` may change, once a sample.
    fn signal(&self, _m: &[f64], _now: Instant, _memory: &mut [f64], value: f64) -> f64 {
        value
    }

    /// [`Law::Force`]: what is added to the rate of the target, at `x` and the other state `other`.
    fn force(&self, _m: &[f64], _t: f64, _x: f64, _other: f64) -> f64 {
        0.0
    }

    /// [`Law::Limit`]: bends the target and the other state after a step.
    fn limit(&self, _m: &[f64], _x: &mut f64, _other: Option<&mut f64>) {}

    /// [`Law::Parameter`]: the parameter's value at time `t`.
    fn parameter(&self, _m: &[f64], _t: f64, value: f64) -> f64 {
        value
    }

    /// [`Law::MeasurementNoise`], [`Law::ProcessNoise`]: standard deviation that joins the twin's in quadrature.
    fn noise_level(&self, _m: &[f64]) -> f64 {
        0.0
    }

    /// [`Law::Outliers`]: what is added to a sample, drawn from the effect's own source.
    fn outlier(&self, _m: &[f64], _source: &mut Source) -> f64 {
        0.0
    }

    /// [`Law::Outliers`]: how often and how large, for filters. An effect that does not say so cannot be named by a
    /// diagnosis.
    fn outliers(&self, _m: &[f64]) -> Option<Outliers> {
        None
    }
}

/// Why an effect cannot be added to a twin.
///
/// ```
/// use std::sync::Arc;
/// use truetwin::effect::LinearLoss;
/// use truetwin::effect::{EffectError, Given, augment};
/// use truetwin::twins::VanDerPol;
///
/// let loss = LinearLoss { target: "x3".into(), magnitudes: Given::default() };
/// let error = augment(Arc::new(VanDerPol), vec![Arc::new(loss)]).err().ok_or("there is no x3")?;
/// assert!(matches!(error, EffectError::Target { .. }));
/// assert!(error.to_string().contains("choose one of x1, x2"), "{error}");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum EffectError {
    /// The target, or the other state, is not there.
    #[error("effect {id}: the twin has no {what} \"{name}\"{}; choose one of {known}", did_you_mean(name, known.split(", ")))]
    Target {
        /// Effect.
        id: String,
        /// Kind of target.
        what: &'static str,
        /// The name.
        name: String,
        /// What there is.
        known: String,
    },
    /// A dynamics effect on a black box.
    #[error(
        "effect {id} bends the equations, which a black-box twin does not show; only sensor and actuator effects can be added"
    )]
    BlackBox {
        /// Effect.
        id: String,
    },
    /// A magnitude that the effect does not have.
    #[error("effect {id} has no magnitude \"{name}\"{}; it has {known}", did_you_mean(name, known.split(", ")))]
    Magnitude {
        /// Effect.
        id: String,
        /// The name.
        name: String,
        /// What there is.
        known: String,
    },
    /// The same effect on the same target twice.
    #[error("effect {id} on {target} is given twice; give it once")]
    Duplicate {
        /// Effect.
        id: String,
        /// Target.
        target: String,
    },
    /// An effect between a state and itself.
    #[error("effect {id} goes from {target} to itself; name another state")]
    Itself {
        /// Effect.
        id: String,
        /// Target.
        target: String,
    },
    /// A memory after the noise, where the framework keeps none.
    #[error(
        "effect {id} remembers and stands after the noise; give it an order below {NOISE_ENTERS}"
    )]
    Memory {
        /// Effect.
        id: String,
    },
    /// A magnitude out of its limits.
    #[error("effect {id}: {name} = {value} is outside {limits}; choose a value inside")]
    Value {
        /// Effect.
        id: String,
        /// Magnitude.
        name: String,
        /// The value.
        value: f64,
        /// Its limits.
        limits: Interval,
    },
}

/// Names of the targets that a law can have in a twin with these equations (none: a black box) and signals.
pub fn targets(law: Law, outline: Option<&Outline>, signals: &Signals) -> Vec<String> {
    let numbered = |word: &str, n: usize| match n {
        1 => vec![word.to_owned()],
        _ => (1..=n).map(|j| format!("{word}{j}")).collect(),
    };
    match law {
        Law::Sensor | Law::MeasurementNoise | Law::Outliers => {
            numbered("sensor", signals.outputs.len())
        }
        Law::Actuator => numbered("actuator", signals.inputs.len()),
        Law::Force | Law::Limit | Law::ProcessNoise => outline.map_or_else(Vec::new, |o| {
            o.states.iter().map(|s| s.name.clone()).collect()
        }),
        Law::Parameter => outline.map_or_else(Vec::new, |o| {
            o.parameters.iter().map(|p| p.name.clone()).collect()
        }),
    }
}

/// Whether each effect can be added to a twin with these equations (none: a black box) and signals.
pub fn check_effects(
    effects: &[Arc<dyn UnmodelledEffect>],
    outline: Option<&Outline>,
    signals: &Signals,
) -> Result<(), EffectError> {
    for effect in effects {
        let (id, law) = (effect.typetag_name().to_owned(), effect.law());
        let on_signals = matches!(
            law,
            Law::Sensor | Law::Actuator | Law::MeasurementNoise | Law::Outliers
        );
        if outline.is_none() && !on_signals {
            return Err(EffectError::BlackBox { id });
        }
        if law == Law::Sensor && effect.memory() > 0 && effect.order() > NOISE_ENTERS {
            return Err(EffectError::Memory { id });
        }
        let known = targets(law, outline, signals);
        let what = law.target();
        for name in [Some(effect.target()), effect.other()]
            .into_iter()
            .flatten()
        {
            if !known.iter().any(|k| k == name) {
                return Err(EffectError::Target {
                    id,
                    what,
                    name: name.into(),
                    known: match known.is_empty() {
                        true => "none: there is nothing of the kind".into(),
                        false => known.join(", "),
                    },
                });
            }
        }
        let target = effect.target().to_owned();
        let same = |other: &Arc<dyn UnmodelledEffect>| {
            other.typetag_name() == id && other.target() == target
        };
        if effects.iter().filter(|other| same(other)).count() > 1 {
            return Err(EffectError::Duplicate { id, target });
        }
        if law == Law::Force && effect.other() == Some(effect.target()) {
            return Err(EffectError::Itself { id, target });
        }
        let declared = effect.magnitudes();
        for (name, &value) in &effect.given().0 {
            let Some(magnitude) = declared.iter().find(|m| m.name == name) else {
                return Err(EffectError::Magnitude {
                    id,
                    name: name.clone(),
                    known: declared
                        .iter()
                        .map(|m| m.name)
                        .collect::<Vec<_>>()
                        .join(", "),
                });
            };
            if !magnitude.limits.contains(value) {
                return Err(EffectError::Value {
                    id,
                    name: name.clone(),
                    value,
                    limits: magnitude.limits,
                });
            }
        }
    }
    Ok(())
}
