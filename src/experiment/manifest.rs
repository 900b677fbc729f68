//! What a folder of runs is about: what another call must say to go on with it.

use super::{MonteCarlo, StoreError};
use crate::files::sha256;
use crate::study::{InputPlan, Study};
use crate::two_stage::PretrainOptions;
use serde_json::{Map, Value, json};
use std::path::Path;

/// Layout of the folder; raised when it changes.
const SCHEMA: &str = "truetwin.reproduce-folder/1";
/// Longest value that is worth showing in a message.
const SHORT: usize = 40;

/// Where the estimator of a study comes from.
#[derive(Debug, Clone, Copy)]
pub enum Origin<'a> {
    /// Trained for it, and kept in the folder.
    Trained(&'a PretrainOptions),
    /// From a file.
    File(&'a Path),
}

/// Everything that the runs in a folder depend on.
#[derive(Debug, Clone, PartialEq)]
pub struct Manifest(Map<String, Value>);

impl Manifest {
    /// Of a study of `study`; reads the estimator's file and the input file, where there are such, for their checksums.
    pub fn new(study: &Study, plan: &MonteCarlo, origin: Origin<'_>) -> Result<Self, StoreError> {
        let mut all = Map::new();
        let mut put = |key: &str, value: Value| {
            all.insert(key.into(), value);
        };
        put("schema", SCHEMA.into());
        put("version", env!("CARGO_PKG_VERSION").into());
        put("twin", study.name().into());
        put("scenario", plan.scenario.number().into());
        put("runs", plan.runs.into());
        put("seed", plan.seed.into());
        // A file that was read can be written.
        put(
            "study",
            toml::to_string(study.file()).unwrap_or_default().into(),
        );
        put("record", json!([study.plan().step, study.plan().samples]));
        if let Some(InputPlan::File(path)) = &study.plan().input {
            put("input file", checksum(path)?.into());
        }
        match origin {
            Origin::File(path) => put("estimator", checksum(path)?.into()),
            Origin::Trained(options) => {
                let preset = study.preset(options.preset);
                put("preset", options.preset.to_string().into());
                put("bank size", options.bank_size.into());
                put("epochs", options.epochs.into());
                put("training seed", options.seed.into());
                put("network", preset.architecture.id().into());
                put("features", json!(preset.features));
                put("preset settings", json!(preset.settings));
            }
        }
        Ok(Self(all))
    }

    /// As it stands in the folder.
    pub(super) fn text(&self) -> String {
        format!("{:#}\n", Value::Object(self.0.clone()))
    }

    /// From the folder's text; `None` where it is none of ours.
    pub(super) fn parse(text: &str) -> Option<Self> {
        match serde_json::from_str(text) {
            Ok(Value::Object(all)) if ours(&all) => Some(Self(all)),
            _ => None,
        }
    }

    /// What `found` says otherwise, in words; `None` where both say the same.
    pub(super) fn differs(&self, found: &Self) -> Option<String> {
        difference(&self.0, &found.0)
    }
}

/// The first thing that `there` says otherwise than `here`, in words; `None` where both say the same.
pub(crate) fn difference(here: &Map<String, Value>, there: &Map<String, Value>) -> Option<String> {
    let keys = here.keys().chain(there.keys());
    keys.map(|key| (key, there.get(key), here.get(key)))
        .find(|(_, there, here)| there != here)
        .map(|(key, there, here)| {
            let (there, here) = (shown(there), shown(here));
            match there.chars().count().max(here.chars().count()) <= SHORT {
                true => format!("{key} was {there}, now it is {here}"),
                false => format!("{key} was another"),
            }
        })
}

/// Also where the layout is another version's.
fn ours(all: &Map<String, Value>) -> bool {
    let schema = all.get("schema").and_then(Value::as_str);
    schema.is_some_and(|schema| schema.starts_with("truetwin.reproduce-folder/"))
}

fn shown(value: Option<&Value>) -> String {
    match value {
        None | Some(Value::Null) => "not given".into(),
        Some(Value::String(text)) => text.clone(),
        Some(value) => value.to_string(),
    }
}

/// SHA-256 of a file, in hexadecimal digits.
fn checksum(path: &Path) -> Result<String, StoreError> {
    let bytes = std::fs::read(path).map_err(|error| StoreError::io(path, error))?;
    Ok(sha256(&bytes))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn manifest(text: &str) -> Manifest {
        Manifest::parse(text).unwrap()
    }

    #[test]
    fn a_difference_is_named_with_both_values_where_they_are_short() {
        let head = r#"{"schema": "truetwin.reproduce-folder/1""#;
        let there = manifest(&format!(r#"{head}, "runs": 2, "network": "deep"}}"#));
        assert_eq!(there.differs(&there), None);
        let here = manifest(&format!(r#"{head}, "runs": 3, "network": "deep"}}"#));
        let difference = here.differs(&there);
        assert_eq!(difference.as_deref(), Some("runs was 2, now it is 3"));
        let here = manifest(&format!(r#"{head}, "runs": 2}}"#));
        let difference = here.differs(&there);
        assert_eq!(
            difference.as_deref(),
            Some("network was deep, now it is not given")
        );
        let long = "x".repeat(50);
        let here = manifest(&format!(r#"{head}, "runs": 2, "network": "{long}"}}"#));
        assert_eq!(here.differs(&there).as_deref(), Some("network was another"));
    }

    #[test]
    fn other_files_are_none_of_ours() {
        for text in ["", "[]", "{}", r#"{"schema": "truetwin.gap/1"}"#] {
            assert_eq!(Manifest::parse(text), None, "{text}");
        }
    }
}
