//! From fitted explanations to an answer: named, a class of rivals, a pair, or none of these.

use super::attribute::{Explanation, RIVALS, probabilities};
use super::base_fit::ITERATIONS;
use super::candidate::{Addition, Candidate};
use super::dictionary::Dictionary;
use super::fit::fit;
use super::null::{Bench, Look, Test};
use super::problem::Problem;
use super::result::Decision;
use super::scales::Scales;
use super::scan::Reference;
use super::several::{promises, several};
use super::shrink::{Runner, closed};
use super::{DiagnoseError, DiagnoseSettings, Setting};
use crate::effect::Law;
use crate::progress::Stage;
use crate::record::Signal;
use crate::twin::Noise;

/// The structural test with the effect added: what is left below this is unexplained.
const UNEXPLAINED: f64 = 0.02;
/// Nats that another effect must add beyond what it costs, and beside an effect that leaves nothing unexplained.
pub(super) const WORTH_ANOTHER: f64 = 3.0;
const WORTH_BESIDE_A_GOOD_ONE: f64 = 8.0;
/// Nats that several effects must be ahead of a catch-all: so many are tried that some imitate anything a little better.
const SEVERAL_OVER_ANYTHING: f64 = 10.0;
/// Least share of the free-run error that effects must take off where something is left unexplained.
const GOOD_PART: f64 = 0.1;

/// What was decided, and with which fits.
pub(super) struct Answer {
    pub decision: Decision,
    /// Accepted fits with their benches' own numbering already resolved.
    pub accepted: Vec<Accepted>,
    pub class: Vec<String>,
    pub unexplained: Option<f64>,
    pub catch_all: Option<String>,
}

/// An answer, and the twins that it rests on.
pub(super) struct Decided<'a> {
    pub answer: Answer,
    /// The twin with the accepted effects.
    pub step: Option<Step<'a>>,
    /// Where none is accepted: the twin with the best listed effect.
    pub best: Option<Step<'a>>,
    /// What the one or the other leaves.
    pub left: Option<Left>,
}

/// What a twin with effects leaves unexplained.
pub(super) struct Left {
    /// On the records, and on these and the validation record together: the smaller one.
    pub p_value: f64,
    /// On the records.
    pub test: Test,
    /// How the records look.
    pub look: Look,
}

impl<'a> Decided<'a> {
    /// The effects of a step; of a single one also its rivals among the listed effects with their scores.
    fn among(listed: &[(String, f64)], step: Step<'a>, left: Option<Left>) -> Self {
        let score = step.score;
        let mut decided = Self::named(step, left);
        let answer = &mut decided.answer;
        if let [only] = &answer.class[..] {
            let rivals = (listed.iter())
                .filter(|(key, s)| key != only && *s >= score - RIVALS)
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

/// One accepted effect.
#[derive(Clone)]
pub(super) struct Accepted {
    pub addition: Addition,
    pub id: String,
    pub target: String,
    pub magnitudes: Vec<(String, f64)>,
    /// Nats that it adds.
    pub gain: f64,
    /// Among all that was tried in its place.
    pub probability: f64,
}

impl Accepted {
    pub fn key(&self) -> String {
        format!("{}@{}", self.id, self.target)
    }

    /// Whether only the noise is changed, so that no free run moves.
    pub fn is_noise(&self) -> bool {
        matches!(
            self.addition.effect.law(),
            Law::MeasurementNoise | Law::ProcessNoise | Law::Outliers
        )
    }
}

/// A twin with accepted effects, fitted.
pub(super) struct Step<'a> {
    pub bench: Bench<'a>,
    pub accepted: Vec<Accepted>,
    /// Score over the twin alone.
    pub score: f64,
}

/// The bench of a twin with effects, whose fit is `explanation` on `bench`, with its probability there.
pub(super) fn grown<'a>(
    setting: &Setting<'a>,
    bench: &Bench<'a>,
    accepted: &[Accepted],
    explanation: &Explanation,
    probability: f64,
) -> Result<Option<Step<'a>>, DiagnoseError> {
    let Some(addition) = bench.addition(explanation) else {
        return Ok(None);
    };
    let variant = &bench.dictionary.variants[explanation.variant];
    let candidate = &bench.dictionary.candidates[explanation.candidate];
    let mut all = accepted.to_vec();
    all.push(Accepted {
        addition,
        id: candidate.id.clone(),
        target: candidate.target.clone(),
        magnitudes: magnitudes(bench, explanation),
        gain: explanation.gain + explanation.validation.unwrap_or(0.0),
        probability,
    });
    let additions: Vec<Addition> = all.iter().map(|a| a.addition.clone()).collect();
    let left: Vec<Candidate> = (bench.dictionary.candidates.iter())
        .filter(|c| !c.is_listed() || !all.iter().any(|a| a.key() == c.key()))
        .cloned()
        .collect();
    let problem = variant.problem(&bench.problem);
    let Some(bench) = setting.bench(problem, explanation.fitted.clone(), &additions, left)? else {
        return Ok(None);
    };
    Ok(Some(Step {
        bench,
        accepted: all,
        score: explanation.score(),
    }))
}

