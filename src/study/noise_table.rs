//! `[noise]` of a study file: one word for the process noise of all states, and levels of states and outputs.

use crate::study::error::StudyError;
use crate::twin::{DeclaredNoise, NoiseLevel, Outline, TwinError, is_memory};
use serde::de::{MapAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize};
use std::collections::{BTreeMap, BTreeSet};
use std::fmt;

/// Key of the word for all states.
const PROCESS: &str = "process";

/// Process noise of all states that have no entry of their own in a study.
///
/// ```
/// use truetwin::study::{ProcessNoise, Study};
/// use truetwin::twins::CascadedTanks;
///
/// // Fits are least squares of the free run: measurement noise explains what the twin misses.
/// let study = Study::of(CascadedTanks)?.with_process_noise(ProcessNoise::None)?;
/// # Ok::<(), truetwin::study::StudyError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum ProcessNoise {
    /// None: the twin is deterministic.
    None,
    /// Fitted to measured records around the declared level, as without a word.
    Fitted,
    /// Held as the twin or the study declares it.
    Declared,
}

/// `[noise]`.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub(crate) struct NoiseTable {
    /// The word for all states.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub process: Option<ProcessNoise>,
    /// Levels by state or output; a state's entry wins over the word.
    #[serde(flatten)]
    pub levels: BTreeMap<String, NoiseLevel>,
}

impl NoiseTable {
    pub fn is_empty(&self) -> bool {
        *self == Self::default()
    }

    /// Returns the levels with those that the word gives the states of a twin; a black box has no outline.
    pub fn entries(
        &self,
        outline: Option<&Outline>,
    ) -> Result<BTreeMap<String, NoiseLevel>, StudyError> {
        let mut all = self.levels.clone();
        let own = |outline: &Outline| {
            let mut all = outline.states.iter().chain(&outline.outputs);
            all.any(|quantity| quantity.name == PROCESS)
        };
        if let Some(NoiseLevel::Declared(level)) = all.get(PROCESS)
            && !outline.is_some_and(own)
        {
            return Err(StudyError::Adaptation(TwinError::Value {
                table: "noise",
                name: PROCESS.into(),
                value: level.std,
                remedy: "process is \"none\", \"fitted\" or \"declared\"",
            }));
        }
        let Some(word) = self.process else {
            return Ok(all);
        };
        let outline = outline.ok_or(TwinError::BlackBox("process noise"))?;
        for name in states(outline) {
            match (word, all.get(name)) {
                (ProcessNoise::None, None) => {
                    let none = DeclaredNoise::known(0.0);
                    all.insert(name.to_owned(), NoiseLevel::Declared(none));
                }
                (ProcessNoise::Declared, Some(level)) if level.is_open() => {
                    return Err(StudyError::Table(format!(
                        "noise: process = \"declared\" holds {name}, whose entry says that its level is not known; remove one"
                    )));
                }
                _ => {}
            }
        }
        Ok(all)
    }

    /// Returns the states and outputs whose level is known.
    pub fn known(&self, outline: Option<&Outline>) -> BTreeSet<String> {
        let is_known = |level: &NoiseLevel| matches!(level, NoiseLevel::Declared(l) if l.known);
        let levels = self.levels.iter().filter(|(_, level)| is_known(level));
        let own = levels.map(|(name, _)| name.as_str());
        let by_word = (outline.into_iter().flat_map(states)).filter(|name| match self.process {
            Some(ProcessNoise::None) => !self.levels.contains_key(*name),
            Some(ProcessNoise::Declared) => true,
            Some(ProcessNoise::Fitted) | None => false,
        });
        own.chain(by_word).map(str::to_owned).collect()
    }
}

/// Names of a twin's own states.
fn states(outline: &Outline) -> impl Iterator<Item = &str> {
    let names = outline.states.iter().map(|state| state.name.as_str());
    names.filter(|name| !is_memory(name))
}

