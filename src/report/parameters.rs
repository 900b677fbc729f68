//! The table of parameters that `estimate`, `fit` and `diagnose` share.

use super::digits::{self, Digits, unit_suffix};
use super::page::Column::{Number, Text};
use super::page::table;
use crate::diagnose::FittedParameter;
use crate::twin::{Interval, PRIOR_DEVIATION, Parameter, Role};
use serde::Serialize;

/// One parameter: what the record says of it beside what was said before.
#[derive(Debug, Clone, Serialize)]
pub(super) struct ParameterRow {
    /// Name, as in study files.
    pub name: String,
    /// Unit.
    pub unit: String,
    /// Estimate.
    pub value: f64,
    /// Standard error.
    pub std_error: f64,
    /// Ends of the interval.
    pub interval: [f64; 2],
    /// The prior box.
    pub prior: Interval,
    /// The physical bounds.
    pub bounds: Interval,
    /// Variance over that of the prior box, at most 1: near 0 the record decides, near 1 it adds nothing to the prior.
    pub prior_share: f64,
    /// The bound that the value lies at: `low` or `high`.
    pub at_bound: Option<&'static str>,
}

impl ParameterRow {
    pub fn new(parameter: &Parameter, value: f64, std_error: f64, interval: [f64; 2]) -> Self {
        let prior = PRIOR_DEVIATION * parameter.prior.width();
        Self {
            name: parameter.name.clone(),
            unit: parameter.unit.clone(),
            value,
            std_error,
            interval,
            prior: parameter.prior,
            bounds: parameter.bounds,
            prior_share: (std_error / prior).powi(2).min(1.0),
            at_bound: parameter.bound_at(value, std_error),
        }
    }

    /// One parameter of a diagnosis.
    pub fn diagnosed(p: &FittedParameter) -> Self {
        let parameter = Parameter::new(&p.name, &p.unit, p.prior.low(), p.prior.high())
            .within(p.bounds.low(), p.bounds.high());
        Self::new(&parameter, p.refitted, p.std_error, p.interval)
    }

    /// Cells of text: value, standard error, interval, prior, note.
    pub fn cells(&self, role: Role) -> [String; 5] {
        let digits = Digits::supported(self.value, self.std_error);
        let [low, high] = self.interval.map(|end| digits.write(end));
        let prior = match role {
            Role::Parameter | Role::Start => format!(
                "{} to {}",
                digits::short(self.prior.low()),
                digits::short(self.prior.high())
            ),
            Role::Noise | Role::Magnitude => String::new(),
        };
        [
            digits.write(self.value),
            digits::error(self.std_error),
            format!("[{low}, {high}]"),
            prior,
            self.note(role).to_owned(),
        ]
    }

    /// Returns whether no value of the interval is in the prior.
    fn is_outside(&self) -> bool {
        let [low, high] = self.interval;
        high < self.prior.low() || low > self.prior.high()
    }

    /// Remark on the value; empty where there is nothing to remark.
    pub fn note(&self, role: Role) -> &'static str {
        match (self.at_bound, role) {
            (Some("low"), _) => "at its lower bound",
            (Some(_), _) => "at its upper bound",
            (None, Role::Parameter) if self.prior_share >= 1.0 => "not identified",
            (None, Role::Parameter) if self.is_outside() => "outside prior",
            (None, _) => "",
        }
    }
}

/// A line of a page's table: the name, the role, the row, and cells of further columns before the value.
pub(super) type Line = (String, Role, ParameterRow, Vec<String>);

/// Table of a page; `more` are the heads of further columns.
pub(super) fn parameter_table(caption: &str, more: &[&str], lines: &[Line]) -> String {
    let mut head = vec![("parameter", Text)];
    head.extend(more.iter().map(|name| (*name, Number)));
    head.extend([
        ("value", Number),
        ("± std error", Number),
        ("interval", Number),
        ("unit", Text),
        ("prior", Number),
        ("", Text),
    ]);
    let rows: Vec<Vec<String>> = (lines.iter())
        .map(|(name, role, row, more)| {
            let [value, error, interval, prior, note] = row.cells(*role);
            let unit = unit_suffix(&row.unit).trim_start().to_owned();
            let mut cells = vec![name.clone()];
            cells.extend(more.iter().cloned());
            cells.extend([value, error, interval, unit, prior, note]);
            cells
        })
        .collect();
    table(caption, &head, &rows)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn notes_say_what_is_special() {
        let parameter = Parameter::new("k", "1/s", 0.0, 1.0).within(0.0, 2.0);
        let note = |value: f64, error: f64| {
            let row = ParameterRow::new(&parameter, value, error, [value - error, value + error]);
            row.cells(Role::Parameter)[4].clone()
        };
        assert_eq!(note(0.5, 0.01), "");
        assert_eq!(note(0.5, 0.3), "not identified");
        assert_eq!(note(1.5, 0.01), "outside prior");
        assert_eq!(note(1.05, 0.1), "");
        assert_eq!(note(2.0, 0.01), "at its upper bound");
        assert_eq!(note(0.0, 0.01), "at its lower bound");
    }

    #[test]
    fn the_prior_share_is_one_where_the_record_is_mute() {
        let parameter = Parameter::new("k", "", 0.0, 1.0);
        let share = |error| ParameterRow::new(&parameter, 0.5, error, [0.0, 1.0]).prior_share;
        assert_eq!(share(1.0), 1.0);
        assert!((share(PRIOR_DEVIATION / 10.0) - 0.01).abs() < 1e-12);
    }
}
