//! Effects in fits and in diagnoses, over the library.

#[path = "../common/agreement.rs"]
mod common;
#[path = "../../examples/rooms.rs"]
#[allow(dead_code, unreachable_pub, clippy::duplicate_mod)]
pub(crate) mod rooms;

use common::{compared, differing, simulated};
use truetwin::evaluate::paper::reference_studies;
use truetwin::prelude::*;

fn reference(name: &str) -> Study {
    let mut all = reference_studies().unwrap().into_iter();
    all.find(|study| study.name() == name).unwrap()
}

#[test]
fn a_fit_and_a_diagnosis_weigh_an_effect_alike() {
    let plan = RecordPlan::levels(4.0, 80, 0.5, 3.0, 20);
    let tanks = Study::new("tanks", truetwin::twins::CascadedTanks, plan).unwrap();
    let all: Vec<String> = tanks.effects().iter().map(|e| e.id().to_owned()).collect();
    let mut wrong = vec![];
    for (id, magnitudes, kept) in [
        (
            "sensor-bias",
            &[4.0][..],
            &["sensor-lag", "linear-loss", "parameter-step"][..],
        ),
        ("sensor-saturation", &[-9.0, 3.0], &["sensor-bias"]),
    ] {
        let record = simulated(&tanks, id, "sensor", magnitudes, &[0.6, 0.5, 0.55, 1.0]);
        let without: Vec<&str> = (all.iter().map(String::as_str))
            .filter(|other| *other != id && !kept.contains(other))
            .collect();
        let all = compared(&tanks, &record, &without);
        assert!(
            all.iter()
                .any(|c| c.key.starts_with(id) && c.diagnosed > 10.0),
            "{id}"
        );
        wrong.extend(differing(id, &all));
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
}

#[test]
#[ignore = "minutes; run it in release"]
fn fits_and_diagnoses_weigh_the_library_alike() {
    let mut wrong = vec![];
    let tanks = reference("tanks");
    let theta = [0.6, 0.5, 0.55, 1.0];
    let leaking = simulated(&tanks, "linear-loss", "h1", &[0.1], &theta);
    wrong.extend(differing("tanks", &compared(&tanks, &leaking, &[])));
    let oscillator = reference("van-der-pol");
    let dragged = simulated(&oscillator, "quadratic-drag", "x2", &[0.05], &[1.5]);
    wrong.extend(differing(
        "van-der-pol",
        &compared(&oscillator, &dragged, &[]),
    ));
    let rooms = {
        let records = RecordPlan::levels(0.1, 200, 0.0, 1.0, 25);
        Study::new("rooms", rooms::Rooms, records).unwrap()
    };
    let late = simulated(&rooms, "sensor-lag", "sensor2", &[1.5], &[1.0, 0.4]);
    wrong.extend(differing("rooms", &compared(&rooms, &late, &[])));
    assert!(wrong.is_empty(), "{wrong:#?}");
}
