//! Entry of a diagnosis, and the order of its steps.

use super::answer::summary::{effects, nuisance, onset, parameters, remains};
use super::answer::{Answer, Hypotheses};
use super::base::left_the_prior;
use super::explain::explore::absorbing;
use super::explain::findings::Findings;
use super::locate::discover::discover;
use super::locate::functions::{curve, told};
use super::locate::maps::maps;
use super::long::search;
use super::outcome::*;
use super::quantify::calibrate::calibrate;
use super::quantify::free_run::{Runner, free_runs, root};
use super::quantify::next_input::next_input;
use super::quantify::power::power;
use super::quantify::share::{Measures, shrinkage};
use super::rounds::Explored;
use super::settings::DiagnoseSettings;
use super::thresholds::Thresholds;
use crate::fit::climb::climb;
use crate::hypothesis::model::Model;
use crate::hypothesis::term::Part;
use crate::likelihood::kalman::recoverable;
use crate::math::six_digits;
use crate::progress::Progress;
use crate::record::Record;
use crate::setting::SettingError;
use crate::study::{Study, StudyError};
use crate::twin::Noise;
use std::sync::Arc;
use std::time::Instant;

/// Most iterations of the last fit of what is accepted.
const FINISH: usize = 80;

/// Diagnoses the gap between a twin and records of one real system.
///
/// All records share θ, noise levels and effects; their starts may differ. A validation record is used for the share closed alone. Noise
/// levels are fitted with θ unless the study says that they are known, and the first state is uncertain unless it is declared. The
/// likelihood of a twin without equations is an ensemble's instead of a filter's; only effects of its signals can then be named. The same
/// seed gives the same bits on any number of threads.
///
/// ```
/// use truetwin::diagnose::Verdict;
/// use truetwin::prelude::*;
/// use truetwin::twins::VanDerPol;
///
/// let drive = Drive::autonomous(0.05, 300)?;
/// let outputs = VanDerPol.simulate(&[1.5], &drive, Noise::new(1, "doc", 0))?;
/// let record = Record::new(drive, outputs)?;
/// let settings = DiagnoseSettings { seed: 7, ..DiagnoseSettings::default() };
/// let study = Study::of(VanDerPol)?;
/// let diagnosis = diagnose(&study, &[record], None, &settings, &Progress::silent())?;
/// assert_eq!(diagnosis.verdict, Verdict::NoGap);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
///
/// [`StudyError`]: records that do not fit the twin or each other, settings that cannot be used, a twin that
/// no start fits, and cancellation.
pub fn diagnose(
    study: &Study,
    records: &[Record],
    validation: Option<&Record>,
    settings: &DiagnoseSettings,
    progress: &Progress,
) -> Result<Diagnosis, StudyError> {
    let clock = Instant::now();
    let study = &*study.for_records(records)?;
    check(study, records, validation, settings)?;
    let owned = Arc::from(records);
    let found = search(study, &owned, settings, progress, &|explored| {
        report(explored, validation, settings, progress)
    })?;
    Ok(Diagnosis {
        seconds: clock.elapsed().as_secs_f64(),
        ..found
    })
}

impl Study {
    /// Diagnoses the gap between the twin and records of one system, as [`diagnose`] does with its default settings.
    ///
    /// # Errors
    ///
    /// As [`diagnose`].
    pub fn diagnose(&self, records: &[Record]) -> Result<Diagnosis, StudyError> {
        let settings = DiagnoseSettings::default();
        diagnose(self, records, None, &settings, &Progress::silent())
    }
}

