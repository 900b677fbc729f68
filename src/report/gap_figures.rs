//! The pictures of a diagnosis.

use super::chart::{Bar, BarChart, BarGroup, Chart, Panel, Series, Span, Style, roomy};
use super::digits::{chance, named, percent, probability, short, unit_suffix};
use super::units::Units;
use crate::diagnose::{Decision, Diagnosis, FreeRuns, Shrinkage};
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
                false => panel.spans(windows(found, &output.name)),
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

/// Windows of the first record.
fn windows(found: &Diagnosis, channel: &str) -> Vec<Span> {
    let notable = found.place.maps.notable().windows;
    let own = (notable.iter()).filter(|w| w.record == 0 && w.channel == channel);
    let mut spans: Vec<Span> = own
        .map(|w| Span {
            from: w.start,
            to: w.end,
            label: percent(w.share),
            weight: w.share,
            clear: w.p_value < found.detection.alpha,
        })
        .collect();
    spans.sort_by(|a, b| a.from.total_cmp(&b.from));
    spans
}

/// Places in the twin by the probability of what explains the gap there; `None` where nothing was looked for.
pub fn gap_targets_svg(found: &Diagnosis) -> Option<String> {
    let targets = &found.place.targets;
    let first = targets.first()?;
    let bars = (targets.iter())
        .map(|t| {
            let note = format!("{}, {}", percent(t.share), probability(t.p_value));
            Bar::new(&t.target, t.share, &note).clear(t.p_value < found.detection.alpha)
        })
        .collect();
    let chart = BarChart {
        title: "Where in the twin".into(),
        description: format!(
            "Bars of {} places; the first is {} with {}.",
            targets.len(),
            first.target,
            percent(first.share)
        ),
        groups: vec![group("", Some(1.0), bars)],
    };
    Some(chart.svg())
}

/// Ranges of states and inputs that stand out; `None` where none does.
pub fn gap_regions_svg(study: &Study, found: &Diagnosis) -> Option<String> {
    let units = Units::of(study);
    let regions = found.place.maps.notable().regions;
    let clearest = regions.first()?;
    let mut variables: Vec<&str> = regions.iter().map(|r| r.variable.as_str()).collect();
    variables.sort_unstable();
    variables.dedup();
    let groups = (variables.into_iter())
        .map(|variable| {
            let unit = unit_suffix(units.variable(variable));
            let mut own: Vec<_> = regions.iter().filter(|r| r.variable == variable).collect();
            own.sort_by(|a, b| a.low.total_cmp(&b.low));
            let bar = |r: &&crate::diagnose::Region| {
                let label = format!("{} … {}{unit}", short(r.low), short(r.high));
                let note = format!("{}, {}", percent(r.share), probability(r.p_value));
                Bar::new(&label, r.share, &note).clear(r.p_value < found.detection.alpha)
            };
            BarGroup {
                label: variable.into(),
                full: None,
                bars: own.iter().map(bar).collect(),
            }
        })
        .collect();
    let chart = BarChart {
        title: "At which states and inputs".into(),
        description: format!(
            "Bars of {} ranges; the longest is {} from {} to {}.",
            regions.len(),
            clearest.variable,
            short(clearest.low),
            short(clearest.high)
        ),
        groups,
    };
    Some(chart.svg())
}

/// Listed effects by probability, then everything else together; `None` where none was fitted.
pub fn gap_which_svg(found: &Diagnosis) -> Option<String> {
    let which = &found.which;
    let first = which.effects.first()?;
    let mut bars: Vec<Bar> = (which.effects.iter().take(SHOWN))
        .map(|effect| {
            let (key, gain) = (effect.key(), short(effect.log_score_gain));
            let note = format!("{}, {gain} nats", chance(effect.probability));
            Bar::new(&key, effect.probability, &note).clear(which.accepted.contains(&key))
        })
        .collect();
    // What absorbs a parameter gap is compared with no others.
    if which.decision != Decision::Absorbed {
        let listed: f64 = bars.iter().map(|bar| bar.value).sum();
        let rest = (1.0 - listed).max(0.0);
        bars.push(Bar::new("all others, unlisted too", rest, &chance(rest)));
    }
    let chart = BarChart {
        title: "Explanations by probability".into(),
        description: format!(
            "Bars of the best explanations; the first is {} with {}.",
            first.key(),
            chance(first.probability)
        ),
        groups: vec![group("", Some(1.0), bars)],
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
