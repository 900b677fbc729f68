//! One instance of an FMU, of either version of the standard.

use super::archive::Archive;
use crate::twin::SimulationError;
use fmi::fmi2::instance::{CoSimulation as Two, Common as TwoCommon, InstanceCS as InstanceTwo};
use fmi::fmi3::{CoSimulation as Three, Fmi3Model, GetSet, instance::InstanceCS as InstanceThree};
use fmi::traits::FmiInstance;

/// An instance for co-simulation.
pub(super) enum Instance {
    Two(Box<InstanceTwo>),
    Three(Box<InstanceThree>),
}

/// An outcome of the library as a simulation's; `what` is for the message.
pub(super) fn done<T>(
    outcome: Result<T, impl Into<fmi::Error>>,
    what: &str,
) -> Result<(), SimulationError> {
    let error = match outcome {
        Ok(_) => return Ok(()),
        Err(error) => error.into(),
    };
    Err(match error {
        fmi::Error::Fmi2Error(fmi::fmi2::Fmi2Error::Fatal)
        | fmi::Error::Fmi3Error(fmi::fmi3::Fmi3Error::Fatal) => {
            SimulationError::fatal(format!("the FMU is corrupt: {what}: {error}"))
        }
        _ => {
            let remedy = "try it at these parameters in the tool that made it";
            SimulationError::Failed(format!("the FMU refuses {what} ({error}); {remedy}").into())
        }
    })
}

impl Instance {
    /// A new instance; the library is loaded.
    pub fn new(archive: &Archive) -> Result<Self, fmi::Error> {
        let (name, visible, logging) = ("truetwin", false, false);
        Ok(match archive {
            Archive::Two(import) => {
                Self::Two(Box::new(import.instantiate_cs(name, visible, logging)?))
            }
            Archive::Three(import) => {
                let made = import.instantiate_cs(name, visible, logging, false, false, &[])?;
                Self::Three(Box::new(made))
            }
        })
    }

    /// As newly made.
    pub fn reset(&mut self) -> Result<(), SimulationError> {
        match self {
            Self::Two(it) => done(FmiInstance::reset(it.as_mut()), "reset"),
            Self::Three(it) => done(FmiInstance::reset(it.as_mut()), "reset"),
        }
    }

    /// Sets reals by their references.
    pub fn set(
        &mut self,
        references: &[u32],
        values: &[f64],
        what: &str,
    ) -> Result<(), SimulationError> {
        match self {
            _ if references.is_empty() => Ok(()),
            Self::Two(it) => done(it.set_real(references, values), what),
            Self::Three(it) => done(it.set_float64(references, values), what),
        }
    }

    /// Reads reals by their references.
    pub fn get(&mut self, references: &[u32], values: &mut [f64]) -> Result<(), SimulationError> {
        match self {
            Self::Two(it) => done(it.get_real(references, values), "reading outputs"),
            Self::Three(it) => done(it.get_float64(references, values), "reading outputs"),
        }
    }

    /// Begins the initialisation at `start` seconds.
    pub fn enter(&mut self, start: f64) -> Result<(), SimulationError> {
        let what = "entering the initialisation";
        match self {
            Self::Two(it) => {
                let it = it.as_mut();
                done(
                    FmiInstance::enter_initialization_mode(it, None, start, None),
                    what,
                )
            }
            Self::Three(it) => {
                let it = it.as_mut();
                done(
                    FmiInstance::enter_initialization_mode(it, None, start, None),
                    what,
                )
            }
        }
    }

    /// Ends the initialisation.
    pub fn exit(&mut self) -> Result<(), SimulationError> {
        let what = "the initialisation";
        match self {
            Self::Two(it) => done(FmiInstance::exit_initialization_mode(it.as_mut()), what),
            Self::Three(it) => done(FmiInstance::exit_initialization_mode(it.as_mut()), what),
        }
    }

    /// From `time` on for `step` seconds; `false` if the FMU asks to end the simulation.
    pub fn step(&mut self, time: f64, step: f64) -> Result<bool, SimulationError> {
        let what = "a step";
        let (mut event, mut ended, mut early, mut reached) = (false, false, false, time);
        let told = (&mut event, &mut ended, &mut early, &mut reached);
        match self {
            Self::Two(it) => done(it.do_step(time, step, true), what)?,
            Self::Three(it) => {
                let outcome = it.do_step(time, step, true, told.0, told.1, told.2, told.3);
                done(outcome, what)?;
            }
        }
        Ok(!ended)
    }
}
