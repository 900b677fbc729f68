//! The tables of a twin, written from what a file has.

use super::event::EVENT;
use super::place::{in_order, number};
use toml::de::{DeTable, DeValue};

/// Tables of a twin, in the order in which they are written.
pub(crate) const TABLES: [&str; 8] = [
    "twin",
    "parameters",
    "constants",
    "define",
    "states",
    "inputs",
    "outputs",
    EVENT,
];

/// Returns the tables of a twin as a file has them, without comments.
pub(super) fn written(file: &DeTable<'_>) -> String {
    let mut text = String::new();
    for table in TABLES {
        let Some(value) = file.get(table) else {
            continue;
        };
        match value.get_ref() {
            DeValue::Table(entries) => text += &written_table(&format!("[{table}]"), entries),
            DeValue::Array(all) => {
                let tables = all.iter().filter_map(|value| value.get_ref().as_table());
                tables.for_each(|keys| text += &written_table(&format!("[[{table}]]"), keys));
            }
            value => text += &format!("[{table}]\nname = {}\n\n", inline(value)),
        }
    }
    text
}

/// Returns a table with its keys, in the order of the file.
fn written_table(head: &str, entries: &DeTable<'_>) -> String {
    let mut text = format!("{head}\n");
    for (key, value) in in_order(entries) {
        let (key, value) = (toml_key(key.get_ref()), inline(value.get_ref()));
        text += &format!("{key} = {value}\n");
    }
    text + "\n"
}

fn toml_key(key: &str) -> String {
    match !key.is_empty() && key.chars().all(|c| c.is_ascii_alphanumeric() || c == '_') {
        true => key.to_owned(),
        false => toml::Value::String(key.into()).to_string(),
    }
}

/// Returns a value in one line.
fn inline(value: &DeValue<'_>) -> String {
    match value {
        DeValue::String(text) => toml::Value::String(text.to_string()).to_string(),
        DeValue::Boolean(is_true) => is_true.to_string(),
        DeValue::Float(number) => number.as_str().to_owned(),
        DeValue::Array(all) => {
            let all: Vec<String> = all.iter().map(|value| inline(value.get_ref())).collect();
            format!("[{}]", all.join(", "))
        }
        DeValue::Table(entries) => {
            let all = in_order(entries).into_iter().map(|(key, value)| {
                format!("{} = {}", toml_key(key.get_ref()), inline(value.get_ref()))
            });
            format!("{{ {} }}", all.collect::<Vec<_>>().join(", "))
        }
        other => number(other).unwrap_or(f64::NAN).to_string(),
    }
}
