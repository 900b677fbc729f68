//! Margins of conditions: above zero where they are true, and zero where they change.

use crate::equations::expression::{Binary, Unary};
use crate::equations::graph::{Graph, Id, Node};
use std::collections::HashMap;

/// Deepest nesting of conditions: that of expressions, and some definitions of definitions.
const DEEPEST: usize = 500;

/// Returns the margin of a condition; or why it has none, with the remedy.
///
/// ```text
/// a < b, a <= b      b − a
/// c and d            min of both margins
/// c or d             max of both margins
/// not c              minus the margin
/// if(c, d, e)        that of d or e
/// ```
pub(super) fn margin(graph: &mut Graph, condition: Id) -> Result<Id, &'static str> {
    if graph.constant(condition).is_some() {
        return Err("a condition that never changes; compare states, inputs or t, such as h > 3");
    }
    Margins {
        graph,
        known: HashMap::new(),
    }
    .of(condition, 0)
}

/// Margins so far: definitions may use each other twice, again and again.
struct Margins<'g> {
    graph: &'g mut Graph,
    known: HashMap<Id, Id>,
}

impl Margins<'_> {
    fn of(&mut self, condition: Id, depth: usize) -> Result<Id, &'static str> {
        if depth > DEEPEST {
            return Err("a condition that is nested too deep; write several events");
        }
        if let Some(margin) = self.known.get(&condition) {
            return Ok(*margin);
        }
        let margin = match self.graph.get(condition).0 {
            // A part that is always true or false.
            Node::Number(bits) => {
                let is_true = f64::from_bits(bits) != 0.0;
                (self.graph).number(if is_true { f64::MAX } else { f64::MIN })
            }
            Node::Two(Binary::Less | Binary::LessEqual, a, b) => self.graph.two(Binary::Sub, b, a),
            Node::Two(operation @ (Binary::And | Binary::Or), a, b) => {
                let (a, b) = (self.of(a, depth + 1)?, self.of(b, depth + 1)?);
                let both = match operation {
                    Binary::And => Binary::Min,
                    _ => Binary::Max,
                };
                self.graph.two(both, a, b)
            }
            Node::One(Unary::Not, a) => {
                let a = self.of(a, depth + 1)?;
                self.graph.one(Unary::Neg, a)
            }
            Node::If(c, a, b) => {
                let (a, b) = (self.of(a, depth + 1)?, self.of(b, depth + 1)?);
                self.graph.choice(c, a, b)
            }
            Node::Two(Binary::Equal | Binary::NotEqual, ..) => {
                return Err("a condition of one point alone, which motion goes past; write < or >");
            }
            _ => return Err("no condition; compare with < or >, such as h > 3"),
        };
        self.known.insert(condition, margin);
        Ok(margin)
    }
}
