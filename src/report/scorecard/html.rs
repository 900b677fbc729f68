//! Scores of withheld trials as one page that needs nothing else.

use super::figures::{gains_svg, nats, of, reliability_svg, strengths_svg};
use super::text::{named_scores, rule};
use crate::evaluate::trials::{Count, Row, Scorecard};
use crate::report::chart::escaped;
use crate::report::digits::{bare, percent, short};
use crate::report::page::Column::{Number, Text};
use crate::report::page::{Section, Shade, figure, folded, matrix, page, paragraph, table};
use std::collections::BTreeMap;

/// The scorecard as a self-contained page: scores with intervals, kinds, detection against magnitude, reliability, the
/// confusion matrix, every trial.
pub fn scorecard_html(card: &Scorecard) -> String {
    let sections = [
        Section::new("scores", "Scores", scores(card)),
        Section::new("kinds", "Kinds of truth", kinds(card)),
        Section::new("detection", "Detection against magnitude", detection(card)),
        Section::new("reliability", "Reliability", reliability(card)),
        Section::new("named", "Which effect was named", confusion(card)),
        Section::new("trials", "Every trial", trials(card)),
    ];
    page(
        &format!("{}: withheld trials", card.twin),
        &lead(card),
        &sections,
    )
}

/// Returns the head of the page.
fn lead(card: &Scorecard) -> String {
    let called = |count: Count| match count.of {
        0 => "none was tried".into(),
        _ => of(count),
    };
    let verdict = format!(
        "False alarms: {}. Gaps detected: {}. Of single listed effects, the true one on top: {}.",
        called(card.false_alarms),
        called(card.detected),
        called(card.top1)
    );
    format!(
        "<p class=\"verdict\">{}</p>\n<p>{} trials, seed {}, structural test at level {}. Truths were sealed before the first \
         diagnosis: sha256 of the key file <code>{}</code>.</p>\n",
        escaped(&verdict),
        card.rows.len(),
        card.seed,
        card.alpha,
        escaped(&card.seal)
    )
}

fn scores(card: &Scorecard) -> String {
    let rows: Vec<Vec<String>> = (named_scores(card).into_iter())
        .map(|(name, score)| counted(&[name], score))
        .collect();
    let head = [
        ("score", Text),
        ("count", Number),
        ("share", Number),
        ("95 % interval", Number),
    ];
    let size = card.mean_class_size.map_or("–".into(), short);
    let seconds = card.seconds_per_record.map_or("–".into(), short);
    let caption = "Clear: the true effect, fitted by the diagnoser, gains over 12 nats. Intervals are Clopper and Pearson’s.";
    table(caption, &head, &rows)
        + &paragraph(&format!(
            "Mean size of a class {size}; mean time of a diagnosis {seconds} s."
        ))
}

fn kinds(card: &Scorecard) -> String {
    let rows: Vec<Vec<String>> = (card.by_kind.iter())
        .map(|k| counted(&[k.kind.id(), rule(k.kind), &of(k.structural)], k.right))
        .collect();
    let head = [
        ("kind", Text),
        ("right answer", Text),
        ("called structural", Number),
        ("right", Number),
        ("share", Number),
        ("95 % interval", Number),
    ];
    table("What was there, and what counts as right.", &head, &rows)
}

/// Some cells, then a count with its share and interval.
fn counted(cells: &[&str], count: Count) -> Vec<String> {
    let (share, interval) = percentages(count);
    let cells = cells.iter().map(|cell| (*cell).to_owned());
    cells.chain([of(count), share, interval]).collect()
}

/// Share and interval.
fn percentages(count: Count) -> (String, String) {
    let (low, high) = count.interval();
    match count.share() {
        None => ("–".into(), "–".into()),
        Some(share) => (
            percent(share),
            format!("{:.0} … {:.0} %", 100.0 * low, 100.0 * high),
        ),
    }
}

/// Detection over strength and over the gain of the true effect.
fn detection(card: &Scorecard) -> String {
    let mut body = match strengths_svg(card) {
        Some(svg) => figure(
            &svg,
            "A point stands in the middle of its range; whiskers are 95 % intervals.",
        ),
        None => paragraph("No trials to draw."),
    };
    let Some(svg) = gains_svg(card) else {
        return body;
    };
    body.push_str(&figure(
        &svg,
        "By what the true effects gain when the diagnoser fits them, in nats: what it could have seen at best.",
    ));
    let rows: Vec<Vec<String>> = (card.by_gain.iter())
        .map(|r| counted(&[&nats(r)], r.detected))
        .collect();
    let head = [
        ("gain of the true effect", Text),
        ("detected", Number),
        ("share", Number),
        ("95 % interval", Number),
    ];
    body.push_str(&folded(
        "Detection by gain in numbers",
        &table("Detected, by gain.", &head, &rows),
    ));
    body
}

