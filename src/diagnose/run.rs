//! The way of one diagnosis.

use super::attribute::{Explanation, explanations, probabilities};
use super::base_fit::{ITERATIONS, base_fit};
use super::black_box::{dithered, measured};
use super::candidate::{Addition, candidates, not_tested};
use super::decide::{Accepted, Answer, Step, decide, magnitudes};
use super::evalue::{combined, log_e};
use super::fit::{Fitted, fit};
use super::held_out::shrinkage;
use super::null::{Bench, Test};
use super::place::locate;
use super::problem::Problem;
use super::result::*;
use super::shrink::{Runner, free_runs};
use super::verdict::{absorbing, left_the_prior, verdict};
use super::{DiagnoseError, DiagnoseSettings, GivenRecord, Setting};
use crate::math::six_digits;
use crate::progress::Progress;
use crate::study::Study;
use crate::twin::{DigitalTwin, Noise, Now, PRIOR_DEVIATION, Parameter, Record, Role};
use std::time::Instant;

/// Shortest record.
const LEAST: usize = 50;
/// Explanations that are reported.
const REPORTED: usize = 12;

/// Diagnoses the gap between a twin and records of one real system.
///
/// All records share θ, but for unknown starts. A validation record is used for the test, the order of explanations, and
/// the share closed. A twin without equations is looked at through ensembles of its simulations instead of a filter; only effects of its
/// signals can then be named. The same seed gives the same bits on any number of threads.
///
/// ```
/// use truetwin::diagnose::{DiagnoseSettings, Verdict, diagnose};
/// use truetwin::progress::Progress;
/// use truetwin::study::{RecordPlan, Study};
/// use truetwin::twin::*;
/// use truetwin::twins::VanDerPol;
///
/// let study = Study::new("oscillator", VanDerPol, RecordPlan::autonomous(0.05, 300))?;
/// let drive = Drive::autonomous(0.05, 300)?;
/// let outputs = VanDerPol.simulate(&[1.5], &drive, Noise::new(1, "doc", 0))?;
/// let record = Record::new(drive, outputs)?;
/// let found = diagnose(&study, &[record], None, &DiagnoseSettings::default(), &Progress::silent())?;
/// assert_eq!(found.verdict, Verdict::NoGap);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
///
/// [`DiagnoseError`]: records that do not fit the twin or each other, settings that cannot be used, a twin that
/// no start fits, and cancellation.
pub fn diagnose(
    study: &Study,
    records: &[Record],
    validation: Option<&Record>,
    settings: &DiagnoseSettings,
    progress: &Progress,
) -> Result<Diagnosis, DiagnoseError> {
    let clock = Instant::now();
    check(study, records, validation, settings)?;
    let noise = Noise::new(settings.seed, "diagnose", 0);
    let (twin, silent) = &measured(study.twin(), records)?;
    let silent = *silent;
    let dithered = match silent {
        true => Some(dithered(records, noise)?),
        false => None,
    };
    let records = dithered.as_deref().unwrap_or(records);
    let validation: Option<Vec<Record>> = validation.map(|v| vec![v.clone()]);
    let validation = validation.as_deref();
    let together = validation.map(|v| [records, v].concat());
    let space = twin.parameters();
    let setting = Setting {
        twin,
        validation,
        together: together.as_deref(),
        follows: silent || without_process_noise(twin.as_ref(), &records[0]),
        silent,
    };

    // θ, and how the record looks at it.
    let problem = Problem::of_twin(twin, records);
    let stage = progress.stage("fit", 1);
    let fitted = base_fit(&problem, settings, noise)?.ok_or(DiagnoseError::NoFit)?;
    stage.tick()?;
    let mut all = candidates(study, &settings.without)?;
    if setting.follows {
        all.retain(|c| c.is_listed() && !c.is_noise());
    }
    let not_tested = not_tested(study, &all);
    let bench =
        (setting.bench(problem.clone(), fitted.clone(), &[], all)?).ok_or(DiagnoseError::NoFit)?;

    // Is it what the twin makes?
    let stage = progress.stage("test", settings.replicates);
    // With a validation record, p is twice the rank's; and without one it is not to end at the edge of the level.
    let level = 0.5 * settings.alpha;
    let nulls = (bench.nulls(
        settings.replicates,
        0.999 * level,
        noise.child("null"),
        &stage,
    )?)
    .ok_or(DiagnoseError::NoFit)?;
    let test = nulls.test();
    let fit_all = || {
        let stage = progress.stage("explain", bench.dictionary.candidates.len());
        explanations(&bench, &nulls.own, validation, None, &stage)
    };
    let mut found: Option<Vec<Explanation>> = None;
    let mut e_value = None;
    if let Some(records) = validation {
        let list = fit_all()?;
        e_value = against(&problem, &fitted, records, &list)?;
        found = Some(list);
    }
    let p_value = combined(test.p_value, e_value);
    let (outside, within) = left_the_prior(&problem, &fitted, settings.alpha)?;
    let verdict = verdict(p_value, outside, settings.alpha);

    // Which effect?
    let mut answer = Answer {
        decision: Decision::NotNeeded,
        accepted: vec![],
        class: vec![],
        unexplained: None,
        catch_all: None,
    };
    let mut step: Option<Step<'_>> = None;
    let mut effects = vec![];
    if verdict == Verdict::StructuralGap {
        let list = match found.take() {
            Some(list) => list,
            None => fit_all()?,
        };
        let stage = progress.stage("accept", 2 * settings.unexplained);
        (answer, step) = decide(&setting, &bench, &list, settings, noise, &stage)?;
        stage.finish();
        effects = reported(&bench, &list, &test, &answer);
        found = Some(list);
    } else if verdict == Verdict::ParameterGap
        && let Some(within) = within
    {
        let stage = progress.stage("explain", bench.dictionary.candidates.len());
        let list = absorbing(&bench, &nulls.own, within, &stage)?;
        stage.finish();
        if !list.is_empty() {
            answer.decision = Decision::Absorbed;
            answer.class = (list.iter())
                .map(|e| bench.dictionary.candidates[e.candidate].key())
                .collect();
        }
        effects = reported(&bench, &list, &test, &answer);
    }

    // Where, and how far?
    let place = match verdict {
        Verdict::StructuralGap => locate(
            &bench,
            found.as_deref().unwrap_or(&[]),
            &test,
            &answer,
            &problem.outline(),
        )?,
        _ => Where::default(),
    };
    let last = step.as_ref().map_or(&bench, |step| &step.bench);
    let (parameters, nuisance) =
        fitted_parameters(&space.iter().collect::<Vec<_>>(), last, settings);
    progress.checkpoint()?;
    let additions: Vec<Addition> = answer.accepted.iter().map(|a| a.addition.clone()).collect();
    let shrinkage = shrinkage(
        &setting,
        &bench,
        step.as_ref(),
        &answer,
        found.as_deref(),
        settings,
        noise,
    )?;
    let runs = |record: &Record| -> Result<FreeRuns, DiagnoseError> {
        let base = Runner::new(twin, &[], problem.of_record(0, &fitted.theta))?;
        let grown = match additions.is_empty() {
            true => None,
            false => {
                let theta = last.problem.of_record(0, &last.fitted.theta);
                Some(Runner::new(twin, &additions, theta)?)
            }
        };
        Ok(free_runs(record, &base, grown.as_ref()))
    };
    Ok(Diagnosis {
        twin: study.name().into(),
        verdict,
        detection: Detection {
            p_value,
            alpha: settings.alpha,
            statistic: test.statistic,
            rank_p_value: test.p_value,
            log_e: e_value,
        },
        parameters,
        nuisance,
        place,
        which: Which {
            decision: answer.decision,
            effects,
            accepted: answer.accepted.iter().map(Accepted::key).collect(),
            class: answer.class,
            unexplained_p_value: answer.unexplained,
            catch_all: answer.catch_all,
        },
        shrinkage,
        free_runs: runs(&records[0])?,
        validation_runs: validation.map(|v| runs(&v[0])).transpose()?,
        not_tested,
        candidates: bench.dictionary.candidates.len(),
        seconds: clock.elapsed().as_secs_f64(),
    })
}

