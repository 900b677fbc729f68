//! Departures of one record, for tests.

use super::sizing::Experiment;
use crate::evaluate::trials::draft::Draft;
use crate::evaluate::trials::law::DeparturePlace;
use crate::evaluate::trials::listed::{ListedLaw, Variant};
use crate::evaluate::trials::scene::Scene;
use crate::evaluate::trials::world::{Conditions, RecordNoise, System};
use crate::study::Study;
use crate::twin::Noise;

/// A listed law of positive sign and its first shape.
pub(super) fn plain(id: &str, place: DeparturePlace) -> Draft {
    let law = ListedLaw::named(id).unwrap();
    Draft::listed(law, place, None, Variant::of(law)[0])
}

/// Asks about departures from one record of a study at θ.
pub(super) fn experiment<R>(
    study: &Study,
    theta: &[f64],
    ask: impl FnOnce(&Experiment<'_>) -> R,
) -> R {
    let conditions = Conditions::declared();
    let noise = Noise::new(1, "theory", 0);
    let drive = study.drives().unwrap().draw(noise).unwrap();
    let scene = Scene::new(study.twin(), theta, &drive, RecordNoise::of(noise)).unwrap();
    let system = System::new(theta, &conditions);
    ask(&Experiment::new(study, system, &scene).unwrap())
}
