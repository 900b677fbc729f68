//! Scope of a twin, and expressions as values of its graph.

use super::entries::TableEntry;
use super::error::EquationsError;
use super::expression::Item;
use super::graph::{Graph, Id, Node, Varies};
use super::place::{PlacedExpression, SourceText};
use crate::setting::did_you_mean;
use crate::storage::untrusted::excerpt;
use std::collections::HashMap;

/// The meaning of a name.
#[derive(Debug, Clone, Copy)]
pub(super) enum Meaning {
    Parameter(usize),
    State(usize),
    Input(usize),
    /// A constant or a definition, by its index.
    Defined(usize),
    /// An output, which no expression uses.
    Output,
}

/// A constant or a definition.
struct Definition {
    name: String,
    byte: usize,
    placed: PlacedExpression,
}

/// Scope and the graph that expressions become a part of.
pub(super) struct Scope<'t> {
    source: SourceText<'t>,
    meanings: HashMap<String, (Meaning, &'static str)>,
    definitions: Vec<Definition>,
    /// `true` for definitions that are constants.
    constants: Vec<bool>,
    /// Values of definitions.
    defined: Vec<Option<Id>>,
    pub graph: Graph,
}

impl<'t> Scope<'t> {
    pub fn new(source: SourceText<'t>) -> Self {
        Self {
            source,
            meanings: HashMap::new(),
            definitions: vec![],
            constants: vec![],
            defined: vec![],
            graph: Graph::default(),
        }
    }

    /// Adds the name of an entry.
    pub fn add(
        &mut self,
        entry: &TableEntry<'_, '_>,
        meaning: Meaning,
    ) -> Result<(), EquationsError> {
        entry.check_name()?;
        let name = entry.name.to_owned();
        match self.meanings.insert(name, (meaning, entry.table)) {
            None => Ok(()),
            Some((_, table)) => entry.error(format!(
                "\"{}\" is in {table} already; rename one",
                excerpt(entry.name)
            )),
        }
    }

    /// Adds a constant or a definition.
    pub fn define(
        &mut self,
        entry: &TableEntry<'_, '_>,
        placed: PlacedExpression,
        is_constant: bool,
    ) -> Result<(), EquationsError> {
        self.add(entry, Meaning::Defined(self.definitions.len()))?;
        self.constants.push(is_constant);
        self.definitions.push(Definition {
            name: entry.name.into(),
            byte: entry.byte,
            placed,
        });
        Ok(())
    }

    /// Computes definitions, each behind those that it uses.
    pub fn resolve(&mut self) -> Result<(), EquationsError> {
        let definitions = std::mem::take(&mut self.definitions);
        self.defined = vec![None; definitions.len()];
        let mut needs: Vec<Vec<usize>> = vec![];
        for definition in &definitions {
            let mut needed = vec![];
            for (name, _) in definition.placed.expression.names() {
                if let Some((Meaning::Defined(index), _)) = self.meanings.get(name) {
                    needed.push(*index);
                }
            }
            needs.push(needed);
        }
        // A definition is ready when all that it uses is.
        let mut waiting: Vec<usize> = (0..definitions.len()).collect();
        while !waiting.is_empty() {
            let (ready, blocked): (Vec<usize>, Vec<usize>) = (waiting.iter())
                .partition(|index| needs[**index].iter().all(|of| self.defined[*of].is_some()));
            if ready.is_empty() {
                return self.circle(&definitions, &needs, blocked[0]);
            }
            for index in ready {
                let definition = &definitions[index];
                let id = match std::mem::take(&mut self.constants[index]) {
                    true => {
                        let name = excerpt(&definition.name);
                        let problem = format!("{name} is no constant; make it a definition");
                        self.value_within(&definition.placed, Varies::Never, &problem)?
                    }
                    false => self.value(&definition.placed)?,
                };
                self.defined[index] = Some(id);
            }
            waiting = blocked;
        }
        Ok(())
    }

    /// The error of a definition that needs itself.
    fn circle(
        &self,
        definitions: &[Definition],
        needs: &[Vec<usize>],
        from: usize,
    ) -> Result<(), EquationsError> {
        // From any blocked one, following what blocks it comes into the circle.
        let (mut path, mut at) = (vec![], from);
        while !path.contains(&at) {
            path.push(at);
            let blocking = needs[at].iter().find(|of| self.defined[**of].is_none());
            at = *blocking.unwrap_or(&at);
        }
        let start = path.iter().position(|index| *index == at).unwrap_or(0);
        let names: Vec<String> = (path[start..].iter().chain([&at]))
            .map(|index| excerpt(&definitions[*index].name))
            .collect();
        let names = match names.len() {
            0..=8 => names.join(" needs "),
            _ => format!("{} needs …", names[..8].join(" needs ")),
        };
        self.source.error(
            definitions[at].byte,
            format!("a definition in a circle: {names}; a memory is a state"),
        )
    }

