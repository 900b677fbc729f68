//! Scores of withheld trials as one page that needs nothing else.

use super::chart::{Chart, Panel, Series, Style, escaped};
use super::digits::{probability, short};
use super::scorecard_text::{named_scores, rule};
use crate::withheld::{Count, Range, Row, Scorecard};
use std::collections::BTreeMap;

const STYLE: &str = "body{font:16px/1.5 system-ui,sans-serif;max-width:60rem;margin:2rem auto;padding:0 1rem;color:#222;background:#fff}\
    table{border-collapse:collapse;margin:.5rem 0}td,th{padding:.15rem .6rem;text-align:left;border-bottom:1px solid #ddd;vertical-align:bottom}\
    .n{text-align:right}.m td,.m th{padding:.1rem .3rem;text-align:center;font-size:.8rem}.m th.r{text-align:left}\
    .m th.c{writing-mode:vertical-rl;transform:rotate(180deg)}.y{background:#d4e8f5}.w{background:#f8dccb}.s{overflow-x:auto}code{font-size:.85rem;word-break:break-all}";

/// The scorecard as a self-contained page: scores with intervals, kinds, detection against magnitude, reliability, the
/// confusion matrix, every trial.
pub fn scorecard_html(card: &Scorecard) -> String {
    let title = escaped(&format!("{}: withheld trials", card.twin));
    let scores: String = (named_scores(card).into_iter())
        .map(|(name, score)| {
            let (share, interval) = percentages(score);
            row_of(&[name, &of(score), &share, &interval], 1)
        })
        .collect();
    let kinds: String = (card.by_kind.iter())
        .map(|k| {
            let (share, interval) = percentages(k.right);
            let cells = [
                k.kind.id(),
                rule(k.kind),
                &of(k.structural),
                &of(k.right),
                &share,
                &interval,
            ];
            row_of(&cells, 2)
        })
        .collect();
    let size = card.mean_class_size.map_or("–".into(), short);
    let seconds = card.seconds_per_record.map_or("–".into(), short);
    format!(
        "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><meta name=\"viewport\" content=\"width=device-width\">\
         <title>{title}</title>\n<style>{STYLE}</style></head>\n<body>\n<h1>{title}</h1>\n\
         <p>{} trials, seed {}, structural test at level {}. Truths were sealed before the first diagnosis: sha256 of the key file \
         <code>{}</code>.</p>\n\
         <h2>Scores</h2>\n<table>\n<tr><th></th><th class=\"n\">count</th><th class=\"n\">share</th><th class=\"n\">95 % interval</th></tr>\n{scores}</table>\n\
         <p>Clear: the true effect, fitted by the diagnoser, gains over 12 nats. Mean size of a class {size}; mean time of a diagnosis {seconds} s.</p>\n\
         <h2>Kinds of truth</h2>\n<table>\n<tr><th>kind</th><th>right answer</th><th class=\"n\">called structural</th><th class=\"n\">right</th>\
         <th class=\"n\">share</th><th class=\"n\">95 % interval</th></tr>\n{kinds}</table>\n\
         <h2>Detection against magnitude</h2>\n{}{}\
         <h2>Reliability</h2>\n{}\
         <h2>Which effect was named</h2>\n{}\
         <h2>Every trial</h2>\n{}</body></html>\n",
        card.rows.len(),
        card.seed,
        card.alpha,
        escaped(&card.seal),
        strengths(card),
        gains(card),
        reliability(card),
        confusion(card),
        trials(card),
    )
}

/// A row of a table; cells from number `first` on are numbers.
fn row_of(cells: &[&str], first: usize) -> String {
    let cells: String = (cells.iter().enumerate())
        .map(|(i, cell)| match i >= first {
            true => format!("<td class=\"n\">{}</td>", escaped(cell)),
            false => format!("<td>{}</td>", escaped(cell)),
        })
        .collect();
    format!("<tr>{cells}</tr>\n")
}

fn of(count: Count) -> String {
    format!("{} of {}", count.count, count.of)
}

/// Share and interval.
fn percentages(count: Count) -> (String, String) {
    let (low, high) = count.interval();
    match count.share() {
        None => ("–".into(), "–".into()),
        Some(share) => (
            format!("{:.0} %", 100.0 * share),
            format!("{:.0} … {:.0} %", 100.0 * low, 100.0 * high),
        ),
    }
}

/// Detection over strength, with its interval.
fn strengths(card: &Scorecard) -> String {
    let middle = |r: &Range| 0.5 * (r.low + r.high);
    let points: Vec<(f64, Count)> = (card.by_strength.iter())
        .map(|r| (middle(r), r.detected))
        .collect();
    curve(
        "Called structural, by strength of the departure",
        "Share of trials with a structural truth that were called structural, with 95 % intervals.",
        "strength, from hardly visible to obvious",
        "share detected",
        points,
        false,
    )
}

