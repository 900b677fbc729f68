//! Fit of a twin to records, with fitted noise and uncertain starts.

use super::certificate::{Certificate, Side};
use super::climb::Fitted;
use super::draws::table;
use super::effects::begin;
use super::evidence::evidence;
use super::follow::{free_runs, starts};
use super::magnitude::{Kind, kinds, largest, shape_axis, size_axis};
use super::outcome::{
    Convergence, Fit, FitEvidence, FitSettings, FittedNoise, FittedValue, NOT_CONVERGED,
    OutputErrors, Warning,
};
use super::posterior::{Draws, posterior};
use super::problem::Problem;
use super::spread::Spread;
use super::starts::{base_fit, polish, search};
use crate::effect::Effect;
use crate::likelihood::kalman::FilterError;
use crate::likelihood::{Beliefs, Level, measured};
use crate::math::deviation;
use crate::record::{Record, Signal};
use crate::twin::{Noise, Role, Twin};
use std::time::Instant;

/// Iterations of each search: loud noise has a way to go.
const ITERATIONS: usize = 80;

/// Subject of a fit: a twin in its study's setting.
pub(crate) struct Subject<'a> {
    pub twin: &'a Twin,
    /// Effects whose free magnitudes are entries of θ.
    pub effects: &'a [Effect],
    pub beliefs: &'a Beliefs,
}

/// Fits a twin to records; `None` where it works at no start.
pub(crate) fn run(
    subject: &Subject<'_>,
    records: &[Record],
    settings: &FitSettings,
) -> Result<Option<Fit>, FilterError> {
    let clock = Instant::now();
    let noise = Noise::new(settings.seed, "fit", 0);
    let measured = measured(subject.twin, records, subject.beliefs)?;
    let mut problem = Problem::of_measured(&measured, records);
    let (twin, levels) = (measured.twin, measured.levels);
    let space = twin.parameters();
    let own = space.len() - levels.len();
    if !problem.is_simulated() {
        // Sizes of effects are known once states are: where the twin follows the record with loud noise.
        let kinds = kinds(subject.effects, records);
        let mut begin = problem.begin(&problem.centre());
        // A step that is beyond the records changes nothing, whatever its size.
        for (value, parameter) in begin.iter_mut().zip(space.iter()) {
            if let Some(Kind::Shape { low, high }) = kinds.get(&parameter.name) {
                *value = parameter.bounds.clamp(0.5 * (low + high));
            }
        }
        let states = problem.states(&begin);
        if let Ok(states) = states {
            let mut axes = problem.axes[..space.len()].to_vec();
            let states: Vec<Signal> = states.into_iter().map(|(_, states)| states).collect();
            for (j, parameter) in space.iter().enumerate().take(own) {
                match kinds.get(&parameter.name) {
                    Some(Kind::Size(off)) => {
                        let mut theta = begin.clone();
                        theta[j] = *off;
                        let entry = (j, parameter);
                        if let Some(size) = largest(&twin, &theta, entry, records, &states) {
                            axes[j] = size_axis(parameter, size);
                        }
                    }
                    Some(Kind::Shape { low, high }) => {
                        axes[j] = shape_axis(parameter, *low, *high);
                    }
                    Some(Kind::Other) | None => {}
                }
            }
            problem = Problem::new(twin.clone(), axes, records);
        }
    }
    let fits = search_all(&problem, subject.effects, noise)?;
    let Some((fitted, certificate)) =
        (fits.first().cloned()).zip(Certificate::new(&problem, &fits))
    else {
        return Ok(None);
    };
    let evidence = evidence(&problem, &fitted, Some(noise.child("evidence")))?;
    let asked = (settings.draws > 0).then_some(settings.draws);
    let draws = match problem.is_simulated() && asked.is_none() {
        true => Draws::default(),
        false => posterior(&problem, &fits, asked, noise.child("posterior"))?,
    };
    let spread = Spread::new(&problem, &fitted, &draws.thetas, settings.level);
    let (parameters, noise_levels) = values(&problem, &fitted, &certificate, &levels, &spread);
    let smoothed = problem.smoothed(&fitted.theta)?;
    let free_runs = free_runs(&problem, &fitted.theta, &smoothed);
    let errors = errors(&problem, &fitted.theta, &free_runs)?;
    let convergence = Convergence {
        converged: certificate.has_converged(),
        distance: certificate.distance,
        agreeing: certificate.agreeing,
        searches: certificate.searches,
    };
    let warnings = warnings(&parameters, &convergence, &errors);
    Ok(Some(Fit {
        parameters,
        noise: noise_levels,
        starts: starts(&problem, &smoothed),
        level: settings.level,
        log_likelihood: fitted.log_likelihood,
        evidence: evidence.map(|e| FitEvidence {
            log_evidence: e.log_evidence,
            laplace: e.laplace,
            std_error: e.error,
            effective_draws: e.effective,
        }),
        convergence,
        errors,
        warnings,
        posterior: (asked.is_some())
            .then(|| table(&problem, &draws, noise.child("starts")))
            .transpose()?,
        samples: problem.samples(),
        seconds: clock.elapsed().as_secs_f64(),
        residuals: (problem.filtered(&fitted.theta)?.into_iter())
            .map(|filtered| filtered.standardised)
            .collect(),
        free_runs,
    }))
}

