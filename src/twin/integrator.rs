//! Fixed-step integrators that carry the equations from one sample to the next.

use crate::twin::Interval;
use serde::{Deserialize, Serialize};
use std::cmp::Ordering;

/// Time, step, inputs and parameters at which equations are evaluated.
#[derive(Debug, Clone, Copy)]
pub struct Now<'a> {
    /// Time in seconds on the record's own clock: `t` of its rows.
    pub t: f64,
    /// Step Δt in seconds: to the next sample, or a substep where [`StateSpace::drift`](crate::twin::StateSpace::drift) is evaluated.
    pub dt: f64,
    /// Inputs at this time.
    pub u: &'a [f64],
    /// Parameters θ.
    pub theta: &'a [f64],
    /// Position between samples; `None` where inputs are held from one to the next.
    pub(crate) between: Option<Between<'a>>,
    /// Time of the first row: laws of effects count from there.
    pub(crate) first_time: f64,
    /// Time that the start belongs to, the first row's or one before it: delays count from there.
    pub(crate) begun: f64,
}

impl<'a> Now<'a> {
    /// Time `t`, step `dt`, inputs `u` held over the step, and parameters θ; the first row is at 0.
    pub fn new(t: f64, dt: f64, u: &'a [f64], theta: &'a [f64]) -> Self {
        Self {
            t,
            dt,
            u,
            theta,
            between: None,
            first_time: 0.0,
            begun: 0.0,
        }
    }
}

/// A position between two samples.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Between<'a> {
    /// Inputs at the next sample.
    pub next: &'a [f64],
    /// Share of the next sample's inputs.
    pub share: f64,
    /// Inputs between this sample and the next.
    pub hold: Hold,
}

impl Between<'_> {
    /// Input on the line from `u` to the next sample's.
    #[inline]
    pub fn line(&self, u: &[f64], to: &mut [f64]) {
        for ((to, u), next) in to.iter_mut().zip(u).zip(self.next) {
            *to = u + self.share * (next - u);
        }
    }
}

/// Inputs between two samples.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Hold {
    /// Held at the value of the sample before.
    #[default]
    Zero,
    /// On the line from one sample to the next; the last is held.
    Linear,
    /// Held at the value of the nearest sample: what a smooth input does that was sampled, and not held. With an odd number of substeps, the
    /// middle one has the mean of both; the last is held.
    Nearest,
}

impl Hold {
    /// Share of the next sample's inputs at a `part` of one of several substeps.
    pub(crate) fn share(self, substep: usize, substeps: usize, part: f64) -> f64 {
        match self {
            Self::Zero => 0.0,
            Self::Linear => (substep as f64 + part) / substeps as f64,
            Self::Nearest => match (2 * substep + 1).cmp(&substeps) {
                Ordering::Less => 0.0,
                Ordering::Equal => 0.5,
                Ordering::Greater => 1.0,
            },
        }
    }
}

/// Most substeps of a sample.
pub(crate) const MOST_SUBSTEPS: usize = 1000;

/// Substeps of the integrator within a sample, and inputs there.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct Stepping {
    /// Steps of Δt/n within a sample, n ≥ 1.
    pub substeps: usize,
    /// Inputs between samples.
    pub hold: Hold,
}

