//! Section on the location of a gap: in the twin, in time, missing functions, at values, lags and frequencies.

use crate::diagnose::{Diagnosis, Location, Maps, Verdict, Window};
use crate::report::digits::{chance, percent, short, unit_suffix};
use crate::report::gap::headline::{accepted_ids, accepted_places, places, somewhere};
use crate::report::gap::pictures;
use crate::report::gap::words::{few, joined};
use crate::report::page::Column::{self, Number, Text};
use crate::report::page::{Section, figure, folded, paragraph, subheading, table};
use crate::report::units::Units;
use crate::study::Study;

/// Meaning of the score of a cell.
const SCORE: &str = "Score: standard deviations above white noise.";

pub(super) fn section_of(study: &Study, diagnosis: &Diagnosis) -> Section {
    let body = match diagnosis.verdict {
        Verdict::StructuralGap => body(study, diagnosis),
        _ => paragraph("There is no structural gap to locate."),
    };
    Section::new("where", "Where", body)
}

fn body(study: &Study, diagnosis: &Diagnosis) -> String {
    let units = Units::of(study);
    let together: Vec<String> = (accepted_places(diagnosis).into_iter())
        .map(|place| units.in_words(place))
        .collect();
    let mut body = targets(diagnosis);
    body.push_str(&match somewhere(&units, &diagnosis.location) {
        Some(_) if together.len() > 1 => paragraph(&format!(
            "The missing laws act on {}.",
            joined(&together, "and")
        )),
        Some([place, _]) if diagnosis.location.class.is_empty() => {
            paragraph(&format!("The missing law acts on {place}."))
        }
        Some([places, _]) => paragraph(&format!(
            "The missing law acts on {places}: this record cannot tell which."
        )),
        None => String::new(),
    });
    body.push_str(&time(diagnosis));
    body.push_str(&functions(study, diagnosis));
    if let Some(svg) = pictures::regions(study, diagnosis) {
        body.push_str(&figure(
            &svg,
            "Shares of the best explanation's gain, by the filtered state or the input one step before, and by the predicted output; \
             all ranges of all variables add up to 100 %. Only ranges that stand out from white noise.",
        ));
        body.push_str(&ranges(study, diagnosis));
    }
    let further: String = [
        (
            pictures::channels(study, diagnosis),
            "Share of each output in the misfit that stands out from white noise.",
        ),
        (
            pictures::lags(diagnosis),
            "Shares of the squared correlations beyond chance. An output on its own past: missing memory, or noise that is not \
             white; on the past of an input: a missing path or delay.",
        ),
        (
            pictures::bands(diagnosis),
            "Shares of the innovations’ power beyond chance.",
        ),
    ]
    .into_iter()
    .filter_map(|(svg, caption)| Some(figure(&svg?, caption)))
    .collect();
    if !further.is_empty() {
        body.push_str(&folded("By output, lag and frequency", &further));
    }
    body
}

/// Places in the twin.
fn targets(diagnosis: &Diagnosis) -> String {
    let Some(svg) = pictures::targets(diagnosis) else {
        return String::new();
    };
    let place = &diagnosis.location;
    let named = match places(diagnosis).as_slice() {
        [] => String::new(),
        [one] => format!(" Filled bar and bold name: {one}."),
        several => format!(" Filled bars and bold names: {}.", few(several)),
    };
    let caption = format!("Posterior probability of each place, given a gap.{named}");
    let rows: Vec<Vec<String>> = (place.targets.iter())
        .map(|t| vec![t.target.clone(), chance(t.probability)])
        .collect();
    let head = [("place", Text), ("probability", Number)];
    let numbers = table("All tested places.", &head, &rows);
    figure(&svg, &caption) + &folded("Places in numbers", &numbers)
}

/// Ranges in numbers.
fn ranges(study: &Study, diagnosis: &Diagnosis) -> String {
    let units = Units::of(study);
    let rows: Vec<Vec<String>> = (diagnosis.location.maps.notable().regions.iter())
        .map(|r| {
            let unit = unit_suffix(units.variable(&r.variable));
            vec![
                r.variable.clone(),
                format!("{} … {}{unit}", short(r.low), short(r.high)),
                percent(r.share),
                short(r.score),
            ]
        })
        .collect();
    let head = [
        ("variable", Text),
        ("range", Number),
        ("share", Number),
        ("score", Number),
    ];
    let caption = format!("Ranges that stand out, clearest first. {SCORE}");
    let numbers = table(&caption, &head, &rows);
    folded("Ranges in numbers", &numbers)
}

