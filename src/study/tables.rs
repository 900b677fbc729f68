//! Tables of a study file.

use crate::effect::{Effect, EffectKey, EffectPattern};
use crate::equations;
use crate::feature::FeatureRecipe;
use crate::record::Columns;
use crate::setting::did_you_mean;
use crate::storage::untrusted::excerpt;
use crate::study::input_plan::PlannedInputs;
use crate::twin::{Hold, Integrator, Interval};
use serde::de::{DeserializeOwned, Error};
use serde::{Deserialize, Deserializer, Serialize};
use std::collections::BTreeMap;
use std::sync::Arc;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// `[record]`.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(
    deny_unknown_fields,
    default,
    expecting = "a table with step, samples, input, hold, integrator, substeps, tolerance or columns"
)]
pub struct RecordTable {
    /// Step in seconds.
    pub step: Option<f64>,
    /// Number of samples.
    pub samples: Option<usize>,
    /// Inputs.
    pub input: Option<PlannedInputs>,
    /// Inputs between samples, also of measured records.
    #[serde(deserialize_with = "hold_of_all")]
    pub hold: Option<Hold>,
    /// Integrator of the twin, also for measured records.
    pub integrator: Option<Integrator>,
    /// Steps of the integrator within a sample, also of measured records.
    pub substeps: Option<usize>,
    /// Largest error of an adaptive substep, as a share of a state's largest size; also of measured records.
    pub tolerance: Option<f64>,
    /// Columns of measured records that do not have the usual names.
    #[serde(skip_serializing_if = "Columns::is_empty")]
    pub columns: Columns,
}

/// Reads a rule that may be that of all inputs.
fn hold_of_all<'de, D: Deserializer<'de>>(from: D) -> Result<Option<Hold>, D::Error> {
    let Some(name) = Option::<String>::deserialize(from)? else {
        return Ok(None);
    };
    match Hold::NAMES.iter().find(|(_, own)| *own == name) {
        Some((Hold::Impulse, _)) => Err(D::Error::custom(
            "hold = \"impulse\" is of a single input; say so where the input is declared",
        )),
        Some((hold, _)) => Ok(Some(*hold)),
        None => {
            let all = Hold::NAMES
                .iter()
                .filter(|(hold, _)| *hold != Hold::Impulse);
            let all: Vec<_> = all.map(|(_, name)| format!("`{name}`")).collect();
            let name = excerpt(&name);
            Err(D::Error::custom(format!(
                "unknown value `{name}`, expected one of {}",
                all.join(", ")
            )))
        }
    }
}

impl RecordTable {
    pub fn is_empty(&self) -> bool {
        *self == Self::default()
    }

    /// Returns `true` if it says what simulated records look like.
    pub(crate) fn is_plan(&self) -> bool {
        self.step.is_some() || self.samples.is_some() || self.input.is_some()
    }
}

/// `[library]`: effects that a diagnosis may name.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Library {
    /// These alone (all if empty): ids, or `id@target`.
    #[serde(
        deserialize_with = "some_patterns",
        skip_serializing_if = "Vec::is_empty"
    )]
    pub only: Vec<EffectPattern>,
    /// Not these.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub without: Vec<EffectPattern>,
}

/// Reads a list that names something: an empty one would say *all* where it reads as *none*.
fn some_patterns<'de, D: Deserializer<'de>>(from: D) -> Result<Vec<EffectPattern>, D::Error> {
    let all = Vec::<EffectPattern>::deserialize(from)?;
    match all.is_empty() {
        true => Err(D::Error::custom(
            "only names no effect; leave it out for all of them, or name some",
        )),
        false => Ok(all),
    }
}

fn named(list: &[EffectPattern], key: &EffectKey) -> bool {
    list.iter().any(|pattern| pattern.matches(key))
}

impl Library {
    pub fn is_empty(&self) -> bool {
        *self == Self::default()
    }

    /// Returns whether a diagnosis may name this effect.
    pub fn lets(&self, key: &EffectKey) -> bool {
        (self.only.is_empty() || named(&self.only, key)) && !named(&self.without, key)
    }

    /// Returns whether all of these effects that `only` names stand in `without`, too.
    pub fn contradicts_itself(&self, effects: &[Effect]) -> bool {
        let only = (effects.iter().map(Effect::key)).filter(|key| named(&self.only, key));
        let mut only = only.peekable();
        only.peek().is_some() && only.all(|key| named(&self.without, key))
    }
}

/// Key of the flag, beside the names of parameters.
const TRUST: &str = "trust";

/// `[prior]`.
///
/// A box is where records are simulated for training. Unless it is trusted, an estimate does not lean on it.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub(crate) struct PriorTable {
    /// `true` if the parameters of every record lie in their boxes.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub trust: bool,
    /// Boxes by name; names may be dotted.
    #[serde(flatten)]
    pub boxes: BTreeMap<String, Interval>,
}