/// Fits from all starts, best first. Effects begin where a fit without them says that they promise most.
fn search_all(
    problem: &Problem<'_>,
    effects: &[Effect],
    noise: Noise,
) -> Result<Vec<Fitted>, FilterError> {
    let space = problem.twin.parameters();
    let is_magnitude = |j: usize| space[j].role == Role::Magnitude;
    let mut initial = vec![];
    if !problem.is_simulated() && (0..space.len()).any(is_magnitude) {
        let without = problem.holding(is_magnitude);
        let base = search(&without, &[], noise.child("without"), ITERATIONS)?;
        if let Some(base) = base.first() {
            initial = begin(&without, &base.theta, effects)?;
        }
    }
    let fits = if problem.is_simulated() {
        base_fit(problem, None, noise)?.into_iter().collect()
    } else {
        search(problem, &initial, noise, ITERATIONS)?
    };
    polish(problem, fits, ITERATIONS)
}

/// Parameters and noise levels with errors and intervals.
fn values(
    problem: &Problem<'_>,
    fitted: &Fitted,
    certificate: &Certificate,
    levels: &[Level],
    spread: &Spread,
) -> (Vec<FittedValue>, Vec<FittedNoise>) {
    let space = problem.twin.parameters();
    let errors = &spread.errors;
    let (mut parameters, mut noise) = (vec![], vec![]);
    for (j, p) in space.iter().enumerate() {
        if p.role == Role::Noise {
            let level = levels.iter().find(|level| level.parameter.name == p.name);
            noise.push(FittedNoise {
                name: p.target().to_owned(),
                role: match level {
                    Some(level) if level.is_process => "process",
                    _ => "measurement",
                },
                unit: p.unit.clone(),
                value: fitted.theta[j],
                std_error: errors[j],
                declared: level.and_then(|level| level.declared),
            });
            continue;
        }
        parameters.push(FittedValue {
            name: p.name.clone(),
            unit: p.unit.clone(),
            value: fitted.theta[j],
            std_error: errors[j],
            // At a bound, draws may lie on one side of the value alone.
            low: spread.low[j].min(fitted.theta[j]),
            high: spread.high[j].max(fitted.theta[j]),
            at_bound: certificate.at_bound[j],
        });
    }
    (parameters, noise)
}

/// Errors of each output at the full θ.
pub(super) fn errors(
    problem: &Problem<'_>,
    theta: &[f64],
    free_runs: &[Option<Signal>],
) -> Result<Vec<OutputErrors>, FilterError> {
    let filtered = problem.filtered(theta)?;
    let outputs = problem.outline().outputs;
    let rms = |values: &[f64]| {
        (values.iter().map(|v| v * v).sum::<f64>() / values.len().max(1) as f64).sqrt()
    };
    Ok((outputs.iter().enumerate())
        .map(|(j, output)| {
            let (mut one_step, mut free, mut all) = (vec![], vec![], vec![]);
            for (r, record) in problem.records.iter().enumerate() {
                for k in 0..record.samples() {
                    let y = record.outputs()[[k, j]];
                    if !y.is_finite() {
                        continue;
                    }
                    all.push(y);
                    // The first row is predicted from the start, which a record is not to be judged by.
                    if k > 0 {
                        one_step.push(filtered[r].innovations[[k, j]]);
                    }
                    if let Some(run) = &free_runs[r] {
                        free.push(y - run[[k, j]]);
                    }
                }
            }
            OutputErrors {
                name: output.name.clone(),
                unit: output.unit.clone(),
                one_step: rms(&one_step),
                free_run: free_runs.iter().all(Option::is_some).then(|| rms(&free)),
                deviation: deviation(&all),
            }
        })
        .collect())
}

fn warnings(
    parameters: &[FittedValue],
    convergence: &Convergence,
    errors: &[OutputErrors],
) -> Vec<Warning> {
    let mut all = Vec::new();
    let mut warn = |code, what, remedy| all.push(Warning { code, what, remedy });
    if !convergence.converged {
        let what = format!(
            "the search has not arrived: {:.2} standard deviations from the top, {} of {} searches agree",
            convergence.distance, convergence.agreeing, convergence.searches
        );
        warn(
            NOT_CONVERGED,
            what,
            "narrow [prior], or fix a parameter that the record does not identify",
        );
    }
    for p in parameters {
        if let Some(side) = p.at_bound {
            let side = match side {
                Side::Low => "lower",
                Side::High => "upper",
            };
            let what = format!("{} lies at its {side} bound", p.name);
            warn(
                "at-bound",
                what,
                "widen [bounds] if other values are possible; its error means little here",
            );
        }
    }
    for e in errors {
        match e.free_run {
            None => warn(
                "free-run-diverges",
                format!("the free run of {} diverges", e.name),
                "judge by one-step errors, or look for what the twin lacks: truetwin diagnose",
            ),
            Some(rmse) if rmse >= e.deviation => warn(
                "no-better-than-constant",
                format!("the free run of {} is no better than a constant", e.name),
                "look for what the twin lacks: truetwin diagnose",
            ),
            Some(_) => {}
        }
    }
    all
}
