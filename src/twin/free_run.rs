//! The trajectory that a twin would show without noise.

use crate::record::{Drive, Signal};
use crate::twin::{DigitalTwin, Noise, SimulationError};

/// Runs that a black box's free run is the mean of: its noise cannot be switched off from outside.
pub const BLACK_BOX_SEEDS: u64 = 32;

/// Outputs of a run without noise (N × channels); of a black box, the mean of 32 runs.
///
/// ```
/// use truetwin::record::Drive;
/// use truetwin::twin::{DigitalTwin, Noise, free_run};
/// use truetwin::twins::VanDerPol;
///
/// let drive = Drive::autonomous(0.05, 10)?;
/// let silent = VanDerPol.simulate(&[1.0], &drive, Noise::OFF)?;
/// assert_eq!(free_run(&VanDerPol, &[1.0], &drive)?, silent);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn free_run(
    twin: &dyn DigitalTwin,
    theta: &[f64],
    drive: &Drive,
) -> Result<Signal, SimulationError> {
    if twin.state_space().is_some() {
        return twin.simulate(theta, drive, Noise::OFF);
    }
    let mut mean = Signal::zeros((drive.samples(), twin.signals().outputs.len()));
    for sample in 0..BLACK_BOX_SEEDS {
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
    Ok(mean / BLACK_BOX_SEEDS as f64)
}
