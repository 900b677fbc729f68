//! A chain of leaking tanks in units of anybody's choice.

use super::{
    DigitalTwin, Noise, Now, Outline, Parameter, ParameterSpace, Quantity, Record, RecordPlan,
    StateSpace, Study,
};

/// Units of a twin's numbers: each is the plain one times its unit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Units {
    pub parameters: f64,
    pub states: f64,
    pub inputs: f64,
    pub outputs: f64,
    pub seconds: f64,
}

impl Units {
    pub const PLAIN: Self = Self {
        parameters: 1.0,
        states: 1.0,
        inputs: 1.0,
        outputs: 1.0,
        seconds: 1.0,
    };
}

/// Levels x1 … xn: ẋ1 = u − k1·x1, ẋi = k(i−1)·x(i−1) − ki·xi; some of the last of them are measured.
#[derive(Debug, Clone, Copy)]
pub struct Chain {
    pub tanks: usize,
    pub measured: usize,
    pub units: Units,
}

impl Chain {
    /// Two tanks, of which the second is measured.
    pub fn pair(units: Units) -> Self {
        Self {
            tanks: 2,
            measured: 1,
            units,
        }
    }

    /// Rate constant number i: each tank has another, lest two could be exchanged.
    pub fn rate(&self, i: usize) -> f64 {
        self.units.parameters * (0.5 + 0.5 * i as f64 / self.tanks as f64)
    }

    pub fn study(&self, samples: usize) -> Study {
        let Units {
            inputs, seconds, ..
        } = self.units;
        let plan = RecordPlan::levels(0.2 * seconds, samples, 0.0, 2.0 * inputs, 15);
        Study::new("chain", *self, plan).unwrap()
    }

    /// A record at rates that are `factor` times those of the middle of the prior.
    pub fn record(&self, factor: f64, samples: usize, seed: u64) -> Record {
        let noise = Noise::new(seed, "record", 0);
        let drive = self.study(samples).drive(noise).unwrap();
        let theta: Vec<f64> = (0..self.tanks).map(|i| factor * self.rate(i)).collect();
        let outputs = self.simulate(&theta, &drive, noise).unwrap();
        Record::new(drive, outputs).unwrap()
    }
}

fn named(letter: &str, count: usize) -> Vec<Quantity> {
    let name = |i: usize| match count {
        1 => letter.to_owned(),
        _ => format!("{letter}{i}"),
    };
    (1..=count).map(|i| Quantity::new(&name(i), "")).collect()
}

impl StateSpace for Chain {
    fn outline(&self) -> Outline {
        let parameter = |i: usize| {
            let rate = self.rate(i);
            Parameter::new(&format!("k{}", i + 1), "", 0.7 * rate, 1.4 * rate)
                .within(0.2 * rate, 4.0 * rate)
        };
        Outline {
            parameters: ParameterSpace::new((0..self.tanks).map(parameter)),
            states: named("x", self.tanks),
            inputs: named("u", 1),
            outputs: named("y", self.measured),
            ..Outline::new()
        }
    }

    fn drift(&self, now: &Now, x: &[f64], dx: &mut [f64]) {
        let units = self.units;
        let mut inflow = now.u[0] / units.inputs;
        for i in 0..self.tanks {
            let outflow = now.theta[i] / units.parameters * x[i] / units.states;
            dx[i] = (inflow - outflow) * units.states / units.seconds;
            inflow = outflow;
        }
    }

    fn observe(&self, _: &Now, x: &[f64], y: &mut [f64]) {
        let first = self.tanks - self.measured;
        for (y, x) in y.iter_mut().zip(&x[first..]) {
            *y = x / self.units.states * self.units.outputs;
        }
    }

    fn noise(&self, _: &Now, _: &[f64], process: &mut [f64], measurement: &mut [f64]) {
        process.fill(0.005 * self.units.states);
        measurement.fill(0.02 * self.units.outputs);
    }
}
