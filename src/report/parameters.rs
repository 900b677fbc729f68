//! The tables of parameters that `estimate`, `fit` and `diagnose` share.

use super::digits::{self, Digits, SHOWN};
use super::document::Block;
use super::document::Column::{Number, Text};
use crate::diagnose::FittedParameter;
use crate::math::three_digits;
use crate::setting::number;
use crate::setting::own_unit;
use crate::twin::{Interval, PRIOR_DEVIATION, Parameter, Role, Side};
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
    pub at_bound: Option<Side>,
    /// The value itself owes this share to the prior: it is an estimate of a network that has learnt the prior.
    #[serde(skip)]
    pub leans: bool,
    /// The interval holds that of the profile likelihood.
    #[serde(skip)]
    pub by_profile: bool,
    #[serde(skip)]
    pub role: Role,
    /// Values at other stages, in the order of their names.
    #[serde(skip)]
    pub stages: Vec<Option<f64>>,
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
            // Not a number where there is no error.
            prior_share: (std_error / prior).powi(2).clamp(0.0, 1.0),
            at_bound: parameter.bound_at(value, std_error),
            leans: false,
            by_profile: false,
            role: parameter.role,
            stages: vec![],
        }
    }

    /// One parameter of a diagnosis.
    pub fn diagnosed(p: &FittedParameter) -> Self {
        Self::new(&p.parameter(), p.refitted, p.std_error, p.interval)
    }

    /// The same with values at other stages.
    pub fn stages(self, stages: Vec<Option<f64>>) -> Self {
        Self { stages, ..self }
    }

    /// Name of a start or a noise level in words.
    fn label(&self) -> String {
        let target = self.role.target(&self.name);
        match self.role {
            Role::Parameter | Role::Magnitude => self.name.clone(),
            Role::Start => format!("start of {target}"),
            Role::Noise => format!("noise of {target}"),
        }
    }

    /// Remark: the note, or else how much of the prior is left in the value.
    fn remark(&self) -> String {
        match (self.note(), self.role) {
            ("", _) if self.by_profile => "interval by profile".to_owned(),
            ("", Role::Parameter) if self.prior_share >= SHOWN.leaning => {
                let share = digits::percent(self.prior_share);
                match self.leans {
                    true => format!("leans on prior: {share}"),
                    false => format!("share of prior {share}"),
                }
            }
            (note, _) => note.to_owned(),
        }
    }

    /// Returns whether readings show it, so that there is nothing to fit.
    fn is_shown(&self) -> bool {
        self.role == Role::Magnitude && self.std_error == 0.0
    }

    /// Special standing of the value; empty where it has none.
    fn note(&self) -> &'static str {
        let [low, high] = self.interval;
        let is_outside = high < self.prior.low() || low > self.prior.high();
        let is_anywhere = low <= self.bounds.low() && high >= self.bounds.high();
        match (self.at_bound, self.role) {
            (None, Role::Magnitude) if self.is_shown() && self.value.is_infinite() => "off",
            (None, Role::Magnitude) if self.is_shown() => match self.value {
                end if end == self.prior.low() || end == self.prior.high() => "end of the prior",
                _ => "shown by the readings",
            },
            (Some(Side::Low), _) => "at lower bound",
            (Some(_), _) => "at upper bound",
            (None, Role::Parameter) if self.prior_share >= 1.0 || is_anywhere => "not identified",
            (None, Role::Parameter) if is_outside => "outside prior",
            (None, _) => "",
        }
    }
}

/// An end of an interval, as `write` has it where it is a number.
fn end(value: f64, write: impl FnOnce(f64) -> String) -> String {
    match value {
        f64::INFINITY => "∞".to_owned(),
        f64::NEG_INFINITY => "−∞".to_owned(),
        value => write(value),
    }
}

/// The ends of an interval, three digits each at most.
fn range(interval: Interval) -> String {
    let [low, high] = [interval.low(), interval.high()]
        .map(|value| end(value, |v| number(three_digits(v)).replace('-', "−")));
    format!("{low}…{high}")
}

