//! Twins with effects, beside the laws of these.

use super::*;
use crate::effect::{Catalogue, EffectKind, Magnitude, OtherState};
use crate::equations::Equations;
use crate::record::{Drive, Signal};
use crate::twin::fixture::Unseen;
use crate::twin::{Acting, Hold, Noise, Stepping};
use crate::twins::CascadedTanks;
use std::sync::Arc;

/// A run keeps two samples of a delay in its states, and holds its outputs back by the rest: that is the register of the law, to the
/// last bits, and noise comes behind it.
#[test]
fn a_delayed_output_is_that_of_the_law() {
    let delay = Catalogue::default().effect("sensor-delay", "sensor");
    let delay = delay.unwrap();
    let base = Twin::new(CascadedTanks);
    let twin = augment(base.clone(), vec![delay.clone()]).unwrap();
    assert_eq!(twin.outline().unwrap().states.len(), 2 + 3);
    let u = Signal::from_shape_fn((120, 1), |(k, _)| ((k / 9) % 5) as f64 / 2.0);
    let drive = Drive::new(0.5, u).unwrap();
    // A black box passes its whole outputs through the law.
    let whole = augment(Twin::new(Unseen(CascadedTanks)), vec![delay]).unwrap();
    for delay in [0.0, 0.1, 0.7, 1.5, 10.0, 12.3, 31.5] {
        let theta = [0.6, 0.5, 0.55, 1.0, delay];
        let expected = whole.simulate(&theta, &drive, Noise::OFF).unwrap();
        let difference = twin.free_run(&theta, &drive).unwrap() - &expected;
        let most = difference.iter().fold(0.0, |a: f64, d| a.max(d.abs()));
        assert!(most < 1e-12, "{delay}: {most}");
    }
}

/// A twin that is late shows what its late sensor shows, while it stands still at the start, too.
#[test]
fn a_late_twin_is_a_twin_with_a_late_sensor() {
    let delay = || Catalogue::default().effect("sensor-delay", "sensor");
    let base = Twin::new(CascadedTanks);
    let held = augment(base.clone(), vec![delay().unwrap()]).unwrap();
    let late = augment_late(base, vec![delay().unwrap()]).unwrap();
    assert_eq!(late.outline().unwrap().states.len(), 2);
    let u = Signal::from_shape_fn((120, 1), |(k, _)| ((k / 9) % 5) as f64 / 2.0);
    let drive = Drive::new(0.5, u).unwrap();
    for (delay, near) in [(0.0, 1e-12), (10.0, 1e-12), (7.3, 0.1)] {
        let theta = [0.6, 0.5, 0.55, 1.0, delay];
        let run = |twin: &Twin| twin.free_run(&theta, &drive).unwrap();
        let difference = run(&held) - run(&late);
        let most = difference.iter().fold(0.0, |a: f64, d| a.max(d.abs()));
        assert!(most < near, "{delay}: {most}");
    }
}

