//! Twins that live outside of this process or of Rust.
//!
//! | the simulator is … | look at |
//! |---|---|
//! | a program in any language that reads and writes lines | [`program`] |
//! | an FMU (FMI 2.0 or 3.0, model exchange or co-simulation) | `fmu`, of the cargo feature `fmi` |

#[cfg(feature = "fmi")]
pub mod fmu;
mod lending;
mod name;
pub mod program;

use crate::record::{Drive, Signals};
use crate::twin::{ParameterSpace, SimulationError};

/// Checks that a simulator can be asked: as many parameters and inputs as it has, and finite numbers, since JSON has no others.
fn check_call(
    space: &ParameterSpace,
    signals: &Signals,
    theta: &[f64],
    drive: &Drive,
) -> Result<(), SimulationError> {
    let given = (theta.len(), drive.inputs().ncols());
    let expected = (space.len(), signals.inputs.len());
    if given != expected {
        return Err(SimulationError::fatal(format!(
            "{given:?} parameters and inputs were given, the simulator has {expected:?}"
        )));
    }
    match theta.iter().all(|value| value.is_finite()) {
        true => Ok(()),
        false => Err(SimulationError::Diverged { at: 0.0 }),
    }
}
