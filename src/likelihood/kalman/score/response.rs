//! First-order responses of a filter's predictions to small additions inside the twin.
//!
//! ```text
//! δȳ_k     = C_k·δx_k + e_k
//! δx_{k+1} = A_k·(δx_k − K_k·δȳ_k) + B_k·d_k        δx_0 = 0
//! ```
//!
//! A, C: derivatives of a step and of the outputs along the filtered states; K: the filter's gain, from the covariances of the same
//! linear model. d: an addition that is held over a step, to a rate (B = ½Δt·(A + I); an Euler step has Δt·I, 4 % more at 0.08 time constants),
//! an input or the logarithm of a parameter (differences); e: an addition to an output.
//!
//! One run along the record serves any number of additions, each of which then costs a small product a row in place of a filter's pass. That
//! is a screen, not a likelihood: what changes covariances is left out.

use crate::likelihood::kalman::order::Order;
use crate::likelihood::kalman::run::spread_start;
use crate::likelihood::kalman::{FilterError, FilterSettings, Kalman};
use crate::parallel::each;
use crate::record::Signal;
use crate::twin::{Acting, Composed, Entry, Now, Role};
use nalgebra::{DMatrix, DVector};

/// Step of a difference, as a share of what a state or a parameter varies.
const STEP: f64 = 1e-4;

/// A twin along its filtered states, linear from row to row.
pub(crate) struct Responses {
    rows: Vec<ResponseRow>,
    /// Numbers of states and outputs.
    size: (usize, usize),
    /// Samples by which each output is late; empty where none is.
    late: Vec<usize>,
    /// Filtered states, memories behind the twin's own.
    pub states: Signal,
    /// Inputs behind the actuators.
    pub inputs: Signal,
    /// Outputs without noise.
    pub outputs: Signal,
}

/// A step from one row to the next; matrices row by row.
struct ResponseRow {
    dt: f64,
    step: Derivatives,
    /// C; zero where outputs are missing.
    outputs: Vec<f64>,
    /// K.
    gain: Vec<f64>,
}

/// Derivatives of the state behind a step, one after the other.
struct Derivatives {
    /// By each state: columns of A.
    states: Vec<Vec<f64>>,
    inputs: Vec<Vec<f64>>,
    /// By the logarithm of each parameter, in the order of the free ones; empty for what is no parameter of the twin.
    parameters: Vec<Vec<f64>>,
}

impl Responses {
    /// Number of samples.
    pub fn samples(&self) -> usize {
        self.rows.len()
    }

    /// Hands on what additions at a place change of each prediction: (sample, output, one change a course). `courses` are `count` of them,
    /// sample by sample.
    pub fn of(
        &self,
        entry: Entry,
        (count, courses): (usize, &[f64]),
        mut then: impl FnMut(usize, usize, &[f64]),
    ) {
        let (n, p) = self.size;
        let at = |i: usize| i * count..(i + 1) * count;
        let (mut state, mut next) = (vec![0.0; n * count], vec![0.0; n * count]);
        let mut changes = vec![0.0; p * count];
        for (k, (row, added)) in (self.rows.iter().zip(courses.chunks_exact(count))).enumerate() {
            changes.fill(0.0);
            if let Entry::Sensor(j) = entry {
                changes[at(j)].copy_from_slice(added);
            }
            for j in 0..p {
                for i in 0..n {
                    add(row.outputs[j * n + i], &state[at(i)], &mut changes[at(j)]);
                }
                let sample = k + self.late.get(j).copied().unwrap_or(0);
                if sample < self.samples() {
                    then(sample, j, &changes[at(j)]);
                }
            }
            for i in 0..n {
                for j in 0..p {
                    add(-row.gain[i * p + j], &changes[at(j)], &mut state[at(i)]);
                }
            }
            next.fill(0.0);
            for a in 0..n {
                for i in 0..n {
                    add(row.step.states[i][a], &state[at(i)], &mut next[at(a)]);
                }
                add(row.moved(entry, a), added, &mut next[at(a)]);
            }
            std::mem::swap(&mut state, &mut next);
        }
    }
}

