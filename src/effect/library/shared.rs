//! Laws and magnitudes that sensors and actuators share.

use super::super::magnitude::{Magnitude, Shape};
use crate::setting::number;

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

/// Takes `value` into the shift register `past`, newest first, and reads it `delay` seconds ago, linear between
/// samples. [`check_delay`] has refused what the register does not reach.
pub(super) fn delay(delay: f64, dt: f64, past: &mut [f64], value: f64) -> f64 {
    past.rotate_right(1);
    past[0] = value;
    let ago = (delay / dt).clamp(0.0, (past.len() - 1) as f64);
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
        number(longest)
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
