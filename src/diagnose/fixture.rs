//! Records of the tanks that tests of several parts begin with.

use super::base::Base;
use super::settings::DiagnoseSettings;
use crate::effect::{Catalogue, augment};
use crate::fit::Passes;
use crate::hypothesis::search::model::Model;
use crate::hypothesis::term::Term;
use crate::record::Record;
use crate::study::{RecordPlan, Study};
use crate::twin::{Noise, Twin};
use crate::twins::CascadedTanks;
use std::sync::Arc;

/// The tanks with so many samples a record, 4 s apart.
pub(crate) fn tanks(samples: usize) -> Study {
    let plan = RecordPlan::levels(4.0, samples, 0.5, 3.0, 20);
    Study::new("tanks", CascadedTanks, plan).unwrap()
}

/// A record of a twin under a drive of the study.
pub(crate) fn record(study: &Study, twin: &Twin, theta: &[f64], seed: u64) -> Record {
    let drives = study.drives().unwrap();
    let drive = drives.draw(Noise::new(seed, "drive", 0)).unwrap();
    let outputs = twin.simulate(theta, &drive, Noise::new(seed, "record", 0));
    Record::new(drive, outputs.unwrap()).unwrap()
}

/// A record of the study's twin at the centre of its prior, its sensor biased.
pub(crate) fn biased_record(study: &Study, bias: f64, seed: u64) -> Record {
    let effect = Catalogue::default().effect("sensor-bias", "sensor");
    let twin = augment(study.twin().clone(), vec![effect.unwrap()]).unwrap();
    let theta = [study.twin().parameters().centre(), vec![bias]].concat();
    record(study, &twin, &theta, seed)
}

/// Settings with these effects of the library alone.
pub(crate) fn only(study: &Study, ids: &[&str]) -> DiagnoseSettings {
    DiagnoseSettings {
        without: (study.effects().iter().map(|e| e.id()))
            .filter(|id| !ids.contains(id))
            .map(Into::into)
            .collect(),
        ..DiagnoseSettings::default()
    }
}

/// The fitted twin of a study, and listed effects as hypotheses beside it.
pub(crate) fn fitted(study: &Study, records: &[Record]) -> (Model, Vec<Arc<Term>>) {
    let settings = DiagnoseSettings::default();
    let passes = Passes::default();
    let base = Base::new(study, study.twin(), records.into(), &settings, &passes).unwrap();
    let terms = base.listed(study, &settings).unwrap();
    (base.model, terms)
}

/// Listed effects as hypotheses beside the fitted twin of a study.
pub(crate) fn listed_terms(study: &Study, records: &[Record]) -> Vec<Arc<Term>> {
    fitted(study, records).1
}
