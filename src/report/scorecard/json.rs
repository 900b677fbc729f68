//! Scores of withheld trials as JSON, `truetwin.scorecard/1`.

use crate::evaluate::trials::Scorecard;
use serde_json::Value;

/// The scorecard as one JSON object, `truetwin.scorecard/1`.
///
/// Each score is `{ count, of, interval }`, the interval Clopper–Pearson's at `interval_level`. What each is of stands in
/// docs/withheld.md.
///
/// Beyond the contract: `interval`, `interval_level`, `clear_top1`, `clear_in_class`, `clear_where`, `unlisted_where`,
/// `clear_class_size`, `clear_abstained`,
/// `clear_pairs_accepted`, `abstained_rightly`
/// (the precision of abstaining), `failed`, `by_kind`, `by_strength`, `by_gain`, `confusion`, `list` (every trial).
///
/// All keys are always there; numbers that are not finite are null.
pub fn scorecard_json(card: &Scorecard) -> Value {
    // Fails for keys that are no strings; there are none.
    serde_json::to_value(card).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::fixture::{scorecards, validator};

    #[test]
    fn full_and_empty_scorecards_keep_to_the_contract() {
        for card in scorecards() {
            let read: Value = serde_json::from_str(&scorecard_json(&card).to_string()).unwrap();
            let complaints: Vec<String> = (validator("scorecard").iter_errors(&read))
                .map(|error| format!("{}: {error}", error.instance_path))
                .collect();
            assert!(complaints.is_empty(), "{complaints:?}");
        }
    }
}
