//! Parts that twins are composed of, and the laws of those parts.

use super::known_noise::SensorNoise;
use crate::twin::points::Layout;
use crate::twin::{Integrator, Interval, Now, Outliers, SimulationError, Stepping};
use std::ops::Range;
use std::sync::Arc;

/// A standard deviation or a step, from magnitudes.
pub(crate) type NoiseLaw = dyn Fn(&[f64]) -> f64 + Send + Sync;
/// Frequency and size of rare large errors, from magnitudes.
pub(crate) type OutlierLaw = dyn Fn(&[f64]) -> Outliers + Send + Sync;
/// A check of all of θ at a step Δt.
pub(crate) type ParameterCheck = dyn Fn(&[f64], f64) -> Result<(), SimulationError> + Send + Sync;
/// A call before each run of a twin; its error stops the run.
pub(crate) type Hook = dyn Fn() -> Result<(), SimulationError> + Send + Sync;

/// Place in a twin at which a law acts.
#[derive(Debug, Clone)]
pub(crate) struct LawPlace {
    /// Index of the channel or the state that it bends.
    pub target: usize,
    /// Index of the other state of a law between two.
    pub other: Option<usize>,
    /// Values that it remembers, in the state.
    pub memory: Range<usize>,
}

/// Change of a signal, over several points at once; `m` are its magnitudes.
pub(crate) trait SignalChange: Send + Sync {
    /// Passes the channel of points, `p` outputs each, through the law; advances its memory in the states.
    fn pass(
        &self,
        m: &[f64],
        now: &Now<'_>,
        on: &LawPlace,
        (at, x): (Layout, &mut [f64]),
        outputs: (usize, &mut [f64]),
    ) {
        self.peek(m, now, on, (at, x), outputs);
    }

    /// As [`pass`](Self::pass), the memories left as they are.
    fn peek(
        &self,
        m: &[f64],
        now: &Now<'_>,
        on: &LawPlace,
        states: (Layout, &[f64]),
        outputs: (usize, &mut [f64]),
    );
}

impl dyn SignalChange {
    /// Returns one value behind a law without memory.
    pub(crate) fn value(&self, m: &[f64], now: &Now<'_>, s: f64) -> f64 {
        let on = LawPlace {
            target: 0,
            other: None,
            memory: 0..0,
        };
        let mut y = [s];
        self.peek(m, now, &on, (Layout::dense(1), &[0.0]), (1, &mut y));
        y[0]
    }
}

/// Addition to the rate of a state, over several points at once.
pub(crate) trait RateChange: Send + Sync {
    /// Adds to the rates of points; `now` holds the twin's own θ.
    fn push(
        &self,
        m: &[f64],
        now: &Now<'_>,
        on: &LawPlace,
        states: (Layout, &[f64]),
        dx: &mut [f64],
    );
}

/// Limit of a state after each step, over several points at once.
pub(crate) trait StateLimit: Send + Sync {
    /// Bends the target and the other state of points.
    fn hold(&self, m: &[f64], on: &LawPlace, at: Layout, x: &mut [f64]);
}

/// Change of a parameter while the twin runs.
pub(crate) trait ParameterChange: Send + Sync {
    /// Returns the value of the parameter at a time, beside the states `x` if it sees these.
    fn value(&self, m: &[f64], now: &Now<'_>, x: &[f64], value: f64) -> f64;

    /// Returns whether the value depends on the states.
    fn sees_states(&self) -> bool {
        false
    }
}

/// Signal inside a twin that a law remembers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Seen {
    State(usize),
    Input(usize),
    /// As the twin's own equations show it.
    Output(usize),
}

/// Memory of a signal inside the twin: it moves once a sample, before the motion of the step that it acts in.
pub(crate) trait Remember: Send + Sync {
    /// Sets the memory at the first sample, where the signal is `value`.
    fn begin(&self, value: f64, memory: &mut [f64]) {
        memory.fill(value);
    }

