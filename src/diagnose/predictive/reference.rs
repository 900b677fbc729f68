//! The fitted twin with noise as declared, beside which fitted noise is judged.

use super::statistics::{Discrepancy, Look};
use super::{Predictive, looks};
use crate::diagnose::quantify::free_run::mean;
use crate::diagnose::thresholds::THRESHOLDS;
use crate::fit::problem::Problem;
use crate::study::StudyError;
use crate::twin::{Role, Twin};

/// States and outputs whose noise level a twin with equations declares, at the first row and θ of the prior's centre.
pub(in crate::diagnose) fn declared(twin: &Twin, problem: &Problem) -> Vec<String> {
    let drive = problem.records[0].drive();
    let Some(outline) = twin.outline() else {
        return vec![];
    };
    let theta = outline.parameters.centre();
    let Some([process, measurement]) = twin.first_noise(&theta, drive) else {
        return vec![];
    };
    let all = outline.states.iter().chain(&outline.outputs);
    (all.zip(process.iter().chain(&measurement)))
        .filter(|(_, level)| **level > 0.0)
        .map(|(quantity, _)| quantity.name.clone())
        .collect()
}

impl Predictive<'_> {
    /// The fitted full θ with declared levels where they are declared, and without correlated noise; and whether noise is of another kind than
    /// that: a level is beyond its declaration, or there is correlated noise.
    pub(super) fn reference(&self) -> (Vec<f64>, bool) {
        let problem = &self.model.problem;
        let mut theta = self.model.theta();
        let mut is_other = false;
        for (j, p) in problem.twin.parameters().iter().enumerate() {
            let is_declared = self.declared.iter().any(|name| name == p.target());
            if p.role == Role::Noise && is_declared {
                let axis = &problem.axes[j];
                let beyond = (theta[j] / axis.centre).ln() / axis.deviation;
                is_other |= beyond > THRESHOLDS.beyond_declared;
                theta[j] = axis.centre;
            }
        }
        for size in self.correlated() {
            theta[size] = problem.axes[size].bounds.low();
            is_other = true;
        }
        (problem.full(&theta), is_other)
    }

    /// Entries of the sizes of correlated noise.
    pub(super) fn correlated(&self) -> Vec<usize> {
        let all = self.model.problem.twin.disturbances();
        all.iter().map(|(.., size)| *size).collect()
    }

    /// Share of the output's variance that noise beyond the reference puts into predictions as far ahead as windows of the record reach; `None`
    /// where there is none, and in a closed loop, where predictions do not count.
    pub(super) fn noise_share(
        &self,
        statistics: &[Discrepancy],
        simulated: &[Look],
    ) -> Result<Option<f64>, StudyError> {
        let (theta, is_other) = self.reference();
        if !is_other || !self.is_open_loop {
            return Ok(None);
        }
        let Some(at) = statistics.iter().rposition(Discrepancy::is_window) else {
            return Ok(None);
        };
        let replicates = self.replicates(0..THRESHOLDS.check_first, |_| &theta)?;
        let of = &statistics[at..=at];
        let declared = looks(&self.model.problem, &replicates, of)?;
        let squares = |values: &mut dyn Iterator<Item = f64>| {
            let squares: Vec<f64> = values.map(f64::exp).filter(|v| v.is_finite()).collect();
            mean(&squares)
        };
        let fitted = squares(&mut simulated.iter().map(|look| look[at]));
        let declared = squares(&mut declared.iter().map(|look| look[0]));
        Ok(Some((fitted - declared).max(0.0)).filter(|share| share.is_finite()))
    }
}
