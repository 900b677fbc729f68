//! Fit of a twin to records, with fitted noise and uncertain starts.

use super::certificate::{Certificate, restarted};
use super::climb::{Fitted, climb};
use super::doubts::Doubts;
use super::evidence::evidence;
use super::follow::{FollowedRecords, steps_taken, swallowed};
use super::outcome::{
    Convergence, Fit, FitEvidence, FitSettings, FittedNoise, FittedStart, FittedValue,
};
use super::posterior::{
    DrawsAsked, FitIntervals, PosteriorRegion, PosteriorSample, posterior, table,
};
use super::problem::Problem;
use super::profile::{Profile, ProfilesOf, profiles};
use super::searched::{Searched, WithoutEffects};
use super::starts::{agreed, agreeing, polish};
use crate::fit::budget::{BUDGET, FitStages, ITERATIONS};
use crate::likelihood::kalman::FilterError;
use crate::likelihood::{Beliefs, Level, Measured};
use crate::twin::{Noise, Role, Twin};
use std::collections::BTreeSet;
use std::time::Instant;

/// Subject of a fit: a twin in its study's setting.
pub(crate) struct Subject<'a> {
    pub twin: &'a Twin,
    pub beliefs: &'a Beliefs,
}

/// Weighs the ends of searches, those of the twin of a study with noise levels in θ; `None` where it works at no start.
pub(crate) fn run(
    measured: &Measured,
    searched: Searched,
    (settings, which): (&FitSettings, ProfilesOf),
    stages: &mut FitStages,
) -> Result<Option<Fit>, FilterError> {
    let clock = Instant::now();
    let noise = settings.noise();
    let Searched {
        problem,
        mut fits,
        without,
    } = searched;
    let restarts = noise.child("restarts");
    let arrived = stages.of(false, || restarted(&problem, &mut fits, restarts))?;
    let levels = &measured.levels;
    let asked = DrawsAsked::of(settings.draws);
    let draws = match problem.is_simulated() && settings.draws == 0 {
        true => PosteriorSample::default(),
        false => stages.of(PosteriorSample::default(), || {
            drawn(&problem, &mut fits, asked, noise)
        })?,
    };
    let Some((fitted, certificate)) =
        (fits.first().cloned()).zip(Certificate::new(&problem, &fits))
    else {
        return Ok(None);
    };
    let evidence = weighed(&problem, (&fitted, &draws, without.as_ref()), stages, noise)?;
    let gained = evidence.and_then(|evidence| evidence.gained);
    let spread = FitIntervals::new(&problem, &fitted, &draws.thetas, settings.level);
    let (mut parameters, noise_levels) = values(&problem, &fitted, &certificate, levels, &spread);
    let arrived = arrived && certificate.has_converged();
    let which = which.beside(arrived);
    let profiled = stages.of(<_>::default(), || {
        profiles(&problem, &fitted, (which, settings.level))
    })?;
    let profiles = stated(&problem, without.as_ref(), profiled, &mut parameters);
    if let Some(without) = without.as_ref().filter(|_| !problem.is_simulated()) {
        let at = (&fitted, settings.level, gained);
        stages.of((), || without.reach_off(&problem, at, &mut parameters))?;
    }
    let FollowedRecords {
        starts,
        free_runs,
        errors,
        residuals,
    } = stages.whole(|| FollowedRecords::new(&problem, &fitted.theta))?;
    let posterior = match settings.draws > 0 && draws.round.is_some() {
        true => stages.of(None, || {
            table(&problem, &draws, noise.child("starts")).map(Some)
        })?,
        false => None,
    };
    let own = measured.twin.parameters().len() - levels.len();
    let mut convergence = Convergence {
        converged: arrived,
        distance: certificate.distance,
        agreeing: certificate.agreeing,
        searches: certificate.searches,
    };
    let alone = (without.as_ref()).map(|without| without.fitted.log_likelihood);
    let ends = alone.is_none_or(|alone| fitted.log_likelihood > alone - BUDGET.below_without);
    convergence.converged &= ends;
    if !convergence.converged {
        parameters.iter_mut().for_each(FittedValue::withhold_error);
    }
    let mut doubts = Doubts::new(&problem, &fitted.theta);
    let by_step = doubts.steps(&free_runs);
    doubts.below(alone.filter(|_| !ends), fitted.log_likelihood);
    doubts.search(&convergence, by_step);
    doubts.start(measured.elsewhere.as_ref(), &residuals);
    doubts.bounds(&parameters, &noise_levels, (without.as_ref(), gained));
    doubts.runs(&errors, by_step);
    doubts.swallowed(stages.of(None, || swallowed(&problem, &fitted, levels, &errors))?);
    doubts.rounded();
    doubts.still();
    doubts.interrupted(stages.are_cut());
    Ok(Some(Fit {
        parameters,
        noise: noise_levels,
        region: PosteriorRegion::new(&problem, &fitted, &draws, told(&starts), own),
        starts,
        level: settings.level,
        log_likelihood: fitted.log_likelihood,
        evidence,
        convergence,
        errors,
        warnings: doubts.all,
        interrupted: stages.are_cut(),
        posterior,
        profiles,
        stepping: None,
        steps: steps_taken(&problem, &fitted.theta),
        samples: problem.samples(),
        seconds: clock.elapsed().as_secs_f64(),
        residuals,
        free_runs,
    }))
}

