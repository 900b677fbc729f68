//! A simulator is given what every measurement has: white noise, of a level that is fitted, on top of any noise of its own.
//!
//! Nothing measured follows a simulator without noise to the last bit, and the noise of one that has some is never quite the
//! measured one. What is left may then be white noise of any size, but not of any colour.

use super::runs::run;
use crate::math::{deviation, largest};
use crate::record::{Record, Signal};
use crate::twin::{
    ComposedBlackBox, DigitalTwin, Interval, Noise, Parameter, Role, SensorNoise, SimulationError,
    Twin, TwinPart, WhiteLevel,
};
use std::sync::Arc;

/// Least noise of such a twin, as a share of an output's deviation: differences and fits are not good to many more digits.
const LEAST: f64 = 1e-3;
/// The same where the simulator has noise of its own: nothing.
const NONE: f64 = 1e-6;
/// The twin as records show it: with measurement noise of a level that is fitted, on top of any noise of its own. Also whether it has
/// none of its own, so that two runs are alike to the bit.
pub(crate) fn measured(
    base: &ComposedBlackBox,
    records: &[Record],
) -> Result<(Twin, bool), SimulationError> {
    let Some(record) = records.first() else {
        return Ok((Twin::BlackBox(base.clone()), false));
    };
    let theta = base.parameters().centre();
    let one = |sample: u64| {
        let noise = Noise::new(0, "silent", sample);
        run(base, &theta, record.drive(), noise)
    };
    let runs = [one(0)?, one(1)?];
    let is_silent = runs[0].is_some() && runs[0] == runs[1];
    let least = if is_silent { LEAST } else { NONE };
    let levels = levels(base, records, runs[0].as_ref(), least);
    let (parameters, outputs): (Vec<Parameter>, Vec<usize>) = levels.into_iter().unzip();
    let twin = Twin::BlackBox(base.clone());
    let entries = twin.entries();
    let levels = (parameters.iter().zip(outputs).enumerate())
        .map(|(i, (parameter, output))| WhiteLevel {
            output,
            entry: entries + i,
            source: format!("measured/{}", parameter.name),
        })
        .collect();
    let white = TwinPart::White(SensorNoise {
        levels,
        is_silent,
        entries,
        runs: Arc::default(),
    });
    Ok((twin.with(parameters, vec![white]), is_silent))
}

/// Deviation of a column, or what is left of it where nothing moves; missing values are left out. None where all is zero.
fn size(signal: &Signal, column: usize) -> Option<f64> {
    let values = signal.column(column).into_iter().copied();
    let values: Vec<f64> = values.filter(|v| v.is_finite()).collect();
    let size = deviation(&values).max(1e-3 * largest(&values));
    (size > 0.0).then_some(size)
}

/// Levels that are fitted, each with the index of its output. A record of zeros tells no size; a `run` of the twin does.
fn levels(
    twin: &ComposedBlackBox,
    records: &[Record],
    run: Option<&Signal>,
    least: f64,
) -> Vec<(Parameter, usize)> {
    let space = twin.parameters();
    (twin.signals().outputs.iter().enumerate())
        .filter(|(_, output)| space.position(&Role::Noise.name(&output.name)).is_err())
        .map(|(j, output)| {
            // Of the first record that has it.
            let having = records.iter().find(|record| record.has_output(j));
            let size = (having.and_then(|record| size(record.outputs(), j)))
                .or_else(|| size(run?, j))
                .unwrap_or(1.0);
            let parameter = Parameter {
                name: Role::Noise.name(&output.name),
                unit: output.unit.clone(),
                prior: Interval::unchecked(LEAST * size, size),
                bounds: Interval::unchecked(least * size, 10.0 * size),
                role: Role::Noise,
            };
            (parameter, j)
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effect::{Catalogue, augment};
    use crate::record::Drive;
    use crate::twin::fixture::AtOnce;

    /// Zeros tell no size of noise, and the twin's own outputs do.
    #[test]
    fn a_record_of_zeros_has_the_size_of_a_run() {
        let u = Signal::from_shape_fn((60, 1), |(k, _)| [0.0, 1.0][k / 20 % 2]);
        let drive = Drive::new(0.1, u).unwrap();
        let records = [Record::new(drive, Signal::zeros((60, 1))).unwrap()];
        let Twin::BlackBox(base) = Twin::new(AtOnce::<1>(|a, u| a[0] * u)) else {
            unreachable!()
        };
        let (measured, _) = measured(&base, &records).unwrap();
        let level = measured.parameters()[1].clone();
        assert!((0.1..10.0).contains(&level.prior.high()), "{level:?}");
    }

    /// A sensor's lag moves the mean and leaves the noise white; what rounds readings rounds the noise, which is then no longer known.
    #[test]
    fn noise_enters_behind_the_laws_of_a_sensor() {
        let u = Signal::from_shape_fn((60, 1), |(k, _)| [0.0, 1.0][k / 20 % 2]);
        let drive = Drive::new(0.1, u).unwrap();
        let outputs = drive.inputs().mapv(|u| 1.2 * u + 0.1 * (40.0 * u).sin());
        let records = [Record::new(drive.clone(), outputs).unwrap()];
        let Twin::BlackBox(base) = Twin::new(AtOnce::<1>(|a, u| a[0] * u)) else {
            unreachable!()
        };
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
        let known = |twin: &Twin, theta: &[f64]| match twin {
            Twin::BlackBox(twin) => twin.known_noise(theta, &drive).unwrap(),
            Twin::Equations(_) => None,
        };
        let mean = known(&lag, &theta).unwrap().mean;
        assert_eq!(mean, lagged);
        let rounded = with("sensor-quantization");
        assert!(known(&rounded, &theta).is_none());
        let rounded = run(&rounded, &theta, noise);
        assert!(
            rounded
                .iter()
                .all(|y| (y / 0.5 - (y / 0.5).round()).abs() < 1e-9)
        );
    }
}
