//! A simulator is given what every measurement has: white noise, of a level that is fitted, on top of any noise of its own.
//!
//! Nothing measured follows a simulator without noise to the last bit, and the noise of one that has some is never quite the
//! measured one. What is left may then be white noise of any size, but not of any colour.

use super::runs::run;
use crate::math::{deviation, largest};
use crate::record::{Drive, Record, Signal, Signals};
use crate::twin::{
    DigitalTwin, Interval, KnownNoise, Noise, NoisePart, Parameter, ParameterSpace, Role,
    SimulationError, Twin,
};
use std::collections::HashMap;
use std::sync::{Arc, Mutex};

/// Least noise of such a twin, as a share of an output's deviation: differences and fits are not good to many more digits.
const LEAST: f64 = 1e-3;
/// The same where the simulator has noise of its own: nothing.
const NONE: f64 = 1e-6;
/// Values of runs that are kept.
const KEPT: usize = 2_000_000;

/// The twin as records show it: with measurement noise of a level that is fitted, on top of any noise of its own. Also whether it has
/// none of its own, so that two runs are alike to the bit.
pub(crate) fn measured(twin: &Twin, records: &[Record]) -> Result<(Twin, bool), SimulationError> {
    let (Twin::BlackBox(base), Some(record)) = (twin, records.first()) else {
        return Ok((twin.clone(), false));
    };
    let theta = twin.parameters().centre();
    let one = |sample: u64| {
        let noise = Noise::new(0, "silent", sample);
        run(twin, &theta, record.drive(), noise)
    };
    let is_silent = match (one(0)?, one(1)?) {
        (Some(first), Some(second)) => first == second,
        _ => false,
    };
    let measured = MeasuredBox {
        base: base.clone(),
        levels: levels(twin, record, if is_silent { LEAST } else { NONE }),
        is_silent,
        runs: Mutex::default(),
    };
    Ok((Twin::BlackBox(Arc::new(measured)), is_silent))
}

/// Deviation, or what is left of it where nothing moves; missing values are left out.
fn size(values: &[f64]) -> f64 {
    let values: Vec<f64> = values.iter().copied().filter(|v| !v.is_nan()).collect();
    let values = values.as_slice();
    let least = (1e-3 * largest(values)).max(1e-100);
    deviation(values).max(least)
}

fn levels(twin: &dyn DigitalTwin, record: &Record, least: f64) -> Vec<Parameter> {
    let space = twin.parameters();
    (twin.signals().outputs.iter().enumerate())
        .filter(|(_, output)| space.position(&Role::Noise.name(&output.name)).is_err())
        .map(|(j, output)| {
            let size = size(&record.outputs().column(j).to_vec());
            Parameter {
                name: Role::Noise.name(&output.name),
                unit: output.unit.clone(),
                prior: Interval::unchecked(LEAST * size, size),
                bounds: Interval::unchecked(least * size, 10.0 * size),
                role: Role::Noise,
            }
        })
        .collect()
}

/// Runs by θ and drive, and how many values they hold.
type Kept = (HashMap<Vec<u64>, Arc<Signal>>, usize);

/// A simulator and the noise of its sensors. One run of a simulator without noise serves a whole ensemble.
struct MeasuredBox {
    base: Arc<dyn DigitalTwin>,
    levels: Vec<Parameter>,
    is_silent: bool,
    runs: Mutex<Kept>,
}

impl MeasuredBox {
    /// The simulator's own parameters, and the noise levels.
    fn split<'t>(&self, theta: &'t [f64]) -> (&'t [f64], &'t [f64]) {
        theta.split_at(theta.len() - self.levels.len())
    }

    fn parts(&self, theta: &[f64]) -> Vec<NoisePart> {
        let channels = self.signals().outputs;
        (self.levels.iter().zip(self.split(theta).1))
            .map(|(parameter, level)| {
                let channel = channels.iter().position(|o| o.name == parameter.target());
                let source = format!("measured/{}", parameter.name);
                NoisePart::white(channel.unwrap_or(0), *level, source)
            })
            .collect()
    }

    fn run(
        &self,
        theta: &[f64],
        drive: &Drive,
        noise: Noise,
    ) -> Result<Arc<Signal>, SimulationError> {
        if !self.is_silent {
            return Ok(Arc::new(self.base.simulate(theta, drive, noise)?));
        }
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

impl DigitalTwin for MeasuredBox {
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
        let (own, _) = self.split(theta);
        let mean = self.run(own, drive, noise)?.as_ref().clone();
        let parts = self.parts(theta);
        Ok(KnownNoise { mean, parts }.draw(noise))
    }
    fn known_noise(
        &self,
        theta: &[f64],
        drive: &Drive,
    ) -> Result<Option<KnownNoise>, SimulationError> {
        if !self.is_silent {
            return Ok(None);
        }
        let (own, _) = self.split(theta);
        let mean = self.run(own, drive, Noise::OFF)?.as_ref().clone();
        let parts = self.parts(theta);
        Ok(Some(KnownNoise { mean, parts }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effect::{Catalogue, augment};
    use crate::twin::fixture::AtOnce;

    /// A sensor's lag moves the mean and leaves the noise white; what rounds readings rounds the noise, which is then no longer known.
    #[test]
    fn noise_enters_behind_the_laws_of_a_sensor() {
        let u = Signal::from_shape_fn((60, 1), |(k, _)| [0.0, 1.0][k / 20 % 2]);
        let drive = Drive::new(0.1, u).unwrap();
        let outputs = drive.inputs().mapv(|u| 1.2 * u + 0.1 * (40.0 * u).sin());
        let records = [Record::new(drive.clone(), outputs).unwrap()];
        let base = Twin::BlackBox(Arc::new(AtOnce::<1>(|a, u| a[0] * u)));
        let (measured, is_silent) = measured(&base, &records).unwrap();
        assert!(is_silent);
        let with = |id: &str| {
            let effect = Catalogue::default().effect(id, "sensor").unwrap();
            augment(measured.clone(), vec![effect]).unwrap()
        };
        let noise = Noise::new(1, "test", 0);
        let run = |twin: &Twin, theta: &[f64], noise| twin.simulate(theta, &drive, noise).unwrap();
        let white = run(&measured, &[1.2, 0.3], noise) - run(&measured, &[1.2, 0.3], Noise::OFF);
        let (lag, theta) = (with("sensor-lag"), [1.2, 0.3, 0.5]);
        let lagged = run(&lag, &theta, Noise::OFF);
        assert!(
            (&lagged - &run(&measured, &[1.2, 0.3], Noise::OFF))
                .mapv(f64::abs)
                .sum()
                > 1.0
        );
        let left = run(&lag, &theta, noise) - &lagged - white;
        assert!(left.iter().all(|v| v.abs() < 1e-12));
        let known = lag.known_noise(&theta, &drive).unwrap().unwrap();
        assert_eq!(known.mean, lagged);
        let rounded = with("sensor-quantization");
        assert!(rounded.known_noise(&theta, &drive).unwrap().is_none());
        let rounded = run(&rounded, &theta, noise);
        assert!(
            rounded
                .iter()
                .all(|y| (y / 0.5 - (y / 0.5).round()).abs() < 1e-9)
        );
    }
}
