//! Exact equivalents are right answers, and the same with the other sign are not.

use super::*;
use crate::evaluate::trials::law::DeparturePlace;
use crate::evaluate::trials::places::TwinPlaces;
use crate::evaluate::trials::truth::fixture::experiment;
use crate::study::{RecordPlan, Study};
use crate::twin::Parameter;
use crate::twin::fixture::OneState;

/// A leaking vessel whose level and input are never near zero: ḣ = u − k·h, u from 1 to 3.
fn vessel() -> OneState {
    let k = Parameter::new("k", "1/s", 0.3, 1.5).within(0.1, 4.0);
    OneState {
        state: "h",
        start: Some(2.0),
        noise: [0.01, 0.02],
        substeps: 10,
        ..OneState::leaking(k)
    }
}

/// Right answers to a departure of about 40 nats; its rival is none of them and leaves less than all.
fn right(id: &str, place: DeparturePlace, sign: f64) -> Vec<String> {
    let plan = RecordPlan::levels(0.3, 200, 1.0, 3.0, 10);
    let study = Study::new("vessel", vessel(), plan).unwrap();
    let listed = Listed::all(&study, &TwinPlaces::new(study.twin()));
    let law = ListedLaw::named(id).unwrap();
    let variant = *Variant::of(law).last().unwrap();
    let variant = Variant { sign, ..variant };
    experiment(&study, &[0.7], |experiment| {
        let draft = Draft::listed(law, place, None, variant);
        let sized = experiment.sized(&draft, 40.0).unwrap().unwrap();
        let all = Imitators::of(experiment, &sized, None, &listed).unwrap();
        let rival = rival(std::slice::from_ref(&all)).unwrap();
        assert!(!all.right.contains(&rival.effect), "{all:?}");
        assert!((0.2..=sized.nats * 1.01).contains(&rival.nats), "{all:?}");
        all.right
    })
}

fn holds(right: &[String], key: &str) -> bool {
    right.iter().any(|r| r == key)
}

/// A push against a level that is never negative is friction, and a bias of the input; a push upwards is no friction.
#[test]
fn a_negative_push_on_a_level_is_friction() {
    let down = right("constant-forcing", DeparturePlace::State(0), -1.0);
    let up = right("constant-forcing", DeparturePlace::State(0), 1.0);
    for key in ["constant-forcing@h", "actuator-bias@actuator"] {
        assert!(holds(&down, key) && holds(&up, key), "{down:?} {up:?}");
    }
    let friction = "coulomb-friction@h";
    assert!(holds(&down, friction), "{down:?}");
    assert!(!holds(&up, friction), "{up:?}");
}

/// A power law of exponent 2 is a quadratic drag, which is no push.
#[test]
fn a_quadratic_drag_is_a_power_law() {
    let drag = right("quadratic-drag", DeparturePlace::State(0), 1.0);
    assert!(holds(&drag, "power-law@h"), "{drag:?}");
    assert!(!holds(&drag, "sensor-lag@sensor"), "{drag:?}");
}

/// Where the input stays beyond it, a dead zone is a bias of half its width. A lag is nothing of the kind.
#[test]
fn a_dead_zone_that_is_never_entered_is_a_bias() {
    let zone = right("actuator-dead-zone", DeparturePlace::Actuator(0), 1.0);
    for key in [
        "actuator-dead-zone@actuator",
        "actuator-bias@actuator",
        "coulomb-friction@h",
    ] {
        assert!(holds(&zone, key), "{zone:?}");
    }
    assert!(!holds(&zone, "actuator-lag@actuator"), "{zone:?}");
}

/// The effects of a pair are no rivals of each other.
#[test]
fn a_right_answer_to_one_departure_is_no_rival_of_the_other() {
    let rivals = |wrong: &[(&str, f64)]| -> Vec<NearestEffect> {
        let rival = |(effect, nats): &(&str, f64)| NearestEffect {
            effect: (*effect).into(),
            nats: *nats,
        };
        wrong.iter().map(rival).collect()
    };
    let of = |right: &str, wrong: &[(&str, f64)]| Imitators {
        right: vec![right.into()],
        wrong: rivals(wrong),
    };
    let pair = [
        of("a@x", &[("b@y", 1.0), ("c@x", 7.0)]),
        of("b@y", &[("a@x", 2.0), ("c@x", 5.0)]),
    ];
    assert_eq!(rival(&pair), rivals(&[("c@x", 5.0)]).pop());
    assert_eq!(rival(&[]), None);
}
