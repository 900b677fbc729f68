use super::pair::ExplicitPair;
use super::path::{Path, Stretch};
use super::rosenbrock::Rosenbrock;
use super::rule::StepBuffers;
use super::*;
use crate::likelihood::kalman::{Coordinates, FilterSettings, Kalman, Score};
use crate::record::{Drive, Record};
use crate::twin::{DigitalTwin, Event, Interval, Noise, Outline, Parameter, StateSpace, Twin};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Global error of ẋ = −x + t at t = 1, whose solution is 2e^{−t} + t − 1.
fn error(steps: usize, mut step: impl FnMut(&Now<'_>, &mut [f64])) -> f64 {
    let (dt, mut x) = (1.0 / steps as f64, [1.0]);
    for k in 0..steps {
        step(&Now::new(k as f64 * dt, dt, &[], &[]), &mut x);
    }
    (x[0] - 2.0 * (-1.0f64).exp()).abs()
}

/// The pendulum in a wind that grows: orders of a linear equation say nothing of the conditions of others.
fn pendulum(now: &Now<'_>, x: &[f64], dx: &mut [f64]) {
    for (x, dx) in x.chunks_exact(2).zip(dx.chunks_exact_mut(2)) {
        dx[0] = x[1];
        dx[1] = -9.81 * x[0].sin() + now.t * now.t;
    }
}

/// Halving the step divides the error by 2^order.
#[test]
fn convergence_orders() {
    for (integrator, order) in [(Integrator::Euler, 1.0), (Integrator::RungeKutta4, 4.0)] {
        let of = |steps| {
            let mut work = StepBuffers::of(1);
            error(steps, |now, x| {
                integrator.step(now, x, &mut work, |now, x, dx| dx[0] = now.t - x[0]);
            })
        };
        let measured = (of(20) / of(40)).log2();
        assert!(
            (measured - order).abs() < 0.15,
            "{integrator:?}: {measured}"
        );
    }
    let end = |steps: usize, is_implicit: bool| {
        let (mut explicit, mut implicit) = (ExplicitPair::default(), Rosenbrock::default());
        let now = Now::new(0.0, 1.0, &[], &[]);
        let mut x = [1.0, 0.0];
        for k in 0..steps {
            let length = 1.0 / steps as f64;
            let of = Stretch {
                from: k as f64 * length,
                length,
            };
            let mut path = Path {
                now: &now,
                inputs: &mut [],
                drift: &mut pendulum,
                held: vec![],
                breaks: &[],
                edge: 0.0,
                limits: None,
            };
            match is_implicit {
                true => implicit.step(&mut path, of, (&[1.0, 1.0], &mut x), None),
                false => explicit.step(&mut path, of, &mut x, None),
            }
        }
        x
    };
    let exact = end(2000, false);
    for (is_implicit, order) in [(false, 5.0), (true, 4.0)] {
        let error = |steps| (end(steps, is_implicit)[0] - exact[0]).abs();
        let measured = (error(20) / error(40)).log2();
        assert!((measured - order).abs() < 0.3, "{is_implicit}: {measured}");
    }
}

/// State at `t`, from a start, in samples of this length.
fn carried<const N: usize>(
    (rule, tolerance): (Integrator, f64),
    start: [f64; N],
    (t, samples): (f64, usize),
    rates: impl Fn(f64, &[f64], &mut [f64]),
) -> ([f64; N], StepsTaken) {
    let (mut x, limits) = (start, [Interval::EVERYTHING; N]);
    let taken = carry_within(&limits, (rule, tolerance), &mut x, (t, samples), rates);
    (x, taken)
}

/// Carries points of as many states as limits to `t`, in samples of this length.
fn carry_within(
    limits: &[Interval],
    (rule, tolerance): (Integrator, f64),
    x: &mut [f64],
    (t, samples): (f64, usize),
    rates: impl Fn(f64, &[f64], &mut [f64]),
) -> StepsTaken {
    let stepping = Stepping {
        tolerance,
        ..Stepping::default()
    };
    let mut work = Workspace::of(&[], limits, (rule, stepping), &[]);
    let (n, dt) = (limits.len(), t / samples as f64);
    for k in 0..samples {
        let now = Now::new(k as f64 * dt, dt, &[], &[]);
        work.carry(n, &now, x, |now, x, dx| {
            for (x, dx) in x.chunks_exact(n).zip(dx.chunks_exact_mut(n)) {
                rates(now.t, x, dx);
            }
        });
    }
    work.steps_taken().unwrap()
}

/// A switch at a time that the equations tell, at the coarsest tolerance; one at a row, too.
#[test]
fn a_step_ends_at_a_jump_that_is_told() {
    struct Switch;
    impl StateSpace for Switch {
        fn outline(&self) -> Outline {
            Outline::new()
                .parameter(Parameter::new("at", "s", 1.0, 3.0))
                .state("x", "1")
                .output("y", "1")
        }
        fn drift(&self, now: &Now<'_>, _: &[f64], dx: &mut [f64]) {
            dx[0] = if now.t > now.theta[0] { now.t } else { 0.0 };
        }
        fn observe(&self, _: &Now<'_>, x: &[f64], y: &mut [f64]) {
            y[0] = x[0];
        }
        fn jumps(&self, now: &Now<'_>) -> Option<Vec<f64>> {
            Some(vec![now.theta[0]])
        }
        fn start(&self, _: &Now<'_>, x: &mut [f64]) {
            x[0] = 0.0;
        }
        fn noise(&self, _: &Now<'_>, _: &[f64], _: &mut [f64], measurement: &mut [f64]) {
            measurement[0] = 0.1;
        }
        fn integrator(&self) -> Integrator {
            Integrator::Adaptive
        }
        fn stepping(&self) -> Stepping {
            Stepping {
                tolerance: *TOLERANCES.end(),
                ..Stepping::default()
            }
        }
    }
    let drive = Drive::autonomous(2.0, 4).unwrap();
    let outputs = Twin::new(Switch).free_run(&[2.7], &drive).unwrap();
    let record = Record::new(drive.clone(), outputs.clone()).unwrap();
    let (twin, settings) = (Twin::new(Switch), FilterSettings::default());
    let kalman = Kalman::new(twin.equations().unwrap(), &record, &settings).unwrap();
    for at in [2.2_f64, 2.5, 2.9] {
        // Filters side by side, each with its own time; coordinates are logarithms.
        let coordinates = Coordinates::new(&twin.parameters());
        let score = Score::forward(&kalman, &[at], &coordinates).unwrap();
        let residual = |(k, y): (usize, &f64)| {
            let t = 2.0 * k as f64;
            let late = t > at;
            let of = y - 0.5 * (t * t - at * at).max(0.0);
            -of * f64::from(late) * at / 0.1_f64.powi(2)
        };
        let expected: f64 = outputs.iter().enumerate().map(residual).sum();
        let slope = score.gradient[0] / at;
        assert!(
            (slope / expected - 1.0).abs() < 1e-2,
            "{at}: {slope}, {expected}"
        );
    }
    let twins = [
        Twin::new(Switch),
        Twin::from(Arc::new(Switch) as Arc<dyn DigitalTwin>),
    ];
    for at in [1.1_f64, 2.0, 2.7, 3.999] {
        for twin in &twins {
            let run = twin.free_run(&[at], &drive).unwrap();
            for (k, y) in run.iter().enumerate() {
                let t = 2.0 * k as f64;
                let expected = 0.5 * (t * t - at * at).max(0.0);
                assert!(
                    (y - expected).abs() < 1e-9,
                    "{at}, row {k}: {y}, {expected}"
                );
            }
        }
    }
}

/// A block that dry friction holds or lets go: where its rates jump again and again, a run takes steps of one length.
#[test]
fn a_run_at_rest_takes_few_steps() {
    for (push, samples) in [(0.5, 20), (0.99, 20), (0.5, 4), (1.5, 20)] {
        let block = |t: f64, x: &[f64], dx: &mut [f64]| {
            let friction = if x[1] == 0.0 { 0.0 } else { x[1].signum() };
            (dx[0], dx[1]) = (x[1], push * (0.7 * t).cos() - friction);
        };
        let start = [0.0, 0.4];
        let (_, taken) = carried((Integrator::Adaptive, 1e-7), start, (20.0, samples), block);
        assert!(
            taken.substeps <= 40 * samples,
            "{push}, {samples}: {taken:?}"
        );
    }
}

/// A state that begins exactly where its rate jumps, small jumps and large ones: differences across it would hold the state for a step.
#[test]
fn a_state_leaves_a_jump_where_it_begins() {
    for (rule, jump) in [Integrator::Adaptive, Integrator::Stiff]
        .into_iter()
        .flat_map(|rule| [1e-6, 1e-3, 0.2, -0.4].map(|jump| (rule, jump)))
    {
        let sign = |x: f64| if x == 0.0 { 0.0 } else { x.signum() };
        let (x, _) = carried((rule, 1e-7), [0.7, 1.0], (1.0, 10), |_, x, dx| {
            dx[0] = -0.5 - jump * sign(x[0] - 0.7);
            dx[1] = -1e4 * (x[1] - x[0]);
        });
        let off = x[0] - (0.2 + jump);
        assert!(off.abs() < 1e-4, "{rule:?}, {jump}: {off}");
    }
}

/// A level that rises and falls, held at 0.16 from 0.2 to 0.5 s, and what it fills; both also upside down.
#[test]
fn a_limit_holds_within_a_step() {
    let levels = [0.16, -0.16];
    for (rule, tolerance, error) in [
        (Integrator::Adaptive, 1e-4, 1e-3),
        (Integrator::Adaptive, 1e-7, 1e-6),
        (Integrator::Adaptive, 1e-10, 1e-9),
        (Integrator::Stiff, 1e-5, 1e-4),
        (Integrator::Stiff, 1e-8, 1e-7),
    ] {
        for sign in [1.0, -1.0] {
            let [low, high] = match sign > 0.0 {
                true => [f64::NEG_INFINITY, levels[0]],
                false => [levels[1], f64::INFINITY],
            };
            let limits = [Interval::new(low, high).unwrap(), Interval::EVERYTHING];
            for points in [1, 3] {
                let starts = [0.0, 0.02, -0.03];
                let mut x: Vec<f64> = starts[..points]
                    .iter()
                    .flat_map(|z| [sign * z, 0.0])
                    .collect();
                let taken =
                    carry_within(&limits, (rule, tolerance), &mut x, (1.0, 1), |t, x, dx| {
                        dx[0] = sign * (1.0 - 2.0 * t);
                        dx[1] = x[0];
                    });
                for (x, z) in x.chunks(2).zip(starts) {
                    let met = 0.5 - (0.25 - 0.16 + z).sqrt();
                    let rising = z * met + met.powi(2) / 2.0 - met.powi(3) / 3.0;
                    let filled = rising + (1.0 - met) * 0.16 - 0.125 / 3.0;
                    // Several points, each at the limit at its own time, take steps of one length.
                    let allowed = if points > 1 {
                        f64::max(error, 5e-4)
                    } else {
                        error
                    };
                    let errors = [sign * x[0] + 0.09, sign * x[1] - filled];
                    let is_near = errors.iter().all(|error| error.abs() < allowed);
                    assert!(
                        is_near,
                        "{rule:?} to {tolerance}, {points}: {errors:?}, {taken:?}"
                    );
                }
            }
        }
    }
}

fn robertson(_: f64, x: &[f64], dx: &mut [f64]) {
    dx[0] = -0.04 * x[0] + 1e4 * x[1] * x[2];
    dx[2] = 3e7 * x[1] * x[1];
    dx[1] = -dx[0] - dx[2];
}

fn hires(_: f64, y: &[f64], d: &mut [f64]) {
    d[0] = -1.71 * y[0] + 0.43 * y[1] + 8.32 * y[2] + 0.0007;
    d[1] = 1.71 * y[0] - 8.75 * y[1];
    d[2] = -10.03 * y[2] + 0.43 * y[3] + 0.035 * y[4];
    d[3] = 8.32 * y[1] + 1.71 * y[2] - 1.12 * y[3];
    d[4] = -1.745 * y[4] + 0.43 * y[5] + 0.43 * y[6];
    d[5] = -280.0 * y[5] * y[7] + 0.69 * y[3] + 1.71 * y[4] - 0.43 * y[5] + 0.69 * y[6];
    d[6] = 280.0 * y[5] * y[7] - 1.81 * y[6];
    d[7] = -d[6];
}

/// The oscillator of van der Pol with ν = 1000, in its own time.
fn van_der_pol(_: f64, x: &[f64], dx: &mut [f64]) {
    dx[0] = x[1];
    dx[1] = 1000.0 * (1.0 - x[0] * x[0]) * x[1] - x[0];
}

fn brusselator(_: f64, x: &[f64], dx: &mut [f64]) {
    dx[0] = 1.0 + x[0] * x[0] * x[1] - 4.0 * x[0];
    dx[1] = 3.0 * x[0] - x[0] * x[0] * x[1];
}

/// A motor of 0.5 mH and 2 Ω (0.25 ms), seen every 5 ms.
fn motor(t: f64, x: &[f64], dx: &mut [f64]) {
    let voltage = 12.0 * (20.0 * t).sin();
    dx[0] = (voltage - 2.0 * x[0] - 0.05 * x[1]) / 5e-4;
    dx[1] = (0.05 * x[0] - 1e-5 * x[1]) / 1e-4;
}

/// Largest difference of any state, as a share of its size.
fn apart<const N: usize>(a: [f64; N], b: [f64; N], sizes: [f64; N]) -> f64 {
    (0..N)
        .map(|i| (a[i] - b[i]).abs() / sizes[i])
        .fold(0.0, f64::max)
}

/// Published values (Mazzia, Magherini: *Test Set for Initial Value Problem Solvers*; Robertson at 40 s: Shampine), and steps to 10⁻¹²:
/// within a millionth of the scale of each state at the usual tolerance, whatever rule is asked for.
#[test]
fn stiff_systems_are_carried_to_a_millionth_of_their_scale() {
    use Integrator::{Adaptive, Stiff};
    let at = |rule| (rule, Stepping::default().tolerance);
    for rule in [Adaptive, Stiff] {
        let (x, _) = carried(at(rule), [1.0, 0.0, 0.0], (40.0, 40), robertson);
        let known = [
            0.715_827_068_719_394,
            9.185534764557338e-6,
            0.2841637457458413,
        ];
        let off = apart(x, known, [1.0, 4e-5, 1.0]);
        assert!(off < 1e-6, "Robertson, {rule:?}: {off:e}");

        let start = [1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0057];
        let (x, taken) = carried(at(rule), start, (321.8122, 300), hires);
        let known = [
            0.7371312573325668e-3,
            0.1442485726316185e-3,
            0.5888729740967575e-4,
            0.1175651343283149e-2,
            0.2386356198831331e-2,
            0.6238968252742796e-2,
            0.2849998395185769e-2,
            0.2850001604814231e-2,
        ];
        let off = apart(x, known, [1.0, 0.2, 0.05, 0.5, 0.05, 0.3, 5.7e-3, 5.7e-3]);
        assert!(off < 1e-6, "HIRES, {rule:?}: {off:e}, {taken:?}");

        // In time over ν: 2 units, at which the speed over ν is known.
        let (x, taken) = carried(at(rule), [2.0, -0.66e-3], (2000.0, 400), van_der_pol);
        let known = [1.706167732170483, -0.8928097010247975e-3];
        let off = apart(x, known, [2.0, 1.3]);
        assert!(off < 1e-6, "van der Pol, {rule:?}: {off:e}, {taken:?}");

        let (exact, _) = carried((Adaptive, 1e-12), [1.5, 3.0], (20.0, 200), brusselator);
        let (x, _) = carried(at(rule), [1.5, 3.0], (20.0, 200), brusselator);
        let off = apart(x, exact, [4.0, 5.0]);
        assert!(off < 1e-6, "Brusselator, {rule:?}: {off:e}");

        let (exact, _) = carried((Adaptive, 1e-12), [0.0; 2], (0.5, 5000), motor);
        let (x, _) = carried(at(rule), [0.0; 2], (0.5, 100), motor);
        let off = apart(x, exact, [6.0, 240.0]);
        assert!(off < 1e-6, "motor, {rule:?}: {off:e}");
    }
}

/// Explicit steps stay where they serve, and give way where they are many.
#[test]
fn the_method_follows_the_system() {
    let adaptive = (Integrator::Adaptive, Stepping::default().tolerance);
    let (_, taken) = carried(adaptive, [1.5, 3.0], (20.0, 200), brusselator);
    assert_eq!(taken.implicit, 0, "{taken:?}");
    let (_, taken) = carried(adaptive, [2.0, 0.0], (2000.0, 400), van_der_pol);
    assert!(taken.implicit > 390 && taken.substeps < 20_000, "{taken:?}");
    // A force that changes its sign at every step of a body at rest costs a limited number of steps.
    let (x, taken) = carried(adaptive, [1.0], (3.0, 30), |_, x, dx| {
        dx[0] = -x[0].signum()
    });
    assert!(x[0].abs() < 0.1 / 32.0, "{x:?}");
    assert!(taken.most < 100, "{taken:?}");
}

/// Points around a body that dry friction holds: steps of one length where each point comes to rest at its own time, neither implicit ones nor steps
/// without end; each point ends where many short steps end, to what one step moves it.
#[test]
fn points_that_friction_stops_take_steps_of_one_length() {
    let force = |t: f64| 1.2 * (3.0 * t).sin();
    let rates = |now: &Now<'_>, x: &[f64], dx: &mut [f64]| {
        for (x, dx) in x.iter().zip(dx) {
            *dx = force(now.t) - x.signum() - 0.1 * x;
        }
    };
    let (dt, start) = (0.05, [0.0, 0.02, -0.02, 0.05, -0.05]);
    let limits = [Interval::EVERYTHING];
    let rule = (Integrator::Adaptive, Stepping::default());
    let mut work = Workspace::of(&[], &limits, rule, &[]);
    let (mut points, mut exact) = (start, start);
    for k in 0..60 {
        let t = f64::from(k) * dt;
        work.carry(1, &Now::new(t, dt, &[], &[]), &mut points, rates);
        let short = dt / 2000.0;
        for i in 0..2000 {
            let mut dx = [0.0; 5];
            let now = Now::new(t + f64::from(i) * short, short, &[], &[]);
            rates(&now, &exact, &mut dx);
            for (x, dx) in exact.iter_mut().zip(dx) {
                *x += short * dx;
            }
        }
        for (x, exact) in points.iter().zip(exact) {
            assert!((x - exact).abs() < 2.2 * short, "{k}: {x} {exact}");
        }
    }
    let taken = work.steps_taken().unwrap();
    assert_eq!((taken.implicit, taken.most), (0, 32), "{taken:?}");
    assert!(taken.substeps > 20 * 32, "{taken:?}");
}