impl PriorTable {
    pub fn is_empty(&self) -> bool {
        *self == Self::default()
    }
}

impl<'de> Deserialize<'de> for PriorTable {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let mut table = toml::Table::deserialize(deserializer)?;
        // A parameter may bear the flag's name: its value is a box.
        let flag = table.get(TRUST).and_then(toml::Value::as_bool);
        if flag.is_some() {
            table.remove(TRUST);
        }
        Ok(Self {
            trust: flag.unwrap_or(false),
            boxes: flat(table)?,
        })
    }
}

/// Reads a table whose keys may be dotted: `start.h1 = …` is the key `start.h1`.
pub(super) fn dotted<'de, D: Deserializer<'de>, V: DeserializeOwned>(
    deserializer: D,
) -> Result<BTreeMap<String, V>, D::Error> {
    flat(toml::Table::deserialize(deserializer)?)
}

fn flat<V: DeserializeOwned, E: serde::de::Error>(
    table: toml::Table,
) -> Result<BTreeMap<String, V>, E> {
    let mut flat = BTreeMap::new();
    flatten("", table, &mut flat).map_err(E::custom)?;
    Ok(flat)
}

/// Adds the values of a table and its inner tables to `flat`, by dotted names.
fn flatten<V: DeserializeOwned>(
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

/// Refuses a table that neither a study nor a twin has, with its place in the text.
pub(super) fn check_tables(file: &DeTable<'_>) -> Result<(), (usize, String)> {
    let known = [&equations::TABLES[..], &TABLES[..], &["effect"]].concat();
    for key in file.keys() {
        let name: &str = key.get_ref();
        if !known.contains(&name) {
            let problem = format!(
                "unknown key `{}`{}, expected one of {}",
                excerpt(name),
                did_you_mean(name, &known),
                known.join(", ")
            );
            return Err((key.span().start, problem));
        }
    }
    Ok(())
}

/// Checks features, of whose keys the parser does not tell the place: that key is at fault without which the error is another.
pub(super) fn check_features(table: &Spanned<DeValue<'_>>) -> Result<(), (usize, String)> {
    let DeValue::Table(keys) = table.get_ref() else {
        return Ok(());
    };
    let Some(told) = features_error(keys.clone()) else {
        return Ok(());
    };
    let near_kind = |name: &str| did_you_mean(name, [KIND]);
    let kind_alone = keys.get_key_value(KIND).into_iter();
    let kind_alone = kind_alone.map(|(key, value)| (key.clone(), value.clone()));
    let is_of_kind = features_error(kind_alone.collect()).as_ref() == Some(&told);
    let is_at_fault = |name: &str| {
        let mut others = keys.clone();
        others.remove(name);
        match keys.contains_key(KIND) {
            false => !near_kind(name).is_empty(),
            true if is_of_kind => name == KIND,
            // What is missing stands nowhere.
            true => {
                name != KIND
                    && !told.starts_with("missing")
                    && features_error(others).as_ref() != Some(&told)
            }
        }
    };
    let named = told
        .split('`')
        .nth(1)
        .and_then(|name| keys.get_key_value(name));
    let fault = match named {
        Some((key, _)) if !is_of_kind => Some(key),
        _ => keys.keys().find(|key| is_at_fault(key.get_ref())),
    };
    let Some(key) = fault else {
        return Err((table.span().start, told));
    };
    let name: &str = key.get_ref();
    let problem = match keys.contains_key(KIND) {
        false => format!("unknown key `{name}`{}", near_kind(name)),
        true if told.contains(&format!("`{name}`")) || name == KIND => told,
        true => format!("{name}: {told}"),
    };
    Err((key.span().start, problem))
}

/// Returns why these keys are no features.
fn features_error(keys: DeTable<'_>) -> Option<String> {
    let keys = toml::de::Deserializer::from(Spanned::new(0..0, keys));
    let read = toml::Table::deserialize(keys)
        .and_then(|keys| <Arc<dyn FeatureRecipe>>::deserialize(toml::Value::Table(keys)));
    Some(read.err()?.message().to_owned())
}

/// Key that says which features they are.
const KIND: &str = "kind";

/// Tables of a study file.
const TABLES: [&str; 9] = [
    "record", "prior", "bounds", "fixed", "limits", "noise", "start", "features", "library",
];
/// Tables of intervals.
const INTERVALS: [&str; 3] = ["prior", "bounds", "limits"];

/// Checks that tables are tables and intervals have two ends, which a parser does not: it takes lists for tables, and what stands behind
/// two ends. Returns the byte of the first that is wrong, and the problem.
pub(super) fn check_shapes(file: &DeTable<'_>) -> Result<(), (usize, String)> {
    for name in TABLES {
        let Some(value) = file.get(name) else {
            continue;
        };
        match value.get_ref() {
            DeValue::Table(table) => check_table(name, table)?,
            _ => {
                let problem = format!("{name} is a table; write [{name}], and its keys below");
                return Err((value.span().start, problem));
            }
        }
    }
    Ok(())
}

/// Returns whether a key of a table has a number.
fn is_number(table: &str, key: &str) -> bool {
    table == "record" && matches!(key, "step" | "samples" | "substeps" | "tolerance")
}

/// Returns whether a key of a table may have the path of a file.
fn is_file(table: &str, key: &str) -> bool {
    table == "input" || table == "record" && key == "input"
}

fn check_table(name: &str, table: &DeTable<'_>) -> Result<(), (usize, String)> {
    let keeps_intervals = INTERVALS.contains(&name);
    for (key, value) in table {
        let key = key.get_ref();
        let problem = match value.get_ref() {
            DeValue::Table(inner) if inner.is_empty() && name == "input" => {
                "has no plan; give a number, a file, or { levels = [low, high], hold = n }"
            }
            DeValue::Table(inner) if inner.is_empty() && name == "record" && key == "input" => {
                "has no plan; give { levels = [low, high], hold = n } or a file, or remove it if the twin has no input"
            }
            DeValue::Table(inner) if inner.is_empty() && is_number(name, key) => {
                "has no value; write a number"
            }
            DeValue::Table(inner) if inner.is_empty() && name != "features" => {
                "is empty; remove it"
            }
            DeValue::String(path) if path.is_empty() && is_file(name, key) => {
                "names no file; write its path"
            }
            DeValue::Table(inner) if keeps_intervals || matches!(name, "fixed" | "record") => {
                let own = match (name, &**key) {
                    ("record", "input") => "input",
                    ("record", "columns") => "columns",
                    (name, _) => name,
                };
                check_table(own, inner)?;
                continue;
            }
            DeValue::Datetime(_) if matches!(name, "record" | "input") => {
                "is no date; write a number, or a text in quotes"
            }
            // A parameter may have that name, too.
            value if name == "prior" && key == TRUST && !(value.is_bool() || value.is_array()) => {
                "is true or false"
            }
            DeValue::Array(ends) if keeps_intervals && ends.len() != 2 => {
                "has two ends: write [low, high]"
            }
            DeValue::Array(_) if name == "noise" => {
                "is no list; give a standard deviation, or { std = .., known = true }"
            }
            DeValue::Array(_) if name == "start" => {
                "is no list; give a value, { value = .., at = .. }, { mean = .., std = .. }, or \"estimate\""
            }
            _ => continue,
        };
        let (table, within) = match name {
            "input" => ("record", " input"),
            _ => (name, ""),
        };
        let problem = format!("[{table}]{within} {key} {problem}");
        return Err((value.span().start, problem));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_flag_stands_among_the_boxes() {
        let text = "trust = true\nk1 = [0.1, 0.5]\n\"start.h1\" = [0.0, 2.0]\n";
        let table: PriorTable = toml::from_str(text).unwrap();
        assert!(table.trust && table.boxes.len() == 2);
        let again: PriorTable = toml::from_str(&toml::to_string(&table).unwrap()).unwrap();
        assert_eq!(again, table);
        let parameter: PriorTable = toml::from_str("trust = [0.0, 1.0]").unwrap();
        assert!(!parameter.trust && parameter.boxes.contains_key(TRUST));
        let wrong = toml::from_str::<PriorTable>("trust = 'yes'").unwrap_err();
        assert!(wrong.to_string().contains(TRUST), "{wrong}");
    }

    #[test]
    fn lists_are_no_tables_and_intervals_have_two_ends() {
        for (text, part) in [
            ("record = [0.5, 80]", "write [record]"),
            ("[limits]\nh1 = [0, 5, 'x']", "[limits] h1 has two ends"),
            ("[prior]\nstart.h1 = [1.0]", "[prior] h1 has two ends"),
            ("[prior]\ntrust = 'yes'", "[prior] trust is true or false"),
            ("[prior]\nk1 = {}", "[prior] k1 is empty"),
            ("[start]\nh1 = [1, 2]", "[start] h1 is no list"),
            ("[noise]\nh1 = [0.1, true]", "[noise] h1 is no list"),
        ] {
            let (_, problem) = check_shapes(DeTable::parse(text).unwrap().get_ref()).unwrap_err();
            assert!(problem.contains(part), "{problem}");
        }
        let fine = "[prior]\nk1 = [0, 1]\nstart.h1 = [0, 1]\ntrust = true\n[noise]\nh1 = { std = 0.1 }\n[features]\nkind = 'score'";
        assert_eq!(
            check_shapes(DeTable::parse(fine).unwrap().get_ref()),
            Ok(())
        );
    }
}
