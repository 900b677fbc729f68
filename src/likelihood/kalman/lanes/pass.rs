//! One pass over the rows for eight pairs of parameters and record at once.
//!
//! The recursion is that of the scalar pass, for one output. Lanes never branch apart: a column without pivot is zero, a limit
//! that some lane feels is computed in all. No lane changes a bit of another. What needs more (readouts that bend, rounding, outliers) is
//! left to the scalar pass.

use super::super::Kalman;
use super::super::likelihood::LOG_TWO_PI;
use super::super::moments::{BEND, HALF_PER_REACH, REACH};
use super::clip::clip;
use crate::math::{Kernel, LANES, Lanes, Mask};
use crate::twin::{Acting, LanePoints, Now, Workspace};

/// Parameters on a record.
pub(super) struct Job<'j> {
    pub kalman: &'j Kalman<'j>,
    pub theta: &'j [f64],
    /// The record's drive as the twin sees it at θ.
    pub acting: Acting<'j>,
}

/// Innovation and its variance, row by row; 0 and 1 where the output is missing.
pub(super) type Rows = Vec<[Lanes; 2]>;

/// A pass of up to eight jobs over records of the same length, step, gaps and twin; N states, P = (1 + 4·N)·N numbers of points.
pub(super) struct Pass<'p, const N: usize, const P: usize> {
    pub jobs: &'p [Job<'p>],
    pub rows: &'p mut Rows,
}

/// Nodes of the readout at which a sensor that bends its signal shows it; see `update`.
const OUTERMOST: f64 = 2.856_970_013_872_806;

