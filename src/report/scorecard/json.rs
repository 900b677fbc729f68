//! Scores of withheld trials as JSON, `truetwin.scorecard/2`.

use crate::evaluate::trials::Scorecard;
use serde_json::Value;

/// The scorecard as one JSON object, `truetwin.scorecard/2`.
///
/// Each score is `{ count, of, interval }`, the interval Clopper–Pearson's at `interval_level`. docs/withheld.md defines each.
/// All keys are always there; numbers that are not finite are null.
pub fn scorecard_json(card: &Scorecard) -> Value {
    // Fails for keys that are no strings; there are none.
    serde_json::to_value(card).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::fixture::{made_scores, scorecards, validator};

    #[test]
    fn full_and_empty_scorecards_keep_to_the_contract() {
        let [full, empty] = scorecards();
        for card in [full, empty, made_scores::scorecard()] {
            let read: Value = serde_json::from_str(&scorecard_json(&card).to_string()).unwrap();
            let complaints: Vec<String> = (validator("scorecard").iter_errors(&read))
                .map(|error| format!("{}: {error}", error.instance_path()))
                .collect();
            assert!(complaints.is_empty(), "{complaints:?}");
        }
    }
}
