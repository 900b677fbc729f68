//! The one trait that every simulator has.

use crate::record::{Drive, Signal, Signals};
#[cfg(doc)]
use crate::twin::StateSpace;
use crate::twin::{Composed, Noise, ParameterSpace, SimulationError};
use std::sync::Arc;

/// A simulator of a physical system: parameters and inputs in, outputs out.
///
/// Two methods make a black box a twin. A simulator whose equations are at hand implements [`StateSpace`](crate::twin::StateSpace)
/// instead and is a `DigitalTwin` by that.
///
/// # What an implementation owes
///
/// - Row k of the result is what is measured at time k·Δt; row 0 is the start. Input k acts from k·Δt on.
/// - The same arguments give the same bits.
/// - Draws come from `noise` by named sources and do not depend on `theta`, so that two runs with the same
///   `noise` are paired. With [`Noise::OFF`] the run is free of noise.
/// - [`crate::twin::conformance`] tells whether a twin keeps to this.
///
/// ```
/// use truetwin::effect::*;
/// use truetwin::record::*;
/// use truetwin::twin::*;
///
/// /// y = a·u + noise.
/// struct Amplifier;
/// impl DigitalTwin for Amplifier {
///     fn parameters(&self) -> ParameterSpace {
///         ParameterSpace::new([Parameter::new("a", "-", 0.5, 2.0)])
///     }
///     fn simulate(&self, theta: &[f64], drive: &Drive, noise: Noise) -> Result<Signal, SimulationError> {
///         let mut v = noise.source("sensor");
///         Ok(drive.inputs().mapv(|u| theta[0] * u + 0.1 * v.normal()))
///     }
/// }
/// let drive = Drive::new(0.1, Signal::ones((20, 1)))?;
/// let y = Amplifier.simulate(&[1.5], &drive, Noise::OFF)?;
/// assert_eq!(y[[0, 0]], 1.5);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub trait DigitalTwin: Send + Sync {
    /// Names, units, prior box and physical bounds, in the order of θ.
    fn parameters(&self) -> ParameterSpace;

    /// Outputs (N × channels) at parameters `theta` under `drive`.
    ///
    /// # Errors
    ///
    /// [`SimulationError::Diverged`] and [`SimulationError::Failed`] cost this one run; [`SimulationError::Fatal`] ends
    /// the whole work.
    fn simulate(
        &self,
        theta: &[f64],
        drive: &Drive,
        noise: Noise,
    ) -> Result<Signal, SimulationError>;

    /// Input and output channels; one input `u` and one output `y` by default.
    fn signals(&self) -> Signals {
        Signals::default()
    }

    /// Outputs without noise (N × channels). The noise of a black box cannot be switched off from outside: by default, the mean of 32 runs.
    ///
    /// # Errors
    ///
    /// As [`simulate`](Self::simulate).
    fn free_run(&self, theta: &[f64], drive: &Drive) -> Result<Signal, SimulationError> {
        mean_run(self, theta, drive)
    }

    /// The equations, of a twin that shows them; none by default.
    fn equations(self: Arc<Self>) -> Option<Composed> {
        None
    }
}

/// Returns the mean of runs, each with noise of its own.
pub(super) fn mean_run(
    twin: &(impl DigitalTwin + ?Sized),
    theta: &[f64],
    drive: &Drive,
) -> Result<Signal, SimulationError> {
    let mut mean = Signal::zeros((drive.samples(), twin.signals().outputs.len()));
    for sample in 0..FREE_RUNS {
        let run = twin.simulate(theta, drive, Noise::new(0, "free run", sample))?;
        if run.dim() != mean.dim() {
            return Err(SimulationError::fatal(format!(
                "the twin gave {:?} rows and columns, {:?} were expected",
                run.dim(),
                mean.dim()
            )));
        }
        mean += &run;
    }
    Ok(mean / FREE_RUNS as f64)
}

/// Runs that a black box's free run is the mean of.
pub(in crate::twin) const FREE_RUNS: u64 = 32;
