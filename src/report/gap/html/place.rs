//! Section on the location of a gap: in the twin, in time, in the equations, at values, lags and frequencies.

use crate::diagnose::{Diagnosis, Location, Maps, Verdict, Window};
use crate::report::digits::{bare, error, percent, probability, short, unit_suffix};
use crate::report::gap::pictures;
use crate::report::page::Column::{self, Number, Text};
use crate::report::page::{Section, figure, folded, paragraph, subheading, table};
use crate::report::units::Units;
use crate::study::Study;

pub(super) fn section_of(study: &Study, diagnosis: &Diagnosis) -> Section {
    let body = match diagnosis.verdict {
        Verdict::StructuralGap => body(study, diagnosis),
        _ => paragraph("There is no structural gap to locate."),
    };
    Section::new("where", "Where", body)
}

fn body(study: &Study, diagnosis: &Diagnosis) -> String {
    let mut body = match &diagnosis.location.target {
        Some(target) => paragraph(&format!("The missing law acts on {target}.")),
        None => String::new(),
    };
    let filled = format!(
        "Filled bars and bold names: p < {}.",
        diagnosis.detection.alpha
    );
    body.push_str(&targets(diagnosis, &filled));
    body.push_str(&time(diagnosis));
    body.push_str(&equations(study, diagnosis));
    if let Some(svg) = pictures::regions(study, diagnosis) {
        let caption = format!(
            "Shares of the best explanation's gain, by the filtered state or the input one step before, and by the predicted output; \
             all ranges of all variables add up to 100 %. Only significant ranges (p ≤ 0.1). {filled}"
        );
        body.push_str(&figure(&svg, &caption));
        body.push_str(&ranges(study, diagnosis));
    }
    let further: String = [
        (
            pictures::channels(study, diagnosis),
            "Share of each output in the significant misfit.",
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
    .filter_map(|(svg, caption)| Some(figure(&svg?, &format!("{caption} {filled}"))))
    .collect();
    if !further.is_empty() {
        body.push_str(&folded("By output, lag and frequency", &further));
    }
    body
}

/// Places in the twin.
fn targets(diagnosis: &Diagnosis, filled: &str) -> String {
    let Some(svg) = pictures::targets(diagnosis) else {
        return String::new();
    };
    let place = &diagnosis.location;
    let alone = match (place.targets.first(), &place.target) {
        (Some(first), Some(target)) if first.target != *target => {
            format!(" Shares compare single explanations; the accepted effects act on {target}.")
        }
        _ => String::new(),
    };
    let caption =
        format!("Probability that the cause of the gap is at this place.{alone} {filled}");
    let rows: Vec<Vec<String>> = (place.targets.iter())
        .map(|t| vec![t.target.clone(), percent(t.share), bare(t.p_value)])
        .collect();
    let head = [("place", Text), ("share", Number), ("p", Number)];
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
                bare(r.p_value),
            ]
        })
        .collect();
    let head = [
        ("variable", Text),
        ("range", Number),
        ("share", Number),
        ("p", Number),
    ];
    let numbers = table("Significant ranges, clearest first.", &head, &rows);
    folded("Ranges in numbers", &numbers)
}

/// When, before and after the effect.
fn time(diagnosis: &Diagnosis) -> String {
    let place = &diagnosis.location;
    let Some(svg) = pictures::time(diagnosis) else {
        return String::new();
    };
    let alpha = diagnosis.detection.alpha;
    let mut lead = match &place.onset {
        Some(o) if o.time <= 0.0 => format!(
            "The twin fails to predict {} from the start on ({}).",
            channel(&o.channel, o.record),
            probability(o.p_value)
        ),
        Some(o) => format!(
            "Fitted to all earlier samples, the twin predicts each stretch until {} s; from there on {} deviates ({}).",
            short(o.time),
            channel(&o.channel, o.record),
            probability(o.p_value)
        ),
        None => "No onset is significant.".into(),
    };
    lead.push_str(&format!(" {}.", standing(&place.maps)));
    if let Some(after) = &place.after {
        let added = match diagnosis.cause.accepted.as_slice() {
            [] => "the best explanation".into(),
            accepted => accepted.join(" and "),
        };
        lead.push_str(&format!(
            " With {added} added: {}.",
            standing(after).to_lowercase()
        ));
    }
    let caption = format!(
        "Shares of the gap by window and output. Unbroken frame and bold text: p < {alpha}; dashed frame: p ≤ 0.1; no frame: as in \
         simulations of the twin. p is corrected for all cells of all maps."
    );
    let numbers = table("Windows in order of time.", &head(place), &rows(place));
    [
        subheading("In time"),
        paragraph(&lead),
        figure(&svg, &caption),
        folded("Windows in numbers", &numbers),
    ]
    .concat()
}

/// Returns the number of significant windows.
fn standing(maps: &Maps) -> String {
    match (maps.notable().windows.len(), maps.windows.len()) {
        (0, _) => "No window is significant".into(),
        (some, all) => format!("{some} of {all} windows are significant"),
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
        ("p", Number),
    ];
    if place.after.is_some() {
        head.extend([("share with the effect", Number), ("p with it", Number)]);
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
            bare(w.p_value),
        ];
        if let Some(after) = &place.after {
            let same =
                |o: &&Window| (o.record, &o.channel, o.start) == (w.record, &w.channel, w.start);
            let [share, p] = match after.windows.iter().find(same) {
                Some(o) => [percent(o.share), bare(o.p_value)],
                None => ["–", "–"].map(String::from),
            };
            cells.extend([share, p]);
        }
        cells
    };
    windows.into_iter().map(row).collect()
}

/// Returns the terms that the equations lack.
fn equations(study: &Study, diagnosis: &Diagnosis) -> String {
    let Some(svg) = pictures::equations(study, diagnosis) else {
        return String::new();
    };
    let units = Units::of(study);
    let equations = &diagnosis.location.equations;
    let lead = match equations.first() {
        Some(first) => format!(
            "A disturbance in the {} explains the record best ({} among all equations, {}).",
            units.equation_name(&first.equation),
            percent(first.share),
            probability(first.p_value)
        ),
        None => String::new(),
    };
    // All others stand in report.json.
    let clear = |i: usize, p: f64| i == 0 || p < diagnosis.detection.alpha;
    let rows: Vec<Vec<String>> = (equations.iter().enumerate())
        .filter(|(i, e)| clear(*i, e.p_value))
        .map(|(_, e)| e)
        .flat_map(|e| e.term.iter().map(move |t| (e, t)))
        .map(|(e, t)| {
            vec![
                units.equation_name(&e.equation),
                t.variable.clone(),
                format!("{} … {}", short(t.low), short(t.high)),
                short(t.mean),
                error(t.std_error),
                units.equation_unit(&e.equation),
            ]
        })
        .collect();
    let head = [
        ("equation", Text),
        ("variable", Text),
        ("range", Number),
        ("mean missing term", Number),
        ("std. error", Number),
        ("unit", Text),
    ];
    let numbers = table("Significant equations, by ranges.", &head, &rows);
    [
        subheading("In the equations"),
        paragraph(&lead),
        figure(
            &svg,
            "Term that each equation lacks: means by ranges of each variable. Boxes: ± one standard error; thick lines: more than two \
             from zero. Bold heading: the equation is significant.",
        ),
        folded("Equations in numbers", &numbers),
    ]
    .concat()
}