/// Adds so many times one list to another.
#[inline(always)]
fn add(factor: f64, from: &[f64], to: &mut [f64]) {
    if factor != 0.0 {
        for (to, from) in to.iter_mut().zip(from) {
            *to += factor * from;
        }
    }
}

impl ResponseRow {
    /// Change of state a behind the step by an addition of one that is held over it.
    fn moved(&self, entry: Entry, a: usize) -> f64 {
        let of = |column: Option<&Vec<f64>>| column.and_then(|c| c.get(a)).copied().unwrap_or(0.0);
        match entry {
            Entry::State(i) => {
                let stays = if a == i { 1.0 } else { 0.0 };
                0.5 * self.dt * (self.step.states[i][a] + stays)
            }
            Entry::Actuator(i) => of(self.step.inputs.get(i)),
            Entry::Parameter(i) => of(self.step.parameters.get(i)),
            Entry::Sensor(_) => 0.0,
        }
    }
}

impl Kalman<'_> {
    /// The responses of its predictions at θ.
    pub(in crate::likelihood) fn responses(&self, theta: &[f64]) -> Result<Responses, FilterError> {
        let settings = FilterSettings {
            keep_states: true,
            ..self.settings.clone()
        };
        let filtered = Kalman::new(&self.twin, self.record, &settings)?
            .of_cells()
            .filter(theta)?;
        let samples = self.record.samples();
        let means =
            (filtered.states).map_or_else(|| Signal::zeros((samples, self.states)), |s| s.means);
        let late = Order::of(self, theta)?.late().to_vec();
        let acting = self.acting(theta)?;
        let linear = Linearisation {
            kalman: self,
            theta,
            acting: &acting,
            sizes: sizes(&means),
        };
        let mut outputs = Signal::zeros((samples, self.channels));
        let mut inputs = Signal::zeros((samples, acting.at(0).u.len()));
        let row = |k: usize| {
            let now = acting.at(k);
            let mean = means.row(k).to_vec();
            let mut y = vec![0.0; self.channels];
            self.twin.observe(&now, &mean, &mut y);
            let is_there = |j: usize| {
                let sample = k + late.get(j).copied().unwrap_or(0);
                sample < samples && !self.record.outputs()[[sample, j]].is_nan()
            };
            let c = linear.outputs(&now, &mean, is_there);
            (y, c, linear.step(&now, &mean), linear.noise(&now, &mean))
        };
        // Rows that wait for exchanges wait together.
        let linearised: Vec<_> = match self.twin.beside() {
            1 => (0..samples).map(row).collect(),
            _ => each(0..samples, row),
        };
        let mut covariance = linear.start();
        let mut rows = Vec::with_capacity(samples);
        for (k, (y, c, step, (q, r))) in linearised.into_iter().enumerate() {
            let now = acting.at(k);
            for (j, y) in y.iter().enumerate() {
                outputs[[k, j]] = *y;
            }
            for (i, u) in now.u.iter().enumerate() {
                inputs[[k, i]] = *u;
            }
            let gain = gain(&covariance, &c, &r);
            covariance = carried(&covariance, (&c, &gain), &step.matrix(), &q);
            rows.push(ResponseRow {
                dt: now.dt,
                step,
                outputs: c.transpose().as_slice().to_vec(),
                gain: gain.transpose().as_slice().to_vec(),
            });
        }
        Ok(Responses {
            rows,
            size: (self.states, self.channels),
            late,
            states: means,
            inputs,
            outputs,
        })
    }
}

/// Root mean square of each state; zero where it never moves.
fn sizes(states: &Signal) -> Vec<f64> {
    (states.columns().into_iter())
        .map(|x| x.iter().map(|v| v * v).sum::<f64>() / x.len().max(1) as f64)
        .map(f64::sqrt)
        .collect()
}

/// Gain P·Cᵀ·(C·P·Cᵀ + R)⁻¹; zero where nothing is measured.
fn gain(covariance: &DMatrix<f64>, c: &DMatrix<f64>, r: &DVector<f64>) -> DMatrix<f64> {
    let cross = covariance * c.transpose();
    let spread = c * &cross + DMatrix::from_diagonal(r);
    match spread.cholesky() {
        Some(factor) => factor.solve(&cross.transpose()).transpose(),
        None => DMatrix::zeros(covariance.nrows(), c.nrows()),
    }
}

