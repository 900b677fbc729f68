//! Expressions as one graph: what is computed twice stands once, what is constant is computed at once.

use super::expression::{Binary, Unary};
use std::collections::HashMap;

/// Most operations and values of a twin: hundreds of states, and some megabytes of memory a thread.
const MOST: usize = 20_000;
/// Largest whole exponent that is multiplied out.
const LARGEST_POWER: f64 = 16.0;

/// Index of a value.
pub(super) type Id = usize;

/// A value.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(super) enum Node {
    /// A number, by its bits.
    Number(u64),
    Parameter(usize),
    Time,
    Input(usize),
    State(usize),
    One(Unary, Id),
    Two(Binary, Id, Id),
    If(Id, Id, Id),
}

impl Node {
    /// Returns its operands, and how many there are.
    pub fn operands(self) -> ([Id; 3], usize) {
        match self {
            Self::One(_, a) => ([a; 3], 1),
            Self::Two(_, a, b) => ([a, b, b], 2),
            Self::If(c, a, b) => ([c, a, b], 3),
            _ => ([0; 3], 0),
        }
    }
}

/// The most that a value depends on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Varies {
    Never,
    ByParameters,
    /// By time or inputs: with each step.
    ByStep,
    ByState,
}

/// Values, operands before what is computed of them.
#[derive(Debug, Default)]
pub(super) struct Graph {
    nodes: Vec<(Node, Varies)>,
    known: HashMap<Node, Id>,
}

impl Graph {
    /// Returns a value and what it depends on.
    pub fn get(&self, id: Id) -> (Node, Varies) {
        self.nodes[id]
    }

    /// Returns the number of values.
    pub fn len(&self) -> usize {
        self.nodes.len()
    }

    /// Returns whether it has more values than a twin may have.
    pub fn is_too_large(&self) -> Option<usize> {
        (self.nodes.len() > MOST).then_some(MOST)
    }

    /// Returns the number that a value always is.
    pub fn constant(&self, id: Id) -> Option<f64> {
        match self.nodes[id].0 {
            Node::Number(bits) => Some(f64::from_bits(bits)),
            _ => None,
        }
    }

    /// Returns which values these need, themselves too.
    pub fn needed(&self, ids: &[Id]) -> Vec<bool> {
        let mut needed = vec![false; self.len()];
        ids.iter().for_each(|id| needed[*id] = true);
        for id in (0..self.len()).rev() {
            if needed[id] {
                let (of, count) = self.nodes[id].0.operands();
                of[..count].iter().for_each(|id| needed[*id] = true);
            }
        }
        needed
    }

    pub fn number(&mut self, value: f64) -> Id {
        self.add(Node::Number(value.to_bits()))
    }

    pub fn one(&mut self, operation: Unary, a: Id) -> Id {
        match (self.constant(a), self.nodes[a].0) {
            (Some(a), _) => self.number(operation.value(a)),
            (_, Node::One(Unary::Neg, inner)) if operation == Unary::Neg => inner,
            _ => self.add(Node::One(operation, a)),
        }
    }

    pub fn two(&mut self, operation: Binary, a: Id, b: Id) -> Id {
        use Binary::{Add, And, Div, Equal, Mul, NotEqual, Or, Pow};
        match (operation, self.constant(a), self.constant(b)) {
            (_, Some(a), Some(b)) => self.number(operation.value(a, b)),
            (Pow, _, Some(exponent)) => self.power(a, exponent),
            (Mul | Div, _, Some(1.0)) => a,
            (Mul, Some(1.0), _) => b,
            // Their operands are exchanged without any change of the value.
            (Add | Mul | And | Or | Equal | NotEqual, ..) => {
                self.add(Node::Two(operation, a.min(b), a.max(b)))
            }
            _ => self.add(Node::Two(operation, a, b)),
        }
    }

    pub fn choice(&mut self, condition: Id, a: Id, b: Id) -> Id {
        match self.constant(condition) {
            Some(condition) if condition != 0.0 => a,
            Some(_) => b,
            None => self.add(Node::If(condition, a, b)),
        }
    }

    /// A power; small whole ones are products, which take a hundredth of the time.
    fn power(&mut self, a: Id, exponent: f64) -> Id {
        if exponent == 0.5 {
            return self.one(Unary::Sqrt, a);
        }
        let size = exponent.abs();
        if size.fract() != 0.0 || size > LARGEST_POWER {
            let exponent = self.number(exponent);
            return self.add(Node::Two(Binary::Pow, a, exponent));
        }
        let (mut bits, mut square, mut product) = (size as u32, a, None);
        while bits > 0 {
            if bits & 1 == 1 {
                product = Some(match product {
                    None => square,
                    Some(product) => self.two(Binary::Mul, product, square),
                });
            }
            bits >>= 1;
            if bits > 0 {
                square = self.two(Binary::Mul, square, square);
            }
        }
        let one = self.number(1.0);
        match product {
            None => one,
            Some(product) if exponent < 0.0 => self.two(Binary::Div, one, product),
            Some(product) => product,
        }
    }

    pub fn add(&mut self, node: Node) -> Id {
        if let Some(&id) = self.known.get(&node) {
            return id;
        }
        let of = |id: Id| self.nodes[id].1;
        let varies = match node {
            Node::Number(_) => Varies::Never,
            Node::Parameter(_) => Varies::ByParameters,
            Node::Time | Node::Input(_) => Varies::ByStep,
            Node::State(_) => Varies::ByState,
            Node::One(_, a) => of(a),
            Node::Two(_, a, b) => of(a).max(of(b)),
            Node::If(a, b, c) => of(a).max(of(b)).max(of(c)),
        };
        self.nodes.push((node, varies));
        self.known.insert(node, self.nodes.len() - 1);
        self.nodes.len() - 1
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_computed_twice_stands_once() {
        let mut graph = Graph::default();
        let (x, k) = (graph.add(Node::State(0)), graph.add(Node::Parameter(0)));
        let a = graph.two(Binary::Mul, k, x);
        assert_eq!(graph.two(Binary::Mul, x, k), a);
        let two = graph.number(2.0);
        let four = graph.two(Binary::Pow, two, two);
        assert_eq!(graph.constant(four), Some(4.0));
        let eighth = graph.number(8.0);
        let before = graph.len();
        let power = graph.two(Binary::Pow, x, eighth);
        assert_eq!(graph.len(), before + 4, "x^8 is three products and a one");
        assert_eq!(graph.get(power).1, Varies::ByState);
        let root = graph.one(Unary::Sqrt, k);
        assert_eq!(graph.get(root).1, Varies::ByParameters);
    }
}
