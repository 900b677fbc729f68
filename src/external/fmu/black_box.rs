//! An FMU that makes its own steps (FMI for co-simulation).

use super::archive::Archive;
use super::description::ModelDescription;
use super::instance::Instance;
use super::variable::FmuVariable;
use super::worker::{FmuWorker, References};
use crate::external::lending::Lending;
use crate::record::{Drive, Signal};
use crate::twin::SimulationError;
use std::sync::Arc;

/// Instances on threads of their own, lent to who simulates.
pub(super) struct SteppedFmu {
    /// Dropped before the unpacked folder is removed.
    workers: Lending<FmuWorker>,
    archive: Arc<Archive>,
    references: References,
    start: f64,
}

impl SteppedFmu {
    /// At most so many `workers`, one for each thread if not given.
    pub fn new(
        description: &ModelDescription,
        archive: Archive,
        workers: Option<usize>,
    ) -> Result<Self, fmi::Error> {
        let archive = Arc::new(archive);
        // A test instance; those that simulate live on threads of their own.
        drop(Instance::new(&archive)?);
        let threads = workers.unwrap_or_else(rayon::current_num_threads);
        let references = |list: &[FmuVariable]| list.iter().map(|v| v.reference).collect();
        Ok(Self {
            workers: Lending::new(if description.alone { 1 } else { threads.max(1) }),
            archive,
            references: References {
                parameters: references(&description.parameters),
                inputs: references(&description.inputs),
                outputs: references(&description.outputs),
            },
            start: description.start,
        })
    }

    /// One run.
    pub fn simulate(&self, theta: &[f64], drive: &Drive) -> Result<Signal, SimulationError> {
        let (idle, place) = self.workers.take(false, |_| true);
        let mut worker = idle.unwrap_or_else(|| {
            FmuWorker::new(self.archive.clone(), self.references.clone(), self.start)
        });
        let outcome = worker.simulate(theta, drive);
        if !matches!(outcome, Err(SimulationError::Fatal(_))) {
            place.give_back(worker);
        }
        outcome
    }
}
