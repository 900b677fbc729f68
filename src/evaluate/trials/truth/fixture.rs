//! Departures of one record, for tests.

use super::sizing::Experiment;
use crate::evaluate::trials::draft::Draft;
use crate::evaluate::trials::law::DeparturePlace;
use crate::evaluate::trials::listed::Variant;
use crate::evaluate::trials::scene::Scene;
use crate::evaluate::trials::world::{Conditions, RecordNoise, System, World};
use crate::study::Study;
use crate::twin::Noise;

/// A listed law of positive sign and its first shape.
pub(super) fn plain(id: &str, place: DeparturePlace) -> Draft {
    Draft::variant(id, place, None, Variant::of(id)[0]).unwrap()
}

/// Asks about departures from one record of a study at θ.
pub(super) fn experiment<R>(
    study: &Study,
    theta: &[f64],
    ask: impl FnOnce(&Experiment<'_>) -> R,
) -> R {
    let world = World::new(study.twin());
    let conditions = Conditions::declared();
    let noise = Noise::new(1, "theory", 0);
    let drive = study.drives().unwrap().draw(noise).unwrap();
    let scene = Scene::new(&world, theta, &drive, RecordNoise::of(noise)).unwrap();
    let system = System::new(theta, &conditions);
    ask(&Experiment::new(study, &world, system, &scene).unwrap())
}
