//! Effects in fits and in diagnoses of real rigs.

#[path = "../common/agreement.rs"]
#[allow(dead_code)]
mod common;

use crate::records::measured;
use crate::rigs::{Drives, Heater};
use common::{compared, differing};
use truetwin::prelude::*;

/// Evidence of the effects that diagnoses of two rigs report is that of fits with each of them in the study.
pub fn fits_and_diagnoses_of_rigs_weigh_effects_alike() {
    let heater = RecordPlan::levels(1.0, 600, 0.0, 100.0, 60);
    let drives = RecordPlan::levels(0.02, 500, -2.0, 2.0, 25);
    let rigs = [
        (Study::new("heater", Heater, heater), "tclab-first.csv"),
        (Study::new("drives", Drives, drives), "drives-2.csv"),
    ];
    let mut wrong = vec![];
    for (study, file) in rigs {
        let (study, record) = (study.unwrap(), measured(file));
        wrong.extend(differing(study.name(), &compared(&study, &record, &[])));
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
}
