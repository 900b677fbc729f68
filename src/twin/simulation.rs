//! The loop that simulates equations.

use crate::record::{Drive, Signal, Signals};
use crate::twin::{
    Acting, DigitalTwin, Interval, Noise, Now, Outline, ParameterSpace, SimulationError,
    StateSpace, Workspace,
};
use std::sync::Arc;

impl<T: StateSpace + 'static> DigitalTwin for T {
    fn parameters(&self) -> ParameterSpace {
        self.outline().parameters
    }

    fn signals(&self) -> Signals {
        self.outline().signals()
    }

    fn simulate(
        &self,
        theta: &[f64],
        drive: &Drive,
        noise: Noise,
    ) -> Result<Signal, SimulationError> {
        self.run(theta, drive, noise)
    }

    fn free_run(&self, theta: &[f64], drive: &Drive) -> Result<Signal, SimulationError> {
        self.run(theta, drive, Noise::OFF)
    }

    fn equations(self: Arc<Self>) -> Option<Arc<dyn StateSpace>> {
        Some(self)
    }
}

/// Checks that θ has the twin's length.
pub(super) fn check_length(parameters: usize, theta: &[f64]) -> Result<(), SimulationError> {
    if theta.len() == parameters {
        return Ok(());
    }
    Err(SimulationError::fatal(format!(
        "{} parameter values given, the twin has {parameters}",
        theta.len()
    )))
}

/// Checks lengths once, before the loop relies on them.
fn check_lengths(outline: &Outline, theta: &[f64], drive: &Drive) -> Result<(), SimulationError> {
    check_length(outline.parameters.len(), theta)?;
    let (given, inputs) = (drive.inputs().ncols(), outline.inputs.len());
    if given != inputs {
        return Err(SimulationError::fatal(format!(
            "the drive has {given} inputs, the twin has {inputs}"
        )));
    }
    Ok(())
}

/// The simulation loop. Allocates its buffers once; nothing inside the loop.
pub(super) fn simulate_equations(
    twin: &(impl StateSpace + ?Sized),
    theta: &[f64],
    drive: &Drive,
    noise: Noise,
) -> Result<Signal, SimulationError> {
    let outline = twin.outline();
    check_lengths(&outline, theta, drive)?;
    twin.check_parameters(theta, drive.dt())?;
    let (n, p) = (outline.states.len(), outline.outputs.len());
    let limits: Vec<(usize, Interval)> = twin
        .limits()
        .into_iter()
        .enumerate()
        .filter(|(_, limit)| *limit != Interval::EVERYTHING)
        .collect();
    let mut process: Vec<_> = (outline.states.iter())
        .map(|s| noise.source(&format!("process/{}", s.name)))
        .collect();
    let mut measurement: Vec<_> = (outline.outputs.iter())
        .map(|y| noise.source(&format!("measurement/{}", y.name)))
        .collect();
    let (mut q, mut r) = (vec![0.0; n], vec![0.0; p]);
    let mut x = vec![0.0; n];
    let mut work = Workspace::new(twin);
    let acting = Acting::of(twin, theta, drive)?;
    let mut dead_time = DeadTime::of(twin, theta, drive.dt());
    let mut outputs = vec![0.0; drive.samples() * p];
    let first = acting.at(0, theta);
    twin.start(&first, &mut x);
    if !noise.is_off() {
        draw_start(twin, &first, &outline, noise, &mut x);
    }
    for k in 0..drive.samples() {
        let now = acting.at(k, theta);
        let y = &mut outputs[k * p..(k + 1) * p];
        twin.observe(&now, &x, y);
        dead_time.hold_back(y);
        if !noise.is_off() {
            q.fill(0.0);
            r.fill(0.0);
            twin.noise(&now, &mut q, &mut r);
            for ((y, r), v) in y.iter_mut().zip(&r).zip(&mut measurement) {
                if *r != 0.0 {
                    *y += r * v.normal();
                }
            }
        }
        twin.readout(&now, y);
        if !y.iter().all(|v| v.is_finite()) {
            return Err(SimulationError::Diverged { at: now.t });
        }
        twin.advance(&now, &mut x, &mut work);
        if !noise.is_off() {
            for ((x, q), w) in x.iter_mut().zip(&q).zip(&mut process) {
                if *q != 0.0 {
                    *x += q * w.normal();
                }
            }
        }
        twin.constrain(&now, &mut x);
        for &(i, limit) in &limits {
            x[i] = limit.clamp(x[i]);
        }
        if !x.iter().all(|v| v.is_finite()) {
            return Err(SimulationError::Diverged { at: now.t + now.dt });
        }
    }
    let mut outputs = Signal::from_shape_vec((drive.samples(), p), outputs)
        .map_err(|error| SimulationError::Fatal(error.into()))?;
    twin.corrupt_outputs(theta, noise, &mut outputs);
    Ok(outputs)
}

/// Holds outputs back by their dead times; before the start, the first values stand.
pub(crate) struct DeadTime {
    /// Samples of each output; empty where none is late.
    late: Vec<usize>,
    /// Outputs so far, as observed.
    observed: Vec<f64>,
}

impl DeadTime {
    pub fn of(twin: &(impl StateSpace + ?Sized), theta: &[f64], dt: f64) -> Self {
        Self {
            late: twin.dead_time(theta, dt),
            observed: vec![],
        }
    }

    /// Replaces the outputs of the next sample by those that are shown at it.
    pub fn hold_back(&mut self, y: &mut [f64]) {
        if self.late.is_empty() {
            return;
        }
        let (p, k) = (y.len(), self.observed.len() / y.len());
        self.observed.extend_from_slice(y);
        for (j, (y, late)) in y.iter_mut().zip(&self.late).enumerate() {
            *y = self.observed[k.saturating_sub(*late) * p + j];
        }
    }
}

/// Moves the start by draws of its own deviations, within the limits.
fn draw_start(
    twin: &(impl StateSpace + ?Sized),
    now: &Now<'_>,
    outline: &Outline,
    noise: Noise,
    x: &mut [f64],
) {
    let mut std = vec![0.0; x.len()];
    twin.start_deviation(now, &mut std);
    if std.iter().all(|std| *std == 0.0) {
        return;
    }
    let moved = (x.iter_mut().zip(&outline.states)).zip(std.iter().zip(twin.limits()));
    for ((x, state), (std, limit)) in moved.filter(|(_, (std, _))| **std != 0.0) {
        let mut source = noise.source(&format!("start/{}", state.name));
        *x = limit.clamp(*x + std * source.normal());
    }
    twin.begin(now, x);
}

#[cfg(test)]
mod tests;
