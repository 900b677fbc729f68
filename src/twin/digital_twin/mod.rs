//! The one trait that every simulator has.

mod known_noise;

pub(crate) use known_noise::{KnownNoise, NoisePart};

use crate::record::{Drive, Signal, Signals};
use crate::twin::{Noise, ParameterSpace, SimulationError, StateSpace};
use std::sync::Arc;

/// A simulator of a physical system: parameters and inputs in, outputs out.
///
/// Two methods make a black box a twin. A simulator whose equations are at hand implements [`StateSpace`]
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
        let mut mean = Signal::zeros((drive.samples(), self.signals().outputs.len()));
        for sample in 0..FREE_RUNS {
            let run = self.simulate(theta, drive, Noise::new(0, "free run", sample))?;
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

    /// Outputs where their noise is known, so that a likelihood needs no ensemble of runs: of a simulator without noise, whose records
    /// have that of their sensors. For twins of this crate.
    #[doc(hidden)]
    fn known_noise(
        &self,
        _theta: &[f64],
        _drive: &Drive,
    ) -> Result<Option<KnownNoise>, SimulationError> {
        Ok(None)
    }

    /// The equations, of a twin that shows them; none by default.
    fn equations(self: Arc<Self>) -> Option<Arc<dyn StateSpace>> {
        None
    }
}

/// Runs that a black box's free run is the mean of.
pub(super) const FREE_RUNS: u64 = 32;