/// Rates of points of `n` states each, followed by all of them and by the first alone, are those of short steps.
fn assert_followed(n: usize, dt: f64, points: &[f64], rates: impl Fn(f64, &[f64], &mut [f64])) {
    let all = |now: &Now<'_>, x: &[f64], dx: &mut [f64]| {
        for (x, dx) in x.chunks_exact(n).zip(dx.chunks_exact_mut(n)) {
            rates(now.t, x, dx);
        }
    };
    for points in [points, &points[..n]] {
        let rule = (Integrator::Adaptive, Stepping::default());
        let mut work = Workspace::of(&[], &vec![Interval::EVERYTHING; n], rule, &[]);
        let (mut found, mut exact) = (points.to_vec(), points.to_vec());
        let mut buffers = StepBuffers::of(n);
        for k in 0..7 {
            let t = f64::from(k) * dt;
            work.carry(n, &Now::new(t, dt, &[], &[]), &mut found, all);
            let short = dt / 20_000.0;
            for i in 0..20_000 {
                let now = Now::new(t + f64::from(i) * short, short, &[], &[]);
                Integrator::RungeKutta4.step(&now, &mut exact, &mut buffers, all);
            }
            for (x, exact) in found.iter().zip(&exact) {
                assert!((x - exact).abs() < 5e-6, "{points:?}, {k}: {x} {exact}");
            }
        }
        let taken = work.steps_taken().unwrap();
        assert!(taken.substeps < 5000, "{taken:?}");
    }
}

