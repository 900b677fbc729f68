//! Fitted noise levels: what is declared, or guessed from the records.

use crate::effect::stops;
use crate::record::{Quantity, Record};
use crate::twin::{
    Composed, FittedLevels, Interval, LevelSource, LevelValue, Outline, Parameter, Role, Twin,
    TwinPart, is_memory,
};
use std::collections::{BTreeMap, BTreeSet};

numbers! {
    /// Guesses of noise and starts that nothing is declared of, and when a declared start is doubted.
    pub(super) const MEASURED: MeasuredLimits = {
        /// Standard deviation of the logarithm of a level that nothing is declared of: within a factor of 50 at two of them. Half of it ties
        /// rigs to this file's guesses of size; twice costs a nat a level, for all explanations alike.
        undeclared: f64 = 2.0,
        /// Guess of an undeclared process noise: over the record, a random walk of this share of the state's own motion.
        wander: f64 = 0.1,
        /// Guess of an undeclared measurement noise, as a share of the output's deviation.
        share: f64 = 0.03,
        /// Loud noise, from which fits begin: a step of this share of the state's own motion. Predictions then hardly reach beyond a row,
        /// and the likelihood has no narrow valleys.
        loud: f64 = 0.1,
        /// Range of a fitted level, as powers of e around its guess: rounding at one end, nonsense at the other.
        range: f64 = 12.0,
        /// Least measurement noise of outputs that stop at an end of their range, as a share of their motion: where the twin stops there, too,
        /// noise that vanishes would make those samples infinitely likely.
        stopped: f64 = 1e-3,
        /// Distance of the first row from the start, in deviations of the noise, beyond which the record began elsewhere. At half of it a right start is
        /// given up in one of eighty records; at twice of it a wrong one of ten deviations is believed.
        elsewhere: f64 = 5.0,
        /// Nats by which records must be better explained with a start that their first rows contradict for it to stand: something is then missing that bends
        /// these rows, with prior odds of 1 to 20. With twice of it an offset of a sensor, better by 5.8, passes for a force.
        stands: f64 = 3.0,
    }
}

/// Largest share of its signal that noise may be: what says less of its signal is no reading of it. Half of it leaves out counts of few
/// events; twice as much changes no answer.
pub(crate) const LARGEST_SHARE: f64 = 0.5;
/// Ending of the name of a share, behind that of its output.
const SUFFIX: &str = ".share";

/// A study's word on noise levels and starts.
#[derive(Debug, Clone, Default)]
pub(crate) struct Beliefs {
    /// Step of the study, in seconds: declared levels of states are those of an increment in it.
    pub step: f64,
    /// States and outputs whose noise is known.
    pub known: BTreeSet<String>,
    /// Factors that one standard deviation of a declared level is; e where none is given.
    pub factors: BTreeMap<String, f64>,
    /// States whose start is declared.
    pub starts: BTreeSet<String>,
    /// Those of them that are not quite known.
    pub wide: BTreeSet<String>,
    /// States whose start is to be estimated, whatever the code says.
    pub estimated: BTreeSet<String>,
    /// `true` where the code's word on starts stands, whatever the first rows say.
    pub trusts_code: bool,
    /// Magnitudes of effects of the study, by their names in θ, where each effect is off.
    pub off: BTreeMap<String, f64>,
}

/// An output whose first value is not that of the start.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct StartElsewhere {
    /// Index of the record.
    pub record: usize,
    /// The output.
    pub output: Quantity,
    /// Its first value.
    pub value: f64,
    /// The value nearest to it that the start allows.
    pub expected: f64,
    /// States whose start is then unknown.
    pub states: Vec<String>,
}

/// Sizes of what a record shows, from which levels are guessed.
pub(super) struct RecordSizes {
    /// Motion of each state.
    pub states: Vec<f64>,
    /// Deviation of each output.
    pub outputs: Vec<f64>,
    /// Standard deviation of each start that is unknown.
    pub starts: Vec<Option<f64>>,
    /// Noise that is declared.
    pub declared: DeclaredLevels,
}

/// A fitted noise level.
#[derive(Debug, Clone)]
pub(crate) struct Level {
    pub parameter: Parameter,
    /// `true` for a state's.
    pub is_process: bool,
    /// Level that is declared, in the parameter's unit.
    pub declared: Option<f64>,
    /// Median before the record is seen.
    pub median: f64,
    /// Standard deviation of its logarithm.
    pub deviation: f64,
    /// Where fits begin.
    pub loud: f64,
}

/// A twin with noise levels in θ, behind its own parameters.
#[derive(Clone)]
pub(crate) struct Measured {
    pub twin: Twin,
    pub levels: Vec<Level>,
    /// `true` for a black box without noise of its own: its run is its prediction.
    pub is_silent: bool,
    /// A start that was said, and is not that of these records.
    pub elsewhere: Option<StartElsewhere>,
}

