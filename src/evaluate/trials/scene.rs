//! Sizes of a twin's signals: one record of its world without departures.

use super::law::{Argument, DeparturePlace, LawVariable, Moment};
use super::world::{Conditions, RecordNoise, System, WorldRun, run};
use crate::evaluate::trials::numbers::TRIAL;
use crate::math::{deviation, ends};
use crate::record::{Drive, Signal};
use crate::twin::Twin;

/// Range and spread of one signal.
#[derive(Debug, Clone, Copy)]
pub(super) struct SignalExtent {
    pub low: f64,
    pub high: f64,
    pub deviation: f64,
    /// Root mean square.
    pub rms: f64,
}

impl SignalExtent {
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

    fn ends(&self) -> (f64, f64) {
        (self.low, self.high)
    }

    /// Width of the range.
    pub fn span(&self) -> f64 {
        self.high - self.low
    }
}

/// A record of the world without departures, and its sizes.
#[derive(Debug, Clone)]
pub(super) struct Scene {
    pub run: WorldRun,
    pub draws: RecordNoise,
    pub states: Vec<SignalExtent>,
    pub rates: Vec<SignalExtent>,
    pub inputs: Vec<SignalExtent>,
    pub outputs: Vec<SignalExtent>,
    /// In seconds.
    pub duration: f64,
    pub dt: f64,
}

fn sizes(signal: &Signal) -> Vec<SignalExtent> {
    (signal.columns().into_iter())
        .map(|column| SignalExtent::of(&column.to_vec()))
        .collect()
}

impl Scene {
    /// Simulates the world at θ; `None` where it diverges.
    pub fn new(twin: &Twin, theta: &[f64], drive: &Drive, draws: RecordNoise) -> Option<Self> {
        let conditions = Conditions::declared();
        let run = run(twin, System::new(theta, &conditions), drive, draws)?;
        Some(Self {
            states: sizes(&run.states),
            rates: sizes(&run.rates),
            inputs: sizes(run.drive.inputs()),
            outputs: sizes(&run.outputs),
            duration: drive.samples() as f64 * drive.dt(),
            dt: drive.dt(),
            run,
            draws,
        })
    }

    /// Returns true if an output never moves.
    pub fn is_still(&self) -> bool {
        self.outputs.iter().any(|size| size.deviation == 0.0)
    }

    /// Returns true if a record stays near this one.
    pub fn is_near(&self, run: &WorldRun) -> bool {
        (run.outputs.columns().into_iter().zip(&self.outputs)).all(|(column, size)| {
            let middle = 0.5 * (size.low + size.high);
            let most = TRIAL.output_reach * size.span();
            // A missing sample compares false.
            !column.iter().any(|y| (y - middle).abs() > most)
        })
    }

    /// The signal that a variable stands for, standardised; `None` for one that does not move.
    pub fn argument(&self, variable: LawVariable, place: DeparturePlace) -> Option<Argument> {
        let (low, high) = match variable {
            LawVariable::Time => (0.0, self.duration),
            LawVariable::State(i) => self.states[i].ends(),
            LawVariable::Input(j) => self.inputs[j].ends(),
            LawVariable::Own => self.extent(place)?.ends(),
        };
        let half_width = 0.5 * (high - low);
        (half_width > 0.0 && half_width.is_finite()).then_some(Argument {
            variable,
            centre: 0.5 * (low + high),
            half_width,
        })
    }

    /// Range of the signal at a place; none of a parameter.
    pub fn extent(&self, place: DeparturePlace) -> Option<SignalExtent> {
        match place {
            DeparturePlace::State(i) => Some(self.states[i]),
            DeparturePlace::Actuator(j) => Some(self.inputs[j]),
            DeparturePlace::Sensor(j) => Some(self.outputs[j]),
            DeparturePlace::Parameter(_) => None,
        }
    }

    /// Variables that move at a place.
    pub fn variables(&self, place: DeparturePlace) -> Vec<LawVariable> {
        let states = (0..self.states.len()).map(LawVariable::State);
        let inputs = (0..self.inputs.len()).map(LawVariable::Input);
        let mut all: Vec<LawVariable> = states.chain(inputs).collect();
        match place {
            DeparturePlace::Sensor(_) | DeparturePlace::Actuator(_) => all.push(LawVariable::Own),
            // Nothing else moves in an autonomous black box.
            DeparturePlace::Parameter(_) | DeparturePlace::State(_) => all.push(LawVariable::Time),
        }
        all.retain(|variable| self.argument(*variable, place).is_some());
        all
    }

    /// The moments of the record, as a law at this place sees them.
    pub fn moments(&self, place: DeparturePlace) -> Vec<Moment<'_>> {
        let run = &self.run;
        (0..run.drive.samples())
            .map(|k| {
                let now = Moment::new(run.drive.time(k), row(&run.states, k), run.drive.input(k));
                now.at(match place {
                    DeparturePlace::State(i) => run.states[[k, i]],
                    DeparturePlace::Actuator(j) => run.drive.inputs()[[k, j]],
                    DeparturePlace::Sensor(j) => run.outputs[[k, j]],
                    DeparturePlace::Parameter(_) => 0.0,
                })
            })
            .collect()
    }

    /// A departure of size 1 at a place: as large as the twin's own terms there; of a parameter, a factor e.
    pub fn unit(&self, place: DeparturePlace) -> f64 {
        match place {
            DeparturePlace::State(i) if self.rates[i].rms > 0.0 => self.rates[i].rms,
            DeparturePlace::State(i) => self.states[i].span().max(1e-9) / self.duration,
            DeparturePlace::Actuator(j) => self.inputs[j].rms.max(1e-9),
            DeparturePlace::Sensor(j) => self.outputs[j].deviation,
            DeparturePlace::Parameter(_) => 1.0,
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
