//! Fixed-step integrators that carry the equations from one sample to the next.

use serde::{Deserialize, Serialize};

/// Time, step, inputs and parameters at which equations are evaluated.
#[derive(Debug, Clone, Copy)]
pub struct Now<'a> {
    /// Time in seconds from the first sample.
    pub t: f64,
    /// Step Δt in seconds.
    pub dt: f64,
    /// Inputs, held over the step.
    pub u: &'a [f64],
    /// Parameters θ.
    pub theta: &'a [f64],
}

/// The rule that carries the state over one step Δt, the input held.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Integrator {
    /// x ← x + Δt·f(t, x), first order; the rule of the paper's twins.
    #[default]
    Euler,
    /// The classical fourth-order Runge–Kutta step.
    RungeKutta4,
}

/// Buffers that outlive a step, so that the loop allocates nothing.
#[derive(Debug, Clone, Default)]
pub struct Workspace {
    slopes: [Vec<f64>; 4],
    stage: Vec<f64>,
}

impl Workspace {
    /// For `states` states.
    pub fn new(states: usize) -> Self {
        Self {
            slopes: std::array::from_fn(|_| vec![0.0; states]),
            stage: vec![0.0; states],
        }
    }
}

impl Integrator {
    /// One step in place: `x(t)` becomes `x(t + Δt)` under `drift(now, x, dx)`.
    #[inline]
    pub fn step(
        self,
        now: &Now<'_>,
        x: &mut [f64],
        work: &mut Workspace,
        mut drift: impl FnMut(&Now<'_>, &[f64], &mut [f64]),
    ) {
        let dt = now.dt;
        match self {
            Self::Euler => {
                // Few numbers stay in registers where the drift is compiled into this.
                let mut few = [0.0; 4];
                let slope = match x.len() {
                    n @ ..=4 => &mut few[..n],
                    n => &mut work.slopes[0][..n],
                };
                drift(now, x, slope);
                for (x, d) in x.iter_mut().zip(slope) {
                    *x += dt * *d;
                }
            }
            Self::RungeKutta4 => {
                let [k1, k2, k3, k4] = &mut work.slopes;
                let stage = &mut work.stage;
                let half = Now {
                    t: now.t + 0.5 * dt,
                    ..*now
                };
                let end = Now {
                    t: now.t + dt,
                    ..*now
                };
                drift(now, x, k1);
                shifted(x, 0.5 * dt, k1, stage);
                drift(&half, stage, k2);
                shifted(x, 0.5 * dt, k2, stage);
                drift(&half, stage, k3);
                shifted(x, dt, k3, stage);
                drift(&end, stage, k4);
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
        let (dt, mut x, mut work) = (1.0 / steps as f64, [1.0], Workspace::new(1));
        for k in 0..steps {
            let now = Now {
                t: k as f64 * dt,
                dt,
                u: &[],
                theta: &[],
            };
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