impl Measured {
    /// All of θ with loud noise, from the twin's own.
    pub(super) fn begun_loud(&self, theta: &[f64]) -> Vec<f64> {
        let levels = self.levels.iter().map(|level| level.loud);
        theta.iter().copied().chain(levels).collect()
    }
}

/// Noise levels that a twin declares, of states for an increment in a step of the study, and of outputs.
#[derive(Debug, Clone)]
pub(super) struct DeclaredLevels {
    pub process: Vec<f64>,
    pub measurement: Vec<f64>,
}

/// Prior and bounds of a level, no lower than `floor`.
fn ranges(median: f64, deviation: f64, floor: f64) -> [Interval; 2] {
    [deviation, MEASURED.range].map(|reach| {
        let low = (median / reach.exp()).max(floor);
        Interval::unchecked(low, median * reach.exp())
    })
}

/// The twin with these sizes of states and outputs.
pub(super) fn build(
    base: &Composed,
    outline: &Outline,
    records: &[Record],
    beliefs: &Beliefs,
    sizes: &RecordSizes,
) -> Measured {
    let RecordSizes {
        states: motion,
        outputs,
        declared,
        starts: widths,
    } = sizes;
    let (n, p) = (outline.states.len(), outline.outputs.len());
    let mut noisy = FittedLevels {
        step: beliefs.step,
        process: vec![LevelSource::Declared; n],
        measurement: vec![LevelSource::Declared; p],
    };
    let mut starts = vec![];
    let twin = Twin::Equations(base.clone());
    let step = records[0].drive().dt();
    let longest = records.iter().map(Record::samples).max().unwrap_or(1) as f64 * step;
    let mut levels = Vec::new();
    let mut add = |name: &str, unit: String, floor: f64, declared: f64, guess: f64, loud: f64| {
        let is_process = floor == 0.0;
        let role_name = Role::Noise.name(name);
        if beliefs.known.contains(name) || outline.parameters.position(&role_name).is_ok() {
            return None;
        }
        let (median, deviation) = if declared > 0.0 {
            (declared, beliefs.factors.get(name).map_or(1.0, |f| f.ln()))
        } else {
            (guess, MEASURED.undeclared)
        };
        // The least level that the record can tell stands for a declared one below it.
        let median = median.max(floor);
        let [prior, bounds] = ranges(median, deviation, floor);
        let parameter = Parameter {
            name: role_name,
            unit,
            prior,
            bounds,
            role: Role::Noise,
        };
        levels.push(Level {
            parameter,
            is_process,
            declared: (declared > 0.0).then_some(declared),
            median,
            deviation,
            loud: bounds.clamp(loud.max(median)),
        });
        Some(twin.entries() + levels.len() - 1)
    };
    for (i, state) in outline.states.iter().enumerate() {
        if is_memory(&state.name) {
            continue;
        }
        let unit = if state.unit.is_empty() {
            "1/√s".to_owned()
        } else {
            format!("{}/√s", state.unit)
        };
        let declared = declared.process[i] / beliefs.step.sqrt();
        let guess = MEASURED.wander * motion[i] / longest.sqrt();
        let loud = MEASURED.loud * motion[i] / step.sqrt();
        if let Some(entry) = add(&state.name, unit, 0.0, declared, guess, loud) {
            noisy.process[i] = LevelSource::Fitted { entry, declared };
        }
        if let Some(std) = widths[i] {
            starts.push(TwinPart::UncertainStart { state: i, std });
        }
    }
    for (j, output) in outline.outputs.iter().enumerate() {
        let (guess, loud) = (MEASURED.share * outputs[j], MEASURED.loud * outputs[j]);
        let unit = output.unit.clone();
        let stops = records
            .iter()
            .any(|r| stops(&r.outputs().column(j).to_vec()));
        let floor = if stops {
            MEASURED.stopped * outputs[j]
        } else {
            f64::MIN_POSITIVE
        };
        let declared = declared.measurement[j];
        if let Some(entry) = add(&output.name, unit, floor, declared, guess, loud) {
            noisy.measurement[j] = LevelSource::Fitted { entry, declared };
        }
    }
    let parameters = levels.iter().map(|level| level.parameter.clone());
    starts.push(TwinPart::Levels(noisy));
    Measured {
        twin: twin.with(parameters, starts),
        levels,
        is_silent: false,
        elsewhere: None,
    }
}

/// Returns the twin with noise of an output that grows with its signal, θ longer by the share.
///
/// ```text
/// r_j = level + share·|y_j|
/// ```
pub(crate) fn with_share(twin: &Twin, output: usize) -> Twin {
    let name = share_name(&twin.signals().outputs[output].name);
    let share = Parameter::new(&Role::Noise.name(&name), "1", 0.0, 0.1)
        .within(0.0, LARGEST_SHARE)
        .with_role(Role::Noise);
    let part = TwinPart::Share {
        output,
        share: LevelValue::Parameter(twin.entries()),
    };
    twin.with([share], vec![part])
}

/// Returns the name of the share of an output's noise, `y.share`.
pub(crate) fn share_name(output: &str) -> String {
    format!("{output}{SUFFIX}")
}
