//! Scores of withheld trials as one page that needs nothing else.

use super::figures::{delivered_svg, reliability_svg};
use super::text::{BIN_HEAD, bin_cells, named_scores, of, rule};
use crate::evaluate::trials::{Baseline, Bin, Count, Row, Scorecard};
use crate::report::chart::escaped;
use crate::report::digits::{percent, short};
use crate::report::page::Column::{Number, Text};
use crate::report::page::{Section, Shade, figure, folded, matrix, page, paragraph, table};
use std::collections::BTreeMap;

/// The scorecard as a self-contained page: statements with intervals, answers by expected information, kinds, reliability,
/// baselines, the confusion matrix, every trial.
pub(crate) fn scorecard_html(card: &Scorecard) -> String {
    let sections = [
        Section::new("scores", "Scores", scores(card)),
        Section::new("information", "Answers by expected information", bins(card)),
        Section::new("kinds", "Kinds of truth", kinds(card)),
        Section::new("reliability", "Reliability", reliability(card)),
        Section::new("baselines", "Baselines", baselines(card)),
        Section::new("named", "Which effect was named", confusion(card)),
        Section::new("trials", "Every trial", trials(card)),
    ];
    let title = format!("{}: withheld trials", card.setup.twin);
    page(&title, &lead(card), &sections)
}

/// Returns the head of the page.
fn lead(card: &Scorecard) -> String {
    let called = |count: Count| match count.of {
        0 => "none was tried".into(),
        _ => of(count),
    };
    let verdict = format!(
        "False alarms: {}. Gaps detected: {}. Effects stated at 0.9 or more that are right: {}. Diagnoses that failed: {}.",
        called(card.false_alarms),
        called(card.detected),
        called(card.precision.stated_90),
        called(card.failed)
    );
    let setup = &card.setup;
    format!(
        "<p class=\"verdict\">{}</p>\n<p>{} trials, seed {}, random laws of {} families{}. Truths were sealed before the first \
         diagnosis: sha256 of the key file <code>{}</code>.</p>\n",
        escaped(&verdict),
        card.trials,
        setup.seed,
        setup.families,
        setup.taken_out(),
        escaped(&setup.seal)
    )
}

fn scores(card: &Scorecard) -> String {
    let rows: Vec<Vec<String>> = (named_scores(card).into_iter())
        .map(|(name, score)| counted(&[&name], score))
        .collect();
    let head = [
        ("score", Text),
        ("count", Number),
        ("share", Number),
        ("95 % interval", Number),
    ];
    let dash = |value: Option<f64>| value.map_or("–".into(), short);
    let caption = "Intervals are Clopper and Pearson’s.";
    let rest = format!(
        "Mean log score of the truth {} nats, mean Brier score {}, over {} gaps with stated probabilities. Mean size of a class \
         {}, of a set of places {}. Median share that the true effects close {}. Mean time of a diagnosis {} s, {} passes over its record. Draws of truths given up: {}.",
        dash(card.probabilities.log_score),
        dash(card.probabilities.brier),
        card.probabilities.trials,
        dash(card.mean_class_size),
        dash(card.mean_places),
        dash(card.closed.true_median),
        dash(card.seconds_per_record),
        dash(card.passes_per_record),
        card.redraws
    );
    table(caption, &head, &rows) + &paragraph(&rest)
}

fn bins(card: &Scorecard) -> String {
    let Some(svg) = delivered_svg(card) else {
        return paragraph("No trial has a gap.");
    };
    let mut head = BIN_HEAD.map(|name| (name, Number));
    (head[0].1, head[1].1) = (Text, Text);
    let cells = |bins: &[Bin]| -> Vec<Vec<String>> { bins.iter().map(bin_cells).collect() };
    let all = table(
        "Every trial with a gap, by its expected information. Missed and failed ones are the rest of the trials. Partial: right and \
         complete, but more was said to be missing. Abstained or partial: of trials in which nothing listed is right.",
        &head,
        &cells(&card.by_information),
    );
    let clear = table(
        "The same of the records that decide: every listed effect that is wrong leaves more than 3 nats of the departure.",
        &head,
        &cells(&card.clear_by_information),
    );
    head[1].0 = "evidence held";
    let held = table(
        "Listed truths by the evidence that their records turned out to hold: log evidence of the true effects over the twin alone, fitted \
         once the keys are open.",
        &head,
        &cells(&card.by_held),
    );
    figure(
        &svg,
        "Right and complete answers, by how much the best possible diagnoser could learn of the departure from such a record.",
    ) + &all
        + &clear
        + &held
}

