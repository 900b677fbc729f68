//! From fitted explanations to an answer: named, a class of rivals, a pair, or none of these.

use super::attribute::{Explanation, RIVALS};
use super::base_fit::ITERATIONS;
use super::candidate::{Addition, Candidate};
use super::dictionary::Dictionary;
use super::fit::fit;
use super::null::{Bench, Look};
use super::pairs::best_pair;
use super::problem::Problem;
use super::result::Decision;
use super::scales::Scales;
use super::scan::Reference;
use super::shrink::{Runner, closed};
use super::{DiagnoseError, DiagnoseSettings, Setting};
use crate::progress::Stage;
use crate::twin::{Law, Noise, Signal};

/// The structural test with the effect added: what is left below this is unexplained.
const UNEXPLAINED: f64 = 0.02;
/// Nats that a second effect must add beyond what it costs.
const WORTH_A_PAIR: f64 = 3.0;
/// Nats that two effects must be ahead of a catch-all: so many pairs are tried that some imitate anything a little better.
const PAIR_OVER_ANYTHING: f64 = 10.0;
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

impl Answer {
    /// The effects of a step, all of them and nothing else.
    fn named(step: &Step<'_>, unexplained: Option<f64>) -> Self {
        Self {
            decision: Decision::Named,
            accepted: step.accepted.clone(),
            class: step.accepted.iter().map(Accepted::key).collect(),
            unexplained,
            catch_all: None,
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

/// The bench of a twin with effects, whose fit is `explanation` on `bench`.
pub(super) fn grown<'a>(
    setting: &Setting<'a>,
    bench: &Bench<'a>,
    accepted: &[Accepted],
    explanation: &Explanation,
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

/// Decides about a structural gap.
pub(super) fn decide<'a>(
    setting: &Setting<'a>,
    bench: &Bench<'a>,
    found: &[Explanation],
    settings: &DiagnoseSettings,
    noise: Noise,
    stage: &Stage,
) -> Result<(Answer, Option<Step<'a>>), DiagnoseError> {
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
    let nothing = |unexplained| Answer {
        decision: Decision::NoneOfThese,
        accepted: vec![],
        class: vec![],
        unexplained,
        catch_all: catch_name.clone(),
    };
    let Some(&first) = listed.first() else {
        return Ok((nothing(None), None));
    };
    // The best listed effect alone.
    let mut unexplained = None;
    let Some(step) = grown(setting, bench, &[], first)? else {
        return Ok((nothing(None), None));
    };
    let single = noise.child("unexplained");
    let mut first_look: Option<Look> = None;
    if let Some((p, look)) = left_over(setting, &step.bench, settings, single, stage)? {
        unexplained = Some(p);
        first_look = Some(look);
        if p > UNEXPLAINED && !beaten(first.score(), candidates[first.candidate].is_noise()) {
            let class: Vec<String> = (listed.iter())
                .filter(|e| e.score() >= first.score() - RIVALS)
                .map(|e| candidates[e.candidate].key())
                .collect();
            let decision = match class.len() {
                1 => Decision::Named,
                _ => Decision::Class,
            };
            let answer = Answer {
                decision,
                class,
                ..Answer::named(&step, unexplained)
            };
            return Ok((answer, Some(step)));
        }
    }
    if let Some(pair) = best_pair(setting, bench, &listed, (&step, first_look.as_ref()), stage)?
        && pair.score > first.score() + WORTH_A_PAIR
        && !beaten(
            pair.score - PAIR_OVER_ANYTHING,
            pair.accepted.iter().any(|a| a.is_noise()),
        )
        && let Some((p, _)) =
            left_over(setting, &pair.bench, settings, single.child("pair"), stage)?
    {
        unexplained = Some(p);
        if p > UNEXPLAINED || improves(setting, bench, &pair, single)? {
            return Ok((Answer::named(&pair, unexplained), Some(pair)));
        }
    }
    // A single effect that leaves something, but follows a record never seen much better.
    if improves(setting, bench, &step, noise)? {
        return Ok((Answer::named(&step, unexplained), Some(step)));
    }
    Ok((nothing(unexplained), None))
}

/// The structural test of a twin with effects, on the records and, where nothing is left there, on these and the validation
/// record together: the smaller p-value, and how the records look.
fn left_over<'a>(
    setting: &Setting<'a>,
    bench: &Bench<'a>,
    settings: &DiagnoseSettings,
    noise: Noise,
    stage: &Stage,
) -> Result<Option<(f64, Look)>, DiagnoseError> {
    let count = settings.unexplained;
    let Some(nulls) = bench.nulls(count, UNEXPLAINED, noise.child("records"), stage)? else {
        return Ok(None);
    };
    let p = nulls.test().p_value;
    let Some(records) = setting.together.filter(|_| p > UNEXPLAINED) else {
        return Ok(Some((p, nulls.own)));
    };
    let there = bench.problem.on(records);
    let mut start = there.full(&bench.problem.of_record(0, &bench.fitted.theta));
    for r in 0..bench.problem.records.len() {
        let own = bench.problem.of_record(r, &bench.fitted.theta);
        there.place(r, &own, &mut start);
    }
    let Some(fitted) = fit(&there, &[start], ITERATIONS)? else {
        return Ok(Some((p, nulls.own)));
    };
    let seen = bench.with_problem(there, fitted, |bench| {
        bench.nulls(count, UNEXPLAINED, noise.child("together"), stage)
    })?;
    let also = seen.map_or(1.0, |nulls| nulls.test().p_value);
    Ok(Some((p.min(also), nulls.own)))
}

/// Of a twin whose free run is to follow the record: whether it follows the validation record better by a good part, beyond
/// chance. A real system is never explained to the last bit, and without process noise nothing else would be accepted.
fn improves(
    setting: &Setting<'_>,
    bench: &Bench<'_>,
    step: &Step<'_>,
    noise: Noise,
) -> Result<bool, DiagnoseError> {
    let Some(records) = setting.validation.filter(|_| setting.follows) else {
        return Ok(false);
    };
    let additions: Vec<Addition> = step.accepted.iter().map(|a| a.addition.clone()).collect();
    let theta = |bench: &Bench<'_>| bench.problem.of_record(0, &bench.fitted.theta);
    let before = Runner::new(setting.twin, &[], theta(bench))?.errors(&records[0], 0);
    let after = Runner::new(setting.twin, &additions, theta(&step.bench))?.errors(&records[0], 0);
    Ok(before.zip(after).is_some_and(|(before, after)| {
        let (_, interval) = closed(&before, &after, 0.0, noise.child("improves"));
        interval.is_some_and(|[low, _]| low > GOOD_PART)
    }))
}
