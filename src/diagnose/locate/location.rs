//! Location of a gap: targets, equations and maps.

use crate::diagnose::context::Context;
use crate::diagnose::detect::Detected;
use crate::diagnose::error::DiagnoseError;
use crate::diagnose::explain::attribute::{Explanation, probabilities};
use crate::diagnose::explain::decide::Conclusion;
use crate::diagnose::locate::discover::discover;
use crate::diagnose::locate::missing_term::{apart, disturbances, equations, missing_term};
use crate::diagnose::locate::onset::onset;
use crate::diagnose::outcome::{Band, Cell, Channel, Lag, Location, Maps, Region, Window};
use crate::diagnose::outcome::{Decision, Discovery, TargetShare};
use crate::diagnose::residuals::cut::Cut;
use crate::diagnose::residuals::cut::Past;
use crate::diagnose::residuals::shares::shares;
use crate::diagnose::test::fitted_twin::FittedTwin;
use crate::diagnose::test::null::Test;
use crate::likelihood::kalman::{Filtered, recoverable};
use crate::progress::Progress;
use crate::twin::Noise;

/// Locates a structural gap; where nothing listed is accepted, also regresses the missing term.
pub(in crate::diagnose) fn locate(
    context: &Context<'_>,
    detected: &Detected<'_>,
    explanations: &[Explanation],
    conclusion: &Conclusion,
    alpha: f64,
    noise: Noise,
    progress: &Progress,
) -> Result<(Location, Option<Discovery>), DiagnoseError> {
    let (model, test) = (&detected.model, &detected.test);
    let mut location = Location {
        onset: onset(model, alpha, noise)?,
        maps: maps(model, test, explanations.first())?,
        ..targets(model, explanations, test, conclusion)
    };
    let apart = if context.follows && !model.problem.is_simulated() {
        apart(
            context,
            model,
            &progress.stage("where", equations_of(model)),
        )?
    } else {
        None
    };
    let (model, explanations, test) = match &apart {
        Some((model, explanations)) => (model, explanations.as_slice(), None),
        None => (model, explanations, Some(test)),
    };
    location.equations = equations(model, explanations, test)?;
    if conclusion.decision == Decision::NoneOfThese && test.is_none() {
        // No disturbance was among the candidates: the best one says where.
        location.target = disturbances(model, explanations)
            .first()
            .map(|(e, _)| model.candidate(e).target.clone());
    }
    let discovery = match conclusion.decision {
        Decision::NoneOfThese => regressed(
            model,
            explanations,
            location.target.as_deref(),
            noise.child("discover"),
        )?,
        _ => None,
    };
    Ok((location, discovery))
}

/// Number of equations of the twin.
fn equations_of(model: &FittedTwin<'_>) -> usize {
    model.bins.states + model.problem.twin.signals().outputs.len()
}

/// Regresses the missing term in the equation of the named target, or else in the most probable one.
fn regressed(
    model: &FittedTwin<'_>,
    explanations: &[Explanation],
    target: Option<&str>,
    noise: Noise,
) -> Result<Option<Discovery>, DiagnoseError> {
    let all = disturbances(model, explanations);
    let name = |e: &Explanation| &model.candidate(e).target;
    let named = all.iter().find(|(e, _)| Some(name(e).as_str()) == target);
    let Some((explanation, _)) = named.or(all.first()) else {
        return Ok(None);
    };
    let term = missing_term(model, explanation)?;
    Ok(term.and_then(|term| discover(&term, model.problem.records, noise)))
}

/// Targets by what explains the record there, and the one that is named.
fn targets(
    model: &FittedTwin<'_>,
    explanations: &[Explanation],
    test: &Test,
    conclusion: &Conclusion,
) -> Location {
    let candidates = &model.dictionary.candidates;
    let chances = probabilities(explanations);
    let mut targets: Vec<TargetShare> = vec![];
    for (e, chance) in explanations.iter().zip(&chances) {
        let candidate = &candidates[e.candidate];
        let p_value = test.candidates.get(e.candidate).copied().unwrap_or(1.0);
        match targets.iter_mut().find(|t| t.target == candidate.target) {
            Some(known) => {
                known.share += chance;
                known.p_value = known.p_value.min(p_value);
            }
            None => targets.push(TargetShare {
                target: candidate.target.clone(),
                p_value,
                share: *chance,
            }),
        }
    }
    targets.sort_by(|a, b| b.share.total_cmp(&a.share));
    let target = match conclusion.accepted.first() {
        Some(accepted) => Some(accepted.target.clone()),
        None => conclusion
            .catch_all
            .clone()
            .or_else(|| targets.first().map(|t| t.target.clone())),
    };
    Location {
        target,
        targets,
        ..Location::default()
    }
}

/// Maps the difference between the records and simulations of the fitted twin. `best` divides the shares by where it helps.
pub(in crate::diagnose) fn maps(
    model: &FittedTwin<'_>,
    test: &Test,
    best: Option<&Explanation>,
) -> Result<Maps, DiagnoseError> {
    let states = model.problem.states(&model.fitted.theta)?;
    let after: Option<Vec<Filtered>> = match best {
        Some(best) => recoverable(model.explained(best).filtered(&best.fitted.theta))?,
        None => None,
    };
    let records = model.problem.records;
    let shares = shares(&model.bins, &states, records, after.as_deref());
    let signals = model.problem.twin.signals();
    let output = |channel: usize| signals.outputs[channel].name.clone();
    let dt = records[0].drive().dt();
    let mut maps = Maps::default();
    for ((cut, &p_value), share) in model.bins.cuts.iter().zip(&test.local).zip(shares) {
        match *cut {
            Cut::Window {
                record,
                channel,
                from,
                to,
            } => maps.windows.push(Window {
                record,
                start: records[record].drive().time(from),
                end: records[record].drive().time(to - 1),
                channel: output(channel),
                p_value,
                share,
            }),
            Cut::Region {
                variable,
                low,
                high,
            } => maps.regions.push(Region {
                variable: model.bins.variables[variable].clone(),
                low,
                high,
                p_value,
                share,
            }),
            Cut::Channel { channel } => maps.channels.push(Channel {
                channel: output(channel),
                p_value,
                share,
            }),
            Cut::Lag {
                channel,
                past,
                from,
                to,
            } => maps.lags.push(Lag {
                channel: output(channel),
                signal: match past {
                    Past::Output(j) => output(j),
                    Past::Input(i) => signals.inputs[i].name.clone(),
                },
                from: from as f64 * dt,
                to: to as f64 * dt,
                p_value,
                share,
            }),
            Cut::Band { channel, low, high } => maps.bands.push(Band {
                channel: output(channel),
                low: low / dt,
                high: high / dt,
                p_value,
                share,
            }),
        }
    }
    clearest_first(&mut maps.windows);
    clearest_first(&mut maps.regions);
    clearest_first(&mut maps.channels);
    clearest_first(&mut maps.lags);
    clearest_first(&mut maps.bands);
    Ok(maps)
}

fn clearest_first<C: Cell>(cells: &mut [C]) {
    cells.sort_by(|a, b| {
        (b.share().total_cmp(&a.share())).then(a.p_value().total_cmp(&b.p_value()))
    });
}
