use super::MathError;
use super::convert::to_matrix;
use super::statistics::norm;
use nalgebra::{DMatrix, DVector};
use ndarray::ArrayRef2;

use super::svd::thin_svd;

/// Directions whose variance, relative to the largest of the correlation matrix, is below this are dropped.
const RELATIVE_VARIANCE: f64 = 1e-16;

/// A linear map that gives features unit covariance, estimated from draws.
///
/// From K draws of n features, rows x₁ … x_K, with
///
/// ```text
/// μ = (1/K) Σ x_k,      S = 1/(K − 1) Σ (x_k − μ)(x_k − μ)ᵀ
/// ```
///
/// it holds a matrix W with W S Wᵀ = I, so that s(x) = ‖W (x − μ)‖² is the squared Mahalanobis distance, without a unit.
/// Two forms:
///
/// - [`calibrated`](Self::calibrated): W = Λ^(−1/2) Vᵀ D^(−1), where D holds the standard deviations and V Λ Vᵀ is the
///   correlation matrix, from the singular values of the standardised draws. Units as far apart as 1e-9 and 1e9 do
///   no harm, nor correlations of 1 − 1e-12: nothing is shrunk, because the information sits in the differences of
///   correlated features. What does not vary at all is dropped; W is [`rank`](Self::rank) × n.
/// - [`regularised`](Self::regularised): W = (S + ε I)^(−1/2), symmetric, n × n, as in the paper. Features
///   whose standard deviation is below √ε hardly count.
///
/// A draw that was used for μ and S is nearer to μ than a new one, so test new observations against *other* draws
/// ([`rank_p_value`](super::rank_p_value)), and take K ≥ 16 n. With K ≤ n the map has rank K − 1 and sees only the directions in
/// which the draws happened to differ.
///
/// Source: Lakshminarayanan, Guerrero & Rojas, "Fine-Tuning a Simulation-Driven Estimator", section IV, step 1; Kessy, Lewin
/// & Strimmer, "Optimal whitening and decorrelation" (2018).
#[derive(Debug, Clone, PartialEq)]
pub struct Whitening {
    mean: DVector<f64>,
    matrix: DMatrix<f64>,
    log_determinant: f64,
}

impl Whitening {
    /// Standardised, rank-revealing, nothing added. `samples` is K × n, one draw a row; they are finite and vary.
    pub fn calibrated(samples: &ArrayRef2<f64>) -> Result<Self, MathError> {
        let CentredDraws { mean, centred } = CentredDraws::new(samples)?;
        // A constant feature has the rounding of its mean, at most K·ε of its size, as its standard deviation.
        let rounding = samples.nrows() as f64 * f64::EPSILON;
        let varying = |(feature, column): &(usize, f64)| {
            let largest = samples
                .column(*feature)
                .fold(0.0, |a: f64, v| a.max(v.abs()));
            *column > rounding * largest
        };
        let (kept, deviations): (Vec<usize>, Vec<f64>) = centred
            .column_iter()
            .map(|column| norm(column.as_slice()))
            .enumerate()
            .filter(varying)
            .unzip();
        let mut standardised = centred.select_columns(&kept);
        for (mut column, deviation) in standardised.column_iter_mut().zip(&deviations) {
            column /= *deviation;
        }
        let svd = thin_svd(&standardised).ok_or(MathError::NotFinite)?;
        let threshold = RELATIVE_VARIANCE.sqrt() * svd.values.iter().copied().fold(0.0, f64::max);
        // Centring takes one degree of freedom, whatever the rounding says.
        let rank = svd
            .values
            .iter()
            .take(centred.nrows() - 1)
            .take_while(|&&s| s > threshold)
            .count();
        if rank == 0 {
            return Err(MathError::NoVariance {
                features: mean.len(),
                draws: centred.nrows(),
            });
        }
        let mut matrix = DMatrix::zeros(rank, mean.len());
        for (position, (&feature, deviation)) in kept.iter().zip(&deviations).enumerate() {
            for direction in 0..rank {
                matrix[(direction, feature)] =
                    svd.right[(position, direction)] / (svd.values[direction] * deviation);
            }
        }
        let logs = |values: &[f64]| values.iter().map(|v| 2.0 * v.ln()).sum::<f64>();
        Ok(Self {
            mean,
            matrix,
            log_determinant: logs(&deviations) + logs(&svd.values.as_slice()[..rank]),
        })
    }

