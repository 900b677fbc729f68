use nalgebra::{DMatrix, DVector};

use crate::math::{MathError, solve_above, solve_truncated};

/// The step that minimises the linear model ½‖r + J p‖² over `low` ≤ p ≤ `high`, which contains 0.
///
/// An active-set method (Stark & Parker, "Bounded-variable least squares", *Computational Statistics* 10, 1995), each
/// face solved by truncated SVD from where the step stands: parameters that would leave the box stop at its face and the
/// rest is solved again; a parameter on a face is let go when the model falls inwards. The model never rises on the way,
/// so p is a descent direction of ½‖r‖² however many bounds are active; a projected Gauss–Newton step need not be.
///
/// Singular values are cut relative to the largest of the *whole* J on every face: a direction that is too weak to move
/// does not become strong because a stronger parameter is held.
pub(super) fn box_step(
    residual: &DVector<f64>,
    jacobian: &DMatrix<f64>,
    low: &DVector<f64>,
    high: &DVector<f64>,
    relative_cutoff: f64,
) -> Result<DVector<f64>, MathError> {
    let dimension = jacobian.ncols();
    let mut step = DVector::<f64>::zeros(dimension);
    let mut left = residual.clone();
    let mut free = vec![true; dimension];
    let mut may_be_freed = vec![true; dimension];

    let whole = solve_truncated(jacobian, residual, relative_cutoff)?.singular_values;
    let threshold = relative_cutoff * whole.iter().copied().fold(0.0, f64::max);
    let slope = jacobian.tr_mul(residual);
    for j in 0..dimension {
        free[j] = !(low[j] >= 0.0 && slope[j] >= 0.0 || high[j] <= 0.0 && slope[j] <= 0.0);
    }
    // Each round holds a free parameter or lets a held one go, and none is let go twice.
    loop {
        let columns: Vec<usize> = (0..dimension).filter(|&j| free[j]).collect();
        let face = jacobian.select_columns(&columns);
        let change = -solve_above(&face, &left, |_| threshold)?.step;

        let mut length = 1.0;
        let mut blocking = None;
        for (&j, change) in columns.iter().zip(change.iter()) {
            let face = if *change > 0.0 { high[j] } else { low[j] };
            let room = face - step[j];
            if change.abs() * length > room.abs() {
                length = room / change;
                blocking = Some((j, face));
            }
        }
        for (&j, change) in columns.iter().zip(change.iter()) {
            step[j] = (step[j] + length * change).clamp(low[j], high[j]);
        }
        if let Some((j, face)) = blocking {
            step[j] = face;
            free[j] = false;
        }
        left = residual + jacobian * &step;
        if blocking.is_some() {
            continue;
        }

        let slope = jacobian.tr_mul(&left);
        let inwards = |j: usize| {
            if step[j] >= high[j] {
                slope[j]
            } else {
                -slope[j]
            }
        };
        let worth = |j: &usize| inwards(*j) > 1e-12 * jacobian.column(*j).norm() * left.norm();
        let next = (0..dimension)
            .filter(|&j| !free[j] && may_be_freed[j] && low[j] < high[j])
            .filter(worth)
            .max_by(|&a, &b| inwards(a).total_cmp(&inwards(b)));
        let Some(j) = next else { return Ok(step) };
        free[j] = true;
        may_be_freed[j] = false;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::dvector;
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    /// Projected gradient, run for long: slow, and obviously right.
    fn reference(
        r: &DVector<f64>,
        j: &DMatrix<f64>,
        low: &DVector<f64>,
        high: &DVector<f64>,
    ) -> DVector<f64> {
        let rate = 1.0 / j.norm_squared();
        let mut p = DVector::zeros(j.ncols());
        for _ in 0..20_000 {
            let down = &p - j.tr_mul(&(r + j * &p)) * rate;
            p = down.zip_zip_map(low, high, |v, l, h| v.clamp(l, h));
        }
        p
    }

    #[test]
    fn the_model_is_minimised_over_the_box() {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let mut active = 0;
        for _ in 0..60 {
            let j = DMatrix::from_fn(9, 4, |_, _| rng.gen_range(-1.0..1.0));
            let r = DVector::from_fn(9, |_, _| rng.gen_range(-3.0..3.0));
            // A third of the faces go through the start.
            let low = DVector::from_fn(4, |_, _| -rng.gen_range(-0.3_f64..0.6).max(0.0));
            let high = DVector::from_fn(4, |_, _| rng.gen_range(-0.3_f64..0.6).max(0.0));
            let p = box_step(&r, &j, &low, &high, 1e-12).unwrap();
            let expected = reference(&r, &j, &low, &high);
            assert!((&p - expected).amax() < 1e-7);
            active += (0..4)
                .filter(|&i| p[i] == low[i] || p[i] == high[i])
                .count();
        }
        assert!(active > 60, "the faces were tried: {active}");
    }

    /// The strong parameter is held at once; the weak one stays, as it would if the strong one were free.
    #[test]
    fn a_weak_direction_stays_weak_on_a_face() {
        let j = DMatrix::from_diagonal(&dvector![1.0, 1e-9]);
        let p = box_step(
            &dvector![-1.0, -1.0],
            &j,
            &dvector![-1.0, -1.0],
            &dvector![0.0, 1.0],
            1e-6,
        );
        assert_eq!(p.unwrap(), dvector![0.0, 0.0]);
    }
}
