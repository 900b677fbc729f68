use crate::math::nearest;
use nalgebra::DVector;
use rand::{SeedableRng, seq::SliceRandom};
use rand_chacha::ChaCha8Rng;

use super::Bounds;

/// `count` points that fill a finite box evenly, in any dimension, from one seed.
///
/// Halton's sequence with each digit permuted at random: coordinate j of point i is
///
/// ```text
/// Σ_k π_jk(digit k of i in base p_j) · p_j^(−k−1),    p_j the j-th prime
/// ```
///
/// Each coordinate is uniform, each pair far more even than independent draws. The first points of a longer set are
/// those of a shorter one.
///
/// Source: Owen, "A randomized Halton algorithm in R", arXiv:1706.02808 (2017).
pub fn space_filling(bounds: &Bounds, count: usize, seed: u64) -> Vec<DVector<f64>> {
    let mut points = vec![DVector::zeros(bounds.dimension()); count];
    for (j, prime) in primes().take(bounds.dimension()).enumerate() {
        // A stream for each coordinate: more coordinates leave the earlier ones as they are.
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        rng.set_stream(j as u64);
        let mut value = vec![0.0; count];
        let mut weight = 1.0 / prime as f64;
        let mut place = 1_usize;
        // Digits beyond the resolution of f64 do not matter.
        while weight > f64::EPSILON {
            let mut digits: Vec<usize> = (0..prime).collect();
            digits.shuffle(&mut rng);
            for (i, value) in value.iter_mut().enumerate() {
                *value += weight * digits[i / place % prime] as f64;
            }
            weight /= prime as f64;
            place = place.saturating_mul(prime);
        }
        let (low, high) = (bounds.lower()[j], bounds.upper()[j]);
        for (point, value) in points.iter_mut().zip(value) {
            point[j] = nearest(low + value * (high - low), low, high);
        }
    }
    points
}

fn primes() -> impl Iterator<Item = usize> {
    (2..).filter(|n| (2..*n).take_while(|d| d * d <= *n).all(|d| n % d != 0))
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::dvector;

    fn unit_cube(dimension: usize) -> Bounds {
        Bounds::new(DVector::zeros(dimension), DVector::repeat(dimension, 1.0)).unwrap()
    }

    #[test]
    fn the_seed_is_a_contract() {
        let points = space_filling(&unit_cube(2), 3, 7);
        let again = space_filling(&unit_cube(3), 5, 7);
        for (a, b) in points.iter().zip(&again) {
            assert_eq!(
                a.as_slice(),
                &b.as_slice()[..2],
                "longer and wider sets begin alike"
            );
        }
        assert_ne!(points, space_filling(&unit_cube(2), 3, 8));
        let pinned = dvector![0.9587611840818977, 0.37057785704124196];
        assert!((&points[0] - pinned).amax() < 1e-15);
    }

    /// Coordinate j of any p_j^k consecutive points falls once into each of p_j^k equal cells.
    #[test]
    fn every_coordinate_is_stratified() {
        let points = space_filling(&unit_cube(3), 125, 1);
        for (j, cells) in [(0, 64), (1, 81), (2, 125)] {
            let mut seen = vec![false; cells];
            points[..cells]
                .iter()
                .for_each(|p| seen[(p[j] * cells as f64) as usize] = true);
            assert!(seen.into_iter().all(|s| s), "coordinate {j}");
        }
    }

    /// The integral of Π 12(x_j − ½)² over five dimensions is 1.
    #[test]
    fn integrals_converge_faster_than_by_independent_draws() {
        let n = 4096;
        let product =
            |p: &DVector<f64>| p.iter().map(|x| 12.0 * (x - 0.5).powi(2)).product::<f64>();
        let mean = space_filling(&unit_cube(5), n, 3)
            .iter()
            .map(product)
            .sum::<f64>()
            / n as f64;
        let independent = (1.8_f64.powi(5) - 1.0).sqrt() / (n as f64).sqrt();
        assert!((mean - 1.0).abs() < independent / 2.0, "{mean}");
    }
}
