//! The library of effects that a twin may lack, one a file.
//!
//! s is a sensor's signal, u an actuator's, x a state, θ a parameter. A *shape* has no off value. At the off values
//! a trajectory does not change by a bit.
//!
//! | effect | target | magnitudes (unit; off 0 unless said) | law |
//! |---|---|---|---|
//! | `sensor-bias` | sensor | `offset` (signal) | s + offset |
//! | `sensor-gain` | sensor | `error` (1) | s·(1 + error) |
//! | `sensor-drift` | sensor | `rate` (signal/s) | s + rate·t |
//! | `sensor-lag` | sensor | `tau` (s) | z ← a·z + (1 − a)·s, a = exp(−Δt/τ) |
//! | `sensor-delay` | sensor | `delay` (s) | s(t − delay), linear between samples |
//! | `sensor-rectification` | sensor | `fraction` (1) | (1 − f)·s + f·abs(s) |
//! | `sensor-noise` | sensor | `std` (signal) | r² + std² for the variance r² of the twin's own noise |
//! | `sensor-saturation` | sensor | `low` (signal, off −∞), `high` (signal, off ∞) | clamp(s, low, high) |
//! | `sensor-quantization` | sensor | `step` (signal) | step·⌊s/step + ½⌋ |
//! | `sensor-outliers` | sensor | `probability` (1), shape `scale` (signal) | s + N(0, scale²) with that probability |
//! | `actuator-gain` | actuator | `error` (1) | u·(1 + error) |
//! | `actuator-bias` | actuator | `offset` (signal) | u + offset |
//! | `actuator-dead-zone` | actuator | `width` (signal) | u − clamp(u, ±width/2) |
//! | `actuator-backlash` | actuator | `width` (signal) | v ← clamp(v, u ± width/2) |
//! | `actuator-saturation` | actuator | `low` (signal, off −∞), `high` (signal, off ∞) | clamp(u, low, high) |
//! | `actuator-rate-limit` | actuator | `rate` (signal/s, off ∞) | v ← v + clamp(u − v, ±rate·Δt) |
//! | `actuator-lag` | actuator | `tau` (s) | v ← a·v + (1 − a)·u, a = exp(−Δt/τ) |
//! | `actuator-delay` | actuator | `delay` (s) | u(t − delay), linear between samples |
//! | `constant-forcing` | state | `force` (state/s) | ẋ + force |
//! | `coulomb-friction` | state | `force` (state/s) | ẋ − force·sign x |
//! | `linear-loss` | state | `rate` (1/s) | ẋ − rate·x |
//! | `cross-coupling` | state, `from` | `rate` (state/(from·s)) | ẋ + rate·x_from |
//! | `quadratic-drag` | state | `coefficient` (1/(state·s)) | ẋ − c·abs(x)·x |
//! | `cubic-stiffness` | state, `from` | `coefficient` (state/(from³·s)) | ẋ − c·x_from³ |
//! | `power-law` | state | `coefficient` (state^(1−e)/s), shape `exponent` (1) | ẋ − c·abs(x)^e·sign x |
//! | `periodic-disturbance` | state | `amplitude` (state/s), shape `frequency` (Hz), shape `phase` (rad) | ẋ + amplitude·sin(2π·f·t + phase) |
//! | `state-ceiling` | state, `to` | `level` (state, off ∞), shape `spill` (1) | the excess over level is cut; spill × excess is added to `to` |
//! | `process-noise` | state | `std` (state) | q² + std² for the variance q² of the twin's own increment a step |
//! | `parameter-drift` | parameter | `rate` (1/s) | θ·(1 + rate·t) |
//! | `parameter-step` | parameter | `size` (1), shape `time` (s) | θ·(1 + size) from that time on |
//!
//! Several effects on one signal act in the table's order, whatever the order of a file; the measurement noise enters
//! after rectification. Starts of a fit are for a signal of size 1 and a step of 1 s; scale them by their units.
//!
//! # Add one
//!
//! Copy the nearest neighbour, change the law, and name it in `effect/mod.rs`: `mod`, `pub use`, the table above and the list
//! below (a test compares both). Outside of this crate, implement [`UnmodelledEffect`] under an id of your own; files then know it too.

use std::sync::Arc;

/// What every effect answers from its fields: target, given magnitudes, and the other state where there is one.
macro_rules! accessors {
    ($($other:ident)?) => {
        fn target(&self) -> &str {
            &self.target
        }

        fn given(&self) -> &Given {
            &self.magnitudes
        }
        $(
            fn other(&self) -> Option<&str> {
                Some(&self.$other)
            }
        )?
    };
}

mod actuator_backlash;
mod actuator_bias;
mod actuator_dead_zone;
mod actuator_delay;
mod actuator_gain;
mod actuator_lag;
mod actuator_rate_limit;
mod actuator_saturation;
mod augment;
mod constant_forcing;
mod coulomb_friction;
mod cross_coupling;
mod cubic_stiffness;
mod file;
mod laws;
mod library;
mod linear_loss;
mod marks;
mod parameter_drift;
mod parameter_step;
mod periodic_disturbance;
mod power_law;
mod process_noise;
mod quadratic_drag;
mod sensor_bias;
mod sensor_delay;
mod sensor_drift;
mod sensor_gain;
mod sensor_lag;
mod sensor_noise;
mod sensor_outliers;
mod sensor_quantization;
mod sensor_rectification;
mod sensor_saturation;
mod state_ceiling;
mod unmodelled;

