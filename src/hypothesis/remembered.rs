//! Unknown functions of what a signal leaves behind: of its lag, and of its play.
//!
//! ```text
//! lag     z ← a·z + (1 − a)·v,  a = exp(−Δt/τ)      play     z ← clamp(z, v ± width/2)
//! ẋ + f(z),   θ·exp(f(z)),   y + f(z)               v: a state, an input or an output;  at a sensor or an actuator also its own signal
//! ```
//!
//! A relay with hysteresis is a step of a play, a valve that follows late is a function of a lag. Time constants and widths are a grid
//! from the record: a search looks at all, and fits the best of each pair of variable and place.

use super::basis::Of;
use super::entry::Entry;
use super::functions::{Variable, of_trace, of_trail, spread, visited};
use super::listed::Library;
use super::scales::Scales;
use super::term::Term;
use super::trace::Trace;
use crate::effect::{TargetKind, targets};
use crate::hypothesis::limits::TERM;
use crate::math::correlation;
use crate::twin::{Role, is_memory};

/// Time constants, from a step and a half to an eighth of the record: a factor of 1.5 apart in 300 rows. They share one prior, so that more of
/// them cost time alone; with half of them a lag between two loses a nat or two.
const LAGS: usize = 9;
/// Widths of a play, in ranges of the signal: below a tenth it is the signal itself, above 0.8 it hardly moves.
const WIDTHS: [f64; 6] = [0.1, 0.2, 0.3, 0.45, 0.6, 0.8];
const WIDTHS_OF_BOX: [f64; 2] = [0.25, 0.5];

/// A signal that may leave a trace.
struct TracedSignal {
    kind: TargetKind,
    index: usize,
    of: Of,
    name: String,
    range: (f64, f64),
}

/// Functions of traces at every place of a twin; `seen` are states of models whose range they must cover.
pub(super) fn remembered(library: &Library<'_>, seen: &[Scales]) -> Vec<Term> {
    let traces = Traces { library, seen };
    let mut terms = traces.of_signals();
    if library.scales.has_equations() {
        terms.extend(traces.inside());
    }
    terms
}

struct Traces<'l> {
    library: &'l Library<'l>,
    seen: &'l [Scales],
}

