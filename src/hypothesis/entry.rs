//! Disturbances and unknown functions of states, inputs and time as parts of a twin.

use super::basis::{Of, TERMS, sum_of_one};
use super::trace::Trace;
pub(crate) use crate::twin::Entry;
use crate::twin::{
    Disturbance, Follows, LARGEST, Law, LawPart, LawPlace, Layout, Now, Parameter, ParameterChange,
    RateChange, Role, Seen, SignalChange, Twin, TwinPart,
};
use std::sync::Arc;

/// A function, where it enters, and the range that it is drawn over.
///
/// ```text
/// y_j + f(z),   θ_i·exp(f(z))   or   ẋ_i + f(z)        z: a state, an input or time, or a trace of one
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Entered {
    /// A sensor, a parameter or, for a trace, a state.
    pub entry: Entry,
    pub of: Of,
    pub ends: (f64, f64),
    /// Trace of the variable that the function is of, where it is not of the variable itself.
    pub trace: Option<Trace>,
}

/// A function in its place: the state that holds the trace, if it is of one.
#[derive(Clone, Copy)]
struct Placed {
    function: Entered,
    memory: usize,
}

impl Placed {
    /// The function behind the memories of the step, which hold the traces of its sample.
    fn value(&self, m: &[f64], now: &Now<'_>, x: &[f64], signal: f64) -> f64 {
        let Entered {
            of, ends, trace, ..
        } = self.function;
        let variable = match trace {
            Some(_) => x[self.memory],
            None => of.value(now.t, x, now.u, signal),
        };
        sum_of_one(m, variable, ends)
    }

    /// The function before the memories of the step have moved: as an output is read.
    fn reading(&self, m: &[f64], now: &Now<'_>, x: &[f64], signal: f64) -> f64 {
        let Entered {
            of, ends, trace, ..
        } = self.function;
        let value = of.value(now.t, x, now.u, signal);
        let variable = match trace {
            Some(trace) => {
                let dt = now.memory_step(matches!(of, Of::Input(_)));
                trace.step(x[self.memory], value, dt)
            }
            None => value,
        };
        sum_of_one(m, variable, ends)
    }

    /// Returns whether it has one value for all states of a moment.
    fn is_of_the_moment(&self) -> bool {
        let is_told = matches!(self.function.of, Of::Time | Of::Input(_));
        is_told && self.function.trace.is_none()
    }
}

impl RateChange for Placed {
    fn push(
        &self,
        m: &[f64],
        now: &Now<'_>,
        on: &LawPlace,
        (at, x): (Layout, &[f64]),
        dx: &mut [f64],
    ) {
        let same = self.is_of_the_moment().then(|| self.value(m, now, x, 0.0));
        let points = x.chunks_exact(at.stride);
        for (x, rates) in points.zip(dx.chunks_exact_mut(at.stride)) {
            rates[on.target] += same.unwrap_or_else(|| self.value(m, now, x, 0.0));
        }
    }
}

impl SignalChange for Placed {
    fn peek(
        &self,
        m: &[f64],
        now: &Now<'_>,
        on: &LawPlace,
        (at, x): (Layout, &[f64]),
        (p, y): (usize, &mut [f64]),
    ) {
        let same = self
            .is_of_the_moment()
            .then(|| self.reading(m, now, x, 0.0));
        for (x, y) in at.each(x).zip(y.chunks_exact_mut(p)) {
            let signal = &mut y[on.target];
            *signal += same.unwrap_or_else(|| self.reading(m, now, x, *signal));
        }
    }
}

impl ParameterChange for Placed {
    fn value(&self, m: &[f64], now: &Now<'_>, x: &[f64], value: f64) -> f64 {
        value * self.value(m, now, x, 0.0).clamp(-LARGEST, LARGEST).exp()
    }

    fn sees_states(&self) -> bool {
        matches!(self.function.of, Of::State(_)) || self.function.trace.is_some()
    }
}

