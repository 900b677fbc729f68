//! The L-stable method of orders 4 and 3 of Hairer and Wanner for stiff equations, RODAS: *Solving Ordinary Differential Equations II*,
//! section IV.7 and the code of that name.

use super::path::{Path, Stretch};
use nalgebra::{DMatrix, DVectorView, Dyn, LU};

const GAMMA: f64 = 0.25;
const NODES: [f64; 6] = [0.0, 0.386, 0.21, 0.63, 1.0, 1.0];
/// Weights of ∂f/∂t at each stage.
const OF_TIME: [f64; 6] = [0.25, -0.1043, 0.1035, -0.0362, 0.0, 0.0];
/// Weights of earlier increments at which each stage takes its rates.
const STAGES: [&[f64]; 6] = [
    &[],
    &[1.544],
    &[0.9466785280815826, 0.2557011698983284],
    &[3.314825187068521, 2.896124015972201, 0.9986419139977817],
    &[
        1.221224509226641,
        6.019134481288629,
        12.53708332932087,
        -0.687886036105895,
    ],
    &[
        1.221224509226641,
        6.019134481288629,
        12.53708332932087,
        -0.687886036105895,
        1.0,
    ],
];
/// Weights of earlier increments over h in each stage's right side.
const RIGHT: [&[f64]; 6] = [
    &[],
    &[-5.6688],
    &[-2.430093356833875, -0.2063599157091915],
    &[-0.1073529058151375, -9.594562251023355, -20.47028614809616],
    &[
        7.496443313967647,
        -10.24680431464352,
        -33.99990352819905,
        11.7089089320616,
    ],
    &[
        8.083246795921522,
        -7.981132988064893,
        -31.52159432874371,
        16.31930543123136,
        -6.058818238834054,
    ],
];
/// Order of the error that is estimated.
pub(super) const ORDER: f64 = 4.0;
/// Difference for derivatives, as a share of the number: half of its digits.
const HALF_DIGITS: f64 = 1.5e-8;
/// Difference of time, as a share of the step: far below it, and above what rounding leaves of a clock of days.
const OF_STEP: f64 = 1e-5;

/// Buffers of the method.
#[derive(Debug, Clone, Default)]
pub(super) struct Rosenbrock {
    increments: [Vec<f64>; 6],
    stage: Vec<f64>,
    /// Rates where the step begins; their change with time, and those of a stage. Before, the latter two are those one and two differences away.
    rates: [Vec<f64>; 3],
}

impl Rosenbrock {
    /// Carries points of `n` states each over a stretch; `sizes` are usual sizes of the states. `errors` are the
    /// differences between both orders.
    pub fn step(
        &mut self,
        path: &mut Path<'_, '_>,
        of: Stretch,
        (sizes, x): (&[f64], &mut [f64]),
        errors: Option<&mut [f64]>,
    ) {
        let (h, n) = (path.seconds(of), sizes.len());
        for buffer in (self.increments.iter_mut()).chain(&mut self.rates) {
            buffer.resize(x.len(), 0.0);
        }
        self.stage.clear();
        self.stage.extend_from_slice(x);
        path.rates(of, 0.0, x, &mut self.rates[0]);
        let solvers = self.solvers(path, of, (sizes, x));
        let [first, by_time, now] = &mut self.rates;
        // Rates at the begin may be those behind a jump.
        let [after, _] = path.edges(of);
        path.rates(of, after / of.length + OF_STEP, x, by_time);
        path.begin_step_at(x, first);
        for (by_time, first) in by_time.iter_mut().zip(&*first) {
            *by_time = (*by_time - first) / (OF_STEP * h);
        }
        for i in 0..6 {
            let (before, rest) = self.increments.split_at_mut(i);
            let increment = &mut rest[0];
            self.stage.copy_from_slice(x);
            added(&mut self.stage, 1.0, STAGES[i], before);
            if i == 0 {
                now.copy_from_slice(first);
            } else {
                path.rates(of, NODES[i], &self.stage, now);
            }
            for ((increment, now), by_time) in increment.iter_mut().zip(&*now).zip(&*by_time) {
                *increment = now + h * OF_TIME[i] * by_time;
            }
            added(increment, 1.0 / h, RIGHT[i], before);
            for (solver, part) in solvers.iter().zip(increment.chunks_exact_mut(n)) {
                let solved = solver.solve(&DVectorView::from_slice(part, n));
                match solved {
                    Some(solved) => part.copy_from_slice(solved.as_slice()),
                    None => part.fill(f64::NAN),
                }
            }
        }
        if let Some(errors) = errors {
            errors.copy_from_slice(&self.increments[5]);
        }
        for ((x, stage), last) in x.iter_mut().zip(&self.stage).zip(&self.increments[5]) {
            *x = stage + last;
        }
    }

