//! Laws and magnitudes that sensors and actuators share.

use super::super::magnitude::{Magnitude, Shape};
use crate::math::{nearest, three_digits};
use crate::setting::number;
use crate::twin::Remember;

/// Samples that a delay keeps: the present one and 63 before it.
pub(super) const DELAY_SAMPLES: usize = 64;

pub(super) const OFFSET: Magnitude = Magnitude::signed("offset", "signal", &[-0.3, -0.1, 0.1, 0.3]);
/// A relative error of the scale; −1 is a dead channel.
pub(super) const ERROR: Magnitude = Magnitude::signed("error", "1", &[-0.2, -0.05, 0.05, 0.2])
    .within(-1.0, f64::INFINITY)
    .shape(Shape::Share);
pub(super) const WIDTH: Magnitude =
    Magnitude::positive("width", "signal", &[0.1, 0.4, 1.0]).shape(Shape::Level);
pub(super) const TAU: Magnitude =
    Magnitude::positive("tau", "s", &[1.0, 4.0, 16.0]).shape(Shape::TimeConstant);
pub(super) const DELAY: Magnitude =
    Magnitude::positive("delay", "s", &[0.5, 2.0, 6.0]).shape(Shape::Delay);
pub(super) const LOW: Magnitude =
    Magnitude::signed("low", "signal", &[-1.0, 0.0, 0.5]).off(f64::NEG_INFINITY);
pub(super) const HIGH: Magnitude =
    Magnitude::signed("high", "signal", &[0.5, 1.0, 2.0]).off(f64::INFINITY);

/// −1, 0 or 1. `f64::signum` gives 1 at 0, which would push a body at rest.
pub(super) fn sign(x: f64) -> f64 {
    if x == 0.0 { 0.0 } else { x.signum() }
}

/// Unlike `f64::clamp`, no panic when a fit tries `low > high`, and NaN stays NaN.
pub(crate) fn clamp(value: f64, low: f64, high: f64) -> f64 {
    let value = if value < low { low } else { value };
    if value > high { high } else { value }
}

/// z ← a·z + (1 − a)·value, a = exp(−Δt/τ); the value itself at τ = 0.
pub(crate) fn lag(tau: f64, dt: f64, z: &mut f64, value: f64) -> f64 {
    *z = if tau > 0.0 {
        let a = (-dt / tau).exp();
        a * *z + (1.0 - a) * value
    } else {
        value
    };
    *z
}

/// v ← v + clamp(u − v, ±reach).
pub(super) fn limit_rate(reach: f64, v: &mut f64, u: f64) -> f64 {
    // v + (u − v) is not u to the bit; within reach, u it is.
    *v = if u - *v > reach {
        *v + reach
    } else if *v - u > reach {
        *v - reach
    } else {
        u
    };
    *v
}

/// A second-order mode that is driven by `value`, held over the step:
///
/// ```text
/// z̈ + 2·ζ·ω·ż + ω²·z = ω²·value,   ω = 2πf        memory: z and z + ż/ω, which both are the value at rest
/// ```
///
/// The motion over a step is exact; at f = ∞, z is the value itself.
pub(super) fn ring(m: &[f64], dt: f64, memory: &mut [f64], value: f64) -> f64 {
    if m[0].is_infinite() {
        memory.fill(value);
        return value;
    }
    let (omega, damping) = (std::f64::consts::TAU * m[0], m[1]);
    let (off, speed) = (memory[0] - value, omega * (memory[1] - memory[0]));
    let (decay, damped) = (
        damping * omega,
        omega * (1.0 - damping * damping).max(0.0).sqrt(),
    );
    let (sin, cos) = (damped * dt).sin_cos();
    let sin = if damped > 0.0 { sin / damped } else { dt };
    let left = (-decay * dt).exp();
    memory[0] = value + left * (off * cos + (speed + decay * off) * sin);
    let speed = left * (speed * cos - (decay * speed + omega * omega * off) * sin);
    memory[1] = memory[0] + speed / omega;
    memory[0]
}

/// Frequency of a mode: beyond half the sampling rate no record shows it.
pub(super) const MODE: Magnitude = Magnitude::positive("frequency", "Hz", &[0.05, 0.2, 0.5])
    .within(1e-6, f64::INFINITY)
    .shape(Shape::Frequency)
    .off(f64::INFINITY);
/// Damping ratio of a mode: from 0.7 on, nothing rings, and a lag says as much.
pub(super) const DAMPING: Magnitude = Magnitude::positive("damping", "1", &[0.1])
    .within(0.0, 0.7)
    .shape(Shape::Share)
    .never_off();

/// Deflection z of a hysteresis, by Bouc's and Wen's equation in its normalised form (n = 1, β = γ = ½):
///
/// ```text
/// ż = (v̇ − ½·|v̇|·z − ½·v̇·|z|)/width        memory: z, which starts at 0, and v
/// ```
///
/// v moves on a line from sample to sample, over which the solution is exact: towards zero as v does, beyond it to ±1 with e^(−Δv/width).
///
/// Source: Ikhouane & Rodellar, *Systems with Hysteresis* (2007), chapter 2.
pub(super) struct Deflection;

