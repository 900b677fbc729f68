//! Explanations of the search as hypotheses to be weighed.

use super::posterior::{Function, Hypotheses, Places, Posterior, Set, log_sum};
use crate::diagnose::search::Explanations;
use crate::effect::TargetKind;
use crate::hypothesis::search::explanation::Explanation;
use crate::hypothesis::term::{Nature, Part, Term};
use crate::math::log_mean;
use std::sync::Arc;

impl Explanations {
    /// The explanations as hypotheses.
    pub fn hypotheses(&self) -> Hypotheses {
        let sets = (self.listed().into_iter().chain(self.pairs())).map(|e| Set {
            log_z: self.gain(e),
            places: places(&e.terms),
            keys: e.terms.iter().map(|term| term.key()).collect(),
            beside: (self.beside(&e.set()))
                .map(|all| all.into_iter().map(|f| self.function(f)).collect()),
        });
        let listed = self.listed();
        let aliased = listed.iter().filter(|e| !e.last().also.is_empty());
        Hypotheses {
            nothing: self.nothing(),
            sets: sets.collect(),
            functions: self
                .rivals()
                .into_iter()
                .map(|f| self.function(f))
                .collect(),
            searched: self.unknown().len(),
            has_equations: true,
            aliases: (aliased.map(|f| (f.last().key(), f.last().keys().split_off(1)))).collect(),
        }
    }

    /// Posterior probabilities of what was found.
    pub fn posterior(&self) -> Posterior {
        self.hypotheses().posterior()
    }

    /// log of the odds of a gap against none, noise being of the twin's own kind.
    pub fn log_odds_alone(&self) -> f64 {
        self.posterior().log_odds + self.nothing()
    }

    fn function(&self, explanation: &Explanation) -> Function {
        let function = explanation.last();
        let held = (self.listed().into_iter()).filter(|f| holds(function, f.last()));
        Function {
            log_z: self.gain(explanation),
            places: places(std::slice::from_ref(function)),
            holds: held.map(|f| f.last().key()).collect(),
        }
    }

    /// log of the evidence of nothing missing, whatever the noise, over that of the twin.
    fn nothing(&self) -> f64 {
        let [alone, pairs] = [self.noise(), self.noise_pairs()]
            .map(|all| log_mean(&all.iter().map(|e| self.gain(e)).collect::<Vec<f64>>()));
        // The best of n kinds makes n − 1 of the n(n − 1)/2 pairs.
        let pairs = pairs - (0.5 * self.noise().len() as f64).ln();
        log_sum([0.0, alone, pairs].into_iter().filter(|z| z.is_finite()))
    }
}

/// Places of terms, and the share of each: a term's part of one is shared by the places of its names.
fn places(terms: &[Arc<Term>]) -> Places {
    let mut all = vec![];
    for term in terms {
        let places = term.places();
        let share = 1.0 / (terms.len() * places.len()) as f64;
        all.extend(places.into_iter().map(|place| (place.to_owned(), share)));
    }
    all
}

/// Returns whether an effect is a function of the same variable at the same place, so that an unknown function there is the effect in
/// another form. The variable of a lag, a delay or a play is the signal's past.
fn holds(function: &Term, effect: &Term) -> bool {
    let Part::Effect { effect: law, .. } = &effect.part else {
        return false;
    };
    if !effect.places().contains(&function.target.as_str()) {
        return false;
    }
    let has_memory = law.kind().memory_values() > 0;
    if function.nature == Nature::Past {
        // Inside the twin, of the same variable.
        let from = law.other().filter(|_| law.kind().remembers().is_some());
        let is_of = |name: &str| function.id.ends_with(&format!(" {name})"));
        return has_memory && from.is_none_or(is_of);
    }
    // Every function contains a constant.
    if law.id().ends_with("-bias") || law.id() == "constant-forcing" {
        return !function.variables.is_empty();
    }
    let [(variable, ..)] = function.variables.as_slice() else {
        return false;
    };
    if has_memory && law.law().target() == TargetKind::State {
        return false;
    }
    let of_time = variable == "t";
    match law.law().target() {
        TargetKind::State if law.id() == "periodic-disturbance" => of_time,
        TargetKind::State => law.entry().from.as_deref().unwrap_or(law.target()) == variable,
        TargetKind::Parameter => of_time,
        TargetKind::Sensor | TargetKind::Actuator => {
            function.nature == Nature::Function
                && !has_memory
                && of_time == (law.id() == "sensor-drift")
        }
    }
}
