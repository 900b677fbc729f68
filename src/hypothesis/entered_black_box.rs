//! Unknown functions of inputs and time at an output or in a parameter of a black box.

use super::basis::{TERMS, sum_of_one};
use super::entry::{Entered, Entry, LARGEST, with_coefficients};
use crate::record::{Drive, Signal, Signals};
use crate::twin::{DigitalTwin, KnownNoise, Noise, ParameterSpace, SimulationError, Twin};
use std::sync::Arc;

/// The black box with a function; θ is longer by its coefficients.
///
/// ```text
/// y_j + f(z)   or   y(t) = Y(θ·exp(f(z(t))), t)        Y(θ, ·): a run with θ held;  z: an input or time
/// ```
///
/// A run cannot change its parameters on the way: outputs follow the runs at fixed values. That is right for changes that are slow beside
/// the simulator's own memory.
pub(super) fn with_function(base: Arc<dyn DigitalTwin>, function: Entered) -> Twin {
    Twin::BlackBox(Arc::new(WithFunction { base, function }))
}

struct WithFunction {
    base: Arc<dyn DigitalTwin>,
    function: Entered,
}

impl WithFunction {
    fn values(&self, coefficients: &[f64], drive: &Drive) -> Vec<f64> {
        let Entered { of, ends, .. } = self.function;
        let at = |k: usize| of.value(drive.time(k), &[], drive.input(k), 0.0);
        (0..drive.samples())
            .map(|k| sum_of_one(coefficients, at(k), ends))
            .collect()
    }

    /// Outputs of runs with the function.
    fn with(
        &self,
        theta: &[f64],
        drive: &Drive,
        run: impl Fn(&[f64]) -> Result<Signal, SimulationError>,
    ) -> Result<Signal, SimulationError> {
        let (own, coefficients) = theta.split_at(theta.len() - TERMS);
        let values = self.values(coefficients, drive);
        if let Entry::Parameter(i) = self.function.entry {
            return Self::bent((own, i), &values, run);
        }
        let mut outputs = run(own)?;
        if let Entry::Sensor(j) = self.function.entry {
            for (y, value) in outputs.column_mut(j).iter_mut().zip(values) {
                *y += value;
            }
        }
        Ok(outputs)
    }

    /// Outputs where the logarithm of parameter i is larger by these values: parabolas through three runs.
    fn bent(
        (theta, i): (&[f64], usize),
        by: &[f64],
        run: impl Fn(&[f64]) -> Result<Signal, SimulationError>,
    ) -> Result<Signal, SimulationError> {
        let by = || by.iter().map(|v| v.clamp(-LARGEST, LARGEST));
        let (low, high) = (
            by().fold(f64::INFINITY, f64::min),
            by().fold(f64::NEG_INFINITY, f64::max),
        );
        let at = |change: f64| {
            let mut theta = theta.to_vec();
            theta[i] *= change.exp();
            run(&theta)
        };
        let (middle, half) = (0.5 * (low + high), 0.5 * (high - low));
        let mut outputs = at(middle)?;
        // What is far below rounding moves nothing.
        if half <= f64::EPSILON {
            return Ok(outputs);
        }
        let (first, last) = (at(low)?, at(high)?);
        for ((k, v), mut row) in by().enumerate().zip(outputs.rows_mut()) {
            let x = (v - middle) / half;
            let ends = first.row(k).into_iter().zip(last.row(k));
            for (y, (a, b)) in row.iter_mut().zip(ends) {
                *y = 0.5 * x * (x - 1.0) * a + (1.0 - x * x) * *y + 0.5 * x * (x + 1.0) * b;
            }
        }
        Ok(outputs)
    }
}

impl DigitalTwin for WithFunction {
    fn parameters(&self) -> ParameterSpace {
        with_coefficients(&self.base.parameters())
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
        if let Some(known) = self.known_noise(theta, drive)? {
            return Ok(known.draw(noise));
        }
        self.with(theta, drive, |own| self.base.simulate(own, drive, noise))
    }
    fn known_noise(
        &self,
        theta: &[f64],
        drive: &Drive,
    ) -> Result<Option<KnownNoise>, SimulationError> {
        let own = &theta[..theta.len() - TERMS];
        let Some(known) = self.base.known_noise(own, drive)? else {
            return Ok(None);
        };
        let mean = |own: &[f64]| match self.base.known_noise(own, drive)? {
            Some(known) => Ok(known.mean),
            None => self.base.simulate(own, drive, Noise::OFF),
        };
        let mean = self.with(theta, drive, mean)?;
        Ok(Some(KnownNoise { mean, ..known }))
    }
}

#[cfg(test)]
mod tests {
    use super::super::basis::Of;
    use super::*;
    use crate::twin::fixture::AtOnce;
    use std::f64::consts::{PI, SQRT_2};

    fn found(entry: Entry, of: Of, first: f64) -> (Drive, Signal) {
        let inputs = Signal::from_shape_fn((50, 1), |(k, _)| 1.0 + 0.02 * k as f64);
        let drive = Drive::new(0.5, inputs).unwrap();
        let ends = (0.0, 30.0);
        let twin = with_function(
            Arc::new(AtOnce::<1>(|a, u| a[0] * a[0] * u)),
            Entered { entry, of, ends },
        );
        let theta = [&[0.8, first][..], &[0.0; TERMS - 1]].concat();
        let Twin::BlackBox(twin) = twin else {
            unreachable!()
        };
        let outputs = twin.simulate(&theta, &drive, Noise::new(1, "test", 0));
        (drive, outputs.unwrap())
    }

    /// Without memory, outputs follow the parameter exactly, but for what parabolas miss.
    #[test]
    fn outputs_follow_a_parameter() {
        let (drive, outputs) = found(Entry::Parameter(0), Of::Time, 0.1);
        for (k, y) in outputs.iter().enumerate() {
            let f = 0.1 * SQRT_2 * (PI * drive.time(k) / 30.0).sin();
            let expected = (0.8 * f.exp()).powi(2) * drive.input(k)[0];
            assert!((y / expected - 1.0).abs() < 5e-4, "{k}: {y} {expected}");
        }
    }

    #[test]
    fn an_output_has_its_function_of_an_input() {
        let (drive, outputs) = found(Entry::Sensor(0), Of::Input(0), 0.3);
        for (k, y) in outputs.iter().enumerate() {
            let u = drive.input(k)[0];
            let expected = 0.64 * u + 0.3 * SQRT_2 * (PI * u / 30.0).sin();
            assert!((y - expected).abs() < 1e-12, "{k}");
        }
    }
}
