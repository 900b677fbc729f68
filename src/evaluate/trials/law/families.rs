//! Halves of the generator's families: one to choose constants with, one for reports.

use super::{DeparturePlace, LawFamily};
use crate::twin::Noise;
use serde::{Deserialize, Serialize};
use std::fmt;
use std::str::FromStr;

/// Seed of the split. Another one makes closed families open.
const SPLIT: u64 = 20_261_121;

/// Families of random laws that a call draws from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Families {
    /// The half that constants may be chosen on.
    Open,
    /// The half for reports.
    Closed,
    /// Both halves.
    #[default]
    All,
}

impl fmt::Display for Families {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Open => "open",
            Self::Closed => "closed",
            Self::All => "all",
        })
    }
}

impl FromStr for Families {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        [Self::Open, Self::Closed, Self::All]
            .into_iter()
            .find(|families| families.to_string() == text)
            .ok_or_else(|| format!("{text} is none of open, closed, all"))
    }
}

impl Families {
    /// Families of this half at a place. Each kind of place has half of them in either half.
    pub(in crate::evaluate::trials) fn at(self, place: DeparturePlace) -> Vec<LawFamily> {
        let mut all: Vec<(f64, LawFamily)> = (LawFamily::all().into_iter())
            .map(|family| {
                let name = format!("{family}/{}", place.kind().name());
                let lot = Noise::new(SPLIT, "families", 0).source(&name).uniform();
                (lot, family)
            })
            .collect();
        all.sort_by(|a, b| a.0.total_cmp(&b.0));
        let half = all.len() / 2;
        let all = all.into_iter().map(|(_, family)| family);
        match self {
            Self::Open => all.take(half).collect(),
            Self::Closed => all.skip(half).collect(),
            Self::All => all.collect(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn halves_share_no_family_and_leave_none_out() {
        for place in [
            DeparturePlace::State(0),
            DeparturePlace::Sensor(1),
            DeparturePlace::Actuator(0),
            DeparturePlace::Parameter(2),
        ] {
            let (open, closed) = (Families::Open.at(place), Families::Closed.at(place));
            assert_eq!((open.len(), closed.len()), (4, 4));
            assert!(open.iter().all(|family| !closed.contains(family)));
        }
        assert_eq!(
            Families::Open.at(DeparturePlace::State(0)),
            Families::Open.at(DeparturePlace::State(5))
        );
        assert!("odd".parse::<Families>().is_err());
        assert_eq!("closed".parse::<Families>(), Ok(Families::Closed));
    }
}
