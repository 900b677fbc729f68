//! From fitted explanations to an answer: named, a class of rivals, a pair, or none of these.

use crate::diagnose::context::Context;
use crate::diagnose::error::DiagnoseError;
use crate::diagnose::explain::attribute::{Explanation, probabilities};
use crate::diagnose::explain::several::{promises, several};
use crate::diagnose::explain::step::{Accepted, Step, grown, improves};
use crate::diagnose::fitting::base_fit::ITERATIONS;
use crate::diagnose::fitting::climb::fit;
use crate::diagnose::outcome::Decision;
use crate::diagnose::settings::DiagnoseSettings;
use crate::diagnose::test::fitted_twin::FittedTwin;
use crate::diagnose::test::null::Test;
use crate::diagnose::test::statistics::Statistics;
use crate::diagnose::thresholds::Thresholds;
use crate::progress::Stage;
use crate::twin::Noise;

/// What was decided, and with which fits.
pub(in crate::diagnose) struct Answer {
    pub decision: Decision,
    /// Accepted fits with their benches' own numbering already resolved.
    pub accepted: Vec<Accepted>,
    pub class: Vec<String>,
    pub unexplained: Option<f64>,
    pub catch_all: Option<String>,
}

/// An answer, and the twins that it rests on.
pub(in crate::diagnose) struct Decided<'a> {
    pub answer: Answer,
    /// The twin with the accepted effects.
    pub step: Option<Step<'a>>,
    /// Where none is accepted: the twin with the best listed effect.
    pub best: Option<Step<'a>>,
    /// What the one or the other leaves.
    pub left: Option<Left>,
}

/// What a twin with effects leaves unexplained.
pub(in crate::diagnose) struct Left {
    /// On the records, and on these and the validation record together: the smaller one.
    pub p_value: f64,
    /// On the records.
    pub test: Test,
    /// How the records look.
    pub look: Statistics,
}

impl<'a> Decided<'a> {
    /// The effects of a step; of a single one also its rivals among the listed effects with their scores.
    fn among(listed: &[(String, f64)], step: Step<'a>, left: Option<Left>) -> Self {
        let score = step.score;
        let mut decided = Self::named(step, left);
        let answer = &mut decided.answer;
        if let [only] = &answer.class[..] {
            let rivals = (listed.iter())
                .filter(|(key, s)| key != only && *s >= score - Thresholds::RIVALS)
                .map(|(key, _)| key.clone());
            answer.class = [only.clone()].into_iter().chain(rivals).collect();
            if answer.class.len() > 1 {
                answer.decision = Decision::Class;
            }
        }
        decided
    }

    /// The effects of a step, all of them and nothing else.
    fn named(step: Step<'a>, left: Option<Left>) -> Self {
        Self {
            answer: Answer {
                decision: Decision::Named,
                accepted: step.accepted.clone(),
                class: step.accepted.iter().map(Accepted::key).collect(),
                unexplained: left.as_ref().map(|left| left.p_value),
                catch_all: None,
            },
            step: Some(step),
            best: None,
            left,
        }
    }
}

