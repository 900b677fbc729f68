//! One instance of an FMU, of either version of the standard.

use super::archive::Archive;
use fmi::fmi2::instance::{CoSimulation as Two, Common as TwoCommon, InstanceCS as InstanceTwo};
use fmi::fmi3::{CoSimulation as Three, Fmi3Model, GetSet, instance::InstanceCS as InstanceThree};
use fmi::traits::FmiInstance;

/// Why an FMU did not do something.
#[derive(Debug)]
pub(super) enum Refusal {
    /// It discarded or failed this one call.
    Error(String),
    /// It says that nothing will work any more, or leads astray.
    Fatal(String),
}

/// What a step led to.
#[derive(Debug, PartialEq, Eq)]
pub(super) enum Step {
    /// The end of the step.
    Done,
    /// The FMU asks to end the simulation.
    Ended,
}

/// An instance for co-simulation.
pub(super) enum Instance {
    Two(InstanceTwo),
    Three(InstanceThree),
}

fn refused(error: impl Into<fmi::Error>, what: &str) -> Refusal {
    let error = error.into();
    let text = format!("{what}: {error}");
    match error {
        fmi::Error::Fmi2Error(fmi::fmi2::Fmi2Error::Fatal)
        | fmi::Error::Fmi3Error(fmi::fmi3::Fmi3Error::Fatal) => Refusal::Fatal(text),
        _ => Refusal::Error(text),
    }
}

impl Instance {
    /// A new instance; the library is loaded.
    pub fn new(archive: &Archive) -> Result<Self, fmi::Error> {
        Ok(match archive {
            Archive::Two(import) => Self::Two(import.instantiate_cs("truetwin", false, false)?),
            Archive::Three(import) => {
                Self::Three(import.instantiate_cs("truetwin", false, false, false, false, &[])?)
            }
        })
    }

    /// As newly made.
    pub fn reset(&mut self) -> Result<(), Refusal> {
        match self {
            Self::Two(it) => (FmiInstance::reset(it))
                .map_err(|e| refused(e, "reset"))
                .map(drop),
            Self::Three(it) => (FmiInstance::reset(it))
                .map_err(|e| refused(e, "reset"))
                .map(drop),
        }
    }

    /// Sets reals by their references.
    pub fn set(&mut self, references: &[u32], values: &[f64], what: &str) -> Result<(), Refusal> {
        if references.is_empty() {
            return Ok(());
        }
        match self {
            Self::Two(it) => it
                .set_real(references, values)
                .map_err(|e| refused(e, what))
                .map(drop),
            Self::Three(it) => it
                .set_float64(references, values)
                .map_err(|e| refused(e, what))
                .map(drop),
        }
    }

    /// Reads reals by their references.
    pub fn get(&mut self, references: &[u32], values: &mut [f64]) -> Result<(), Refusal> {
        let what = "reading outputs";
        match self {
            Self::Two(it) => it
                .get_real(references, values)
                .map_err(|e| refused(e, what))
                .map(drop),
            Self::Three(it) => it
                .get_float64(references, values)
                .map_err(|e| refused(e, what))
                .map(drop),
        }
    }

    /// Begins the initialisation at `start` seconds.
    pub fn enter(&mut self, start: f64) -> Result<(), Refusal> {
        let what = "entering the initialisation";
        match self {
            Self::Two(it) => FmiInstance::enter_initialization_mode(it, None, start, None)
                .map_err(|e| refused(e, what))
                .map(drop),
            Self::Three(it) => FmiInstance::enter_initialization_mode(it, None, start, None)
                .map_err(|e| refused(e, what))
                .map(drop),
        }
    }

    /// Ends the initialisation.
    pub fn exit(&mut self) -> Result<(), Refusal> {
        let what = "the initialisation";
        match self {
            Self::Two(it) => FmiInstance::exit_initialization_mode(it)
                .map_err(|e| refused(e, what))
                .map(drop),
            Self::Three(it) => FmiInstance::exit_initialization_mode(it)
                .map_err(|e| refused(e, what))
                .map(drop),
        }
    }

    /// From `time` on for `step` seconds.
    pub fn step(&mut self, time: f64, step: f64) -> Result<Step, Refusal> {
        let what = "a step";
        match self {
            Self::Two(it) => match it.do_step(time, step, true) {
                Ok(_) => Ok(Step::Done),
                Err(error) => Err(refused(error, what)),
            },
            Self::Three(it) => {
                let (mut event, mut ended, mut early, mut reached) = (false, false, false, time);
                it.do_step(
                    time,
                    step,
                    true,
                    &mut event,
                    &mut ended,
                    &mut early,
                    &mut reached,
                )
                .map_err(|e| refused(e, what))?;
                Ok(if ended { Step::Ended } else { Step::Done })
            }
        }
    }
}
