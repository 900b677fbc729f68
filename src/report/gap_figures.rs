//! The pictures of a diagnosis: measured and twin, which effect, how far. Where, what next and exploration have their own files.

mod discovery;
mod equations;
mod next;
mod places;
mod time;

pub use discovery::{gap_missing_svg, gap_terms_svg};
pub use equations::gap_equations_svg;
pub use next::gap_next_input_svg;
pub use places::{gap_bands_svg, gap_channels_svg, gap_lags_svg, gap_regions_svg, gap_targets_svg};
pub use time::gap_time_svg;

use super::chart::{Bar, BarChart, BarGroup, Chart, Edge, Mark, Panel, Series, Span, Style, roomy};
use super::digits::{chance, named, percent, short};
use super::units::Units;
use crate::diagnose::{Cell, Decision, Diagnosis, EffectFit, FreeRuns, Maps, Onset, Shrinkage};
use crate::study::Study;

/// Explanations that are drawn.
const SHOWN: usize = 8;

/// Measured outputs with the twin running free over them, before and after accepted effects; below the first record the
/// windows of time that stand out. `None` for the validation record where there is none.
///
/// What leaves the picture far above or below the measured values is broken off.
pub fn gap_runs_svg(study: &Study, found: &Diagnosis, validation: bool) -> Option<String> {
    let runs = match validation {
        true => found.validation_runs.as_ref()?,
        false => &found.free_runs,
    };
    let outputs = Units::of(study).outputs;
    let panels = (outputs.iter().enumerate())
        .map(|(j, output)| {
            let panel = Panel::new(&named(output), series(runs, j));
            match validation {
                true => panel,
                false => (panel.spans(windows(found, &output.name))).marks(
                    onset(found.place.onset.as_ref(), 0, &output.name)
                        .into_iter()
                        .collect(),
                ),
            }
        })
        .collect();
    let record = if validation {
        "validation record"
    } else {
        "record"
    };
    let after = match runs.after {
        Some(_) => ", and with the accepted effects",
        None => "",
    };
    let (name, end) = (&found.twin, runs.times.last().copied().unwrap_or(0.0));
    let chart = Chart {
        title: format!("{name}: {record} and twin, running free"),
        description: format!(
            "Measured outputs of the {record} over {} s; the refitted twin without noise{after}.",
            short(end)
        ),
        x: "t in s".into(),
        panels,
    };
    Some(chart.svg())
}

/// Lines of one output.
fn series(runs: &FreeRuns, channel: usize) -> Vec<Series> {
    let shown = roomy(runs.measured.column(channel).iter().copied());
    let lines = [
        ("measured", Style::RECORD, Some(&runs.measured)),
        ("twin, refitted", Style::BEFORE, runs.before.as_ref()),
        ("with effects", Style::AFTER, runs.after.as_ref()),
    ];
    (lines.into_iter())
        .filter_map(|(label, style, signal)| {
            let values = signal?.column(channel).to_vec();
            let points = runs.times.iter().copied().zip(values);
            Some(Series::new(label, style, points).within(shown.clone()))
        })
        .collect()
}

/// Windows of the first record that stand out.
fn windows(found: &Diagnosis, channel: &str) -> Vec<Span> {
    let notable = found.place.maps.notable();
    let full = largest(&notable);
    spans(&notable, found.detection.alpha, full, (0, channel))
}

/// The largest share of a window: as dark as it gets.
fn largest(maps: &Maps) -> f64 {
    (maps.windows.iter().map(|w| w.share)).fold(f64::MIN_POSITIVE, f64::max)
}

/// Windows of one record and output, by time; a share of `full` is as dark as it gets.
fn spans(maps: &Maps, alpha: f64, full: f64, (record, channel): (usize, &str)) -> Vec<Span> {
    let own = (maps.windows.iter()).filter(|w| w.record == record && w.channel == channel);
    let mut spans: Vec<Span> = own
        .map(|w| Span {
            from: w.start,
            to: w.end,
            label: percent(w.share),
            weight: w.share / full,
            edge: edge(w, alpha),
        })
        .collect();
    spans.sort_by(|a, b| a.from.total_cmp(&b.from));
    spans
}

