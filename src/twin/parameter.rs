//! Parameters to estimate: names, units, prior box and physical bounds.

use crate::setting::number;
use crate::twin::{Interval, Noise, TwinError};
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;

/// The standard deviation of a uniform prior over its width, 1/√12; an estimate that is no better rests on the prior alone.
pub const PRIOR_DEVIATION: f64 = 0.288_675_134_594_812_9;

/// A value so near to a bound, in its own standard errors, lies at it.
const AT_BOUND: f64 = 0.1;

/// The kind of a parameter.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Role {
    /// A parameter of the twin's own equations.
    #[default]
    #[serde(rename = "physical")]
    Parameter,
    /// An unknown start of a state.
    Start,
    /// An unknown noise level.
    Noise,
    /// The magnitude of an effect that the twin lacked.
    #[serde(rename = "effect")]
    Magnitude,
}

impl Role {
    /// The name of a parameter of this role: `start.h1`, `noise.y`; of other roles, `target` itself.
    pub(crate) fn name(self, target: &str) -> String {
        format!("{}{target}", self.prefix())
    }

    /// Returns the state of a start called `name`, the state or output of a noise level, and `name` itself in other roles.
    pub(crate) fn target(self, name: &str) -> &str {
        name.strip_prefix(self.prefix()).unwrap_or(name)
    }

    /// The word of results for what is estimated beside the twin's own parameters; none for these.
    pub(crate) fn nuisance(self) -> Option<&'static str> {
        match self {
            Self::Parameter => None,
            Self::Start => Some("start"),
            Self::Noise => Some("noise"),
            Self::Magnitude => Some("effect"),
        }
    }

    /// The beginning of the names of parameters of this role.
    fn prefix(self) -> &'static str {
        match self {
            Self::Start => "start.",
            Self::Noise => "noise.",
            Self::Parameter | Self::Magnitude => "",
        }
    }
}

/// Side of a bound.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum Side {
    /// Lower bound.
    Low,
    /// Upper bound.
    High,
}

/// One parameter.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Parameter {
    /// Short name, as on the command line and in study files.
    pub name: String,
    /// Unit, for people.
    pub unit: String,
    /// Interval that simulations for training are drawn from, uniformly.
    pub prior: Interval,
    /// Physically possible values; estimates never leave them. They enclose the prior.
    pub bounds: Interval,
    /// Kind.
    pub role: Role,
}

impl Parameter {
    /// Bound that a value with this standard error lies at.
    pub(crate) fn bound_at(&self, value: f64, std_error: f64) -> Option<Side> {
        let reach = AT_BOUND * std_error;
        match value {
            value if value - self.bounds.low() <= reach => Some(Side::Low),
            value if self.bounds.high() - value <= reach => Some(Side::High),
            _ => None,
        }
    }

    /// A physical parameter with prior `[low, high]` and the same bounds; ends are checked with the twin.
    pub fn new(name: &str, unit: &str, low: f64, high: f64) -> Self {
        let prior = Interval::unchecked(low, high);
        Self {
            name: name.into(),
            unit: unit.into(),
            prior,
            bounds: prior,
            role: Role::Parameter,
        }
    }

    /// Sets the physical bounds to `[low, high]`.
    #[must_use]
    pub fn within(mut self, low: f64, high: f64) -> Self {
        self.bounds = Interval::unchecked(low, high);
        self
    }

    /// Checks that prior and bounds are finite and in order, and the prior inside the bounds.
    pub(crate) fn check(&self) -> Result<(), TwinError> {
        let Self {
            name,
            prior,
            bounds,
            ..
        } = self;
        let is_wrong = |of: &Interval| of.check().is_err() || !of.is_finite();
        let kinds = [("prior", prior), ("bounds", bounds)];
        let problem = if let Some((kind, wrong)) = kinds.iter().find(|(_, of)| is_wrong(of)) {
            format!(
                "{kind} of {name} is {wrong}; write finite [low, high] with low < high and a finite width"
            )
        } else if !bounds.contains(prior.low()) || !bounds.contains(prior.high()) {
            format!(
                "prior {prior} of {name} leaves its bounds {bounds}; shrink the prior or widen the bounds"
            )
        } else {
            return Ok(());
        };
        Err(TwinError::Parameter {
            name: name.clone(),
            problem,
        })
    }

    /// Checks that a value lies within the bounds.
    pub(crate) fn check_value(&self, value: f64) -> Result<(), TwinError> {
        let (low, high) = (self.bounds.low(), self.bounds.high());
        if self.bounds.contains(value) {
            return Ok(());
        }
        // What rounds to an end is told by its distance.
        let by = match [low, high].map(number).contains(&number(value)) {
            true => format!(" by {}", number((value - high).max(low - value))),
            false => String::new(),
        };
        Err(TwinError::Declaration(format!(
            "{} = {} is outside its bounds {}{by}; choose a value inside",
            self.name,
            number(value),
            self.bounds
        )))
    }

