//! Reasons to doubt a diagnosis.

use super::FittedParameter;
use crate::fit::Warning;
use crate::record::Record;
use crate::twin::Twin;

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
    let mut all = Warning::still(&twin.signals(), records);
    for (r, record) in records.iter().enumerate() {
        if let Some(first) = records[..r].iter().position(|other| other == record) {
            let what = format!(
                "records {} and {} are the same and count twice",
                first + 1,
                r + 1
            );
            all.push(Warning::new("repeated-record", what));
        }
    }
    if let Some(same) = records.iter().position(|record| Some(record) == validation) {
        let what = format!("the validation record is the same as record {}", same + 1);
        all.push(Warning::new("validation-is-record", what));
    }
    for p in parameters {
        let side = p.parameter().bound_at(p.refitted, p.std_error);
        all.extend(side.map(|side| Warning::at_bound("at-bound", &p.name, side)));
    }
    if has_finer_step {
        let what =
            "the twin's own step is too long for the records; the diagnosis used a finer one";
        all.push(Warning::new("coarse-step", what.into()));
    }
    if let Some(rows) = searched {
        let of: usize = records.iter().map(Record::samples).sum();
        let what =
            format!("explanations were chosen on the first {rows} of {of} rows, and fitted to all");
        all.push(Warning::new("first-rows", what));
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::record::{Drive, Signal};
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
                "repeated-record",
                "validation-is-record",
                "at-bound",
                "coarse-step",
                "first-rows",
            ]
        );
        assert_eq!(told[2].what, "records 1 and 2 are the same and count twice");
    }
}
