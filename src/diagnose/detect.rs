//! Whether the twin can have made the records.

use super::attribute::{Explanation, explanations};
use super::base_fit::{ITERATIONS, base_fit};
use super::candidate::{candidates, not_tested};
use super::evalue::{combined, log_e};
use super::fit::{Fitted, fit};
use super::null::{Bench, Nulls, Test};
use super::problem::Problem;
use super::result::{Detection, Verdict};
use super::verdict::{left_the_prior, verdict};
use super::{DiagnoseError, DiagnoseSettings, Setting};
use crate::progress::Progress;
use crate::record::Record;
use crate::twin::{Noise, Now, Role, Twin};

/// The twin, fitted and tested.
pub(super) struct Detected<'a> {
    /// The refitted twin with everything that records are looked at with.
    pub bench: Bench<'a>,
    /// What simulations of it look like.
    pub nulls: Nulls,
    pub test: Test,
    pub detection: Detection,
    pub verdict: Verdict,
    /// Explanations, where the e-value needed them.
    pub found: Option<Vec<Explanation>>,
    /// The fit with θ inside the prior, where θ left it.
    pub within: Option<Fitted>,
    /// Effects that were not looked at.
    pub not_tested: Vec<String>,
}

/// Fits the twin to the records, and tests it.
pub(super) fn detect<'a>(
    setting: &Setting<'a>,
    records: &'a [Record],
    settings: &DiagnoseSettings,
    noise: Noise,
    progress: &Progress,
) -> Result<Detected<'a>, DiagnoseError> {
    let problem = Problem::of_twin(setting.twin, records);
    let stage = progress.stage("fit", 1);
    let fitted = base_fit(&problem, settings, noise)?.ok_or(DiagnoseError::NoFit)?;
    stage.tick()?;
    let mut all = candidates(setting.study, &settings.without)?;
    if setting.follows {
        all.retain(|c| c.is_listed() && !c.is_noise());
    }
    let not_tested = not_tested(setting.study, &all);
    let bench =
        (setting.bench(problem.clone(), fitted.clone(), &[], all)?).ok_or(DiagnoseError::NoFit)?;
    let stage = progress.stage("test", settings.replicates);
    // With a validation record, p is twice the rank's; and without one it is not to end at the edge of the level.
    let level = 0.5 * settings.alpha;
    let nulls = bench.nulls(
        settings.replicates,
        0.999 * level,
        noise.child("null"),
        &stage,
    )?;
    let nulls = nulls.ok_or(DiagnoseError::NoFit)?;
    let test = nulls.test();
    let mut found = None;
    let mut e_value = None;
    if let Some(records) = setting.validation {
        let list = explained(setting, &bench, &nulls, progress)?;
        e_value = against(&problem, &fitted, records, &list)?;
        found = Some(list);
    }
    let p_value = combined(test.p_value, e_value);
    let (outside, within) = left_the_prior(&problem, &fitted, settings.alpha)?;
    Ok(Detected {
        bench,
        detection: Detection {
            p_value,
            alpha: settings.alpha,
            statistic: test.statistic,
            rank_p_value: test.p_value,
            log_e: e_value,
        },
        verdict: verdict(p_value, outside, settings.alpha),
        nulls,
        test,
        found,
        within,
        not_tested,
    })
}

/// Every candidate, fitted.
pub(super) fn explained(
    setting: &Setting<'_>,
    bench: &Bench<'_>,
    nulls: &Nulls,
    progress: &Progress,
) -> Result<Vec<Explanation>, DiagnoseError> {
    let stage = progress.stage("explain", bench.dictionary.candidates.len());
    explanations(bench, &nulls.own, setting.validation, None, &stage)
}

/// Whether no state of the twin is noisy, with any noise level that the study leaves open; nobody knows of a black box.
pub(super) fn without_process_noise(twin: &Twin, record: &Record) -> bool {
    let Twin::Equations(twin) = twin else {
        return false;
    };
    let outline = twin.outline();
    let theta = outline.parameters.centre();
    let drive = record.drive();
    let now = Now {
        t: 0.0,
        dt: drive.dt(),
        u: drive.input(0),
        theta: &theta,
    };
    let mut process = vec![0.0; outline.states.len()];
    let mut measurement = vec![0.0; outline.outputs.len()];
    twin.noise(&now, &mut process, &mut measurement);
    process.iter().all(|q| *q == 0.0)
}

/// log E of the validation record against the twin refitted on it.
fn against(
    problem: &Problem<'_>,
    fitted: &Fitted,
    records: &[Record],
    found: &[Explanation],
) -> Result<Option<f64>, DiagnoseError> {
    let there = problem.on(records);
    let space = problem.twin.parameters();
    let starts = space.iter().filter(|p| p.role == Role::Start).count();
    let begin = there.full(&problem.of_record(0, &fitted.theta));
    let refitted = fit(&there, &[begin, there.centre()], ITERATIONS)?;
    Ok(refitted.and_then(|f| log_e(found, f.log_likelihood, starts, there.samples())))
}
