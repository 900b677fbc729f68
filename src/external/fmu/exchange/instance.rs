//! One instance of an FMU's equations, of either version of the standard.

use super::super::archive::Archive;
use super::super::instance::done;
use crate::twin::SimulationError;
use fmi::EventFlags;
use fmi::fmi2::instance::{Common as TwoCommon, InstanceME as InstanceTwo};
use fmi::fmi3::{Fmi3Model, GetSet, instance::InstanceME as InstanceThree};
use fmi::traits::{FmiInstance, FmiModelExchange};

/// Rounds of the iteration at an event: tools need a few, and one that needs more has none that is the last.
const ROUNDS: usize = 100;

type Outcome = Result<(), SimulationError>;

/// An instance for model exchange.
pub(super) enum ExchangeInstance {
    Two(Box<InstanceTwo>),
    Three(Box<InstanceThree>),
}

/// Calls both versions alike.
macro_rules! each {
    ($instance:expr, $what:expr, $it:ident => $call:expr) => {
        match $instance {
            ExchangeInstance::Two($it) => done($call, $what),
            ExchangeInstance::Three($it) => done($call, $what),
        }
    };
}

impl ExchangeInstance {
    /// A new instance; the library is loaded.
    pub fn new(archive: &Archive) -> Result<Self, fmi::Error> {
        Ok(match archive {
            Archive::Two(import) => {
                Self::Two(Box::new(import.instantiate_me("truetwin", false, false)?))
            }
            Archive::Three(import) => {
                Self::Three(Box::new(import.instantiate_me("truetwin", false, false)?))
            }
        })
    }

    pub fn reset(&mut self) -> Outcome {
        each!(self, "reset", it => FmiInstance::reset(it.as_mut()))
    }

    /// Initialises at `start` seconds with these parameters; returns the time of the first event that the FMU foresees.
    pub fn initialise(
        &mut self,
        start: f64,
        references: &[u32],
        theta: &[f64],
    ) -> Result<Option<f64>, SimulationError> {
        self.set(references, theta, "these parameters")?;
        each!(self, "entering the initialisation", it => {
            FmiInstance::enter_initialization_mode(it.as_mut(), None, start, None)
        })?;
        each!(self, "the initialisation", it => FmiInstance::exit_initialization_mode(it.as_mut()))?;
        self.settle()
    }

    /// Sets reals by their references.
    pub fn set(&mut self, references: &[u32], values: &[f64], what: &str) -> Outcome {
        match self {
            _ if references.is_empty() => Ok(()),
            Self::Two(it) => done(it.set_real(references, values), what),
            Self::Three(it) => done(it.set_float64(references, values), what),
        }
    }

    /// Reads reals by their references.
    pub fn get(&mut self, references: &[u32], values: &mut [f64]) -> Outcome {
        match self {
            Self::Two(it) => done(it.get_real(references, values), "reading outputs"),
            Self::Three(it) => done(it.get_float64(references, values), "reading outputs"),
        }
    }

    pub fn set_time(&mut self, time: f64) -> Outcome {
        each!(self, "a time", it => FmiModelExchange::set_time(it.as_mut(), time))
    }

    pub fn set_states(&mut self, x: &[f64]) -> Outcome {
        each!(self, "states", it => FmiModelExchange::set_continuous_states(it.as_mut(), x))
    }

    pub fn states(&mut self, x: &mut [f64]) -> Outcome {
        each!(self, "reading states", it => FmiModelExchange::get_continuous_states(it.as_mut(), x))
    }

    pub fn rates(&mut self, dx: &mut [f64]) -> Outcome {
        each!(self, "rates", it => FmiModelExchange::get_continuous_state_derivatives(it.as_mut(), dx))
    }

    /// Event indicators; not a number where the FMU discards these states.
    pub fn indicators(&mut self, z: &mut [f64]) -> Outcome {
        if z.is_empty() {
            return Ok(());
        }
        let mut is_told = true;
        each!(self, "event indicators", it => {
            FmiModelExchange::get_event_indicators(it.as_mut(), z).map(|told| is_told = told)
        })?;
        if !is_told {
            z.fill(f64::NAN);
        }
        Ok(())
    }

    /// Tells the FMU that a step is complete; returns whether it asks for an event here. No state of it was saved that is returned to.
    pub fn complete_step(&mut self) -> Result<bool, SimulationError> {
        let (mut event, mut end) = (false, false);
        each!(self, "a complete step", it => {
            FmiModelExchange::completed_integrator_step(it.as_mut(), true, &mut event, &mut end)
        })?;
        match end {
            true => Err(SimulationError::Failed(
                "the FMU asks to end the simulation".into(),
            )),
            false => Ok(event),
        }
    }

    /// Lets the FMU treat an event here; returns the time of the next one that it foresees.
    pub fn event(&mut self) -> Result<Option<f64>, SimulationError> {
        each!(self, "an event", it => FmiModelExchange::enter_event_mode(it.as_mut()))?;
        self.settle()
    }

    /// Iterates until nothing changes at this time, then leaves the event.
    fn settle(&mut self) -> Result<Option<f64>, SimulationError> {
        for _ in 0..ROUNDS {
            let mut flags = EventFlags::default();
            each!(self, "an event", it => {
                FmiModelExchange::update_discrete_states(it.as_mut(), &mut flags)
            })?;
            if flags.terminate_simulation {
                return Err(SimulationError::Failed(
                    "the FMU asks to end the simulation".into(),
                ));
            }
            if !flags.discrete_states_need_update {
                each!(self, "to go on behind an event", it => {
                    FmiModelExchange::enter_continuous_time_mode(it.as_mut())
                })?;
                return Ok(flags.next_event_time);
            }
        }
        let problem = format!("an event of the FMU does not end within {ROUNDS} rounds");
        Err(SimulationError::Failed(problem.into()))
    }
}
