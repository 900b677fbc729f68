//! Fitted noise levels: what is declared, or guessed from the records.

use crate::effect::stops;
use crate::likelihood::kalman::{FilterSettings, STOPPED};
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
        /// States up to which each has a level of its own. More share one factor: a record tells few levels of many hidden states, and each costs
        /// a pass of every score. Half of it ties models of five states; twice makes fits of sixteen states three times as long.
        apart: usize = 8,
        /// Guess of an undeclared process noise: over the record, a random walk of this share of the state's own motion.
        wander: f64 = 0.1,
        /// Guess of an undeclared measurement noise, as a share of the output's deviation.
        share: f64 = 0.03,
        /// Loud noise, from which fits begin: a step of this share of the state's own motion. Predictions then hardly reach beyond a row,
        /// and the likelihood has no narrow valleys.
        loud: f64 = 0.1,
        /// Range of a fitted level, as powers of e around its guess: rounding at one end, nonsense at the other.
        range: f64 = 12.0,
        /// Rows of a record that tell sizes of states and levels of noise, at most, evenly spread: a median of so many is right to a hundredth of a
        /// deviation. Half as many change guesses by less than their prior is wide; twice as many take their memory.
        sized_rows: usize = 10_000,
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
    /// States whose start is then unknown, or that is declared and stands.
    pub states: Vec<String>,
    /// `true` where it stands.
    pub is_held: bool,
}

impl StartElsewhere {
    /// Returns whether a first row is explained, by its residual in deviations of the noise.
    pub fn is_explained_at(residual: f64) -> bool {
        residual.abs() <= MEASURED.elsewhere
    }
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
    /// Further states whose level is in proportion.
    pub following: Vec<FollowingLevel>,
}

/// A level in proportion to that of another state.
#[derive(Debug, Clone)]
pub(crate) struct FollowingLevel {
    pub state: String,
    pub unit: String,
    /// Level that is declared, in this unit.
    pub declared: Option<f64>,
    /// This level over the other.
    pub share: f64,
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

/// Belief in a level before the records are seen.
struct Guess<'a> {
    name: &'a str,
    unit: String,
    /// Least level that the records can tell.
    floor: f64,
    /// Zero where nothing is declared.
    declared: f64,
    /// Used where nothing is declared.
    guessed: f64,
    loud: f64,
}

impl Guess<'_> {
    fn median(&self) -> f64 {
        let is_declared = self.declared > 0.0;
        let median = if is_declared {
            self.declared
        } else {
            self.guessed
        };
        // The least level that the record can tell stands for a declared one below it.
        median.max(self.floor)
    }

    /// The level as a parameter, of a state or of an output.
    fn level(&self, beliefs: &Beliefs, is_process: bool) -> Level {
        let (declared, median) = (self.declared_level(), self.median());
        let deviation = match declared {
            Some(_) => beliefs.factors.get(self.name).map_or(1.0, |f| f.ln()),
            None => MEASURED.undeclared,
        };
        let [prior, bounds] = ranges(median, deviation, self.floor);
        let parameter = Parameter {
            name: Role::Noise.name(self.name),
            unit: self.unit.clone(),
            prior,
            bounds,
            role: Role::Noise,
        };
        Level {
            parameter,
            is_process,
            declared,
            median,
            deviation,
            loud: bounds.clamp(self.loud.max(median)),
            following: vec![],
        }
    }

    fn declared_level(&self) -> Option<f64> {
        (self.declared > 0.0).then_some(self.declared)
    }
}

