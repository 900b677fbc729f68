//! Noise levels of the reference twins.

use super::level::MEASURED;
use super::*;
use crate::likelihood::kalman::{FilterSettings, Kalman};
use crate::math::deviation;
use crate::record::{Drive, Signal};
use crate::twin::{DigitalTwin, Noise, Now, Outline, Parameter, StateSpace};
use crate::twins::{CascadedTanks, VanDerPol};

fn record(twin: &dyn DigitalTwin, theta: &[f64], drive: Drive) -> Record {
    let outputs = twin
        .simulate(theta, &drive, Noise::new(1, "measured", 0))
        .unwrap();
    Record::new(drive, outputs).unwrap()
}

fn tanks() -> (Composed, Record) {
    let inputs = Signal::from_shape_fn((200, 1), |(k, _)| [2.6, 0.4, 2.0, 1.2][k / 30 % 4]);
    let drive = Drive::new(0.5, inputs).unwrap();
    let record = record(&CascadedTanks, &[0.6, 0.5, 0.55, 1.0], drive);
    (CascadedTanks.into(), record)
}

fn medians(measured: &Measured) -> impl Iterator<Item = f64> {
    measured.levels.iter().map(|level| level.median)
}

fn beliefs(step: f64) -> Beliefs {
    Beliefs {
        step,
        ..Beliefs::default()
    }
}

/// Declared levels are medians, in units per √s; at them the filter sees the twin's own noise.
#[test]
fn declared_levels_are_the_twins_own() {
    let (twin, record) = tanks();
    let measured = measured_equations(&twin, std::slice::from_ref(&record), &beliefs(0.5)).unwrap();
    let names: Vec<&str> = (measured.levels.iter())
        .map(|l| l.parameter.name.as_str())
        .collect();
    assert_eq!(names, ["noise.h1", "noise.h2", "noise.y"]);
    assert!((measured.levels[0].median - 0.1 / 0.5f64.sqrt()).abs() < 1e-12);
    assert_eq!(measured.levels[2].median, 0.15);
    let theta: Vec<f64> = [0.6, 0.5, 0.55, 1.0]
        .into_iter()
        .chain(medians(&measured))
        .collect();
    let (mut q, mut r) = ([0.0; 2], [0.0; 1]);
    for (dt, level) in [(0.5, 0.1), (2.0, 0.2)] {
        let now = Now::new(0.0, dt, &[1.0], &theta);
        measured
            .twin
            .equations()
            .unwrap()
            .noise(&now, &[1.0; 2], &mut q, &mut r);
        assert!((q[0] - level).abs() < 1e-12 && (r[0] - 0.15).abs() < 1e-12);
    }
}

/// Levels that nothing is declared of are guessed from the record; known levels and declared starts stay.
#[test]
fn undeclared_levels_come_from_the_record() {
    let record = record(&VanDerPol, &[1.5], Drive::autonomous(0.05, 300).unwrap());
    let twin = Composed::from(VanDerPol);
    let held = Beliefs {
        known: ["x2".to_owned()].into(),
        ..beliefs(0.05)
    };
    let measured = measured_equations(&twin, std::slice::from_ref(&record), &held).unwrap();
    let names: Vec<&str> = (measured.levels.iter())
        .map(|l| l.parameter.name.as_str())
        .collect();
    assert_eq!(names, ["noise.x1", "noise.y"]);
    let y = deviation(&record.outputs().column(0).to_vec());
    assert!((measured.levels[1].median - MEASURED.share * y).abs() < 1e-12);
    let theta: Vec<f64> = [1.5].into_iter().chain(medians(&measured)).collect();
    let now = Now::new(0.0, 0.05, &[], &theta);
    let mut std = [0.0; 2];
    measured
        .twin
        .equations()
        .unwrap()
        .start_deviation(&now, &mut std);
    // The twin says its start, and the record agrees.
    assert_eq!(std, [0.0; 2]);
    assert_eq!(measured.elsewhere, None);
}

