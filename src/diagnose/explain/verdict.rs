//! Rules for the kind of gap.

use crate::diagnose::error::DiagnoseError;
use crate::diagnose::explain::attribute::{Explanation, explanations};
use crate::diagnose::outcome::Verdict;
use crate::diagnose::test::fitted_twin::FittedTwin;
use crate::diagnose::test::statistics::Statistics;
use crate::diagnose::thresholds::Thresholds;
use crate::fit::axis::Axis;
use crate::fit::climb::{Fitted, fit};
use crate::fit::problem::Problem;
use crate::progress::Stage;
use crate::twin::Role;
use statrs::distribution::{ChiSquared, ContinuousCDF};

/// The rule: structural where the test says so, otherwise by whether θ left its prior significantly.
pub(in crate::diagnose) fn verdict(p_value: f64, outside: bool, alpha: f64) -> Verdict {
    if p_value < alpha {
        Verdict::StructuralGap
    } else if outside {
        Verdict::ParameterGap
    } else {
        Verdict::NoGap
    }
}

/// The problem with the twin's own parameters held within their prior box.
pub(in crate::diagnose) fn inside<'a>(problem: &Problem<'a>) -> Problem<'a> {
    let space = problem.twin.parameters();
    let axes = (space.iter().zip(&problem.axes))
        .map(|(p, axis)| match p.role {
            Role::Parameter => axis.clone().inside(p.prior),
            _ => axis.clone(),
        })
        .collect::<Vec<Axis>>();
    Problem::new(problem.twin.clone(), axes, problem.records)
}

/// Tests whether θ lies outside its prior box: likelihood ratio of the best θ anywhere over the best inside.
/// Returns the fit inside as well.
pub(in crate::diagnose) fn left_the_prior(
    problem: &Problem<'_>,
    fitted: &Fitted,
    alpha: f64,
) -> Result<(bool, Option<Fitted>), DiagnoseError> {
    let space = problem.twin.parameters();
    let theta = problem.of_record(0, &fitted.theta);
    let own = || (space.iter().zip(&theta)).filter(|(p, _)| p.role == Role::Parameter);
    let beyond = own().filter(|(p, v)| !p.prior.contains(**v)).count();
    if beyond == 0 {
        return Ok((false, None));
    }
    let boxed = inside(problem);
    let starts = [fitted.theta.clone(), boxed.centre()];
    let within = fit(&boxed, &starts, 20)?;
    let ratio = within.as_ref().map_or(f64::INFINITY, |w| {
        2.0 * (fitted.log_likelihood - w.log_likelihood)
    });
    // As many bounds as bind are what chance can gain from.
    let limit =
        ChiSquared::new(beyond as f64).map_or(f64::INFINITY, |c| c.inverse_cdf(1.0 - alpha));
    Ok((ratio > limit, within))
}

/// Listed effects that explain a parameter gap with θ inside the prior: fits within 2 nats of θ outside, best first.
pub(in crate::diagnose) fn absorbing(
    model: &FittedTwin<'_>,
    statistics: &Statistics,
    within: Fitted,
    stage: &Stage,
) -> Result<Vec<Explanation>, DiagnoseError> {
    let free = model.fitted.log_likelihood;
    let boxed = inside(&model.problem);
    let listed: Vec<usize> = (0..model.dictionary.candidates.len())
        .filter(|&c| model.dictionary.candidates[c].is_listed())
        .collect();
    let explanations = model.with_problem(boxed, within, |model| {
        explanations(model, statistics, None, Some(&listed), stage)
    })?;
    Ok((explanations.into_iter())
        .filter(|e| e.fitted.log_likelihood >= free - Thresholds::ABSORBS)
        .collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_test_comes_before_the_prior() {
        assert_eq!(verdict(0.01, true, 0.05), Verdict::StructuralGap);
        assert_eq!(verdict(0.05, true, 0.05), Verdict::ParameterGap);
        assert_eq!(verdict(0.5, false, 0.05), Verdict::NoGap);
    }
}
