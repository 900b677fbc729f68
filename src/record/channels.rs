//! Channels of a twin, and the columns of a file that hold them.

use crate::setting::did_you_mean;
use crate::storage::untrusted::{excerpt, quoted};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::str::FromStr;

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

    /// Unit of its rate of change.
    pub(crate) fn rate_unit(&self) -> String {
        match self.unit.as_str() {
            "" | "-" | "1" => "1/s".into(),
            unit if unit.chars().all(char::is_alphanumeric) => format!("{unit}/s"),
            unit => format!("({unit})/s"),
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
pub(crate) fn column_names(letter: &str, channels: usize) -> Vec<String> {
    match channels {
        0 => vec![],
        1 => vec![letter.into()],
        _ => (1..=channels).map(|j| format!("{letter}{j}")).collect(),
    }
}

/// Columns of a record file with so many channels.
pub(super) fn columns(inputs: usize, outputs: usize) -> Vec<String> {
    let time = vec!["t".to_owned()];
    [time, column_names("u", inputs), column_names("y", outputs)].concat()
}

/// Columns of files that do not have the usual names: name in the twin → column in the file.
///
/// Names in the twin are `t`, its inputs and outputs, or `u`, `u1`, `y`, `y1` and so on.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Columns(BTreeMap<String, String>);

impl Columns {
    /// Returns `true` if all columns have their usual names.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// The same without those of outputs, for files of time and inputs.
    pub(super) fn without_outputs(&self, signals: Option<&Signals>) -> Self {
        let is_output = |key: &str| usual_name(key, signals).is_some_and(|n| n.starts_with('y'));
        let mut columns = self.0.clone();
        columns.retain(|key, _| !is_output(key));
        Self(columns)
    }

    /// Translates a header into the usual names, `None` for a column that is left out.
    ///
    /// Times, inputs and outputs that are given here come from these columns alone; the others from columns with their usual
    /// names or the twin's. Columns are left out only where some are given.
    pub(super) fn usual_names(
        &self,
        header: &[&str],
        signals: Option<&Signals>,
    ) -> Result<Vec<Option<String>>, String> {
        let given = self.given(header, signals)?;
        let letters: Vec<char> = (given.iter().flatten())
            .filter_map(|name| name.chars().next())
            .collect();
        let is_given = |letter: char| letters.contains(&letter);
        (header.iter().zip(given).enumerate())
            .map(|(at, (column, given))| {
                if self.0.values().any(|asked| asked == column) && header[..at].contains(column) {
                    return Err(format!(
                        "column \"{}\" appears twice; rename or remove one",
                        quoted(column)
                    ));
                }
                if given.is_some() {
                    return Ok(given);
                }
                let usual = usual_name(column, signals).unwrap_or_else(|| (*column).to_owned());
                let is_replaced = usual.starts_with(is_given);
                let is_other = !is_usual(&usual) || is_replaced;
                Ok((self.is_empty() || !is_other).then_some(usual))
            })
            .collect()
    }

    /// Returns the usual name of each column that is given here.
    fn given(
        &self,
        header: &[&str],
        signals: Option<&Signals>,
    ) -> Result<Vec<Option<String>>, String> {
        let mut names: Vec<Option<String>> = vec![None; header.len()];
        let lacks = signals.is_some_and(|signals| signals.outputs.len() > 1);
        for (key, column) in &self.0 {
            let usual = usual_name(key, signals).ok_or_else(|| unknown_key(key, signals))?;
            let at = (header.iter()).position(|name| name == column);
            let has_other = |key: &String| {
                let is_output = |key| usual_name(key, signals).is_some_and(|n| n.starts_with('y'));
                is_output(key.as_str()) && header.contains(&self.0[key].as_str())
            };
            // A record may lack a sensor that others have.
            if at.is_none() && usual.starts_with('y') && lacks && self.0.keys().any(has_other) {
                continue;
            }
            let at = at.ok_or_else(|| {
                let near = did_you_mean(column, header);
                format!(
                    "no column is called \"{}\"{near}, which is to be {}; the columns are {}",
                    quoted(column),
                    quoted(key),
                    excerpt(&header.join(", "))
                )
            })?;
            if names.iter().flatten().any(|name| *name == usual) {
                return Err(format!(
                    "two columns are to be {}, which is also {}; give one of them",
                    quoted(key),
                    usual
                ));
            }
            if let Some(other) = names[at].replace(usual) {
                return Err(format!(
                    "column \"{}\" is to be both {other} and {}; give each its own column",
                    quoted(column),
                    quoted(key)
                ));
            }
        }
        for letter in ["u", "y"].into_iter().filter(|l| *l == "u" || !lacks) {
            let given: Vec<&String> = (names.iter().flatten())
                .filter(|name| name.starts_with(letter))
                .collect();
            let is_missing = |number: &usize| {
                let numbered = format!("{letter}{number}");
                let alone = *number == 1 && given.iter().any(|name| *name == letter);
                !alone && !given.contains(&&numbered)
            };
            if let Some(number) = (1..=given.len()).find(is_missing) {
                return Err(format!(
                    "no column is given for {letter}{number}; give every input, or none, and every output, or none"
                ));
            }
        }
        Ok(names)
    }
}

/// Parses `t=time,u=pump,y=level`.
impl FromStr for Columns {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let mut columns = BTreeMap::new();
        for part in text.split(',') {
            let (key, column) = (part.split_once('='))
                .map(|(key, column)| (key.trim(), column.trim()))
                .filter(|(key, column)| !key.is_empty() && !column.is_empty())
                .ok_or_else(|| {
                    format!(
                        "\"{}\" is not name=column; write t=time,u=pump",
                        quoted(part)
                    )
                })?;
            if columns.insert(key.to_owned(), column.to_owned()).is_some() {
                return Err(format!("{} is given twice; give it once", quoted(key)));
            }
        }
        Ok(Self(columns))
    }
}

/// Returns `true` for t, u, u1, y, y1 and so on.
pub(super) fn is_usual(name: &str) -> bool {
    let channel = name.strip_prefix(['u', 'y']);
    name == "t" || channel.is_some_and(|rest| rest.bytes().all(|b| b.is_ascii_digit()))
}

/// Returns the usual name behind a name in the twin.
fn usual_name(name: &str, signals: Option<&Signals>) -> Option<String> {
    let of = |letter: &str, channels: &[Quantity]| {
        let at = channels.iter().position(|channel| channel.name == name)?;
        Some(column_names(letter, channels.len()).swap_remove(at))
    };
    let own = signals.and_then(|s| of("u", &s.inputs).or_else(|| of("y", &s.outputs)));
    own.filter(|_| name != "t")
        .or_else(|| is_usual(name).then(|| name.to_owned()))
}

/// The error of a name that is not the twin's.
fn unknown_key(key: &str, signals: Option<&Signals>) -> String {
    let own = signals.map(|s| s.inputs.iter().chain(&s.outputs));
    let mut known = vec!["t"];
    match own {
        Some(channels) => known.extend(channels.map(|channel| channel.name.as_str())),
        None => known.extend(["u", "u1", "u2", "y", "y1", "y2"]),
    }
    format!(
        "columns: no channel is called \"{}\"{}; there are {}",
        quoted(key),
        did_you_mean(key, &known),
        excerpt(&known.join(", "))
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(columns: &str, header: &str) -> Result<Vec<String>, String> {
        let signals = Signals {
            inputs: vec![Quantity::new("pump", "V")],
            outputs: vec![Quantity::new("upper", "m"), Quantity::new("lower", "m")],
        };
        let columns = match columns {
            "" => Columns::default(),
            text => text.parse()?,
        };
        let header: Vec<&str> = header.split(',').collect();
        let names = columns.usual_names(&header, Some(&signals))?;
        Ok(names.into_iter().map(Option::unwrap_or_default).collect())
    }

    #[test]
    fn columns_are_found_by_the_names_of_the_twin() {
        let own = names("", "t,pump,lower,upper").unwrap();
        assert_eq!(own, ["t", "u", "y2", "y1"]);
        let mixed = names("t=time,upper=A,y2=B", "B,t,time,u,A,note,y1").unwrap();
        assert_eq!(mixed, ["y2", "", "t", "u", "y1", "", ""]);
        assert_eq!(names("", "t,u,note").unwrap(), ["t", "u", "note"]);
        assert_eq!(names("lower=a", "t,a").unwrap(), ["t", "y2"]);
        assert_eq!(names("lower=a,upper=b", "t,a").unwrap(), ["t", "y2"]);
    }

    #[test]
    fn wrong_columns_are_named() {
        for (columns, header, part) in [
            (
                "t=tim",
                "time,u",
                "no column is called \"tim\" (did you mean \"time\"?)",
            ),
            (
                "pumpp=a",
                "t,a",
                "no channel is called \"pumpp\" (did you mean \"pump\"?)",
            ),
            ("t=a,u=a", "a,b", "column \"a\" is to be both"),
            ("u=a,pump=b", "a,b", "two columns are to be u"),
            ("upper=a,y1=b", "a,b", "two columns are to be"),
            ("t=a", "a,a", "column \"a\" appears twice"),
            ("t=a,t=b", "a,b", "t is given twice"),
            ("time", "a,b", "not name=column"),
            ("t=", "a,b", "not name=column"),
        ] {
            let error = names(columns, header).unwrap_err();
            assert!(error.contains(part), "{columns}: {error}");
        }
    }
}
