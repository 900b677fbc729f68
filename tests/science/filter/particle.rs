//! A bootstrap particle filter: the likelihood without approximation, up to its own scatter.

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use truetwin::record::Record;
use truetwin::twin::{Now, StateSpace};

/// log p(y | θ) with `count` particles, for one output with measurement noise; resampled systematically at each row.
pub fn log_likelihood(
    twin: &dyn StateSpace,
    theta: &[f64],
    record: &Record,
    count: usize,
    seed: u64,
) -> f64 {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let drive = record.drive();
    let n = twin.outline().states.len();
    let limits = twin.limits();
    let (mut q, mut r) = (vec![0.0; n], vec![0.0; 1]);
    let mut now = Now::new(0.0, drive.dt(), drive.input(0), theta);
    let mut start = vec![0.0; n];
    twin.start(&now, &mut start);
    let mut x = start.repeat(count);
    let mut chosen = x.clone();
    let mut weights = vec![0.0; count];
    let mut slope = vec![0.0; n];
    let (mut total, mut y) = (0.0, [0.0]);
    for k in 0..record.samples() {
        (now.t, now.u) = (drive.time(k), drive.input(k));
        q.fill(0.0);
        r.fill(0.0);
        twin.noise(&now, &start, &mut q, &mut r);
        let mut most = f64::NEG_INFINITY;
        for (x, weight) in x.chunks_exact(n).zip(&mut weights) {
            twin.observe(&now, x, &mut y);
            let e = (record.outputs()[[k, 0]] - y[0]) / r[0];
            *weight = -0.5 * e * e;
            most = most.max(*weight);
        }
        let mut sum = 0.0;
        for weight in &mut weights {
            *weight = (*weight - most).exp();
            sum += *weight;
        }
        total +=
            most + (sum / count as f64).ln() - 0.5 * (2.0 * std::f64::consts::PI).ln() - r[0].ln();
        let (mut from, mut reached) = (0, weights[0] / sum);
        let first: f64 = rng.r#gen::<f64>();
        for (i, to) in chosen.chunks_exact_mut(n).enumerate() {
            let at = (i as f64 + first) / count as f64;
            while reached < at && from + 1 < count {
                from += 1;
                reached += weights[from] / sum;
            }
            to.copy_from_slice(&x[from * n..(from + 1) * n]);
            twin.drift(&now, to, &mut slope);
            for ((x, q), slope) in to.iter_mut().zip(&q).zip(&slope) {
                let z: f64 = StandardNormal.sample(&mut rng);
                *x += drive.dt() * slope + q * z;
            }
            twin.constrain(&now, to);
            for (x, limit) in to.iter_mut().zip(&limits) {
                *x = limit.clamp(*x);
            }
        }
        std::mem::swap(&mut x, &mut chosen);
    }
    total
}
