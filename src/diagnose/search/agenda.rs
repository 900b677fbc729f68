//! The next question of a search, from what is known: a pure function of it.

use super::Search;
use super::evidence::{Evidence, Purpose, Question};
use super::explanations::is_noise_apart;
use crate::diagnose::thresholds::THRESHOLDS;
use crate::hypothesis::search::explanation::Explanation;
use crate::hypothesis::search::{Breadth, SEARCH};
use crate::hypothesis::set::TermSet;

/// Stage of a search; each ends with a step of progress.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Stage {
    Functions,
    Effects,
    Noise,
    Remains,
    Pairs,
    /// Functions beside the sets that may be accepted, once the twin stays as it is.
    Rest,
}

/// Knowledge with which a search begins.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Begin {
    Afresh,
    /// Fits beside a worse fit of the same twin.
    WithFits,
    /// Explanations carried on from the same twin with another step.
    Carried,
}

impl<E: Evidence> Search<E> {
    /// The next question of a stage; `None` once there is no more to ask.
    pub(super) fn next(&self, stage: Stage) -> Option<Question> {
        match stage {
            Stage::Functions => self.functions(),
            Stage::Effects => self.effects(),
            Stage::Noise => self.noise(),
            Stage::Remains => self.remains(),
            Stage::Pairs => self.pairs(),
            Stage::Rest => self.rest(),
        }
    }

    fn functions(&self) -> Option<Question> {
        let question = self.ask(Purpose::Functions, TermSet::default())?;
        Some(match self.begin {
            Begin::Afresh => question,
            Begin::WithFits => question.with(Breadth::few),
            Begin::Carried => {
                let best = keys(self.known.unknown().into_iter().take(SEARCH.few_functions));
                question
                    .only(best)
                    .from(self.best_listed())
                    .with(Breadth::few)
            }
        })
    }

    fn effects(&self) -> Option<Question> {
        let gap = self.known.best_unknown();
        let all = |breadth: Breadth| breadth.for_gap(gap).of_all().afresh();
        if let Some(question) = self.ask(Purpose::Effects, TermSet::default()) {
            return Some(match self.begin {
                Begin::Afresh if gap > SEARCH.null_like => question.with(all),
                Begin::Afresh => question.with(|breadth| breadth.for_gap(gap)),
                Begin::WithFits => question.with(Breadth::of_all),
                Begin::Carried => question.only(keys(self.standing_out().into_iter())),
            });
        }
        // A fit that has nothing to answer for is where it should be.
        let is_missed = gap <= SEARCH.null_like && self.known.top() > SEARCH.null_like;
        let asks = self.begin == Begin::Afresh && is_missed;
        let question = asks.then(|| self.ask(Purpose::AllEffects, TermSet::default()))??;
        Some(question.with(all))
    }

    fn noise(&self) -> Option<Question> {
        if self.begin == Begin::Carried {
            return None;
        }
        let listed = self.known.listed();
        let best = listed
            .first()
            .filter(|e| self.known.gain(e) > THRESHOLDS.wider);
        let wider = best.and_then(|_| self.ask(Purpose::WiderFunctions, TermSet::default()));
        if let Some(question) = wider {
            return Some(question.from(self.best_listed()).with(Breadth::few));
        }
        if let Some(question) = self.ask(Purpose::Noise, TermSet::default()) {
            return Some(question.with(Breadth::of_all));
        }
        let noise = self.known.noise();
        let likely = noise
            .first()
            .filter(|e| self.known.gain(e) > THRESHOLDS.noise);
        if let Some(question) = likely.and_then(|e| self.ask(Purpose::NoisePairs, e.set())) {
            return Some(question.with(Breadth::of_all));
        }
        let best = best?;
        let question = self.ask(Purpose::Outliers, best.set())?;
        let outliers = noise.into_iter().filter(|e| is_noise_apart(e, best));
        Some(question.only(keys(outliers)).with(Breadth::of_all))
    }

    /// Asks what single effects leave, until one leaves nothing.
    fn remains(&self) -> Option<Question> {
        if self.begin == Begin::Carried || !self.looks_beside() {
            return None;
        }
        let near = self.known.top() - SEARCH.candidates;
        for effect in self.known.listed().into_iter().take(self.budget.singles) {
            let may_suffice = self.known.gain(effect) >= near && self.may_suffice(effect);
            if !may_suffice || self.known.suffices(effect) == Some(true) {
                return None;
            }
            if let Some(question) = self.ask_remains(effect) {
                return Some(question);
            }
        }
        None
    }

    /// Asks for second effects, and for noise in their place.
    fn pairs(&self) -> Option<Question> {
        if !self.looks_beside() {
            return None;
        }
        let is_new = self.begin != Begin::Carried;
        if is_new
            && self.evidence.breadth().pairs
            && let Some(question) = self.seconds().or_else(|| self.rivals_of_pair())
        {
            return Some(question);
        }
        let pair = self.known.winning_pair()?;
        if let Some(question) = self.ask(Purpose::Singles, TermSet::default()) {
            let keys = pair.terms.iter().map(|term| term.key()).collect();
            let question = question.only(keys).from(vec![pair.set()]);
            return Some(question.with(|breadth| self.for_gap(breadth).of_all()));
        }
        if !is_new {
            return None;
        }
        let singles = self.known.singles_of(pair).into_iter();
        let mut questions = singles.filter_map(|e| self.ask(Purpose::NoiseInstead, e.set()));
        if let Some(question) = questions.next() {
            return Some(question.with(Breadth::of_all));
        }
        self.ask_remains(self.known.noise_instead_of_second()?)
    }