fn reliability(card: &Scorecard) -> String {
    let Some(svg) = reliability_svg(card) else {
        return paragraph("No effect was accepted: nothing to draw.");
    };
    let rows: Vec<Vec<String>> = (card.reliability.iter())
        .map(|bin| counted(&[&format!("{:.2}", bin.stated)], bin.right))
        .collect();
    let head = [
        ("stated, mean", Number),
        ("right", Number),
        ("share", Number),
        ("95 % interval", Number),
    ];
    figure(
        &svg,
        "Where an effect was accepted: its stated probability against how often it was a true one. On the diagonal, what is \
         stated is what happens; below it, too much is claimed.",
    ) + &folded(
        "Reliability in numbers",
        &table(
            "Answers of about the same stated probability.",
            &head,
            &rows,
        ),
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
        let short = if answer.contains(" + ") {
            "a pair".to_owned()
        } else {
            id(&answer).to_owned()
        };
        *(counts.entry(id(&row.truth)).or_default().entry(short)).or_insert(0) += 1;
    }
    if counts.is_empty() {
        return paragraph("No trials with one listed effect.");
    }
    let mut answers: Vec<String> = (counts.values().flat_map(BTreeMap::keys).cloned()).collect();
    answers.sort();
    answers.dedup();
    let rows: Vec<(String, Vec<Option<Shade>>)> = (counts.iter())
        .map(|(truth, row)| {
            let all: u64 = row.values().sum();
            let cells = (answers.iter())
                .map(|answer| {
                    let n = *row.get(answer)?;
                    Some(Shade {
                        text: n.to_string(),
                        weight: n as f64 / all.max(1) as f64,
                        right: answer == truth,
                    })
                })
                .collect();
            ((*truth).to_owned(), cells)
        })
        .collect();
    matrix(
        "One listed effect was there: truths down, answers across, targets left out. Framed and bold: right. Darker: a larger \
         share of the row.",
        &answers,
        &rows,
    )
}

fn trials(card: &Scorecard) -> String {
    let rows: Vec<Vec<String>> = card.rows.iter().map(trial).collect();
    let head = [
        ("trial", Number),
        ("kind", Text),
        ("truth", Text),
        ("answer", Text),
        ("right", Text),
        ("strength", Number),
        ("gain", Number),
        ("p", Number),
    ];
    let wrong = card.rows.iter().filter(|row| !row.is_right()).count();
    paragraph(&format!(
        "{wrong} of {} trials were not answered as the rule of their kind asks.",
        card.rows.len()
    )) + &folded(
        "Trials one by one",
        &table("In the order in which they were drawn.", &head, &rows),
    )
}

fn trial(row: &Row) -> Vec<String> {
    let or_dash = |value: Option<f64>| value.map_or("–".into(), short);
    let p = row.outcome.as_ref().map_or("–".into(), |o| bare(o.p_value));
    vec![
        row.trial.to_string(),
        row.kind.id().into(),
        row.truth.clone(),
        row.answer(),
        if row.is_right() { "yes" } else { "no" }.into(),
        or_dash(row.strength),
        or_dash(row.gain),
        p,
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::fixture::{made_scores, scorecards};

    #[test]
    fn the_page_stands_alone() {
        let [full, empty] = scorecards();
        for card in [&full, &empty] {
            let page = scorecard_html(card);
            assert!(page.starts_with("<!doctype html>") && page.ends_with("</html>\n"));
            assert!(!page.contains("src=") && !page.contains("<script"));
            assert_eq!(
                page.matches("href=").count(),
                page.matches("href=\"#").count()
            );
        }
        let page = scorecard_html(&full);
        assert_eq!(page.matches("<svg").count(), 3);
        assert!(page.contains("<td class=\"right\"") && page.contains("1 of 2 trials were not"));
        assert!(page.contains("<td>failed</td>"));
    }

    #[test]
    fn many_trials_are_drawn_and_counted() {
        let page = scorecard_html(&made_scores::scorecard());
        for text in [
            "False alarms: 0 of 30. Gaps detected: 72 of 90. Of single listed effects, the true one on top: 45 of 48.",
            "<title>Called structural, by strength</title>",
            "<title>Called structural, by gain</title>",
            "<title>How often the effect on top is true</title>",
            ">as stated<",
            ">50 … 100 nats<",
            "<td class=\"right\" style=\"background:rgb(0 114 178 / 0.50)\">12</td>",
            "22 of 120 trials were not answered",
        ] {
            assert!(page.contains(text), "{text}");
        }
        assert_eq!(
            page.matches("<circle").count(),
            9 + 2,
            "dots, and those of two legends"
        );
    }
}
