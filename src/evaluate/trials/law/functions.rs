//! Random functions: expression trees, and samples of Gaussian processes by random Fourier features.

use crate::evaluate::trials::numbers::TRIAL;
use crate::twin::Source;
use serde::{Deserialize, Serialize};
use std::f64::consts::TAU;
use std::fmt;

/// A node of an expression in standardised arguments.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(in crate::evaluate::trials) enum Tree {
    /// Argument with this index.
    Argument(usize),
    /// Number.
    Number(f64),
    Sum(Box<Tree>, Box<Tree>),
    Product(Box<Tree>, Box<Tree>),
    Sine(Box<Tree>),
    Square(Box<Tree>),
    /// tanh of the inner one.
    Bend(Box<Tree>),
    /// exp(−z²).
    Bump(Box<Tree>),
    /// Absolute value.
    Size(Box<Tree>),
    /// The inner one where it is positive, else 0.
    Part(Box<Tree>),
}

impl Tree {
    /// Draws a tree that depends on every argument; with kinks, if asked.
    pub fn draw(arguments: usize, kinked: bool, source: &mut Source) -> Self {
        let mut root = Self::grown(0, source);
        for argument in 1..arguments {
            let other = Self::grown(argument, source);
            root = match source.happens(0.6) {
                true => Self::Product(Box::new(root), Box::new(other)),
                false => Self::sum(root, other),
            };
        }
        if !kinked {
            return root;
        }
        let shifted = Self::sum(root, Self::Number(uniform(source, -0.7, 0.7)));
        match source.happens(0.5) {
            true => Self::Size(Box::new(shifted)),
            false => Self::Part(Box::new(shifted)),
        }
    }

    /// A smooth function of one argument.
    fn grown(argument: usize, source: &mut Source) -> Self {
        let times = |factor: f64| {
            let argument = Box::new(Self::Argument(argument));
            Self::Product(Box::new(Self::Number(factor)), argument)
        };
        let slope = times(uniform(source, 0.8, 3.0));
        let line = Self::sum(slope, Self::Number(uniform(source, -1.0, 1.0)));
        let line = Box::new(line);
        let inner = match (4.0 * source.uniform()) as usize {
            0 => Self::Sine(line),
            1 => Self::Square(line),
            2 => Self::Bend(line),
            _ => Self::Bump(line),
        };
        if source.happens(0.5) {
            return inner;
        }
        let again = times(uniform(source, -1.5, 1.5));
        Self::sum(inner, Self::Sine(Box::new(again)))
    }

    fn sum(a: Self, b: Self) -> Self {
        Self::Sum(Box::new(a), Box::new(b))
    }

    /// The value at these arguments.
    pub fn at(&self, z: &[f64]) -> f64 {
        match self {
            Self::Argument(i) => z[*i],
            Self::Number(v) => *v,
            Self::Sum(a, b) => a.at(z) + b.at(z),
            Self::Product(a, b) => a.at(z) * b.at(z),
            Self::Sine(a) => a.at(z).sin(),
            Self::Square(a) => a.at(z).powi(2),
            Self::Bend(a) => a.at(z).tanh(),
            Self::Bump(a) => (-a.at(z).powi(2)).exp(),
            Self::Size(a) => a.at(z).abs(),
            Self::Part(a) => a.at(z).max(0.0),
        }
    }
}

fn uniform(source: &mut Source, low: f64, high: f64) -> f64 {
    low + (high - low) * source.uniform()
}

impl fmt::Display for Tree {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Argument(i) => write!(f, "z{}", i + 1),
            Self::Number(v) => write!(f, "{v:.2}"),
            Self::Sum(a, b) => write!(f, "({a} + {b})"),
            Self::Product(a, b) => write!(f, "{a}·{b}"),
            Self::Sine(a) => write!(f, "sin({a})"),
            Self::Square(a) => write!(f, "({a})²"),
            Self::Bend(a) => write!(f, "tanh({a})"),
            Self::Bump(a) => write!(f, "exp(−({a})²)"),
            Self::Size(a) => write!(f, "|{a}|"),
            Self::Part(a) => write!(f, "max(0, {a})"),
        }
    }
}

/// One sample of a stationary Gaussian process with a squared-exponential covariance: Σ a·cos(w·z + b).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(in crate::evaluate::trials) struct Waves {
    frequencies: Vec<Vec<f64>>,
    amplitudes: Vec<f64>,
    phases: Vec<f64>,
}

impl Waves {
    /// Draws a sample over standardised arguments; `length` is its length scale in their unit.
    pub fn draw(arguments: usize, length: f64, source: &mut Source) -> Self {
        let scale = (2.0 / TRIAL.wave_features as f64).sqrt();
        let (mut frequencies, mut amplitudes, mut phases) = (vec![], vec![], vec![]);
        for _ in 0..TRIAL.wave_features {
            frequencies.push((0..arguments).map(|_| source.normal() / length).collect());
            amplitudes.push(scale * source.normal());
            phases.push(TAU * source.uniform());
        }
        Self {
            frequencies,
            amplitudes,
            phases,
        }
    }

    /// The value at these arguments.
    pub fn at(&self, z: &[f64]) -> f64 {
        (self
            .frequencies
            .iter()
            .zip(&self.amplitudes)
            .zip(&self.phases))
        .map(|((w, a), b)| {
            let angle: f64 = w.iter().zip(z).map(|(w, z)| w * z).sum();
            a * (angle + b).cos()
        })
        .sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::twin::Noise;

    #[test]
    fn trees_depend_on_every_argument_and_are_each_new() {
        let mut texts = std::collections::BTreeSet::new();
        for i in 0..40 {
            let mut source = Noise::new(1, "trees", i).source("tree");
            let tree = Tree::draw(2, i % 2 == 0, &mut source);
            let grid = |f: &dyn Fn(f64) -> [f64; 2]| -> Vec<f64> {
                (-20..=20)
                    .map(|k| tree.at(&f(0.1 * f64::from(k))))
                    .collect()
            };
            for values in [grid(&|z| [z, 0.7]), grid(&|z| [0.7, z])] {
                assert!(values.iter().all(|v| v.is_finite()));
            }
            texts.insert(tree.to_string());
        }
        assert_eq!(texts.len(), 40);
    }

    #[test]
    fn a_known_tree_has_its_value_and_its_text() {
        let tree = Tree::Size(Box::new(Tree::Sum(
            Box::new(Tree::Sine(Box::new(Tree::Argument(0)))),
            Box::new(Tree::Number(-2.0)),
        )));
        assert_eq!(tree.at(&[0.0]), 2.0);
        assert_eq!(tree.to_string(), "|(sin(z1) + -2.00)|");
    }

    /// Over samples the variance is 1, and the correlation at one length scale exp(−½) = 0.61.
    #[test]
    fn samples_have_the_covariance_of_their_process() {
        let (mut square, mut product) = (0.0, 0.0);
        let n = 2000;
        for i in 0..n {
            let waves = Waves::draw(1, 0.5, &mut Noise::new(2, "waves", i).source("w"));
            let (a, b) = (waves.at(&[0.2]), waves.at(&[0.7]));
            square += a * a / n as f64;
            product += a * b / n as f64;
        }
        assert!((square - 1.0).abs() < 0.15, "{square}");
        assert!((product - 0.61).abs() < 0.12, "{product}");
    }
}