/// Values with errors and intervals of this level, in few columns.
pub(super) fn values(caption: &str, level: f64, rows: &[ParameterRow]) -> Block {
    let level = format!("{:.0} % interval", 100.0 * level);
    let head = [
        ("parameter", Text),
        ("value", Number),
        ("± std error", Number),
        (&level, Number),
        ("unit", Text),
        ("", Text),
    ];
    let cells = |row: &ParameterRow| {
        let digits = Digits::supported(row.value, row.std_error);
        let [low, high] = row.interval.map(|value| end(value, |v| digits.write(v)));
        vec![
            row.label(),
            digits.write(row.value),
            match row.is_shown() {
                true => "–".to_owned(),
                false => digits::error(row.std_error),
            },
            match row.is_shown() || row.interval.iter().all(|end| end.is_nan()) {
                true => "–".to_owned(),
                false => format!("[{low}, {high}]"),
            },
            own_unit(&row.unit).to_owned(),
            row.remark(),
        ]
    };
    Block::table(caption, &head, rows.iter().map(cells).collect())
}

/// Priors, bounds and values at other stages, which `stages` names.
pub(super) fn priors(stages: &[&str], rows: &[ParameterRow]) -> Block {
    let mut head = vec![("parameter", Text), ("prior", Number), ("bounds", Number)];
    head.extend(stages.iter().map(|name| (*name, Number)));
    let cells = |row: &ParameterRow| {
        let digits = Digits::supported(row.value, row.std_error);
        let stages = row.stages.iter();
        let stages = stages.map(|value| value.map_or("–".to_owned(), |v| digits.write(v)));
        let ranges = match row.role {
            Role::Parameter | Role::Start => [range(row.prior), range(row.bounds)],
            Role::Noise | Role::Magnitude => ["–", "–"].map(String::from),
        };
        std::iter::once(row.label())
            .chain(ranges)
            .chain(stages)
            .collect()
    };
    let caption = "Prior: the range that was trained on or expected. Not identified: the record says no more than the prior.";
    Block::table(caption, &head, rows.iter().map(cells).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn notes_say_what_is_special() {
        let parameter = Parameter::new("k", "1/s", 0.0, 1.0).within(0.0, 2.0);
        let note = |value: f64, error: f64| {
            ParameterRow::new(&parameter, value, error, [value - error, value + error]).remark()
        };
        assert_eq!(note(0.5, 0.01), "");
        assert_eq!(note(0.5, 0.3), "not identified");
        let anywhere = ParameterRow::new(&parameter, 1.0, 0.2, [0.0, 2.0]);
        assert_eq!(anywhere.remark(), "not identified");
        assert_eq!(note(1.5, 0.01), "outside prior");
        assert_eq!(note(0.5, PRIOR_DEVIATION / 2.0), "share of prior 25 %");
        assert_eq!(note(1.05, 0.05), "");
        assert_eq!(note(2.0, 0.01), "at upper bound");
        assert_eq!(note(0.0, 0.01), "at lower bound");
    }

    #[test]
    fn a_line_can_be_read_alone() {
        let parameter = Parameter::new("k", "1/s", -0.25, 1.0).within(f64::NEG_INFINITY, 2e9);
        let mut row = ParameterRow::new(&parameter, 0.5, 0.18, [0.2, 0.8]).stages(vec![Some(0.4)]);
        row.leans = true;
        let cells = |block: Block| match block {
            Block::Table(table) => table.rows[0].join("|"),
            _ => String::new(),
        };
        let rows = [row];
        let line = cells(values("", 0.9, &rows));
        assert_eq!(line, "k|0.50|0.18|[0.20, 0.80]|1/s|leans on prior: 25 %");
        assert_eq!(cells(priors(&["first"], &rows)), "k|−0.25…1|−∞…2e9|0.40");
    }
}