/// Decides, locates and measures.
fn report(
    explored: Explored<'_>,
    validation: Option<&Record>,
    settings: &DiagnoseSettings,
    progress: &Progress,
) -> Result<Diagnosis, StudyError> {
    // What is left to do for a partial answer is done as for a quick look, without a share: that takes longest.
    let hurried = DiagnoseSettings {
        quick: true,
        calibrate: 0,
        ..settings.clone()
    };
    let is_partial = explored.findings.is_partial;
    let settings = if is_partial { &hurried } else { settings };
    let noise = settings.noise();
    let Explored {
        study,
        base,
        listed,
        findings,
        posterior,
        not_tested,
        searched,
    } = &explored;
    let model = &base.model;
    let records = &model.problem.records;
    let mut detection = Detection {
        log_evidence: posterior.log_odds,
        p_value: None,
        simulations: settings.calibrate,
        at_floor: false,
        alpha: settings.alpha,
    };
    if settings.calibrate > 0 {
        let stage = progress.stage("calibrate", settings.calibrate);
        let alone = DiagnoseSettings {
            detection_only: true,
            calibrate: 0,
            ..settings.clone()
        };
        let log_odds = |records: &[Record]| {
            let silent = Progress::silent();
            search(study, &Arc::from(records), &alone, &silent, &|found| {
                Ok(found.posterior.log_odds)
            })
        };
        let own = posterior.log_odds;
        let p = calibrate(
            model,
            settings.calibrate,
            own,
            log_odds,
            noise.child("null"),
            &stage,
        );
        let p = match p {
            Err(StudyError::Cancelled(_)) if settings.give_partial => None,
            p => p?,
        };
        if let Some((p, at_floor)) = p {
            (detection.p_value, detection.at_floor) = (Some(p), at_floor);
        }
    }
    let (outside, within) = left_the_prior(model, settings.alpha)?;
    let hypotheses = Hypotheses {
        has_equations: base.scales.has_equations(),
        ..findings.hypotheses()
    };
    let mut answer = Answer::new(hypotheses.posterior(), outside);
    let mut absorbed = vec![];
    match (answer.verdict, within) {
        (Verdict::StructuralGap, _) if !settings.detection_only => answer = answer.decided(),
        (Verdict::ParameterGap, Some(within)) if !settings.detection_only => {
            absorbed = absorbing(model, &within, listed)?;
            if !absorbed.is_empty() {
                answer.decision = Decision::Absorbed;
                answer.class = absorbed.iter().flat_map(|f| f.last().keys()).collect();
            }
        }
        _ => {}
    }
    let is_linearised = !base.scales.has_equations() && !base.is_silent;
    if is_linearised && !is_nearer(findings.model(&answer.accepted), model)? {
        answer = answer.refuted();
    }
    let verdict = answer.verdict;
    let finished = finished(findings.model(&answer.accepted))?;
    let accepted = finished.as_ref();
    let last = accepted.unwrap_or(model);
    let stage = progress.stage("where and how far", 4);
    let mut location = Location::default();
    let (mut next, mut discovery, mut visible, mut shrunk) = (None, None, vec![], None);
    if verdict == Verdict::StructuralGap && !settings.detection_only {
        location = located(findings, &answer, model)?;
        location.after = accepted.map(|m| maps(m, None)).transpose()?;
        discovery = discovered(findings, &answer, &location, noise);
    }
    settings.ends(stage.tick())?;
    if !settings.detection_only {
        let is_class = answer.decision == Decision::Class && answer.accepted.len() == 1;
        if is_class && !settings.quick {
            let rivals: Vec<&Model> = (answer.class.iter())
                .filter_map(|key| findings.model(std::slice::from_ref(key)))
                .collect();
            next = next_input(&rivals, noise.child("next"))?;
        }
        settings.ends(stage.tick())?;
        if !settings.quick {
            visible = power(model, listed)?;
        }
        settings.ends(stage.tick())?;
        let validation = validation.map(std::slice::from_ref);
        let measures = Measures {
            base: model,
            accepted,
            others: &findings.listed,
            class: &answer.class,
            validation,
            initial: settings.initial.as_deref(),
        };
        if !is_partial {
            shrunk = shrinkage(&measures, noise)?;
        }
        settings.ends(stage.tick())?;
    }
    let runs = |records: &[Record]| -> Result<FreeRuns, StudyError> {
        let runner = |model: &Model| {
            let problem = model.problem.on(records);
            Runner::new(&problem, &problem.full(&model.theta()))
        };
        let (base, grown) = (runner(model)?, accepted.map(runner).transpose()?.flatten());
        Ok(free_runs(&records[0], base.as_ref(), grown.as_ref()))
    };
    let parameters = parameters(last, &base.theta, settings)?;
    let filtered = recoverable(last.problem.filtered(&last.fitted.theta))?;
    Ok(Diagnosis {
        twin: study.name().into(),
        verdict,
        detection,
        warnings: warnings(
            study.twin(),
            records,
            validation,
            &parameters,
            base.step.is_some(),
            *searched,
        ),
        residuals: (records.iter().zip(filtered.into_iter().flatten()))
            .filter_map(|(r, filtered)| Record::new(r.drive().clone(), filtered.standardised).ok())
            .collect(),
        parameters,
        nuisance: nuisance(last, &base.noises)?,
        location: Location {
            onset: accepted.and_then(onset),
            ..location
        },
        cause: Cause {
            decision: answer.decision,
            effects: match verdict {
                Verdict::StructuralGap if !settings.detection_only => {
                    effects(findings, &answer, accepted)
                }
                _ => super::answer::summary::absorbed(&absorbed),
            },
            probabilities: answer.posterior.kinds,
            remains: remains(findings, &answer),
            next_input: next,
            class: answer.class,
            accepted: answer.accepted,
        },
        shrinkage: shrunk,
        discovery,
        power: visible,
        free_runs: runs(&records[..1])?,
        validation_runs: validation
            .map(|v| runs(std::slice::from_ref(v)))
            .transpose()?,
        correlated_noise: base.noise_at(|part| !matches!(part, Part::Effect { .. })),
        outliers: base.noise_at(|part| matches!(part, Part::Effect { .. })),
        quick: settings.quick,
        interrupted: is_partial,
        integrator: base.step.map(|step| step.integrator),
        substeps: base.step.map(|step| step.substeps),
        candidates: findings.listed.len() + findings.unknown.len(),
        not_tested: not_tested.clone(),
        passes: model.problem.passes().so_far(),
        seconds: 0.0,
    })
}

