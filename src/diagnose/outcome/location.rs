//! Location of a gap: in the equations, in time, in the states, by lag and by frequency.

use crate::diagnose::thresholds::THRESHOLDS;
use serde::{Serialize, Serializer};

/// Location of a gap.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct Location {
    /// Residuals of the refitted twin, described.
    #[serde(flatten)]
    pub maps: Maps,
    /// Time of a change, where one is what explains the records.
    pub onset: Option<Onset>,
    /// Place of the first accepted effect, or else the most probable one.
    pub target: Option<String>,
    /// Target and the other places within 3 nats of the most probable one: the records cannot tell which. Empty where there are none,
    /// and where effects at several places are accepted.
    pub class: Vec<String>,
    /// All places, most probable first.
    pub targets: Vec<TargetShare>,
    /// Missing functions of the twin alone, and on top of the accepted effects; clearest first.
    pub functions: Vec<MissingFunction>,
    /// The maps with the accepted effects, or else the best explanation, added.
    pub after: Option<Maps>,
}

/// A target, and how much speaks for it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TargetShare {
    /// State, `sensor`, `actuator` or parameter.
    pub target: String,
    /// Posterior probability of what explains the records there, given a gap.
    pub probability: f64,
}

impl TargetShare {
    /// The target and the places that the records cannot tell from it, most probable first; empty where there are none.
    pub(in crate::diagnose) fn alike(targets: &[Self], target: &str) -> Vec<String> {
        let most = targets.first().map_or(0.0, |t| t.probability);
        let least = most * (-THRESHOLDS.rivals).exp();
        let others = (targets.iter())
            .filter(|t| t.probability >= least && t.target != target)
            .map(|t| t.target.as_str());
        let class: Vec<String> = (std::iter::once(target).chain(others))
            .map(str::to_owned)
            .collect();
        if class.len() > 1 { class } else { vec![] }
    }
}

/// Innovations cut in several ways: a description, not a test. Shares add up to at most one in each list. Serialised are the cells that
/// stand out.
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

/// A change at one time.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Onset {
    /// Time in seconds.
    pub time: f64,
    /// Parameter that changes.
    pub parameter: String,
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
    /// Standard deviations above what white noise shows.
    pub score: f64,
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
    /// Standard deviations above what white noise shows.
    pub score: f64,
    /// Share in what the best explanation gains, over all regions of all variables.
    pub share: f64,
}

/// One output over the whole of all records.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Channel {
    /// Output.
    pub channel: String,
    /// Standard deviations above what white noise shows.
    pub score: f64,
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
    /// Standard deviations above what white noise shows.
    pub score: f64,
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
    /// Standard deviations above what white noise shows.
    pub score: f64,
    /// Share in all power beyond what chance makes.
    pub share: f64,
}

/// An unknown function that was fitted together with θ and noise levels.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct MissingFunction {
    /// State whose rate it joins, sensor or actuator whose signal it bends, or parameter whose logarithm it joins.
    pub place: String,
    /// State, input or signal that it depends on, or `t`.
    pub variable: String,
    /// True on top of the accepted effects; false beside the twin alone.
    pub on_top: bool,
    /// Nats over the model without it.
    pub log_evidence: f64,
    /// Values of the variable, over the range that the records show.
    pub values: Vec<f64>,
    /// The function there.
    pub mean: Vec<f64>,
    /// Its standard deviation, θ and noise levels uncertain.
    pub std_error: Vec<f64>,
}

/// One cell of a map.
pub(crate) trait Cell {
    /// Standard deviations above white noise.
    fn score(&self) -> f64;
    /// Share of what the list divides.
    fn share(&self) -> f64;
    /// Returns true where the cell stands out.
    fn is_notable(&self) -> bool {
        self.score() >= THRESHOLDS.notable
    }
}

macro_rules! cells {
    ($($name:ty),*) => {
        $(impl Cell for $name {
            fn score(&self) -> f64 {
                self.score
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_are_alike_within_three_nats_of_the_most_probable() {
        let share = |(target, probability): (&str, f64)| TargetShare {
            target: target.into(),
            probability,
        };
        let targets = [("h1", 0.6), ("h2", 0.31), ("sensor", 0.06), ("k4", 0.02)].map(share);
        assert_eq!(TargetShare::alike(&targets, "h1"), ["h1", "h2", "sensor"]);
        assert_eq!(TargetShare::alike(&targets, "h2"), ["h2", "h1", "sensor"]);
        let clear = [("h1", 0.97), ("h2", 0.03)].map(share);
        assert!(TargetShare::alike(&clear, "h1").is_empty());
    }
}
