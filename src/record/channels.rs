//! Names and units of channels.

use serde::Serialize;

/// A named physical quantity with its unit.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Quantity {
    /// Name.
    pub name: String,
    /// Unit, for people.
    pub unit: String,
    /// Noun for reports, such as `upper tank`; empty where there is none.
    #[serde(skip_serializing_if = "String::is_empty")]
    pub description: String,
}

impl Quantity {
    /// `name` in `unit`.
    pub fn new(name: &str, unit: &str) -> Self {
        Self {
            name: name.into(),
            unit: unit.into(),
            description: String::new(),
        }
    }
}

/// The channels of a twin.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Signals {
    /// Inputs, in the order of a drive's columns.
    pub inputs: Vec<Quantity>,
    /// Outputs, in the order of a record's columns.
    pub outputs: Vec<Quantity>,
}

impl Default for Signals {
    fn default() -> Self {
        Self {
            inputs: vec![Quantity::new("u", "")],
            outputs: vec![Quantity::new("y", "")],
        }
    }
}

/// Column names of a record file: `u` for one channel, `u1,u2,…` for several, nothing for none.
pub(super) fn column_names(letter: &str, channels: usize) -> Vec<String> {
    match channels {
        0 => vec![],
        1 => vec![letter.into()],
        _ => (1..=channels).map(|j| format!("{letter}{j}")).collect(),
    }
}
