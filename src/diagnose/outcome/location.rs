//! Location of a gap: in the equations, in time, in the states, by lag and by frequency.

use crate::diagnose::thresholds::Thresholds;
use serde::{Serialize, Serializer};

/// Location of a gap.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct Location {
    /// Difference between the record and simulations of the refitted twin.
    #[serde(flatten)]
    pub maps: Maps,
    /// Onset of the gap.
    pub onset: Option<Onset>,
    /// The most probable place of a structural gap.
    pub target: Option<String>,
    /// All places, most probable first.
    pub targets: Vec<TargetShare>,
    /// Equations and what each would have to gain or lose to follow the record, most probable first.
    pub equations: Vec<Equation>,
    /// The maps with the accepted effects, or else the best explanation, added.
    pub after: Option<Maps>,
}

/// A target, and how much speaks for it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TargetShare {
    /// State, `sensor`, `actuator` or parameter.
    pub target: String,
    /// Family-wise over all candidates.
    pub p_value: f64,
    /// Probability of the explanations there.
    pub share: f64,
}

/// Difference between innovations and those of simulations, cut in several ways. All p-values are corrected for all cells of all cuts
/// together; shares add up to at most one in each list. Serialised are the cells that stand out.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct Maps {
    /// Windows of time, clearest first.
    #[serde(serialize_with = "notable")]
    pub windows: Vec<Window>,
    /// Ranges of states, inputs and predicted outputs, clearest first.
    #[serde(serialize_with = "notable")]
    pub regions: Vec<Region>,
    /// Outputs, clearest first.
    #[serde(serialize_with = "notable")]
    pub channels: Vec<Channel>,
    /// Past signals that innovations still depend on, clearest first.
    #[serde(serialize_with = "notable")]
    pub lags: Vec<Lag>,
    /// Frequency bands, clearest first.
    #[serde(serialize_with = "notable")]
    pub bands: Vec<Band>,
}

/// The start of the first block of time that the twin, fitted to all before it, does not foresee.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Onset {
    /// Index of the record, from 0.
    pub record: usize,
    /// Time in seconds.
    pub time: f64,
    /// Output.
    pub channel: String,
    /// p-value of the block that begins there, corrected for all blocks.
    pub p_value: f64,
}

/// A stretch of time.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Window {
    /// First instant, in seconds.
    pub start: f64,
    /// Last instant, in seconds.
    pub end: f64,
    /// Output.
    pub channel: String,
    /// Family-wise.
    pub p_value: f64,
    /// Share in what the best explanation gains.
    pub share: f64,
    /// Index of the record, from 0.
    pub record: usize,
}

/// A range of a variable.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Region {
    /// State, input, or output as predicted.
    pub variable: String,
    /// From.
    pub low: f64,
    /// To.
    pub high: f64,
    /// Family-wise.
    pub p_value: f64,
    /// Share in what the best explanation gains, over all regions of all variables.
    pub share: f64,
}

/// One output over the whole of all records.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Channel {
    /// Output.
    pub channel: String,
    /// Family-wise.
    pub p_value: f64,
    /// Share of its innovations in what stands out.
    pub share: f64,
}

/// Dependence of an innovation on the past.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Lag {
    /// Output.
    pub channel: String,
    /// The past signal: an input, or the output itself (its own innovations).
    pub signal: String,
    /// Shortest lag, in seconds.
    pub from: f64,
    /// Longest lag, in seconds.
    pub to: f64,
    /// Family-wise.
    pub p_value: f64,
    /// Share in all squared correlations beyond what chance makes.
    pub share: f64,
}

/// A band of frequencies.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Band {
    /// Output.
    pub channel: String,
    /// In Hz.
    pub low: f64,
    /// In Hz.
    pub high: f64,
    /// Family-wise.
    pub p_value: f64,
    /// Share in all power beyond what chance makes.
    pub share: f64,
}

/// Missing term of an equation, as the smoothed disturbance there.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Equation {
    /// The state whose rate, or the output whose value, the equation gives.
    pub equation: String,
    /// Family-wise, of the disturbance's scan.
    pub p_value: f64,
    /// Probability of a disturbance there among disturbances in all equations.
    pub share: f64,
    /// Mean of the missing term by ranges of states and inputs.
    pub term: Vec<TermRange>,
}

/// The missing term where a variable is in a range.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TermRange {
    /// State or input.
    pub variable: String,
    /// From.
    pub low: f64,
    /// To.
    pub high: f64,
    /// Mean of the missing term, in the unit of the equation.
    pub mean: f64,
    /// Standard deviation of that mean, the term's correlation in time counted.
    pub std_error: f64,
}

/// One cell of a map.
pub(crate) trait Cell {
    /// Family-wise p-value.
    fn p_value(&self) -> f64;
    /// Share of what the list divides.
    fn share(&self) -> f64;
    /// Returns true where the cell stands out of simulations: p ≤ 0.1.
    fn is_notable(&self) -> bool {
        self.p_value() <= Thresholds::NOTABLE
    }
}

macro_rules! cells {
    ($($name:ty),*) => {
        $(impl Cell for $name {
            fn p_value(&self) -> f64 {
                self.p_value
            }
            fn share(&self) -> f64 {
                self.share
            }
        })*
    };
}
cells!(Window, Region, Channel, Lag, Band);

impl Maps {
    /// The maps without the cells that do not stand out.
    pub fn notable(&self) -> Self {
        fn kept<C: Cell + Clone>(cells: &[C]) -> Vec<C> {
            cells.iter().filter(|c| c.is_notable()).cloned().collect()
        }
        Self {
            windows: kept(&self.windows),
            regions: kept(&self.regions),
            channels: kept(&self.channels),
            lags: kept(&self.lags),
            bands: kept(&self.bands),
        }
    }
}

/// Writes the cells that stand out.
fn notable<C: Cell + Serialize, S: Serializer>(
    cells: &[C],
    serializer: S,
) -> Result<S::Ok, S::Error> {
    serializer.collect_seq(cells.iter().filter(|cell| cell.is_notable()))
}
