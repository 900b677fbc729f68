//! A thread that owns one instance: FMUs may be called from one thread only.

use super::archive::Archive;
use super::instance::Instance;
use crate::record::{Drive, Signal};
use crate::twin::SimulationError;
use std::sync::Arc;
use std::sync::mpsc::{Sender, channel};
use std::thread::{self, JoinHandle};

/// Which variables are set and read, in the twin's order.
#[derive(Debug, Clone, Default)]
pub(super) struct References {
    pub parameters: Vec<u32>,
    pub inputs: Vec<u32>,
    pub outputs: Vec<u32>,
}

/// One simulation and where its outcome goes.
struct Job {
    theta: Vec<f64>,
    drive: Drive,
    reply: Sender<Result<Signal, SimulationError>>,
}

/// An instance on its thread; both end with the value.
pub(super) struct FmuWorker {
    jobs: Option<Sender<Job>>,
    thread: Option<JoinHandle<()>>,
}

impl FmuWorker {
    /// A thread for an instance that starts at `start` seconds; the instance is made with the first simulation.
    pub fn new(archive: Arc<Archive>, references: References, start: f64) -> Self {
        let (jobs, to_do) = channel::<Job>();
        let thread = thread::spawn(move || {
            let mut bench = Bench {
                archive,
                references,
                start,
                instance: None,
            };
            for job in to_do {
                // Who no longer waits for the outcome does not miss it.
                let _ = job.reply.send(bench.simulate(&job.theta, &job.drive));
            }
        });
        Self {
            jobs: Some(jobs),
            thread: Some(thread),
        }
    }

    /// One simulation.
    pub fn simulate(&mut self, theta: &[f64], drive: &Drive) -> Result<Signal, SimulationError> {
        let (reply, outcome) = channel();
        let job = Job {
            theta: theta.to_vec(),
            drive: drive.clone(),
            reply,
        };
        let sent = self
            .jobs
            .as_ref()
            .is_some_and(|jobs| jobs.send(job).is_ok());
        // A status that the standard does not know ends the thread.
        let lost = || Err(SimulationError::fatal("the FMU left the FMI standard"));
        if sent {
            outcome.recv().unwrap_or_else(|_| lost())
        } else {
            lost()
        }
    }
}

impl Drop for FmuWorker {
    fn drop(&mut self) {
        self.jobs = None;
        if let Some(thread) = self.thread.take() {
            // A thread that ended early has said so to whoever waited.
            let _ = thread.join();
        }
    }
}

struct Bench {
    archive: Arc<Archive>,
    references: References,
    start: f64,
    instance: Option<Instance>,
}

impl Bench {
    fn simulate(&mut self, theta: &[f64], drive: &Drive) -> Result<Signal, SimulationError> {
        // An instance that cannot be reset, or failed, is made anew.
        let used = self.instance.take();
        let reset = used.and_then(|mut used| used.reset().is_ok().then_some(used));
        let mut instance = match reset {
            Some(instance) => instance,
            None => Instance::new(&self.archive).map_err(|error| {
                SimulationError::fatal(format!("no instance of the FMU: {error}"))
            })?,
        };
        let outcome = run(&mut instance, &self.references, self.start, theta, drive);
        match &outcome {
            Ok(_) => self.instance = Some(instance),
            // The standard forbids any further call, that to free it included.
            Err(SimulationError::Fatal(_)) => std::mem::forget(instance),
            Err(_) => {}
        }
        outcome
    }
}

/// Row k is read when time k·Δt is reached, before input k is set: FMI 2.0 forbids to read between setting and stepping.
fn run(
    instance: &mut Instance,
    references: &References,
    start: f64,
    theta: &[f64],
    drive: &Drive,
) -> Result<Signal, SimulationError> {
    let References {
        parameters,
        inputs,
        outputs,
    } = references;
    instance.set(parameters, theta, "these parameters")?;
    instance.enter(start)?;
    instance.set(inputs, drive.input(0), "the first input")?;
    instance.exit()?;
    let mut signal = Signal::zeros((drive.samples(), outputs.len()));
    let mut row = vec![0.0; outputs.len()];
    for k in 0..drive.samples() {
        if k > 0 {
            let before = drive.time(k - 1);
            match instance.step(start + before, drive.dt()) {
                Ok(true) => {}
                Err(error) if !error.costs_one_run() => return Err(error),
                Ok(false) | Err(_) => return Err(SimulationError::Diverged { at: before }),
            }
        }
        instance.get(outputs, &mut row)?;
        if row.iter().any(|value| !value.is_finite()) {
            return Err(SimulationError::Diverged { at: drive.time(k) });
        }
        signal.row_mut(k).assign(&ndarray::ArrayView1::from(&row));
        if k > 0 {
            instance.set(inputs, drive.input(k), "an input")?;
        }
    }
    Ok(signal)
}