    /// Returns the state of a start, the state or output of a noise level, and the whole name of any other parameter.
    pub(crate) fn target(&self) -> &str {
        self.role.target(&self.name)
    }

    /// Returns the range that fits start in: the bounds, or the prior of a magnitude, whose bounds are wide in any unit.
    pub(crate) fn start_range(&self) -> Interval {
        match self.role {
            Role::Magnitude => self.prior,
            _ => self.bounds,
        }
    }

    /// Sets the role. A black box's own parameter may be called `start.…` or `noise.…` in that role alone.
    #[must_use]
    pub fn with_role(mut self, role: Role) -> Self {
        self.role = role;
        self
    }
}

/// Checks that no name of a `kind` is given twice.
pub(super) fn check_unique<'a>(
    kind: &str,
    names: impl IntoIterator<Item = &'a str>,
) -> Result<(), TwinError> {
    let mut seen = BTreeSet::new();
    match names.into_iter().find(|name| !seen.insert(*name)) {
        Some(name) => Err(TwinError::Declaration(format!(
            "duplicate {kind} name {name}; rename one"
        ))),
        None => Ok(()),
    }
}

/// The parameters of a twin, in the order of θ.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct ParameterSpace(Vec<Parameter>);

impl ParameterSpace {
    /// A space of these parameters, in the order of θ; [`check`](Self::check) finds faults.
    pub fn new(parameters: impl IntoIterator<Item = Parameter>) -> Self {
        Self(parameters.into_iter().collect())
    }

    /// Checks that names are unique, boxes in order, and priors inside bounds.
    pub fn check(&self) -> Result<(), TwinError> {
        if self.0.is_empty() {
            return Err(TwinError::Declaration(
                "the twin has no parameter to estimate; declare or free at least one".into(),
            ));
        }
        check_unique("parameter", self.names())?;
        self.0.iter().try_for_each(Parameter::check)
    }

    /// Checks that `theta` has the right length and lies in the bounds.
    pub fn check_point(&self, theta: &[f64]) -> Result<(), TwinError> {
        if theta.len() != self.len() {
            return Err(TwinError::Length {
                given: theta.len(),
                expected: self.len(),
                names: self.names().join(", "),
            });
        }
        for (parameter, &value) in self.0.iter().zip(theta) {
            parameter.check_value(value)?;
        }
        Ok(())
    }

    /// Adds a parameter at the end of θ.
    pub(crate) fn push(&mut self, parameter: Parameter) {
        self.0.push(parameter);
    }

    /// Number of parameters, d.
    pub fn len(&self) -> usize {
        self.0.len()
    }

    /// Tells whether there is no parameter.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Parameters in the order of θ.
    pub fn iter(&self) -> std::slice::Iter<'_, Parameter> {
        self.0.iter()
    }

    /// Names in the order of θ.
    pub fn names(&self) -> Vec<&str> {
        self.0.iter().map(|p| p.name.as_str()).collect()
    }

    /// Index in θ of the parameter called `name`.
    pub fn position(&self, name: &str) -> Result<usize, TwinError> {
        self.0
            .iter()
            .position(|p| p.name == name)
            .ok_or_else(|| TwinError::Unknown {
                name: name.into(),
                names: self.names().join(", "),
            })
    }

    /// Centre of the prior box.
    pub fn centre(&self) -> Vec<f64> {
        self.0.iter().map(|p| p.prior.centre()).collect()
    }

    /// Widths of the prior box: the scale of each parameter.
    pub fn widths(&self) -> Vec<f64> {
        self.0.iter().map(|p| p.prior.width()).collect()
    }

    /// Physical bounds.
    pub fn bounds(&self) -> Vec<Interval> {
        self.0.iter().map(|p| p.bounds).collect()
    }

    /// `theta` moved to the nearest point in the bounds.
    pub fn clamp(&self, theta: &[f64]) -> Vec<f64> {
        self.0
            .iter()
            .zip(theta)
            .map(|(p, &v)| p.bounds.clamp(v))
            .collect()
    }

    /// `theta` moved to the nearest point in the prior box.
    pub(crate) fn clamp_to_prior(&self, theta: &[f64]) -> Vec<f64> {
        (self.0.iter().zip(theta))
            .map(|(p, &v)| p.prior.clamp(v))
            .collect()
    }

    /// Uniform in the prior box, from the noise source `theta`.
    pub fn draw_prior(&self, noise: Noise) -> Vec<f64> {
        let mut source = noise.source("theta");
        self.0
            .iter()
            .map(|p| p.prior.low() + source.uniform() * p.prior.width())
            .collect()
    }

    /// Uniform in the physical bounds, magnitudes of effects in their prior; from the noise source `theta`.
    pub fn draw_bounds(&self, noise: Noise) -> Vec<f64> {
        let mut source = noise.source("theta");
        self.0
            .iter()
            .map(|p| {
                let range = p.start_range();
                range.low() + source.uniform() * range.width()
            })
            .collect()
    }
}