    /// Moves the memory on; `m` are the magnitudes of its law.
    fn next(&self, m: &[f64], dt: f64, value: f64, memory: &mut [f64]);
}

/// A law's memory, and the signal that it follows.
#[derive(Clone)]
pub(crate) struct Follows {
    pub of: Seen,
    pub by: Arc<dyn Remember>,
}

/// A function of magnitudes and of what it bends, over several points at once.
#[derive(Clone)]
pub(crate) enum Law {
    /// An output signal, before its noise.
    Sensor(Arc<dyn SignalChange>),
    /// An output signal behind its noise; nothing is remembered there.
    Reading(Arc<dyn SignalChange>),
    /// An input signal.
    Actuator(Arc<dyn SignalChange>),
    /// The rate of a state.
    Force(Arc<dyn RateChange>),
    /// A limit on a state, after each step.
    Limit(Arc<dyn StateLimit>),
    /// A parameter over time, or with the states.
    Parameter(Arc<dyn ParameterChange>),
    /// The noise of an output: a standard deviation that joins the twin's own in quadrature.
    MeasurementNoise(Arc<NoiseLaw>),
    /// The noise of a state.
    ProcessNoise(Arc<NoiseLaw>),
    /// Rounding of a finished output, halves upwards: the law is the step.
    Rounding(Arc<NoiseLaw>),
    /// Rare large errors of a finished output.
    Outliers(Arc<OutlierLaw>),
}

/// A law, what it bends, and where its magnitudes stand in θ.
#[derive(Clone)]
pub(crate) struct LawPart {
    pub law: Law,
    /// Name, from which its memory in the state has those of its values, and by which its errors are drawn.
    pub name: String,
    /// Index of the channel or state, or entry of θ.
    pub target: usize,
    /// Index of the other state of a law between two.
    pub other: Option<usize>,
    /// Entries of θ, held ones counted.
    pub magnitudes: Range<usize>,
    /// Number of values that it remembers; they begin at the first value of the signal.
    pub memory: usize,
    /// Signal inside the twin that the memory follows, where it is not the signal that the law bends.
    pub follows: Option<Follows>,
    /// `true` where it shows the signal as it was so many seconds ago, its first magnitude.
    pub is_dead_time: bool,
    /// Magnitude that is a time in seconds after the first row, at which it may jump.
    pub time: Option<usize>,
}

impl LawPart {
    /// Creates a part without memory.
    pub fn new(law: Law, name: String, target: usize, magnitudes: Range<usize>) -> Self {
        Self {
            law,
            name,
            target,
            other: None,
            magnitudes,
            memory: 0,
            follows: None,
            is_dead_time: false,
            time: None,
        }
    }

    /// Returns the magnitudes.
    #[inline]
    pub fn m<'t>(&self, theta: &'t [f64]) -> &'t [f64] {
        &theta[self.magnitudes.clone()]
    }

    /// Returns whether it acts on outputs with their noise.
    pub fn is_behind_noise(&self) -> bool {
        matches!(
            self.law,
            Law::Reading(_) | Law::Rounding(_) | Law::Outliers(_)
        )
    }

    /// Returns its place, its memory being these states.
    #[inline]
    pub fn place(&self, memory: &Range<usize>) -> LawPlace {
        LawPlace {
            target: self.target,
            other: self.other,
            memory: memory.clone(),
        }
    }
}

/// Point at which a disturbance or a function enters.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(crate) enum Entry {
    /// Added to the rate of a state.
    State(usize),
    /// Added to an output, before its noise.
    Sensor(usize),
    /// Added to an input; only where there are no equations.
    Actuator(usize),
    /// Added to the logarithm of a parameter.
    Parameter(usize),
}

/// Largest change of the logarithm of a parameter: e⁵ is beyond any that a record could show.
pub(crate) const LARGEST: f64 = 5.0;