/// Where steps vary, a delay reads the signal so many seconds ago, on the line between rows; of replicates, the same.
#[test]
fn a_delay_counts_seconds_where_steps_vary() {
    let times = [0.0, 0.5, 2.0, 2.0, 2.0, 2.3, 5.0, 5.1, 9.0];
    let u = |k: usize| if times[k] < 2.0 { 1.0 } else { times[k] };
    let drive = Drive::with_times(&times, Signal::from_shape_fn((9, 1), |(k, _)| u(k))).unwrap();
    let base = Twin::new(CascadedTanks);
    let theta = [0.6, 0.5, 0.55, 1.0];
    let delayed = |signal: &[f64], delay: f64| -> Vec<f64> {
        let value = |t: f64| {
            let after = times.iter().position(|time| *time > t).unwrap_or(9);
            let Some(before) = after.checked_sub(1) else {
                return signal[0];
            };
            let Some(next) = times.get(after) else {
                return signal[before];
            };
            let share = (t - times[before]) / (next - times[before]);
            signal[before] + share * (signal[after] - signal[before])
        };
        times.iter().map(|t| value(t - delay)).collect()
    };
    let run = |id: &str, target: &str, delay: f64| {
        let effect = Catalogue::default().effect(id, target).unwrap();
        let twin = augment(base.clone(), vec![effect]).unwrap();
        let run = twin.free_run(&[&theta[..], &[delay]].concat(), &drive);
        run.unwrap().column(0).to_vec()
    };
    let near = |run: Vec<f64>, expected: &[f64], what: &str| {
        let mut errors = run.iter().zip(expected).map(|(a, b)| (a - b).abs());
        assert!(errors.all(|e| e < 1e-12), "{what}: {run:?}, {expected:?}");
    };
    let plain = base.free_run(&theta, &drive).unwrap().column(0).to_vec();
    for delay in [0.0, 0.1, 0.3, 1.7, 4.0, 20.0] {
        let seen = run("sensor-delay", "sensor", delay);
        near(seen, &delayed(&plain, delay), &format!("sensor {delay}"));
        let acting = delayed(&(0..9).map(u).collect::<Vec<_>>(), delay);
        let late = Signal::from_shape_fn((9, 1), |(k, _)| acting[k]);
        let late = Drive::with_times(&times, late).unwrap();
        let expected = base.free_run(&theta, &late).unwrap().column(0).to_vec();
        near(
            run("actuator-delay", "actuator", delay),
            &expected,
            &format!("actuator {delay}"),
        );
    }
}

/// A late twin in adaptive steps stands still until the delay is over, and its parameter steps so much later.
#[test]
fn a_delay_ends_within_an_adaptive_step() {
    let text = "[parameters]\nk = { prior = [0.1, 2.0] }\n[states]\nx = { rate = \"-k*x\", start = 1.0 }\n\
                [outputs]\ny = { value = \"x\", noise = 0.05 }";
    let base = Twin::from(Arc::new(Equations::parse(text).unwrap()));
    let effect = |id: &str, target: &str| Catalogue::default().effect(id, target).unwrap();
    let effects = vec![
        effect("parameter-step", "k"),
        effect("sensor-delay", "sensor"),
    ];
    let twin = augment_late(base, effects).unwrap();
    let names = twin.parameters();
    assert!(names.names()[1].ends_with("size") && names.names()[3].ends_with("delay"));
    let drive = Drive::autonomous(2.0, 5).unwrap().beginning_at(100.0);
    for (time, delay) in [(0.7, 0.9), (0.7, 1.9), (3.1, 2.0), (0.3, 3.3)] {
        let run = twin.free_run(&[0.2, 0.5, time, delay], &drive).unwrap();
        for (k, y) in run.iter().enumerate() {
            let t = (2.0 * k as f64 - delay).max(0.0);
            let expected = (-0.2 * (t + 0.5 * (t - time).max(0.0))).exp();
            assert!(
                (y - expected).abs() < 1e-7,
                "{time}, {delay}, row {k}: {y}, {expected}"
            );
        }
    }
}

/// A dose of a late twin is given once, so much later.
#[test]
fn a_delay_holds_events_back() {
    let text = "[parameters]\nk = { prior = [0.1, 2.0] }\n[states]\nx = { rate = \"-k*x\", start = 1.0 }\n\
                [outputs]\ny = { value = \"x\", noise = 0.05 }\n[[event]]\nat = [0.0, 1.0]\nadd = { x = 1 }";
    let base = Twin::from(Arc::new(Equations::parse(text).unwrap()));
    let delay = Catalogue::default()
        .effect("sensor-delay", "sensor")
        .unwrap();
    let twin = augment_late(base, vec![delay]).unwrap();
    let drive = Drive::autonomous(2.0, 8).unwrap();
    for delay in [0.0, 0.5, 1.0, 5.3, 10.0] {
        let run = twin.free_run(&[0.2, delay], &drive).unwrap();
        for (k, y) in run.iter().enumerate() {
            let t = 2.0 * k as f64 - delay;
            let doses = [0.0, 1.0].iter().filter(|at| **at < t);
            let all: f64 = [0.0]
                .iter()
                .chain(doses)
                .map(|at| (-0.2 * (t.max(0.0) - at)).exp())
                .sum();
            assert!((y - all).abs() < 1e-6, "{delay}, row {k}: {y}, {all}");
        }
    }
}

