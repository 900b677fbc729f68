//! Settings of sealed trials, and the kinds of truth.

use super::{Families, NuisanceKind};
use crate::diagnose::Ablation;
use crate::record::Record;
use serde::{Deserialize, Serialize};
use std::fmt;

/// Settings of sealed trials.
///
/// | setting | default | meaning |
/// |---|---|---|
/// | `trials` | 100 | records |
/// | `seed` | 1 | of truths, records and diagnoses |
/// | `kinds` | all | kinds of truth, assigned in the proportions of docs/withheld.md |
/// | `nuisances` | none | nuisances of which each record has one; without a choice, half of the records have one of all |
/// | `families` | all | half of the families that random laws come from |
/// | `like` | no | a measured record whose inputs, length, step and gaps the trials have |
/// | `without` | no | whether the true effects are taken out of the library: then every trial with one must abstain |
/// | `validation` | no | whether each trial has a second record |
/// | `detection_only` | no | whether a diagnosis ends with its verdict: for false alarms over many trials |
/// | `ablated` | none | parts taken out of the diagnosis, to measure what they are worth |
/// | `steadiness` | 0 | first trials whose diagnosis is repeated with other seeds, a doubled record, other units, another order of the library |
#[derive(Debug, Clone, PartialEq)]
pub struct TrialSettings {
    /// Records.
    pub trials: usize,
    /// Seed of everything random.
    pub seed: u64,
    /// Kinds of truth.
    pub kinds: Vec<Kind>,
    /// Nuisances of which each record has one; where there are none, half of the records have one of all.
    pub nuisances: Vec<NuisanceKind>,
    /// Families of random laws.
    pub families: Families,
    /// Record whose inputs, length, step and gaps the trials have.
    pub like: Option<Record>,
    /// True if the true effects are taken out of the library.
    pub without: bool,
    /// True if each trial has a validation record.
    pub validation: bool,
    /// True if a diagnosis ends with its verdict.
    pub detection_only: bool,
    /// Parts taken out of the diagnosis.
    pub ablated: Vec<Ablation>,
    /// Number of first trials whose diagnosis is repeated.
    pub steadiness: usize,
}

impl Default for TrialSettings {
    fn default() -> Self {
        Self {
            trials: 100,
            seed: 1,
            kinds: Kind::ALL.to_vec(),
            nuisances: vec![],
            families: Families::default(),
            like: None,
            without: false,
            validation: false,
            detection_only: false,
            ablated: vec![],
            steadiness: 0,
        }
    }
}

/// Kind of truth of a trial, which decides the right answer.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Kind {
    /// Nothing, θ inside the prior: no structural gap.
    None,
    /// Nothing, θ outside the prior: no structural gap.
    Outside,
    /// A listed law: to be named.
    Listed,
    /// A listed law, its physics written otherwise: to be named.
    Otherwise,
    /// A random law: a structural gap, and none of the listed effects.
    Random,
    /// A random law of what was before, by a play or a fading mean: the same.
    Memory,
    /// Two listed laws at different places: both to be accepted.
    Pair,
    /// θ outside the prior and a listed law: to be named.
    Beside,
}

/// Names in calls and files, numbers of trials among twenty, right answers; in the order of the kinds.
#[rustfmt::skip] // One row a kind.
const TABLE: [(Kind, &str, usize, &str); 8] = [
    (Kind::None, "none", 4, "no structural gap"),
    (Kind::Outside, "outside", 3, "no structural gap; a parameter gap may be seen"),
    (Kind::Listed, "listed", 4, NAMED),
    (Kind::Otherwise, "otherwise", 2, NAMED),
    (Kind::Random, "random", 3, UNNAMED),
    (Kind::Memory, "memory", 1, UNNAMED),
    (Kind::Pair, "pair", 1, "structural, both effects and nothing false accepted"),
    (Kind::Beside, "beside", 2, NAMED),
];
const UNNAMED: &str = "structural, none of the listed effects";
const NAMED: &str = "structural, the true effect and nothing false accepted";

impl Kind {
    /// All, in the order of tables.
    pub const ALL: [Self; 8] = [
        Self::None,
        Self::Outside,
        Self::Listed,
        Self::Otherwise,
        Self::Random,
        Self::Memory,
        Self::Pair,
        Self::Beside,
    ];

    /// As in calls and files.
    pub fn id(self) -> &'static str {
        TABLE[self as usize].1
    }

    /// The kind with this id.
    pub fn named(id: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|kind| kind.id() == id)
    }

    /// The right answer, in words.
    pub(crate) fn rule(self) -> &'static str {
        TABLE[self as usize].3
    }

    /// Returns true if no θ explains the record.
    pub fn is_structural(self) -> bool {
        !matches!(self, Self::None | Self::Outside)
    }

    /// Returns true if the law is a random one.
    pub(super) fn is_random(self) -> bool {
        matches!(self, Self::Random | Self::Memory)
    }

    /// Returns true if θ lies outside the prior.
    pub(super) fn is_outside(self) -> bool {
        matches!(self, Self::Outside | Self::Beside)
    }

    /// Number of trials of this kind among twenty.
    fn weight(self) -> usize {
        TABLE[self as usize].2
    }
}

impl fmt::Display for Kind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.id())
    }
}

/// Assigns kinds to trials in the proportions of the weights and in random order: `pick` gives numbers below its argument.
pub(super) fn assign_kinds(
    kinds: &[Kind],
    trials: usize,
    mut pick: impl FnMut(usize) -> usize,
) -> Vec<Kind> {
    // Round after round, so that few trials have many kinds.
    let most = kinds.iter().map(|kind| kind.weight()).max().unwrap_or(0);
    let pack: Vec<Kind> = (0..most)
        .flat_map(|round| kinds.iter().filter(move |kind| kind.weight() > round))
        .copied()
        .collect();
    let mut assigned: Vec<Kind> = pack.into_iter().cycle().take(trials).collect();
    for i in (1..assigned.len()).rev() {
        assigned.swap(i, pick(i + 1));
    }
    assigned
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn twenty_trials_have_every_kind_by_its_weight() {
        let assigned = assign_kinds(&Kind::ALL, 40, |n| n / 2);
        for kind in Kind::ALL {
            let count = assigned.iter().filter(|k| **k == kind).count();
            assert_eq!(count, 2 * kind.weight(), "{kind}");
            assert_eq!(Kind::named(kind.id()), Some(kind));
            assert_eq!(TABLE[kind as usize].0, kind);
        }
        assert_eq!(assign_kinds(&[Kind::Pair], 3, |_| 0), [Kind::Pair; 3]);
        assert!(assign_kinds(&[], 3, |_| 0).is_empty());
    }
}