/// Decides about a structural gap: the best single effect, more beside it where the data ask for them, or none.
pub(in crate::diagnose) fn decide<'a>(
    context: &Context<'a>,
    bench: &FittedTwin<'a>,
    found: &[Explanation],
    settings: &DiagnoseSettings,
    noise: Noise,
    stage: &Stage,
) -> Result<Decided<'a>, DiagnoseError> {
    let candidates = &bench.dictionary.candidates;
    let listed: Vec<&Explanation> = (found.iter())
        .filter(|e| candidates[e.candidate].is_listed())
        .collect();
    let catch_all = found.iter().find(|e| !candidates[e.candidate].is_listed());
    let catch_score = catch_all.map_or(f64::NEG_INFINITY, Explanation::score);
    let catch_name = catch_all.map(|e| candidates[e.candidate].target.clone());
    // A noise is nothing but a disturbance without memory: it must do better without the memory's price.
    let price = 0.5 * (bench.problem.samples() as f64).ln();
    let beaten = |score: f64, noisy: bool| score < catch_score + if noisy { price } else { 0.0 };
    let nothing = |left: Option<Left>, step| Decided {
        answer: Answer {
            decision: Decision::NoneOfThese,
            accepted: vec![],
            class: vec![],
            unexplained: left.as_ref().map(|left| left.p_value),
            catch_all: catch_name.clone(),
        },
        step: None,
        best: step,
        left,
    };
    let Some(&first) = listed.first() else {
        return Ok(nothing(None, None));
    };
    let keys: Vec<(String, f64)> = (listed.iter())
        .map(|e| (candidates[e.candidate].key(), e.score()))
        .collect();
    let chances = probabilities(found);
    let chance = (found.iter().zip(&chances))
        .find(|(e, _)| e.candidate == first.candidate)
        .map_or(f64::NAN, |(_, chance)| *chance);
    let Some(single) = grown(context, bench, &[], first, chance)? else {
        return Ok(nothing(None, None));
    };
    let tests = noise.child("unexplained");
    let Some(left) = left_over(context, &single.bench, settings, tests, stage)? else {
        return Ok(nothing(None, None));
    };
    let passes = left.p_value > Thresholds::UNEXPLAINED
        && !beaten(first.score(), candidates[first.candidate].is_noise());
    // More than one, where one is not enough, or where a second one promises much.
    if !passes || promises(&single, &left.look) {
        let margin = if passes {
            Thresholds::WORTH_BESIDE_SUFFICIENT
        } else {
            Thresholds::WORTH_ANOTHER
        };
        let several = several(
            context,
            bench,
            &listed,
            (&single, &left.look),
            margin,
            noise,
            stage,
        )?;
        if let Some(step) = several
            && !beaten(
                step.score - Thresholds::SEVERAL_OVER_DISTURBANCE,
                step.accepted.iter().any(Accepted::is_noise),
            )
        {
            let tests = tests.child("several");
            if let Some(rest) = left_over(context, &step.bench, settings, tests, stage)?
                && (rest.p_value > Thresholds::UNEXPLAINED
                    || (!passes && improves(context, (bench, &[]), &step, noise)?))
            {
                return Ok(Decided::among(&keys, step, Some(rest)));
            }
        }
    }
    if passes {
        return Ok(Decided::among(&keys, single, Some(left)));
    }
    // A single effect that leaves something, but follows a record never seen much better.
    if improves(context, (bench, &[]), &single, noise)? {
        return Ok(Decided::named(single, Some(left)));
    }
    Ok(nothing(Some(left), Some(single)))
}

/// The structural test of a twin with effects, on the records and, where nothing is left there, on these and the validation
/// record together.
fn left_over<'a>(
    context: &Context<'a>,
    bench: &FittedTwin<'a>,
    settings: &DiagnoseSettings,
    noise: Noise,
    stage: &Stage,
) -> Result<Option<Left>, DiagnoseError> {
    let count = settings.unexplained;
    let Some(nulls) = bench.nulls(
        count,
        Thresholds::UNEXPLAINED,
        noise.child("records"),
        stage,
    )?
    else {
        return Ok(None);
    };
    let test = nulls.test();
    let left = |also: f64| {
        Some(Left {
            p_value: test.p_value.min(also),
            test: test.clone(),
            look: nulls.own,
        })
    };
    let Some(records) = context
        .together
        .filter(|_| test.p_value > Thresholds::UNEXPLAINED)
    else {
        return Ok(left(1.0));
    };
    let (there, start) = bench.on(records);
    let Some(fitted) = fit(&there, &[start], ITERATIONS)? else {
        return Ok(left(1.0));
    };
    let seen = bench.with_problem(there, fitted, |bench| {
        bench.nulls(
            count,
            Thresholds::UNEXPLAINED,
            noise.child("together"),
            stage,
        )
    })?;
    Ok(left(seen.map_or(1.0, |nulls| nulls.test().p_value)))
}