/// A start that the twin says is known, and given up where the first row is another one; a start that nobody says is unknown, as wide as the
/// record is away from it. What the study says stands where the record begins at 0.
#[test]
fn starts_are_known_unless_a_record_says_otherwise() {
    let deviations = |twin: &Composed, record: &Record, held: &Beliefs| {
        let measured = measured_equations(twin, std::slice::from_ref(record), held).unwrap();
        let space = measured.twin.parameters();
        let (mut std, theta) = ([0.0; 2], space.centre());
        let now = Now::new(0.0, 0.5, record.drive().input(0), &theta);
        (measured.twin.equations().unwrap()).start_deviation(&now, &mut std);
        (std, measured.elsewhere)
    };
    let swing = record(&VanDerPol, &[1.5], Drive::autonomous(0.05, 400).unwrap());
    let later = Record::new(
        Drive::autonomous(0.05, 300).unwrap(),
        swing.outputs().slice(ndarray::s![60..360, ..]).to_owned(),
    )
    .unwrap();
    let oscillator = Composed::from(VanDerPol);
    let (std, elsewhere) = deviations(&oscillator, &later, &beliefs(0.05));
    assert!(std[0] > 0.5 && std[1] > 0.5, "{std:?}");
    let elsewhere = elsewhere.unwrap();
    assert_eq!((elsewhere.expected, elsewhere.states.len()), (1.0, 2));
    let held = Beliefs {
        starts: ["x1".to_owned(), "x2".to_owned()].into(),
        ..beliefs(0.05)
    };
    // What is declared stands, and is told of the state that the output shows.
    let (std, elsewhere) = deviations(&oscillator, &later, &held);
    let elsewhere = elsewhere.unwrap();
    assert_eq!((std, elsewhere.is_held), ([0.0; 2], true));
    assert_eq!(elsewhere.states, ["x1"]);
    let at_ten = later.drive().clone().beginning_at(10.0);
    let at_ten = Record::new(at_ten, later.outputs().clone()).unwrap();
    let (std, elsewhere) = deviations(&oscillator, &at_ten, &held);
    assert!(std[0] > 0.5 && elsewhere.is_some(), "{std:?}");

    // The tanks say nothing: at an operating point of 5 V their motion is a tenth of it.
    let inputs = Signal::from_shape_fn((400, 1), |(k, _)| [1.45, 1.55][k / 20 % 2]);
    let drive = Drive::new(0.5, inputs).unwrap();
    let theta = [0.6, 0.6, 0.6, 1.0];
    let whole = CascadedTanks.simulate(&theta, &drive, Noise::OFF).unwrap();
    let rest = Drive::new(0.5, drive.inputs().slice(ndarray::s![200.., ..]).to_owned()).unwrap();
    let rest = Record::new(rest, whole.slice(ndarray::s![200.., ..]).to_owned()).unwrap();
    let (std, elsewhere) = deviations(&CascadedTanks.into(), &rest, &beliefs(0.5));
    assert!(std[1] > 3.0 && std[0] > 1.0, "{std:?}");
    assert_eq!(elsewhere, None);
}

/// A start that is wide forgets what the twin said: the likelihood of a record that began elsewhere is finite and near that of the
/// right start.
#[test]
fn a_wide_start_is_integrated() {
    let (twin, _) = tanks();
    let inputs = Signal::from_elem((200, 1), 1.5);
    let drive = Drive::new(0.5, inputs).unwrap();
    let theta = [0.6, 0.5, 0.55, 1.0];
    let begun = Signal::from_shape_fn((200, 1), |(k, _)| if k < 5 { 6.0 } else { 4.5 });
    let record = Record::new(drive, begun).unwrap();
    let wide = measured_equations(&twin, std::slice::from_ref(&record), &beliefs(0.5)).unwrap();
    let held = Beliefs {
        starts: ["h1".to_owned(), "h2".to_owned()].into(),
        ..beliefs(0.5)
    };
    let known = measured_equations(&twin, std::slice::from_ref(&record), &held).unwrap();
    let settings = FilterSettings::default();
    let log_likelihood = |m: &Measured| {
        let theta: Vec<f64> = theta.iter().copied().chain(medians(m)).collect();
        let kalman = Kalman::new(m.twin.equations().unwrap(), &record, &settings).unwrap();
        kalman.log_likelihood(&theta).unwrap()
    };
    assert!(log_likelihood(&wide) > log_likelihood(&known) + 100.0);
}

