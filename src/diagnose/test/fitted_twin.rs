//! A fitted twin with its dictionary of effects.

use crate::diagnose::error::DiagnoseError;
use crate::diagnose::hypotheses::candidate::{Addition, Candidate};
use crate::diagnose::hypotheses::dictionary::Dictionary;
use crate::diagnose::hypotheses::scales::Scales;
use crate::diagnose::residuals::cut::Bins;
use crate::fit::climb::Fitted;
use crate::fit::problem::Problem;
use crate::fit::reference::Reference;
use crate::record::{Record, Signal};
use crate::twin::Twin;
use std::sync::Arc;

/// A fitted twin, its dictionary of effects and the cuts of its records.
pub(in crate::diagnose) struct FittedTwin<'a> {
    pub problem: Problem<'a>,
    pub fitted: Fitted,
    pub dictionary: Arc<Dictionary>,
    pub bins: Bins,
}

impl<'a> FittedTwin<'a> {
    /// θ of the first record.
    pub fn theta(&self) -> Vec<f64> {
        self.problem.of_record(0, &self.fitted.theta)
    }

    /// Builds the dictionary of effects around a fit; `None` where the twin cannot be filtered there.
    pub fn new(
        twin: &Twin,
        problem: Problem<'a>,
        fitted: Fitted,
        additions: &[Addition],
        candidates: Vec<Candidate>,
    ) -> Result<Option<Self>, DiagnoseError> {
        let states = problem.states(&fitted.theta)?;
        let bins = Bins::new(&problem.outline(), &states, problem.records);
        let Some(reference) = Reference::new(&problem, &fitted.theta)? else {
            return Ok(None);
        };
        let means: Vec<Signal> = states.into_iter().map(|(_, s)| s).collect();
        let scales = Scales {
            records: problem.records,
            states: &means,
        };
        let dictionary = Dictionary::new(
            twin,
            additions,
            candidates,
            &problem,
            &fitted.theta,
            &reference,
            &scales,
        )?;
        Ok(Some(Self {
            problem,
            fitted,
            dictionary: Arc::new(dictionary),
            bins,
        }))
    }

    /// The same candidates beside another fit of the same twin.
    pub fn with_problem<R>(
        &self,
        problem: Problem<'a>,
        fitted: Fitted,
        f: impl FnOnce(&FittedTwin<'a>) -> R,
    ) -> R {
        f(&Self {
            problem,
            fitted,
            dictionary: self.dictionary.clone(),
            bins: self.bins.clone(),
        })
    }

    /// The fitted twin's twin on other records, the first of which are its own, and θ to start a fit from.
    pub fn on<'b>(&self, records: &'b [Record]) -> (Problem<'b>, Vec<f64>) {
        let problem = self.problem.on(records);
        let start = problem.carried(&self.problem, &self.fitted.theta);
        (problem, start)
    }
}
