//! The study file: a twin in the user's own setting.

use crate::effect::{EffectEntry, EffectPattern};
use crate::feature::FeatureRecipe;
use crate::record::read_drive;
use crate::storage::files::folder;
use crate::storage::untrusted::{MESSAGE, check_names, one_line, read_text};
use crate::study::error::StudyError;
use crate::study::plan::InputPlan;
use crate::twin::{Interval, Level};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

/// Longest study file, in bytes: a hundred times one that names every parameter and effect.
const MOST: u64 = 1 << 20;

/// Content of a study file; everything but `twin` is optional, unknown keys are refused.
///
/// ```toml
/// twin = "tanks"
/// [record]
/// step = 4.0
/// samples = 1024
/// input = { levels = [0.5, 6.0], hold = 25 }   # or a file: "U.csv"
/// [prior]
/// k1 = [0.01, 0.1]
/// start.h1 = [0.0, 10.0]
/// [bounds]
/// k1 = [0.001, 1.0]
/// [fixed]
/// k4 = 1.0
/// [limits]
/// h1 = [0.0, 10.0]
/// [noise]
/// h1 = 0.0          # standard deviation of the increment a step
/// y = "estimate"    # or a standard deviation
/// [start]
/// h1 = "estimate"   # or a value
/// [features]
/// kind = "deviation"
/// blocks = 64
/// [[effect]]
/// id = "sensor-lag"
/// target = "sensor"
/// magnitudes = { tau = 3.0 }                   # what is not given is estimated
/// ```
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct StudyFile {
    /// Name of the twin.
    pub twin: String,
    /// Step, length and input of simulated records.
    #[serde(skip_serializing_if = "RecordTable::is_empty")]
    pub record: RecordTable,
    /// Prior boxes.
    #[serde(
        skip_serializing_if = "BTreeMap::is_empty",
        deserialize_with = "dotted"
    )]
    pub prior: BTreeMap<String, Interval>,
    /// Physical bounds.
    #[serde(
        skip_serializing_if = "BTreeMap::is_empty",
        deserialize_with = "dotted"
    )]
    pub bounds: BTreeMap<String, Interval>,
    /// Parameters that are known.
    #[serde(
        skip_serializing_if = "BTreeMap::is_empty",
        deserialize_with = "dotted"
    )]
    pub fixed: BTreeMap<String, f64>,
    /// Limits of states.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub limits: BTreeMap<String, Interval>,
    /// Noise of states and outputs.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub noise: BTreeMap<String, Level>,
    /// Starts of states.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub start: BTreeMap<String, Level>,
    /// Features, in place of the preset's.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub features: Option<Arc<dyn FeatureRecipe>>,
    /// Effects added to the twin.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub effect: Vec<EffectEntry>,
    /// Which effects a diagnosis may name.
    #[serde(skip_serializing_if = "Library::is_empty")]
    pub library: Library,
}

/// `[record]`.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct RecordTable {
    /// Step in seconds.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub step: Option<f64>,
    /// Number of samples.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub samples: Option<usize>,
    /// Inputs.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub input: Option<InputPlan>,
}

impl RecordTable {
    fn is_empty(&self) -> bool {
        *self == Self::default()
    }
}

/// `[library]`: effects that a diagnosis may name.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Library {
    /// These alone (all if empty): ids, or `id@target`.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub only: Vec<EffectPattern>,
    /// Not these.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub without: Vec<EffectPattern>,
}

impl Library {
    fn is_empty(&self) -> bool {
        *self == Self::default()
    }
}

impl StudyFile {
    /// Reads a study file. A relative input file is looked for beside it; its step and length become the study's.
    pub fn read(path: &Path) -> Result<Self, StudyError> {
        let text = read_text(path, MOST).map_err(|error| StudyError::Io {
            path: path.into(),
            error,
        })?;
        let mut file = Self::parse(&text, path)?;
        let record = &mut file.record;
        if let Some(InputPlan::File(input)) = &mut record.input {
            *input = folder(path).join(&*input);
            let drive = read_drive(input)?;
            let (step, samples) = (drive.dt(), drive.samples());
            let other = record.step.is_some_and(|s| (s - step).abs() > 1e-3 * step)
                || record.samples.is_some_and(|n| n != samples);
            if other {
                return Err(StudyError::Plan(format!(
                    "{}: [record] contradicts {}, which has {samples} samples, step {step} s; leave step and samples out",
                    path.display(),
                    input.display()
                )));
            }
            (record.step, record.samples) = (Some(step), Some(samples));
        }
        Ok(file)
    }

