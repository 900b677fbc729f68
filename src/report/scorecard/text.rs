//! Scores of withheld trials on the terminal.

use crate::evaluate::trials::{Bin, Count, Kind, Scorecard};
use crate::report::digits::short;
use crate::report::table::table;

/// The scorecard: statements, fates by expected information, kinds of truth, baselines.
pub fn scorecard_text(card: &Scorecard) -> String {
    let setup = &card.setup;
    let head = format!(
        "{}: {} withheld trials, seed {}, families {}{}; keys sealed as sha256 {}\n\n",
        setup.twin,
        card.trials,
        setup.seed,
        setup.families,
        setup.taken_out(),
        setup.seal
    );
    let mut scores = vec![cells(&["", "count", "of", "95 % interval"])];
    scores.extend((named_scores(card).into_iter()).map(|(name, score)| line(&name, score)));
    let mut kinds = vec![cells(&["kind", "trials", "called structural", "right"])];
    kinds.extend(card.by_kind.iter().map(|k| {
        vec![
            k.kind.to_string(),
            k.right.of.to_string(),
            k.called_structural.count.to_string(),
            k.right.count.to_string(),
        ]
    }));
    let bins = |head: &[&str], bins: &[Bin]| -> String {
        let mut rows = vec![cells(head)];
        rows.extend(bins.iter().map(bin_cells));
        table(&rows)
    };
    let [mut clear, mut held] = [BIN_HEAD; 2];
    clear[0] = "truth, clear";
    held[1] = "evidence held";
    let mut baselines = vec![cells(&[
        "answers of",
        "verdict right",
        "answer right",
        "place right",
    ])];
    baselines.extend(card.baselines.iter().map(|b| {
        let place = b.place.map_or("–".into(), of);
        vec![b.name.into(), of(b.verdict), of(b.right), place]
    }));
    let mut tail = vec![];
    for (name, value, unit) in [
        (
            "Mean log score of the truth",
            card.probabilities.log_score,
            "nats",
        ),
        ("Mean Brier score", card.probabilities.brier, ""),
        ("Mean size of a class", card.mean_class_size, ""),
        ("Mean number of places told", card.mean_places, ""),
        (
            "Median share that the true effects close",
            card.closed.true_median,
            "",
        ),
        (
            "Mean number of passes of a diagnosis",
            card.passes_per_record,
            "",
        ),
        ("Mean time of a diagnosis", card.seconds_per_record, "s"),
    ] {
        if let Some(value) = value {
            tail.push(
                format!("{name}: {} {unit}", short(value))
                    .trim_end()
                    .to_owned(),
            );
        }
    }
    tail.push(format!("Draws of truths given up: {}", card.redraws));
    let parts = [
        table(&scores),
        bins(&BIN_HEAD, &card.by_information),
        bins(&clear, &card.clear_by_information),
        bins(&held, &card.by_held),
        table(&kinds),
        table(&baselines),
    ];
    format!("{head}{}\n{}\n", parts.join("\n"), tail.join("\n"))
}

/// Columns of fates by expected information.
pub(super) const BIN_HEAD: [&str; 13] = [
    "truth",
    "information",
    "trials",
    "called",
    "delivered",
    "partial",
    "incomplete",
    "in class",
    "wrong name",
    "refused",
    "abstained",
    "abstained or partial",
    "place right",
];

/// One bin as a row of [`BIN_HEAD`].
pub(super) fn bin_cells(bin: &Bin) -> Vec<String> {
    let plain = |count: Count| count.count.to_string();
    vec![
        bin.truths.into(),
        nats(bin),
        bin.delivered.of.to_string(),
        plain(bin.called_structural),
        plain(bin.delivered),
        plain(bin.partial),
        plain(bin.incomplete),
        plain(bin.in_class),
        plain(bin.wrong_name),
        plain(bin.refused),
        plain(bin.abstained),
        // Of those alone in which nothing listed is right.
        match bin.abstained_or_partial.of {
            0 => "–".into(),
            _ => of(bin.abstained_or_partial),
        },
        plain(bin.place),
    ]
}

/// Range of a bin.
pub(super) fn nats(bin: &Bin) -> String {
    match bin.high.is_finite() {
        true => format!("{:.0} … {:.0} nats", bin.low, bin.high),
        false => format!("above {:.0} nats", bin.low),
    }
}

/// Returns `count of all`.
pub(super) fn of(count: Count) -> String {
    format!("{} of {}", count.count, count.of)
}

/// Every score that is one count, with its name, in the order of reports.
pub(super) fn named_scores(card: &Scorecard) -> Vec<(String, Count)> {
    let precision = &card.precision;
    let mut scores: Vec<(String, Count)> = vec![
        (
            "nothing missing, called structural".into(),
            card.false_alarms,
        ),
        (
            "nothing missing, diagnosis failed".into(),
            card.nulls_failed,
        ),
        (
            "nothing missing but a finer step, called structural".into(),
            card.coarse_called_structural,
        ),
        ("gaps, called structural".into(), card.detected),
        (
            "gaps beside a coarse step, delivered".into(),
            card.coarse_delivered,
        ),
        ("stated at 0.9 or more: right".into(), precision.stated_90),
        ("stated at 0.7 or more: right".into(), precision.stated_70),
        ("stated at 0.5 or more: right".into(), precision.stated_50),
        ("\"none of these\": right".into(), precision.none_of_these),
        ("\"no structural gap\": right".into(), precision.no_gap),
        (
            "\"no structural gap\": right, or below 3 nats".into(),
            precision.no_gap_or_faint,
        ),
        ("place: right".into(), precision.place),
        ("place at 0.9 or more: right".into(), precision.place_90),
        (
            "place: right, or one of its rivals".into(),
            precision.place_class,
        ),
        (
            "90 % intervals of θ that hold it, nothing missing".into(),
            card.coverage.nulls,
        ),
        (
            "90 % intervals of θ that hold it, beside a right effect".into(),
            card.coverage.delivered,
        ),
        (
            "90 % intervals of the share that the true effects close: hold 1".into(),
            card.closed.true_holds_one,
        ),
        (
            "share closed beside a right effect: −0.1 to 1.1".into(),
            card.closed.delivered_within,
        ),
        ("diagnoses that failed".into(), card.failed),
    ];
    for score in &card.by_nuisance {
        let name = format!("false alarms, nuisance {}", score.nuisance);
        scores.push((name, score.false_alarms));
    }
    for score in &card.steadiness {
        scores.push((format!("same answer, other {}", score.change), score.same));
    }
    scores
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
        Kind::Listed | Kind::Otherwise | Kind::Beside => {
            "structural, the true effect and nothing false accepted"
        }
        Kind::Random => "structural, none of the listed effects",
        Kind::Pair => "structural, both effects and nothing false accepted",
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
        assert!(text.contains("stated at 0.9 or more: right"), "{text}");
        assert!(text.contains("3 … 100 %"), "{text}");
        assert!(text.contains("10 … 30 nats"), "{text}");
        assert!(text.contains("truth, clear"), "{text}");
        assert!(text.contains("nothing missing, diagnosis failed"), "{text}");
        assert!(text.contains("always no gap"), "{text}");
        assert!(scorecard_text(&empty).contains("0 withheld trials"));
    }
}
