//! Events of a text: when or at which times states are set.

mod margin;
#[cfg(test)]
mod tests;

use super::entries::{TableEntry, entry_list};
use super::error::EquationsError;
use super::expression::Binary;
use super::graph::{Graph, Id, Node, Varies};
use super::names::Scope;
use super::place::{SourceText, in_order, number};
use super::tape::OperationTape;
use crate::setting::did_you_mean;
use crate::storage::untrusted::excerpt;
use crate::twin::{Event, Now};
use margin::margin;
use smallvec::SmallVec;
use toml::de::{DeTable, DeValue};

#[cfg(test)]
pub(in crate::equations) use tests::BALL;

/// List of events in a file.
pub(super) const EVENT: &str = "event";
const WHEN: &str = "when";
const AT: &str = "at";

/// An event as values of the graph.
pub(super) struct EventText {
    name: String,
    trigger: TriggerText,
    /// States with their values behind it.
    changes: Vec<(usize, Id)>,
}

enum TriggerText {
    /// The margin of the condition, and the condition.
    When(Id, Id),
    At(Vec<Id>),
}

/// Reads the events of a file; `states` are the twin's.
pub(super) fn events(
    source: SourceText<'_>,
    file: &DeTable<'_>,
    (states, names): (&[TableEntry<'_, '_>], &mut Scope<'_>),
) -> Result<Vec<EventText>, EquationsError> {
    let states: Vec<&str> = states.iter().map(|state| state.name).collect();
    let all = entry_list(source, file, EVENT)?;
    (all.iter().enumerate())
        .map(|(i, entry)| event(i, entry, (&states, names)))
        .collect()
}

fn event(
    index: usize,
    entry: &TableEntry<'_, '_>,
    (states, names): (&[&str], &mut Scope<'_>),
) -> Result<EventText, EquationsError> {
    let keys = entry.keys(&[WHEN, AT, "set", "add"])?;
    let (trigger, name) = match (keys.get(WHEN), keys.get(AT)) {
        (Some(value), None) => {
            let placed = entry.expression_of(WHEN, value)?;
            let condition = names.value(&placed)?;
            match margin(&mut names.graph, condition) {
                Ok(margin) => {
                    let text = value.get_ref().as_str().unwrap_or_default();
                    (
                        TriggerText::When(margin, condition),
                        format!("when {}", excerpt(text)),
                    )
                }
                Err(problem) => {
                    return Err(placed.problem(&entry.source, (0, problem.into())));
                }
            }
        }
        (None, Some(value)) => (times(entry, value, names)?, "at its times".to_owned()),
        (Some(_), Some(_)) => {
            return entry.error("an event has when and at; write one event for each");
        }
        (None, None) => {
            return entry.error(
                "an event has no condition; give when = \"h > 3\", or times, at = [1.0, 5.5]",
            );
        }
    };
    Ok(EventText {
        name: format!("event {} ({name})", index + 1),
        trigger,
        changes: changes(entry, keys, (states, names))?,
    })
}

/// Reads one time or a list of them.
fn times(
    entry: &TableEntry<'_, '_>,
    value: &toml::Spanned<DeValue<'_>>,
    names: &mut Scope<'_>,
) -> Result<TriggerText, EquationsError> {
    const OF: &str =
        "the time of an event moves; name parameters, constants and definitions of these alone";
    let all = match value.get_ref().as_array() {
        Some(all) => all.iter().collect(),
        None => vec![value],
    };
    if all.is_empty() {
        return entry.wrong(AT, value, "one time or more, such as [1.0, 5.5]");
    }
    let mut ids = vec![];
    for value in all {
        if number(value.get_ref()).is_some_and(|at| !at.is_finite()) {
            return entry.wrong(AT, value, "times in seconds");
        }
        let placed = entry.expression_of(AT, value)?;
        ids.push(names.value_within(&placed, Varies::ByParameters, OF)?);
    }
    Ok(TriggerText::At(ids))
}

/// Reads what is set, and what is added.
fn changes(
    entry: &TableEntry<'_, '_>,
    keys: &DeTable<'_>,
    (states, names): (&[&str], &mut Scope<'_>),
) -> Result<Vec<(usize, Id)>, EquationsError> {
    let mut changes: Vec<(usize, Id)> = vec![];
    for key in ["set", "add"] {
        let Some(value) = keys.get(key) else {
            continue;
        };
        let Some(table) = value.get_ref().as_table() else {
            return entry.wrong(key, value, "states with their values, { h = \"0.5*h\" }");
        };
        for (name, value) in in_order(table) {
            let byte = name.span().start;
            let name: &str = name.get_ref();
            let Some(state) = states.iter().position(|state| *state == name) else {
                let problem = format!(
                    "\"{}\" is no state{}; an event changes {}",
                    excerpt(name),
                    did_you_mean(name, states),
                    states.join(", ")
                );
                return entry.source.error(byte, problem);
            };
            if changes.iter().any(|(other, _)| *other == state) {
                let problem = format!("{name} is in set and in add; keep one of them");
                return entry.source.error(byte, problem);
            }
            let placed = entry.expression_of(name, value)?;
            let mut id = names.value(&placed)?;
            if key == "add" {
                let own = names.graph.add(Node::State(state));
                id = names.graph.two(Binary::Add, own, id);
            }
            changes.push((state, id));
        }
    }
    match changes.is_empty() {
        true => entry.error("an event changes nothing; give set = { h = 0 }, or add"),
        false => Ok(changes),
    }
}

impl EventText {
    /// Returns the states that it changes.
    pub fn states(&self) -> impl Iterator<Item = usize> {
        self.changes.iter().map(|(state, _)| *state)
    }

    /// Returns its condition.
    pub fn condition(&self) -> Option<Id> {
        match self.trigger {
            TriggerText::When(_, condition) => Some(condition),
            TriggerText::At(_) => None,
        }
    }

    /// Compiles it to operations.
    pub fn compiled(&self, graph: &Graph) -> Event {
        let states: Vec<usize> = self.states().collect();
        let ids: Vec<Id> = self.changes.iter().map(|(_, id)| *id).collect();
        let tape = OperationTape::new(graph, &ids);
        let change = move |now: &Now<'_>, x: &mut [f64]| {
            let mut values = SmallVec::<[f64; 8]>::from_elem(0.0, states.len());
            tape.point(now, x, &mut values);
            for (state, value) in states.iter().zip(&values) {
                x[*state] = *value;
            }
        };
        match &self.trigger {
            TriggerText::When(margin, _) => {
                let tape = OperationTape::new(graph, &[*margin]);
                let margin = move |now: &Now<'_>, x: &[f64]| {
                    let mut margin = [0.0];
                    tape.point(now, x, &mut margin);
                    margin[0]
                };
                Event::when(&self.name, margin, change)
            }
            TriggerText::At(ids) => {
                let (tape, count) = (OperationTape::new(graph, ids), ids.len());
                let times = move |now: &Now<'_>| {
                    let mut times = vec![0.0; count];
                    tape.point(now, &[], &mut times);
                    times
                };
                Event::at(&self.name, times, change)
            }
        }
    }
}
