//! Simulations compressed to features: banks for training, clouds around an estimate, nulls for tests.
//!
//! | to … | look at |
//! |---|---|
//! | simulate a twin and take features | [`FeatureSimulator`] |
//! | make many rows, each a pure function of its number | [`FeatureSimulator::draws`], [`Draws`] |
//! | simulate from a study's prior | [`Prior`] |
//! | train on more rows than fit into memory | [`Bank`] |
//! | exchange rows with NumPy and spreadsheets | [`file`] |

pub mod file;
mod npy;
mod simulator;

pub use simulator::FeatureSimulator;

use crate::estimator::error::EstimatorError;
use crate::feature::FeatureRecipe;
use crate::progress::Stage;
use crate::record::Drive;
use crate::study::{DriveSource, Study, StudyError};
use crate::twin::{Noise, ParameterSpace};
use ndarray::{Array2, s};
use std::borrow::Cow;
use std::ops::Range;

/// Where to simulate: θ, and time grid with inputs.
pub type Draw<'a> = (Vec<f64>, Cow<'a, Drive>);

/// Parameters and the features simulated there, row by row.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Draws {
    /// Parameters, M × d.
    pub theta: Array2<f64>,
    /// Features, M × n.
    pub features: Array2<f64>,
    /// Draws that were out of bounds, diverged or had no features, and were drawn again.
    pub redrawn: usize,
}

impl Draws {
    /// `rows` rows of d parameters and n features, all zero.
    fn zeros(rows: usize, d: usize, n: usize) -> Self {
        Self {
            theta: Array2::zeros((rows, d)),
            features: Array2::zeros((rows, n)),
            redrawn: 0,
        }
    }

    /// The rows of several parts, one after another, `rows` of them at most; parts beyond these are not asked for. `odd` is the
    /// error of a part whose rows have another width than those of the first.
    pub(crate) fn stacked<'a, E>(
        rows: usize,
        parts: impl IntoIterator<Item = Result<Cow<'a, Self>, E>>,
        odd: impl Fn(usize) -> E,
    ) -> Result<Self, E> {
        let (mut all, mut filled): (Option<Self>, _) = (None, 0);
        for (index, part) in parts.into_iter().enumerate() {
            let part = part?;
            let (d, n) = (part.theta.ncols(), part.features.ncols());
            let all = all.get_or_insert_with(|| Self::zeros(rows, d, n));
            if (all.theta.ncols(), all.features.ncols()) != (d, n) {
                return Err(odd(index));
            }
            let to = rows.min(filled + part.theta.nrows());
            let (place, taken) = (s![filled..to, ..], s![..to - filled, ..]);
            (all.theta.slice_mut(place)).assign(&part.theta.slice(taken));
            (all.features.slice_mut(place)).assign(&part.features.slice(taken));
            all.redrawn += part.redrawn;
            filled = to;
            if filled == rows {
                break;
            }
        }
        let mut all = all.unwrap_or_default();
        all.theta = all.theta.slice_move(s![..filled, ..]);
        all.features = all.features.slice_move(s![..filled, ..]);
        Ok(all)
    }
}

/// Simulations that need not fit into memory at once: rows of parameters and features, in parts.
///
/// Rows are independent draws, so that any set of parts is a sample of the whole.
pub trait Bank: Sync {
    /// Rows of each part, in order.
    fn parts(&self) -> Vec<usize>;

    /// Part number `index`.
    fn part(&self, index: usize) -> Result<Cow<'_, Draws>, EstimatorError>;

    /// All rows.
    fn rows(&self) -> usize {
        self.parts().iter().sum()
    }
}

/// A bank in memory: one part.
impl Bank for Draws {
    fn parts(&self) -> Vec<usize> {
        vec![self.theta.nrows()]
    }

    fn part(&self, _: usize) -> Result<Cow<'_, Draws>, EstimatorError> {
        Ok(Cow::Borrowed(self))
    }
}

/// Draws from a study's prior: θ uniform in the prior, each with noise and, where the study draws inputs, an input of its own.
///
/// Source: Lakshminarayanan, Guerrero & Rojas, section III.
pub struct Prior {
    simulator: FeatureSimulator,
    space: ParameterSpace,
    drives: DriveSource,
}

debug_by_name!(Prior);

impl Prior {
    /// Creates the prior of a study, seen through features.
    pub fn new(study: &Study, features: &dyn FeatureRecipe) -> Result<Self, EstimatorError> {
        study.check_estimated()?;
        Ok(Self {
            simulator: FeatureSimulator::new(study.twin().clone(), features)?,
            space: study.twin().parameters(),
            drives: study.drives()?,
        })
    }

    /// Number of features.
    pub fn dim(&self) -> usize {
        self.simulator.dim()
    }

    /// Rows `rows` of what `purpose` names: row i depends on (seed, purpose, i) alone.
    pub fn rows(
        &self,
        rows: Range<u64>,
        seed: u64,
        purpose: &str,
        stage: &Stage,
    ) -> Result<Draws, EstimatorError> {
        self.simulator.draws(
            rows,
            |i| Noise::new(seed, purpose, i),
            |_, _, noise| {
                let drive = self.drives.draw(noise).map_err(StudyError::from)?;
                Ok(Some((self.space.draw_prior(noise), Cow::Owned(drive))))
            },
            stage,
        )
    }
}
