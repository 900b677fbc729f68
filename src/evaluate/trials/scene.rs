//! Sizes of a twin's signals: one record of its world without departures.

use super::law::{Argument, Moment, Place, Variable};
use super::world::{Conditions, Draws, Run, System, World};
use crate::math::{deviation, ends};
use crate::record::{Drive, Signal};

/// A departure may move an output so many times as far as it moves without one; beyond, the system is another.
const REACH: f64 = 20.0;

/// Range and spread of one signal.
#[derive(Debug, Clone, Copy)]
pub(super) struct Size {
    pub low: f64,
    pub high: f64,
    pub deviation: f64,
    /// Root mean square.
    pub rms: f64,
}

impl Size {
    fn of(values: &[f64]) -> Self {
        let present: Vec<f64> = values.iter().copied().filter(|v| v.is_finite()).collect();
        let (low, high) = ends(&present);
        let square: f64 = present.iter().map(|v| v * v).sum();
        Self {
            low,
            high,
            deviation: deviation(&present),
            rms: (square / present.len().max(1) as f64).sqrt(),
        }
    }

    /// Width of the range.
    pub fn span(&self) -> f64 {
        self.high - self.low
    }
}

/// A record of the world without departures, and its sizes.
#[derive(Debug, Clone)]
pub(super) struct Scene {
    pub run: Run,
    pub states: Vec<Size>,
    pub rates: Vec<Size>,
    pub inputs: Vec<Size>,
    pub outputs: Vec<Size>,
    /// In seconds.
    pub duration: f64,
    pub dt: f64,
}

fn sizes(signal: &Signal) -> Vec<Size> {
    (signal.columns().into_iter())
        .map(|column| Size::of(&column.to_vec()))
        .collect()
}

impl Scene {
    /// Simulates the world at θ; `None` where it diverges.
    pub fn new(world: &World, theta: &[f64], drive: &Drive, draws: Draws) -> Option<Self> {
        let conditions = Conditions::declared();
        let system = System {
            theta,
            departures: &[],
            conditions: &conditions,
        };
        let run = world.run(system, drive, draws)?;
        Some(Self {
            states: sizes(&run.states),
            rates: sizes(&run.rates),
            inputs: sizes(run.drive.inputs()),
            outputs: sizes(&run.outputs),
            duration: drive.samples() as f64 * drive.dt(),
            dt: drive.dt(),
            run,
        })
    }

    /// Returns true if an output never moves.
    pub fn is_still(&self) -> bool {
        self.outputs.iter().any(|size| size.deviation == 0.0)
    }

    /// Returns true if a record stays near this one.
    pub fn is_near(&self, run: &Run) -> bool {
        (run.outputs.columns().into_iter().zip(&self.outputs)).all(|(column, size)| {
            let middle = 0.5 * (size.low + size.high);
            let most = REACH * size.span();
            // A missing sample compares false.
            !column.iter().any(|y| (y - middle).abs() > most)
        })
    }

    /// The signal that a variable stands for, standardised; `None` for one that does not move.
    pub fn argument(&self, variable: Variable, place: Place) -> Option<Argument> {
        let (low, high) = match (variable, place) {
            (Variable::Time, _) => (0.0, self.duration),
            (Variable::State(i), _) | (Variable::Own, Place::State(i)) => {
                (self.states[i].low, self.states[i].high)
            }
            (Variable::Input(j), _) | (Variable::Own, Place::Actuator(j)) => {
                (self.inputs[j].low, self.inputs[j].high)
            }
            (Variable::Own, Place::Sensor(j)) => (self.outputs[j].low, self.outputs[j].high),
            (Variable::Own, Place::Parameter(_)) => return None,
        };
        let half_width = 0.5 * (high - low);
        (half_width > 0.0 && half_width.is_finite()).then_some(Argument {
            variable,
            centre: 0.5 * (low + high),
            half_width,
        })
    }

    /// Variables that move at a place.
    pub fn variables(&self, place: Place) -> Vec<Variable> {
        let states = (0..self.states.len()).map(Variable::State);
        let inputs = (0..self.inputs.len()).map(Variable::Input);
        let mut all: Vec<Variable> = states.chain(inputs).collect();
        match place {
            Place::Sensor(_) | Place::Actuator(_) => all.push(Variable::Own),
            // Nothing else moves in an autonomous black box.
            Place::Parameter(_) | Place::State(_) => all.push(Variable::Time),
        }
        all.retain(|variable| self.argument(*variable, place).is_some());
        all
    }

    /// The moments of the record, as a law at this place sees them.
    pub fn moments(&self, place: Place) -> Vec<Moment<'_>> {
        let run = &self.run;
        (0..run.drive.samples())
            .map(|k| Moment {
                t: run.drive.time(k),
                x: row(&run.states, k),
                u: run.drive.input(k),
                own: match place {
                    Place::State(i) => run.states[[k, i]],
                    Place::Actuator(j) => run.drive.inputs()[[k, j]],
                    Place::Sensor(j) => run.outputs[[k, j]],
                    Place::Parameter(_) => 0.0,
                },
            })
            .collect()
    }

    /// A departure of size 1 at a place: as large as the twin's own terms there; of a parameter, a factor e.
    pub fn unit(&self, place: Place) -> f64 {
        match place {
            Place::State(i) if self.rates[i].rms > 0.0 => self.rates[i].rms,
            Place::State(i) => self.states[i].span().max(1e-9) / self.duration,
            Place::Actuator(j) => self.inputs[j].rms.max(1e-9),
            Place::Sensor(j) => self.outputs[j].deviation,
            Place::Parameter(_) => 1.0,
        }
    }
}

/// One row of a signal.
fn row(signal: &Signal, k: usize) -> &[f64] {
    let columns = signal.ncols();
    signal
        .as_slice()
        .map_or(&[], |all| &all[k * columns..(k + 1) * columns])
}