    /// Decompositions of 1/(γh) − ∂f/∂x, one for each point, by differences that all points share, to the side that each moves to: a state at a
    /// jump of its rate leaves it.
    fn solvers(
        &mut self,
        path: &mut Path<'_, '_>,
        of: Stretch,
        (sizes, x): (&[f64], &[f64]),
    ) -> Vec<LU<f64, Dyn, Dyn>> {
        let (h, n) = (path.seconds(of), sizes.len());
        let [first, near, far] = &mut self.rates;
        let stage = &mut self.stage;
        let mut matrices = vec![DMatrix::zeros(n, n); x.len() / n];
        for j in 0..n {
            for at in (0..x.len()).step_by(n) {
                let (value, rate) = (x[at + j], first[at + j]);
                let size = value.abs().max(sizes[j]).max((h * rate).abs());
                let step = HALF_DIGITS * size.max(f64::MIN_POSITIVE.sqrt());
                stage[at + j] += path.side(j, (value, 2.0 * step), rate) * step;
            }
            path.rates(of, 0.0, stage, near);
            // What a difference changes by its own size over the step is stiff, or a jump: a second difference, from the end of the first, has no
            // jump in it.
            let is_steep = (0..x.len()).any(|i| {
                let size = x[i].abs().max(sizes[i % n]);
                h * (near[i] - first[i]).abs() > HALF_DIGITS * size
            });
            let mut is_held = vec![];
            if is_steep {
                let beside = stage.clone();
                for at in (0..x.len()).step_by(n) {
                    stage[at + j] += stage[at + j] - x[at + j];
                }
                path.rates(of, 0.0, stage, far);
                is_held = held(path, of, (n, j), [x, &beside], [first, near, far]);
            }
            for (p, matrix) in matrices.iter_mut().enumerate() {
                let at = p * n;
                let steps = if is_steep { 2.0 } else { 1.0 };
                let difference = (stage[at + j] - x[at + j]) / steps;
                stage[at + j] = x[at + j];
                let (from, to) = match is_steep && !is_held[p] {
                    true => (&near[..], &far[..]),
                    false => (&first[..], &near[..]),
                };
                for i in 0..n {
                    matrix[(i, j)] = (from[at + i] - to[at + i]) / difference;
                }
            }
        }
        let decomposed = matrices.into_iter().map(|mut matrix| {
            for i in 0..n {
                matrix[(i, i)] += 1.0 / (GAMMA * h);
            }
            matrix.lu()
        });
        decomposed.collect()
    }
}

/// Returns which points are held by their state j, of n: its rate at points `beside` pushes back. A jump holds it if it does so until the step's end, as
/// one that moves carries what it holds. `rates` are those at `x`, there, and as far behind.
fn held(
    path: &mut Path<'_, '_>,
    of: Stretch,
    (n, j): (usize, usize),
    [x, beside]: [&[f64]; 2],
    [first, near, far]: [&[f64]; 3],
) -> Vec<bool> {
    let states = || (j..x.len()).step_by(n);
    let mut is_held: Vec<bool> = states()
        .map(|at| near[at] * (beside[at] - x[at]) < 0.0)
        .collect();
    let is_jump = |at: usize| (far[at] - near[at]).abs() < 0.5 * (near[at] - first[at]).abs();
    if (states().zip(&is_held)).any(|(at, is_held)| *is_held && is_jump(at)) {
        let mut late = vec![0.0; x.len()];
        for (points, before) in [(x, first), (beside, near)] {
            path.rates(of, 1.0, points, &mut late);
            for (at, is_held) in states().zip(&mut is_held) {
                *is_held &= !is_jump(at) || late[at] * before[at] >= 0.0;
            }
        }
    }
    is_held
}

/// Adds weighted increments, all times a factor.
fn added(to: &mut [f64], factor: f64, weights: &[f64], increments: &[Vec<f64>]) {
    for (weight, increment) in weights.iter().zip(increments) {
        for (to, increment) in to.iter_mut().zip(increment) {
            *to += factor * weight * increment;
        }
    }
}