/// Rates that are steep in time alone are no jump that each point meets for itself: all follow them within the tolerance, from a state of zero, with gains
/// of their own, and where a state integrates what changes, too.
#[test]
fn points_follow_what_is_steep_in_time() {
    let pulse = |t: f64| (-((t - 9.93) / 0.1225).powi(2)).exp();
    let wave = |t: f64| (30.0 * (1.37 * t).sin()).tanh();
    assert_followed(1, 2.0, &[0.0, 0.1, -0.1], |t, _, dx| dx[0] = pulse(t));
    assert_followed(1, 1.0, &[0.0, 0.1, -0.1], |t, x, dx| dx[0] = wave(t) - x[0]);
    let mass = [0.0, 0.0, 0.1, 0.0, -0.1, 0.0, 0.0, 0.1, 0.0, -0.1];
    assert_followed(2, 2.0, &mass, |t, x, dx| (dx[0], dx[1]) = (x[1], pulse(t)));
    let gains = [0.1, 1.0, 0.1, 0.6, 0.1, 1.4];
    assert_followed(2, 1.0, &gains, |t, x, dx| {
        (dx[0], dx[1]) = (x[1] * wave(t) - x[0], 0.0)
    });
}

/// Rates that turn round where a state passes a wave are met by each point at its own time, and take steps of one length.
#[test]
fn points_that_pass_a_wave_take_steps_of_one_length() {
    let rates = |now: &Now<'_>, x: &[f64], dx: &mut [f64]| {
        for (x, dx) in x.iter().zip(dx) {
            *dx = -(x - (3.0 * now.t).sin()).signum() - 0.1 * x;
        }
    };
    let mut points = [0.0, 0.02, -0.02, 0.05, -0.05];
    let rule = (Integrator::Adaptive, Stepping::default());
    let mut work = Workspace::of(&[], &[Interval::EVERYTHING], rule, &[]);
    for k in 0..60 {
        let now = Now::new(f64::from(k) * 0.05, 0.05, &[], &[]);
        work.carry(1, &now, &mut points, rates);
    }
    let taken = work.steps_taken().unwrap();
    assert_eq!((taken.implicit, taken.most), (0, 32), "{taken:?}");
}

