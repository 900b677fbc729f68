//! Motion of composed equations, and parts together.

use crate::effect::{Catalogue, augment};
use crate::hypothesis::entry::disturbed;
use crate::likelihood::kalman::{FilterSettings, Kalman};
use crate::math::Lanes;
use crate::record::{Drive, Record, Signal};
use crate::twin::{
    Adaptation, Entry, Hold, Integrator, Interval, LanePlaces, Noise, NoiseLevel, Now, Outline,
    Parameter, StartLevel, StateSpace, Stepping, Twin, adapt, fix,
};
use crate::twins::CascadedTanks;

/// ẋ = u − k·x³ within limits, y = x.
struct Vessel(Integrator);
impl StateSpace for Vessel {
    fn outline(&self) -> Outline {
        Outline::new()
            .parameter(Parameter::new("k", "1/s", 0.0, 1.0).within(0.0, 20.0))
            .parameter(Parameter::new("gain", "-", 0.5, 2.0))
            .state("x", "m")
            .input("u", "m/s")
            .output("y", "m")
    }
    fn drift(&self, now: &Now<'_>, x: &[f64], dx: &mut [f64]) {
        dx[0] = now.theta[1] * now.u[0] - now.theta[0] * x[0].powi(3);
    }
    fn observe(&self, _: &Now<'_>, x: &[f64], y: &mut [f64]) {
        y[0] = x[0];
    }
    fn noise(&self, _: &Now<'_>, _: &[f64], _: &mut [f64], measurement: &mut [f64]) {
        measurement[0] = 1e-3;
    }
    fn limits(&self) -> Vec<Interval> {
        vec![Interval::unchecked(0.0, 1.5)]
    }
    fn integrator(&self) -> Integrator {
        self.0
    }
}

const RULES: [Integrator; 2] = [Integrator::Euler, Integrator::RungeKutta4];

fn refined(rule: Integrator, substeps: usize, hold: Hold) -> Twin {
    let twin = Twin::new(Vessel(rule));
    let change = |_: &mut _, to: &mut Stepping| {
        *to = Stepping {
            substeps,
            hold,
            ..*to
        }
    };
    twin.stepped(change).unwrap()
}

fn inputs(samples: usize) -> Signal {
    Signal::from_shape_fn((samples, 1), |(k, _)| [2.0, 5.0, -3.0, 1.0][k / 5 % 4])
}

/// Substeps are the samples of a finer step, limits included, to the bit.
#[test]
fn substeps_are_a_finer_step() {
    let (samples, n) = (40, 4);
    let coarse = Drive::new(0.5, inputs(samples)).unwrap();
    let held = Signal::from_shape_fn((samples * n, 1), |(k, _)| coarse.input(k / n)[0]);
    let fine = Drive::new(0.125, held).unwrap();
    for rule in RULES {
        let theta = [1.0, 1.0];
        let own = Twin::new(Vessel(rule)).free_run(&theta, &fine).unwrap();
        let run = refined(rule, n, Hold::Zero)
            .free_run(&theta, &coarse)
            .unwrap();
        assert!(run.iter().any(|y| *y == 1.5) && run.iter().any(|y| *y == 0.0));
        for k in 0..samples {
            assert_eq!(run[[k, 0]], own[[k * n, 0]], "{rule:?}, row {k}");
        }
    }
}

/// ẋ = u with u on lines: the trapezoidal rule is exact, and so are both rules in their own order.
#[test]
fn inputs_lie_on_lines() {
    let u = [0.0, 1.0, 3.0, 2.0];
    let drive = Drive::new(0.1, Signal::from_shape_fn((4, 1), |(k, _)| u[k])).unwrap();
    let run = |rule, substeps, hold| {
        let run = refined(rule, substeps, hold).free_run(&[0.0, 1.0], &drive);
        run.unwrap().column(0).to_vec()
    };
    let near = |a: Vec<f64>, b: [f64; 4]| {
        assert!(
            a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-15),
            "{a:?} {b:?}"
        );
    };
    near(
        run(Integrator::RungeKutta4, 1, Hold::Linear),
        [0.0, 0.05, 0.25, 0.5],
    );
    near(
        run(Integrator::Euler, 1, Hold::Linear),
        [0.0, 0.0, 0.1, 0.4],
    );
    near(
        run(Integrator::Euler, 2, Hold::Linear),
        [0.0, 0.025, 0.175, 0.45],
    );
    near(
        run(Integrator::RungeKutta4, 3, Hold::Zero),
        [0.0, 0.0, 0.1, 0.4],
    );
    near(
        run(Integrator::RungeKutta4, 2, Hold::Nearest),
        [0.0, 0.05, 0.25, 0.5],
    );
    // Of an odd number of substeps, the middle one is two halves.
    near(
        run(Integrator::Euler, 1, Hold::Nearest),
        [0.0, 0.05, 0.25, 0.5],
    );
    // Steps that vary, too: 0.1 · ½ + 0.3 · 2 + 0.1 · 2.5.
    let times = Drive::with_times(&[0.0, 0.1, 0.4, 0.5], drive.inputs().clone()).unwrap();
    let twin = refined(Integrator::RungeKutta4, 2, Hold::Linear);
    let uneven = twin.free_run(&[0.0, 1.0], &times).unwrap();
    near(uneven.column(0).to_vec(), [0.0, 0.05, 0.65, 0.9]);
}

