use super::MathError;
use super::nearest;
use nalgebra::{DMatrix, DVector};

/// Where to evaluate a function of θ for its Jacobian, and how to put the values together.
///
/// For each parameter, with step h along its axis,
///
/// ```text
/// central        ∂f/∂θ_j ≈ (f(θ + h) − f(θ − h)) / 2h                        error O(h²)
/// at a bound     ∂f/∂θ_j ≈ ±(−3 f(θ) + 4 f(θ ± h) − f(θ ± 2h)) / 2h          error O(h²)
/// ```
///
/// The one-sided form is taken where θ ± h leaves the bounds, on the side with more room, with h at most half of
/// that room; every point respects the bounds. Two points a parameter, and θ itself once if any is one-sided.
///
/// The stencil evaluates nothing: the caller takes the [`points`](Self::points), runs them in any order on any number of
/// threads, and hands the values back. A random function must use the *same* seeds at all points.
///
/// Choose h relative to each parameter's scale: about 6e-6 of it for a smooth function in f64 (the cube root of the
/// rounding), 0.01 to 0.03 of it for simulators with kinks.
#[derive(Debug, Clone, PartialEq)]
pub struct Stencil {
    points: Vec<Vec<f64>>,
    /// For each parameter, the points that make its column, with their weights.
    columns: Vec<Vec<(usize, f64)>>,
}

impl Stencil {
    /// Around `theta` with one step for each parameter, inside `lower` ≤ θ ≤ `upper` (all of length d, the parameters'
    /// units; bounds may be infinite). [`MathError::Step`] where rounding or the bounds leave a step no room.
    pub fn new(
        theta: &[f64],
        steps: &[f64],
        lower: &[f64],
        upper: &[f64],
    ) -> Result<Self, MathError> {
        let dimension = theta.len();
        let mut stencil = Self {
            points: Vec::with_capacity(2 * dimension + 1),
            columns: Vec::with_capacity(dimension),
        };
        let mut centre = None;
        for (index, (&at, &step)) in theta.iter().zip(steps).enumerate() {
            let (low, high) = (lower[index], upper[index]);
            let no_room = MathError::Step {
                index,
                value: at,
                step,
            };
            if !(at.is_finite() && low <= at && at <= high && step.is_finite() && step > 0.0) {
                return Err(no_room);
            }
            let mut point = |value: f64| {
                let mut point = theta.to_vec();
                point[index] = value;
                stencil.points.push(point);
                stencil.points.len() - 1
            };
            // Divide by the distance between the points as they are after rounding, not by the step asked for.
            let column = if at - step >= low && at + step <= high {
                let (left, right) = (at - step, at + step);
                let weight = 1.0 / (right - left);
                vec![(point(right), weight), (point(left), -weight)]
            } else {
                let (room, sign) = if high - at >= at - low {
                    (high - at, 1.0)
                } else {
                    (at - low, -1.0)
                };
                let near = nearest(at + sign * step.min(room / 2.0), low, high);
                let far = nearest(near + (near - at), low, high);
                let (a, b) = (near - at, far - at);
                if a == 0.0 || a == b {
                    return Err(no_room);
                }
                // The derivative at 0 of the parabola through 0, a and b; for b = 2a the formula above.
                let (near, far) = (point(near), point(far));
                let centre = *centre.get_or_insert_with(|| {
                    stencil.points.push(theta.to_vec());
                    stencil.points.len() - 1
                });
                vec![
                    // No product of two distances: that of small ones is zero.
                    (centre, -(1.0 / a + 1.0 / b)),
                    (near, b / (b - a) / a),
                    (far, -a / (b - a) / b),
                ]
            };
            if column.iter().any(|(_, weight)| !weight.is_finite()) {
                return Err(no_room);
            }
            stencil.columns.push(column);
        }
        Ok(stencil)
    }

    /// The points to evaluate, each of length d.
    pub fn points(&self) -> &[Vec<f64>] {
        &self.points
    }