impl Traces<'_> {
    fn scales(&self) -> &Scales {
        self.library.scales
    }

    fn source(&self, kind: TargetKind, index: usize) -> Option<TracedSignal> {
        let outline = &self.scales().outline;
        let (of, names) = match kind {
            TargetKind::Sensor => (Of::Output(index), &outline.outputs),
            TargetKind::Actuator => (Of::Input(index), &outline.inputs),
            _ => (Of::State(index), &outline.states),
        };
        let all = std::iter::once(self.scales()).chain(self.seen);
        let range = visited(all.map(|scales| scales.columns(kind, index)))?;
        Some(TracedSignal {
            kind,
            index,
            of,
            name: names[index].name.clone(),
            range,
        })
    }

    /// The traces of a signal, each as a variable with the range that it is seen in.
    fn of(&self, source: &TracedSignal) -> Vec<(Variable, Trace)> {
        let scales = self.scales();
        let (dt, duration) = (scales.dt(), scales.duration());
        let (lags, widths): (Vec<f64>, &[f64]) = match scales.has_equations() {
            true => (spread::<LAGS>(1.5 * dt, duration / 8.0).to_vec(), &WIDTHS),
            false => (
                spread::<{ TERM.lags_of_box + 1 }>(1.5 * dt, duration / 8.0)[1..].to_vec(),
                &WIDTHS_OF_BOX,
            ),
        };
        let lags = (lags.into_iter()).map(|tau| ("lagged", Trace::Lag(tau)));
        let range = source.range.1 - source.range.0;
        let plays = (widths.iter()).map(|part| ("play of", Trace::Play(0.5 * part * range)));
        let variable = |(word, trace): (&str, Trace)| {
            let all = std::iter::once(scales).chain(self.seen);
            let values = all.map(|s| trace.of(&s.columns(source.kind, source.index), dt));
            let (low, high) = visited(values)?;
            let variable = Variable {
                name: format!("{word} {}", source.name),
                of: source.of,
                low,
                high,
            };
            Some((variable, trace))
        };
        lags.chain(plays).filter_map(variable).collect()
    }

    /// Functions of the trace of a sensor's or an actuator's own signal.
    fn of_signals(&self) -> Vec<Term> {
        let signals = self.library.twin.signals();
        let mut terms = vec![];
        for kind in [TargetKind::Sensor, TargetKind::Actuator] {
            for (j, target) in targets(kind, None, &signals).into_iter().enumerate() {
                let Some(source) = self.source(kind, j) else {
                    continue;
                };
                let size = self.scales().size(kind, j);
                let entry = match kind {
                    TargetKind::Sensor => Entry::Sensor(j),
                    _ => Entry::Actuator(j),
                };
                let traces = self.of(&source).into_iter();
                terms.extend(
                    traces.map(|(seen, trace)| of_trace(&target, &seen, size, trace, entry)),
                );
            }
        }
        terms
    }

    /// Functions of traces of states, inputs and outputs at rates, parameters and outputs.
    fn inside(&self) -> Vec<Term> {
        let outline = &self.scales().outline;
        let of = |kind, count: usize| (0..count).filter_map(move |i| self.source(kind, i));
        let shown = self.shown();
        let (states, signals): (Vec<TracedSignal>, Vec<TracedSignal>) =
            of(TargetKind::State, outline.states.len())
                .chain(of(TargetKind::Actuator, outline.inputs.len()))
                .chain(of(TargetKind::Sensor, outline.outputs.len()))
                .filter(|source| match source.of {
                    Of::Output(j) => shown[j].is_none(),
                    _ => !is_memory(&source.name),
                })
                .partition(|source| source.kind == TargetKind::State);
        let is_large = states.len() > TERM.most_states;
        let places = self.places();
        let mut terms = vec![];
        for source in states.iter().chain(&signals) {
            let is_apart = |entry: Entry| match (entry, source.of) {
                // A sensor's own signal has its functions already.
                (Entry::Sensor(j), Of::State(i)) => shown[j] != Some(i) && !is_large,
                (Entry::Sensor(j), of) => of != Of::Output(j),
                (entry, Of::State(i)) => !is_large || entry == Entry::State(i),
                _ => true,
            };
            for (seen, trace) in self.of(source) {
                let places = places.iter().filter(|(_, entry, _)| is_apart(*entry));
                terms.extend(places.map(|(target, entry, largest)| {
                    of_trail(target, *entry, &seen, *largest, trace)
                }));
            }
        }
        terms
    }

    /// Places at which a function of a trace may enter, with its largest size.
    fn places(&self) -> Vec<(String, Entry, f64)> {
        let scales = self.scales();
        let outline = &scales.outline;
        let rates = outline.states.iter().zip(&scales.rates).enumerate();
        let states = rates
            .filter(|(i, (state, rate))| {
                **rate > 0.0 && !scales.defined[*i] && !is_memory(&state.name)
            })
            .map(|(i, (state, rate))| (state.name.clone(), Entry::State(i), *rate));
        let parameters = (outline.parameters.iter().enumerate())
            .filter(|(_, p)| p.role == Role::Parameter)
            .map(|(i, p)| (p.name.clone(), Entry::Parameter(i), 1.0));
        let sensors = targets(TargetKind::Sensor, None, &self.library.twin.signals());
        let sensors = (sensors.into_iter().enumerate()).map(|(j, target)| {
            let size = scales.size(TargetKind::Sensor, j);
            (target, Entry::Sensor(j), size)
        });
        states.chain(parameters).chain(sensors).collect()
    }

    /// The state that each output is, but for its scale and its noise, if it is one.
    fn shown(&self) -> Vec<Option<usize>> {
        let Library { twin, theta, .. } = *self.library;
        let scales = self.scales();
        let (n, p) = (scales.outline.states.len(), scales.outline.outputs.len());
        let all = (scales.equations_at(twin, theta, usize::MAX)).unwrap_or_default();
        let columns: Vec<Vec<f64>> = (0..n)
            .map(|i| scales.columns(TargetKind::State, i))
            .collect();
        let is_same = |i: usize, j: usize| {
            let outputs = all.chunks_exact(n + p).map(|row| row[n + j]);
            let pairs: Vec<(f64, f64)> = columns[i].iter().copied().zip(outputs).collect();
            !pairs.is_empty() && correlation(&pairs).abs() > TERM.same_trace
        };
        (0..p).map(|j| (0..n).find(|&i| is_same(i, j))).collect()
    }
}