pub use actuator_backlash::ActuatorBacklash;
pub use actuator_bias::ActuatorBias;
pub use actuator_dead_zone::ActuatorDeadZone;
pub use actuator_delay::ActuatorDelay;
pub use actuator_gain::ActuatorGain;
pub use actuator_lag::ActuatorLag;
pub use actuator_rate_limit::ActuatorRateLimit;
pub use actuator_saturation::ActuatorSaturation;
pub(crate) use augment::augment_short;
pub use augment::{augment, given_magnitudes};
pub use constant_forcing::ConstantForcing;
pub use coulomb_friction::CoulombFriction;
pub use cross_coupling::CrossCoupling;
pub use cubic_stiffness::CubicStiffness;
pub use file::{EffectFileError, parse_effects, read_effects};
pub(crate) use library::described;
pub use library::{Description, applicable, library};
pub use linear_loss::LinearLoss;
pub use parameter_drift::ParameterDrift;
pub use parameter_step::ParameterStep;
pub use periodic_disturbance::PeriodicDisturbance;
pub use power_law::PowerLaw;
pub use process_noise::ProcessNoise;
pub use quadratic_drag::QuadraticDrag;
pub use sensor_bias::SensorBias;
pub use sensor_delay::SensorDelay;
pub use sensor_drift::SensorDrift;
pub use sensor_gain::SensorGain;
pub use sensor_lag::SensorLag;
pub use sensor_noise::SensorNoise;
pub use sensor_outliers::SensorOutliers;
pub use sensor_quantization::SensorQuantization;
pub use sensor_rectification::SensorRectification;
pub use sensor_saturation::SensorSaturation;
pub use state_ceiling::StateCeiling;
pub use unmodelled::{
    EffectError, Effects, Given, Instant, Law, Magnitude, Mark, NOISE_ENTERS, UnmodelledEffect,
};
pub(crate) use unmodelled::{check_effects, targets};

/// One line of the library: how to make the effect, and its law in words.
struct Member {
    /// From its target and the other state.
    make: fn(&str, &str) -> Arc<dyn UnmodelledEffect>,
    other: Option<&'static str>,
    formula: &'static str,
}

/// `member!(Type: "formula")`; `member!(Type + from: "formula")` of a law between two states.
macro_rules! member {
    ($effect:ident $(+ $other:ident)?: $formula:literal) => {
        Member {
            make: |target, _other| {
                Arc::new($effect {
                    target: target.into(),
                    $($other: _other.into(),)?
                    magnitudes: Given::default(),
                })
            },
            other: [$(stringify!($other),)?].first().copied(),
            formula: $formula,
        }
    };
}

/// The library, in the order of its table.
fn members() -> Vec<Member> {
    vec![
        member!(SensorBias: "s + offset"),
        member!(SensorGain: "s·(1 + error)"),
        member!(SensorDrift: "s + rate·t"),
        member!(SensorLag: "z ← a·z + (1 − a)·s, a = exp(−Δt/τ)"),
        member!(SensorDelay: "s(t − delay), linear between samples"),
        member!(SensorRectification: "(1 − f)·s + f·abs(s)"),
        member!(SensorNoise: "r² + std² for the variance r² of the twin's own noise"),
        member!(SensorSaturation: "clamp(s, low, high)"),
        member!(SensorQuantization: "step·⌊s/step + ½⌋"),
        member!(SensorOutliers: "s + N(0, scale²) with that probability"),
        member!(ActuatorGain: "u·(1 + error)"),
        member!(ActuatorBias: "u + offset"),
        member!(ActuatorDeadZone: "u − clamp(u, ±width/2)"),
        member!(ActuatorBacklash: "v ← clamp(v, u ± width/2)"),
        member!(ActuatorSaturation: "clamp(u, low, high)"),
        member!(ActuatorRateLimit: "v ← v + clamp(u − v, ±rate·Δt)"),
        member!(ActuatorLag: "v ← a·v + (1 − a)·u, a = exp(−Δt/τ)"),
        member!(ActuatorDelay: "u(t − delay), linear between samples"),
        member!(ConstantForcing: "ẋ + force"),
        member!(CoulombFriction: "ẋ − force·sign x"),
        member!(LinearLoss: "ẋ − rate·x"),
        member!(CrossCoupling + from: "ẋ + rate·x_from"),
        member!(QuadraticDrag: "ẋ − c·abs(x)·x"),
        member!(CubicStiffness + from: "ẋ − c·x_from³"),
        member!(PowerLaw: "ẋ − c·abs(x)^e·sign x"),
        member!(PeriodicDisturbance: "ẋ + amplitude·sin(2π·f·t + phase)"),
        member!(StateCeiling + to: "the excess over level is cut; spill × excess is added to `to`"),
        member!(ProcessNoise: "q² + std² for the variance q² of the twin's own increment a step"),
        member!(ParameterDrift: "θ·(1 + rate·t)"),
        member!(ParameterStep: "θ·(1 + size) from that time on"),
    ]
}
