//! The table `[prior]` of a study file: boxes of parameters, and whether they are to be trusted.

use crate::twin::Interval;
use serde::{Deserialize, Deserializer, Serialize};
use std::collections::BTreeMap;

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
        let trust = match table.get(TRUST) {
            Some(toml::Value::Boolean(trust)) => Some(*trust),
            _ => None,
        };
        if trust.is_some() {
            table.remove(TRUST);
        }
        let mut boxes = BTreeMap::new();
        flatten("", table, &mut boxes).map_err(serde::de::Error::custom)?;
        Ok(Self {
            trust: trust.unwrap_or(false),
            boxes,
        })
    }
}

/// Adds the values of a table and its inner tables to `flat`, by dotted names.
pub(super) fn flatten<V: serde::de::DeserializeOwned>(
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
}