    /// Parses the text of a study file; `path` is for messages.
    pub fn parse(text: &str, path: &Path) -> Result<Self, StudyError> {
        let wrong = |line, message: &str| StudyError::Syntax {
            path: path.into(),
            line,
            message: one_line(message, MESSAGE),
        };
        // Not every text comes from a file of its own: an estimator holds one, too.
        if text.len() as u64 > MOST {
            return Err(wrong(1, &format!("more than {} MiB of text", MOST >> 20)));
        }
        let syntax = |error: toml::de::Error| {
            let at = error.span().map_or(0, |span| span.start);
            let before = text.bytes().take(at);
            wrong(before.filter(|b| *b == b'\n').count() + 1, error.message())
        };
        let file = toml::from_str(text).map_err(syntax)?;
        let table = toml::from_str(text).map_err(syntax)?;
        check_names(&table).map_err(|problem| wrong(1, &problem))?;
        Ok(file)
    }
}

/// A table whose keys may be dotted: `start.h1 = …` is the key `start.h1`.
fn dotted<'de, D, V>(deserializer: D) -> Result<BTreeMap<String, V>, D::Error>
where
    D: serde::Deserializer<'de>,
    V: serde::de::DeserializeOwned,
{
    let table = toml::Table::deserialize(deserializer)?;
    let mut flat = BTreeMap::new();
    flatten("", table, &mut flat).map_err(serde::de::Error::custom)?;
    Ok(flat)
}

fn flatten<V: serde::de::DeserializeOwned>(
    prefix: &str,
    table: toml::Table,
    flat: &mut BTreeMap<String, V>,
) -> Result<(), String> {
    for (key, value) in table {
        let key = format!("{prefix}{key}");
        match value {
            toml::Value::Table(inner) => flatten(&format!("{key}."), inner, flat)?,
            value => {
                let value = V::deserialize(value).map_err(|e| format!("{key}: {}", e.message()))?;
                flat.insert(key, value);
            }
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(text: &str) -> Result<StudyFile, String> {
        StudyFile::parse(text, Path::new("s.toml")).map_err(|e| e.to_string())
    }

    #[test]
    fn every_table_is_read_and_written_again() {
        let text = r#"
            twin = "tanks"
            [record]
            step = 4
            samples = 1024
            input = { levels = [0.5, 6.0], hold = 25 }
            [prior]
            k1 = [0.01, 0.1]
            start.h1 = [0, 10]
            [fixed]
            k4 = 1
            [limits]
            h1 = [0, inf]
            [noise]
            h1 = 0
            y = "estimate"
            [start]
            h1 = "estimate"
            h2 = 5.2
            [features]
            kind = "arx"
            outputs = 4
            inputs = 8
            [library]
            without = ["sensor-lag"]
        "#;
        let file = parse(text).unwrap();
        assert_eq!(file.prior["start.h1"], Interval::new(0.0, 10.0).unwrap());
        assert_eq!(file.noise["y"], Level::Estimate);
        assert_eq!(file.start["h2"], Level::Known(5.2));
        let again = parse(&toml::to_string(&file).unwrap()).unwrap();
        assert_eq!(format!("{file:?}"), format!("{again:?}"));
    }

    #[test]
    fn messages_are_one_line_with_the_place() {
        for (text, expected) in [
            (
                "twin = 'tanks'\nstep = 1\n",
                "s.toml, line 2: unknown field `step`",
            ),
            (
                "twin = 'tanks'\n[prior]\nk1 = [0.8, 0.4]\n",
                "invalid interval",
            ),
            ("twin = 'x'\n[features]\nkind = 'arma'\n", "`arx`"),
            ("twin = \n", "s.toml, line 1"),
            ("twin = 'x'\n[noise]\ny = 'guess'\n", "s.toml, line 3"),
        ] {
            let message = parse(text).unwrap_err();
            assert!(message.contains(expected), "{message}");
            assert!(!message.contains('\n'), "{message}");
        }
    }
}