/// Returns the twin with a function; θ is longer by its coefficients.
pub(crate) fn with_function(twin: &Twin, function: Entered) -> Twin {
    let coefficients = (1..=TERMS).map(|k| {
        Parameter::new(&format!("function/{k}"), "", -1.0, 1.0).with_role(Role::Magnitude)
    });
    let memory = twin.outline().map_or(0, |outline| outline.states.len());
    let law = Arc::new(Placed { function, memory });
    let magnitudes = twin.entries()..twin.entries() + TERMS;
    let (law, target) = match function.entry {
        Entry::Sensor(target) => (Law::Sensor(law), target),
        Entry::Parameter(i) => (Law::Parameter(law), twin.entry(i)),
        Entry::State(target) => (Law::Force(law), target),
        // Inputs have functions that are effects.
        Entry::Actuator(_) => return twin.clone(),
    };
    let mut part = LawPart::new(law, format!("function/{memory}"), target, magnitudes);
    if let Some((trace, of)) = function.trace.zip(seen(function.of)) {
        part.memory = 1;
        part.follows = Some(Follows {
            of,
            by: Arc::new(trace),
        });
    }
    twin.with(coefficients, vec![TwinPart::Law(part)])
}

/// Signal inside a twin that a variable is.
fn seen(of: Of) -> Option<Seen> {
    match of {
        Of::State(i) => Some(Seen::State(i)),
        Of::Input(i) => Some(Seen::Input(i)),
        Of::Output(j) => Some(Seen::Output(j)),
        Of::Signal | Of::Time => None,
    }
}

