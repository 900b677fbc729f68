//! Where the gap lies: targets, and what simulations say of each cut.

use crate::diagnose::context::Context;
use crate::diagnose::detect::Detected;
use crate::diagnose::error::DiagnoseError;
use crate::diagnose::explain::attribute::{Explanation, probabilities};
use crate::diagnose::explain::decide::Answer;
use crate::diagnose::locate::discover::discover;
use crate::diagnose::locate::missing_term::{apart, disturbances, equations, missing_term};
use crate::diagnose::locate::onset::onset;
use crate::diagnose::outcome::{Band, Cell, Channel, Lag, Maps, Region, Where, Window};
use crate::diagnose::outcome::{Decision, Discovery, TargetShare};
use crate::diagnose::residuals::cut::Cut;
use crate::diagnose::residuals::cut::Past;
use crate::diagnose::residuals::shares::shares;
use crate::diagnose::test::fitted_twin::FittedTwin;
use crate::diagnose::test::null::Test;
use crate::likelihood::kalman::{Filtered, recoverable};
use crate::progress::Progress;
use crate::twin::Noise;

/// `where` of the report but for what is drawn again, and, where nothing listed is accepted, what the missing term depends on.
pub(in crate::diagnose) fn locate(
    context: &Context<'_>,
    detected: &Detected<'_>,
    found: &[Explanation],
    answer: &Answer,
    alpha: f64,
    noise: Noise,
    progress: &Progress,
) -> Result<(Where, Option<Discovery>), DiagnoseError> {
    let (bench, test) = (&detected.bench, &detected.test);
    let mut place = Where {
        onset: onset(bench, alpha, noise)?,
        maps: maps(bench, test, found.first())?,
        ..targets(bench, found, test, answer)
    };
    let shows = context.twin.equations().is_some();
    let apart = match context.follows && shows {
        true => apart(
            context,
            bench,
            &progress.stage("where", equations_of(bench)),
        )?,
        false => None,
    };
    let (bench, found, test) = match &apart {
        Some((bench, found)) => (bench, found.as_slice(), None),
        None => (bench, found, Some(test)),
    };
    place.equations = equations(bench, found, test)?;
    if answer.decision == Decision::NoneOfThese && test.is_none() {
        // No disturbance was among the candidates: the best one says where.
        place.target = disturbances(bench, found)
            .first()
            .map(|(e, _)| bench.dictionary.candidates[e.candidate].target.clone());
    }
    let discovery = match answer.decision {
        Decision::NoneOfThese => regressed(
            bench,
            found,
            place.target.as_deref(),
            noise.child("discover"),
        )?,
        _ => None,
    };
    Ok((place, discovery))
}

/// How many equations the twin has.
fn equations_of(bench: &FittedTwin<'_>) -> usize {
    bench.bins.states + bench.problem.twin.signals().outputs.len()
}

/// What the missing term depends on, in the equation of the named target, or else in the most probable one.
fn regressed(
    bench: &FittedTwin<'_>,
    found: &[Explanation],
    target: Option<&str>,
    noise: Noise,
) -> Result<Option<Discovery>, DiagnoseError> {
    let all = disturbances(bench, found);
    let name = |e: &Explanation| &bench.dictionary.candidates[e.candidate].target;
    let named = all.iter().find(|(e, _)| Some(name(e).as_str()) == target);
    let Some((explanation, _)) = named.or(all.first()) else {
        return Ok(None);
    };
    let term = missing_term(bench, explanation)?;
    Ok(term.and_then(|term| discover(&term, bench.problem.records, noise)))
}

/// Targets by what explains the record there, and the one that is named.
fn targets(bench: &FittedTwin<'_>, found: &[Explanation], test: &Test, answer: &Answer) -> Where {
    let candidates = &bench.dictionary.candidates;
    let chances = probabilities(found);
    let mut targets: Vec<TargetShare> = vec![];
    for (e, chance) in found.iter().zip(&chances) {
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
    let target = match answer.accepted.first() {
        Some(accepted) => Some(accepted.target.clone()),
        None => answer
            .catch_all
            .clone()
            .or_else(|| targets.first().map(|t| t.target.clone())),
    };
    Where {
        target,
        targets,
        ..Where::default()
    }
}

/// How the records differ from what the bench's twin makes, cut in all ways. `best`, where there is one, says when it helps.
pub(in crate::diagnose) fn maps(
    bench: &FittedTwin<'_>,
    test: &Test,
    best: Option<&Explanation>,
) -> Result<Maps, DiagnoseError> {
    let states = bench.problem.states(&bench.fitted.theta)?;
    let after: Option<Vec<Filtered>> = match best {
        Some(best) => recoverable(bench.explained(best).filtered(&best.fitted.theta))?,
        None => None,
    };
    let records = bench.problem.records;
    let shares = shares(&bench.bins, &states, records, after.as_deref());
    let signals = bench.problem.twin.signals();
    let output = |channel: usize| signals.outputs[channel].name.clone();
    let dt = records[0].drive().dt();
    let mut maps = Maps::default();
    for ((cut, &p_value), share) in bench.bins.cuts.iter().zip(&test.local).zip(shares) {
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
                variable: bench.bins.variables[variable].clone(),
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