/// Levels take the place of the twin's own one by one, whatever the step; θ and the start stay.
#[test]
fn levels_are_put_in_the_place_of_the_twins_own() {
    let (twin, record) = tanks();
    let levels = BTreeMap::from([("h2".to_owned(), 0.3), ("y".to_owned(), 0.05)]);
    let base = Twin::Equations(twin);
    let loud = with_levels(&base, &record, &beliefs(0.5), &[levels]).unwrap();
    assert_eq!(loud.parameters().names(), base.parameters().names());
    let theta = loud.parameters().centre();
    let equations = loud.equations().unwrap();
    let (mut q, mut r, mut start) = ([0.0; 2], [0.0; 1], [0.0; 2]);
    let now = Now::new(0.0, 0.25, &[1.0], &theta);
    equations.noise(&now, &[1.0; 2], &mut q, &mut r);
    assert!((q[0] - 0.1 / 2f64.sqrt()).abs() < 1e-12, "declared: {q:?}");
    assert!((q[1] - 0.15).abs() < 1e-12 && (r[0] - 0.05).abs() < 1e-12);
    equations.start_deviation(&now, &mut start);
    assert_eq!(start, [0.0; 2]);
}

/// A level that halves while a tank runs empty, read with an error of a twentieth of the level.
struct Reading;

impl StateSpace for Reading {
    fn outline(&self) -> Outline {
        Outline::new()
            .parameter(Parameter::new("k", "1/s", 0.5, 1.5))
            .state("x", "V")
            .output("y", "V")
    }
    fn drift(&self, now: &Now<'_>, x: &[f64], dx: &mut [f64]) {
        dx[0] = -now.theta[0] * x[0];
    }
    fn start(&self, _: &Now<'_>, x: &mut [f64]) {
        x[0] = 8.0;
    }
    fn observe(&self, _: &Now<'_>, x: &[f64], y: &mut [f64]) {
        y[0] = x[0];
    }
    fn noise(&self, _: &Now<'_>, x: &[f64], _: &mut [f64], measurement: &mut [f64]) {
        measurement[0] = 0.05 * x[0];
    }
}

/// Noise follows the states in runs and in filters; one fitted factor multiplies it, whose typical level is declared.
#[test]
fn declared_levels_follow_the_states() {
    let drive = Drive::autonomous(0.01, 300).unwrap();
    let record = record(&Reading, &[1.0], drive.clone());
    let mean = Reading.simulate(&[1.0], &drive, Noise::OFF).unwrap();
    let shares = (record.outputs() / &mean - 1.0) / 0.05;
    let early = shares.iter().take(150).map(|e| e * e).sum::<f64>() / 150.0;
    let late = shares.iter().skip(150).map(|e| e * e).sum::<f64>() / 150.0;
    assert!(
        (0.7..1.4).contains(&early) && (0.7..1.4).contains(&late),
        "{early} {late}"
    );
    let held = Beliefs {
        known: ["x".to_owned()].into(),
        starts: ["x".to_owned()].into(),
        ..beliefs(0.01)
    };
    let twin = Composed::from(Reading);
    let measured = measured_equations(&twin, std::slice::from_ref(&record), &held).unwrap();
    let typical = measured.levels[0].declared.unwrap();
    assert!(
        (typical / (0.05 * 8.0 * 0.99f64.powi(150)) - 1.0).abs() < 0.02,
        "{typical}"
    );
    let settings = FilterSettings::default();
    let equations = measured.twin.equations().unwrap();
    let kalman = Kalman::new(equations, &record, &settings).unwrap();
    let at = |level: f64| kalman.log_likelihood(&[1.0, level]).unwrap();
    let residuals = kalman.filter(&[1.0, typical]).unwrap().standardised;
    let expected: f64 = (residuals.iter().zip(&mean))
        .map(|(e, y)| -0.5 * (e * e + (std::f64::consts::TAU * (0.05 * y).powi(2)).ln()))
        .sum();
    assert!((at(typical) - expected).abs() < 1e-6);
    assert!(at(typical) > at(2.0 * typical) && at(typical) > at(0.5 * typical));
}

