//! A twin with terms, fitted to the records.

use crate::fit::axis::{EvidencePrior, Family};
use crate::fit::climb::{Fitted, climb};
use crate::fit::evidence::{CREDIT, Laplace, laplace};
use crate::fit::problem::Problem;
use crate::fit::reference::Reference;
use crate::hypothesis::limits::SEARCH;
use crate::hypothesis::term::{Term, marks, with_terms};
use crate::likelihood::kalman::FilterError;
use crate::record::Signal;
use crate::twin::Twin;
use std::sync::Arc;

/// A twin with terms, fitted.
#[derive(Clone)]
pub(crate) struct Model {
    /// The twin without terms, its noise levels in θ.
    pub base: Twin,
    pub terms: Vec<Arc<Term>>,
    pub problem: Problem,
    pub fitted: Fitted,
    /// log Z, in nats; BIC in its place where evidence is taken out.
    pub log_evidence: f64,
    /// True where BIC stands in the place of evidence.
    pub by_bic: bool,
}

/// A model with one more term, not yet fitted.
pub(crate) struct Extended {
    pub terms: Vec<Arc<Term>>,
    pub problem: Problem,
    /// Entries of the new term's magnitudes.
    pub entries: Vec<usize>,
    by_bic: bool,
}

impl Model {
    /// The twin alone; `None` where its evidence cannot be told.
    pub fn bare(base: Twin, problem: Problem, fitted: Fitted, by_bic: bool) -> Option<Self> {
        Self::new(base, vec![], problem, fitted, by_bic)
    }

    /// The twin with terms; `None` where its evidence cannot be told.
    fn new(
        base: Twin,
        terms: Vec<Arc<Term>>,
        problem: Problem,
        fitted: Fitted,
        by_bic: bool,
    ) -> Option<Self> {
        let log_evidence = match by_bic {
            true => bic(&problem, &fitted),
            false => laplace(&problem, &fitted, CREDIT)?.0,
        };
        log_evidence.is_finite().then_some(Self {
            base,
            log_evidence: log_evidence + marks(&terms),
            terms,
            problem,
            fitted,
            by_bic,
        })
    }

    /// The same model, carried on to another fit.
    pub fn refitted(&self, fitted: Fitted) -> Option<Self> {
        let (terms, problem) = (self.terms.clone(), self.problem.clone());
        Self::new(self.base.clone(), terms, problem, fitted, self.by_bic)
    }

    /// The problem with another twin in the place of its own, of the same parameters.
    pub fn problem_of(&self, base: &Twin) -> Result<Problem, FilterError> {
        let twin = with_terms(base, self.terms.iter().map(Arc::as_ref))?;
        let axes = self.problem.axes[..twin.parameters().len()].to_vec();
        let mut problem = self.problem.with_twin(twin, axes);
        problem.families.clone_from(&self.problem.families);
        Ok(problem)
    }

    /// θ of the first record.
    pub fn theta(&self) -> Vec<f64> {
        self.problem.of_record(0, &self.fitted.theta)
    }

    /// Filtered states of each record.
    pub fn states(&self) -> Result<Vec<Signal>, FilterError> {
        let all = self.problem.states(&self.fitted.theta)?;
        Ok(all.into_iter().map(|(_, states)| states).collect())
    }

    /// Innovations, and what θ answers; `None` where the filter does not work.
    pub fn reference(&self) -> Result<Option<Reference>, FilterError> {
        Reference::new(&self.problem, &self.fitted.theta)
    }

    /// The model with one more term.
    pub fn extend(&self, term: &Arc<Term>) -> Result<Extended, FilterError> {
        self.extend_by(std::slice::from_ref(term))
    }

