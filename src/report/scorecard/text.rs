//! Scores of withheld trials on the terminal.

use crate::evaluate::trials::{Count, Kind, Scorecard};
use crate::report::table::table;

/// The scorecard: the scores, then each kind of truth.
pub fn scorecard_text(card: &Scorecard) -> String {
    let head = format!(
        "{}: {} withheld trials, seed {}; keys sealed as sha256 {}\n\n",
        card.twin,
        card.rows.len(),
        card.seed,
        card.seal
    );
    let mut scores = vec![cells(&["", "count", "of", "95 % interval"])];
    scores.extend(
        named_scores(card)
            .into_iter()
            .map(|(name, score)| line(name, score)),
    );
    let mut kinds = vec![cells(&["kind", "trials", "called structural", "right"])];
    kinds.extend(card.by_kind.iter().map(|k| {
        vec![
            k.kind.to_string(),
            k.right.of.to_string(),
            k.structural.count.to_string(),
            k.right.count.to_string(),
        ]
    }));
    let mut tail = String::new();
    if let Some(size) = card.mean_class_size {
        tail.push_str(&format!("Mean size of a class: {size:.2}.\n"));
    }
    if let Some(seconds) = card.seconds_per_record {
        tail.push_str(&format!("Mean time of a diagnosis: {seconds:.1} s.\n"));
    }
    format!("{head}{}\n{}\n{tail}", table(&scores), table(&kinds))
}

/// Every score with its name, in the order of reports.
pub(super) fn named_scores(card: &Scorecard) -> Vec<(&'static str, Count)> {
    vec![
        ("false alarms", card.false_alarms),
        (
            "absorbed, called structural",
            card.absorbed_called_structural,
        ),
        ("detected", card.detected),
        ("clear ones detected", card.clear_detected),
        ("true effect on top", card.top1),
        ("clear ones on top", card.clear_top1),
        ("true effect in the class", card.in_class),
        ("clear ones in the class", card.clear_in_class),
        ("place right", card.place),
        ("place of clear ones right", card.clear_place),
        ("place of unlisted ones right", card.unlisted_place),
        ("unlisted, abstained", card.abstained),
        ("abstained, unlisted", card.abstained_rightly),
        ("listed, abstained", card.wrongly_abstained),
        ("pairs accepted", card.pairs_accepted),
        ("clear pairs accepted", card.clear_pairs_accepted),
        ("abstained where nothing fits", card.clear_abstained),
        ("intervals that cover", card.interval_covers),
        ("failed", card.failed),
    ]
}

fn line(name: &str, score: Count) -> Vec<String> {
    let (low, high) = score.interval();
    vec![
        name.into(),
        score.count.to_string(),
        score.of.to_string(),
        match score.of {
            0 => "–".into(),
            _ => format!("{:.0} … {:.0} %", 100.0 * low, 100.0 * high),
        },
    ]
}

fn cells(names: &[&str]) -> Vec<String> {
    names.iter().map(|name| (*name).into()).collect()
}

/// Returns the rule of a right answer.
pub(super) fn rule(kind: Kind) -> &'static str {
    match kind {
        Kind::None => "no structural gap",
        Kind::Outside => "no structural gap; a parameter gap may be seen",
        Kind::Listed | Kind::Parametrised => "structural, the true effect on top",
        Kind::Unlisted => "structural, none of the listed effects",
        Kind::Pair => "structural, both effects and nothing else accepted",
        Kind::Confounded => "structural, the true effect or its double in the class",
        Kind::Absorbed => "no structural gap: parameters stand in for it",
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::fixture::scorecards;

    #[test]
    fn scores_stand_beside_their_intervals() {
        let [full, empty] = scorecards();
        let text = scorecard_text(&full);
        assert!(text.contains("true effect on top"), "{text}");
        assert!(text.contains("3 … 100 %"), "{text}");
        assert!(scorecard_text(&empty).contains("0 withheld trials"));
    }
}
