//! Runs of a twin at one θ under one drive, with draws that are the same at every θ.

use crate::parallel::try_found;
use crate::record::{Drive, Signal};
use crate::twin::{DigitalTwin, Noise, SimulationError};

/// Runs of an ensemble. A row is predicted from a few numbers, each of which costs one of as many degrees of freedom.
pub(crate) const RUNS: usize = 64;

/// Mean and deviations of runs, by row and output.
pub(crate) struct Ensemble {
    pub mean: Signal,
    /// Deviations of output j in row k from their mean, one for each run, at (k·p + j)·runs.
    deviations: Vec<f64>,
    pub runs: usize,
}

impl Ensemble {
    /// `Diverged` where half of the runs are.
    pub fn new(
        twin: &dyn DigitalTwin,
        theta: &[f64],
        drive: &Drive,
    ) -> Result<Self, SimulationError> {
        drive.check_uniform().map_err(SimulationError::of)?;
        let noise = Noise::new(0, "ensemble", 0);
        let runs: Vec<Signal> =
            try_found(0..RUNS, |i| run(twin, theta, drive, noise.sample(i as u64)))?;
        if runs.len() < RUNS / 2 {
            return Err(SimulationError::Diverged { at: drive.time(0) });
        }
        let (samples, p) = runs[0].dim();
        let mut mean = Signal::zeros((samples, p));
        runs.iter().for_each(|run| mean += run);
        mean /= runs.len() as f64;
        let m = runs.len();
        let mut deviations = vec![0.0; samples * p * m];
        for (i, run) in runs.iter().enumerate() {
            for ((at, value), mean) in run.iter().enumerate().zip(&mean) {
                deviations[at * m + i] = value - mean;
            }
        }
        Ok(Self {
            mean,
            deviations,
            runs: m,
        })
    }

    /// Number of outputs.
    pub fn outputs(&self) -> usize {
        self.mean.ncols()
    }

    /// Deviations of one number, over the runs.
    pub fn of(&self, row: usize, output: usize) -> &[f64] {
        let from = (row * self.outputs() + output) * self.runs;
        &self.deviations[from..from + self.runs]
    }
}

/// One run; `None` where it diverged.
pub(crate) fn run(
    twin: &dyn DigitalTwin,
    theta: &[f64],
    drive: &Drive,
    noise: Noise,
) -> Result<Option<Signal>, SimulationError> {
    let expected = (drive.samples(), twin.signals().outputs.len());
    match twin.simulate(theta, drive, noise) {
        Ok(outputs) if outputs.dim() != expected => Err(SimulationError::fatal(format!(
            "the twin gave {:?} rows and columns, {expected:?} were expected",
            outputs.dim()
        ))),
        Ok(outputs) => Ok(outputs.iter().all(|v| v.is_finite()).then_some(outputs)),
        Err(error) if error.costs_one_run() => Ok(None),
        Err(error) => Err(error),
    }
}