    /// The paper's form, S + ε I with ε = `epsilon` > 0 in squared feature units. `samples` is K × n, one draw a row.
    pub fn regularised(samples: &ArrayRef2<f64>, epsilon: f64) -> Result<Self, MathError> {
        let CentredDraws { mean, centred } = CentredDraws::new(samples)?;
        // Rows of zeros change no covariance, and give all n directions where there are fewer draws than features.
        let rows = centred.nrows().max(mean.len());
        let svd = thin_svd(&centred.resize_vertically(rows, 0.0)).ok_or(MathError::NotFinite)?;
        let variances = svd.values.map(|s| s * s + epsilon);
        let scaled = &svd.right * DMatrix::from_diagonal(&variances.map(|v| v.sqrt().recip()));
        Ok(Self {
            mean,
            matrix: scaled * svd.right.transpose(),
            log_determinant: variances.iter().map(|v| v.ln()).sum(),
        })
    }

    /// μ, length n, in feature units.
    pub fn mean(&self) -> &DVector<f64> {
        &self.mean
    }

    /// W, rank × n, in inverse feature units.
    pub fn matrix(&self) -> &DMatrix<f64> {
        &self.matrix
    }

    /// The number of directions kept: the length of a whitened vector, and the degrees of freedom of a distance.
    pub fn rank(&self) -> usize {
        self.matrix.nrows()
    }

    /// ln det S over the kept features and directions; of S + ε I in the regularised form.
    ///
    /// At full rank this is the log-determinant in the Gaussian log-density of the features.
    pub fn log_determinant(&self) -> f64 {
        self.log_determinant
    }

    /// W δ: whitens a difference of features of length n, without taking the mean away.
    pub fn apply(&self, difference: &DVector<f64>) -> DVector<f64> {
        &self.matrix * difference
    }

    /// W J: whitens each column of an n × d Jacobian.
    pub fn apply_columns(&self, jacobian: &DMatrix<f64>) -> DMatrix<f64> {
        &self.matrix * jacobian
    }

    /// W (x − μ).
    pub fn residual(&self, x: &DVector<f64>) -> DVector<f64> {
        &self.matrix * (x - &self.mean)
    }

    /// ‖W (x − μ)‖².
    pub fn squared_distance(&self, x: &DVector<f64>) -> f64 {
        self.residual(x).norm_squared()
    }

    /// [`squared_distance`](Self::squared_distance) of each row of `samples`, B × n.
    pub fn squared_distances(&self, samples: &ArrayRef2<f64>) -> Vec<f64> {
        // One product of matrices: thirty times as fast as a product for each row.
        let mut centred = to_matrix(&samples.t());
        for mut column in centred.column_iter_mut() {
            column -= &self.mean;
        }
        let whitened = &self.matrix * centred;
        whitened.column_iter().map(|w| w.norm_squared()).collect()
    }
}

/// Draws around their mean, divided by √(K − 1), so that `centredᵀ centred` is the covariance.
struct CentredDraws {
    mean: DVector<f64>,
    centred: DMatrix<f64>,
}