/// An outflow by the root of a level that runs empty is steep, and not stiff.
#[test]
fn what_is_steep_at_one_place_stays_explicit() {
    let adaptive = (Integrator::Adaptive, Stepping::default().tolerance);
    let (_, taken) = carried(adaptive, [1.0], (50.0, 100), |t, x, dx| {
        let pump = if (t / 10.0) as usize == 2 { 0.8 } else { 0.0 };
        dx[0] = pump - 0.5 * x[0].max(0.0).sqrt();
    });
    assert_eq!(taken.implicit, 0, "{taken:?}");
    assert!(taken.substeps < 600, "{taken:?}");
}

/// All points take one schedule: differences are those of one smooth function.
#[test]
fn points_take_the_same_steps() {
    let rates = |_: &Now<'_>, x: &[f64], dx: &mut [f64]| {
        for (x, dx) in x.chunks_exact(2).zip(dx.chunks_exact_mut(2)) {
            van_der_pol(0.0, x, dx);
        }
    };
    let now = Now::new(0.0, 5.0, &[], &[]);
    let limits = [Interval::EVERYTHING; 2];
    let rule = (Integrator::Adaptive, Stepping::default());
    let mut work = Workspace::of(&[], &limits, rule, &[]);
    let at = |work: &mut Workspace, x: f64| {
        let mut points = [2.0, 0.0, x, 0.0];
        work.carry(2, &now, &mut points, rates);
        points[2]
    };
    let before = at(&mut work, 2.0);
    let taken = work.steps_taken().unwrap();
    let slope = (at(&mut work, 2.0 + 1e-7) - before) / 1e-7;
    for k in 1..50 {
        let shift = 1e-9 * f64::from(k);
        let off = at(&mut work, 2.0 + shift) - before - slope * shift;
        assert!(off.abs() < 1e-13, "{k}: {off:e}");
    }
    assert_eq!(work.steps_taken().unwrap(), taken, "one schedule");
}

