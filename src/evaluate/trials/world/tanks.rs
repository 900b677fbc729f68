//! The cascaded tanks as a world.

use super::{MissingEffect, World};

const fn missing(id: &'static str, target: &'static str, low: f64, high: f64) -> MissingEffect {
    MissingEffect {
        id,
        target,
        range: (low, high),
    }
}

/// Root of a level; below a millionth its slope is that of the twin, which has a floor there.
fn root(level: f64) -> f64 {
    level.abs().max(1e-6).sqrt()
}

/// ḣ₁ = −k₁√h₁ + k₄u, ḣ₂ = k₂√h₁ − k₃√h₂; each level takes N(0, 0.1²) a sample, y = h₂ + N(0, 0.15²), levels in [0, 10].
///
/// With θ in the prior, five steps a sample differ from one by less than the noise shows, so either may be drawn.
pub(super) const WORLD: World = World {
    twin: "tanks",
    state_names: ["h1", "h2"],
    parameters: &["k1", "k2", "k3", "k4"],
    has_input: true,
    start: [0.0, 0.0],
    output: 1,
    process: |_| [0.1, 0.1],
    measurement: 0.15,
    limits: [(0.0, 10.0); 2],
    rates: |k, u, [upper, lower]| {
        let between = root(upper);
        [
            k[3] * u - k[0] * between,
            k[1] * between - k[2] * root(lower),
        ]
    },
    substeps: &[1, 5],
    state_sizes: [3.0, 3.0],
    rate_sizes: [1.0, 0.7],
    missing_effects: &[
        missing("sensor-bias", "sensor", 0.1, 1.5),
        missing("sensor-lag", "sensor", 0.5, 6.0),
        missing("sensor-delay", "sensor", 0.3, 4.0),
        missing("sensor-saturation", "sensor", 0.05, 0.6),
        missing("sensor-quantization", "sensor", 0.3, 2.0),
        missing("sensor-noise", "sensor", 0.06, 0.6),
        missing("sensor-outliers", "sensor", 0.005, 0.08),
        missing("actuator-bias", "actuator", 0.1, 1.0),
        missing("actuator-dead-zone", "actuator", 0.2, 2.5),
        missing("actuator-backlash", "actuator", 0.2, 2.0),
        missing("actuator-saturation", "actuator", 0.05, 0.6),
        missing("actuator-rate-limit", "actuator", 1.5, 0.05),
        missing("actuator-lag", "actuator", 0.6, 8.0),
        missing("actuator-delay", "actuator", 0.4, 6.0),
        missing("constant-forcing", "h1", 0.05, 0.6),
        missing("constant-forcing", "h2", 0.05, 0.5),
        missing("linear-loss", "h1", 0.03, 0.5),
        missing("linear-loss", "h2", 0.03, 0.4),
        missing("cross-coupling", "h1", 0.03, 0.3),
        missing("cross-coupling", "h2", 0.03, 0.3),
        missing("quadratic-drag", "h1", 0.01, 0.2),
        missing("quadratic-drag", "h2", 0.01, 0.2),
        missing("power-law", "h1", 0.01, 0.2),
        missing("power-law", "h2", 0.01, 0.2),
        missing("periodic-disturbance", "h1", 0.08, 0.8),
        missing("periodic-disturbance", "h2", 0.06, 0.6),
        missing("state-ceiling", "h1", 0.05, 0.6),
        missing("state-ceiling", "h2", 0.05, 0.6),
        missing("process-noise", "h1", 0.05, 0.4),
        missing("process-noise", "h2", 0.05, 0.4),
        missing("parameter-drift", "k1", 0.0003, 0.004),
        missing("parameter-drift", "k2", 0.0003, 0.004),
        missing("parameter-drift", "k3", 0.0003, 0.004),
        missing("parameter-drift", "k4", 0.0003, 0.004),
        missing("parameter-step", "k1", 0.05, 0.6),
        missing("parameter-step", "k2", 0.05, 0.6),
        missing("parameter-step", "k3", 0.05, 0.6),
        missing("parameter-step", "k4", 0.05, 0.6),
    ],
    doubles: &[
        ["actuator-bias@actuator", "constant-forcing@h1"],
        ["actuator-delay@actuator", "sensor-delay@sensor"],
        ["linear-loss@h2", "power-law@h2"],
        ["quadratic-drag@h1", "power-law@h1"],
    ],
    absorbed: &[
        missing("actuator-gain", "actuator", 0.05, 0.5),
        // Not the sensor's gain: levels scale with it, but their noise does not.
        missing("parameter-step", "k1", 0.05, 0.5),
        missing("parameter-step", "k2", 0.05, 0.5),
        missing("parameter-step", "k3", 0.05, 0.5),
        missing("parameter-step", "k4", 0.05, 0.5),
    ],
};