/// The frame that says how much a cell stands out.
fn edge(cell: &impl Cell, alpha: f64) -> Edge {
    match cell {
        cell if cell.p_value() < alpha => Edge::Unbroken,
        cell if cell.is_notable() => Edge::Dashed,
        _ => Edge::Bare,
    }
}

/// The onset, where it is in this record and output.
fn onset(onset: Option<&Onset>, record: usize, channel: &str) -> Option<Mark> {
    let onset = onset?;
    (onset.record == record && onset.channel == channel).then(|| Mark {
        x: onset.time,
        label: format!("onset {} s", short(onset.time)),
    })
}

/// Listed effects by probability, then everything else together; `None` where none was fitted.
pub fn gap_which_svg(found: &Diagnosis) -> Option<String> {
    let which = &found.which;
    let first = which.effects.first()?;
    let bar = |effect: &EffectFit| {
        let (key, gain) = (effect.key(), short(effect.log_score_gain));
        let note = format!("{}, {gain} nats", chance(effect.probability));
        Bar::new(&key, effect.probability, &note).clear(which.accepted.contains(&key))
    };
    let shown = || which.effects.iter().take(SHOWN);
    let is_rival =
        |e: &&EffectFit| which.decision == Decision::Class && which.class.contains(&e.key());
    let rivals: Vec<Bar> = shown().filter(is_rival).map(bar).collect();
    let mut others: Vec<Bar> = shown().filter(|e| !is_rival(e)).map(bar).collect();
    // What absorbs a parameter gap is compared with no others.
    if which.decision != Decision::Absorbed {
        let listed: f64 = shown().map(|e| e.probability).sum();
        let rest = (1.0 - listed).max(0.0);
        others.push(Bar::new("all others, unlisted too", rest, &chance(rest)));
    }
    let groups = match rivals.is_empty() {
        true => vec![group("", Some(1.0), others)],
        false => vec![
            group("One class: not told apart by these data", Some(1.0), rivals),
            group("Outside the class", Some(1.0), others),
        ],
    };
    let chart = BarChart {
        title: "Explanations by probability".into(),
        description: format!(
            "Bars of the best explanations; the first is {} with {}.",
            first.key(),
            chance(first.probability)
        ),
        groups,
    };
    Some(chart.svg())
}

/// Free-run errors on held-out data, and the share of the gap that closes; `None` without such data, and for effects that move
/// no free run.
pub fn gap_shrinkage_svg(found: &Diagnosis) -> Option<String> {
    let s = found.shrinkage.as_ref()?;
    if s.metric != Shrinkage::FREE_RUN {
        return None;
    }
    let errors = [
        ("not refitted", s.unfitted, false),
        ("before, refitted", Some(s.before), false),
        ("a wrong effect instead", s.placebo, false),
        ("after, with effects", s.after, true),
        ("floor, noise alone", s.floor, false),
    ];
    let bars = (errors.into_iter())
        .filter_map(|(label, value, clear)| {
            Some(Bar::new(label, value?, &short(value?)).clear(clear))
        })
        .collect();
    let mut groups = vec![group(&format!("{}, {}", s.metric, s.held_out), None, bars)];
    if let (Some(closed), Some(ends)) = (s.closed, s.interval) {
        let [low, high] = ends.map(percent);
        let note = format!("{} ({low} to {high})", percent(closed));
        let bars = vec![
            Bar::new("closed, 90 % interval", closed, &note)
                .clear(true)
                .interval(Some(ends)),
        ];
        groups.push(group("Share of the gap", Some(1.0), bars));
    }
    let after = s
        .after
        .map_or(String::new(), |after| format!(", {} after", short(after)));
    let chart = BarChart {
        title: match s.after {
            Some(_) => "How far the gap closes".into(),
            None => "Errors of free runs".into(),
        },
        description: format!("Errors of free runs: {} before{after}.", short(s.before)),
        groups,
    };
    Some(chart.svg())
}

fn group(label: &str, full: Option<f64>, bars: Vec<Bar>) -> BarGroup {
    BarGroup {
        label: label.into(),
        full,
        bars,
    }
}
