//! Starts of twins that oscillate: θ at which the linearised twin swings as the records do.
//!
//! ```text
//! y(k) = Σ aᵢ·y(k − i) + Σ bᵢ·u(k − i) + c,  i = 1 … 2n        zᵐ = Σ aᵢ·zᵐ⁻ⁱ,  λ = ln z/Δt
//! distance = min over the twin's eigenvalues μ of |ln(μ/λ)|     λ: the pole of the record that swings longest
//! ```
//!
//! A likelihood has a narrow top at each frequency, and few points drawn over the bounds lie near the right one; the poles of a record are
//! found without any search.

use crate::fit::budget::BUDGET;
use crate::fit::problem::Problem;
use crate::math::ascending;
use crate::record::Record;
use crate::twin::{Acting, Noise, Twin};
use nalgebra::{Complex, DMatrix, DVector};

/// Starts at which the twin swings as the first record does, noise loud; none for a black box, or where nothing swings.
pub(crate) fn spectral_starts(problem: &Problem) -> Vec<Vec<f64>> {
    let record = &problem.records[0];
    let Some(states) = problem.twin.outline().map(|outline| outline.states.len()) else {
        return vec![];
    };
    let outputs = record.outputs().ncols();
    let poles: Vec<Complex<f64>> = (0..outputs)
        .filter_map(|output| swing(record, output, 2 * states))
        .collect();
    if problem.is_simulated() || poles.is_empty() {
        return vec![];
    }
    let (space, noise) = (problem.twin.parameters(), Noise::new(0, "spectral", 0));
    let mut found: Vec<(f64, Vec<f64>)> = (0..BUDGET.spectral_points)
        .filter_map(|i| {
            let noise = noise.sample(i);
            let theta = problem.full(&match i % 2 {
                0 => space.draw_prior(noise),
                _ => space.draw_bounds(noise),
            });
            let theta = problem.begin(&problem.drawn(theta, noise));
            let own = eigenvalues(&problem.twin, &problem.of_record(0, &theta), record)?;
            let distance = |pole: &Complex<f64>| {
                let each = own.iter().map(|value| (value / pole).ln().norm());
                each.fold(f64::INFINITY, f64::min)
            };
            let sum: f64 = poles.iter().map(distance).sum();
            sum.is_finite().then_some((sum, theta))
        })
        .collect();
    ascending(&mut found, |a| a.0);
    found.truncate(BUDGET.spectral_starts);
    found.into_iter().map(|(_, theta)| theta).collect()
}

/// The pole of an output that swings longest, in 1/s.
fn swing(record: &Record, output: usize, order: usize) -> Option<Complex<f64>> {
    let (y, u) = (record.outputs().column(output), record.drive().inputs());
    let columns = order * (1 + u.ncols()) + 1;
    let rows: Vec<usize> = (order..record.samples())
        .filter(|&k| (k - order..=k).all(|i| y[i].is_finite()))
        .collect();
    if rows.len() < 2 * columns {
        return None;
    }
    let phi = DMatrix::from_fn(rows.len(), columns, |row, column| {
        let k = rows[row];
        match (column / order, column % order) {
            (0, i) => y[k - 1 - i],
            (j, i) if j <= u.ncols() => u[[k - 1 - i, j - 1]],
            _ => 1.0,
        }
    });
    let target = DVector::from_iterator(rows.len(), rows.iter().map(|&k| y[k]));
    let mut gram = phi.tr_mul(&phi);
    let ridge = BUDGET.spectral_ridge * gram.trace() / columns as f64;
    (0..columns).for_each(|i| gram[(i, i)] += ridge);
    let a = gram.cholesky()?.solve(&phi.tr_mul(&target));
    let companion = DMatrix::from_fn(order, order, |i, j| match i {
        0 => a[j],
        i if j + 1 == i => 1.0,
        _ => 0.0,
    });
    let dt = record.drive().dt();
    let poles = companion.complex_eigenvalues();
    (poles.iter())
        .filter(|z| z.im > 0.0 && z.im.atan2(z.re) < BUDGET.fastest * std::f64::consts::PI)
        .map(|z| z.ln() / dt)
        .filter(|pole| pole.re.abs() < BUDGET.damped * pole.norm())
        .min_by(|a, b| a.re.abs().total_cmp(&b.re.abs()))
}

/// Eigenvalues of the twin's equations at its start that swing, in 1/s.
fn eigenvalues(twin: &Twin, theta: &[f64], record: &Record) -> Option<Vec<Complex<f64>>> {
    let twin = twin.equations()?;
    let n = twin.outline().states.len();
    let acting = Acting::of(twin, theta, record.drive()).ok()?;
    let now = acting.at(0);
    let (mut x, mut rates) = (vec![0.0; n], vec![0.0; n]);
    twin.run_to_first_row(&acting, &mut twin.workspace(), &mut x);
    twin.drift(&now, &x, &mut rates);
    let mut jacobian = DMatrix::zeros(n, n);
    for j in 0..n {
        let step = 1e-6 * x[j].abs().max(1.0);
        let (mut moved, mut there) = (x.clone(), vec![0.0; n]);
        moved[j] += step;
        twin.drift(&now, &moved, &mut there);
        for i in 0..n {
            jacobian[(i, j)] = (there[i] - rates[i]) / step;
        }
    }
    let finite = jacobian.iter().all(|v| v.is_finite());
    let all = finite.then(|| jacobian.complex_eigenvalues())?;
    Some(all.iter().copied().filter(|value| value.im > 0.0).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::record::{Drive, Signal};

    /// The pole of a damped swing, with a little noise.
    #[test]
    fn a_swing_has_its_pole() {
        let mut source = Noise::new(1, "swing", 0).source("v");
        let y = Signal::from_shape_fn((400, 1), |(k, _)| {
            let t = 0.05 * k as f64;
            (-0.2 * t).exp() * (3.0 * t).sin() + 0.002 * source.normal()
        });
        let record = Record::new(Drive::autonomous(0.05, 400).unwrap(), y).unwrap();
        let pole = swing(&record, 0, 4).unwrap();
        assert!(
            (pole.im - 3.0).abs() < 0.05 && (pole.re + 0.2).abs() < 0.1,
            "{pole}"
        );
    }
}