/// Returns the twin with an Ornstein–Uhlenbeck disturbance, θ longer by its strength σ > 0: what an effect that nobody listed would look
/// like to a filter. One that may follow it gains on every gap at the right place, and on one elsewhere less.
pub(crate) fn disturbed(twin: &Twin, entry: Entry, memory: f64) -> Twin {
    let name = format!("disturbance/{}", twin.entries());
    let sigma = Parameter::new(&name, "", 0.01, 1.0).with_role(Role::Magnitude);
    let disturbance = Disturbance {
        entry: match entry {
            Entry::Parameter(i) => Entry::Parameter(twin.entry(i)),
            entry => entry,
        },
        memory,
        sigma: twin.entries(),
    };
    twin.with([sigma], vec![TwinPart::Disturbance(disturbance)])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::record::{Drive, Signal};
    use crate::twin::Noise;
    use crate::twin::fixture::AtOnce;
    use crate::twins::CascadedTanks;
    use std::f64::consts::{PI, SQRT_2};

    fn rising() -> Drive {
        let inputs = Signal::from_shape_fn((50, 1), |(k, _)| 1.0 + 0.02 * k as f64);
        Drive::new(0.5, inputs).unwrap()
    }

    const THETA: [f64; 4] = [0.6, 0.5, 0.55, 1.0];

    /// The output alone moves, by the function of the input.
    #[test]
    fn an_output_has_its_function() {
        let (base, drive) = (Twin::new(CascadedTanks), rising());
        let plain = base.free_run(&THETA, &drive).unwrap();
        let function = Entered {
            entry: Entry::Sensor(0),
            of: Of::Input(0),
            ends: (0.0, 4.0),
            trace: None,
        };
        let twin = with_function(&base, function);
        let mut longer = [&THETA[..], &[0.0; TERMS]].concat();
        assert_eq!(twin.free_run(&longer, &drive).unwrap(), plain);
        longer[4] = 0.3;
        let moved = twin.free_run(&longer, &drive).unwrap() - &plain;
        for (k, moved) in moved.iter().enumerate() {
            let z = drive.input(k)[0] / 4.0;
            let f = 0.3 * SQRT_2 * (PI * z).sin();
            assert!((moved - f).abs() < 1e-12, "{k}");
        }
    }

    /// A gain of the pump that follows its own input is that of a twin whose input is larger by as much; one that follows a level is
    /// another one.
    #[test]
    fn a_parameter_follows_its_function() {
        let (base, drive) = (Twin::new(CascadedTanks), rising());
        let theta: Vec<f64> = THETA
            .iter()
            .copied()
            .chain([0.3])
            .chain([0.0; TERMS - 1])
            .collect();
        let twin = |of| {
            let function = Entered {
                entry: Entry::Parameter(3),
                of,
                ends: (0.0, 4.0),
                trace: None,
            };
            with_function(&base, function)
                .free_run(&theta, &drive)
                .unwrap()
        };
        let larger = drive
            .inputs()
            .mapv(|u| u * (0.3 * SQRT_2 * (PI * u / 4.0).sin()).exp());
        let larger = Drive::new(0.5, larger).unwrap();
        let expected = base.free_run(&THETA, &larger).unwrap();
        let difference = |found: Signal| (found - &expected).mapv(f64::abs).sum();
        assert!(difference(twin(Of::Input(0))) < 1e-9);
        assert!(difference(twin(Of::State(0))) > 1e-3);
        assert!(difference(twin(Of::Time)) > 1e-3);
    }

    fn run_of_box(entry: Entry, of: Of, first: f64) -> (Drive, Signal) {
        let inputs = Signal::from_shape_fn((50, 1), |(k, _)| 1.0 + 0.02 * k as f64);
        let drive = Drive::new(0.5, inputs).unwrap();
        let ends = (0.0, 30.0);
        let base = Twin::new(AtOnce::<1>(|a, u| a[0] * a[0] * u));
        let trace = None;
        let function = Entered {
            entry,
            of,
            ends,
            trace,
        };
        let twin = with_function(&base, function);
        let theta = [&[0.8, first][..], &[0.0; TERMS - 1]].concat();
        let outputs = twin.simulate(&theta, &drive, Noise::new(1, "test", 0));
        (drive, outputs.unwrap())
    }

    /// Without memory, outputs follow the parameter exactly, but for what parabolas miss.
    #[test]
    fn outputs_of_a_black_box_follow_a_parameter() {
        let (drive, outputs) = run_of_box(Entry::Parameter(0), Of::Time, 0.1);
        for (k, y) in outputs.iter().enumerate() {
            let f = 0.1 * SQRT_2 * (PI * drive.time(k) / 30.0).sin();
            let expected = (0.8 * f.exp()).powi(2) * drive.input(k)[0];
            assert!((y / expected - 1.0).abs() < 5e-4, "{k}: {y} {expected}");
        }
    }

    #[test]
    fn an_output_of_a_black_box_has_its_function_of_an_input() {
        let (drive, outputs) = run_of_box(Entry::Sensor(0), Of::Input(0), 0.3);
        for (k, y) in outputs.iter().enumerate() {
            let u = drive.input(k)[0];
            let expected = 0.64 * u + 0.3 * SQRT_2 * (PI * u / 30.0).sin();
            assert!((y - expected).abs() < 1e-12, "{k}");
        }
    }

    /// Without strength, nothing changes; with it, the disturbance has the standard deviation that σ says.
    #[test]
    fn a_disturbance_has_its_strength() {
        let base = Twin::new(CascadedTanks);
        let drive = Drive::new(0.5, Signal::from_elem((3000, 1), 1.5)).unwrap();
        let theta = [0.6, 0.5, 0.55, 1.0];
        let noise = Noise::new(2, "t", 0);
        let plain = base.simulate(&theta, &drive, noise).unwrap();
        let twin = disturbed(&base, Entry::Sensor(0), 0.8);
        let run = |sigma: f64| {
            let theta: Vec<f64> = theta.iter().copied().chain([sigma]).collect();
            twin.simulate(&theta, &drive, noise).unwrap()
        };
        assert_eq!(run(0.0), plain);
        let difference = &run(0.3) - &plain;
        let variance = difference.mapv(|d| d * d).mean().unwrap();
        // Effective number of draws: 3000·(1 − a²)/(1 + a²) = 660; five standard deviations of the variance.
        assert!((variance / 0.09 - 1.0).abs() < 5.0 * (2.0f64 / 660.0).sqrt());
    }
}