/// An amount is in the state behind its row, whatever the rule; other inputs are as they say.
#[test]
fn amounts_are_added_at_their_rows() {
    let holds = [Hold::Impulse, Hold::Linear];
    let rates = |now: &Now<'_>, x: &[f64], dx: &mut [f64]| {
        dx[0] = -0.5 * x[0] + 2.0 * now.u[0];
        dx[1] = now.u[1];
    };
    for rule in [
        Integrator::Adaptive,
        Integrator::Stiff,
        Integrator::RungeKutta4,
    ] {
        let limits = [Interval::EVERYTHING; 2];
        let mut work = Workspace::of(&holds, &limits, (rule, Stepping::default()), &[]);
        let between = Between {
            next: &[0.0, 3.0],
            holds: &holds,
            bends: &[],
        };
        let now = Now {
            between: Some(between),
            ..Now::new(0.0, 0.2, &[4.0, 1.0], &[])
        };
        let mut x = [1.0, 0.0];
        work.carry(2, &now, &mut x, rates);
        let decayed = 9.0 * (-0.1f64).exp();
        assert!((x[0] - decayed).abs() < 1e-6, "{rule:?}: {x:?}");
        assert!((x[1] - 0.4).abs() < 1e-12, "{rule:?}: {x:?}");
    }
}

