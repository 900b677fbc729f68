//! Scores of the stated probabilities of the effects and of *none of these*, over gaps with one departure.

use crate::evaluate::trials::Kind;
use crate::evaluate::trials::numbers::TRIAL;
use crate::evaluate::trials::row::TrialRow;

/// Logarithm of the probability of the truth, at least ln 0.001.
pub(super) fn log_score(row: &TrialRow) -> Option<f64> {
    scores(row).map(|(truth, _)| truth.max(TRIAL.least_probability).ln())
}

/// Squared error over all outcomes: 0 perfect, 2 certain and wrong.
pub(super) fn brier(row: &TrialRow) -> Option<f64> {
    scores(row).map(|(_, brier)| brier)
}

/// Probability of the truth and Brier score of one trial; `None` where no effect has a probability.
fn scores(row: &TrialRow) -> Option<(f64, f64)> {
    let outcome = row.outcome().filter(|o| o.is_structural())?;
    if row.is_null() || row.truth.kind == Kind::Pair || outcome.effects.is_empty() {
        return None;
    }
    let stated: f64 = outcome.effects.iter().map(|e| e.probability).sum();
    let scale = stated.max(1.0);
    let none = 1.0 - stated / scale;
    // Effects that are right answers alike are one outcome.
    let (mut right, mut false_squares) = (0.0, 0.0);
    for effect in &outcome.effects {
        let probability = effect.probability / scale;
        match row.is_right(&effect.key) {
            true => right += probability,
            false => false_squares += probability.powi(2),
        }
    }
    let (truth, other) = match row.must_abstain() {
        true => (none, 0.0),
        false => (right, none),
    };
    Some((truth, (1.0 - truth).powi(2) + false_squares + other.powi(2)))
}