impl<const N: usize, const P: usize> Kernel for Pass<'_, N, P> {
    type Output = Option<Lanes>;

    /// Log-likelihoods, not finite in lanes that failed or need the scalar pass; `None` where all do.
    #[inline(always)]
    fn run(self) -> Option<Lanes> {
        let Self { jobs, rows } = self;
        let first = jobs[0].kalman;
        let twin = first.twin;
        let limits = &first.limits[..N];
        let mut nows = begin(jobs);
        let mut mean = [Lanes::ZERO; N];
        let mut cov = [[Lanes::ZERO; N]; N];
        let mut floor = Lanes::all(first.unrounded[0]);
        for lane in 0..LANES {
            let job = &jobs[if lane < jobs.len() { lane } else { 0 }];
            let (mut m, mut p) = ([0.0; N], vec![0.0; N * N]);
            (job.kalman).start(&nows[lane], &mut m, &mut p, &mut [0.0; N]);
            floor.0[lane] = job.kalman.unrounded[0];
            for i in 0..N {
                mean[i].0[lane] = m[i];
                for j in 0..N {
                    cov[i][j].0[lane] = p[i * N + j];
                }
            }
        }
        let mut root = [[Lanes::ZERO; N]; N];
        let mut points = [Lanes::ZERO; P];
        let mut outputs = [Lanes::ZERO; P];
        let (mut q, mut shifts) = ([Lanes::ZERO; N], [Lanes::ZERO; N]);
        let (mut one, mut shift) = ([0.0; P], [0.0; N]);
        let mut work = Workspace::new(twin);
        let (zero, unit) = (Lanes::ZERO, Lanes::all(1.0));
        let (mut squares, mut logs, mut product) = (zero, zero, unit);
        let mut valid = unit;
        let (samples, mut values) = (first.record.samples(), 0);
        rows.clear();
        for k in 0..samples {
            for (now, job) in nows.iter_mut().zip(jobs) {
                job.acting.go_to(k, now);
            }
            let active = &nows[..jobs.len()];
            let mut r = zero;
            twin.noise_lanes(active, &mut q, &mut r);
            // Row k into the state.
            if first.gaps && first.outputs[k].is_nan() {
                rows.push([zero, unit]);
            } else {
                factor(&mean, &cov, &mut root);
                spread(&mean, &root, &mut points);
                twin.observe_lanes(active, N, &points, &mut outputs, &mut one);
                let mut predicted = outputs[0];
                let mut noise = (r * r).max(floor);
                let mut variance = noise;
                let mut slopes = [zero; N];
                for j in 0..N {
                    let (plus, minus) = (outputs[1 + 2 * j], outputs[2 + 2 * j]);
                    slopes[j] = (plus - minus) * HALF_PER_REACH;
                    let bend = (plus + minus) * 0.5 - outputs[0];
                    predicted += bend * (1.0 / 3.0);
                    let bend = bend * BEND;
                    noise += bend * bend;
                    variance += bend * bend + slopes[j] * slopes[j];
                }
                let sd = variance.sqrt();
                let mut ends = [predicted + sd * OUTERMOST, predicted - sd * OUTERMOST];
                let changed = twin.readout_lanes(active, &mut ends);
                if changed[..jobs.len()].iter().all(|changed| *changed) {
                    return None;
                }
                valid = Mask::of(changed).select(Lanes::all(f64::NAN), valid);
                let mut y = zero;
                for lane in 0..LANES {
                    let job = &jobs[if lane < jobs.len() { lane } else { 0 }];
                    y.0[lane] = job.kalman.outputs[k];
                }
                let e = y - predicted;
                rows.push([e, variance]);
                let per_variance = variance.recip();
                let good = (zero.below(variance)).and(variance.below(Lanes::all(f64::INFINITY)));
                valid = good.select(valid, Lanes::all(f64::NAN));
                values += 1;
                squares += e * e * per_variance;
                let next = product * variance;
                let inside = (Lanes::all(1e-250).below(next)).and(next.below(Lanes::all(1e250)));
                if inside.not().any() {
                    logs += inside.select(zero, product.ln() + variance.ln());
                }
                product = inside.select(next, unit);
                let mut gain = [zero; N];
                for j in 0..N {
                    for i in 0..N {
                        gain[i] += root[j][i] * slopes[j];
                    }
                }
                for i in 0..N {
                    gain[i] = gain[i] * per_variance;
                    mean[i] += gain[i] * e;
                }
                let mut rest = root;
                for j in 0..N {
                    for i in 0..N {
                        rest[j][i] = rest[j][i] - gain[i] * slopes[j];
                    }
                }
                for i in 0..N {
                    let share = gain[i] * noise;
                    for j in 0..=i {
                        let mut entry = zero;
                        for d in &rest {
                            entry += d[i] * d[j];
                        }
                        entry += share * gain[j];
                        (cov[i][j], cov[j][i]) = (entry, entry);
                    }
                }
            }
            if k + 1 == samples {
                break;
            }
            // The state to row k + 1.
            factor(&mean, &cov, &mut root);
            spread(&mean, &root, &mut points);
            for i in 0..N {
                shifts[i] = q[i] * REACH;
            }
            let lanes = LanePoints {
                all: &mut points,
                limits,
                shifts: &shifts,
                one: &mut one,
                shift: &mut shift,
            };
            let bent = Mask::of(twin.advance_lanes(active, lanes, &mut work));
            let (centre, images) = points.split_at_mut(N);
            for i in 0..N {
                mean[i] = centre[i];
                for j in 0..N {
                    cov[i][j] = zero;
                }
            }
            let (images, noises) = images.split_at_mut(2 * N * N);
            differences(images, centre, &mut mean);
            add_outer(images, &mut cov);
            if bent.any() {
                for i in 0..N {
                    // A state without noise has no shifted points.
                    let moved = bent.and((q[i].below(zero)).or(zero.below(q[i])));
                    if !moved.any() {
                        cov[i][i] += q[i] * q[i];
                        continue;
                    }
                    let pair = &mut noises[2 * i * N..2 * (i + 1) * N];
                    noise_differences(pair, centre, (i, q[i]), moved, &mut mean);
                    add_outer(pair, &mut cov);
                }
            } else {
                for i in 0..N {
                    cov[i][i] += q[i] * q[i];
                }
            }
            clip(&mut mean, &mut cov, limits);
        }
        let sum = squares + (logs + product.ln()) + values as f64 * LOG_TWO_PI;
        Some(sum * -0.5 * valid)
    }
}

