//! Fit and structural test of the twin.

use crate::diagnose::context::Context;
use crate::diagnose::error::DiagnoseError;
use crate::diagnose::explain::attribute::{Explanation, explanations};
use crate::diagnose::explain::evalue::{combined, log_e};
use crate::diagnose::explain::verdict::{left_the_prior, verdict};
use crate::diagnose::hypotheses::candidate::{candidates, not_tested};
use crate::diagnose::outcome::{Detection, Verdict};
use crate::diagnose::settings::DiagnoseSettings;
use crate::diagnose::test::fitted_twin::FittedTwin;
use crate::diagnose::test::null::{NullDistribution, Test};
use crate::fit::climb::{Fitted, fit};
use crate::fit::problem::Problem;
use crate::fit::starts::{ITERATIONS, base_fit};
use crate::progress::Progress;
use crate::record::Record;
use crate::twin::{Noise, Role};

/// The twin, fitted and tested.
pub(in crate::diagnose) struct Detected<'a> {
    /// The refitted twin.
    pub model: FittedTwin<'a>,
    /// Statistics of its simulations.
    pub null: NullDistribution,
    pub test: Test,
    pub detection: Detection,
    pub verdict: Verdict,
    /// Explanations, where the e-value needed them.
    pub explanations: Option<Vec<Explanation>>,
    /// The fit with θ inside the prior, where θ left it.
    pub within: Option<Fitted>,
    /// Effects that were not tested.
    pub not_tested: Vec<String>,
}

/// Fits the twin to the records, and tests it.
pub(in crate::diagnose) fn detect<'a>(
    context: &Context<'a>,
    records: &'a [Record],
    settings: &DiagnoseSettings,
    noise: Noise,
    progress: &Progress,
) -> Result<Detected<'a>, DiagnoseError> {
    let problem = Problem::of_twin(context.twin, records);
    let stage = progress.stage("fit", 1);
    let fitted =
        base_fit(&problem, settings.initial.as_deref(), noise)?.ok_or(DiagnoseError::NoFit)?;
    stage.tick()?;
    let mut all = candidates(context.study, &settings.without)?;
    if context.follows {
        all.retain(|c| c.is_listed() && !c.is_noise());
    }
    let not_tested = not_tested(context.study, &all);
    let model = (FittedTwin::new(context.twin, problem.clone(), fitted.clone(), &[], all)?)
        .ok_or(DiagnoseError::NoFit)?;
    let stage = progress.stage("test", settings.replicates);
    // With a validation record, p is twice the rank's; and without one it is not to end at the edge of the level.
    let level = 0.5 * settings.alpha;
    let null = model.null_distribution(
        settings.replicates,
        0.999 * level,
        noise.child("null"),
        &stage,
    )?;
    let null = null.ok_or(DiagnoseError::NoFit)?;
    if null.others.iter().all(Option::is_none) {
        return Err(DiagnoseError::NoSimulation);
    }
    let test = null.test();
    let mut explanations = None;
    let mut e_value = None;
    if let Some(records) = context.validation {
        let list = explained(context, &model, &null, progress)?;
        e_value = against(&problem, &fitted, records, &list)?;
        explanations = Some(list);
    }
    let p_value = combined(test.p_value, e_value);
    let (outside, within) = left_the_prior(&problem, &fitted, settings.alpha)?;
    Ok(Detected {
        model,
        detection: Detection {
            p_value,
            alpha: settings.alpha,
            statistic: test.statistic,
            rank_p_value: test.p_value,
            log_e: e_value,
        },
        verdict: verdict(p_value, outside, settings.alpha),
        null,
        test,
        explanations,
        within,
        not_tested,
    })
}

/// Every candidate, fitted.
pub(in crate::diagnose) fn explained(
    context: &Context<'_>,
    model: &FittedTwin<'_>,
    null: &NullDistribution,
    progress: &Progress,
) -> Result<Vec<Explanation>, DiagnoseError> {
    let stage = progress.stage("explain", model.dictionary.candidates.len());
    explanations(model, &null.own, context.validation, None, &stage)
}

/// log E of the validation record against the twin refitted on it.
fn against(
    problem: &Problem<'_>,
    fitted: &Fitted,
    records: &[Record],
    explanations: &[Explanation],
) -> Result<Option<f64>, DiagnoseError> {
    let there = problem.on(records);
    let space = problem.twin.parameters();
    let starts = space.iter().filter(|p| p.role == Role::Start).count();
    let begin = there.full(&problem.of_record(0, &fitted.theta));
    let refitted = fit(&there, &[begin, there.centre()], ITERATIONS)?;
    Ok(refitted.and_then(|f| log_e(explanations, f.log_likelihood, starts, there.samples())))
}
