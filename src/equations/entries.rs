//! Entries of the tables of a file, with their keys.

use super::error::EquationsError;
use super::expression::{Callable, is_name};
use super::place::{PlacedExpression, SourceText, in_order, number};
use crate::setting::did_you_mean;
use crate::storage::untrusted::{check_name, excerpt, hidden};
use crate::twin::Interval;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// Words that expressions use already.
const WORDS: [&str; 5] = ["and", "or", "not", "t", "pi"];

/// Most entries of a table: whoever has more writes a program.
const MOST: usize = 2000;

/// An entry of a table: its name, and its keys or its value.
#[derive(Clone, Copy)]
pub(super) struct TableEntry<'a, 't> {
    pub source: SourceText<'t>,
    pub table: &'static str,
    pub name: &'a str,
    pub byte: usize,
    pub value: &'a Spanned<DeValue<'t>>,
}

/// Returns the entries of a table in the order of the file.
pub(super) fn entries<'a, 't>(
    source: SourceText<'t>,
    file: &'a DeTable<'t>,
    table: &'static str,
) -> Result<Vec<TableEntry<'a, 't>>, EquationsError> {
    let Some(value) = file.get(table) else {
        return Ok(vec![]);
    };
    let Some(keys) = value.get_ref().as_table() else {
        return source.error(
            value.span().start,
            format!("{table} is a table; write it in brackets, and its entries below"),
        );
    };
    check_number(source, value.span().start, (table, keys.len()))?;
    let entries = in_order(keys).into_iter().map(|(key, value)| TableEntry {
        source,
        table,
        name: key.get_ref(),
        byte: key.span().start,
        value,
    });
    Ok(entries.collect())
}

/// Checks that a table has no more entries than a file may have.
fn check_number(
    source: SourceText<'_>,
    byte: usize,
    (table, entries): (&str, usize),
) -> Result<(), EquationsError> {
    match entries > MOST {
        true => source.error(
            byte,
            format!("{entries} entries of {table}; there may be {MOST}"),
        ),
        false => Ok(()),
    }
}

/// Returns the entries of a list of tables, `[[table]]`.
pub(super) fn entry_list<'a, 't>(
    source: SourceText<'t>,
    file: &'a DeTable<'t>,
    table: &'static str,
) -> Result<Vec<TableEntry<'a, 't>>, EquationsError> {
    let Some(value) = file.get(table) else {
        return Ok(vec![]);
    };
    let byte = value.span().start;
    let all = match value.get_ref().as_array() {
        Some(all) if all.iter().all(|value| value.get_ref().is_table()) => all,
        _ => {
            let problem = format!("{table} is a list of tables; write [[{table}]] above each");
            return source.error(byte, problem);
        }
    };
    check_number(source, byte, (table, all.len()))?;
    let entry = |value: &'a Spanned<DeValue<'t>>| TableEntry {
        source,
        table,
        name: table,
        byte: value.span().start,
        value,
    };
    Ok(all.iter().map(entry).collect())
}

impl<'a, 't> TableEntry<'a, 't> {
    /// An error at the entry's name.
    pub fn error<T>(&self, problem: impl Into<String>) -> Result<T, EquationsError> {
        self.source.error(self.byte, problem)
    }

    /// Checks that expressions can use its name.
    pub fn check_name(&self) -> Result<(), EquationsError> {
        let name = self.name;
        let shown = excerpt(name);
        if !is_name(name) {
            return self.error(format!(
                "\"{shown}\" cannot stand in an expression; use letters, digits and _, a letter first"
            ));
        }
        if let Err(problem) = check_name(name) {
            return self.error(problem);
        }
        if WORDS.contains(&name) || Callable::named(name).is_some() {
            return self.error(format!(
                "\"{shown}\" is a word of expressions; choose another name"
            ));
        }
        Ok(())
    }

    /// Returns its keys after a check that they are known.
    pub fn keys(&self, known: &[&str]) -> Result<&'a DeTable<'t>, EquationsError> {
        let Some(keys) = self.value.get_ref().as_table() else {
            return self.source.error(
                self.value.span().start,
                format!(
                    "{} is no table; write {} = {{ {} = … }}",
                    self.name, self.name, known[0]
                ),
            );
        };
        let unknown = keys
            .iter()
            .find(|(key, _)| !known.contains(&key.get_ref().as_ref()));
        match unknown {
            None => Ok(keys),
            Some((key, _)) => {
                let name: &str = key.get_ref();
                self.source.error(
                    key.span().start,
                    format!(
                        "unknown key \"{}\"{}; {} has {}",
                        excerpt(name),
                        did_you_mean(name, known),
                        self.table,
                        known.join(", ")
                    ),
                )
            }
        }
    }

    /// Returns the text of a key, empty where it is not given.
    pub fn text(&self, keys: &DeTable<'t>, key: &str) -> Result<String, EquationsError> {
        match keys.get(key) {
            None => Ok(String::new()),
            Some(value) => match value.get_ref().as_str() {
                Some(text) if !text.contains(hidden) => Ok(text.to_owned()),
                _ => self.wrong(key, value, "a text of one line without hidden characters"),
            },
        }
    }

    /// Returns the two numbers of a key.
    pub fn interval(
        &self,
        keys: &DeTable<'t>,
        key: &str,
    ) -> Result<Option<Interval>, EquationsError> {
        let Some(value) = keys.get(key) else {
            return Ok(None);
        };
        let ends: Option<Vec<f64>> = (value.get_ref().as_array())
            .and_then(|all| all.iter().map(|end| number(end.get_ref())).collect());
        match ends.as_deref() {
            Some(&[low, high]) => match Interval::new(low, high) {
                Ok(interval) => Ok(Some(interval)),
                Err(error) => self.source.error(value.span().start, error.to_string()),
            },
            _ => self.wrong(key, value, "two numbers, [low, high]"),
        }
    }

    /// Returns the expression of a key.
    pub fn expression(
        &self,
        keys: &DeTable<'t>,
        key: &str,
    ) -> Result<Option<PlacedExpression>, EquationsError> {
        match keys.get(key) {
            None => Ok(None),
            Some(value) => self.expression_of(key, value).map(Some),
        }
    }

    pub fn expression_of(
        &self,
        key: &str,
        value: &Spanned<DeValue<'t>>,
    ) -> Result<PlacedExpression, EquationsError> {
        match self.source.expression(value) {
            Some(placed) => placed,
            None => self.wrong(key, value, "a number or an expression in quotes"),
        }
    }

    /// An error at a key's value, with what it is to be.
    pub fn wrong<T>(
        &self,
        key: &str,
        value: &Spanned<DeValue<'_>>,
        expected: &str,
    ) -> Result<T, EquationsError> {
        self.source.error(
            value.span().start,
            format!(
                "{key} of {} cannot be read; write {expected}",
                excerpt(self.name)
            ),
        )
    }
}
