//! Scores of withheld trials as JSON, text and page.

mod tables;

use crate::evaluate::LEVEL;
use crate::evaluate::trials::{Breakdown, BreakdownLine, Scorecard, TrialRow};
use crate::report::document::{Block, Document, Matrix, Section, Shade};
use crate::setting::count;
use serde_json::{Value, json};
use std::collections::BTreeMap;
use tables::{breakdown, delivered_svg, of, reliability_svg};

impl Scorecard {
    /// One JSON object, `truetwin.scorecard/2`; `tests/contract` has its schema.
    pub fn json(&self) -> Value {
        scorecard_json(self)
    }

    /// Lines for the terminal: everything but pictures and single trials.
    pub fn text(&self) -> String {
        self.document().text()
    }

    /// Page of its own: what was found of what was there, place, probabilities, every trial.
    pub fn html(&self) -> String {
        self.document().html()
    }

    pub(crate) fn document(&self) -> Document {
        Document {
            title: format!("{}: withheld trials", self.setup.twin),
            answer: vec![
                Block::Headline(headline(self)),
                Block::paragraph(setup(self)),
            ],
            sections: sections(self),
            ..Document::default()
        }
    }
}

fn sections(card: &Scorecard) -> Vec<Section> {
    let section = |id, title, keys: &[&str]| {
        let tables = keys.iter().filter_map(|key| breakdown(card, key));
        Section::new(id, title, vec![]).brief(tables.collect())
    };
    let delivered = match delivered_svg(card) {
        Some(svg) => Block::picture(
            svg,
            "Right and complete answers, by how much the best possible diagnoser could learn of the departure from such a record.",
        ),
        None => Block::paragraph("No trial has a gap."),
    };
    let reliability = match reliability_svg(card) {
        Some(svg) => Block::picture(
            svg,
            "Stated probability of the most probable effect against how often it is right. On the diagonal, what is stated is what \
             happens; below it, too much is claimed.",
        ),
        None => Block::paragraph("No effect was stated: nothing to draw."),
    };
    let nats = ["by_information", "clear_by_information", "by_held"];
    let mut all = vec![
        Section::new("scores", "Scores", vec![])
            .brief(vec![tables::scores(card), tables::figures(card)]),
        section("information", "Answers by expected information", &nats),
        section("kinds", "Kinds of truth", &["by_kind"]),
        section(
            "nuisances",
            "Nuisances, repeated diagnoses",
            &["by_nuisance", "steadiness"],
        ),
        section("reliability", "Reliability", &["reliability"]),
        section("baselines", "Baselines", &["baselines"]),
        Section::new("named", "Which effect was named", vec![confusion(card)]),
        Section::new(
            "trials",
            "Every trial",
            vec![Block::folded(
                "Trials one by one",
                vec![tables::trials(card)],
            )],
        ),
    ];
    all[1].rest.push(delivered);
    all[4].rest.push(reliability);
    all
}

/// Counts of the first sentence: words and keys.
const HEADLINE: [(&str, &str); 4] = [
    ("False alarms", "false_alarms"),
    ("Gaps detected", "detected"),
    (
        "Effects stated at 0.9 or more that are right",
        "precision.stated_90",
    ),
    ("Diagnoses that failed", "failed"),
];

fn headline(card: &Scorecard) -> String {
    let parts = HEADLINE.map(|(words, key)| match card.count(key) {
        count if count.of == 0 => format!("{words}: none was tried."),
        count => format!("{words}: {}.", of(count)),
    });
    parts.join(" ")
}

fn setup(card: &Scorecard) -> String {
    let (setup, settings) = (&card.setup, &card.setup.settings);
    let parts: Vec<&str> = settings.ablated.iter().map(|part| part.id()).collect();
    let without = match parts.is_empty() {
        true => String::new(),
        false => format!(", diagnosed without {}", parts.join(", ")),
    };
    format!(
        "{}: {}, seed {}, families {}{without}. Truths were sealed before the first diagnosis: sha256 of the key file {}",
        setup.twin,
        count(card.trials, "withheld trial"),
        settings.seed,
        settings.families,
        setup.seal
    )
}

/// Truths down, answers across, by id: trials with one listed effect.
fn confusion(card: &Scorecard) -> Block {
    let id = |key: &str| key.split('@').next().unwrap_or(key).to_owned();
    let mut counts: BTreeMap<String, BTreeMap<String, u64>> = BTreeMap::new();
    let is_single = |row: &&TrialRow| row.right.len() == 1 && !row.must_abstain();
    for row in card.rows.iter().filter(is_single) {
        let answer = match row.answer_text() {
            several if several.contains(" + ") => "several".into(),
            one => id(&one),
        };
        *(counts
            .entry(id(&row.truth_name()))
            .or_default()
            .entry(answer))
        .or_default() += 1;
    }
    if counts.is_empty() {
        return Block::paragraph("No trials with one listed effect.");
    }
    let mut answers: Vec<String> = counts.values().flat_map(BTreeMap::keys).cloned().collect();
    answers.sort();
    answers.dedup();
    let line = |(truth, row): (&String, &BTreeMap<String, u64>)| {
        let all = row.values().sum::<u64>().max(1);
        let shade = |answer: &String| {
            row.get(answer).map(|n| Shade {
                text: n.to_string(),
                weight: *n as f64 / all as f64,
                right: answer == truth,
            })
        };
        (truth.clone(), answers.iter().map(shade).collect())
    };
    let rows = counts.iter().map(line).collect();
    Block::Matrix(Matrix {
        caption: "One listed effect was there: truths down, answers across, targets left out. Framed and bold: right. Darker: a larger \
                  share of the row."
            .into(),
        head: answers,
        rows,
    })
}

