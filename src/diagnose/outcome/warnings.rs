//! Reasons to doubt a diagnosis.

use super::FittedParameter;
use crate::fit::Warning;
use crate::record::{Quantity, Record, Signal};
use crate::twin::{Parameter, Twin};

/// Lists what makes a diagnosis doubtful: constant channels, repeated records, parameters at a bound, a coarse step, a
/// search that saw some of the rows.
pub(in crate::diagnose) fn warnings(
    twin: &Twin,
    records: &[Record],
    validation: Option<&Record>,
    parameters: &[FittedParameter],
    has_finer_step: bool,
    searched: Option<usize>,
) -> Vec<Warning> {
    let mut all = vec![];
    let mut warn = |code, what, remedy| all.push(Warning { code, what, remedy });
    let of = |r: usize| match records.len() {
        1 => String::new(),
        _ => format!(" of record {}", r + 1),
    };
    let signals = twin.signals();
    for (r, record) in records.iter().enumerate() {
        for name in constant(&signals.inputs, record.drive().inputs()) {
            warn(
                "constant-input",
                format!("the input {name}{} never changes", of(r)),
                "what acts through it cannot be told from a constant; give a record in which it moves",
            );
        }
        for name in constant(&signals.outputs, record.outputs()) {
            warn(
                "constant-output",
                format!("the output {name}{} never changes", of(r)),
                "a sensor that is stuck tells nothing of the twin; check it",
            );
        }
        if let Some(first) = records[..r].iter().position(|other| other == record) {
            warn(
                "repeated-record",
                format!(
                    "records {} and {} are the same and count twice",
                    first + 1,
                    r + 1
                ),
                "give each record once",
            );
        }
    }
    if let Some(same) = records.iter().position(|record| Some(record) == validation) {
        warn(
            "validation-is-record",
            format!("the validation record is the same as record {}", same + 1),
            "give a second measurement: the share closed is otherwise that of fitted data",
        );
    }
    for p in parameters {
        let parameter = Parameter::new(&p.name, &p.unit, p.prior.low(), p.prior.high())
            .within(p.bounds.low(), p.bounds.high());
        if let Some(side) = parameter.bound_at(p.refitted, p.std_error) {
            let side = if side == "low" { "lower" } else { "upper" };
            warn(
                "at-bound",
                format!("{} lies at its {side} bound", p.name),
                "widen [bounds] if other values are possible; its error means little here",
            );
        }
    }
    if has_finer_step {
        warn(
            "coarse-step",
            "the twin's own step is too long for the records; the diagnosis used a finer one"
                .into(),
            "set integrator and substeps in [record] of the study as this report has them",
        );
    }
    if let Some(rows) = searched {
        let all: usize = records.iter().map(Record::samples).sum();
        warn(
            "first-rows",
            format!(
                "explanations were chosen on the first {rows} of {all} rows, and fitted to all"
            ),
            "if something may begin later, diagnose that part of the record alone",
        );
    }
    all
}

/// Names of the channels that have a single value.
fn constant<'q>(names: &'q [Quantity], signal: &Signal) -> Vec<&'q str> {
    let is_constant = |j: usize| {
        let column = signal.column(j);
        let mut there = column.iter().filter(|value| !value.is_nan());
        there.next().is_some_and(|first| there.all(|v| v == first))
    };
    (names.iter().enumerate())
        .filter(|(j, _)| *j < signal.ncols() && is_constant(*j))
        .map(|(_, quantity)| quantity.name.as_str())
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::record::Drive;
    use crate::twin::Interval;
    use crate::twins::CascadedTanks;

    #[test]
    fn everything_doubtful_is_told() {
        let still = Signal::from_elem((5, 1), 2.0);
        let record = Record::new(Drive::new(0.5, still.clone()).unwrap(), still).unwrap();
        let parameter = FittedParameter {
            name: "k1".into(),
            unit: "-".into(),
            initial: None,
            alone: 1.5,
            refitted: 1.5,
            std_error: 0.1,
            interval: [1.4, 1.5],
            identified: true,
            prior: Interval::new(0.4, 0.8).unwrap(),
            bounds: Interval::new(0.1, 1.5).unwrap(),
        };
        let told = warnings(
            &Twin::new(CascadedTanks),
            &[record.clone(), record.clone()],
            Some(&record),
            &[parameter],
            true,
            Some(4),
        );
        let codes: Vec<&str> = told.iter().map(|warning| warning.code).collect();
        assert_eq!(
            codes,
            [
                "constant-input",
                "constant-output",
                "constant-input",
                "constant-output",
                "repeated-record",
                "validation-is-record",
                "at-bound",
                "coarse-step",
                "first-rows",
            ]
        );
        assert_eq!(told[4].what, "records 1 and 2 are the same and count twice");
    }
}