/// An input that jumps half-way has no mean there: ẋ = u² from 1 to −3 over 0.2 s.
#[test]
fn no_step_goes_over_the_jump_of_an_input() {
    for rule in [
        Integrator::Euler,
        Integrator::RungeKutta4,
        Integrator::Adaptive,
    ] {
        for substeps in [1, 2, 3, 5] {
            let stepping = Stepping {
                substeps,
                ..Stepping::default()
            };
            let limits = [Interval::EVERYTHING];
            let mut work = Workspace::of(&[Hold::Nearest], &limits, (rule, stepping), &[]);
            let between = Between {
                next: &[-3.0],
                holds: &[Hold::Nearest],
                bends: &[],
            };
            let now = Now {
                between: Some(between),
                ..Now::new(0.0, 0.2, &[1.0], &[])
            };
            let mut x = [0.0];
            work.carry(1, &now, &mut x, |now, _, dx| dx[0] = now.u[0].powi(2));
            assert!((x[0] - 1.0).abs() < 1e-12, "{rule:?}, {substeps}: {x:?}");
        }
    }
}

/// A fall through so many thresholds, which counts its rates.
struct Thresholds {
    number: u32,
    rates: AtomicUsize,
}

impl StateSpace for Thresholds {
    fn outline(&self) -> Outline {
        let outline = Outline::new().parameter(Parameter::new("g", "m/s²", 9.0, 11.0));
        let outline = outline.state("h", "m").state("v", "m/s").output("y", "m");
        (0..self.number).fold(outline, |outline, i| {
            let height = 0.5 + f64::from(i) / 1000.0;
            let slow = |_: &Now<'_>, x: &mut [f64]| x[1] *= 0.999;
            outline.event(Event::when("threshold", move |_, x| height - x[0], slow))
        })
    }
    fn drift(&self, now: &Now<'_>, x: &[f64], dx: &mut [f64]) {
        self.rates.fetch_add(1, Ordering::Relaxed);
        (dx[0], dx[1]) = (x[1], -now.theta[0]);
    }
    fn observe(&self, _: &Now<'_>, x: &[f64], y: &mut [f64]) {
        y[0] = x[0];
    }
    fn start(&self, _: &Now<'_>, x: &mut [f64]) {
        x[0] = 1.0;
    }
    fn integrator(&self) -> Integrator {
        Integrator::Adaptive
    }
}

