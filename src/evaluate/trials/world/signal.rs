//! Distortions of a signal on its way from a sensor or to an actuator: whole series at once, in formulas of its own.

use crate::twin::Noise;
use serde::{Deserialize, Serialize};
use std::f64::consts::PI;

/// Steps of a lag that is integrated, per sample.
const FINE: usize = 20;

/// A law from one series to another of the same length.
///
/// Where a law has a softness (`settling`, `knee`, `rounding`, `compliance`), 0 is its textbook form and anything else the
/// same physics with smooth edges.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(in crate::evaluate::trials) enum SignalLaw {
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
    /// With this probability a value is off by N(0, scale²), or by ±scale.
    Outliers {
        probability: f64,
        scale: f64,
        alike: bool,
    },
    /// No answer around zero.
    DeadZone { width: f64, knee: f64 },
    /// Play between two gears.
    Play { width: f64, compliance: f64 },
    /// A limit on the change a second.
    RateLimit { rate: f64, knee: f64 },
    /// Another factor on the way up than on the way down.
    Asymmetry { error: f64 },
    /// A dead time that grows with the signal, `delay` seconds at `span`.
    LevelDelay { delay: f64, span: f64 },
    /// Bursts of spikes at odd times, `each` seconds apart on average.
    Glitches { height: f64, each: f64 },
    /// Now and then the value stays, for `length` seconds.
    Sticking { length: f64, each: f64 },
    /// A perturbed characteristic: s + c·s².
    Curve { coefficient: f64 },
    /// The factor falls with use, to 1 − loss, over `capacity` of accumulated |s|·Δt.
    Fading { loss: f64, capacity: f64 },
}

impl SignalLaw {
    /// The perturbed series; random laws draw from `noise`.
    pub fn apply(&self, s: &[f64], dt: f64, noise: Noise) -> Vec<f64> {
        let time = |k: usize| k as f64 * dt;
        let each = |f: &dyn Fn(usize, f64) -> f64| -> Vec<f64> {
            s.iter().enumerate().map(|(k, v)| f(k, *v)).collect()
        };
        match *self {
            Self::Bias { offset, settling } => each(&|k, v| {
                let missing = if settling > 0.0 {
                    (-time(k) / settling).exp()
                } else {
                    0.0
                };
                v + offset * (1.0 - missing)
            }),
            Self::Gain { factor } => each(&|_, v| factor * v),
            Self::Drift { rate, levelling } => each(&|k, v| match levelling {
                None => v + rate * time(k),
                Some(span) => v + rate * span * (1.0 - (-time(k) / span).exp()),
            }),
            Self::Lag { tau } => follow(s, |z, v, _| z + (1.0 - (-dt / tau).exp()) * (v - z)),
            Self::LowPass { cutoff } => follow(s, |mut z, v, before| {
                let h = 2.0 * PI * cutoff * dt / FINE as f64;
                for i in 1..=FINE {
                    let now = before + (v - before) * i as f64 / FINE as f64;
                    z = (z + h * now) / (1.0 + h);
                }
                z
            }),
            Self::Delay { delay, cubic } => each(&|k, _| past(s, k as f64 - delay / dt, cubic)),
            Self::Rectification { fraction, rounding } => each(&|_, v| {
                let size = (v * v + rounding * rounding).sqrt();
                v + fraction * (size - v)
            }),
            Self::Saturation { low, high, knee } => each(&|_, v| {
                let v = high.map_or(v, |high| high - above(high - v, knee));
                low.map_or(v, |low| low + above(v - low, knee))
            }),
            Self::Quantization { step, half_way } => each(&|_, v| {
                let levels = v / step;
                step * if half_way {
                    levels.floor() + 0.5
                } else {
                    (levels + 0.5).floor()
                }
            }),
            Self::Outliers {
                probability,
                scale,
                alike,
            } => {
                let mut source = noise.source("rare errors");
                s.iter()
                    .map(|v| {
                        let (hit, size) = (source.happens(probability), source.normal());
                        let size = if alike { size.signum() } else { size };
                        if hit { v + scale * size } else { *v }
                    })
                    .collect()
            }
            Self::DeadZone { width, knee } => {
                each(&|_, v| above(v - 0.5 * width, knee) - above(-v - 0.5 * width, knee))
            }
            Self::Play { width, compliance } => follow(s, |z, v, _| {
                let contact = if v - z > 0.5 * width {
                    v - 0.5 * width
                } else if z - v > 0.5 * width {
                    v + 0.5 * width
                } else {
                    z
                };
                z + (1.0 - compliance) * (contact - z)
            }),
            Self::RateLimit { rate, knee } => {
                let most = rate * dt;
                follow(s, |z, v, _| {
                    let hard = (v - z).max(-most).min(most);
                    z + (1.0 - knee) * hard + knee * most * ((v - z) / most).tanh()
                })
            }
            Self::Asymmetry { error } => {
                let mut way = 0.0;
                let mut before = s.first().copied().unwrap_or(0.0);
                each_mut(s, |v| {
                    let change: f64 = v - before;
                    before = v;
                    if change != 0.0 {
                        way += 0.3 * (change.signum() - way);
                    }
                    v * (1.0 + error * way)
                })
            }
            Self::LevelDelay { delay, span } => each(&|k, v| {
                let ago = delay * (v.abs() / span).min(2.0) / dt;
                past(s, k as f64 - ago, false)
            }),
            Self::Glitches {
                height,
                each: apart,
            } => {
                let mut source = noise.source("glitches");
                let mut left = 0usize;
                each_mut(s, |v| {
                    if left == 0 && source.happens(dt / apart) {
                        left = 3 + (9.0 * source.uniform()) as usize;
                    }
                    let spike = height * (2.0 * source.uniform() - 0.5);
                    left = left.saturating_sub(1);
                    if left > 0 { v + spike } else { v }
                })
            }
            Self::Sticking {
                length,
                each: apart,
            } => {
                let mut source = noise.source("sticking");
                let (mut left, mut stuck) = (0.0, 0.0);
                each_mut(s, |v| {
                    if left > 0.0 {
                        left -= dt;
                        return stuck;
                    }
                    if source.happens(dt / apart) {
                        (left, stuck) = (length * (0.5 + source.uniform()), v);
                    }
                    v
                })
            }
            Self::Curve { coefficient } => each(&|_, v| v + coefficient * v * v),
            Self::Fading { loss, capacity } => {
                let mut used = 0.0;
                each_mut(s, |v| {
                    used += v.abs() * dt;
                    v * (1.0 - loss * (1.0 - (-used / capacity).exp()))
                })
            }
        }
    }
}

