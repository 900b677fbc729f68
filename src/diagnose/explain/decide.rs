//! Decision among fitted explanations: one, a class of rivals, several together, or none of these.

use crate::diagnose::context::Context;
use crate::diagnose::error::DiagnoseError;
use crate::diagnose::explain::attribute::{Explanation, probabilities};
use crate::diagnose::explain::extended::{Accepted, ExtendedTwin, extend, improves};
use crate::diagnose::explain::several::{promises, several};
use crate::diagnose::outcome::Decision;
use crate::diagnose::settings::DiagnoseSettings;
use crate::diagnose::test::fitted_twin::FittedTwin;
use crate::diagnose::test::null::Test;
use crate::diagnose::test::statistics::Statistics;
use crate::diagnose::thresholds::Thresholds;
use crate::fit::climb::fit;
use crate::fit::starts::ITERATIONS;
use crate::progress::Stage;
use crate::twin::Noise;

/// Decision with the accepted fits.
pub(in crate::diagnose) struct Conclusion {
    pub decision: Decision,
    /// Accepted fits with their fitted twins' own numbering already resolved.
    pub accepted: Vec<Accepted>,
    pub class: Vec<String>,
    pub unexplained: Option<f64>,
    pub catch_all: Option<String>,
}

/// An conclusion, and the twins that it rests on.
pub(in crate::diagnose) struct Decided<'a> {
    pub conclusion: Conclusion,
    /// The twin with the accepted effects.
    pub extended: Option<ExtendedTwin<'a>>,
    /// The twin with the best listed effect, where none is accepted.
    pub best: Option<ExtendedTwin<'a>>,
    /// Test of the twin with the accepted or best effects.
    pub left: Option<Remainder>,
}

/// Structural test of a twin with effects.
pub(in crate::diagnose) struct Remainder {
    /// On the records, and on these and the validation record together: the smaller one.
    pub p_value: f64,
    /// On the records.
    pub test: Test,
    /// Statistics of the records.
    pub statistics: Statistics,
}

impl<'a> Decided<'a> {
    /// The effects of a extended; of a single one also its rivals among the listed effects with their scores.
    fn among(
        listed: &[(String, f64)],
        extended: ExtendedTwin<'a>,
        left: Option<Remainder>,
    ) -> Self {
        let score = extended.score;
        let mut decided = Self::named(extended, left);
        let conclusion = &mut decided.conclusion;
        if let [only] = &conclusion.class[..] {
            let rivals = (listed.iter())
                .filter(|(key, s)| key != only && *s >= score - Thresholds::RIVALS)
                .map(|(key, _)| key.clone());
            conclusion.class = [only.clone()].into_iter().chain(rivals).collect();
            if conclusion.class.len() > 1 {
                conclusion.decision = Decision::Class;
            }
        }
        decided
    }

    /// The effects of a extended, all of them and nothing else.
    fn named(extended: ExtendedTwin<'a>, left: Option<Remainder>) -> Self {
        Self {
            conclusion: Conclusion {
                decision: Decision::Named,
                accepted: extended.accepted.clone(),
                class: extended.accepted.iter().map(Accepted::key).collect(),
                unexplained: left.as_ref().map(|left| left.p_value),
                catch_all: None,
            },
            extended: Some(extended),
            best: None,
            left,
        }
    }
}

