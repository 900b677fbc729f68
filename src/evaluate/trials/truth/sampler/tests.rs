//! Truths of every kind can be drawn of any twin, and have the information that they are to have.

#[path = "../../../../../examples/own_twin.rs"]
#[allow(dead_code, unreachable_pub)]
mod own_twin;
#[path = "../../../../../examples/rooms.rs"]
#[allow(dead_code, unreachable_pub, clippy::duplicate_mod)]
mod rooms;

use super::*;
use crate::diagnose::fixture::tanks;
use crate::evaluate::paper::reference_studies;
use crate::evaluate::trials::law::{Departure, DepartureLaw, DeparturePlace, SignalDeparture};
use crate::evaluate::trials::numbers::TRIAL;
use crate::evaluate::trials::truth::fixture::{experiment, plain};
use crate::evaluate::trials::truth::sizing::Experiment;
use crate::study::RecordPlan;
use crate::twin::Parameter;
use crate::twin::fixture::OneState;
use crate::twins::VanDerPol;
use own_twin::Tank;
use rooms::Rooms;

pub(super) fn rooms() -> Study {
    rooms_of(200)
}

fn rooms_of(samples: usize) -> Study {
    let plan = RecordPlan::levels(0.1, samples, 0.0, 1.0, 25);
    Study::new("rooms", Rooms, plan).unwrap()
}

fn sampler(study: &Study) -> TruthSampler<'_> {
    TruthSampler::new(study, (Families::All, vec![]), None).unwrap()
}

fn draw(sampler: &TruthSampler<'_>, kind: Kind, trial: usize) -> Drawn {
    let noise = Noise::new(5, "truth", trial as u64);
    let extra = Extra {
        validation: true,
        doubled: true,
    };
    sampler.draw(trial, kind, extra, noise).unwrap()
}

fn holds(sampler: &TruthSampler<'_>, kind: Kind, trial: usize) {
    let (drawn, again) = (draw(sampler, kind, trial), draw(sampler, kind, trial));
    assert_eq!((&drawn.truth, &drawn.record), (&again.truth, &again.record));
    let doubled = drawn.doubled.unwrap();
    assert_eq!(doubled.samples(), 2 * drawn.record.samples());
    assert_ne!(drawn.validation.unwrap(), drawn.record);
    let truth = drawn.truth;
    let departures = match kind {
        Kind::None | Kind::Outside => 0,
        Kind::Pair => 2,
        _ => 1,
    };
    assert_eq!(truth.departures.len(), departures, "{truth:?}");
    assert_eq!(
        (truth.right.len(), truth.targets.len()),
        (departures, departures)
    );
    assert_eq!(truth.information.is_some(), departures > 0);
    if let Some(nats) = truth.information {
        assert!((0.3..900.0).contains(&nats), "{nats}");
    }
    for effect in &truth.effects {
        assert!(truth.right.iter().flatten().any(|key| key == effect));
    }
    let text = serde_json::to_string(&truth).unwrap();
    let read: Truth = serde_json::from_str(&text).unwrap();
    assert_eq!((read.kind, read.right), (truth.kind, truth.right));
    let inside = |(p, v): (&crate::twin::Parameter, &f64)| p.prior.contains(*v);
    let all_inside = sampler.space.iter().zip(&truth.theta).all(inside);
    assert_eq!(all_inside, !kind.is_outside());
    sampler.space.check_point(&truth.theta).unwrap();
}

#[test]
fn every_kind_can_be_drawn_of_the_reference_twins_and_repeats() {
    let plan = RecordPlan::autonomous(0.05, 120);
    let oscillator = Study::new("van-der-pol", VanDerPol, plan).unwrap();
    for study in [oscillator, tanks(120)] {
        let sampler = sampler(&study);
        for kind in Kind::ALL {
            sampler.check(kind).unwrap();
            holds(&sampler, kind, 1);
        }
    }
}

#[test]
fn every_kind_can_be_drawn_of_a_twin_of_several_outputs() {
    let study = rooms_of(60);
    let sampler = sampler(&study);
    let keys: Vec<&str> = sampler.listed.iter().map(|l| l.key.as_str()).collect();
    for key in [
        "sensor-bias@sensor2",
        "cross-coupling@wall",
        "parameter-step@loss",
    ] {
        assert!(keys.contains(&key), "{keys:?}");
    }
    for kind in Kind::ALL {
        holds(&sampler, kind, 0);
    }
}