/// The state that each of many takes its level from, by index: of those declared, or of the others, the one with the largest level. A state
/// whose factor the study says has its own.
fn leaders(guesses: &[Option<Guess<'_>>], beliefs: &Beliefs) -> Vec<Option<usize>> {
    if guesses.iter().flatten().count() <= MEASURED.apart {
        return vec![None; guesses.len()];
    }
    let is_tied = |guess: &&Guess<'_>| !beliefs.factors.contains_key(guess.name);
    let tied = |i: usize| guesses[i].as_ref().filter(is_tied);
    let leader = |declared: bool| {
        let of_kind = |i: &usize| tied(*i).is_some_and(|g| (g.declared > 0.0) == declared);
        let median = |i: &usize| guesses[*i].as_ref().map_or(0.0, Guess::median);
        let all = (0..guesses.len()).filter(of_kind);
        all.max_by(|a, b| median(a).total_cmp(&median(b)))
    };
    let leaders = [false, true].map(leader);
    (0..guesses.len())
        .map(|i| leaders[usize::from(tied(i)?.declared > 0.0)].filter(|leader| *leader != i))
        .collect()
}

/// Beliefs in the levels of states, and of outputs; none where a level is known, or a parameter of the twin's own.
fn guesses<'a>(
    outline: &'a Outline,
    records: &[Record],
    beliefs: &Beliefs,
    sizes: &RecordSizes,
) -> [Vec<Option<Guess<'a>>>; 2] {
    let step = records[0].drive().dt();
    let longest = records.iter().map(Record::samples).max().unwrap_or(1) as f64 * step;
    let is_fitted = |name: &str| {
        let has_own = outline.parameters.position(&Role::Noise.name(name)).is_ok();
        !beliefs.known.contains(name) && !has_own
    };
    let of_state = |i: usize| {
        let (state, motion) = (&outline.states[i], sizes.states[i]);
        let unit = state.unit.as_str();
        let guess = || Guess {
            name: &state.name,
            unit: format!("{}/√s", if unit.is_empty() { "1" } else { unit }),
            floor: 0.0,
            declared: sizes.declared.process[i] / beliefs.step.sqrt(),
            guessed: MEASURED.wander * motion / longest.sqrt(),
            loud: MEASURED.loud * motion / step.sqrt(),
        };
        (!is_memory(&state.name) && is_fitted(&state.name)).then(guess)
    };
    let settings = FilterSettings::default();
    let all: Vec<Vec<f64>> = records.iter().map(|r| settings.floors(r)).collect();
    // Below it, filters take all levels for the same. A record without values of an output says nothing of it.
    let floor = |j: usize| {
        let of_records = (records.iter().zip(&all))
            .filter(|(record, _)| record.outputs().column(j).iter().any(|y| y.is_finite()))
            .map(|(_, floors)| floors[j].sqrt());
        of_records.reduce(f64::min).unwrap_or(f64::MIN_POSITIVE)
    };
    let of_output = |j: usize| {
        let (output, size) = (&outline.outputs[j], sizes.outputs[j]);
        let has_end = |record: &Record| stops(&record.outputs().column(j).to_vec());
        let guess = || Guess {
            name: &output.name,
            unit: output.unit.clone(),
            floor: match records.iter().any(has_end) {
                // Where the twin stops there, too, noise that vanishes would make those samples infinitely likely.
                true => STOPPED * size,
                false => floor(j).max(f64::MIN_POSITIVE),
            },
            declared: sizes.declared.measurement[j],
            guessed: MEASURED.share * size,
            loud: MEASURED.loud * size,
        };
        is_fitted(&output.name).then(guess)
    };
    [
        (0..outline.states.len()).map(of_state).collect(),
        (0..outline.outputs.len()).map(of_output).collect(),
    ]
}

/// The twin with these sizes of states and outputs.
pub(super) fn build(
    base: &Composed,
    outline: &Outline,
    records: &[Record],
    beliefs: &Beliefs,
    sizes: &RecordSizes,
) -> Measured {
    let [states, outputs] = guesses(outline, records, beliefs, sizes);
    let leaders = leaders(&states, beliefs);

    let twin = Twin::Equations(base.clone());
    let first = twin.entries();
    let mut levels: Vec<Level> = vec![];
    let mut fitted = |guess: &Option<Guess<'_>>, is_process: bool| match guess {
        None => LevelSource::Declared,
        Some(guess) => {
            levels.push(guess.level(beliefs, is_process));
            LevelSource::Fitted {
                entry: first + levels.len() - 1,
                declared: guess.declared,
            }
        }
    };
    let mut process: Vec<LevelSource> = (states.iter().zip(&leaders))
        .map(|(guess, leader)| match leader {
            None => fitted(guess, true),
            Some(_) => LevelSource::Declared,
        })
        .collect();
    let measurement = outputs.iter().map(|guess| fitted(guess, false)).collect();
    for (i, (guess, leader)) in states.iter().zip(leaders).enumerate() {
        let Some((guess, leader)) = guess.as_ref().zip(leader) else {
            continue;
        };
        if let LevelSource::Fitted { entry, declared } = process[leader] {
            let level = &mut levels[entry - first];
            let share = guess.median() / level.median;
            level.following.push(FollowingLevel {
                state: guess.name.to_owned(),
                unit: guess.unit.clone(),
                declared: guess.declared_level(),
                share,
            });
            process[i] = match declared > 0.0 {
                true => LevelSource::Fitted { entry, declared },
                false => LevelSource::Follows { entry, share },
            };
        }
    }
    let widths = sizes.starts.iter().enumerate();
    let starts = widths.filter_map(|(state, std)| {
        let is_memory = is_memory(&outline.states[state].name);
        let std = std.filter(|_| !is_memory)?;
        Some(TwinPart::UncertainStart { state, std })
    });
    let noisy = TwinPart::Levels(FittedLevels {
        step: beliefs.step,
        process,
        measurement,
    });
    let parameters = levels.iter().map(|level| level.parameter.clone());
    Measured {
        twin: twin.with(parameters, starts.chain([noisy]).collect()),
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
