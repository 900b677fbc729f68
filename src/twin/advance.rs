//! One step of any equations; the points of several filters.

use super::integrator::{Integrator, Refined};
use super::points::{gather, scatter};
use super::simulation::simulate_equations;
use crate::math::{LANES, Lanes};
use crate::record::{Drive, Signal};
use crate::twin::{
    Advance, Interval, LanePoints, Layout, Noise, Now, Points, SimulationError, StateSpace,
    Stepping, Workspace,
};

/// States of a twin in lanes, at most.
const MOST: usize = 4;

impl Workspace {
    /// For the states of `twin`, and its substeps.
    pub fn new(twin: &(impl StateSpace + ?Sized)) -> Self {
        let outline = twin.outline();
        let stepping = twin.stepping();
        let refined = (stepping != Stepping::default()).then(|| {
            let limits = twin.limits().into_iter().enumerate();
            Box::new(Refined {
                substeps: stepping.substeps.max(1),
                limits: limits
                    .filter(|(_, limit)| *limit != Interval::EVERYTHING)
                    .collect(),
                inputs: vec![0.0; outline.inputs.len()],
            })
        });
        let mut work = Self::of_states(outline.states.len());
        work.refined = refined;
        work
    }
}

impl<T: StateSpace> Advance for T {
    #[inline]
    fn advance(&self, now: &Now<'_>, x: &mut [f64], work: &mut Workspace) {
        self.update(now, x);
        // One call of the drift, compiled inline, for what most twins do.
        if work.refined.is_none() && self.integrator() == Integrator::Euler {
            let drift = |now: &Now<'_>, x: &[f64], dx: &mut [f64]| self.drift(now, x, dx);
            return Integrator::Euler.step(now, x, work, drift);
        }
        carry(self, now, x, work);
    }

    fn run_equations(
        &self,
        theta: &[f64],
        drive: &Drive,
        noise: Noise,
    ) -> Result<Signal, SimulationError> {
        simulate_equations(self, theta, drive, noise)
    }

    fn advance_lanes(
        &self,
        now: &[Now<'_>],
        points: LanePoints<'_>,
        work: &mut Workspace,
    ) -> [bool; LANES] {
        // Loops of known length, for the sizes of most twins.
        match points.shifts.len() {
            1 => advance_lanes(self, 1, now, points, work),
            2 => advance_lanes(self, 2, now, points, work),
            3 => advance_lanes(self, 3, now, points, work),
            n => advance_lanes(self, n, now, points, work),
        }
    }

    fn observe_lanes(
        &self,
        now: &[Now<'_>],
        n: usize,
        x: &[Lanes],
        y: &mut [Lanes],
        buffer: &mut [f64],
    ) {
        match n {
            1 => observe_lanes(self, 1, now, x, y, buffer),
            2 => observe_lanes(self, 2, now, x, y, buffer),
            3 => observe_lanes(self, 3, now, x, y, buffer),
            n => observe_lanes(self, n, now, x, y, buffer),
        }
    }

    fn noise_lanes(&self, now: &[Now<'_>], process: &mut [Lanes], measurement: &mut Lanes) {
        match process.len() {
            1 => noise_lanes(self, 1, now, process, measurement),
            2 => noise_lanes(self, 2, now, process, measurement),
            3 => noise_lanes(self, 3, now, process, measurement),
            n => noise_lanes(self, n, now, process, measurement),
        }
    }

    fn readout_lanes(&self, now: &[Now<'_>], y: &mut [Lanes]) -> [bool; LANES] {
        let mut changed = [false; LANES];
        for ((lane, at), changed) in now.iter().enumerate().zip(&mut changed) {
            for y in &mut *y {
                *changed |= self.readout_each(at, 1, &mut y.0[lane..=lane]);
            }
        }
        changed
    }
}

/// One step by any integrator, in substeps.
#[inline(never)]
fn carry<T: StateSpace>(twin: &T, now: &Now<'_>, x: &mut [f64], work: &mut Workspace) {
    let drift = |now: &Now<'_>, x: &[f64], dx: &mut [f64]| twin.drift(now, x, dx);
    (twin.integrator()).carry(x.len(), now, x, work, drift);
}

#[inline(always)]
fn advance_lanes<T: StateSpace>(
    twin: &T,
    n: usize,
    now: &[Now<'_>],
    points: LanePoints<'_>,
    work: &mut Workspace,
) -> [bool; LANES] {
    let (moving, length) = (1 + 2 * n, (1 + 4 * n) * n);
    let (all, one) = (&mut points.all[..length], &mut points.one[..length]);
    let (shifts, shift) = (&points.shifts[..n], &mut points.shift[..n]);
    let mut bent = [false; LANES];
    for (lane, at) in now.iter().enumerate() {
        gather(&all[..moving * n], lane, &mut one[..moving * n]);
        gather(shifts, lane, shift);
        let point = Points {
            all: &mut *one,
            moving,
            limits: points.limits,
            shifts: &*shift,
        };
        bent[lane] = twin.advance_each(at, point, work);
        let (moved, shifted) = one.split_at(moving * n);
        scatter(moved, (lane, now.len()), &mut all[..moving * n]);
        if bent[lane] {
            scatter(shifted, (lane, now.len()), &mut all[moving * n..]);
        }
    }
    bent
}

#[inline(always)]
fn observe_lanes<T: StateSpace>(
    twin: &T,
    n: usize,
    now: &[Now<'_>],
    x: &[Lanes],
    y: &mut [Lanes],
    buffer: &mut [f64],
) {
    let points = 1 + 2 * n;
    let (x, y) = (&x[..points * n], &mut y[..points]);
    let buffer = &mut buffer[..points * n];
    let mut outputs = [0.0; 1 + 2 * MOST];
    let outputs = &mut outputs[..points];
    for (lane, at) in now.iter().enumerate() {
        gather(x, lane, buffer);
        twin.observe_each(at, Layout::dense(n), 1, buffer, outputs);
        scatter(outputs, (lane, now.len()), y);
    }
}

#[inline(always)]
fn noise_lanes<T: StateSpace>(
    twin: &T,
    n: usize,
    now: &[Now<'_>],
    process: &mut [Lanes],
    measurement: &mut Lanes,
) {
    let mut levels = [0.0; MOST + 1];
    let (q, r) = levels[..=n].split_at_mut(n);
    for (lane, at) in now.iter().enumerate() {
        q.fill(0.0);
        r.fill(0.0);
        twin.noise(at, q, r);
        scatter(q, (lane, now.len()), &mut process[..n]);
        scatter(r, (lane, now.len()), std::slice::from_mut(measurement));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::likelihood::kalman::{FilterSettings, Kalman};
    use crate::record::Record;
    use crate::twin::{Hold, Integrator, Outline, Parameter, Twin, fix};

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
        fn noise(&self, _: &Now<'_>, _: &mut [f64], measurement: &mut [f64]) {
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
        let change = |_: &mut _, to: &mut Stepping| *to = Stepping { substeps, hold };
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
        // Of an odd number of substeps, the middle one has the mean.
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
            let plain = Kalman::new(&Vessel(rule), &record, &settings)
                .and_then(|kalman| kalman.filter(&[0.2, 0.5]))
                .unwrap();
            assert!(plain.innovations.iter().any(|e| e.abs() > 1e-2));
        }
    }
}