/// Decides about a structural gap: the best single effect, more beside it where the data ask for them, or none.
pub(in crate::diagnose) fn decide<'a>(
    context: &Context<'a>,
    model: &FittedTwin<'a>,
    explanations: &[Explanation],
    settings: &DiagnoseSettings,
    noise: Noise,
    stage: &Stage,
) -> Result<Decided<'a>, DiagnoseError> {
    let candidates = &model.dictionary.candidates;
    let listed: Vec<&Explanation> = (explanations.iter())
        .filter(|e| candidates[e.candidate].is_listed())
        .collect();
    let catch_all = explanations
        .iter()
        .find(|e| !candidates[e.candidate].is_listed());
    let catch_score = catch_all.map_or(f64::NEG_INFINITY, Explanation::score);
    let catch_name = catch_all.map(|e| candidates[e.candidate].target.clone());
    // A noise is nothing but a disturbance without memory: it must do better without the memory's price.
    let price = 0.5 * (model.problem.samples() as f64).ln();
    let beaten = |score: f64, noisy: bool| score < catch_score + if noisy { price } else { 0.0 };
    let nothing = |left: Option<Remainder>, extended| Decided {
        conclusion: Conclusion {
            decision: Decision::NoneOfThese,
            accepted: vec![],
            class: vec![],
            unexplained: left.as_ref().map(|left| left.p_value),
            catch_all: catch_name.clone(),
        },
        extended: None,
        best: extended,
        left,
    };
    let Some(&first) = listed.first() else {
        return Ok(nothing(None, None));
    };
    let keys: Vec<(String, f64)> = (listed.iter())
        .map(|e| (candidates[e.candidate].key(), e.score()))
        .collect();
    let chances = probabilities(explanations);
    let chance = (explanations.iter().zip(&chances))
        .find(|(e, _)| e.candidate == first.candidate)
        .map_or(f64::NAN, |(_, chance)| *chance);
    let Some(single) = extend(context, model, &[], first, chance)? else {
        return Ok(nothing(None, None));
    };
    let tests = noise.child("unexplained");
    let Some(left) = left_over(context, &single.model, settings, tests, stage)? else {
        return Ok(nothing(None, None));
    };
    let passes = left.p_value > Thresholds::UNEXPLAINED
        && !beaten(first.score(), candidates[first.candidate].is_noise());
    // More than one, where one is not enough, or where a second one promises much.
    if !passes || promises(&single, &left.statistics) {
        let margin = if passes {
            Thresholds::WORTH_BESIDE_SUFFICIENT
        } else {
            Thresholds::WORTH_ANOTHER
        };
        let several = several(
            context,
            model,
            &listed,
            (&single, &left.statistics),
            margin,
            noise,
            stage,
        )?;
        if let Some(extended) = several
            && !beaten(
                extended.score - Thresholds::SEVERAL_OVER_DISTURBANCE,
                extended.accepted.iter().any(Accepted::is_noise),
            )
        {
            let tests = tests.child("several");
            if let Some(rest) = left_over(context, &extended.model, settings, tests, stage)?
                && (rest.p_value > Thresholds::UNEXPLAINED
                    || (!passes && improves(context, (model, &[]), &extended, noise)?))
            {
                return Ok(Decided::among(&keys, extended, Some(rest)));
            }
        }
    }
    if passes {
        return Ok(Decided::among(&keys, single, Some(left)));
    }
    // A single effect that leaves something, but follows a record never seen much better.
    if improves(context, (model, &[]), &single, noise)? {
        return Ok(Decided::named(single, Some(left)));
    }
    Ok(nothing(Some(left), Some(single)))
}

/// The structural test of a twin with effects, on the records and, where nothing is left there, on these and the validation
/// record together.
fn left_over<'a>(
    context: &Context<'a>,
    model: &FittedTwin<'a>,
    settings: &DiagnoseSettings,
    noise: Noise,
    stage: &Stage,
) -> Result<Option<Remainder>, DiagnoseError> {
    let count = settings.unexplained;
    let Some(null) = model.null_distribution(
        count,
        Thresholds::UNEXPLAINED,
        noise.child("records"),
        stage,
    )?
    else {
        return Ok(None);
    };
    let test = null.test();
    let left = |also: f64| {
        Some(Remainder {
            p_value: test.p_value.min(also),
            test: test.clone(),
            statistics: null.own,
        })
    };
    let Some(records) = context
        .together
        .filter(|_| test.p_value > Thresholds::UNEXPLAINED)
    else {
        return Ok(left(1.0));
    };
    let (there, start) = model.on(records);
    let Some(fitted) = fit(&there, &[start], ITERATIONS)? else {
        return Ok(left(1.0));
    };
    let seen = model.with_problem(there, fitted, |model| {
        model.null_distribution(
            count,
            Thresholds::UNEXPLAINED,
            noise.child("together"),
            stage,
        )
    })?;
    Ok(left(seen.map_or(1.0, |null| null.test().p_value)))
}