/// When, before and after the effect.
fn time(diagnosis: &Diagnosis) -> String {
    let place = &diagnosis.location;
    let Some(svg) = pictures::time(diagnosis) else {
        return String::new();
    };
    let mut lead = match &place.onset {
        Some(o) => format!(
            "A change of {} at {} s explains the record best. ",
            o.parameter,
            short(o.time)
        ),
        None => String::new(),
    };
    lead.push_str(&format!("{}.", standing(&place.maps)));
    if let Some(after) = &place.after {
        let added = match diagnosis.cause.accepted.as_slice() {
            [] => "the best explanation".into(),
            _ => accepted_ids(&diagnosis.cause),
        };
        lead.push_str(&format!(
            " With {added} added: {}.",
            standing(after).to_lowercase()
        ));
    }
    let caption = "Shares of the gap by window and output. Frame and bold text: the window stands out; no frame: like white noise.";
    let numbers = table(
        &format!("Windows in order of time. {SCORE}"),
        &head(place),
        &rows(place),
    );
    [
        subheading("In time"),
        paragraph(&lead),
        figure(&svg, caption),
        folded("Windows in numbers", &numbers),
    ]
    .concat()
}

/// Returns the number of windows that stand out.
fn standing(maps: &Maps) -> String {
    match (maps.notable().windows.len(), maps.windows.len()) {
        (0, _) => "No window stands out from white noise".into(),
        (some, all) => format!("{some} of {all} windows stand out from white noise"),
    }
}

fn channel(channel: &str, record: usize) -> String {
    match record {
        0 => channel.into(),
        _ => format!("{channel}, record {}", record + 1),
    }
}

/// Columns of the windows' table.
fn head(place: &Location) -> Vec<(&'static str, Column)> {
    let mut head = vec![
        ("output", Text),
        ("from, s", Number),
        ("to, s", Number),
        ("share", Number),
        ("score", Number),
    ];
    if place.after.is_some() {
        head.extend([("share with the effect", Number), ("score with it", Number)]);
    }
    head
}

/// A row a window.
fn rows(place: &Location) -> Vec<Vec<String>> {
    let mut windows: Vec<&Window> = place.maps.windows.iter().collect();
    windows.sort_by(|a, b| {
        let key = |w: &Window| (w.record, w.channel.clone());
        (key(a).cmp(&key(b))).then(a.start.total_cmp(&b.start))
    });
    let row = |w: &Window| {
        let mut cells = vec![
            channel(&w.channel, w.record),
            short(w.start),
            short(w.end),
            percent(w.share),
            short(w.score),
        ];
        if let Some(after) = &place.after {
            let same =
                |o: &&Window| (o.record, &o.channel, o.start) == (w.record, &w.channel, w.start);
            let [share, score] = match after.windows.iter().find(same) {
                Some(o) => [percent(o.share), short(o.score)],
                None => ["–", "–"].map(String::from),
            };
            cells.extend([share, score]);
        }
        cells
    };
    windows.into_iter().map(row).collect()
}

/// Returns the functions that the twin lacks.
fn functions(study: &Study, diagnosis: &Diagnosis) -> String {
    let Some(svg) = pictures::functions(study, diagnosis) else {
        return String::new();
    };
    let units = Units::of(study);
    let rows: Vec<Vec<String>> = (diagnosis.location.functions.iter())
        .map(|f| {
            let beside = match f.on_top {
                true => "on top of the accepted effects",
                false => "beside the twin alone",
            };
            vec![
                units.place(&f.place),
                units.named(&f.variable),
                beside.into(),
                short(f.log_evidence),
            ]
        })
        .collect();
    let head = [
        ("joins the", Text),
        ("depends on", Text),
        ("fitted", Text),
        ("nats", Number),
    ];
    let numbers = table(
        "Fitted functions, clearest first; their values stand in report.json.",
        &head,
        &rows,
    );
    [
        subheading("Missing functions"),
        paragraph(
            "Each unknown function is fitted together with parameters and noise levels. Above zero, the twin gives too little; below, too much.",
        ),
        figure(
            &svg,
            "Mean and band of ± 1 standard error over the range that the records show. A function on top of the accepted effects shows \
             what they do not explain: it should stay near zero.",
        ),
        folded("Functions in numbers", &numbers),
    ]
    .concat()
}