/// A bias of a sensor of N white samples with noise r has ½·N·(b/r)² nats, less what θ, the start and the noise level imitate.
#[test]
fn information_is_that_of_theory() {
    let gain = Parameter::new("gain", "1", 0.5, 1.5).within(0.1, 4.0);
    let level = OneState {
        noise: [0.0, 0.1],
        // As fine as the world's: a step that shows would be fitted as noise.
        substeps: 16,
        integrator: crate::twin::Integrator::RungeKutta4,
        // Fast: x follows gain·u within a sample.
        ..OneState::new([gain], |theta, u, x| 20.0 * (theta[0] * u[0] - x))
    };
    let study = Study::new("level", level, RecordPlan::levels(0.1, 400, -1.0, 1.0, 5)).unwrap();
    experiment(&study, &[1.0], bias_has_its_information);
}

fn bias_has_its_information(experiment: &Experiment<'_>) {
    let (scene, information) = (experiment.scene, &experiment.information);
    let draft = plain("sensor-bias", DeparturePlace::Sensor(0));
    let departure = draft.of_size(0.05, scene).unwrap();
    let bias = 0.05 * scene.outputs[0].deviation;
    let mirrored = experiment
        .mirrored(std::slice::from_ref(&departure))
        .unwrap();
    let pair = experiment.pair(&[departure]).unwrap();
    let lost = information.lost([&pair[0], &mirrored]).unwrap().unwrap();
    let change = information.change(pair).unwrap().unwrap();
    let (nats, theory) = (
        information.nats(&change),
        0.5 * 400.0 * (bias / 0.1).powi(2),
    );
    assert!((nats / theory - 1.0).abs() < 0.15, "{nats} {theory}");
    // A fitted noise level takes a part of a bias: N/2·log(1 + (b/r)²).
    let absorbed = 0.5 * 400.0 * (1.0 + (bias / 0.1).powi(2)).ln();
    assert!((lost / absorbed - 1.0).abs() < 0.15, "{lost} {absorbed}");
    // The gain of the actuator is what θ does; the bias is no gain.
    let gain = plain("actuator-gain", DeparturePlace::Actuator(0));
    let gain = experiment
        .changed(&gain, TRIAL.first_size)
        .unwrap()
        .unwrap();
    assert!(
        information.nats(&gain) < 0.05 * nats,
        "{}",
        information.nats(&gain)
    );
    let same = experiment
        .changed(&draft, TRIAL.first_size)
        .unwrap()
        .unwrap();
    assert!(information.unexplained(&change, &same) < 0.01);
}

/// A step that is fine shows nothing, a coarse one shows.
#[test]
fn a_coarse_step_is_seen() {
    let [oscillator, ..] = &reference_studies().unwrap()[..] else {
        panic!("no study")
    };
    let coarse = draw(&sampler(oscillator), Kind::None, 0).truth.step;
    assert!(coarse > 3.0, "{coarse}");
    let fine = draw(&sampler(&rooms()), Kind::None, 0).truth.step;
    assert!(fine < 3.0, "{fine}");
}

#[test]
fn twins_without_departures_say_why() {
    let study = rooms();
    let text = "twin = 'rooms'\n[library]\nonly = ['sensor-noise']";
    let file = crate::study::StudyFile::parse(text, "s.toml".as_ref()).unwrap();
    let study = study.configure(&file).unwrap();
    let sampler = sampler(&study);
    let error = sampler.check(Kind::Listed).unwrap_err().to_string();
    assert!(
        error.contains("kind listed") && error.contains("the library"),
        "{error}"
    );
    assert!(sampler.check(Kind::Random).is_ok());
}

/// A black box: y = gain·u behind a lag.
struct Boxed;
impl crate::twin::DigitalTwin for Boxed {
    fn parameters(&self) -> ParameterSpace {
        ParameterSpace::new([Parameter::new("gain", "1", 0.5, 1.5).within(0.2, 3.0)])
    }
    fn simulate(
        &self,
        theta: &[f64],
        drive: &Drive,
        _: Noise,
    ) -> Result<Signal, crate::twin::SimulationError> {
        let mut z = 0.0;
        let rows = (0..drive.samples()).map(|k| {
            z += 0.3 * (theta[0] * drive.input(k)[0] - z);
            z
        });
        let rows: Vec<f64> = rows.collect();
        Ok(Signal::from_shape_fn((rows.len(), 1), |(k, _)| rows[k]))
    }
}

#[test]
fn black_boxes_have_departures_of_signals_and_parameters() {
    let plan = RecordPlan::levels(0.1, 80, 0.0, 1.0, 10);
    let study = Study::new("boxed", Boxed, plan);
    let study = study.unwrap();
    let sampler = sampler(&study);
    assert!(sampler.is_silent && equations(sampler.study.twin()).is_none());
    for kind in [Kind::None, Kind::Listed, Kind::Random, Kind::Memory] {
        let drawn = sampler.draw(0, kind, Extra::default(), Noise::new(2, "box", 0));
        let truth = drawn.unwrap().truth;
        assert_eq!(truth.departures.is_empty(), kind == Kind::None);
        let is_of_memory =
            |label: &String| label.starts_with("hysteretic") || label.starts_with("memory");
        assert!(
            kind != Kind::Memory || truth.labels.iter().all(is_of_memory),
            "{:?}",
            truth.labels
        );
        assert_eq!(truth.conditions.added.len(), 1);
    }
}

