//! The records of a Monte-Carlo study.

use super::scenario::ScenarioDraws;
use crate::evaluate::EvaluateError;
use crate::record::Record;
use crate::study::Study;
use crate::twin::Noise;

/// Draws of θ that are tried before a diverging twin is given up.
const ATTEMPTS: u64 = 20;

/// A simulated record and what it came from.
pub(super) struct Simulated {
    pub(super) truth: Vec<f64>,
    pub(super) record: Record,
    pub(super) noise: Noise,
}

/// Record number `run` under `seed`. Where θ is drawn, a draw that diverges is drawn again.
pub(super) fn simulated(
    study: &Study,
    draws: &ScenarioDraws<'_>,
    seed: u64,
    run: usize,
) -> Result<Simulated, EvaluateError> {
    let first = Noise::new(seed, "record", run as u64);
    let mut attempt = 0;
    loop {
        let noise = match attempt {
            0 => first,
            _ => first.child("again").sample(attempt),
        };
        attempt += 1;
        let (truth, drive) = draws.draw(run, noise)?;
        match study.twin().simulate(&truth, &drive, noise) {
            Ok(outputs) => {
                return Ok(Simulated {
                    truth,
                    record: Record::complete(drive, outputs)?,
                    noise,
                });
            }
            Err(error) if error.costs_one_run() && draws.can_redraw() && attempt < ATTEMPTS => {}
            Err(error) => return Err(error.into()),
        }
    }
}
