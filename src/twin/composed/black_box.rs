//! Parts of a black box, over whole signals.

use super::digital_twin::mean_run;
use super::part::{Disturbance, Entry, LARGEST, Law, LawPart, ParameterChange, TwinPart};
use super::parts::{Added, Parts, Theta};
use super::simulation::check_length;
use crate::progress::is_hastened;
use crate::record::{Drive, Signal, Signals};
use crate::twin::{
    DigitalTwin, Integrator, KnownNoise, Noise, NoisePart, Now, Outline, ParameterSpace,
    SimulationError, Stepping,
};
use std::sync::Arc;

/// A simulator with all parts that are added to it, cheap to clone. Parts act on inputs and outputs, and on what is known of their noise.
///
/// A run cannot change its parameters on the way: where a parameter follows a function of inputs or time, outputs follow the runs at
/// fixed values. That is right for changes that are slow beside the simulator's own memory.
#[derive(Clone)]
pub struct ComposedBlackBox {
    own: Arc<dyn DigitalTwin>,
    parts: Arc<Parts>,
}

debug_by_name!(ComposedBlackBox);

/// Outputs of a run, its noise apart where this is known.
struct Outputs {
    /// Signal behind which noise of the sensors enters.
    signal: Signal,
    known: Option<Vec<NoisePart>>,
}

impl Outputs {
    /// Adds draws of the known noise to the signal.
    fn draw(&mut self, noise: Noise) {
        for part in self.known.take().into_iter().flatten() {
            part.add(noise, &mut self.signal);
        }
    }

    fn add(&mut self, part: NoisePart, noise: Noise) {
        match &mut self.known {
            Some(parts) => parts.push(part),
            None => part.add(noise, &mut self.signal),
        }
    }
}

impl From<Arc<dyn DigitalTwin>> for ComposedBlackBox {
    fn from(own: Arc<dyn DigitalTwin>) -> Self {
        let signals = own.signals();
        let outline = Outline {
            parameters: own.parameters(),
            states: vec![],
            inputs: signals.inputs,
            outputs: signals.outputs,
            ..Outline::new()
        };
        let parts = Parts::none(
            outline,
            vec![],
            (Integrator::default(), Stepping::default()),
        );
        let parts = Arc::new(parts);
        Self { own, parts }
    }
}

impl ComposedBlackBox {
    /// Returns the same simulator with these parts.
    pub(in crate::twin) fn of(&self, parts: Arc<Parts>) -> Self {
        let own = self.own.clone();
        Self { own, parts }
    }

    pub(in crate::twin) fn parts(&self) -> &Parts {
        &self.parts
    }

    /// Returns all of θ from the free entries, checked.
    fn checked(&self, theta: &[f64], dt: f64) -> Result<Theta, SimulationError> {
        check_length(self.parts.outline.parameters.len(), theta)?;
        let theta = self.parts.complete(theta);
        self.parts.check(&theta, dt)?;
        Ok(theta)
    }

    /// Returns outputs where their noise is known, so that a likelihood needs no ensemble of runs: of a simulator without noise, whose
    /// records have that of their sensors.
    pub(crate) fn known_noise(
        &self,
        theta: &[f64],
        drive: &Drive,
    ) -> Result<Option<KnownNoise>, SimulationError> {
        let mut is_known = false;
        for added in &self.parts.list {
            match &added.part {
                TwinPart::White(noise) => is_known = noise.is_silent,
                TwinPart::Law(part) if part.is_behind_noise() => return Ok(None),
                TwinPart::Disturbance(disturbance)
                    if matches!(disturbance.entry, Entry::Actuator(_)) =>
                {
                    return Ok(None);
                }
                _ => {}
            }
        }
        if !is_known {
            return Ok(None);
        }
        let theta = self.checked(theta, drive.dt())?;
        let outputs = self.outputs(&self.parts.list, &theta, drive, Noise::OFF)?;
        let mean = outputs.signal;
        Ok(outputs.known.map(|parts| KnownNoise { mean, parts }))
    }