impl<'a> Setting<'a> {
    /// Everything that is needed to look at a fitted twin; `None` where it cannot be filtered around the fit.
    pub fn bench(
        &self,
        problem: Problem<'a>,
        fitted: super::fit::Fitted,
        additions: &[Addition],
        candidates: Vec<Candidate>,
    ) -> Result<Option<Bench<'a>>, DiagnoseError> {
        let states = problem.states(&fitted.theta)?;
        let bins = super::localise::Bins::new(&problem.outline(), &states, problem.records);
        let Some(reference) = Reference::new(&problem, &fitted.theta)? else {
            return Ok(None);
        };
        let means: Vec<Signal> = states.into_iter().map(|(_, s)| s).collect();
        let scales = Scales {
            records: problem.records,
            states: &means,
        };
        let dictionary = Dictionary::new(
            self.twin,
            additions,
            candidates,
            &problem,
            &fitted.theta,
            &reference,
            &scales,
        )?;
        Ok(Some(Bench {
            problem,
            fitted,
            dictionary: std::sync::Arc::new(dictionary),
            bins,
        }))
    }
}

/// Names and values of an explanation's magnitudes, those held at their off values included.
pub(super) fn magnitudes(bench: &Bench<'_>, explanation: &Explanation) -> Vec<(String, f64)> {
    let candidate = &bench.dictionary.candidates[explanation.candidate];
    let variant = &bench.dictionary.variants[explanation.variant];
    let problem = variant.problem(&bench.problem);
    let theta = problem.of_record(0, &explanation.fitted.theta);
    let mut free = theta[theta.len() - variant.free.len()..].iter();
    (candidate.magnitudes().into_iter())
        .map(|m| {
            let value = (variant.held.get(m.name).copied())
                .unwrap_or_else(|| free.next().copied().unwrap_or(f64::NAN));
            (m.name.to_owned(), value)
        })
        .collect()
}

/// Decides about a structural gap: the best single effect, more beside it where the data ask for them, or none.
pub(super) fn decide<'a>(
    setting: &Setting<'a>,
    bench: &Bench<'a>,
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
    let Some(single) = grown(setting, bench, &[], first, chance)? else {
        return Ok(nothing(None, None));
    };
    let tests = noise.child("unexplained");
    let Some(left) = left_over(setting, &single.bench, settings, tests, stage)? else {
        return Ok(nothing(None, None));
    };
    let passes = left.p_value > UNEXPLAINED
        && !beaten(first.score(), candidates[first.candidate].is_noise());
    // More than one, where one is not enough, or where a second one promises much.
    if !passes || promises(&single, &left.look) {
        let margin = if passes {
            WORTH_BESIDE_A_GOOD_ONE
        } else {
            WORTH_ANOTHER
        };
        let several = several(
            setting,
            bench,
            &listed,
            (&single, &left.look),
            margin,
            noise,
            stage,
        )?;
        if let Some(step) = several
            && !beaten(
                step.score - SEVERAL_OVER_ANYTHING,
                step.accepted.iter().any(Accepted::is_noise),
            )
        {
            let tests = tests.child("several");
            if let Some(rest) = left_over(setting, &step.bench, settings, tests, stage)?
                && (rest.p_value > UNEXPLAINED
                    || (!passes && improves(setting, (bench, &[]), &step, noise)?))
            {
                return Ok(Decided::among(&keys, step, Some(rest)));
            }
        }
    }
    if passes {
        return Ok(Decided::among(&keys, single, Some(left)));
    }
    // A single effect that leaves something, but follows a record never seen much better.
    if improves(setting, (bench, &[]), &single, noise)? {
        return Ok(Decided::named(single, Some(left)));
    }
    Ok(nothing(Some(left), Some(single)))
}

/// The structural test of a twin with effects, on the records and, where nothing is left there, on these and the validation
/// record together.
fn left_over<'a>(
    setting: &Setting<'a>,
    bench: &Bench<'a>,
    settings: &DiagnoseSettings,
    noise: Noise,
    stage: &Stage,
) -> Result<Option<Left>, DiagnoseError> {
    let count = settings.unexplained;
    let Some(nulls) = bench.nulls(count, UNEXPLAINED, noise.child("records"), stage)? else {
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
    let Some(records) = setting.together.filter(|_| test.p_value > UNEXPLAINED) else {
        return Ok(left(1.0));
    };
    let (there, start) = bench.on(records);
    let Some(fitted) = fit(&there, &[start], ITERATIONS)? else {
        return Ok(left(1.0));
    };
    let seen = bench.with_problem(there, fitted, |bench| {
        bench.nulls(count, UNEXPLAINED, noise.child("together"), stage)
    })?;
    Ok(left(seen.map_or(1.0, |nulls| nulls.test().p_value)))
}

/// Of a twin whose free run is to follow the record: whether a step's effects let it follow the validation record better than
/// those `before` by a good part, beyond chance. A real system is never explained to the last bit, and without process noise
/// nothing else would be accepted.
pub(super) fn improves(
    setting: &Setting<'_>,
    (bench, before): (&Bench<'_>, &[Accepted]),
    step: &Step<'_>,
    noise: Noise,
) -> Result<bool, DiagnoseError> {
    let Some(records) = setting.validation.filter(|_| setting.follows) else {
        return Ok(false);
    };
    let errors = |bench: &Bench<'_>, accepted: &[Accepted]| -> Result<_, DiagnoseError> {
        let additions: Vec<Addition> = accepted.iter().map(|a| a.addition.clone()).collect();
        let theta = bench.problem.of_record(0, &bench.fitted.theta);
        Ok(Runner::new(setting.twin, &additions, theta)?.errors(&records[0], 0))
    };
    let (before, after) = (errors(bench, before)?, errors(&step.bench, &step.accepted)?);
    Ok(before.zip(after).is_some_and(|(before, after)| {
        let (_, interval) = closed(&before, &after, 0.0, noise.child("improves"));
        interval.is_some_and(|[low, _]| low > GOOD_PART)
    }))
}
