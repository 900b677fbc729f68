//! Departures of one record, for tests.

use super::sizing::Stage;
use crate::evaluate::trials::draft::Draft;
use crate::evaluate::trials::information::Information;
use crate::evaluate::trials::law::DeparturePlace;
use crate::evaluate::trials::listed::Variant;
use crate::evaluate::trials::scene::Scene;
use crate::evaluate::trials::world::{Conditions, RecordNoise, World};
use crate::study::Study;
use crate::twin::Noise;

/// A listed law of positive sign and its first shape.
pub(super) fn plain(id: &str, place: DeparturePlace) -> Draft {
    Draft::variant(id, place, None, Variant::of(id)[0]).unwrap()
}

/// Asks about departures from one record of a study at θ.
pub(super) fn on_stage<R>(
    study: &Study,
    theta: &[f64],
    ask: impl FnOnce(&Stage<'_>, &Information) -> R,
) -> R {
    let world = World::new(study.twin());
    let conditions = Conditions::declared();
    let noise = Noise::new(1, "theory", 0);
    let drive = study.drives().unwrap().draw(noise).unwrap();
    let draws = RecordNoise::of(noise);
    let scene = Scene::new(&world, theta, &drive, draws).unwrap();
    let stage = Stage {
        world: &world,
        theta,
        conditions: &conditions,
        drive: &drive,
        draws,
        scene: &scene,
    };
    let plain = stage.records(&[]).unwrap();
    let plain = plain.each_ref().map(std::slice::from_ref);
    let information = Information::new(study, theta, &conditions, plain);
    ask(&stage, &information.unwrap().unwrap())
}