/// The word, or the level of a state that bears its key's name.
#[derive(Deserialize)]
#[serde(
    untagged,
    expecting = "process is \"none\", \"fitted\" or \"declared\""
)]
enum Process {
    Word(ProcessNoise),
    Level(NoiseLevel),
}

impl<'de> Deserialize<'de> for NoiseTable {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Entries;
        impl<'de> Visitor<'de> for Entries {
            type Value = NoiseTable;

            fn expecting(&self, text: &mut fmt::Formatter<'_>) -> fmt::Result {
                text.write_str("a table of noise levels")
            }

            fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<NoiseTable, A::Error> {
                let mut table = NoiseTable::default();
                while let Some(name) = map.next_key::<String>()? {
                    if name != PROCESS {
                        table.levels.insert(name, map.next_value()?);
                        continue;
                    }
                    match map.next_value()? {
                        Process::Word(word) => table.process = Some(word),
                        Process::Level(level) => {
                            table.levels.insert(name, level);
                        }
                    }
                }
                Ok(table)
            }
        }
        deserializer.deserialize_map(Entries)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::study::{RecordPlan, Study, StudyFile};
    use crate::twin::fixture::AtOnce;
    use crate::twins::CascadedTanks;

    fn table(text: &str) -> NoiseTable {
        toml::from_str(text).unwrap()
    }

    fn tanks() -> Outline {
        crate::twin::StateSpace::outline(&CascadedTanks)
    }

    #[test]
    fn the_word_stands_among_levels() {
        for text in [
            "process = \"none\"\nh1 = 0.1\n",
            "process = 0.2\n",
            "y = \"estimate\"\n",
        ] {
            let read = table(text);
            assert_eq!(toml::to_string(&read).unwrap(), text);
        }
        assert_eq!(
            table("process = 'declared'").process,
            Some(ProcessNoise::Declared)
        );
        let error = toml::from_str::<NoiseTable>("process = 'no'").unwrap_err();
        assert!(error.message().contains("\"fitted\""), "{error}");
    }

    /// An entry wins over the word; outputs are not its business.
    #[test]
    fn the_word_speaks_for_states_without_an_entry() {
        let outline = tanks();
        let none = table("process = 'none'\nh1 = 0.1\ny = 0.2");
        let entries = none.entries(Some(&outline)).unwrap();
        assert_eq!(entries["h1"], NoiseLevel::declared(0.1));
        assert_eq!(
            entries["h2"],
            NoiseLevel::Declared(DeclaredNoise::known(0.0))
        );
        assert_eq!(entries["y"], NoiseLevel::declared(0.2));
        let names = |all: &[&str]| all.iter().map(|n| (*n).to_owned()).collect();
        assert_eq!(none.known(Some(&outline)), names(&["h2"]));
        let declared = table("process = 'declared'\nh1 = 0.1");
        assert_eq!(declared.known(Some(&outline)), names(&["h1", "h2"]));
        let fitted = table("process = 'fitted'\nh1 = { std = 0.1, known = true }");
        assert_eq!(fitted.known(Some(&outline)), names(&["h1"]));
    }

    #[test]
    fn contradictions_and_black_boxes_are_refused() {
        for entry in ["'estimate'", "{ std = 0.1, factor = 2.0 }"] {
            let both = table(&format!("process = 'declared'\nh1 = {entry}"));
            let message = both.entries(Some(&tanks())).unwrap_err().to_string();
            assert!(
                message.contains("holds h1") && !message.contains('\n'),
                "{message}"
            );
        }
        let plan = RecordPlan::levels(0.5, 60, 0.0, 3.0, 30);
        let study = Study::new("boxed", AtOnce::<1>(|a, u| a[0] * u), plan).unwrap();
        let text = "twin = 'boxed'\n[noise]\nprocess = 'none'";
        let file = StudyFile::parse(text, "s.toml".as_ref()).unwrap();
        let message = study.configure(&file).unwrap_err().to_string();
        assert!(message.starts_with("process noise needs"), "{message}");
    }
}