impl std::ops::Index<usize> for ParameterSpace {
    type Output = Parameter;
    fn index(&self, index: usize) -> &Parameter {
        &self.0[index]
    }
}

impl std::ops::IndexMut<usize> for ParameterSpace {
    fn index_mut(&mut self, index: usize) -> &mut Parameter {
        &mut self.0[index]
    }
}

/// The direction with the sign under which its first leading part is positive: a direction has no sign of its own, and
/// results must repeat. Parts within 1 % of the largest lead.
pub fn oriented(direction: &[f64]) -> Vec<f64> {
    let largest = direction.iter().fold(0.0f64, |a, v| a.max(v.abs()));
    let leading = direction.iter().find(|v| v.abs() >= 0.99 * largest);
    let sign = leading.map_or(1.0, |v| v.signum());
    direction.iter().map(|v| sign * v).collect()
}

/// A direction in words: `0.71·k1 − 0.71·k2`, parts under a twentieth of the largest left out.
pub fn combination(names: &[&str], direction: &[f64]) -> String {
    if let [name] = names {
        return (*name).to_owned();
    }
    let direction = oriented(direction);
    let largest = direction.iter().fold(0.0f64, |a, v| a.max(v.abs()));
    let mut text = String::new();
    for (name, value) in names.iter().zip(&direction) {
        if value.abs() > 0.05 * largest {
            text.push_str(match (text.is_empty(), *value < 0.0) {
                (true, true) => "−",
                (true, false) => "",
                (false, true) => " − ",
                (false, false) => " + ",
            });
            text.push_str(&format!("{:.2}·{name}", value.abs()));
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pair() -> ParameterSpace {
        ParameterSpace::new([
            Parameter::new("a", "s", 1.0, 3.0).within(0.0, 9.0),
            Parameter::new("b", "m", -1.0, 1.0),
        ])
    }

    #[test]
    fn a_prior_turned_inside_out_is_named() {
        let space = ParameterSpace::new([Parameter::new("k4", "-", 1.2, 0.8)]);
        let error = space.check().unwrap_err().to_string();
        assert_eq!(
            error,
            "prior of k4 is [1.2, 0.8]; write finite [low, high] with low < high and a finite width"
        );
    }

    #[test]
    fn a_prior_outside_the_bounds_is_named() {
        let space = ParameterSpace::new([Parameter::new("k", "-", 0.0, 2.0).within(0.5, 3.0)]);
        let error = space.check().unwrap_err().to_string();
        assert!(error.contains("leaves its bounds [0.5, 3]"), "{error}");
    }

    #[test]
    fn a_value_that_rounds_to_its_bound_is_told_by_its_distance() {
        let told = |value: f64| pair()[0].check_value(value).unwrap_err().to_string();
        assert!(told(12.0).contains("a = 12 is outside its bounds [0, 9];"));
        assert!(
            told(9.0 + 1e-9).contains("outside its bounds [0, 9] by 1.000000"),
            "{}",
            told(9.0 + 1e-9)
        );
    }

    #[test]
    fn nan_is_out_of_bounds() {
        assert!(pair().check_point(&[f64::NAN, 0.0]).is_err());
        assert!(pair().check_point(&[1.0]).is_err());
        assert!(pair().check_point(&[9.0, -1.0]).is_ok());
    }

    /// Seeds are contracts: these draws may not change between versions.
    #[test]
    fn prior_draws_are_pinned_and_uniform() {
        let space = pair();
        let draws: Vec<_> = (0..2000)
            .map(|i| space.draw_prior(Noise::new(1, "test", i)))
            .collect();
        assert!(draws.iter().all(|t| space[0].prior.contains(t[0])));
        let mean = draws.iter().map(|t| t[0]).sum::<f64>() / 2000.0;
        // sd of the mean: (width/√12)/√n = 0.013
        assert!((mean - 2.0).abs() < 0.06, "{mean}");
        assert_eq!(space.draw_prior(Noise::new(1, "test", 0)), draws[0]);
    }

    #[test]
    fn signs_and_small_parts() {
        let names = ["a", "b", "c"];
        assert_eq!(
            combination(&names, &[-0.7, 0.7000001, 0.01]),
            "0.70·a − 0.70·b"
        );
        assert_eq!(combination(&names, &[-0.3, 0.9, 0.0]), "−0.30·a + 0.90·b");
        assert_eq!(combination(&["nu"], &[1.0]), "nu");
    }
}