/// A start that the first rows contradict stands where it explains 3 nats; beside effects that may bend them, where giving it up explains less.
#[test]
fn a_contradicted_start_stands_where_it_explains_enough() {
    let better = |held: Option<f64>, bends: bool| {
        let again = || Ok::<_, ()>(held);
        with_better_start((Some(1.0), bends), |nats| *nats, again).unwrap()
    };
    assert_eq!(better(Some(4.1), false), (Some(4.1), true));
    assert_eq!(better(Some(3.9), false), (Some(1.0), false));
    assert_eq!(better(None, false), (Some(1.0), false));
    assert_eq!(better(Some(-1.9), true), (Some(-1.9), true));
    assert_eq!(better(Some(-2.1), true), (Some(1.0), false));
}

/// Ten rooms in a row; half of them declare a noise, each twice that of the one before.
#[derive(Debug)]
struct Row;

impl Row {
    const STATES: usize = 10;

    fn declared(state: usize) -> f64 {
        if state < Self::STATES / 2 {
            0.0
        } else {
            0.001 * f64::from(1 << state)
        }
    }
}

impl StateSpace for Row {
    fn outline(&self) -> Outline {
        let parameter = Parameter::new("a", "1/s", 0.5, 2.0);
        let outline = Outline::new().parameter(parameter).output("y", "K");
        (0..Self::STATES).fold(outline, |all, i| all.state(&format!("T{i}"), "K"))
    }
    fn drift(&self, now: &Now<'_>, x: &[f64], dx: &mut [f64]) {
        for i in 0..x.len() {
            let before = if i == 0 { 1.0 } else { x[i - 1] };
            dx[i] = now.theta[0] * (before - x[i]);
        }
    }
    fn observe(&self, _: &Now<'_>, x: &[f64], y: &mut [f64]) {
        y[0] = x[2];
    }
    fn noise(&self, _: &Now<'_>, _: &[f64], process: &mut [f64], measurement: &mut [f64]) {
        for (i, level) in process.iter_mut().enumerate() {
            *level = Self::declared(i);
        }
        measurement[0] = 0.01;
    }
}

/// Beyond eight states the levels of those that declare one are in proportion, and so are the guessed ones; what the study says of a state is
/// its own.
#[test]
fn levels_of_many_states_share_a_factor() {
    let record = record(&Row, &[1.0], Drive::autonomous(0.5, 100).unwrap());
    let held = Beliefs {
        factors: [("T6".to_owned(), 2.0)].into(),
        ..beliefs(0.5)
    };
    let twin = Composed::from(Row);
    let measured = measured_equations(&twin, std::slice::from_ref(&record), &held).unwrap();
    let targets: Vec<&str> = (measured.levels.iter())
        .map(|level| level.parameter.target())
        .collect();
    let [guessed, own, declared, output] = targets[..] else {
        panic!("{targets:?}")
    };
    assert_eq!((own, declared, output), ("T6", "T9", "y"));
    assert!(guessed < "T5");
    let following = measured.levels.iter().map(|level| level.following.len());
    assert_eq!(following.collect::<Vec<_>>(), [4, 0, 3, 0]);
    let equations = measured.twin.equations().unwrap();
    let noise = |factors: [f64; 3]| {
        let factors = factors.into_iter().chain([1.0]);
        let levels = medians(&measured)
            .zip(factors)
            .map(|(median, f)| median * f);
        let theta: Vec<f64> = [1.0].into_iter().chain(levels).collect();
        let (mut process, mut measurement) = ([0.0; Row::STATES], [0.0]);
        let now = Now::new(0.0, 0.5, &[], &theta);
        equations.noise(&now, &[0.0; Row::STATES], &mut process, &mut measurement);
        process
    };
    let (centre, changed) = (noise([1.0; 3]), noise([3.0, 5.0, 7.0]));
    for i in 0..Row::STATES {
        let factor = match i {
            6 => 5.0,
            i if i < 5 => 3.0,
            _ => 7.0,
        };
        assert!((changed[i] / centre[i] / factor - 1.0).abs() < 1e-12, "{i}");
        if i >= 5 {
            assert!((centre[i] / Row::declared(i) - 1.0).abs() < 1e-12, "{i}");
        }
        assert!(equations.fits_noise_of(i));
    }
}
