//! Published knowledge about twins, and the methods that it scores.

use crate::evaluate::baseline::Initialisation;
use crate::twin::ParameterSpace;
use serde::{Deserialize, Serialize};
use std::fmt;

/// Published knowledge about a twin: test points, quantities that a record determines, figures.
#[derive(Debug, Clone, Default)]
pub struct Benchmark {
    /// Parameters of the test points; empty where there are none.
    pub points: &'static [TestPoint],
    /// The first input of every record, as levels; empty for the study's own random inputs.
    pub levels: &'static [f64],
    /// Samples that a level is held.
    pub hold: usize,
    /// Functions of θ that a record determines.
    pub invariants: &'static [Invariant],
    /// Change of θ that a record hardly shows.
    pub symmetry: Option<Symmetry>,
    /// Published figures, of [`Scenario::First`](super::Scenario::First).
    pub published: &'static [(ScoredMethod, Published)],
}

/// A parameter and its values at OOD 1 and OOD 2.
pub type TestPoint = (&'static str, [f64; 2]);

/// A published figure.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Published {
    /// Mean squared error.
    pub mse: f64,
    /// Milliseconds a record, on the authors' machine.
    #[serde(rename = "ms")]
    pub milliseconds: f64,
}

/// A function of θ that a record determines, though it may not determine each parameter.
#[derive(Debug, Clone, Copy)]
pub struct Invariant {
    /// Formula: `k1·k2`.
    pub name: &'static str,
    /// Parameters that it reads, by name.
    pub parameters: &'static [&'static str],
    /// Its value, from these parameters in this order.
    pub value: fn(&[f64]) -> f64,
}

impl Invariant {
    /// The functional over the whole of θ; `None` where θ lacks one of its parameters (it was fixed, say).
    pub fn bind(self, space: &ParameterSpace) -> Option<impl Fn(&[f64]) -> f64 + use<>> {
        let at = positions(space, self.parameters)?;
        Some(move |theta: &[f64]| (self.value)(&pick(theta, &at)))
    }
}

/// A change of θ that leaves every noise-free output as it is, so that a record hardly shows it.
#[derive(Debug, Clone, Copy)]
pub struct Symmetry {
    /// Parameters that change, by name.
    pub parameters: &'static [&'static str],
    /// The direction v of the change, from these parameters at the truth, in their order.
    pub direction: fn(&[f64]) -> Vec<f64>,
}

impl Symmetry {
    /// The squared length of an error without its part along the symmetry, averaged over the d parameters:
    ///
    /// ```text
    /// e⊥ = e − v·(vᵀe)/(vᵀv),   e = θ̂ − θ,   result ‖e⊥‖²/d
    /// ```
    ///
    /// with v at `truth`. `None` where θ lacks a parameter: then it cannot move along the symmetry either.
    pub fn bind(self, space: &ParameterSpace) -> Option<impl Fn(&[f64], &[f64]) -> f64 + use<>> {
        let at = positions(space, self.parameters)?;
        Some(move |theta: &[f64], truth: &[f64]| {
            let mut v = vec![0.0; truth.len()];
            for (&j, part) in at.iter().zip((self.direction)(&pick(truth, &at))) {
                v[j] = part;
            }
            let e: Vec<f64> = theta.iter().zip(truth).map(|(a, b)| a - b).collect();
            let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(x, y)| x * y).sum::<f64>();
            let along = dot(&v, &e) / dot(&v, &v);
            let squares = e.iter().zip(&v).map(|(e, v)| (e - along * v).powi(2));
            squares.sum::<f64>() / truth.len() as f64
        })
    }
}

fn positions(space: &ParameterSpace, names: &[&str]) -> Option<Vec<usize>> {
    names.iter().map(|name| space.position(name).ok()).collect()
}

fn pick(theta: &[f64], at: &[usize]) -> Vec<f64> {
    at.iter().map(|&j| theta[j]).collect()
}

/// Scored method.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(into = "String", try_from = "String")]
#[non_exhaustive]
pub enum ScoredMethod {
    /// The pretrained network.
    TsPre,
    /// Gauss–Newton, whatever the gate says.
    GaussNewton,
    /// Tuned heads, whatever the gate says.
    TsFine,
    /// The estimator's answer: gate, misfit and all.
    Final,
    /// The prediction-error method, the paper's six steps.
    PredictionError(Initialisation),
    /// The dual Kalman filter; of twins with equations only.
    DualFilter(Initialisation),
}

impl ScoredMethod {
    /// Every row, in the order of a table.
    pub fn all() -> Vec<Self> {
        let mut all = vec![Self::TsPre, Self::GaussNewton, Self::TsFine, Self::Final];
        all.extend(Initialisation::ALL.map(Self::PredictionError));
        all.extend(Initialisation::ALL.map(Self::DualFilter));
        all
    }

    /// Start of a baseline.
    pub fn initialisation(self) -> Option<Initialisation> {
        match self {
            Self::PredictionError(start) | Self::DualFilter(start) => Some(start),
            _ => None,
        }
    }

    /// Method and start: `PEM (bad)`.
    pub fn label(self) -> String {
        match self.initialisation() {
            Some(start) => format!("{self} ({start})"),
            None => self.to_string(),
        }
    }
}

impl fmt::Display for ScoredMethod {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::TsPre => "TS-pre",
            Self::GaussNewton => "GN",
            Self::TsFine => "TS-fine",
            Self::Final => "final",
            Self::PredictionError(_) => "PEM",
            Self::DualFilter(_) => "dual-EKF",
        })
    }
}

impl From<ScoredMethod> for String {
    fn from(method: ScoredMethod) -> Self {
        method.label()
    }
}

impl TryFrom<String> for ScoredMethod {
    type Error = String;

    fn try_from(label: String) -> Result<Self, String> {
        let found = Self::all().into_iter().find(|m| m.label() == label);
        found.ok_or_else(|| format!("no method is called \"{label}\""))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::twin::Parameter;

    #[test]
    fn every_label_is_read_again() {
        for method in ScoredMethod::all() {
            assert_eq!(ScoredMethod::try_from(String::from(method)), Ok(method));
        }
        assert!(ScoredMethod::try_from("PEM (worst)".to_owned()).is_err());
    }

    fn space(names: &[&str]) -> ParameterSpace {
        ParameterSpace::new(names.iter().map(|n| Parameter::new(n, "-", 0.0, 2.0)))
    }

    #[test]
    fn parameters_are_found_by_name() {
        let ratio = Invariant {
            name: "a/b",
            parameters: &["a", "b"],
            value: |p| p[0] / p[1],
        };
        let of = ratio.bind(&space(&["b", "c", "a"])).unwrap();
        assert_eq!(of(&[2.0, 7.0, 1.0]), 0.5);
        assert!(ratio.bind(&space(&["a", "c"])).is_none());
    }

    /// v = (1, 0, 1): an error along it vanishes, one across it stays, a mixed one loses its part along v.
    #[test]
    fn the_part_along_the_symmetry_is_left_out() {
        let symmetry = Symmetry {
            parameters: &["c", "a"],
            direction: |_| vec![1.0, 1.0],
        };
        let error = symmetry.bind(&space(&["a", "b", "c"])).unwrap();
        let truth = [1.0, 1.0, 1.0];
        assert_eq!(error(&[1.5, 1.0, 1.5], &truth), 0.0);
        assert!((error(&[1.0, 1.3, 1.0], &truth) - 0.09 / 3.0).abs() < 1e-15);
        assert!((error(&[1.2, 1.0, 1.0], &truth) - 0.02 / 3.0).abs() < 1e-15);
    }
}