    /// Second effects beside the best single ones, or beside one that leaves nothing.
    fn seconds(&self) -> Option<Question> {
        let listed = self.known.listed();
        let enough = listed.iter().find(|e| self.known.suffices(e) == Some(true));
        let least = self.budget.stands_out * self.known.top();
        let firsts: Vec<&Explanation> = match enough {
            Some(enough) => vec![*enough],
            None => (listed.iter().take(self.budget.singles))
                .filter(|e| self.known.gain(e) > least)
                .copied()
                .collect(),
        };
        let question = (firsts.into_iter()).find_map(|e| self.ask(Purpose::Pairs, e.set()))?;
        let count = self.budget.seconds[usize::from(enough.is_some())];
        let question = question.from(self.best_listed());
        Some(question.with(|breadth| Breadth {
            listed: count,
            annealed: count.min(breadth.annealed),
            least: self.budget.least_second,
            ..self.for_gap(breadth)
        }))
    }

    /// The second effect of a pair that wins beside the rivals of the first.
    fn rivals_of_pair(&self) -> Option<Question> {
        let pair = self.known.winning_pair()?;
        let [first, second] = &pair.terms[..] else {
            return None;
        };
        let alone = self.known.get(&TermSet::of(std::slice::from_ref(first)));
        let least = alone.map_or(self.known.top(), |e| self.known.gain(e)) - THRESHOLDS.rivals;
        let rivals = (self.known.listed().into_iter())
            .filter(|e| self.known.gain(e) > least)
            .filter(|e| ![first.key(), second.key()].contains(&e.last().key()));
        let mut rivals = rivals.take(self.budget.singles);
        let question = rivals.find_map(|e| self.ask(Purpose::RivalPairs, e.set()))?;
        let question = question.only(vec![second.key()]).from(self.best_listed());
        Some(question.with(|breadth| self.for_gap(breadth)))
    }

    /// Asks what remains beside the best sets.
    fn rest(&self) -> Option<Question> {
        if !self.looks_beside() {
            return None;
        }
        let known = &self.known;
        let best = known.listed().into_iter().next()?;
        if let Some(question) = (self.may_suffice(best).then(|| self.ask_remains(best))).flatten() {
            return Some(question);
        }
        let pairs = known.pairs();
        for (i, pair) in pairs.iter().take(self.budget.pairs).enumerate() {
            let is_near = pair.log_z > pairs[0].log_z - SEARCH.candidates;
            if !known.wins(pair) || i > 0 && !(is_near && self.may_suffice(pair)) {
                break;
            }
            if let Some(question) = self.ask_remains(pair) {
                return Some(question);
            }
            if known.suffices(pair) == Some(true) {
                break;
            }
        }
        let mut sets = known.listed().into_iter().chain(pairs);
        let enough = sets.any(|e| known.suffices(e) == Some(true));
        // What explains most may do so beside something unknown, which is also a rival of the second effect of a pair; and a function may
        // speak for a rival of the best effect.
        let first = known
            .winning_pair()
            .and_then(|pair| known.singles_of(pair).first().copied());
        let best = (!enough).then_some(best);
        let others = [best, first, self.likeliest_single()];
        (others.into_iter().flatten()).find_map(|e| self.ask_remains(e))
    }

    /// The most probable of the best single effect and its rivals.
    fn likeliest_single(&self) -> Option<&Explanation> {
        let posterior = self.known.posterior();
        let near = self.known.top() - THRESHOLDS.rivals;
        let rivals = self
            .known
            .listed()
            .into_iter()
            .filter(|e| self.known.gain(e) > near);
        let probability = |e: &Explanation| posterior.name(&e.last().key());
        rivals.max_by(|a, b| probability(a).total_cmp(&probability(b)))
    }

    /// A question that was not asked yet.
    fn ask(&self, purpose: Purpose, beside: TermSet) -> Option<Question> {
        let is_new = !self.asked.contains(&(purpose, beside.clone()));
        is_new.then(|| Question {
            purpose,
            beside,
            only: None,
            from: vec![],
            breadth: self.evidence.breadth(),
        })
    }

    fn ask_remains(&self, explanation: &Explanation) -> Option<Question> {
        let question = self.ask(Purpose::Remains, explanation.set())?;
        let question = question.from(vec![explanation.set()]);
        Some(question.with(|breadth| self.for_gap(breadth).few()))
    }

    /// Effort for a gap as large as the best unknown function tells.
    fn for_gap(&self, breadth: Breadth) -> Breadth {
        breadth.for_gap(self.known.best_unknown())
    }

    /// Returns whether the search goes on to pairs and remains: something is missing, and no other kind of noise comes first. Where that
    /// explains as much as one effect, two may explain more.
    fn looks_beside(&self) -> bool {
        !self.detection_only
            && self.known.log_odds_alone() > THRESHOLDS.gap
            && self.asks_for_noise_beside().is_none()
    }

    /// Returns whether an explanation may leave nothing: what an unknown function alone explains better leaves something.
    fn may_suffice(&self, explanation: &Explanation) -> bool {
        self.known.gain(explanation) > self.known.best_unknown() - SEARCH.candidates
    }

    /// The best listed effects, from whose θ fits begin as well.
    fn best_listed(&self) -> Vec<TermSet> {
        let listed = self.known.listed().into_iter();
        listed
            .take(self.budget.starts)
            .map(Explanation::set)
            .collect()
    }

    /// The best listed effects that stand out.
    fn standing_out(&self) -> Vec<&Explanation> {
        let least = self.budget.stands_out * self.known.top();
        let listed = self.known.listed().into_iter().take(self.budget.singles);
        listed.filter(|e| self.known.gain(e) > least).collect()
    }
}

/// Keys of the last terms.
fn keys<'e>(explanations: impl Iterator<Item = &'e Explanation>) -> Vec<String> {
    explanations.map(|e| e.last().key()).collect()
}
