//! Golden answers of real rigs.

#[path = "../common/golden.rs"]
mod common;

use crate::records::{measured, tanks};
use crate::rigs::{Carriage, Heater};
use common::{Asks, Case, with_tables, worse};
use truetwin::prelude::*;

const FRICTION: &str = "[[effect]]\nid = 'coulomb-friction'\ntarget = 'v'\n[[effect]]\nid = 'constant-forcing'\ntarget = 'v'";

/// Answers of the tanks, the heater and the carriage stay, and no search ends lower than it did.
pub(crate) fn golden_answers_of_rigs_stay() {
    let (heater, carriage) = (
        Study::of(Heater).unwrap(),
        with_tables(&Study::of(Carriage).unwrap(), FRICTION),
    );
    let case = |name, study, record, asks| Case {
        name,
        study,
        records: vec![record],
        asks,
    };
    let worse = worse(&[
        case(
            "real-tanks-fit",
            tanks(),
            measured("cascaded-tanks-estimation.csv"),
            Asks::Fit,
        ),
        case(
            "emps-fit",
            carriage,
            every_other_row(&measured("emps-estimation.csv")),
            Asks::Fit,
        ),
        case(
            "tclab-1",
            heater,
            measured("tclab-first.csv"),
            Asks::Diagnosis,
        ),
    ]);
    assert!(worse.is_empty(), "{}", worse.join("\n"));
}

/// A record at twice its step, inputs averaged over it.
fn every_other_row(record: &Record) -> Record {
    let rows = record.samples() / 2;
    let inputs = record.drive().inputs();
    let mean = Signal::from_shape_fn((rows, inputs.ncols()), |(k, i)| {
        0.5 * (inputs[[2 * k, i]] + inputs[[2 * k + 1, i]])
    });
    let outputs = Signal::from_shape_fn((rows, record.outputs().ncols()), |(k, j)| {
        record.outputs()[[2 * k, j]]
    });
    Record::new(
        Drive::new(2.0 * record.drive().dt(), mean).unwrap(),
        outputs,
    )
    .unwrap()
}
