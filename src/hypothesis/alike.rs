//! Listed effects that do the same in a twin: one hypothesis with several names.
//!
//! A constant force on a velocity and a bias of the only motor that drives it are one term of the equations. Only laws of which nothing but
//! the size is unknown are compared: a record tells times and shapes by itself.

use super::listed::Library;
use super::term::{Nature, Part, Term, with_terms};
use crate::effect::{EffectKey, TargetKind};
use crate::hypothesis::limits::TERM;
use crate::likelihood::kalman::FilterError;

/// Merges terms that add the same to the equations, at small sizes and at the largest. The first by place (state, actuator, sensor,
/// parameter), then by name, stands for the others. A black box shows no equations, and keeps all.
pub(crate) fn merged(terms: Vec<Term>, library: &Library<'_>) -> Result<Vec<Term>, FilterError> {
    let (twin, theta) = (library.twin, library.theta);
    let Some(own) = library.scales.equations_at(twin, theta, TERM.moments) else {
        return Ok(terms);
    };
    let beside = Beside { library, own };
    let mut heads: Vec<(usize, Additions<'_>)> = vec![];
    let mut names: Vec<Vec<EffectKey>> = vec![vec![]; terms.len()];
    let mut order: Vec<usize> = (0..terms.len()).collect();
    order.sort_by_key(|&i| (rank(&terms[i]), terms[i].key()));
    let mut is_merged = vec![false; terms.len()];
    for i in order {
        let Some(own) = Additions::of(&terms[i], &beside)? else {
            continue;
        };
        let mut head = None;
        for (j, other) in &heads {
            if own.are_alike(other, &beside)? {
                head = Some(*j);
                break;
            }
        }
        match head {
            Some(j) => {
                is_merged[i] = true;
                names[j].push(EffectKey::new(&terms[i].id, &terms[i].target));
            }
            None => heads.push((i, own)),
        }
    }
    Ok((terms.into_iter().zip(names).zip(is_merged))
        .filter(|(_, is_merged)| !is_merged)
        .map(|((term, also), _)| Term { also, ..term })
        .collect())
}

/// Order of places.
fn rank(term: &Term) -> usize {
    let Part::Effect { effect, .. } = &term.part else {
        return 4;
    };
    match effect.law().target() {
        TargetKind::State => 0,
        TargetKind::Actuator => 1,
        TargetKind::Sensor => 2,
        TargetKind::Parameter => 3,
    }
}

/// Changes of rates and outputs along the records by a term of one unknown size.
struct Additions<'t> {
    term: &'t Term,
    /// A small size, and the largest on the same side.
    sizes: [f64; 2],
    small: Vec<f64>,
}

impl<'t> Additions<'t> {
    /// Additions of a term; `None` where more than its size is to be found, or where it adds nothing here.
    fn of(term: &'t Term, beside: &Beside<'_>) -> Result<Option<Self>, FilterError> {
        let is_effect = term.nature == Nature::Listed && !term.is_noise();
        let [axis] = &term.axes[..] else {
            return Ok(None);
        };
        let Some((small, largest)) = axis.small_size().zip(axis.largest_size()) else {
            return Ok(None);
        };
        if !is_effect || term.shape().is_some() {
            return Ok(None);
        }
        let additions = beside.added(term, small)?;
        let moves = additions.iter().any(|v| *v != 0.0) && additions.iter().all(|v| v.is_finite());
        Ok(moves.then_some(Self {
            term,
            sizes: [small, largest],
            small: additions,
        }))
    }

    /// Returns whether some multiple of another term adds the same, small or large.
    fn are_alike(&self, other: &Self, beside: &Beside<'_>) -> Result<bool, FilterError> {
        // A friction is no force that may as well push.
        if self.term.axes[0].is_one_sided() != other.term.axes[0].is_one_sided() {
            return Ok(false);
        }
        let square = dot(&other.small, &other.small);
        let multiple = dot(&self.small, &other.small) / square;
        if !is_multiple(&self.small, multiple, &other.small) {
            return Ok(false);
        }
        let [small, largest] = self.sizes;
        let there = multiple * other.sizes[0] * largest / small;
        if !other.term.axes[0].bounds.contains(there) {
            return Ok(false);
        }
        let own = beside.added(self.term, largest)?;
        Ok(is_multiple(&own, 1.0, &beside.added(other.term, there)?))
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// Returns whether one list is so many times another.
fn is_multiple(own: &[f64], multiple: f64, other: &[f64]) -> bool {
    let rest: f64 = (own.iter().zip(other))
        .map(|(own, other)| (own - multiple * other).powi(2))
        .sum();
    own.len() == other.len() && rest <= TERM.same_square * dot(own, own)
}

/// A fitted twin, and its own equations along the records.
struct Beside<'l> {
    library: &'l Library<'l>,
    own: Vec<f64>,
}

impl Beside<'_> {
    /// Changes of rates and outputs by a term of this size; empty where it adds states.
    fn added(&self, term: &Term, size: f64) -> Result<Vec<f64>, FilterError> {
        let Library {
            twin,
            theta,
            scales,
            ..
        } = self.library;
        let twin = with_terms(twin, std::iter::once(term))?;
        let theta = [*theta, &[size]].concat();
        let grown = (scales.equations_at(&twin, &theta, TERM.moments))
            .filter(|grown| grown.len() == self.own.len())
            .unwrap_or_default();
        Ok(grown
            .iter()
            .zip(&self.own)
            .map(|(there, own)| there - own)
            .collect())
    }
}

#[cfg(test)]
mod tests {
    use crate::diagnose::fixture::{biased_record, listed_terms, tanks};

    /// The pump feeds the upper tank alone: what biases it is a constant inflow there, what scales it is not.
    #[test]
    fn a_bias_of_the_only_pump_is_a_constant_inflow() {
        let study = tanks(60);
        let terms = listed_terms(&study, &[biased_record(&study, 0.0, 5)]);
        let merged: Vec<Vec<String>> = (terms.iter())
            .filter(|term| !term.also.is_empty())
            .map(|term| term.keys())
            .collect();
        assert_eq!(merged, [["constant-forcing@h1", "actuator-bias@actuator"]]);
        let pump: Vec<&str> = (terms.iter())
            .filter(|term| !term.also.is_empty())
            .flat_map(|term| term.places())
            .collect();
        assert_eq!(pump, ["h1", "actuator"]);
    }
}