/// The twin's view of each job's first row; lanes without a job repeat the first.
fn begin<'j>(jobs: &'j [Job<'j>]) -> [Now<'j>; LANES] {
    std::array::from_fn(|lane| {
        let job = &jobs[if lane < jobs.len() { lane } else { 0 }];
        job.acting.at(0, job.theta)
    })
}

/// Columns of Cholesky's root; those without pivot are zero.
#[inline(always)]
fn factor<const N: usize>(mean: &[Lanes; N], cov: &[[Lanes; N]; N], root: &mut [[Lanes; N]; N]) {
    let (zero, unit) = (Lanes::ZERO, Lanes::all(1.0));
    for j in 0..N {
        let mut pivot = cov[j][j];
        for k in 0..j {
            pivot = pivot - root[k][j] * root[k][j];
        }
        let least = cov[j][j] * 1e-15 + mean[j] * mean[j] * 1e-28;
        let counts = least.below(pivot);
        let sd = counts.select(pivot, unit).sqrt();
        let per_sd = counts.select(sd.recip(), zero);
        for i in 0..j {
            root[j][i] = zero;
        }
        root[j][j] = counts.select(sd, zero);
        for i in j + 1..N {
            let mut entry = cov[i][j];
            for k in 0..j {
                entry = entry - root[k][i] * root[k][j];
            }
            root[j][i] = entry * per_sd;
        }
    }
}

/// The mean, then two points on each column of the root.
#[inline(always)]
fn spread<const N: usize>(mean: &[Lanes; N], root: &[[Lanes; N]; N], points: &mut [Lanes]) {
    points[..N].copy_from_slice(mean);
    for j in 0..N {
        let pair = &mut points[(1 + 2 * j) * N..(3 + 2 * j) * N];
        for i in 0..N {
            let away = root[j][i] * REACH;
            (pair[i], pair[N + i]) = (mean[i] + away, mean[i] - away);
        }
    }
}

/// Makes slopes and bends of the images of two points, and adds to the mean what the bends do to it.
#[inline(always)]
fn differences<const N: usize>(images: &mut [Lanes], centre: &[Lanes], mean: &mut [Lanes; N]) {
    for pair in images.chunks_exact_mut(2 * N) {
        for i in 0..N {
            let (plus, minus) = (pair[i], pair[N + i]);
            let bend = (plus + minus) * 0.5 - centre[i];
            mean[i] += bend * (1.0 / 3.0);
            (pair[i], pair[N + i]) = ((plus - minus) * HALF_PER_REACH, bend * BEND);
        }
    }
}

/// The same of the images of noise of state i, q, in the lanes where a constraint bent them; straight in the others.
#[inline(always)]
fn noise_differences<const N: usize>(
    pair: &mut [Lanes],
    centre: &[Lanes],
    (i, q): (usize, Lanes),
    bent: Mask,
    mean: &mut [Lanes; N],
) {
    for j in 0..N {
        let (plus, minus) = (pair[j], pair[N + j]);
        let bend = bent.select((plus + minus) * 0.5 - centre[j], Lanes::ZERO);
        mean[j] += bend * (1.0 / 3.0);
        let straight = if i == j { q } else { Lanes::ZERO };
        pair[j] = bent.select((plus - minus) * HALF_PER_REACH, straight);
        pair[N + j] = bend * BEND;
    }
}

/// Adds Σ D Dᵀ, both triangles.
#[inline(always)]
fn add_outer<const N: usize>(deviations: &[Lanes], sum: &mut [[Lanes; N]; N]) {
    for i in 0..N {
        for j in 0..=i {
            let mut entry = sum[i][j];
            for d in deviations.chunks_exact(N) {
                entry += d[i] * d[j];
            }
            (sum[i][j], sum[j][i]) = (entry, entry);
        }
    }
}