/// Shares with their intervals over x.
fn curve(
    title: &str,
    description: &str,
    x: &str,
    y: &str,
    points: Vec<(f64, Count)>,
    diagonal: bool,
) -> String {
    if points.is_empty() {
        return "<p>No trials to draw.</p>\n".into();
    }
    let mut series = vec![];
    if diagonal {
        series.push(Series::new(
            "as stated",
            Style::RECORD,
            [(0.5, 0.5), (1.0, 1.0)],
        ));
    }
    let line = |pick: &dyn Fn(Count) -> Option<f64>| -> Vec<(f64, f64)> {
        (points.iter())
            .filter_map(|(x, count)| Some((*x, pick(*count)?)))
            .collect()
    };
    series.push(Series::new("share", Style::AFTER, line(&Count::share)));
    for (label, end) in [("95 % interval", 0), ("", 1)] {
        let ends = line(&|count| Some([count.interval().0, count.interval().1][end]));
        series.push(Series::new(label, Style::BEFORE, ends));
    }
    Chart {
        title: title.into(),
        description: description.into(),
        x: x.into(),
        panels: vec![Panel::new(y, series)],
    }
    .svg()
}

/// Detection by the gain of the true effect.
fn gains(card: &Scorecard) -> String {
    if card.by_gain.is_empty() {
        return String::new();
    }
    let end = |v: f64| match v.is_finite() {
        true => short(v),
        false => String::new(),
    };
    let rows: String = (card.by_gain.iter())
        .map(|r| {
            let (share, interval) = percentages(r.detected);
            let range = format!("{} … {}", end(r.low), end(r.high));
            row_of(&[&range, &of(r.detected), &share, &interval], 1)
        })
        .collect();
    format!(
        "<table>\n<tr><th>gain of the true effect, nats</th><th class=\"n\">detected</th><th class=\"n\">share</th><th class=\"n\">95 % interval</th></tr>\n{rows}</table>\n"
    )
}

fn reliability(card: &Scorecard) -> String {
    let points = (card.reliability.iter())
        .map(|bin| (bin.stated, bin.right))
        .collect();
    curve(
        "How often the effect on top is a true one",
        "Share of right answers by stated probability, with 95 % intervals; the diagonal is perfect.",
        "stated probability",
        "share right",
        points,
        true,
    )
}

/// Id of a key.
fn id(key: &str) -> &str {
    key.split('@').next().unwrap_or(key)
}

/// Truths down, answers across, by id: single listed effects.
fn confusion(card: &Scorecard) -> String {
    let mut counts: BTreeMap<&str, BTreeMap<String, u64>> = BTreeMap::new();
    for row in card.rows.iter().filter(|row| row.is_single()) {
        let answer = row.answer();
        let short = match answer.contains(" + ") {
            true => "a pair".to_owned(),
            false => id(&answer).to_owned(),
        };
        *(counts.entry(id(&row.truth)).or_default().entry(short)).or_insert(0) += 1;
    }
    if counts.is_empty() {
        return "<p>No trials with one listed effect.</p>\n".into();
    }
    let mut answers: Vec<&String> = counts.values().flat_map(BTreeMap::keys).collect();
    answers.sort();
    answers.dedup();
    let head: String = (answers.iter())
        .map(|a| format!("<th class=\"c\">{}</th>", escaped(a)))
        .collect();
    let body: String = (counts.iter())
        .map(|(truth, row)| {
            let cells: String = (answers.iter())
                .map(
                    |answer| match (row.get(*answer), answer.as_str() == *truth) {
                        (Some(n), true) => format!("<td class=\"y\">{n}</td>"),
                        (Some(n), false) => format!("<td class=\"w\">{n}</td>"),
                        (None, _) => "<td></td>".into(),
                    },
                )
                .collect();
            format!("<tr><th class=\"r\">{}</th>{cells}</tr>\n", escaped(truth))
        })
        .collect();
    format!(
        "<p>One listed effect was there: truths down, answers across, targets left out.</p>\n\
         <div class=\"s\"><table class=\"m\">\n<tr><th></th>{head}</tr>\n{body}</table></div>\n"
    )
}

fn trials(card: &Scorecard) -> String {
    let rows: String = card.rows.iter().map(trial).collect();
    format!(
        "<div class=\"s\"><table>\n<tr><th>trial</th><th>kind</th><th>truth</th><th>answer</th><th>right</th><th class=\"n\">strength</th>\
         <th class=\"n\">gain</th><th class=\"n\">test</th></tr>\n{rows}</table></div>\n"
    )
}

fn trial(row: &Row) -> String {
    let or_dash = |value: Option<f64>| value.map_or("–".into(), short);
    let p = row
        .outcome
        .as_ref()
        .map_or("–".into(), |o| probability(o.p_value));
    let cells: [&str; 8] = [
        &row.trial.to_string(),
        row.kind.id(),
        &row.truth,
        &row.answer(),
        if row.is_right() { "yes" } else { "no" },
        &or_dash(row.strength),
        &or_dash(row.gain),
        &p,
    ];
    row_of(&cells, 5)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::fixture::scorecards;

    #[test]
    fn the_page_stands_alone() {
        let [full, empty] = scorecards();
        for card in [&full, &empty] {
            let page = scorecard_html(card);
            assert!(page.starts_with("<!doctype html>") && page.ends_with("</html>\n"));
            assert!(!page.contains("src=") && !page.contains("href="));
        }
        let page = scorecard_html(&full);
        assert!(page.matches("<svg").count() == 2 && page.contains("<td class=\"y\">1</td>"));
        assert!(page.contains("<td>failed</td>"));
    }
}