/// The cost of events of one interval grows with their number: only those that come first are located.
#[test]
fn many_events_cost_in_proportion() {
    let rates = |number: u32| {
        let rates = AtomicUsize::new(0);
        let twin = Thresholds { number, rates };
        let drive = Drive::autonomous(1.0, 2).unwrap();
        twin.simulate(&[10.0], &drive, Noise::OFF).unwrap();
        twin.rates.into_inner()
    };
    let [few, many] = [20, 80].map(rates);
    assert!(many < 6 * few, "{few} {many}");
}

/// A count of how often the time has passed a limit, and the time since.
struct Alarm {
    limit: f64,
    rule: Integrator,
}

impl StateSpace for Alarm {
    fn outline(&self) -> Outline {
        let limit = self.limit;
        let passed = Event::when("passed", move |now, _| now.t - limit, |_, x| x[0] += 1.0);
        // Others, that change nothing, cut the ways to rows and from them.
        let beside = |part: f64| {
            let margin = move |now: &Now<'_>, _: &[f64]| (20.0 * now.t + part).sin();
            Event::when("beside", margin, |_, _| {})
        };
        Outline::new()
            .parameter(Parameter::new("k", "-", 0.5, 2.0))
            .state("count", "-")
            .state("since", "s")
            .output("count", "-")
            .output("since", "s")
            .event(passed)
            .event(beside(0.3))
            .event(beside(1.7))
    }
    fn drift(&self, now: &Now<'_>, _: &[f64], dx: &mut [f64]) {
        dx[1] = f64::from(now.t > self.limit);
    }
    fn observe(&self, _: &Now<'_>, x: &[f64], y: &mut [f64]) {
        y.copy_from_slice(x);
    }
    fn start(&self, _: &Now<'_>, _: &mut [f64]) {}
    fn integrator(&self) -> Integrator {
        self.rule
    }
}

/// The end of a step and the next row are one time: what is behind the time of a row is seen once, and not at that row.
#[test]
fn a_time_of_a_row_is_passed_once() {
    let rows = 60;
    let made = Drive::autonomous(0.1, rows).unwrap();
    let times: Vec<f64> = (0..rows).map(|k| k as f64 / 10.0).collect();
    let read = Drive::with_times(&times, made.inputs().clone()).unwrap();
    for rule in [
        Integrator::Euler,
        Integrator::RungeKutta4,
        Integrator::Adaptive,
        Integrator::Stiff,
    ] {
        for (k, drive) in (0..rows - 1).flat_map(|k| [(k, &made), (k, &read)]) {
            let limit = times[k];
            let y = (Alarm { limit, rule }).simulate(&[1.0], drive, Noise::OFF);
            let y = y.unwrap();
            for (row, y) in y.rows().into_iter().enumerate() {
                let count = if row > k { 1.0 } else { 0.0 };
                assert_eq!(y[0], count, "{rule:?}: row {row} of {k}");
                assert!(row > k || y[1] == 0.0, "{rule:?}: row {row} of {k}: {y}");
            }
        }
    }
}

/// ẍ = −ω²·x − 0.3·ẋ from 1.
struct Swing(f64);

impl StateSpace for Swing {
    fn outline(&self) -> Outline {
        let outline = Outline::new().parameter(Parameter::new("k", "-", 0.5, 2.0));
        let outline = outline.state("x", "m").state("v", "m/s");
        outline.output("y", "m")
    }
    fn drift(&self, _: &Now<'_>, x: &[f64], dx: &mut [f64]) {
        (dx[0], dx[1]) = (x[1], -self.0.powi(2) * x[0] - 0.3 * x[1]);
    }
    fn observe(&self, _: &Now<'_>, x: &[f64], y: &mut [f64]) {
        y[0] = x[0];
    }
    fn start(&self, _: &Now<'_>, x: &mut [f64]) {
        x[0] = 1.0;
    }
    fn integrator(&self) -> Integrator {
        Integrator::Adaptive
    }
}

/// A gap takes the steps that it needs; one that needs too many ends the run, and is not gone over in steps that are too long.
#[test]
fn a_long_gap_is_crossed_or_refused() {
    let after = |omega: f64, gap: f64| -> Result<f64, _> {
        let drive = Drive::autonomous(gap, 2).unwrap();
        let y = Swing(omega).simulate(&[1.0], &drive, Noise::OFF);
        y.map(|y| y[[1, 0]])
    };
    for gap in [20.0f64, 300.0, 1200.0, 2700.0] {
        let omega = (3.1f64.powi(2) - 0.0225).sqrt();
        let exact =
            (-0.15 * gap).exp() * ((omega * gap).cos() + 0.15 / omega * (omega * gap).sin());
        let y = after(3.1, gap).unwrap();
        assert!((y - exact).abs() < 1e-4, "{gap} s: {y} {exact}");
    }
    let error = after(1e5, 1e4).unwrap_err().to_string();
    assert!(
        error.contains("too many steps between t = 0 s and 10000 s"),
        "{error}"
    );
}
