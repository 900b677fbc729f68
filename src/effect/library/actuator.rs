//! Effects of actuators, in the order in which they act along the signal u.

use super::super::kind::EffectKind;
use super::super::magnitude::{Magnitude, Shape};
use super::shared::{
    DAMPING, DELAY, DELAY_SAMPLES, ERROR, HIGH, LOW, MODE, OFFSET, TAU, WIDTH, check_delay, clamp,
    delay, lag, limit_rate, ring,
};

pub(super) fn rows() -> Vec<EffectKind> {
    vec![
        // A relative error of the scale.
        EffectKind::actuator("actuator-gain", "u·(1 + error)", |m, _, _, u| {
            u * (1.0 + m[0])
        })
        .with_sentence("{place} acts with its command changed by {%error}.")
        .magnitude(ERROR)
        .order(10),
        // A constant error of the zero.
        EffectKind::actuator("actuator-bias", "u + offset", |m, _, _, u| u + m[0])
            .with_sentence("{place} acts with its command plus {offset}.")
            .magnitude(OFFSET)
            .order(20),
        // Commands inside ±width/2 do nothing, larger ones lose that much.
        EffectKind::actuator(
            "actuator-dead-zone",
            "u − clamp(u, ±width/2)",
            |m, _, _, u| u - clamp(u, -0.5 * m[0], 0.5 * m[0]),
        )
        .with_sentence("{place} does not act within a dead zone of {width}.")
        .magnitude(WIDTH)
        .order(30),
        // Play: after a reversal nothing moves until it is used up; v starts at the first u.
        EffectKind::actuator(
            "actuator-backlash",
            "v ← clamp(v, u ± width/2)",
            |m, _, memory, u| {
                memory[0] = clamp(memory[0], u - 0.5 * m[0], u + 0.5 * m[0]);
                memory[0]
            },
        )
        .with_sentence("{place} has a play of {width}.")
        .magnitude(WIDTH)
        .memory(1)
        .order(40),
        // A limited range. Where low exceeds high, high wins.
        EffectKind::actuator(
            "actuator-saturation",
            "clamp(u, low, high)",
            |m, _, _, u| clamp(u, m[0], m[1]),
        )
        .with_sentence("{place} does not act below {low} or above {high}.")
        .magnitude(LOW)
        .magnitude(HIGH)
        .order(50),
        // A limited speed; v starts at the first u.
        EffectKind::actuator(
            "actuator-rate-limit",
            "v ← v + clamp(u − v, ±rate·Δt)",
            |m, now, memory, u| limit_rate(m[0] * now.dt, &mut memory[0], u),
        )
        .with_sentence("{place} changes by {rate} at most.")
        .magnitude(
            Magnitude::positive("rate", "signal/s", &[0.1, 0.5, 2.0])
                .shape(Shape::Rate)
                .off(f64::INFINITY),
        )
        .memory(1)
        .order(60),
        // A first-order lag; v starts at the first u.
        EffectKind::actuator(
            "actuator-lag",
            "v ← a·v + (1 − a)·u, a = exp(−Δt/τ)",
            |m, now, memory, u| lag(m[0], now.dt, &mut memory[0], u),
        )
        .with_sentence("{place} follows its command with a lag of {tau}.")
        .magnitude(TAU)
        .memory(1)
        .order(70),
        // A mode of the drive that nobody modelled; v starts at rest, at the first u.
        EffectKind::actuator(
            "actuator-mode",
            "v̈ + 2·damping·ω·v̇ + ω²·v = ω²·u, ω = 2π·frequency",
            |m, now, memory, u| ring(m, now.dt, memory, u),
        )
        .with_sentence("{place} rings at {frequency} with a damping ratio of {damping}.")
        .magnitude(MODE)
        .magnitude(DAMPING)
        .memory(2)
        .order(75),
        // A dead time of at most 63 steps; the first value before the start.
        EffectKind::actuator(
            "actuator-delay",
            "u(t − delay), linear between samples",
            |m, now, memory, u| delay(m[0], now.dt, memory, u),
        )
        .with_sentence("{place} acts {delay} after its command.")
        .magnitude(DELAY)
        .memory(DELAY_SAMPLES)
        .dead_time()
        .check(|m, dt| check_delay(m[0], dt))
        .order(80),
    ]
}
