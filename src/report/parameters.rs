//! The table of parameters that `estimate`, `fit` and `diagnose` share.

use super::digits::{self, Digits, unit_suffix};
use super::page::Column::{Number, Text};
use super::page::table;
use crate::diagnose::FittedParameter;
use crate::math::three_digits;
use crate::setting::number;
use crate::twin::{Interval, PRIOR_DEVIATION, Parameter, Role};
use serde::Serialize;

/// Share of the prior from which on a remark names it.
const LEANING: f64 = 0.1;

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
    /// The value itself owes this share to the prior: it is an estimate of a network that has learnt the prior.
    #[serde(skip)]
    pub leans: bool,
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
            leans: false,
        }
    }

    /// One parameter of a diagnosis.
    pub fn diagnosed(p: &FittedParameter) -> Self {
        let parameter = Parameter::new(&p.name, &p.unit, p.prior.low(), p.prior.high())
            .within(p.bounds.low(), p.bounds.high());
        Self::new(&parameter, p.refitted, p.std_error, p.interval)
    }

    /// Cells of a table: value, standard error, interval, prior, bounds, remark.
    fn cells(&self, role: Role) -> [String; 6] {
        let digits = Digits::supported(self.value, self.std_error);
        let [low, high] = self.interval.map(|end| digits.write(end));
        let [prior, bounds] = match role {
            Role::Parameter | Role::Start => [range(self.prior), range(self.bounds)],
            Role::Noise | Role::Magnitude => [String::new(), String::new()],
        };
        [
            digits.write(self.value),
            digits::error(self.std_error),
            format!("[{low}, {high}]"),
            prior,
            bounds,
            self.remark(role),
        ]
    }

    /// Remark of a table: the note, or else how much of the prior is left in the value.
    fn remark(&self, role: Role) -> String {
        match (self.note(role), role) {
            ("", Role::Parameter) if self.prior_share >= LEANING => {
                let share = digits::percent(self.prior_share);
                match self.leans {
                    true => format!("leans on prior: {share}"),
                    false => format!("share of prior {share}"),
                }
            }
            (note, _) => note.to_owned(),
        }
    }

    /// Returns whether no value of the interval is in the prior.
    fn is_outside(&self) -> bool {
        let [low, high] = self.interval;
        high < self.prior.low() || low > self.prior.high()
    }

    /// Remark on the value; empty where there is nothing to remark.
    pub fn note(&self, role: Role) -> &'static str {
        match (self.at_bound, role) {
            (Some("low"), _) => "at lower bound",
            (Some(_), _) => "at upper bound",
            (None, Role::Parameter) if self.prior_share >= 1.0 => "not identified",
            (None, Role::Parameter) if self.is_outside() => "outside prior",
            (None, _) => "",
        }
    }
}

/// The ends of an interval, three digits each at most.
fn range(interval: Interval) -> String {
    let end = |value: f64| match value {
        f64::INFINITY => "∞".to_owned(),
        f64::NEG_INFINITY => "−∞".to_owned(),
        value => number(three_digits(value)).replace('-', "−"),
    };
    format!("{}…{}", end(interval.low()), end(interval.high()))
}

/// A line of the table: the name, the role, the row, and cells of further columns before the value.
pub(super) type Line = (String, Role, ParameterRow, Vec<String>);

/// Head and rows of the table as text: name, unit, further columns with the heads `more`, value, error, interval, prior, bounds, remark.
pub(super) fn parameter_rows(
    [value, interval]: [&str; 2],
    more: &[&str],
    lines: &[Line],
) -> Vec<Vec<String>> {
    let mut head = vec!["parameter", "unit"];
    head.extend(more);
    head.extend([value, "± std error", interval, "prior", "bounds", ""]);
    let head = head.into_iter().map(str::to_owned).collect();
    let rows = lines.iter().map(|(name, role, row, more)| {
        let start = [name.clone(), row.unit.clone()];
        [&start[..], more, &row.cells(*role)].concat()
    });
    std::iter::once(head).chain(rows).collect()
}

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
        ("bounds", Number),
        ("", Text),
    ]);
    let rows: Vec<Vec<String>> = (lines.iter())
        .map(|(name, role, row, more)| {
            let [value, error, interval, prior, bounds, remark] = row.cells(*role);
            let unit = unit_suffix(&row.unit).trim_start().to_owned();
            let mut cells = vec![name.clone()];
            cells.extend(more.iter().cloned());
            cells.extend([value, error, interval, unit, prior, bounds, remark]);
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
            row.cells(Role::Parameter)[5].clone()
        };
        assert_eq!(note(0.5, 0.01), "");
        assert_eq!(note(0.5, 0.3), "not identified");
        assert_eq!(note(1.5, 0.01), "outside prior");
        assert_eq!(note(0.5, PRIOR_DEVIATION / 2.0), "share of prior 25 %");
        assert_eq!(note(1.05, 0.05), "");
        assert_eq!(note(2.0, 0.01), "at upper bound");
        assert_eq!(note(0.0, 0.01), "at lower bound");
    }

    /// Text and page have the same columns.
    #[test]
    fn a_line_can_be_read_alone() {
        let parameter = Parameter::new("k", "1/s", -0.25, 1.0).within(f64::NEG_INFINITY, 2e9);
        let mut row = ParameterRow::new(&parameter, 0.5, 0.18, [0.2, 0.8]);
        row.leans = true;
        let line = || {
            (
                "k".to_owned(),
                Role::Parameter,
                row.clone(),
                vec!["0.4".to_owned()],
            )
        };
        let text = parameter_rows(["final", "90 % interval"], &["initial"], &[line()]);
        assert_eq!(text[0].len(), text[1].len());
        assert_eq!(
            text[1].join("|"),
            "k|1/s|0.4|0.50|0.18|[0.20, 0.80]|−0.25…1|−∞…2e9|leans on prior: 25 %"
        );
        let page = parameter_table("", &["initial"], &[line()]);
        assert!(
            page.contains("−∞…2e9") && page.contains("leans on prior: 25 %"),
            "{page}"
        );
        let level = parameter.with_role(Role::Noise);
        let row = ParameterRow::new(&level, 0.5, 0.18, [0.2, 0.8]);
        assert_eq!(row.cells(Role::Noise)[3..], ["", "", ""]);
    }

    #[test]
    fn the_prior_share_is_one_where_the_record_is_mute() {
        let parameter = Parameter::new("k", "", 0.0, 1.0);
        let share = |error| ParameterRow::new(&parameter, 0.5, error, [0.0, 1.0]).prior_share;
        assert_eq!(share(1.0), 1.0);
        assert!((share(PRIOR_DEVIATION / 10.0) - 0.01).abs() < 1e-12);
    }
}
