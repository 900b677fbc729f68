use nalgebra::DVector;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::{Bounds, GaussNewton, Minimum, OptimiseError, ResidualProblem, space_filling};

/// Settings of a Gauss–Newton search from several starts, for problems with several wells.
///
/// The caller's starts come first, then `extra` points that fill the bounds evenly ([`space_filling`]). Searches run on
/// rayon's threads; the result does not depend on how many there are. A start without a value costs only itself.
///
/// | setting | default | range | meaning |
/// |---|---|---|---|
/// | `extra` | 8 | ≥ 0 | starts besides those that are given; they need finite bounds |
/// | `seed` | 0 | any | of the extra starts |
/// | `gauss_newton` | [`GaussNewton`] | | of each search |
///
/// # Example
///
/// ```
/// use nalgebra::{DMatrix, DVector, dmatrix, dvector};
/// use truetwin::optimise::{Bounds, EvaluationError, MultiStart, ResidualProblem};
///
/// /// Wells near −2 and 2, the right one deeper.
/// struct TwoWells;
/// impl ResidualProblem for TwoWells {
///     fn dimension(&self) -> usize {
///         1
///     }
///     fn residual(&self, x: &DVector<f64>) -> Result<DVector<f64>, EvaluationError> {
///         Ok(dvector![x[0] * x[0] - 4.0, 0.3 * (x[0] - 2.0)])
///     }
///     fn jacobian(&self, x: &DVector<f64>) -> Result<DMatrix<f64>, EvaluationError> {
///         Ok(dmatrix![2.0 * x[0]; 0.3])
///     }
/// }
///
/// let bounds = Bounds::new(dvector![-5.0], dvector![5.0])?;
/// let given = [dvector![-3.0]];
/// let survey = MultiStart::default().minimise(&TwoWells, &given, &bounds, &dvector![1.0], |m| m.cost)?;
/// assert!((survey.best().minimum.theta[0] - 2.0).abs() < 1e-6);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct MultiStart {
    /// Starts besides those that are given.
    pub extra: usize,
    /// Of the extra starts.
    pub seed: u64,
    /// Of each search.
    pub gauss_newton: GaussNewton,
}

impl Default for MultiStart {
    fn default() -> Self {
        Self {
            extra: 8,
            seed: 0,
            gauss_newton: GaussNewton::default(),
        }
    }
}

impl MultiStart {
    /// Searches from every start and sorts what was found by `score`, the least first; equal scores by their start, NaN
    /// last. Bounds and scale as in [`GaussNewton::minimise`].
    ///
    /// # Errors
    ///
    /// [`OptimiseError`]: input that does not fit, a fatal evaluation, no start at all, or none with a value.
    pub fn minimise<P: ResidualProblem + Sync + ?Sized>(
        &self,
        problem: &P,
        given: &[DVector<f64>],
        bounds: &Bounds,
        scale: &DVector<f64>,
        score: impl Fn(&Minimum) -> f64 + Sync,
    ) -> Result<Survey, OptimiseError> {
        let mut starts = given.to_vec();
        if self.extra > 0 {
            starts.extend(space_filling(bounds, self.extra, self.seed)?);
        }
        let count = starts.len() as f64;
        OptimiseError::check_setting("starts", count, count > 0.0, "give one, or set extra")?;
        let search = |(start, theta): (usize, &DVector<f64>)| {
            let minimum = self.gauss_newton.minimise(problem, theta, bounds, scale)?;
            let score = score(&minimum);
            Ok(Candidate {
                start,
                score: if score.is_nan() { f64::INFINITY } else { score },
                minimum,
            })
        };
        // Collected whole and in order: which error is seen first must not depend on the threads.
        let results: Vec<_> = starts.par_iter().enumerate().map(search).collect();
        let mut candidates = Vec::with_capacity(results.len());
        let mut first = None;
        for result in results {
            match result {
                Ok(candidate) => candidates.push(candidate),
                Err(error @ OptimiseError::Start(_)) => {
                    first.get_or_insert(error);
                }
                Err(error) => return Err(error),
            }
        }
        candidates.sort_by(|a, b| a.score.total_cmp(&b.score));
        match first {
            Some(first) if candidates.is_empty() => Err(OptimiseError::AllStarts {
                count: starts.len(),
                first: Box::new(first),
            }),
            _ => Ok(Survey {
                failures: starts.len() - candidates.len(),
                candidates,
            }),
        }
    }
}

/// What was found from one start.
#[derive(Debug, Clone, PartialEq)]
pub struct Candidate {
    /// Which start: the given ones first.
    pub start: usize,
    /// The caller's score; ∞ where it was NaN.
    pub score: f64,
    /// Where the search ended.
    pub minimum: Minimum,
}

/// What was found from all starts: at least one candidate.
#[derive(Debug, Clone, PartialEq)]
pub struct Survey {
    candidates: Vec<Candidate>,
    failures: usize,
}