/// Records like a measured one have its inputs, its length and its gaps.
#[test]
fn records_are_like_a_measured_one() {
    let study = rooms();
    let drawn = draw(&sampler(&study), Kind::None, 3).record;
    let mut outputs = drawn.outputs().clone();
    for k in 20..40 {
        outputs[[k, 1]] = f64::NAN;
    }
    let like = Record::new(
        drawn.drive().first(150),
        outputs.slice(ndarray::s![..150, ..]).to_owned(),
    );
    let like = like.unwrap();
    let sampler = TruthSampler::new(&study, (Families::Closed, vec![]), Some(&like)).unwrap();
    let noise = Noise::new(9, "like", 0);
    let made = sampler
        .draw(0, Kind::Listed, Extra::default(), noise)
        .unwrap();
    assert_eq!(made.record.samples(), 150);
    for k in 20..40 {
        assert!(made.record.outputs()[[k, 1]].is_nan());
    }
}

/// A push on the upper tank and a bias of its pump are one departure: nothing of one remains beside the other.
#[test]
fn departures_that_are_alike_have_no_information_beside_each_other() {
    experiment(&tanks(250), &[0.6, 0.5, 0.55, 1.0], |experiment| {
        let information = &experiment.information;
        let changed = |id, place| {
            let change = experiment.changed(&plain(id, place), 0.1);
            change.unwrap().unwrap()
        };
        let push = changed("constant-forcing", DeparturePlace::State(0));
        let bias = changed("actuator-bias", DeparturePlace::Actuator(0));
        let lag = changed("sensor-lag", DeparturePlace::Sensor(0));
        assert!(information.unexplained(&push, &bias) < 0.01);
        assert!(information.unexplained(&push, &lag) > 0.1);
    });
}

/// A gain of the pump is a tank of another area with another outflow, however far away.
#[test]
fn what_a_distant_theta_absorbs_has_no_information() {
    let study = Study::new("tank", Tank, RecordPlan::levels(0.1, 300, 0.0, 1.0, 20)).unwrap();
    experiment(&study, &[0.49, 1.04], |experiment| {
        let gain = Departure {
            place: DeparturePlace::Actuator(0),
            law: DepartureLaw::Signal(SignalDeparture::Gain { factor: 2.35 }),
        };
        let mirrored = experiment.mirrored(std::slice::from_ref(&gain)).unwrap();
        let [own, _] = experiment.pair(&[gain]).unwrap();
        let lost = experiment.information.lost([&own, &mirrored]);
        let lost = lost.unwrap().unwrap();
        assert!(lost < 1.0, "{lost}");
    });
}

/// Pairs are drawn so that the rest of each departure has the information that a single one has: the smaller of two logarithms is a third of its range
/// above the least, on average.
#[test]
fn pairs_have_information_beside_each_other() {
    let study = tanks(150);
    let sampler = sampler(&study);
    let all: Vec<f64> = (0..12)
        .map(|trial| draw(&sampler, Kind::Pair, trial).truth.information.unwrap())
        .map(f64::ln)
        .collect();
    let range = (INFORMATION[1] / INFORMATION[0]).ln();
    // Its standard deviation is 0.24 of the range.
    let count = all.len() as f64;
    let mean = all.iter().sum::<f64>() / count / range;
    let error = 0.24 / count.sqrt();
    assert!((mean - 1.0 / 3.0).abs() < 2.5 * error, "{mean} ± {error}");
}

/// A drift of the pump's gain is as well one of the pump, and of the tank that it fills.
#[test]
fn places_of_the_same_meaning_are_in_the_key() {
    let study = tanks(100);
    let sampler = sampler(&study);
    let places = |trial| {
        let truth = draw(&sampler, Kind::Listed, trial).truth;
        (truth.targets[0].clone(), truth.places)
    };
    let mut seen = 0;
    for (target, places) in (0..15).map(places) {
        let expected: &[&str] = match target.as_str() {
            "k1" => &["h1", "k1"],
            "k4" | "actuator" => &["actuator", "h1", "k4"],
            "k2" | "k3" => &["h2", target.as_str()],
            _ => &[target.as_str()],
        };
        assert_eq!(places, expected);
        seen += usize::from(expected.len() > 1);
    }
    assert!(seen > 1, "{seen}");
}