impl Remember for Deflection {
    fn begin(&self, value: f64, memory: &mut [f64]) {
        memory.copy_from_slice(&[0.0, value]);
    }

    fn next(&self, m: &[f64], _: f64, value: f64, memory: &mut [f64]) {
        let way = (value - memory[1]) / m[1];
        memory[0] = deflected(memory[0], way);
        memory[1] = value;
    }
}

/// The deflection after a way in widths.
fn deflected(z: f64, way: f64) -> f64 {
    let side = if way < 0.0 { -1.0 } else { 1.0 };
    let (z, way) = (side * z, way.abs());
    // Against the deflection, a spring; a filter's points may have left ±1.
    let back = clamp(-z, 0.0, way);
    let (z, way) = (z + back, way - back);
    side * match way > 0.0 {
        true => 1.0 - (1.0 - z) * (-way).exp(),
        false => z,
    }
}

/// Takes `value` into the shift register `past`, newest first, and reads it `delay` seconds ago, linear between
/// samples. [`check_delay`] has refused what the register does not reach.
pub(super) fn delay(delay: f64, dt: f64, past: &mut [f64], value: f64) -> f64 {
    past.rotate_right(1);
    past[0] = value;
    let ago = nearest(delay / dt, 0.0, past.len().saturating_sub(1) as f64);
    let (i, f) = (ago.trunc() as usize, ago.fract());
    if f == 0.0 {
        past[i]
    } else {
        (1.0 - f) * past[i] + f * past[i + 1]
    }
}

/// Refuses a delay that the register does not reach at step `dt`.
pub(super) fn check_delay(delay: f64, dt: f64) -> Result<(), String> {
    let longest = (DELAY_SAMPLES - 1) as f64 * dt;
    if delay <= longest {
        return Ok(());
    }
    Err(format!(
        "delay = {} s, but at a step of {} s at most {} s are kept; choose a shorter delay or a longer step",
        number(delay),
        number(dt),
        number(three_digits(longest))
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn clamp_never_panics_and_passes_nan_on() {
        assert_eq!(clamp(0.0, 2.0, 1.0), 1.0);
        assert!(clamp(f64::NAN, -1.0, 1.0).is_nan());
    }

    /// A mode swings about a new value with its period and its damping; a law in many steps is the law in one.
    #[test]
    fn a_mode_rings_at_its_frequency() {
        let m = [0.5, 0.1];
        let after = |steps: u32| {
            let mut memory = [0.0, 0.0];
            let dt = 2.0 / f64::from(steps);
            (0..steps).for_each(|_| {
                ring(&m, dt, &mut memory, 1.0);
            });
            memory[0]
        };
        assert!((after(1) - after(40)).abs() < 1e-12);
        // A damped period of 2 s / √(1 − ζ²): the overshoot has decayed by e^(−2πζ/√(1 − ζ²)).
        let root = (1.0f64 - 0.01).sqrt();
        let mut memory = [0.0, 0.0];
        let z = ring(&m, 2.0 / root, &mut memory, 1.0);
        assert!((1.0 - z - (-std::f64::consts::TAU * 0.1 / root).exp()).abs() < 1e-12);
        assert_eq!(ring(&[f64::INFINITY, 0.1], 0.1, &mut memory, 3.0), 3.0);
    }

    /// The exact steps are the differential equation, and a closed loop leaves an area.
    #[test]
    fn a_deflection_solves_its_equation() {
        let width = 0.4;
        let mut memory = [0.0, 0.0];
        let (mut z, mut v) = (0.0f64, 0.0f64);
        for k in 1..=400 {
            let next = (0.05 * f64::from(k)).sin();
            for _ in 0..2000 {
                let dv = (next - v) / 2000.0;
                let slope = |z: f64| (dv - 0.5 * dv.abs() * z - 0.5 * dv * z.abs()) / width;
                let middle = z + 0.5 * slope(z);
                z += slope(middle);
            }
            v = next;
            Deflection.next(&[1.0, width], 0.1, v, &mut memory);
            assert!((memory[0] - z).abs() < 1e-6, "{k}: {} {z}", memory[0]);
        }
        assert_eq!(deflected(0.3, 0.0), 0.3);
        assert!(deflected(f64::NAN, 0.1).is_nan());
    }

    /// A ramp delayed is the ramp less the delay, once the start has left the register.
    #[test]
    fn a_delayed_ramp_lags_by_the_delay() {
        let (dt, mut past) = (0.1, [0.0; DELAY_SAMPLES]);
        for d in [0.0, 0.03, 0.25, 6.3] {
            let last = (0..200)
                .map(|k| delay(d, dt, &mut past, f64::from(k) * dt))
                .last();
            assert!((last.unwrap() - (19.9 - d)).abs() < 1e-12, "delay {d}");
        }
    }

    #[test]
    fn a_delay_beyond_the_register_is_refused_with_the_remedy() {
        assert!(check_delay(31.5, 0.5).is_ok());
        let error = check_delay(32.0, 0.5).unwrap_err();
        assert!(error.contains("at most 31.5 s"), "{error}");
        assert!(check_delay(f64::NAN, 0.5).is_err());
    }
}