pub(super) fn check(
    study: &Study,
    records: &[Record],
    validation: Option<&Record>,
    settings: &DiagnoseSettings,
) -> Result<(), DiagnoseError> {
    let first = records.first().ok_or(DiagnoseError::NoRecord)?;
    let expected = first.drive().dt();
    let measured =
        (records.iter().enumerate()).map(|(i, record)| (GivenRecord::Measured(i), record));
    let validation = validation.map(|record| (GivenRecord::Validation, record));
    for (which, record) in measured.chain(validation) {
        (record.check_channels(&study.twin().signals())).map_err(|error| {
            DiagnoseError::Channels {
                record: which,
                error,
            }
        })?;
        let given = record.drive().dt();
        if (given - expected).abs() > 1e-3 * expected {
            return Err(DiagnoseError::Steps {
                record: which,
                given: six_digits(given),
                expected: six_digits(expected),
            });
        }
        if record.samples() < LEAST {
            return Err(DiagnoseError::TooShort {
                record: which,
                samples: record.samples(),
                least: LEAST,
            });
        }
    }
    let setting = |name, value, remedy| {
        Err(DiagnoseError::Setting {
            name,
            value,
            remedy,
        })
    };
    let (alpha, replicates) = (settings.alpha, settings.replicates as f64);
    if !(alpha > 0.0 && alpha < 1.0) {
        return setting(
            "alpha",
            alpha,
            "choose a level between 0 and 1, such as 0.05",
        );
    }
    if (replicates + 1.0) * alpha <= 1.0 {
        return setting("replicates", replicates, "take more than 1/alpha");
    }
    if settings.unexplained < 50 {
        return setting(
            "unexplained",
            settings.unexplained as f64,
            "take at least 50",
        );
    }
    Ok(())
}

