//! The cubic spline through a smooth signal that was sampled.

use super::Hold;
use crate::record::Drive;
use ndarray::Array2;

/// Bends of inputs away from the lines between samples.
///
/// For row k and input j, columns 2·j and 2·j + 1 hold h²/6 times the second derivative of the natural cubic spline at row k and at the next row,
/// h the step between them. At a share s of the way, r = 1 − s, the spline is
///
/// ```text
/// r·u(k) + s·u(k+1) + (r³ − r)·bend(k) + (s³ − s)·bend'(k)
/// ```
///
/// Rows at one time are one knot; behind the last row nothing bends. Source: de Boor, *A Practical Guide to Splines* (1978), chapter IV.
#[derive(Debug)]
pub(crate) struct Bends(Option<Array2<f64>>);

impl Bends {
    /// Those of a drive under these rules; none where no input is on a spline.
    pub fn of(drive: &Drive, holds: &[Hold]) -> Self {
        Self(holds.contains(&Hold::Spline).then(|| bends(drive)))
    }

    /// Behind row k; empty where no input is on a spline.
    #[inline]
    pub fn behind(&self, k: usize) -> &[f64] {
        match &self.0 {
            Some(bends) => bends.row(k).to_slice().unwrap_or(&[]),
            None => &[],
        }
    }
}

fn bends(drive: &Drive) -> Array2<f64> {
    let (rows, inputs) = drive.inputs().dim();
    let mut bends = Array2::zeros((rows, 2 * inputs));
    // Rows from which the next one is at another time: an interval each.
    let ways: Vec<usize> = (0..rows.saturating_sub(1))
        .filter(|&k| !drive.is_repeated(k))
        .collect();
    for (j, u) in drive.inputs().columns().into_iter().enumerate() {
        let slope = |k: usize| (u[k + 1] - u[k]) / drive.step(k);
        // Tridiagonal equations for the second derivatives at the knots between two intervals, eliminated downwards.
        let mut knots: Vec<(f64, f64)> = Vec::with_capacity(ways.len());
        let (mut above, mut value) = (0.0, 0.0);
        for pair in ways.windows(2) {
            let [before, after] = [drive.step(pair[0]), drive.step(pair[1])];
            let right = 6.0 * (slope(pair[1]) - slope(pair[0]));
            let pivot = 2.0 * (before + after) - before * above;
            (above, value) = (after / pivot, (right - before * value) / pivot);
            knots.push((above, value));
        }
        let mut later = 0.0;
        for (i, &k) in ways.iter().enumerate().rev() {
            let scale = drive.step(k) * drive.step(k) / 6.0;
            let own = match i.checked_sub(1) {
                Some(knot) => knots[knot].1 - knots[knot].0 * later,
                None => 0.0,
            };
            bends[[k, 2 * j]] = scale * own;
            bends[[k, 2 * j + 1]] = scale * later;
            later = own;
        }
    }
    bends
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::record::Signal;

    /// A sine with nine samples a period, at times that vary and with a replicate: the error is of fourth order in the step, that of a line of
    /// second.
    #[test]
    fn a_smooth_signal_is_followed_between_its_samples() {
        let mut times: Vec<f64> = (0..60).map(|k| k as f64 + 0.2 * (k % 3) as f64).collect();
        times.insert(30, times[30]);
        let of = |t: f64| (0.7 * t).sin();
        let values: Vec<f64> = times.iter().map(|t| of(*t)).collect();
        let drive = Drive::with_times(&times, Signal::from_shape_vec((61, 1), values).unwrap());
        let drive = drive.unwrap();
        let bends = bends(&drive);
        let (mut spline, mut line) = (0.0, 0.0);
        // The ends are straight, where the sine is not.
        for k in (8..52).filter(|&k| !drive.is_repeated(k)) {
            let (s, r) = (0.5f64, 0.5f64);
            let on_line = r * drive.input(k)[0] + s * drive.input(k + 1)[0];
            let bent = (r.powi(3) - r) * bends[[k, 0]] + (s.powi(3) - s) * bends[[k, 1]];
            let truth = of(times[k] + 0.5 * drive.step(k));
            spline = f64::max(spline, (on_line + bent - truth).abs());
            line = f64::max(line, (on_line - truth).abs());
        }
        assert!(line > 0.04 && spline < 0.004, "{line} {spline}");
        assert_eq!(bends[[60, 0]], 0.0);
    }
}
