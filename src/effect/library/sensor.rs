//! Effects of sensors, in the order in which they act along the signal s.

use super::super::kind::EffectKind;
use super::super::magnitude::{Magnitude, Shape};
use super::super::marks::{clipped, rounded, unclipped};
use super::shared::{
    DAMPING, DELAY, DELAY_SAMPLES, ERROR, HIGH, LOW, MODE, OFFSET, TAU, WIDTH, check_delay, clamp,
    delay, lag, ring,
};
use crate::twin::Outliers;

pub(super) fn rows() -> Vec<EffectKind> {
    [errors(), dynamics(), limits(), readings()].concat()
}

/// Errors of zero and scale, and play.
fn errors() -> Vec<EffectKind> {
    vec![
        // A constant error of the zero.
        EffectKind::sensor("sensor-bias", "s + offset", |m, _, _, s| s + m[0])
            .with_sentence("{place} shows the true value plus {offset}.")
            .magnitude(OFFSET)
            .order(10),
        // A relative error of the scale.
        EffectKind::sensor("sensor-gain", "s·(1 + error)", |m, _, _, s| {
            s * (1.0 + m[0])
        })
        .with_sentence("{place} shows the true value changed by {%error}.")
        .magnitude(ERROR)
        .order(20),
        // A zero that moves steadily from the first sample on.
        EffectKind::sensor("sensor-drift", "s + rate·t", |m, now, _, s| {
            s + m[0] * now.t
        })
        .with_sentence("{place} drifts by {rate}.")
        .magnitude(
            Magnitude::signed("rate", "signal/s", &[-0.01, -0.001, 0.001, 0.01]).shape(Shape::Rate),
        )
        .order(30),
        // Play between the signal and its gauge; z starts at the first s.
        EffectKind::sensor(
            "sensor-backlash",
            "z ← clamp(z, s ± width/2)",
            |m, _, memory, s| {
                memory[0] = clamp(memory[0], s - 0.5 * m[0], s + 0.5 * m[0]);
                memory[0]
            },
        )
        .with_sentence("{place} has a play of {width}.")
        .magnitude(WIDTH)
        .memory(1)
        .order(35),
    ]
}

/// Lags, modes and delays.
fn dynamics() -> Vec<EffectKind> {
    vec![
        // A first-order lag; the reading is z, which starts at the first s.
        EffectKind::sensor(
            "sensor-lag",
            "z ← a·z + (1 − a)·s, a = exp(−Δt/τ)",
            |m, now, memory, s| lag(m[0], now.since, &mut memory[0], s),
        )
        .with_sentence("{place} follows the true value with a lag of {tau}.")
        .magnitude(TAU)
        .memory(1)
        .order(40),
        // A mode of the gauge that nobody modelled; z starts at rest, at the first s.
        EffectKind::sensor(
            "sensor-mode",
            "z̈ + 2·damping·ω·ż + ω²·z = ω²·s, ω = 2π·frequency",
            |m, now, memory, s| ring(m, now.since, memory, s),
        )
        .with_sentence("{place} rings at {frequency} with a damping ratio of {damping}.")
        .magnitude(MODE)
        .magnitude(DAMPING)
        .memory(2)
        .order(45),
        // A dead time of at most 63 steps; the first value before the start.
        EffectKind::sensor(
            "sensor-delay",
            "s(t − delay), linear between samples",
            |m, now, memory, s| delay(m[0], now.since, memory, s),
        )
        .with_sentence("{place} shows the true value {delay} late.")
        .magnitude(DELAY)
        .memory(DELAY_SAMPLES)
        .dead_time()
        .check(|m, dt| check_delay(m[0], dt))
        .order(50),
    ]
}

/// Folds and ends before the noise.
fn limits() -> Vec<EffectKind> {
    vec![
        // A part f of the signal is rectified.
        EffectKind::sensor(
            "sensor-rectification",
            "(1 − f)·s + f·abs(s)",
            |m, _, _, s| (1.0 - m[0]) * s + m[0] * s.abs(),
        )
        .with_sentence("{place} shows {%fraction} of the size of the signal, whatever its sign.")
        .magnitude(
            Magnitude::positive("fraction", "1", &[0.1, 0.5, 0.9])
                .within(0.0, 1.0)
                .shape(Shape::Share),
        )
        .order(60),
        // A limited range before the noise, so that no value repeats. Where low exceeds high, high wins.
        EffectKind::sensor(
            "sensor-clipping",
            "clamp(s, low, high), before the noise",
            |m, _, _, s| clamp(s, m[0], m[1]),
        )
        .with_sentence("{place} sees nothing below {low} or above {high}; its noise comes on top.")
        .magnitude(LOW)
        .magnitude(HIGH)
        .mark(unclipped)
        .order(65),
    ]
}

/// Noise, and what acts on readings.
fn readings() -> Vec<EffectKind> {
    vec![
        // White noise. A black box's own is already in its outputs; independent draws are added there.
        EffectKind::measurement_noise(
            "sensor-noise",
            "r² + std² for the variance r² of the twin's own noise",
            |m| m[0],
        )
        .with_sentence("{place} has noise of {std} beside its own.")
        .magnitude(Magnitude::positive("std", "signal", &[0.01, 0.05, 0.2])),
        // A limited range, after the noise. Where low exceeds high, high wins.
        EffectKind::sensor("sensor-saturation", "clamp(s, low, high)", |m, _, _, s| {
            clamp(s, m[0], m[1])
        })
        .with_sentence("{place} shows nothing below {low} or above {high}.")
        .magnitude(LOW)
        .magnitude(HIGH)
        .mark(clipped)
        .order(80),
        // Rounding to a multiple of the step, halves upwards.
        EffectKind::rounding("sensor-quantization", "step·⌊s/step + ½⌋", |m| m[0])
            .with_sentence("{place} shows steps of {step}.")
            .magnitude(Magnitude::positive("step", "signal", &[0.02, 0.1, 0.5]).shape(Shape::Level))
            .mark(rounded),
        // Rare large errors, after everything else.
        EffectKind::outliers(
            "sensor-outliers",
            "s + N(0, scale²) with that probability",
            |m| Outliers {
                probability: m[0],
                scale: m[1],
            },
        )
        .with_sentence("{place} is off by about {scale} in {%probability} of the samples.")
        .magnitude(
            Magnitude::positive("probability", "1", &[0.01, 0.05])
                .within(0.0, 1.0)
                .shape(Shape::Share),
        )
        .magnitude(Magnitude::positive("scale", "signal", &[0.5, 2.0]).never_off()),
    ]
}