/// The accepted model, its fit carried on to its end: the search stops where a hypothesis is known well enough to be compared.
pub(super) fn finished(accepted: Option<&Model>) -> Result<Option<Model>, StudyError> {
    let Some(model) = accepted else {
        return Ok(None);
    };
    let fitted = climb(&model.problem, &model.fitted.theta, FINISH)?;
    let finished = fitted.and_then(|fitted| model.refitted(fitted));
    Ok(finished.or_else(|| Some(model.clone())))
}

/// Returns whether the free run of a noisy black box's model is nearer to the record than that of the twin. Their likelihood is linearised
/// about their runs, and says nothing where these are in another phase.
fn is_nearer(model: Option<&Model>, twin: &Model) -> Result<bool, StudyError> {
    let Some(model) = model else { return Ok(true) };
    let error = |model: &Model| -> Result<f64, StudyError> {
        let runner = Runner::new(&model.problem, &model.fitted.theta)?;
        let errors = runner.and_then(|runner| runner.errors(&model.problem.records[0], 0));
        Ok(errors.map_or(f64::INFINITY, |errors| root(&errors)))
    };
    Ok(error(model)? < Thresholds::NEARER * error(twin)?)
}

/// Places, missing functions and residuals of a structural gap.
fn located(findings: &Findings, answer: &Answer, model: &Model) -> Result<Location, StudyError> {
    let targets = answer.posterior.targets();
    let accepted: Vec<&str> = (findings.model(&answer.accepted).iter())
        .flat_map(|m| &m.terms)
        .map(|term| term.target.as_str())
        .collect();
    let target = answer.place();
    let several = accepted.iter().any(|place| *place != accepted[0]);
    let class = match &target {
        Some(target) if !several => TargetShare::alike(&targets, target),
        _ => vec![],
    };
    let mut functions = told(&findings.unknown, target.as_deref(), false, 0.0);
    if let Some((keys, on_top)) = findings.beside(&answer.accepted) {
        let floor = findings.gain(keys).unwrap_or(0.0);
        functions.extend(told(on_top, target.as_deref(), true, floor));
    }
    let best = findings.best();
    Ok(Location {
        maps: maps(model, best)?,
        target,
        class,
        targets,
        functions,
        ..Location::default()
    })
}

/// A sparse law for what is missing, where nothing listed explains it all.
fn discovered(
    findings: &Findings,
    answer: &Answer,
    location: &Location,
    noise: Noise,
) -> Option<Discovery> {
    // The place that the answer states: of the gap, or of what remains beside the accepted effects.
    let (all, place) = match answer.decision {
        Decision::NoneOfThese => (&findings.unknown[..], location.target.clone()?),
        Decision::Partial => (
            findings.beside(&answer.accepted)?.1,
            remains(findings, answer)?.place,
        ),
        _ => return None,
    };
    // The best function of one variable there. What a parameter follows is no law to be added.
    let (found, curve) = (all.iter())
        .filter(|f| f.last().target == place && !f.last().is_in_parameter())
        .find_map(|f| Some((f, curve(f.model.as_ref()?)?)))?;
    discover(
        (&place, &found.last().variables[0].0),
        &curve,
        noise.child("discover"),
    )
}

fn check(
    study: &Study,
    records: &[Record],
    validation: Option<&Record>,
    settings: &DiagnoseSettings,
) -> Result<(), StudyError> {
    let first = records.first().ok_or(StudyError::NoRecord)?;
    let expected = first.drive().dt();
    let measured = (records.iter().enumerate()).map(|(i, record)| (Some(i), record));
    let validation = validation.map(|record| (None, record));
    for (which, record) in measured.chain(validation) {
        (record.check_channels(&study.twin().signals()))
            .and_then(|()| study.twin().check_drive(record.drive()))
            .map_err(|error| StudyError::Channels {
                record: which,
                error,
            })?;
        let given = record.drive().dt();
        let uniform = first.drive().is_uniform() && record.drive().is_uniform();
        if uniform && (given - expected).abs() > 1e-3 * expected {
            return Err(StudyError::Steps {
                record: which,
                given: six_digits(given),
                expected: six_digits(expected),
            });
        }
        let samples = record.measured_rows();
        let least = study.twin().parameters().len() + 3;
        if samples < least {
            return Err(StudyError::TooShort {
                record: which,
                samples,
                least,
            });
        }
    }
    let alpha = settings.alpha;
    SettingError::unless(
        alpha > 0.0 && alpha < 1.0,
        "alpha",
        alpha,
        "choose a level between 0 and 1, such as 0.05",
    )?;
    SettingError::unless(
        settings.calibrate <= MOST_SIMULATIONS,
        "calibrate",
        settings.calibrate,
        format!("choose at most {MOST_SIMULATIONS}"),
    )?;
    Ok(())
}

/// Most simulations of a calibration.
const MOST_SIMULATIONS: usize = 100_000;