fn each_mut(s: &[f64], f: impl FnMut(f64) -> f64) -> Vec<f64> {
    s.iter().copied().map(f).collect()
}

/// z ← f(z, s_k, s_{k−1}), from the first value on.
fn follow(s: &[f64], f: impl Fn(f64, f64, f64) -> f64) -> Vec<f64> {
    let Some(&first) = s.first() else {
        return vec![];
    };
    let (mut z, mut before) = (first, first);
    each_mut(s, |v| {
        z = f(z, v, before);
        before = v;
        z
    })
}

/// The part of v above zero; with a knee, rounded over about that width.
pub(super) fn above(v: f64, knee: f64) -> f64 {
    if knee > 0.0 {
        // Far out, exp would overflow and the knee is not felt.
        match v / knee {
            z if z > 30.0 => v,
            z => knee * z.exp().ln_1p(),
        }
    } else {
        v.max(0.0)
    }
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

    fn perturbed(law: &SignalLaw) -> Vec<f64> {
        law.apply(&ramp(), 0.1, Noise::new(1, "t", 0))
    }

    /// Behind a ramp of slope 1 a second both forms of a lag end up τ late, and both of a delay its length.
    #[test]
    fn two_forms_of_one_law_agree_where_theory_says() {
        let late = |law: SignalLaw| ramp()[199] - perturbed(&law)[199];
        let (tau, cutoff) = (0.8, 1.0 / (2.0 * PI * 0.8));
        assert!((late(SignalLaw::LowPass { cutoff }) - tau).abs() < 0.02);
        assert!((late(SignalLaw::Lag { tau }) - tau).abs() < 0.06);
        for cubic in [false, true] {
            let delay = 0.734;
            assert!((late(SignalLaw::Delay { delay, cubic }) - delay).abs() < 1e-9);
        }
    }

    #[test]
    fn smooth_edges_are_smooth_and_close() {
        for (hard, soft) in [
            (
                SignalLaw::Saturation {
                    low: Some(-2.0),
                    high: Some(3.0),
                    knee: 0.0,
                },
                SignalLaw::Saturation {
                    low: Some(-2.0),
                    high: Some(3.0),
                    knee: 0.1,
                },
            ),
            (
                SignalLaw::DeadZone {
                    width: 2.0,
                    knee: 0.0,
                },
                SignalLaw::DeadZone {
                    width: 2.0,
                    knee: 0.1,
                },
            ),
            (
                SignalLaw::Rectification {
                    fraction: 0.5,
                    rounding: 0.0,
                },
                SignalLaw::Rectification {
                    fraction: 0.5,
                    rounding: 0.1,
                },
            ),
        ] {
            let apart = (perturbed(&hard).iter().zip(perturbed(&soft)))
                .map(|(a, b)| (a - b).abs())
                .fold(0.0, f64::max);
            assert!(apart > 1e-3 && apart < 0.1, "{hard:?}: {apart}");
        }
        assert_eq!(above(-1.0, 0.0), 0.0);
        assert_eq!(above(100.0, 0.1), 100.0);
    }

    #[test]
    fn random_laws_repeat() {
        for law in [
            SignalLaw::Glitches {
                height: 1.0,
                each: 2.0,
            },
            SignalLaw::Sticking {
                length: 0.5,
                each: 2.0,
            },
        ] {
            assert_eq!(perturbed(&law), perturbed(&law));
            assert_ne!(perturbed(&law), ramp());
        }
    }
}
