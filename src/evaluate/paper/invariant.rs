//! Functions of θ that a record determines, and changes that it hardly shows.

use crate::twin::ParameterSpace;

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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::twin::Parameter;

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
