//! Distortions of a signal, sample by sample.

use super::above;
use crate::evaluate::trials::numbers::TRIAL;
use crate::math::nearest;
use serde::{Deserialize, Serialize};
use std::f64::consts::PI;

/// A law from one signal to another.
///
/// Where a law has a softness (`settling`, `knee`, `rounding`, `compliance`), 0 is its textbook form and anything else the same
/// physics with smooth edges.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(in crate::evaluate::trials) enum SignalDeparture {
    /// An offset that is reached with the time constant `settling`, in seconds.
    Bias { offset: f64, settling: f64 },
    /// A factor.
    Gain { factor: f64 },
    /// An offset that grows by `rate` a second at first, and levels off over `levelling` seconds.
    Drift { rate: f64, levelling: Option<f64> },
    /// First order, time constant `tau` in seconds.
    Lag { tau: f64 },
    /// First order, given by its cut-off frequency in Hz and integrated in small steps along straight lines.
    LowPass { cutoff: f64 },
    /// A dead time in seconds; between samples along a straight line, or along a cubic.
    Delay { delay: f64, cubic: bool },
    /// A part of the signal is seen without its sign.
    Rectification { fraction: f64, rounding: f64 },
    /// Ends of the range.
    Saturation {
        low: Option<f64>,
        high: Option<f64>,
        knee: f64,
    },
    /// Levels at multiples of the step, or half-way between them.
    Quantization { step: f64, half_way: bool },
    /// No answer around zero.
    DeadZone { width: f64, knee: f64 },
    /// Play between two gears.
    Play { width: f64, compliance: f64 },
    /// A limit on the change a second.
    RateLimit { rate: f64, knee: f64 },
}

impl SignalDeparture {
    /// The distorted value at time `t`. `memory` is empty at first and belongs to the law.
    pub fn at(&self, t: f64, dt: f64, memory: &mut Vec<f64>, v: f64) -> f64 {
        match *self {
            Self::Bias { offset, settling } => {
                let missing = if settling > 0.0 {
                    (-t / settling).exp()
                } else {
                    0.0
                };
                v + offset * (1.0 - missing)
            }
            Self::Gain { factor } => factor * v,
            Self::Drift { rate, levelling } => match levelling {
                None => v + rate * t,
                Some(span) => v + rate * span * (1.0 - (-t / span).exp()),
            },
            Self::Lag { tau } => follow(memory, v, |z, _| z + (1.0 - (-dt / tau).exp()) * (v - z)),
            Self::LowPass { cutoff } => follow(memory, v, |mut z, before| {
                let h = 2.0 * PI * cutoff * dt / TRIAL.lag_steps as f64;
                for i in 1..=TRIAL.lag_steps {
                    let now = before + (v - before) * i as f64 / TRIAL.lag_steps as f64;
                    z = (z + h * now) / (1.0 + h);
                }
                z
            }),
            Self::Delay { delay, cubic } => {
                memory.push(v);
                past(memory, (memory.len() - 1) as f64 - delay / dt, cubic)
            }
            Self::Rectification { fraction, rounding } => {
                v + fraction * ((v * v + rounding * rounding).sqrt() - v)
            }
            Self::Saturation { low, high, knee } => {
                let v = high.map_or(v, |high| high - above(high - v, knee));
                low.map_or(v, |low| low + above(v - low, knee))
            }
            Self::Quantization { step, half_way } => {
                let levels = v / step;
                step * if half_way {
                    levels.floor() + 0.5
                } else {
                    (levels + 0.5).floor()
                }
            }
            Self::DeadZone { width, knee } => {
                above(v - 0.5 * width, knee) - above(-v - 0.5 * width, knee)
            }
            Self::Play { width, compliance } => follow(memory, v, |z, _| {
                let half = 0.5 * width;
                z + (1.0 - compliance) * (nearest(z, v - half, v + half) - z)
            }),
            Self::RateLimit { rate, knee } => follow(memory, v, |z, _| {
                let most = rate * dt;
                let hard = nearest(v - z, -most, most);
                z + (1.0 - knee) * hard + knee * most * ((v - z) / most).tanh()
            }),
        }
    }
}

/// z ← f(z, signal of the sample before), from the first value on.
fn follow(memory: &mut Vec<f64>, v: f64, f: impl Fn(f64, f64) -> f64) -> f64 {
    if memory.is_empty() {
        memory.extend([v, v]);
    }
    memory[0] = f(memory[0], memory[1]);
    memory[1] = v;
    memory[0]
}

/// The series at a place between samples, its first value before the start.
fn past(s: &[f64], place: f64, cubic: bool) -> f64 {
    let at = |i: f64| s[(i.max(0.0) as usize).min(s.len() - 1)];
    let (i, f) = (place.floor(), place - place.floor());
    let (a, b) = (at(i), at(i + 1.0));
    if !cubic {
        return a + f * (b - a);
    }
    // Catmull–Rom: slopes from the neighbours.
    let (before, after) = (at(i - 1.0), at(i + 2.0));
    let (p, q) = (0.5 * (b - before), 0.5 * (after - a));
    a + f * (p + f * (3.0 * (b - a) - 2.0 * p - q + f * (2.0 * (a - b) + p + q)))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ramp() -> Vec<f64> {
        (0..200).map(|k| 0.1 * f64::from(k) - 5.0).collect()
    }

    fn distorted(law: &SignalDeparture) -> Vec<f64> {
        let mut memory = vec![];
        (ramp().iter().enumerate())
            .map(|(k, v)| law.at(0.1 * k as f64, 0.1, &mut memory, *v))
            .collect()
    }

    /// Behind a ramp of slope 1 a second both forms of a lag end up τ late, and both of a delay its length.
    #[test]
    fn two_forms_of_one_law_agree_where_theory_says() {
        let late = |law: SignalDeparture| ramp()[199] - distorted(&law)[199];
        let (tau, cutoff) = (0.8, 1.0 / (2.0 * PI * 0.8));
        assert!((late(SignalDeparture::LowPass { cutoff }) - tau).abs() < 0.02);
        assert!((late(SignalDeparture::Lag { tau }) - tau).abs() < 0.06);
        for cubic in [false, true] {
            let delay = 0.734;
            let late = late(SignalDeparture::Delay { delay, cubic });
            assert!((late - delay).abs() < 1e-9, "{late}");
        }
    }

    #[test]
    fn smooth_edges_are_smooth_and_close() {
        let saturation = |knee| SignalDeparture::Saturation {
            low: Some(-2.0),
            high: Some(3.0),
            knee,
        };
        let zone = |knee| SignalDeparture::DeadZone { width: 2.0, knee };
        for (hard, soft) in [(saturation(0.0), saturation(0.1)), (zone(0.0), zone(0.1))] {
            let apart = (distorted(&hard).iter().zip(distorted(&soft)))
                .map(|(a, b)| (a - b).abs())
                .fold(0.0, f64::max);
            assert!(apart > 1e-3 && apart < 0.1, "{hard:?}: {apart}");
        }
        assert_eq!(above(-1.0, 0.0), 0.0);
        assert_eq!(above(100.0, 0.1), 100.0);
    }

    #[test]
    fn memories_keep_within_their_limits() {
        let limited = distorted(&SignalDeparture::RateLimit {
            rate: 0.5,
            knee: 0.0,
        });
        assert!((limited[199] - limited[99] - 5.0).abs() < 1e-9);
        let play = distorted(&SignalDeparture::Play {
            width: 1.0,
            compliance: 0.0,
        });
        assert!((ramp()[199] - play[199] - 0.5).abs() < 1e-12);
    }
}
