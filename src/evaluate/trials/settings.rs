//! Settings of sealed trials.

use super::{Families, Kind};
use crate::diagnose::Ablation;
use crate::record::Record;

/// Most trials of a folder; their keys are in memory.
pub(crate) const MOST: usize = 1_000_000;

/// Settings of sealed trials.
///
/// | setting | default | meaning |
/// |---|---|---|
/// | `trials` | 100 | records |
/// | `seed` | 1 | of truths, records and diagnoses |
/// | `kinds` | all | kinds of truth, assigned in the proportions of docs/withheld.md |
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