impl Survey {
    /// The candidate with the least score.
    pub fn best(&self) -> &Candidate {
        &self.candidates[0]
    }

    /// All candidates, the least score first.
    pub fn candidates(&self) -> &[Candidate] {
        &self.candidates
    }

    /// All candidates, the least score first.
    pub fn into_candidates(self) -> Vec<Candidate> {
        self.candidates
    }

    /// How many starts had no value.
    pub fn failures(&self) -> usize {
        self.failures
    }

    /// Calls of the residual over all searches that succeeded.
    pub fn evaluations(&self) -> u64 {
        self.candidates.iter().map(|c| c.minimum.evaluations).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::optimise::EvaluationError;
    use nalgebra::{DMatrix, dmatrix, dvector};

    /// Wells near −2 and 2, the right one deeper; nothing beyond ±`edge`.
    struct TwoWells {
        edge: f64,
        fatal: bool,
    }

    impl ResidualProblem for TwoWells {
        fn dimension(&self) -> usize {
            1
        }
        fn residual(&self, x: &DVector<f64>) -> Result<DVector<f64>, EvaluationError> {
            if x[0].abs() <= self.edge {
                return Ok(dvector![x[0] * x[0] - 4.0, 0.3 * (x[0] - 2.0)]);
            }
            let cause = format!("diverged at {}", x[0]);
            Err(if self.fatal {
                EvaluationError::fatal(cause)
            } else {
                EvaluationError::rejected(cause)
            })
        }
        fn jacobian(&self, x: &DVector<f64>) -> Result<DMatrix<f64>, EvaluationError> {
            Ok(dmatrix![2.0 * x[0]; 0.3])
        }
    }

    fn survey(
        problem: &TwoWells,
        given: &[DVector<f64>],
        extra: usize,
    ) -> Result<Survey, OptimiseError> {
        let bounds = Bounds::new(dvector![-5.0], dvector![5.0]).unwrap();
        let settings = MultiStart {
            extra,
            seed: 1,
            ..MultiStart::default()
        };
        settings.minimise(problem, given, &bounds, &dvector![1.0], |m| m.cost)
    }

    const WHOLE: TwoWells = TwoWells {
        edge: 9.0,
        fatal: false,
    };

    #[test]
    fn the_deeper_well_is_found_from_the_wrong_side() {
        let given = [dvector![-4.0]];
        let alone = survey(&WHOLE, &given, 0).unwrap();
        assert!(alone.best().minimum.theta[0] < -1.0, "one start is stuck");
        let all = survey(&WHOLE, &given, 6).unwrap();
        assert!((all.best().minimum.theta[0] - 2.0).abs() < 1e-6);
        assert_eq!((all.candidates().len(), all.failures()), (7, 0));
        assert!(all.candidates().is_sorted_by(|a, b| a.score <= b.score));
        assert!(all.evaluations() > alone.evaluations());
    }

    #[test]
    fn the_number_of_threads_changes_nothing() {
        let on = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new()
                .num_threads(threads)
                .build()
                .unwrap();
            pool.install(|| survey(&WHOLE, &[dvector![0.5]], 12).unwrap())
        };
        assert_eq!(on(1), on(4));
    }

    #[test]
    fn equal_scores_keep_the_order_of_their_starts() {
        let given = [dvector![1.0], dvector![-4.0], dvector![1.0]];
        let bounds = Bounds::unbounded(1);
        let settings = MultiStart {
            extra: 0,
            ..MultiStart::default()
        };
        let constant = settings
            .minimise(&WHOLE, &given, &bounds, &dvector![1.0], |_| 7.0)
            .unwrap();
        assert_eq!(
            constant
                .candidates()
                .iter()
                .map(|c| c.start)
                .collect::<Vec<_>>(),
            [0, 1, 2]
        );
        let undefined = |m: &Minimum| if m.theta[0] > 0.0 { f64::NAN } else { 1.0 };
        let last = settings
            .minimise(&WHOLE, &given, &bounds, &dvector![1.0], undefined)
            .unwrap();
        assert_eq!(last.best().start, 1);
    }

    #[test]
    fn failed_starts_cost_only_themselves() {
        let narrow = TwoWells {
            edge: 3.0,
            fatal: false,
        };
        let given = [dvector![4.5], dvector![2.5]];
        let some = survey(&narrow, &given, 0).unwrap();
        assert_eq!((some.failures(), some.best().start), (1, 1));
        let error = survey(&narrow, &given[..1], 0).unwrap_err();
        assert!(error.to_string().starts_with("all 1 starts failed"));
        assert!(error.to_string().contains("diverged at 4.5"));
        let fatal = TwoWells {
            edge: 3.0,
            fatal: true,
        };
        assert!(matches!(
            survey(&fatal, &given, 0),
            Err(OptimiseError::Fatal(_))
        ));
        assert!(
            survey(&WHOLE, &[], 0)
                .unwrap_err()
                .to_string()
                .contains("give one")
        );
    }
}
