//! The van der Pol oscillator as a world.

use super::{MissingEffect, World};

const fn missing(id: &'static str, target: &'static str, low: f64, high: f64) -> MissingEffect {
    MissingEffect {
        id,
        target,
        range: (low, high),
    }
}

/// ẋ₁ = x₂, ẋ₂ = ν·(1 − x₁²)·x₂ − x₁ + w with w ~ N(0, 0.02) held over a sample; y = x₁.
///
/// Its step of 0.05 s is coarse enough that a finer one is another system, so it is integrated as the twin is.
pub(super) const WORLD: World = World {
    twin: "van-der-pol",
    state_names: ["x1", "x2"],
    parameters: &["nu"],
    has_input: false,
    start: [1.0, 0.0],
    output: 0,
    process: |dt| [0.0, dt * 0.02f64.sqrt()],
    measurement: 0.0,
    limits: [(f64::NEG_INFINITY, f64::INFINITY); 2],
    rates: |theta, _, [x, v]| [v, theta[0] * v * (1.0 - x * x) - x],
    substeps: &[1],
    state_sizes: [2.0, 2.5],
    rate_sizes: [1.5, 1.5],
    missing_effects: &[
        missing("sensor-bias", "sensor", 0.003, 0.3),
        missing("sensor-gain", "sensor", 0.003, 0.2),
        missing("sensor-drift", "sensor", 0.0005, 0.03),
        missing("sensor-lag", "sensor", 0.01, 0.3),
        missing("sensor-delay", "sensor", 0.01, 0.3),
        missing("sensor-rectification", "sensor", 0.01, 0.6),
        missing("sensor-noise", "sensor", 0.0005, 0.03),
        missing("sensor-outliers", "sensor", 0.005, 0.08),
        missing("sensor-saturation", "sensor", 0.02, 0.5),
        missing("sensor-quantization", "sensor", 0.005, 0.3),
        missing("constant-forcing", "x1", 0.01, 0.4),
        missing("constant-forcing", "x2", 0.01, 0.4),
        missing("coulomb-friction", "x2", 0.01, 0.4),
        missing("linear-loss", "x1", 0.01, 0.3),
        missing("linear-loss", "x2", 0.01, 0.4),
        missing("cross-coupling", "x1", 0.01, 0.3),
        missing("cross-coupling", "x2", 0.01, 0.3),
        missing("quadratic-drag", "x2", 0.005, 0.2),
        missing("cubic-stiffness", "x2", 0.005, 0.3),
        missing("power-law", "x2", 0.005, 0.2),
        missing("periodic-disturbance", "x1", 0.01, 0.4),
        missing("periodic-disturbance", "x2", 0.02, 0.6),
        missing("state-ceiling", "x1", 0.02, 0.5),
        missing("process-noise", "x2", 0.003, 0.05),
        missing("parameter-drift", "nu", 0.002, 0.06),
        missing("parameter-step", "nu", 0.03, 0.6),
    ],
    doubles: &[
        ["linear-loss@x2", "power-law@x2"],
        ["quadratic-drag@x2", "power-law@x2"],
    ],
    absorbed: &[missing("parameter-step", "nu", 0.05, 0.5)],
};