/// Whether no state of the twin is noisy, with any noise level that the study leaves open; nobody knows of a black box.
pub(super) fn without_process_noise(twin: &dyn DigitalTwin, record: &Record) -> bool {
    let Some(twin) = twin.state_space() else {
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

/// Explanations as they are reported: the accepted ones first.
fn reported(
    bench: &Bench<'_>,
    found: &[Explanation],
    test: &Test,
    answer: &Answer,
) -> Vec<EffectFit> {
    let chances = probabilities(found);
    let mut all: Vec<EffectFit> = (found.iter().zip(chances))
        .filter(|(e, _)| bench.dictionary.candidates[e.candidate].is_listed())
        .map(|(e, probability)| {
            let candidate = &bench.dictionary.candidates[e.candidate];
            EffectFit {
                id: candidate.id.clone(),
                target: candidate.target.clone(),
                probability,
                magnitudes: magnitudes(bench, e),
                log_score_gain: e.gain + e.validation.unwrap_or(0.0),
                p_value: test.candidates.get(e.candidate).copied(),
            }
        })
        .collect();
    // A pair's magnitudes and gains are those of the two together.
    if answer.accepted.len() > 1 {
        for accepted in answer.accepted.iter().rev() {
            let at = all.iter().position(|e| e.key() == accepted.key());
            let mut effect = match at {
                Some(at) => all.remove(at),
                None => continue,
            };
            effect.magnitudes = accepted.magnitudes.clone();
            effect.log_score_gain = accepted.gain;
            all.insert(0, effect);
        }
    }
    all.truncate(REPORTED);
    all
}

/// The twin's own parameters, and everything else that the study estimates.
fn fitted_parameters(
    space: &[&Parameter],
    bench: &Bench<'_>,
    settings: &DiagnoseSettings,
) -> (Vec<FittedParameter>, Vec<FittedNuisance>) {
    let errors = bench.fitted.std_errors(&bench.problem);
    let theta = &bench.fitted.theta;
    let (mut own, mut nuisance) = (vec![], vec![]);
    for (j, p) in space.iter().enumerate() {
        if p.role == Role::Physical {
            own.push(FittedParameter {
                name: p.name.clone(),
                unit: p.unit.clone(),
                initial: settings.initial.as_ref().and_then(|i| i.get(j).copied()),
                refitted: theta[j],
                std_error: errors[j],
                identified: errors[j] < PRIOR_DEVIATION * p.prior.width(),
                prior: p.prior,
            });
        } else {
            let role = match p.role {
                Role::Start => "start",
                Role::Noise => "noise",
                _ => "effect",
            };
            let name = p.name.split_once('.').filter(|_| role != "effect");
            nuisance.push(FittedNuisance {
                name: name.map_or(p.name.as_str(), |(_, name)| name).to_owned(),
                role,
                value: theta[j],
                std_error: errors[j],
            });
        }
    }
    // Starts of further records stand behind everything else.
    let starts: Vec<&&Parameter> = space.iter().filter(|p| p.role == Role::Start).collect();
    let d = bench.problem.twin.parameters().len();
    for (i, j) in (d..theta.len()).enumerate() {
        let (record, which) = (i / starts.len().max(1) + 2, i % starts.len().max(1));
        let name = starts[which].name.trim_start_matches("start.");
        nuisance.push(FittedNuisance {
            name: format!("{name} (record {record})"),
            role: "start",
            value: theta[j],
            std_error: errors[j],
        });
    }
    (own, nuisance)
}
