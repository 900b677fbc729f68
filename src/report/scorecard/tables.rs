//! The tables and pictures of a scorecard, for the terminal and for the page.

use crate::evaluate::Count;
use crate::evaluate::trials::{Breakdown, BreakdownLine, Kind, Scorecard, TrialRow};
use crate::report::chart::{Bar, BarGroup, Dot, Dots, Line, Panel, Style, bar_chart, chart};
use crate::report::digits::{percent, short};
use crate::report::document::Block;
use crate::report::document::Column::{self, Number, Text};
use serde_json::Value;

/// Counts over all trials.
pub(super) fn scores(card: &Scorecard) -> Block {
    let row = |name: &str, count| [vec![name.to_owned()], counted(count).to_vec()].concat();
    Block::table(
        "Counts over all trials. Intervals are Clopper and Pearson’s.",
        &[&[("score", Text)], &COUNTED[..]].concat(),
        card.scores
            .iter()
            .map(|score| row(score.words, score.value))
            .collect(),
    )
}

/// Other numbers over all trials.
pub(super) fn figures(card: &Scorecard) -> Block {
    let value = |value: &Value| value.as_f64().map_or("–".into(), short);
    let rows = (card.figures.iter())
        .map(|figure| vec![figure.words.into(), value(&figure.value)])
        .collect();
    let head = [("figure", Text), ("value", Number)];
    Block::table("Numbers over all trials.", &head, rows)
}

/// Counts by groups of trials: key of the breakdown, its caption, heads of the labels.
const BREAKDOWNS: [(&str, &str, &[&str]); 8] = [
    (
        "by_information",
        "Every trial with a gap, by its expected information. Missed and failed ones are the rest of the trials. Partial: everything \
         accepted is right, and more is said to be missing. Unknown, rightly: of trials in which nothing listed is right, those that say \
         so and name nothing false.",
        &["truth", "information", "trials"],
    ),
    (
        "clear_by_information",
        "The same of the records that decide: every listed effect that is wrong leaves more than 3 nats of the departure.",
        &["truth, clear", "information", "trials"],
    ),
    (
        "by_held",
        "Listed truths by the evidence that their records turned out to hold: log evidence of the true effects over the twin alone, fitted \
         once the keys are open.",
        &["truth", "evidence held", "trials"],
    ),
    (
        "by_kind",
        "Kinds of truth, and what counts as right.",
        &["kind", "right answer", "trials"],
    ),
    ("by_nuisance", "Trials under each nuisance.", &["nuisance"]),
    (
        "reliability",
        "Most probable effects of about the same stated probability.",
        &["stated, mean"],
    ),
    (
        "steadiness",
        "Diagnoses repeated: the same verdict, decision and accepted effects.",
        &["change"],
    ),
    (
        "baselines",
        "The same trials, answered in simple ways.",
        &["answers of"],
    ),
];

/// The table of the breakdown with this key; `None` without lines.
pub(super) fn breakdown(card: &Scorecard, key: &str) -> Option<Block> {
    let (_, caption, labels) = BREAKDOWNS.into_iter().find(|(known, ..)| *known == key)?;
    let found = card
        .breakdown(key)
        .filter(|found| !found.lines.is_empty())?;
    let mut head: Vec<(&str, Column)> = labels.iter().map(|label| (*label, Text)).collect();
    match found.columns.len() {
        1 => head.extend(COUNTED),
        _ => {
            let columns = found.columns.iter().filter(|(_, words)| !words.is_empty());
            head.extend(columns.map(|(_, words)| (*words, Number)));
        }
    }
    let rows = found
        .lines
        .iter()
        .map(|line| cells(found, line, labels.len()));
    Some(Block::table(caption, &head, rows.collect()))
}

/// One line: its labels, the number of its trials where there is a column for it, its counts.
fn cells(breakdown: &Breakdown, line: &BreakdownLine, labels: usize) -> Vec<String> {
    let text = |key: &str| match line.label(key) {
        Value::String(text) => text.clone(),
        number => number.as_f64().map_or("–".into(), |v| format!("{v:.2}")),
    };
    let rule = |kind: &str| Kind::named(kind).map_or("–", Kind::rule).to_owned();
    let trials = line
        .counts
        .first()
        .copied()
        .flatten()
        .filter(|_| labels == 3);
    let mut cells = match breakdown.key {
        "by_kind" => vec![text("kind"), rule(&text("kind"))],
        "by_nuisance" => vec![text("nuisance")],
        "reliability" => vec![text("stated")],
        "steadiness" => vec![text("change")],
        "baselines" => vec![text("name")],
        _ => vec![text("truths"), nats(line)],
    };
    cells.extend(trials.map(|count| count.of.to_string()));
    if let (1, Some(Some(count))) = (breakdown.columns.len(), line.counts.first()) {
        cells.extend(counted(*count));
        return cells;
    }
    for ((_, words), count) in breakdown.columns.iter().zip(&line.counts) {
        match count {
            _ if words.is_empty() => {}
            None => cells.push("–".into()),
            // The column of the trials has the denominator.
            Some(count) if trials.is_some_and(|trials| trials.of == count.of) => {
                cells.push(count.count.to_string());
            }
            Some(count) => cells.push(of(*count)),
        }
    }
    cells
}