/// The filter moves as the simulation does, through wrappers, too.
#[test]
fn the_filter_takes_the_same_steps() {
    let drive = Drive::new(0.3, inputs(60)).unwrap();
    for rule in RULES {
        let twin = refined(rule, 3, Hold::Linear);
        let fixed = fix(twin.clone(), &[("gain".to_owned(), 0.5)].into()).unwrap();
        let outputs = twin.free_run(&[0.2, 0.5], &drive).unwrap();
        assert_eq!(fixed.free_run(&[0.2], &drive).unwrap(), outputs);
        let record = Record::new(drive.clone(), outputs).unwrap();
        let settings = FilterSettings::default();
        let equations = fixed.equations().unwrap();
        let seen = Kalman::new(equations, &record, &settings)
            .and_then(|kalman| kalman.filter(&[0.2]))
            .unwrap();
        let largest = seen
            .innovations
            .iter()
            .fold(0.0, |a: f64, e| a.max(e.abs()));
        assert!(largest < 1e-12, "{rule:?}: {largest}");
        let plain = Kalman::new(Vessel(rule), &record, &settings)
            .and_then(|kalman| kalman.filter(&[0.2, 0.5]))
            .unwrap();
        assert!(plain.innovations.iter().any(|e| e.abs() > 1e-2));
    }
}

/// Parts of different kinds stand beside each other: in either order they make the same run and the same likelihood.
#[test]
fn independent_parts_commute() {
    let effect = |id: &str, target: &str| Catalogue::default().effect(id, target).unwrap();
    let adaptation = Adaptation {
        noise: [("y".to_owned(), NoiseLevel::declared(0.07))].into(),
        start: [("h1".to_owned(), StartLevel::Estimate)].into(),
        limits: [("h2".to_owned(), Interval::unchecked(0.0, 9.0))].into(),
        ..Adaptation::default()
    };
    let ceiling = || effect("state-ceiling", "h1").with_other("h2");
    let steps: [&dyn Fn(Twin) -> Twin; 8] = [
        &|twin| augment(twin, vec![effect("sensor-lag", "sensor")]).unwrap(),
        &|twin| augment(twin, vec![effect("quadratic-drag", "h2"), ceiling()]).unwrap(),
        &|twin| augment(twin, vec![effect("actuator-gain", "actuator")]).unwrap(),
        &|twin| augment(twin, vec![effect("parameter-drift", "k1")]).unwrap(),
        &|twin| adapt(twin, &adaptation, 0.5).unwrap(),
        &|twin| twin.stepped(|_, to| to.substeps = 2).unwrap(),
        &|twin| fix(twin, &[("k3".to_owned(), 0.55)].into()).unwrap(),
        &|twin| twin.watched(|| Ok(())),
    ];
    let base = || Twin::new(CascadedTanks);
    let there = steps.iter().fold(base(), |twin, step| step(twin));
    let back = steps.iter().rev().fold(base(), |twin, step| step(twin));
    let theta = |twin: &Twin| -> Vec<f64> {
        let value = |name: &str| match name {
            "k1" => 0.6,
            "k2" => 0.5,
            "k4" => 1.0,
            "start.h1" => 4.0,
            "sensor-lag@sensor.tau" => 1.3,
            "quadratic-drag@h2.coefficient" => 0.02,
            "state-ceiling@h1.level" => 5.0,
            "state-ceiling@h1.spill" => 0.5,
            "actuator-gain@actuator.error" => 0.1,
            "parameter-drift@k1.rate" => 0.001,
            other => panic!("{other}"),
        };
        twin.parameters().names().iter().map(|n| value(n)).collect()
    };
    let inputs = Signal::from_shape_fn((120, 1), |(k, _)| [2.5, 0.5, 3.0][k / 20 % 3]);
    let drive = Drive::new(0.5, inputs).unwrap();
    let run = |twin: &Twin| twin.simulate(&theta(twin), &drive, Noise::new(3, "order", 0));
    let outputs = run(&there).unwrap();
    assert_eq!(outputs, run(&back).unwrap());
    assert_ne!(theta(&there), theta(&back));
    let record = Record::new(drive.clone(), outputs).unwrap();
    let settings = FilterSettings::default();
    let [a, b] = [&there, &back].map(|twin| {
        let kalman = Kalman::new(twin.equations().unwrap(), &record, &settings).unwrap();
        kalman.log_likelihood(&theta(twin)).unwrap()
    });
    assert!((a - b).abs() < 1e-9, "{a} {b}");
}