/// Evidence of a fit, and what its effects gain of it.
fn weighed(
    problem: &Problem,
    (fitted, draws, without): (&Fitted, &PosteriorSample, Option<&WithoutEffects>),
    stages: &mut FitStages,
    noise: Noise,
) -> Result<Option<FitEvidence>, FilterError> {
    let by = |draws| evidence(problem, fitted, draws, noise.child("evidence"));
    let found = match stages.of(None, || by(draws).map(Some))? {
        Some(found) => found,
        None => by(&PosteriorSample::default())?,
    };
    let gain = || match without.zip(found.as_ref()) {
        Some((without, with)) => without.gain(problem, with, noise.child("without")),
        None => Ok(None),
    };
    let gained = stages.of(None, gain)?;
    Ok(found.map(|found| FitEvidence {
        gained,
        ..found.into()
    }))
}

/// Returns what is told of the first states of the first record: value and standard error.
fn told(starts: &[FittedStart]) -> impl Fn(&str) -> Option<(f64, f64)> {
    |state| {
        let start = starts.iter().find(|start| start.name == state)?;
        Some((start.value, start.std_error))
    }
}

/// States intervals that hold both that of the posterior and that of the profile, for the named parameters; a side without an end reaches to the bound of
/// what was looked for, or to where the law of a magnitude ends.
fn stated(
    problem: &Problem,
    without: Option<&WithoutEffects>,
    (profiles, named): (Vec<Profile>, BTreeSet<String>),
    parameters: &mut [FittedValue],
) -> Vec<Profile> {
    let space = problem.twin.parameters();
    for value in parameters.iter_mut().filter(|v| named.contains(&v.name)) {
        let own = profiles.iter().find(|profile| profile.name == value.name);
        let bounds = space.position(&value.name).ok().map(|j| {
            let (shown, own) = (problem.axes[j].bounds, space[j].bounds);
            match without.and_then(|without| without.magnitudes.get(&value.name)) {
                Some(m) if shown == own => m.limits,
                _ => shown,
            }
        });
        if let Some((own, bounds)) = own.zip(bounds) {
            value.low = own.low.unwrap_or(bounds.low()).min(value.low);
            value.high = own.high.unwrap_or(bounds.high()).max(value.high);
            value.by_profile = true;
        }
    }
    profiles
}

/// Posterior draws; where they lead to a better top that no other search has found, more of these begin.
fn drawn(
    problem: &Problem,
    fits: &mut Vec<Fitted>,
    asked: DrawsAsked,
    noise: Noise,
) -> Result<PosteriorSample, FilterError> {
    let draws = followed(problem, fits, asked, noise.child("posterior"))?;
    if problem.is_simulated() || agreeing(fits) > 1 {
        return Ok(draws);
    }
    let best = fits.first().map(|fit| fit.objective);
    let more = noise.child("more searches");
    *fits = agreed(problem, fits.clone(), more, ITERATIONS)?;
    match fits.first().map(|fit| fit.objective) > best {
        true => followed(problem, fits, asked, noise.child("posterior")),
        false => Ok(draws),
    }
}

/// Posterior draws; where one of them is better than the best fit, another search begins there: the likelihood has kinks that no slope
/// leads over.
fn followed(
    problem: &Problem,
    fits: &mut Vec<Fitted>,
    asked: DrawsAsked,
    noise: Noise,
) -> Result<PosteriorSample, FilterError> {
    let mut draws = posterior(problem, fits, asked, noise)?;
    for _ in 0..BUDGET.restarts_from_draws {
        let Some(better) = draws.better.take() else {
            break;
        };
        let Some(fit) = climb(problem, &better, ITERATIONS)? else {
            break;
        };
        for fit in polish(problem, vec![fit], ITERATIONS)? {
            fits.insert(0, fit);
        }
        draws = posterior(problem, fits, asked, noise)?;
    }
    Ok(draws)
}

/// Parameters and noise levels with errors and intervals.
fn values(
    problem: &Problem,
    fitted: &Fitted,
    certificate: &Certificate,
    levels: &[Level],
    spread: &FitIntervals,
) -> (Vec<FittedValue>, Vec<FittedNoise>) {
    let space = problem.twin.parameters();
    let errors = &spread.errors;
    let (mut parameters, mut noise) = (vec![], vec![]);
    for (j, p) in space.iter().enumerate() {
        // Unknown starts of equations are integrated; they stand among the starts.
        if p.role == Role::Start && problem.axes[j].held {
            continue;
        }
        if p.role == Role::Noise {
            let level = levels.iter().find(|level| level.parameter.name == p.name);
            let own = FittedNoise {
                name: p.target().to_owned(),
                role: match level {
                    Some(level) if level.is_process => "process",
                    _ => "measurement",
                },
                unit: p.unit.clone(),
                value: fitted.theta[j],
                std_error: errors[j],
                declared: level.and_then(|level| level.declared),
                at_bound: certificate.at_bound[j],
            };
            let following = level.map_or(&[][..], |level| &level.following);
            let in_proportion = following.iter().map(|other| FittedNoise {
                name: other.state.clone(),
                unit: other.unit.clone(),
                value: own.value * other.share,
                std_error: own.std_error * other.share,
                declared: other.declared,
                ..own.clone()
            });
            noise.extend(std::iter::once(own.clone()).chain(in_proportion));
            continue;
        }
        let value = fitted.theta[j];
        if p.role == Role::Magnitude && problem.axes[j].held {
            parameters.push(FittedValue::shown(p, value));
            continue;
        }
        parameters.push(FittedValue {
            name: p.name.clone(),
            unit: p.unit.clone(),
            value,
            std_error: errors[j],
            low: spread.low[j],
            high: spread.high[j],
            by_profile: false,
            at_bound: certificate.at_bound[j],
        });
    }
    (parameters, noise)
}