impl CentredDraws {
    fn new(samples: &ArrayRef2<f64>) -> Result<Self, MathError> {
        let (draws, features) = samples.dim();
        if draws < 2 {
            return Err(MathError::NoVariance { features, draws });
        }
        if samples.iter().any(|v| !v.is_finite()) {
            return Err(MathError::NotFinite);
        }
        let mut centred = to_matrix(samples);
        let mean = DVector::from_fn(features, |j, _| centred.column(j).mean());
        let scale = ((draws - 1) as f64).sqrt().recip();
        for (mut column, &mean) in centred.column_iter_mut().zip(mean.iter()) {
            column.apply(|x| *x = (*x - mean) * scale);
        }
        Ok(Self { mean, centred })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::{Array2, s};
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use rand_distr::StandardNormal;

    fn gaussian(draws: usize, features: usize, seed: u64) -> Array2<f64> {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        Array2::from_shape_simple_fn((draws, features), || rng.sample(StandardNormal))
    }

    fn covariance(samples: &Array2<f64>) -> DMatrix<f64> {
        let draws = CentredDraws::new(samples).unwrap();
        draws.centred.tr_mul(&draws.centred)
    }

    #[test]
    fn whitened_draws_have_unit_covariance() {
        let samples = gaussian(200, 4, 1).dot(&gaussian(4, 4, 2));
        let whitening = Whitening::calibrated(&samples).unwrap();
        let s = covariance(&samples);
        let unit = whitening.matrix() * &s * whitening.matrix().transpose();
        assert!((unit - DMatrix::identity(4, 4)).amax() < 1e-12);
        assert!((whitening.log_determinant() - s.determinant().ln()).abs() < 1e-10);
        let total: f64 = whitening.squared_distances(&samples).iter().sum();
        assert!((total - 199.0 * 4.0).abs() < 1e-8, "Σ s_k = (K − 1) n");
    }

    /// s is invariant under any invertible linear map of the features: units and correlation do not matter.
    #[test]
    fn distances_do_not_depend_on_units_or_correlation() {
        let samples = gaussian(300, 5, 3);
        let expected = Whitening::calibrated(&samples)
            .unwrap()
            .squared_distances(&samples);
        let mut harsh = samples.clone();
        for j in 1..5 {
            // Correlated to 1 − 5e-13 with the feature before.
            let column = &harsh.slice(s![.., j - 1]) + &(&samples.slice(s![.., j]) * 1e-6);
            harsh.column_mut(j).assign(&column);
        }
        for (j, unit) in [1e-9, 1.0, 1e200, 1e-200, 1e4].into_iter().enumerate() {
            harsh.column_mut(j).mapv_inplace(|v| v * unit);
        }
        let whitening = Whitening::calibrated(&harsh).unwrap();
        assert_eq!(whitening.rank(), 5);
        for (a, b) in whitening.squared_distances(&harsh).iter().zip(&expected) {
            assert!((a - b).abs() < 1e-6 * b.max(1.0), "{a} against {b}");
        }
    }

    #[test]
    fn what_does_not_vary_is_dropped() {
        let mut samples = gaussian(100, 5, 4);
        let sum = &samples.column(0) + &samples.column(1);
        samples.column_mut(2).assign(&sum);
        samples.column_mut(3).fill(0.1);
        samples.column_mut(4).fill(0.0);
        let whitening = Whitening::calibrated(&samples).unwrap();
        assert_eq!((whitening.rank(), whitening.matrix().shape()), (2, (2, 5)));
        assert!(whitening.matrix().columns(3, 2).amax() == 0.0);
        let free = Whitening::calibrated(&samples.slice(s![.., ..2])).unwrap();
        let (a, b) = (
            whitening.squared_distances(&samples),
            free.squared_distances(&samples.slice(s![.., ..2])),
        );
        assert!(a.iter().zip(&b).all(|(a, b)| (a - b).abs() < 1e-9));
        let few = Whitening::calibrated(&gaussian(4, 7, 5)).unwrap();
        assert_eq!(few.rank(), 3, "centring takes a degree of freedom");
    }

    #[test]
    fn the_regularised_form_is_the_inverse_square_root() {
        for draws in [3, 50] {
            let samples = gaussian(draws, 4, 6);
            let s = covariance(&samples) + DMatrix::identity(4, 4) * 0.01;
            let whitening = Whitening::regularised(&samples, 0.01).unwrap();
            let w = whitening.matrix();
            assert!((w - w.transpose()).amax() < 1e-12, "symmetric");
            assert!((w * &s * w - DMatrix::identity(4, 4)).amax() < 1e-11);
            assert!((whitening.log_determinant() - s.determinant().ln()).abs() < 1e-10);
        }
    }

    #[test]
    fn features_without_scatter_are_refused() {
        let mut samples = gaussian(5, 3, 7);
        assert!(Whitening::calibrated(&samples.slice(s![..1, ..])).is_err());
        samples[[3, 2]] = f64::INFINITY;
        assert!(Whitening::calibrated(&samples).is_err());
        let error = Whitening::calibrated(&Array2::ones((5, 3))).unwrap_err();
        assert!(error.to_string().contains("noise on"));
    }
}
