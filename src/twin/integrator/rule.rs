//! Rules that carry the state over one step.

use super::path::{Path, Stretch};
use super::{Hold, Now};
use serde::{Deserialize, Serialize};
use std::ops::RangeInclusive;

/// Most substeps of a sample.
pub(crate) const MOST_SUBSTEPS: usize = 1000;

/// Tolerances that can be asked for: above what rounding leaves, below what is no tolerance.
pub(crate) const TOLERANCES: RangeInclusive<f64> = 1e-12..=0.1;
/// Largest error of an adaptive substep, as a share of a state's largest size so far. Stiff systems of the literature then come within a
/// millionth of their scale; at ten times as much Robertson's reactions go astray, a tenth costs half as many steps again.
const TOLERANCE: f64 = 1e-7;

/// Substeps of the integrator within a sample, and inputs there.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Stepping {
    /// Steps of Δt/n within a sample, n ≥ 1; the least number of adaptive ones.
    pub substeps: usize,
    /// Inputs between samples, but for those that the [outline](crate::twin::Outline::hold) has another rule of.
    pub hold: Hold,
    /// Largest error of an adaptive substep, as a share of a state's largest size so far.
    pub tolerance: f64,
}

impl Default for Stepping {
    /// One step, inputs held; adaptive ones to 10⁻⁷.
    fn default() -> Self {
        Self {
            substeps: 1,
            hold: Hold::Zero,
            tolerance: TOLERANCE,
        }
    }
}

/// The rule that carries the state over one step.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Integrator {
    /// x ← x + Δt·f(t, x), first order; the rule of the paper's twins.
    #[default]
    Euler,
    /// The classical fourth-order Runge–Kutta step.
    #[serde(rename = "runge-kutta-4")]
    RungeKutta4,
    /// x ← f(t, x): the drift is the state at the next sample, and nothing is between samples. Forces of effects are rates still: they
    /// add Δt times themselves.
    Discrete,
    /// Substeps to a [tolerance](Stepping::tolerance), by the pair of orders 5 and 4 of Dormand and Prince; where that takes many, by the
    /// method of [`Stiff`](Self::Stiff). All points of a filter take the same, chosen so that each keeps the tolerance.
    Adaptive,
    /// Substeps to a tolerance by an L-stable method of order 4 (RODAS of Hairer and Wanner), for rates that differ by orders of magnitude.
    Stiff,
}

/// Buffers of a step.
#[derive(Debug, Clone)]
pub(in crate::twin) struct StepBuffers {
    slopes: [Vec<f64>; 4],
    stage: Vec<f64>,
}

impl StepBuffers {
    /// For `states` states.
    pub(super) fn of(states: usize) -> Self {
        Self {
            slopes: std::array::from_fn(|_| vec![0.0; states]),
            stage: vec![0.0; states],
        }
    }

    /// A buffer for `states` states.
    pub(in crate::twin) fn stage(&mut self, states: usize) -> &mut [f64] {
        grown(&mut self.stage, states)
    }
}

impl Integrator {
    /// Returns whether steps are as long as a tolerance allows.
    pub(crate) fn is_adaptive(self) -> bool {
        matches!(self, Self::Adaptive | Self::Stiff)
    }

    /// Returns whether it takes rates where limits have not acted yet.
    pub(super) fn is_between(self) -> bool {
        !matches!(self, Self::Euler | Self::Discrete)
    }

    /// One step in place, the input held: `x(t)` becomes `x(t + Δt)` under `drift(now, x, dx)`.
    #[inline]
    pub(in crate::twin) fn step(
        self,
        now: &Now<'_>,
        x: &mut [f64],
        work: &mut StepBuffers,
        mut drift: impl FnMut(&Now<'_>, &[f64], &mut [f64]),
    ) {
        self.step_in_stages(now, x, work, |_, now, x, dx| drift(now, x, dx));
    }

    /// One step over a stretch of the way.
    pub(super) fn step_over(
        self,
        path: &mut Path<'_, '_>,
        of: Stretch,
        x: &mut [f64],
        work: &mut StepBuffers,
    ) {
        let now = Now {
            t: path.time(of.from),
            dt: path.seconds(of),
            end: path.time(of.from + of.length),
            ..*path.now
        };
        self.step_in_stages(&now, x, work, |share, _, x, dx| {
            path.rates(of, share, x, dx)
        });
    }

    /// As [`step`](Self::step); `drift` is also told the share of the step that has passed at each stage.
    #[inline]
    pub(super) fn step_in_stages(
        self,
        now: &Now<'_>,
        x: &mut [f64],
        work: &mut StepBuffers,
        mut drift: impl FnMut(f64, &Now<'_>, &[f64], &mut [f64]),
    ) {
        let dt = now.dt;
        match self {
            // The engine gives a discrete twin's way to the next sample as a rate. Steps to a tolerance have a schedule.
            Self::Euler | Self::Discrete | Self::Adaptive | Self::Stiff => {
                // Few numbers stay in registers where the drift is compiled into this.
                let mut few = [0.0; 4];
                let slope = match x.len() {
                    n @ ..=4 => &mut few[..n],
                    n => grown(&mut work.slopes[0], n),
                };
                drift(0.0, now, x, slope);
                for (x, d) in x.iter_mut().zip(slope) {
                    *x += dt * *d;
                }
            }
            Self::RungeKutta4 => {
                let [k1, k2, k3, k4] = work.slopes.each_mut().map(|k| grown(k, x.len()));
                let stage = grown(&mut work.stage, x.len());
                let half = Now {
                    t: now.t + 0.5 * dt,
                    ..*now
                };
                let end = Now { t: now.end, ..*now };
                drift(0.0, now, x, k1);
                shifted(x, 0.5 * dt, k1, stage);
                drift(0.5, &half, stage, k2);
                shifted(x, 0.5 * dt, k2, stage);
                drift(0.5, &half, stage, k3);
                shifted(x, dt, k3, stage);
                drift(1.0, &end, stage, k4);
                for (i, x) in x.iter_mut().enumerate() {
                    *x += dt / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i]);
                }
            }
        }
    }
}

/// The first `length` numbers of a buffer, which grows where it is shorter.
#[inline]
fn grown(buffer: &mut Vec<f64>, length: usize) -> &mut [f64] {
    if buffer.len() < length {
        buffer.resize(length, 0.0);
    }
    &mut buffer[..length]
}

/// `out = x + h·slope`.
fn shifted(x: &[f64], h: f64, slope: &[f64], out: &mut [f64]) {
    for ((out, x), s) in out.iter_mut().zip(x).zip(slope) {
        *out = x + h * s;
    }
}