    fn extend_by(&self, new: &[Arc<Term>]) -> Result<Extended, FilterError> {
        let terms: Vec<Arc<Term>> = self.terms.iter().chain(new).cloned().collect();
        let twin = with_terms(&self.base, terms.iter().map(Arc::as_ref))?;
        let d = self.problem.twin.parameters().len();
        let mut axes = self.problem.axes[..d].to_vec();
        let mut families = self.problem.families.clone();
        let mut entries = vec![];
        for term in new {
            if let Some(own) = &term.entries {
                for (&j, axis) in own.iter().zip(&term.axes) {
                    axes[j] = axis.clone();
                }
                entries.extend(own);
                continue;
            }
            if let Some((weights, largest)) = &term.family {
                families.push(Family {
                    entries: (axes.len()..).take(weights[0].len()).collect(),
                    weights: weights.clone(),
                    largest: *largest,
                });
            }
            entries.extend(axes.len()..axes.len() + term.axes.len());
            axes.extend(term.axes.iter().cloned());
        }
        let mut problem = self.problem.with_twin(twin, axes);
        problem.families = families;
        Ok(Extended {
            terms,
            problem,
            entries,
            by_bic: self.by_bic,
        })
    }

    /// The model fitted to the end of a climb: a search stops before.
    pub fn carried_on(&self) -> Result<Option<Self>, FilterError> {
        let fitted = climb(&self.problem, &self.fitted.theta, SEARCH.to_the_end)?;
        Ok(fitted.and_then(|fitted| self.refitted(fitted)))
    }

    /// The terms beside another twin of the same parameters, or other records, fitted on from here.
    pub fn beside_twin(&self, base: &Model) -> Result<Option<Model>, FilterError> {
        let extended = base.extend_by(&self.terms)?;
        let start = extended.problem.carried(&self.problem, &self.fitted.theta);
        let fitted = climb(&extended.problem, &start, SEARCH.to_the_end)?;
        Ok(fitted.and_then(|fitted| extended.fitted(base.base.clone(), fitted)))
    }

    /// Full θ of the extended model where the new term has these magnitudes.
    pub fn beside(&self, extended: &Extended, m: &[f64]) -> Vec<f64> {
        self.beside_at(extended, &self.fitted.theta, m)
    }

    /// The same at another full θ of this model.
    pub fn beside_at(&self, extended: &Extended, theta: &[f64], m: &[f64]) -> Vec<f64> {
        let mut theta = extended.problem.carried(&self.problem, theta);
        for (&j, value) in extended.entries.iter().zip(m) {
            theta[j] = extended.problem.axes[j].bounds.clamp(*value);
        }
        theta
    }
}

impl Extended {
    /// Full θ of a new start: θ of the twin from elsewhere, the magnitudes of the new term as they are.
    pub fn from(&self, own: &[f64], mut theta: Vec<f64>) -> Vec<f64> {
        let (d, begun) = (own.len(), theta.clone());
        for r in 0..self.problem.records.len() {
            let mut of_record = self.problem.of_record(r, &theta);
            of_record[..d].copy_from_slice(own);
            self.problem.place(r, &of_record, &mut theta);
        }
        for &j in &self.entries {
            theta[j] = begun[j];
        }
        theta
    }

    /// Slope and information at θ, without a step.
    pub fn at(&self, theta: &[f64]) -> Result<Option<Fitted>, FilterError> {
        climb(&self.problem, theta, 0)
    }

    /// The problem with the priors of coefficients and sizes that an approximation found most probable.
    pub fn with_sizes(&self, found: &Laplace) -> Problem {
        let mut problem = self.problem.clone();
        for &(j, deviation) in &found.sizes {
            if problem.axes[j].evidence == EvidencePrior::Member {
                problem.axes[j].deviation = deviation;
            }
        }
        problem
    }

    /// The fitted model.
    pub fn fitted(self, base: Twin, fitted: Fitted) -> Option<Model> {
        Model::new(base, self.terms, self.problem, fitted, self.by_bic)
    }
}

/// The Bayesian information criterion in nats, the larger the better.
fn bic(problem: &Problem, fitted: &Fitted) -> f64 {
    let fitted_entries = problem.axes.iter().filter(|axis| !axis.held).count();
    let values = (problem.records.iter())
        .map(|r| r.outputs().iter().filter(|y| !y.is_nan()).count())
        .sum::<usize>();
    fitted.log_likelihood - 0.5 * fitted_entries as f64 * (values.max(1) as f64).ln()
}

/// Keys of terms, in their order.
pub(crate) fn keys(terms: &[Arc<Term>]) -> Vec<String> {
    terms.iter().map(|t| t.key()).collect()
}