fn kinds(card: &Scorecard) -> String {
    let rows: Vec<Vec<String>> = (card.by_kind.iter())
        .map(|k| {
            let failed = k.failed.count.to_string();
            let cells = [k.kind.id(), rule(k.kind), &of(k.called_structural), &failed];
            counted(&cells, k.right)
        })
        .collect();
    let head = [
        ("kind", Text),
        ("right answer", Text),
        ("called structural", Number),
        ("failed", Number),
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

fn reliability(card: &Scorecard) -> String {
    let Some(svg) = reliability_svg(card) else {
        return paragraph("No effect was stated: nothing to draw.");
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
        "The effect on top: its stated probability against how often it is right. On the diagonal, what is stated is what \
         happens; below it, too much is claimed.",
    ) + &folded(
        "Reliability in numbers",
        &table(
            "Answers of about the same stated probability.",
            &head,
            &rows,
        ),
    )
}

fn baselines(card: &Scorecard) -> String {
    let row = |b: &Baseline| -> Vec<String> {
        let share = |count: Count| format!("{}, {}", of(count), percentages(count).0);
        let place = b.place.map_or("–".into(), share);
        vec![b.name.into(), share(b.verdict), share(b.right), place]
    };
    let rows: Vec<Vec<String>> = card.baselines.iter().map(row).collect();
    let head = [
        ("answers of", Text),
        ("verdict right", Number),
        ("answer right", Number),
        ("place right", Number),
    ];
    table("The same trials, answered in simple ways.", &head, &rows)
}

/// Id of a key.
fn id(key: &str) -> &str {
    key.split('@').next().unwrap_or(key)
}

/// Truths down, answers across, by id: trials with one listed effect.
fn confusion(card: &Scorecard) -> String {
    let mut counts: BTreeMap<&str, BTreeMap<String, u64>> = BTreeMap::new();
    let single = |row: &&Row| row.right.len() == 1 && !row.must_abstain();
    for row in card.rows.iter().filter(single) {
        let answer = row.answer();
        let short = if answer.contains(" + ") {
            "several".to_owned()
        } else {
            id(&answer).to_owned()
        };
        *(counts.entry(id(&row.truth.name)).or_default().entry(short)).or_insert(0) += 1;
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
        ("nuisance", Text),
        ("information, nats", Number),
        ("nearest wrong effect leaves, nats", Number),
        ("answer", Text),
        ("stated", Number),
        ("worth", Text),
    ];
    folded(
        "Trials one by one",
        &table("In the order in which they were drawn.", &head, &rows),
    )
}

fn trial(row: &Row) -> Vec<String> {
    let or_dash = |value: Option<f64>| value.map_or("–".into(), short);
    let stated = row.outcome.as_ref().and_then(|o| o.stated());
    vec![
        row.trial.to_string(),
        row.kind.id().into(),
        row.truth.name.clone(),
        row.nuisance.clone(),
        or_dash(row.information),
        or_dash(row.truth.rival.as_ref().map(|rival| rival.nats)),
        row.answer(),
        stated.map_or("–".into(), |p| format!("{p:.2}")),
        row.fate().to_string(),
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
        assert_eq!(page.matches("<svg").count(), 2);
        assert!(page.contains("<td class=\"right\"") && page.contains("<td>failed</td>"));
        assert!(scorecard_html(&empty).contains("No trial has a gap."));
    }

    #[test]
    fn many_trials_are_drawn_and_counted() {
        let page = scorecard_html(&made_scores::scorecard());
        for text in [
            "False alarms: 0 of 29. Gaps detected: 72 of 90.",
            "<title>Right answers, by expected information</title>",
            "<title>How often the effect on top is right</title>",
            ">as stated<",
            "above 30 nats",
            "always no gap",
            "wrong name",
        ] {
            assert!(page.contains(text), "{text}");
        }
    }
}