impl Default for Stepping {
    /// One step, inputs held.
    fn default() -> Self {
        Self {
            substeps: 1,
            hold: Hold::Zero,
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
}

/// Buffers of one twin that outlive a step, so that the loop allocates nothing.
#[derive(Debug, Clone)]
pub(crate) struct Workspace {
    stages: StepBuffers,
    integrator: Integrator,
    /// Substeps and lines of inputs; `None` where a sample is one step and inputs are held.
    refined: Option<Refined>,
}

/// Buffers of a step.
#[derive(Debug, Clone)]
pub(super) struct StepBuffers {
    slopes: [Vec<f64>; 4],
    stage: Vec<f64>,
}

/// Rule by which a twin moves between samples.
#[derive(Debug, Clone)]
struct Refined {
    substeps: usize,
    /// Limits that are felt, by state.
    limits: Vec<(usize, Interval)>,
    /// Inputs at a stage.
    inputs: Vec<f64>,
}

impl Workspace {
    /// For equations of so many inputs, with these boxes of the states.
    pub(super) fn of(
        inputs: usize,
        limits: &[Interval],
        (integrator, stepping): (Integrator, Stepping),
    ) -> Self {
        Self {
            stages: StepBuffers::of(limits.len()),
            integrator,
            refined: (stepping != Stepping::default()).then(|| Refined {
                substeps: stepping.substeps.max(1),
                limits: felt(limits),
                inputs: vec![0.0; inputs],
            }),
        }
    }

    /// Returns whether a sample is one step of Euler's rule, inputs held.
    #[inline]
    pub(super) fn is_plain(&self) -> bool {
        self.refined.is_none() && self.integrator != Integrator::RungeKutta4
    }

    /// Buffers of a single step.
    #[inline]
    pub(super) fn stages(&mut self) -> &mut StepBuffers {
        &mut self.stages
    }

    /// Carries points of `n` states each over one sample, in the substeps of the twin.
    #[inline(always)]
    pub(super) fn carry(
        &mut self,
        n: usize,
        now: &Now<'_>,
        x: &mut [f64],
        drift: impl FnMut(&Now<'_>, &[f64], &mut [f64]),
    ) {
        let (rule, stages) = (self.integrator, &mut self.stages);
        match &mut self.refined {
            Some(refined) => rule.substeps(n, now, x, (stages, refined), drift),
            None => rule.step(now, x, stages, drift),
        }
    }

    /// A buffer for `states` states.
    pub(super) fn stage(&mut self, states: usize) -> &mut [f64] {
        grown(&mut self.stages.stage, states)
    }
}

impl StepBuffers {
    /// For `states` states.
    fn of(states: usize) -> Self {
        Self {
            slopes: std::array::from_fn(|_| vec![0.0; states]),
            stage: vec![0.0; states],
        }
    }
}

/// Boxes that are felt, by state.
pub(super) fn felt(limits: &[Interval]) -> Vec<(usize, Interval)> {
    let limits = limits.iter().copied().enumerate();
    limits
        .filter(|(_, limit)| *limit != Interval::EVERYTHING)
        .collect()
}

/// The first `length` numbers of a buffer, which grows where it is shorter.
#[inline]
fn grown(buffer: &mut Vec<f64>, length: usize) -> &mut [f64] {
    if buffer.len() < length {
        buffer.resize(length, 0.0);
    }
    &mut buffer[..length]
}

impl Integrator {
    /// One step in place, the input held: `x(t)` becomes `x(t + Δt)` under `drift(now, x, dx)`.
    #[inline]
    pub(super) fn step(
        self,
        now: &Now<'_>,
        x: &mut [f64],
        work: &mut StepBuffers,
        mut drift: impl FnMut(&Now<'_>, &[f64], &mut [f64]),
    ) {
        self.step_in_stages(now, x, work, |_, now, x, dx| drift(now, x, dx));
    }

    /// Steps of Δt/m, inputs between this sample's and the next one's where there is one. States are put into their limits between substeps, as
    /// they would be between samples of a finer step.
    #[inline(never)]
    fn substeps(
        self,
        n: usize,
        now: &Now<'_>,
        x: &mut [f64],
        (work, refined): (&mut StepBuffers, &mut Refined),
        mut drift: impl FnMut(&Now<'_>, &[f64], &mut [f64]),
    ) {
        let m = refined.substeps;
        let h = now.dt / m as f64;
        for i in 0..m {
            if i > 0 {
                for &(j, limit) in &refined.limits {
                    for x in x.iter_mut().skip(j).step_by(n) {
                        *x = limit.clamp(*x);
                    }
                }
            }
            let sub = Now {
                t: now.t + i as f64 * h,
                dt: h,
                ..*now
            };
            let Some(between) = now.between else {
                self.step(&sub, x, work, &mut drift);
                continue;
            };
            let inputs = &mut refined.inputs;
            self.step_in_stages(&sub, x, work, |share, stage, x, dx| {
                let between = Between {
                    share: between.hold.share(i, m, share),
                    ..between
                };
                between.line(now.u, inputs);
                let stage = Now {
                    u: inputs,
                    between: Some(between),
                    ..*stage
                };
                drift(&stage, x, dx);
            });
        }
    }

    /// As [`step`](Self::step); `drift` is also told the share of the step that has passed at each stage.
    #[inline]
    fn step_in_stages(
        self,
        now: &Now<'_>,
        x: &mut [f64],
        work: &mut StepBuffers,
        mut drift: impl FnMut(f64, &Now<'_>, &[f64], &mut [f64]),
    ) {
        let dt = now.dt;
        match self {
            // The engine gives a discrete twin's way to the next sample as a rate.
            Self::Euler | Self::Discrete => {
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
                let end = Now {
                    t: now.t + dt,
                    ..*now
                };
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

/// `out = x + h·slope`.
fn shifted(x: &[f64], h: f64, slope: &[f64], out: &mut [f64]) {
    for ((out, x), s) in out.iter_mut().zip(x).zip(slope) {
        *out = x + h * s;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Global error of ẋ = −x + t at t = 1, whose solution is 2e^{−t} + t − 1.
    fn error(integrator: Integrator, steps: usize) -> f64 {
        let (dt, mut x, mut work) = (1.0 / steps as f64, [1.0], StepBuffers::of(1));
        for k in 0..steps {
            let now = Now::new(k as f64 * dt, dt, &[], &[]);
            integrator.step(&now, &mut x, &mut work, |now, x, dx| dx[0] = now.t - x[0]);
        }
        (x[0] - 2.0 * (-1.0f64).exp()).abs()
    }

    /// Halving the step divides the error by 2^order.
    #[test]
    fn convergence_orders() {
        for (integrator, order) in [(Integrator::Euler, 1.0), (Integrator::RungeKutta4, 4.0)] {
            let measured = (error(integrator, 20) / error(integrator, 40)).log2();
            assert!(
                (measured - order).abs() < 0.15,
                "{integrator:?}: {measured}"
            );
        }
    }
}
