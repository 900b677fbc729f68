//! A standard normal number of which only a cell is known: what rounding leaves of a signal.

use super::Known;

/// Nodes and weights of the Gauss–Legendre rule with eight points on [−1, 1], by pairs.
const NODES: [(f64, f64); 4] = [
    (0.183_434_642_495_649_8, 0.362_683_783_378_362),
    (0.525_532_409_916_329, 0.313_706_645_877_887_27),
    (0.796_666_477_413_626_7, 0.222_381_034_453_374_48),
    (0.960_289_856_497_536_3, 0.101_228_536_290_376_26),
];
/// −log of the density, over its maximum in the cell, beyond which nothing counts.
const DEPTH: f64 = 36.0;
/// Most that −log of the density may change over a panel of the rule, which is two standard deviations long at most.
const CHANGE: f64 = 8.0;

impl Known {
    /// That it lies in a cell, by its centre and its width.
    ///
    /// ```text
    /// M_i = ∫ tⁱ·exp(−o·t − t²/2) dt over the cell,  z = ±(o + t)     o: the end nearer to 0, or 0 itself
    /// density M_0·exp(−o²/2)/width,   mean ±(o + M_1/M_0),   variance M_2/M_0 − (M_1/M_0)²
    /// ```
    ///
    /// By quadrature: smooth in both, and exact to 1e-9 also where a cell is narrow, or far out, which differences of the error function
    /// are not.
    pub fn in_cell(centre: f64, width: f64) -> Self {
        let nearer = centre.abs() - 0.5 * width;
        let o = nearer.max(0.0);
        let reach = 2.0 * DEPTH / ((o * o + 2.0 * DEPTH).sqrt() + o);
        let (low, high) = ((nearer - o).max(-reach), (nearer - o + width).min(reach));
        let middle = 0.5 * (low + high);
        let change = o * high + 0.5 * (low * low).max(high * high);
        let panels = (0.5 * (high - low)).max(change / CHANGE).ceil().max(1.0);
        let half = 0.5 * (high - low) / panels;
        let mut moments = [0.0; 3];
        for i in 0..panels as usize {
            let centre = low + (2 * i + 1) as f64 * half;
            for (node, weight) in NODES {
                for t in [centre - node * half, centre + node * half] {
                    let density = weight * (-o * t - 0.5 * t * t).exp();
                    let distance = t - middle;
                    moments[0] += density;
                    moments[1] += density * distance;
                    moments[2] += density * distance * distance;
                }
            }
        }
        let mean = moments[1] / moments[0];
        Self {
            log_density: (moments[0] * half / width).ln() - 0.5 * o * o,
            mean: (o + middle + mean).copysign(centre),
            variance: moments[2] / moments[0] - mean * mean,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn near(found: f64, expected: f64, tolerance: f64) {
        assert!(
            (found - expected).abs() <= tolerance,
            "{found} instead of {expected}"
        );
    }

    /// A narrow cell is a point; one that holds everything says nothing; half a line has known moments.
    #[test]
    fn the_limits_are_exact() {
        for centre in [-3.0, -0.5, 0.0, 1.0, 6.0] {
            let cell = Known::in_cell(centre, 1e-4);
            near(cell.log_density, -0.5 * centre * centre, 1e-7);
            near(cell.mean, centre, 1e-8);
            near(cell.variance, 1e-8 / 12.0, 1e-13);
        }
        let all = Known::in_cell(0.3, 1e3);
        near(
            all.log_density,
            (std::f64::consts::TAU.sqrt() / 1e3).ln(),
            1e-9,
        );
        near(all.mean, 0.0, 1e-9);
        near(all.variance, 1.0, 1e-9);
        let half = Known::in_cell(500.0, 1e3);
        near(half.mean, (2.0 / std::f64::consts::PI).sqrt(), 1e-9);
        near(half.variance, 1.0 - 2.0 / std::f64::consts::PI, 1e-9);
    }

    /// From Φ(3) − Φ(1) and φ(1), φ(3), and far out, where the density is almost that of an exponential law: E(z − 40) = 0.0249688, to
    /// 7 digits from the continued fraction of Mills' ratio.
    #[test]
    fn a_wide_and_a_far_cell_have_their_moments() {
        let (inner, outer) = (0.241_970_724_519_143_37, 0.004_431_848_411_938_007_5);
        let share = 0.998_650_101_968_369_9 - 0.841_344_746_068_542_9;
        let cell = Known::in_cell(2.0, 2.0);
        let mean = (inner - outer) / share;
        near(cell.mean, mean, 1e-9);
        let square = 1.0 + (inner - 3.0 * outer) / share;
        near(cell.variance, square - mean * mean, 1e-9);
        near(
            cell.log_density,
            (share * std::f64::consts::TAU.sqrt() / 2.0).ln(),
            1e-9,
        );
        let farthest = Known::in_cell(1e9, 1e-3);
        near(farthest.mean, 1e9 - 0.5e-3, 1e-6);
        assert!(farthest.log_density.is_finite() && farthest.variance > 0.0);
        let far = Known::in_cell(45.0, 10.0);
        near(far.mean - 40.0, 0.024_968_8, 1e-7);
        let other = Known::in_cell(-45.0, 10.0);
        near(far.mean, -other.mean, 1e-9);
        near(far.variance, other.variance, 1e-12);
    }
}