    /// The Jacobian, outputs × d, from the values at [`points`](Self::points) in their order, all of one length.
    pub fn assemble(&self, values: &[DVector<f64>]) -> DMatrix<f64> {
        let rows = values.first().map_or(0, DVector::len);
        let mut jacobian = DMatrix::zeros(rows, self.columns.len());
        for (mut column, terms) in jacobian.column_iter_mut().zip(&self.columns) {
            for &(point, weight) in terms {
                column.axpy(weight, &values[point], 1.0);
            }
        }
        jacobian
    }

    /// The Jacobian of `f`, one point after the other; the first failure ends it.
    pub fn jacobian<E>(
        &self,
        f: impl FnMut(&[f64]) -> Result<DVector<f64>, E>,
    ) -> Result<DMatrix<f64>, E> {
        let points = self.points.iter().map(Vec::as_slice);
        Ok(self.assemble(&points.map(f).collect::<Result<Vec<_>, E>>()?))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{dmatrix, dvector};

    const FREE: [f64; 2] = [f64::INFINITY; 2];
    const BELOW: [f64; 2] = [f64::NEG_INFINITY; 2];

    fn smooth(p: &[f64]) -> Result<DVector<f64>, MathError> {
        Ok(dvector![p[0].exp() * p[1], p[0].sin(), p[1].powi(3)])
    }

    fn exact(p: &[f64]) -> DMatrix<f64> {
        dmatrix![p[0].exp() * p[1], p[0].exp(); p[0].cos(), 0.0; 0.0, 3.0 * p[1].powi(2)]
    }

    #[test]
    fn a_smooth_function_is_differentiated_to_ten_digits() {
        let at = [0.3, -1.2];
        let stencil = Stencil::new(&at, &[1e-5; 2], &BELOW, &FREE).unwrap();
        assert_eq!(stencil.points().len(), 4);
        assert!((stencil.jacobian(smooth).unwrap() - exact(&at)).amax() < 1e-9);
    }

    /// Both forms are of second order: a step ten times smaller, an error a hundred times smaller.
    #[test]
    fn convergence_is_of_second_order_also_at_a_bound() {
        let at = [0.3, -1.2];
        for lower in [BELOW, at] {
            let error = |h: f64| {
                let stencil = Stencil::new(&at, &[h; 2], &lower, &FREE).unwrap();
                (stencil.jacobian(smooth).unwrap() - exact(&at)).amax()
            };
            let order = (error(1e-2) / error(1e-3)).log10();
            assert!((order - 2.0).abs() < 0.05, "order {order}");
        }
    }

    #[test]
    fn every_point_respects_the_bounds() {
        let (lower, upper) = ([0.0, 0.999], [0.15, 1.0]);
        let at = [0.05, 1.0];
        let stencil = Stencil::new(&at, &[0.1, 0.1], &lower, &upper).unwrap();
        assert_eq!(stencil.points().len(), 5, "θ itself is shared");
        for point in stencil.points() {
            assert!(
                (0..2).all(|j| (lower[j]..=upper[j]).contains(&point[j])),
                "{point:?}"
            );
        }
        let linear = |p: &[f64]| Ok::<_, MathError>(dvector![2.0 * p[0] - 3.0 * p[1]]);
        assert!((stencil.jacobian(linear).unwrap() - dmatrix![2.0, -3.0]).amax() < 1e-9);
    }

    #[test]
    fn a_step_without_room_is_refused() {
        assert!(Stencil::new(&[1.0], &[0.1], &[1.0], &[1.0]).is_err());
        assert!(Stencil::new(&[2.0], &[0.1], &[0.0], &[1.0]).is_err());
        let error = Stencil::new(&[1e9], &[1e-12], &[0.0], &[1e10]).unwrap_err();
        assert!(error.to_string().contains("1e-5 of the parameter's scale"));
    }
}