    /// Adds an expression to the graph.
    pub fn value(&mut self, placed: &PlacedExpression) -> Result<Id, EquationsError> {
        self.value_of(placed, Varies::ByState)
    }

    /// As [`value`](Self::value), of names that depend on no more than `most`.
    fn value_of(&mut self, placed: &PlacedExpression, most: Varies) -> Result<Id, EquationsError> {
        let mut stack: Vec<Id> = Vec::new();
        let fault = || {
            EquationsError::at(
                self.source.0,
                placed.byte(0),
                "an expression without operands; write 0",
            )
        };
        for item in &placed.expression.0 {
            let mut pop = || stack.pop().ok_or_else(fault);
            let id = match item {
                Item::Number(value) => self.graph.number(*value),
                Item::Name(name, at) => {
                    let node = self.meaning(name, most);
                    match node {
                        Ok(id) => id,
                        Err(problem) => {
                            return Err(placed.problem(&self.source, (*at, problem)));
                        }
                    }
                }
                Item::One(operation) => {
                    let a = pop()?;
                    self.graph.one(*operation, a)
                }
                Item::Two(operation) => {
                    let (b, a) = (pop()?, pop()?);
                    self.graph.two(*operation, a, b)
                }
                Item::If => {
                    let (b, a, condition) = (pop()?, pop()?, pop()?);
                    self.graph.choice(condition, a, b)
                }
            };
            stack.push(id);
            if let Some(most) = self.graph.is_too_large() {
                let problem =
                    format!("more than {most} operations; a twin of that size needs Rust");
                return Err(placed.problem(&self.source, (0, problem)));
            }
        }
        let id = stack.pop().ok_or_else(|| {
            EquationsError::at(
                self.source.0,
                placed.byte(0),
                "an empty expression; write 0",
            )
        })?;
        match self.graph.constant(id).filter(|value| !value.is_finite()) {
            None => Ok(id),
            Some(value) => {
                let problem = format!("the value is {value}; write what is a finite number");
                Err(placed.problem(&self.source, (0, problem)))
            }
        }
    }

    /// As [`value`](Self::value), of what depends on no more than `most`; `what` says what it may use.
    pub fn value_within(
        &mut self,
        placed: &PlacedExpression,
        most: Varies,
        what: &str,
    ) -> Result<Id, EquationsError> {
        let id = self.value_of(placed, most)?;
        match self.graph.get(id).1 <= most {
            true => Ok(id),
            false => Err(placed.problem(&self.source, (0, what.to_owned()))),
        }
    }

    /// The value that a name stands for, or the problem, which offers names that depend on no more than `most`.
    fn meaning(&mut self, name: &str, most: Varies) -> Result<Id, String> {
        let node = match self.meanings.get(name) {
            Some((Meaning::Parameter(index), _)) => Node::Parameter(*index),
            Some((Meaning::State(index), _)) => Node::State(*index),
            Some((Meaning::Input(index), _)) => Node::Input(*index),
            Some((Meaning::Defined(index), _)) => {
                return self.defined[*index].ok_or_else(|| {
                    format!("{name} is not known here; use constants and parameters")
                });
            }
            Some((Meaning::Output, _)) => {
                return Err(format!(
                    "\"{}\" is an output; name what it shows in define, and use that",
                    excerpt(name)
                ));
            }
            None if name == "t" => Node::Time,
            None if name == "pi" => return Ok(self.graph.number(std::f64::consts::PI)),
            None => return Err(self.unknown(name, most)),
        };
        Ok(self.graph.add(node))
    }

    fn unknown(&self, name: &str, most: Varies) -> String {
        let usable = |meaning: &Meaning| match meaning {
            Meaning::Parameter(_) => Varies::ByParameters <= most,
            Meaning::Input(_) => Varies::ByStep <= most,
            Meaning::State(_) => Varies::ByState <= most,
            // A definition that waits for others may depend on anything.
            Meaning::Defined(index) => {
                let varies = self.defined[*index].map(|id| self.graph.get(id).1);
                let waits = match self.constants[*index] {
                    true => Varies::Never,
                    false => Varies::ByState,
                };
                varies.unwrap_or(waits) <= most
            }
            Meaning::Output => false,
        };
        let mut known: Vec<&str> = (self.meanings.iter())
            .filter(|(_, (meaning, _))| usable(meaning))
            .map(|(name, _)| name.as_str())
            .chain((Varies::ByStep <= most).then_some("t"))
            .chain(["pi"])
            .collect();
        known.sort_unstable();
        let near = did_you_mean(name, &known);
        let listed = match known.len() {
            0..=30 => known.join(", "),
            many => format!("{} and {} more", known[..30].join(", "), many - 30),
        };
        format!(
            "unknown name \"{}\"{near}; there are {listed}",
            excerpt(name)
        )
    }
}