/// The scorecard as one JSON object. Each count is `{ count, of, interval }`, the interval Clopper–Pearson's at `interval_level`;
/// docs/withheld.md defines each. All keys are always there; numbers that are not finite are null.
fn scorecard_json(card: &Scorecard) -> Value {
    let (setup, settings) = (&card.setup, &card.setup.settings);
    let mut object = json!({
        "schema": "truetwin.scorecard/2",
        "twin": setup.twin,
        "seed": settings.seed,
        "families": settings.families,
        "without": settings.without,
        "validation": settings.validation,
        "like": settings.like.is_some(),
        "detection_only": settings.detection_only,
        "ablated": settings.ablated,
        "seal": setup.seal,
        "trials": card.trials,
        "interval_level": LEVEL,
    });
    let scores = card
        .scores
        .iter()
        .map(|score| (score.key, json!(score.value)));
    let figures = card
        .figures
        .iter()
        .map(|figure| (figure.key, figure.value.clone()));
    for (path, value) in scores.chain(figures) {
        match path.split_once('.') {
            Some((group, key)) => object[group][key] = value,
            None => object[path] = value,
        }
    }
    for breakdown in &card.breakdowns {
        object[breakdown.key] = lines(breakdown);
    }
    object["list"] = card.rows.iter().map(trial).collect();
    object
}

fn lines(breakdown: &Breakdown) -> Value {
    let line = |line: &BreakdownLine| {
        let mut object = line.labels.clone();
        let counts = breakdown.columns.iter().zip(&line.counts);
        object.extend(counts.map(|((key, _), count)| ((*key).into(), json!(count))));
        Value::Object(object)
    };
    breakdown.lines.iter().map(line).collect()
}

fn trial(row: &TrialRow) -> Value {
    let (truth, outcome) = (&row.truth, row.outcome());
    json!({
        "trial": truth.trial,
        "kind": truth.kind,
        "truth": row.truth_name(),
        "right": row.right,
        "rival": truth.rival,
        "targets": truth.targets,
        "places": truth.places,
        "information": truth.information,
        "held": row.held(),
        "step_information": truth.step,
        "nuisance": row.nuisance(),
        "answer": row.answer_text(),
        "fate": row.fate(),
        "stated": outcome.and_then(|o| o.stated()),
        "target": outcome.and_then(|o| o.target.as_ref()),
        "closed": outcome.and_then(|o| o.closed),
        "true_closed": row.true_share.and_then(|share| share.closed),
        "failure": row.answer.failure,
        "redraws": truth.redraws,
        "passes": outcome.map(|o| o.passes),
        "seconds": row.answer.seconds,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evaluate::trials::fixture::{many, scorecards};
    use crate::report::document::escaped;
    use crate::report::fixture::validator;

    #[test]
    fn full_and_empty_scorecards_keep_to_the_contract() {
        let [full, empty] = scorecards();
        for card in [full, empty, many()] {
            let read: Value = serde_json::from_str(&card.json().to_string()).unwrap();
            let complaints: Vec<String> = (validator("scorecard").iter_errors(&read))
                .map(|error| format!("{}: {error}", error.instance_path()))
                .collect();
            assert!(complaints.is_empty(), "{complaints:?}");
        }
    }

    #[test]
    fn the_page_stands_alone() {
        let [full, empty] = scorecards();
        for card in [&full, &empty] {
            let page = card.html();
            assert!(page.starts_with("<!doctype html>") && page.ends_with("</html>\n"));
            assert!(!page.contains("src=") && !page.contains("<script"));
            let links = page.matches("href=").count();
            assert_eq!(links, page.matches("href=\"#").count());
        }
        assert_eq!(full.html().matches("<svg").count(), 2);
        assert!(full.html().contains("<td class=\"right\""));
    }

    /// Every score of the JSON stands on terminal and page, with its count.
    #[test]
    fn terminal_and_page_have_every_score() {
        let card = many();
        let (text, page) = (card.text(), card.html());
        let headline = "False alarms: 0 of 29. Gaps detected: 72 of 90.";
        assert!(page.contains(headline) && text.starts_with(headline));
        for score in &card.scores {
            for (report, words) in [(&text, score.words), (&page, &*escaped(score.words))] {
                let line = report.split(words).nth(1).unwrap();
                assert!(line.contains(&of(score.value)), "{}", score.words);
            }
        }
        assert!(text.contains("above 30 nats") && text.contains("always no gap"));
    }
}