/// Every trial.
pub(super) fn trials(card: &Scorecard) -> Block {
    let or_dash = |value: Option<f64>| value.map_or("–".into(), short);
    let row = |row: &TrialRow| {
        let stated = row.outcome().and_then(|o| o.stated());
        vec![
            row.truth.trial.to_string(),
            row.truth.kind.to_string(),
            row.truth_name(),
            row.nuisance(),
            or_dash(row.truth.information),
            or_dash(row.truth.rival.as_ref().map(|rival| rival.nats)),
            row.answer_text(),
            stated.map_or("–".into(), |p| format!("{p:.2}")),
            row.fate().to_string().replace('-', " "),
        ]
    };
    let head = [
        ("trial", Number),
        ("kind", Text),
        ("truth", Text),
        ("nuisance", Text),
        ("information, nats", Number),
        ("nearest wrong effect leaves, nats", Number),
        ("answer", Text),
        ("stated", Number),
        ("fate", Text),
    ];
    let rows = card.rows.iter().map(row).collect();
    Block::table("In the order in which they were drawn.", &head, rows)
}

/// Columns of [`counted`].
const COUNTED: [(&str, Column); 3] = [
    ("count", Number),
    ("share", Number),
    ("95 % interval", Number),
];

/// A count with its share and interval.
fn counted(count: Count) -> [String; 3] {
    let (low, high) = count.interval();
    match count.share() {
        None => ["–", "–", "–"].map(Into::into),
        Some(share) => [
            of(count),
            percent(share),
            format!("{:.0} … {:.0} %", 100.0 * low, 100.0 * high),
        ],
    }
}

/// Returns `count of all`, or a dash of nothing.
pub(super) fn of(count: Count) -> String {
    match count.of {
        0 => "–".into(),
        all => format!("{} of {all}", count.count),
    }
}

/// Range of a bin of information.
pub(super) fn nats(line: &BreakdownLine) -> String {
    let low = line.label("low").as_f64().unwrap_or(0.0);
    match line.label("high").as_f64() {
        Some(high) => format!("{low:.0} … {high:.0} nats"),
        None => format!("above {low:.0} nats"),
    }
}

/// Delivered answers by expected information as bars; `None` without gaps.
pub(super) fn delivered_svg(card: &Scorecard) -> Option<String> {
    let bins = card.breakdown("by_information")?;
    let last = bins.lines.last()?;
    let delivered = |line: &BreakdownLine| bins.count(line, "delivered").unwrap_or_default();
    let bar = |line: &BreakdownLine| {
        let delivered = delivered(line);
        let (low, high) = delivered.interval();
        Bar::new(
            &nats(line),
            delivered.share().unwrap_or(f64::NAN),
            &of(delivered),
        )
        .clear(true)
        .interval(Some([low, high]))
    };
    let groups = [
        ("listed", "a listed effect is there"),
        ("random", "a law that nobody listed"),
    ];
    let groups = groups.map(|(truths, label)| {
        let label = format!("{label}: share of right answers, 95 % interval");
        let lines = (bins.lines.iter()).filter(|line| line.label("truths") == truths);
        BarGroup::new(&label, Some(1.0), lines.map(bar).collect()).per_cent()
    });
    let filled = groups.into_iter().filter(|group| !group.bars.is_empty());
    let groups: Vec<BarGroup> = filled.collect();
    let (last, right) = (nats(last), of(delivered(last)));
    let description = format!("Bars with 95 % intervals; {last} {right} delivered.");
    Some(bar_chart(
        "Right answers, by expected information",
        &description,
        &groups,
    ))
}

/// Right answers by stated probability; `None` where no effect was stated.
pub(super) fn reliability_svg(card: &Scorecard) -> Option<String> {
    let dot = |line: &BreakdownLine| {
        let right = line.counts.first().copied().flatten()?;
        let (low, high) = right.interval();
        Some(Dot {
            x: line.label("stated").as_f64()?,
            y: right.share()?,
            low,
            high,
        })
    };
    let lines = &card.breakdown("reliability")?.lines;
    let points: Vec<Dot> = lines.iter().filter_map(dot).collect();
    if points.is_empty() {
        return None;
    }
    let diagonal = [(0.0, 0.0), (1.0, 1.0)];
    let series = vec![Line::new("as stated", Style::RECORD, diagonal)];
    let dots = Dots {
        label: "share, 95 % interval".into(),
        points,
    };
    let panel = Panel::new("share right", series)
        .dots(dots)
        .range(-0.03, 1.03);
    let axis = ("stated probability".to_owned(), vec![panel]);
    let description = "Share of right answers by stated probability, with 95 % intervals; the diagonal is perfect.";
    let title = "How often the most probable effect is right";
    Some(chart(title, description, &[axis]))
}