/// Doses come from nowhere before the first row, and all of each arrives, on even and uneven rows.
#[test]
fn actuators_pass_doses_on() {
    let text = "[parameters]\nk = { prior = [0.1, 2.0] }\n[states]\nx = { rate = \"dose - 0*k\", start = 0.0 }\n\
                [inputs]\ndose = { hold = \"impulse\" }\n[outputs]\ny = { value = \"x\", noise = 0.05 }";
    let base = Twin::from(Arc::new(Equations::parse(text).unwrap()));
    let even: Vec<f64> = (0..40).map(f64::from).collect();
    let uneven: Vec<f64> = (0..40)
        .map(|k| [0.0, 1.0, 1.3][k % 3] + (k / 3 * 2) as f64)
        .collect();
    let at = |effect: (&str, &str), m: &[f64], times: &[f64], row: usize| {
        let effect = Catalogue::default().effect(effect.0, effect.1).unwrap();
        let twin = augment_late(base.clone(), vec![effect]).unwrap();
        let doses = Signal::from_shape_fn((40, 1), |(k, _)| if k == row { 8.0 } else { 0.0 });
        let drive = Drive::with_times(times, doses).unwrap();
        twin.free_run(&[&[0.2], m].concat(), &drive).unwrap()
    };
    for row in [0, 5] {
        for effect in [("actuator-delay", "actuator"), ("sensor-delay", "sensor")] {
            for times in [&even, &uneven] {
                let run = at(effect, &[2.25], times, row);
                let arrives = times[row] + 2.25;
                for (y, t) in run.iter().zip(times) {
                    let expected = match t - arrives {
                        late if late > 1.0 => 8.0,
                        late if late < -1.0 => 0.0,
                        _ => *y,
                    };
                    assert!((y - expected).abs() < 1e-6, "{effect:?} {row}, {t} s: {y}");
                }
            }
        }
        let run = at(("actuator-lag", "actuator"), &[1.5], &even, row);
        assert!((run[[39, 0]] - 8.0).abs() < 1e-6, "{row}: {run}");
    }
}

/// A step of a parameter within a sample of adaptive steps acts at its time: y = t, and half of what is behind it more.
#[test]
fn a_step_of_a_parameter_acts_at_its_time() {
    let text = "[parameters]\nk = { prior = [0.5, 2.0] }\n[states]\nx = { rate = \"k\", start = 0.0 }\n\
                [outputs]\ny = { value = \"x\", noise = 0.05 }";
    let base = Twin::from(Arc::new(Equations::parse(text).unwrap()));
    let step = Catalogue::default().effect("parameter-step", "k").unwrap();
    let twin = augment(base, vec![step]).unwrap();
    let drive = Drive::autonomous(2.0, 5).unwrap().beginning_at(100.0);
    let run = |time: f64| twin.free_run(&[1.0, 0.5, time], &drive).unwrap();
    for time in [0.7, 2.0, 3.1, 3.1 + 1e-7, 5.999] {
        for (k, y) in run(time).iter().enumerate() {
            let t = 2.0 * k as f64;
            let expected = t + 0.5 * (t - time).max(0.0);
            assert!(
                (y - expected).abs() < 1e-9,
                "{time}, row {k}: {y}, {expected}"
            );
        }
    }
}