/// Filters side by side have the noise levels of each alone, however many there are and whatever else parts change.
#[test]
fn noise_is_the_same_side_by_side() {
    let effect = |id: &str, target: &str| Catalogue::default().effect(id, target).unwrap();
    let parts: [&[(&str, &str)]; 4] = [
        &[],
        &[("quadratic-drag", "h2"), ("sensor-lag", "sensor")],
        &[("process-noise", "h1"), ("sensor-noise", "sensor")],
        &[("parameter-drift", "k1"), ("actuator-delay", "actuator")],
    ];
    let adaptation = Adaptation {
        noise: [
            ("h1".to_owned(), NoiseLevel::declared(0.03)),
            ("y".to_owned(), NoiseLevel::Estimate),
        ]
        .into(),
        ..Adaptation::default()
    };
    for (parts, is_adapted) in parts.into_iter().flat_map(|p| [(p, false), (p, true)]) {
        let effects = parts.iter().map(|(id, target)| effect(id, target));
        let mut twin = augment(Twin::new(CascadedTanks), effects.collect()).unwrap();
        if is_adapted {
            twin = adapt(twin, &adaptation, 0.5).unwrap();
        }
        let centre = twin.parameters().centre();
        let Twin::Equations(twin) = twin else {
            panic!("equations");
        };
        let n = twin.outline().states.len();
        let theta: Vec<Vec<f64>> = (0..8)
            .map(|lane| {
                centre
                    .iter()
                    .map(|v| v * (1.0 + 0.01 * f64::from(lane)))
                    .collect()
            })
            .collect();
        let states = |lane: usize| (0..n).map(move |i| (1 + lane + i) as f64);
        let x: Vec<Lanes> = (0..n)
            .map(|i| Lanes(std::array::from_fn(|lane| states(lane).nth(i).unwrap())))
            .collect();
        for lanes in [1, 3, 8] {
            let now: Vec<Now<'_>> = (theta.iter().take(lanes))
                .map(|theta| Now::new(7.0, 2.0, &[3.0], theta))
                .collect();
            let (mut q, mut r) = (vec![Lanes([1.0; 8]); n], Lanes([1.0; 8]));
            let factors = twin.level_factors(|lane| now.get(lane).unwrap_or(&now[0]).theta);
            let mut at = LanePlaces::new(now.clone(), twin.own_parameters());
            twin.noise_lanes(&factors, &mut at, &x, (&mut q, &mut r));
            for (lane, now) in now.iter().enumerate() {
                let (mut process, mut measurement) = (vec![0.0; n], vec![0.0]);
                let x: Vec<f64> = states(lane).collect();
                twin.noise(now, &x, &mut process, &mut measurement);
                let beside: Vec<f64> = q.iter().map(|q| q.0[lane]).collect();
                assert_eq!(beside, process, "{parts:?} {is_adapted} {lane} of {lanes}");
                assert_eq!(r.0[lane], measurement[0], "{parts:?} {is_adapted}");
                assert!(measurement[0] > 0.0);
            }
        }
    }
}

/// ẋ = u up to a brim, which is a parameter that nothing else depends on.
struct Brimming;
impl StateSpace for Brimming {
    fn outline(&self) -> Outline {
        Outline::new()
            .parameter(Parameter::new("brim", "m", 0.5, 2.0))
            .state("x", "m")
            .input("u", "m/s")
            .output("y", "m")
    }
    fn drift(&self, now: &Now<'_>, _: &[f64], dx: &mut [f64]) {
        dx[0] = now.u[0];
    }
    fn observe(&self, _: &Now<'_>, x: &[f64], y: &mut [f64]) {
        y[0] = x[0];
    }
    fn constrain(&self, now: &Now<'_>, x: &mut [f64]) {
        x[0] = x[0].min(now.theta[0]);
    }
}

/// A filter learns a disturbance from what its points differ in: each has the brim of its own.
#[test]
fn points_have_their_own_disturbances_in_constraints() {
    let twin = disturbed(&Twin::new(Brimming), Entry::Parameter(0), 0.9);
    let theta = [1.0, 0.2];
    let mut points = [2.0, 0.0, 2.0, 0.5, 2.0, -0.5];
    let now = Now::new(0.0, 1.0, &[1.0], &theta);
    twin.equations().unwrap().constrain(&now, &mut points);
    let brims = [0.0, 0.5, -0.5].map(f64::exp);
    assert_eq!([points[0], points[2], points[4]], brims);
}