/// An Ornstein–Uhlenbeck disturbance.
///
/// ```text
/// d ← a·d + σ·√(1 − a²)·w        (a = 1: d ← d + σ·w)        ẋ_i + d,   y_j + d,   u_j + d   or   θ_i·exp(d)
/// d ~ N(0, σ²) at the start      (a = 1: 0)
/// ```
#[derive(Debug, Clone, Copy)]
pub(crate) struct Disturbance {
    pub entry: Entry,
    /// Share a of itself that it keeps from a step to the next.
    pub memory: f64,
    /// Entry of σ in θ.
    pub sigma: usize,
}

impl Disturbance {
    /// Standard deviation at the first sample, in units of σ: it began long before, unless it forgets nothing.
    pub fn started(memory: f64) -> f64 {
        if memory < 1.0 { 1.0 } else { 0.0 }
    }

    /// √(1 − a²), and 1 for a = 1: share of σ that comes anew at each step.
    pub fn share(memory: f64) -> f64 {
        match 1.0 - memory * memory {
            s if s > 0.0 => s.sqrt(),
            _ => 1.0,
        }
    }
}

/// A start or noise level.
#[derive(Debug, Clone, Copy)]
pub(crate) enum LevelValue {
    Known(f64),
    /// Entry of θ.
    Parameter(usize),
}

impl LevelValue {
    /// Returns its value.
    pub fn value(self, theta: &[f64]) -> f64 {
        match self {
            Self::Known(value) => value,
            Self::Parameter(entry) => theta[entry],
        }
    }
}

/// Origin of a noise level.
#[derive(Debug, Clone, Copy)]
pub(crate) enum LevelSource {
    /// The twin.
    Declared,
    /// An entry of θ; the twin's own level, in the parameter's unit, says how it depends on time and θ.
    Fitted { entry: usize, declared: f64 },
    /// A share of an entry of θ, the level of another state.
    Follows { entry: usize, share: f64 },
}

/// Noise levels of states and outputs that a record fits.
#[derive(Debug, Clone)]
pub(crate) struct FittedLevels {
    /// Step of the study, in seconds: declared levels of states are those of an increment in it.
    pub step: f64,
    pub process: Vec<LevelSource>,
    pub measurement: Vec<LevelSource>,
}

/// A part of a composed twin. Entries of θ count held parameters, too.
#[derive(Clone)]
pub(crate) enum TwinPart {
    /// A law on signals, states, parameters or noise.
    Law(LawPart),
    /// Box of a state.
    Box { state: usize, limit: Interval },
    /// Delay of the whole twin, by the sum of these entries of θ in seconds.
    Late(Vec<usize>),
    /// Noise level of a state or an output in place of the twin's own; a state's is that of the increment in `step`.
    Level {
        is_process: bool,
        target: usize,
        level: LevelValue,
        step: f64,
    },
    /// Noise levels that a record fits.
    Levels(FittedLevels),
    /// Noise of an output that grows with its signal: |y| times this share is added to its level.
    Share { output: usize, share: LevelValue },
    /// Values of held parameters, from this entry of θ on: each run draws one list of them.
    Drawn { first: usize, values: Vec<Vec<f64>> },
    /// Noise of the sensors of a black box.
    White(SensorNoise),
    /// Start of a state, and its standard deviation.
    Start {
        state: usize,
        mean: LevelValue,
        std: f64,
    },
    /// Time that the start belongs to, on the record's own clock; `None` for that of the first row.
    Begins(Option<f64>),
    /// Standard deviation of a start for which none is declared.
    UncertainStart { state: usize, std: f64 },
    /// A disturbance, for which equations have a state more.
    Disturbance(Disturbance),
    /// Integrator and stepping in place of the twin's own.
    Steps(Integrator, Stepping),
    /// Outputs in another unit, larger by a factor.
    Unit(f64),
    /// Check before a run.
    Check(Arc<ParameterCheck>),
    /// Call before a run.
    Hook(Arc<Hook>),
}