/// Memories of a sensor move over the time since the row before, however the steps vary; replicates read one state.
#[test]
fn a_slow_sensor_counts_the_time_since_the_row_before() {
    let times = [0.0, 0.5, 2.0, 2.0, 2.0, 2.3, 5.0, 5.1, 9.0];
    let input = |t: f64| if t < 2.0 { 1.0 } else { 2.0 };
    let u = Signal::from_shape_fn((times.len(), 1), |(k, _)| input(times[k]));
    let drive = Drive::with_times(&times, u).unwrap();
    let base = Twin::new(CascadedTanks);
    let theta = [0.6, 0.5, 0.55, 1.0];
    let plain = base.free_run(&theta, &drive).unwrap();
    let seen = |id: &str, m: &[f64]| {
        let effect = Catalogue::default().effect(id, "sensor").unwrap();
        let twin = augment(base.clone(), vec![effect]).unwrap();
        twin.free_run(&[&theta[..], m].concat(), &drive).unwrap()
    };
    let (tau, frequency, damping) = (1.5, 0.2, 0.3);
    let (lagged, ringing) = (
        seen("sensor-lag", &[tau]),
        seen("sensor-mode", &[frequency, damping]),
    );
    // Both laws as differential equations, their signal held over the time since the row before.
    let omega = std::f64::consts::TAU * frequency;
    let (mut lag, mut mode, mut speed) = (plain[[0, 0]], plain[[0, 0]], 0.0);
    for (k, s) in plain.column(0).iter().enumerate() {
        let since = if k == 0 { 0.0 } else { times[k] - times[k - 1] };
        let parts = 20_000;
        let h = since / f64::from(parts);
        for _ in 0..parts {
            lag += h * (s - lag) / tau;
            speed += h * (omega * omega * (s - mode) - 2.0 * damping * omega * speed);
            mode += h * speed;
        }
        assert!((lagged[[k, 0]] - lag).abs() < 1e-3, "row {k}");
        assert!((ringing[[k, 0]] - mode).abs() < 1e-3, "row {k}");
    }
}

/// Actuators remember nothing in the state: a delay there is the twin with its inputs later, the first one held before.
#[test]
fn a_delayed_input_costs_no_state() {
    let delay = Catalogue::default()
        .effect("actuator-delay", "actuator")
        .unwrap();
    let base = Twin::new(CascadedTanks);
    let twin = augment(base.clone(), vec![delay]).unwrap();
    assert_eq!(twin.outline().unwrap().states.len(), 2);
    let input = |k: usize| (k % 17) as f64 / 6.0;
    let drive = |late: usize| {
        let rows = Signal::from_shape_fn((80, 1), |(k, _)| input(k.saturating_sub(late)));
        Drive::new(0.5, rows).unwrap()
    };
    let theta = [0.6, 0.5, 0.55, 1.0];
    let noise = Noise::new(1, "t", 0);
    let later = base.simulate(&theta, &drive(30), noise).unwrap();
    let delayed = twin.simulate(&[&theta[..], &[15.0]].concat(), &drive(0), noise);
    assert_eq!(delayed.unwrap(), later);
}

/// A force of one's own sees inputs, parameters bent by other effects, all states and the time.
#[test]
fn a_force_sees_the_whole_twin() {
    let kind = EffectKind::force("all", "", |m, at| {
        m[0] * (at.x + at.other + at.t + at.states[1] + at.u[0] + at.theta[3])
    })
    .magnitude(Magnitude::signed("size", "1", &[1.0]))
    .other(OtherState::From);
    let library = Catalogue::default().with(kind);
    let effects = vec![
        library.effect("all", "h1").unwrap().with_other("h2"),
        library.effect("actuator-bias", "actuator").unwrap(),
        library.effect("parameter-drift", "k4").unwrap(),
    ];
    let twin = augment(Twin::new(CascadedTanks), effects).unwrap();
    let equations = twin.equations().unwrap();
    let rate = |size: f64| {
        let theta = [0.6, 0.5, 0.55, 1.0, size, 0.25, 0.5];
        let drive = Drive::new(0.5, Signal::from_elem((5, 1), 3.0)).unwrap();
        let acting = Acting::of(equations, &theta, &drive).unwrap();
        let mut rates = [0.0; 2];
        equations.drift(&acting.at(4), &[4.0, 7.0], &mut rates);
        rates[0]
    };
    let expected = 4.0 + 7.0 + 2.0 + 7.0 + 3.25 + 1.0 * (1.0 + 0.5 * 2.0);
    assert!((rate(1.0) - rate(0.0) - expected).abs() < 1e-12);
}

