//! A simulator without noise of its own is given what every measurement has: white noise, of a level that is fitted.
//!
//! Nothing measured follows such a simulator to the last bit, so that without it any record would be a gap. What is left may then
//! be white noise of any size, but not of any colour.

use super::runs::run;
use crate::math::{deviation, largest};
use crate::record::{Drive, Record, Signal, Signals};
use crate::twin::{
    DigitalTwin, Interval, Noise, Parameter, ParameterSpace, Role, SimulationError, Twin,
};
use std::collections::HashMap;
use std::sync::{Arc, Mutex};

/// Least noise of such a twin, as a share of an output's deviation: differences and fits are not good to many more digits.
const LEAST: f64 = 1e-3;
/// Values of runs that are kept.
const KEPT: usize = 2_000_000;

/// The twin as records show it: itself, or, where two runs are alike to the bit, with measurement noise. Also whether that
/// was so.
pub(crate) fn measured(twin: &Twin, records: &[Record]) -> Result<(Twin, bool), SimulationError> {
    let (Twin::BlackBox(base), Some(record)) = (twin, records.first()) else {
        return Ok((twin.clone(), false));
    };
    let theta = twin.parameters().centre();
    let one = |sample: u64| {
        let noise = Noise::new(0, "silent", sample);
        run(twin, &theta, record.drive(), noise)
    };
    let (Some(first), Some(second)) = (one(0)?, one(1)?) else {
        return Ok((twin.clone(), false));
    };
    if first != second {
        return Ok((twin.clone(), false));
    }
    let silent = Silent {
        base: base.clone(),
        levels: levels(twin, record),
        runs: Mutex::default(),
    };
    Ok((Twin::BlackBox(Arc::new(silent)), true))
}

/// Deviation, or what is left of it where nothing moves; missing values are left out.
fn size(values: &[f64]) -> f64 {
    let values: Vec<f64> = values.iter().copied().filter(|v| !v.is_nan()).collect();
    let values = values.as_slice();
    let least = (1e-3 * largest(values)).max(1e-100);
    deviation(values).max(least)
}

fn levels(twin: &dyn DigitalTwin, record: &Record) -> Vec<Parameter> {
    (twin.signals().outputs.iter().enumerate())
        .map(|(j, output)| {
            let size = size(&record.outputs().column(j).to_vec());
            Parameter {
                name: Role::Noise.name(&output.name),
                unit: output.unit.clone(),
                prior: Interval::unchecked(LEAST * size, size),
                bounds: Interval::unchecked(LEAST * size, 10.0 * size),
                role: Role::Noise,
            }
        })
        .collect()
}

/// Runs by θ and drive, and how many values they hold.
type Kept = (HashMap<Vec<u64>, Arc<Signal>>, usize);

/// A simulator and the noise of its sensors. One run serves a whole ensemble.
struct Silent {
    base: Arc<dyn DigitalTwin>,
    levels: Vec<Parameter>,
    runs: Mutex<Kept>,
}

impl Silent {
    fn run(&self, theta: &[f64], drive: &Drive) -> Result<Arc<Signal>, SimulationError> {
        let dt = drive.dt();
        let numbers = theta.iter().chain([&dt]).chain(drive.inputs());
        let key: Vec<u64> = numbers
            .map(|v| v.to_bits())
            .chain([drive.samples() as u64])
            .collect();
        let kept = || self.runs.lock().unwrap_or_else(|e| e.into_inner());
        if let Some(run) = kept().0.get(&key) {
            return Ok(run.clone());
        }
        let run = Arc::new(self.base.simulate(theta, drive, Noise::OFF)?);
        let mut kept = kept();
        if kept.1 > KEPT {
            *kept = Kept::default();
        }
        kept.1 += run.len() + key.len();
        kept.0.insert(key, run.clone());
        Ok(run)
    }
}

impl DigitalTwin for Silent {
    fn parameters(&self) -> ParameterSpace {
        ParameterSpace::new(self.base.parameters().iter().chain(&self.levels).cloned())
    }
    fn signals(&self) -> Signals {
        self.base.signals()
    }
    fn simulate(
        &self,
        theta: &[f64],
        drive: &Drive,
        noise: Noise,
    ) -> Result<Signal, SimulationError> {
        let (own, levels) = theta.split_at(theta.len() - self.levels.len());
        let mut outputs = self.run(own, drive)?.as_ref().clone();
        for (j, (mut column, level)) in outputs.columns_mut().into_iter().zip(levels).enumerate() {
            let mut source = noise.source(&format!("measured/{j}"));
            column
                .iter_mut()
                .for_each(|v| *v += level * source.normal());
        }
        Ok(outputs)
    }
}