    /// Outputs behind these parts, θ all of it.
    fn outputs(
        &self,
        parts: &[Added],
        theta: &[f64],
        drive: &Drive,
        noise: Noise,
    ) -> Result<Outputs, SimulationError> {
        let Some((Added { part, .. }, inside)) = parts.split_last() else {
            let own = &theta[..self.parts.parameters];
            let signal = self.own.simulate(own, drive, noise)?;
            let known = None;
            return Ok(Outputs { signal, known });
        };
        let inner = |theta: &[f64], drive: &Drive| self.outputs(inside, theta, drive, noise);
        match part {
            TwinPart::Law(part) => match &part.law {
                Law::Actuator(law) => {
                    return inner(theta, &part.act(law.as_ref(), theta, (drive, false))?);
                }
                Law::Parameter(law) => {
                    return self.followed(inside, (part, law.as_ref()), theta, (drive, noise));
                }
                _ => {}
            },
            TwinPart::Disturbance(part) => {
                if let Entry::Actuator(input) = part.entry {
                    let mut inputs = drive.inputs().clone();
                    disturbance(part, input, theta).add(noise, &mut inputs);
                    let drive = drive
                        .with_inputs(inputs)
                        .map_err(|_| SimulationError::Diverged { at: 0.0 })?;
                    return inner(theta, &drive);
                }
            }
            TwinPart::White(white) if white.is_silent => {
                let run = || {
                    let mut silent = self.outputs(inside, theta, drive, Noise::OFF)?;
                    silent.draw(Noise::OFF);
                    Ok(silent.signal)
                };
                return Ok(Outputs {
                    signal: white.run(theta, drive, run)?,
                    known: Some(white.parts(theta).collect()),
                });
            }
            _ => {}
        }
        let mut outputs = inner(theta, drive)?;
        match part {
            TwinPart::Law(part) => {
                if part.is_behind_noise() {
                    outputs.draw(noise);
                }
                match &part.law {
                    Law::Sensor(law) | Law::Reading(law) => {
                        part.pass(law.as_ref(), theta, drive, (&mut outputs.signal, false));
                    }
                    Law::MeasurementNoise(law) => {
                        let source = format!("sensor-noise/{}", part.target);
                        let level = law(part.m(theta));
                        outputs.add(NoisePart::white(part.target, level, source), noise);
                    }
                    _ => part.finish(theta, noise, &mut outputs.signal),
                }
            }
            TwinPart::White(white) => white.parts(theta).for_each(|part| outputs.add(part, noise)),
            TwinPart::Disturbance(part) => {
                if let Entry::Sensor(output) = part.entry {
                    outputs.add(disturbance(part, output, theta), noise);
                }
            }
            _ => {}
        }
        Ok(outputs)
    }

    /// Outputs where a parameter follows inputs or time: parabolas through three runs, in its logarithm.
    ///
    /// ```text
    /// y(t) = Y(θ·exp(f(z(t))), t)        Y(θ, ·): a run with θ held;  z: an input or time
    /// ```
    fn followed(
        &self,
        inside: &[Added],
        (part, law): (&LawPart, &dyn ParameterChange),
        theta: &[f64],
        (drive, noise): (&Drive, Noise),
    ) -> Result<Outputs, SimulationError> {
        let m = part.m(theta);
        let by: Vec<f64> = (0..drive.samples())
            .map(|k| {
                let now = Now::new(drive.time(k), drive.step(k), drive.input(k), &[]);
                (law.value(m, &now, &[], 1.0).ln()).clamp(-LARGEST, LARGEST)
            })
            .collect();
        let low = by.iter().copied().fold(f64::INFINITY, f64::min);
        let high = by.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let at = |change: f64| {
            let mut theta = Theta::from_slice(theta);
            theta[part.target] *= change.exp();
            self.outputs(inside, &theta, drive, noise)
        };
        let (middle, half) = (0.5 * (low + high), 0.5 * (high - low));
        let mut outputs = at(middle)?;
        // What is far below rounding moves nothing.
        if half <= f64::EPSILON {
            return Ok(outputs);
        }
        let (first, last) = (at(low)?.signal, at(high)?.signal);
        for ((k, v), mut row) in by.iter().enumerate().zip(outputs.signal.rows_mut()) {
            let x = (v - middle) / half;
            let ends = first.row(k).into_iter().zip(last.row(k));
            for (y, (a, b)) in row.iter_mut().zip(ends) {
                *y = 0.5 * x * (x - 1.0) * a + (1.0 - x * x) * *y + 0.5 * x * (x + 1.0) * b;
            }
        }
        Ok(outputs)
    }
}

/// The disturbance on a channel.
fn disturbance(part: &Disturbance, channel: usize, theta: &[f64]) -> NoisePart {
    let sigma = theta[part.sigma];
    NoisePart {
        output: channel,
        level: Disturbance::share(part.memory) * sigma,
        memory: Some(part.memory),
        start: Disturbance::started(part.memory) * sigma,
        source: "disturbance".to_owned(),
    }
}

impl DigitalTwin for ComposedBlackBox {
    fn parameters(&self) -> ParameterSpace {
        self.parts.outline.parameters.clone()
    }
    fn signals(&self) -> Signals {
        self.own.signals()
    }
    fn simulate(
        &self,
        theta: &[f64],
        drive: &Drive,
        noise: Noise,
    ) -> Result<Signal, SimulationError> {
        if is_hastened() {
            return Err(SimulationError::stopped());
        }
        self.parts.call_hooks()?;
        let theta = self.checked(theta, drive.dt())?;
        let mut outputs = self.outputs(&self.parts.list, &theta, drive, noise)?;
        outputs.draw(noise);
        Ok(outputs.signal)
    }
    fn free_run(&self, theta: &[f64], drive: &Drive) -> Result<Signal, SimulationError> {
        if self.parts.list.is_empty() {
            return (self.own).free_run(&self.checked(theta, drive.dt())?, drive);
        }
        mean_run(self, theta, drive)
    }
}