/// Magnitudes have the units of the twin, not the placeholders of the library.
#[test]
fn magnitudes_have_units_of_the_twin() {
    let library = Catalogue::default();
    let effects = [
        "state-ceiling@h1",
        "quadratic-drag@h2",
        "sensor-drift@sensor",
    ];
    let placed = |key: &&str| {
        let (id, target) = key.split_once('@').unwrap();
        library.effect(id, target).unwrap()
    };
    let effects = effects.iter().map(placed);
    let effects = effects.map(|effect| match effect.id() {
        "state-ceiling" => effect.with_other("h2"),
        _ => effect,
    });
    let twin = augment(Twin::new(CascadedTanks), effects.collect()).unwrap();
    let units: Vec<String> = (twin.parameters().iter().skip(4))
        .map(|p| format!("{} {}", p.name, p.unit))
        .collect();
    assert_eq!(
        units,
        [
            "state-ceiling@h1.level V",
            "state-ceiling@h1.spill -",
            "quadratic-drag@h2.coefficient 1/(V·s)",
            "sensor-drift@sensor.rate V/s",
        ]
    );
}

/// A sensor in pascals has a bias of thousands; a fraction stays a fraction.
#[test]
fn bounds_of_magnitudes_are_the_limits_of_their_law() {
    let library = Catalogue::default();
    let signals = Twin::new(CascadedTanks).signals();
    let of = |id| magnitude_parameters(&library.effect(id, "sensor").unwrap(), &[], &signals);
    assert!(of("sensor-bias")[0].bounds.contains(-1e5));
    let drift = &of("sensor-drift")[0];
    assert!(drift.bounds.contains(1e3) && drift.start_range() == drift.prior);
    let noise = of("sensor-noise")[0].bounds;
    assert_eq!(noise.low(), 0.0);
    assert!(noise.contains(1e4));
    assert_eq!(of("sensor-rectification")[0].bounds.high(), 1.0);
}

/// Between samples, effects on inputs leave a line a line: off, no bit changes; a bias moves both ends.
#[test]
fn actuator_effects_keep_inputs_on_lines() {
    let linear = |_: &mut _, stepping: &mut Stepping| {
        stepping.hold = Hold::Linear;
        stepping.substeps = 3;
    };
    let base = Twin::new(CascadedTanks).stepped(linear).unwrap();
    let levels = |shift: f64| {
        let levels = |(k, _)| shift + [1.5, 2.5, 0.5][k / 10 % 3];
        Drive::new(0.5, Signal::from_shape_fn((60, 1), levels)).unwrap()
    };
    let theta = [0.6, 0.5, 0.55, 1.0];
    let with = |magnitudes: &[f64]| [&theta[..], magnitudes].concat();
    let plain = base
        .simulate(&theta, &levels(0.0), Noise::new(1, "line", 0))
        .unwrap();
    let run = |ids: &[&str], magnitudes: &[f64]| {
        let library = Catalogue::default();
        let effects = ids.iter().map(|id| library.effect(id, "actuator").unwrap());
        // One after the other, so that one twin holds another.
        let twin = effects.fold(base.clone(), |twin, effect| {
            augment(twin, vec![effect]).unwrap()
        });
        let noise = Noise::new(1, "line", 0);
        twin.simulate(&with(magnitudes), &levels(0.0), noise)
            .unwrap()
    };
    assert_eq!(run(&["actuator-bias"], &[0.0]), plain);
    assert_eq!(run(&["actuator-lag", "actuator-bias"], &[0.0, 0.0]), plain);
    let shifted = base
        .simulate(&theta, &levels(0.25), Noise::new(1, "line", 0))
        .unwrap();
    let biased = run(&["actuator-bias"], &[0.25]);
    assert!((&biased - &shifted).iter().all(|d| d.abs() < 1e-12));
    assert_ne!(
        run(&["actuator-bias", "actuator-lag"], &[0.25, 2.0]),
        biased
    );
}
