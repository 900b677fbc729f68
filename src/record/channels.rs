//! Channels of a twin, and the usual names of columns that hold them.

use serde::Serialize;

/// Largest size of a channel; its inverse is the least one that is not 0. Squares and sums of squares of a record must stay finite and must
/// not vanish: twice or half of it are as good, 1e154 is not.
pub(crate) const LARGEST: f64 = 1e100;

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

/// The same in brackets after a space; nothing for none.
pub(super) fn names_in_brackets(letter: &str, channels: usize) -> String {
    match channels {
        0 => String::new(),
        _ => format!(" ({})", column_names(letter, channels).join(",")),
    }
}

/// Columns of a record file with so many channels.
pub(super) fn columns(inputs: usize, outputs: usize) -> Vec<String> {
    let time = vec!["t".to_owned()];
    [time, column_names("u", inputs), column_names("y", outputs)].concat()
}

/// Returns whether a reader finds a name in a header as it was written: without blanks at its ends, in one line.
pub(super) fn is_cell(name: &str) -> bool {
    name.trim() == name && !name.contains(['\r', '\n'])
}

/// Columns of a file that the reader of a twin's records takes for its inputs, and its outputs if `outputs`: those with the usual names,
/// unless one of them is another channel's own name. Then each channel has its own name, or `u01`, `y002` where that tells it not apart.
pub(super) fn header(signals: &Signals, outputs: bool) -> Vec<String> {
    let shown = if outputs { signals.outputs.len() } else { 0 };
    let usual = columns(signals.inputs.len(), shown);
    let is_read = |column: &str, name: &str| {
        let found = usual_name(column, Some(signals));
        found.as_deref() == Some(name) && is_cell(column)
    };
    if usual.iter().all(|name| is_read(name, name)) {
        return usual;
    }
    let channels = signals.inputs.iter().chain(&signals.outputs);
    let own = channels.map(|channel| channel.name.clone());
    let own = std::iter::once("t".to_owned()).chain(own);
    (usual.iter().zip(own))
        .map(|(name, own)| {
            let aliases = (0..).map(|zeros| match name.as_str() {
                "t" => name.clone(),
                "u" | "y" => format!("{name}{}1", "0".repeat(zeros)),
                name => format!("{}{}{}", &name[..1], "0".repeat(zeros), &name[1..]),
            });
            let mut names = [own, name.clone()].into_iter().chain(aliases);
            // As many aliases as there are channels cannot all be names of others.
            let found = names.find(|column| is_read(column, name));
            found.unwrap_or_else(|| name.clone())
        })
        .collect()
}

/// Returns `true` for t, u, u1, y, y1 and so on.
pub(super) fn is_usual(name: &str) -> bool {
    let channel = name.strip_prefix(['u', 'y']);
    name == "t" || channel.is_some_and(|rest| rest.bytes().all(|b| b.is_ascii_digit()))
}

/// Returns the usual name behind a name in the twin: that of the channel with this very name, else of the one that `u`, `u1`, `u01`, `y`, … stands
/// for. A name of two channels stands for none.
pub(super) fn usual_name(name: &str, signals: Option<&Signals>) -> Option<String> {
    let usual = is_usual(name).then(|| name.to_owned());
    let Some(signals) = signals.filter(|_| name != "t") else {
        return usual;
    };
    let sides = [("u", &signals.inputs), ("y", &signals.outputs)];
    let of = |(letter, channels): (&str, &Vec<Quantity>)| {
        let at = channels.iter().position(|channel| channel.name == name)?;
        Some(column_names(letter, channels.len()).swap_remove(at))
    };
    match sides.map(of) {
        [Some(_), Some(_)] => return None,
        [Some(own), None] | [None, Some(own)] => return Some(own),
        [None, None] => {}
    }
    let (letter, channels) = sides.into_iter().find(|side| name.starts_with(side.0))?;
    let number = name[1..].parse::<usize>();
    let numbered = |number: usize| {
        column_names(letter, channels.len())
            .get(number.wrapping_sub(1))
            .cloned()
    };
    // Another number is out of order, which the reader says.
    usual.map(|usual| number.ok().and_then(numbered).unwrap_or(usual))
}