/// Covariance of the next row.
fn carried(
    covariance: &DMatrix<f64>,
    (c, gain): (&DMatrix<f64>, &DMatrix<f64>),
    a: &DMatrix<f64>,
    q: &DVector<f64>,
) -> DMatrix<f64> {
    let kept = covariance - gain * (c * covariance);
    let next = a * (&kept + kept.transpose()) * a.transpose() * 0.5;
    next + DMatrix::from_diagonal(q)
}

/// Derivatives of a twin along its filtered states.
struct Linearisation<'l> {
    kalman: &'l Kalman<'l>,
    theta: &'l [f64],
    acting: &'l Acting<'l>,
    sizes: Vec<f64>,
}

impl Derivatives {
    /// A.
    fn matrix(&self) -> DMatrix<f64> {
        let n = self.states.len();
        DMatrix::from_fn(n, n, |a, i| self.states[i][a])
    }
}

impl Linearisation<'_> {
    fn twin(&self) -> &Composed {
        &self.kalman.twin
    }

    /// Covariance of the first state.
    fn start(&self) -> DMatrix<f64> {
        let n = self.kalman.states;
        let (mut mean, mut covariance) = (vec![0.0; n], vec![0.0; n * n]);
        let now = self.acting.start();
        self.twin().start(&now, &mut mean);
        spread_start(self.twin(), &now, &mut mean, &mut covariance);
        DMatrix::from_vec(n, n, covariance)
    }

    /// Variances of process and measurement noise.
    fn noise(&self, now: &Now<'_>, x: &[f64]) -> (DVector<f64>, DVector<f64>) {
        let mut q = DVector::zeros(self.kalman.states);
        let mut r = DVector::zeros(self.kalman.channels);
        (self.twin()).noise(now, x, q.as_mut_slice(), r.as_mut_slice());
        let floors = &self.kalman.unrounded;
        q.apply(|q| *q *= *q);
        for (r, floor) in r.iter_mut().zip(floors) {
            *r = (*r * *r).max(*floor).max(f64::MIN_POSITIVE);
        }
        (q, r)
    }

    /// The state behind a step, within its limits.
    fn moved(&self, now: &Now<'_>, x: &[f64]) -> Vec<f64> {
        let (mut x, mut work) = (x.to_vec(), self.twin().workspace());
        self.twin().step(now, &mut x, &mut work);
        self.twin().constrain(now, &mut x);
        for (x, limit) in x.iter_mut().zip(&self.kalman.limits) {
            *x = limit.clamp(*x);
        }
        x
    }

    /// Step of a difference in state i.
    fn reach(&self, i: usize) -> f64 {
        STEP * self.sizes[i]
    }

    fn step(&self, now: &Now<'_>, x: &[f64]) -> Derivatives {
        let here = self.moved(now, x);
        let slope = |there: &[f64], other: &[f64], h: f64| -> Vec<f64> {
            let changes = there.iter().zip(other);
            changes.map(|(there, other)| (there - other) / h).collect()
        };
        let of_state = |i: usize| {
            let h = self.reach(i);
            let [above, below] = [h, -h].map(|h| {
                let mut x = x.to_vec();
                x[i] += h;
                self.moved(now, &x)
            });
            match h > 0.0 {
                true => slope(&above, &below, 2.0 * h),
                false => vec![0.0; x.len()],
            }
        };
        let of_input = |i: usize| {
            let mut u = now.u.to_vec();
            let h = STEP * u[i].abs().max(1.0);
            u[i] += h;
            slope(&self.moved(&Now { u: &u, ..*now }, x), &here, h)
        };
        let of_parameter = |i: usize| {
            let mut theta = self.theta.to_vec();
            theta[i] *= STEP.exp();
            let now = &Now {
                theta: &theta,
                ..*now
            };
            slope(&self.moved(now, x), &here, STEP)
        };
        let parameters = self.kalman.parameters.iter().enumerate();
        Derivatives {
            states: (0..x.len()).map(of_state).collect(),
            inputs: (0..now.u.len()).map(of_input).collect(),
            parameters: parameters
                .map(|(i, p)| match p.role {
                    Role::Parameter => of_parameter(i),
                    _ => vec![],
                })
                .collect(),
        }
    }

    /// C, without the rows of outputs that are not there.
    fn outputs(&self, now: &Now<'_>, x: &[f64], is_there: impl Fn(usize) -> bool) -> DMatrix<f64> {
        let (n, p) = (x.len(), self.kalman.channels);
        let mut c = DMatrix::zeros(p, n);
        let mut x = x.to_vec();
        let mut sides = [vec![0.0; p], vec![0.0; p]];
        for i in (0..n).filter(|&i| self.reach(i) > 0.0) {
            let (own, h) = (x[i], self.reach(i));
            for (y, h) in sides.iter_mut().zip([h, -h]) {
                x[i] = own + h;
                self.twin().observe(now, &x, y);
            }
            x[i] = own;
            for j in (0..p).filter(|&j| is_there(j)) {
                c[(j, i)] = (sides[0][j] - sides[1][j]) / (2.0 * h);
            }
        }
        c
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::record::{Drive, Record};
    use crate::twin::{DigitalTwin, Integrator, Noise, Outline, Parameter, StateSpace};

    /// ẋ = k·(u + f − x), y = x + e: f and e are parameters that are off.
    struct ForcedLag;

    impl StateSpace for ForcedLag {
        fn outline(&self) -> Outline {
            Outline::new()
                .parameter(Parameter::new("k", "1/s", 0.2, 2.0))
                .parameter(Parameter::new("f", "-", -1.0, 1.0))
                .parameter(Parameter::new("e", "-", -1.0, 1.0))
                .state("x", "-")
                .input("u", "-")
                .output("y", "-")
        }
        fn drift(&self, now: &Now<'_>, x: &[f64], dx: &mut [f64]) {
            dx[0] = now.theta[0] * (now.u[0] - x[0]) + now.theta[1] * (0.3 * now.t).sin();
        }
        fn observe(&self, now: &Now<'_>, x: &[f64], y: &mut [f64]) {
            y[0] = x[0] + now.theta[2] * (0.3 * now.t).sin();
        }
        fn noise(&self, _: &Now<'_>, _: &[f64], process: &mut [f64], measurement: &mut [f64]) {
            (process[0], measurement[0]) = (0.05, 0.1);
        }
        fn integrator(&self) -> Integrator {
            Integrator::RungeKutta4
        }
    }

    /// Responses of a linear twin are what a filter's predictions change by, to the order of the held step.
    #[test]
    fn responses_are_changes_of_predictions() {
        let inputs = Signal::from_shape_fn((200, 1), |(k, _)| f64::from((k / 40) as u8 % 2));
        let drive = Drive::new(0.1, inputs).unwrap();
        let theta = [0.8, 0.0, 0.0];
        let noise = Noise::new(3, "t", 0);
        let y = DigitalTwin::simulate(&ForcedLag, &theta, &drive, noise).unwrap();
        let record = Record::new(drive.clone(), y).unwrap();
        let settings = FilterSettings::default();
        let kalman = Kalman::new(ForcedLag, &record, &settings).unwrap();
        let innovations = |theta: &[f64]| kalman.filter(theta).unwrap().innovations;
        let own = innovations(&theta);
        let responses = kalman.responses(&theta).unwrap();
        for (entry, size) in [
            (Entry::State(0), [0.01, 0.0]),
            (Entry::Sensor(0), [0.0, 0.01]),
        ] {
            let moved = &own - &innovations(&[theta[0], size[0], size[1]]);
            let course: Vec<f64> = (0..200)
                .map(|k| 0.01 * (0.3 * drive.time(k)).sin())
                .collect();
            let (mut worst, mut largest) = (0.0f64, 0.0f64);
            responses.of(entry, (1, &course), |k, j, change| {
                worst = worst.max((change[0] - moved[[k, j]]).abs());
                largest = largest.max(moved[[k, j]].abs());
            });
            assert!(worst < 0.02 * largest, "{entry:?}: {worst} of {largest}");
        }
    }
}
