//! Pictures along time or a variable: records, windows, the next input, missing functions.

use crate::diagnose::{Cell, Diagnosis, Maps, MissingFunction, Onset};
use crate::math::ascending;
use crate::report::chart::{
    Area, HeatGroup, HeatRow, Line, Panel, Span, Style, TimeMark, chart, heat_map,
};
use crate::report::digits::{in_unit, named, percent, short};
use crate::report::gap::statement::accepted_ids;
use crate::report::record::{RecordPicture, Run};
use crate::report::units::Units;
use crate::study::Study;

/// Windows of time by output, of the refitted twin and, below, with the accepted effects added; `None` where nothing was looked for.
///
/// Each cell has its share; frames say which cells stand out.
pub fn time(diagnosis: &Diagnosis) -> Option<String> {
    let maps = &diagnosis.location.maps;
    let clearest = maps.windows.first()?;
    let after = (diagnosis.location.after.as_ref()).filter(|m| !m.windows.is_empty());
    let full = largest(maps).max(after.map_or(0.0, largest));
    let onset = diagnosis.location.onset.as_ref();
    let mut groups = of_records("twin, refitted", maps, onset, full);
    if let Some(after) = after {
        groups.extend(of_records(&with_effects(diagnosis), after, None, full));
    }
    let windows = |maps: &Maps| maps.notable().windows.len();
    let after = after.map_or(String::new(), |after| {
        format!("; with the effect added, {} stand out", windows(after))
    });
    let description = format!(
        "{} of {} windows stand out, the clearest in {} from {} to {} s with {} of the gap{after}.",
        windows(maps),
        maps.windows.len(),
        clearest.channel,
        short(clearest.start),
        short(clearest.end),
        percent(clearest.share),
    );
    Some(heat_map("Windows of time", &description, &groups))
}

/// Returns the label of the second map.
fn with_effects(diagnosis: &Diagnosis) -> String {
    match diagnosis.cause.accepted.as_slice() {
        [] => "with the best explanation added".into(),
        _ => format!("with {} added", accepted_ids(&diagnosis.cause)),
    }
}

/// A group a record, a row an output; the change is marked above the first row.
fn of_records(label: &str, maps: &Maps, change: Option<&Onset>, full: f64) -> Vec<HeatGroup> {
    let last = (maps.windows.iter().map(|w| w.record)).max().unwrap_or(0);
    (0..=last)
        .map(|record| {
            let mut channels: Vec<&str> = vec![];
            for window in maps.windows.iter().filter(|w| w.record == record) {
                if !channels.contains(&window.channel.as_str()) {
                    channels.push(&window.channel);
                }
            }
            channels.sort_unstable();
            HeatGroup {
                label: match last {
                    0 => label.into(),
                    _ => format!("record {}: {label}", record + 1),
                },
                rows: (channels.into_iter().enumerate())
                    .map(|(i, channel)| HeatRow {
                        label: channel.into(),
                        cells: spans(maps, full, (record, channel)),
                        mark: change.filter(|_| i == 0).map(mark),
                    })
                    .collect(),
            }
        })
        .filter(|group| !group.rows.is_empty())
        .collect()
}

/// Windows of the first record that stand out.
pub(super) fn windows(diagnosis: &Diagnosis, channel: &str) -> Vec<Span> {
    let notable = diagnosis.location.maps.notable();
    let full = largest(&notable);
    spans(&notable, full, (0, channel))
}

/// The largest share of a window: as dark as it gets.
pub(super) fn largest(maps: &Maps) -> f64 {
    (maps.windows.iter().map(|w| w.share)).fold(f64::MIN_POSITIVE, f64::max)
}

/// Windows of one record and output, by time; a share of `full` is as dark as it gets.
pub(super) fn spans(maps: &Maps, full: f64, (record, channel): (usize, &str)) -> Vec<Span> {
    let own = (maps.windows.iter()).filter(|w| w.record == record && w.channel == channel);
    let mut spans: Vec<Span> = own
        .map(|w| Span {
            from: w.start,
            to: w.end,
            label: percent(w.share),
            weight: w.share / full,
            clear: w.is_notable(),
        })
        .collect();
    ascending(&mut spans, |a| a.from);
    spans
}

/// The time of a change.
pub(super) fn mark(onset: &Onset) -> TimeMark {
    TimeMark {
        x: onset.time,
        label: format!("change at {} s", short(onset.time)),
    }
}

/// Measured outputs with the twin running free over them, before and after accepted effects, and what is left below; the windows of time
/// that stand out in the first record. `None` for the validation record where there is none.
pub fn runs(study: &Study, diagnosis: &Diagnosis, validation: bool) -> Option<String> {
    let (runs, record) = match validation {
        true => (diagnosis.validation_runs.as_ref()?, "validation record"),
        false => (&diagnosis.free_runs, "record"),
    };
    let spans = |output: &str| -> Vec<Span> {
        match validation {
            true => vec![],
            false => windows(diagnosis, output),
        }
    };
    let change = diagnosis.location.onset.as_ref().filter(|_| !validation);
    let lines = [
        ("twin, refitted", Style::BEFORE, runs.before.as_ref()),
        ("with effects", Style::AFTER, runs.after.as_ref()),
    ];
    let picture = RecordPicture {
        title: format!("{}: {record} and twin", diagnosis.twin),
        outputs: &Units::of(study).signals.outputs,
        times: &runs.times,
        measured: &runs.measured,
        runs: (lines.into_iter())
            .filter_map(|(label, style, run)| Some(Run(label, style, run?)))
            .collect(),
        spans: &spans,
        marks: change.map(mark).into_iter().collect(),
    };
    Some(picture.svg())
}

/// The disturbance that fitted noise hides, with its bursts; `None` where there is none.
pub fn disturbance(diagnosis: &Diagnosis) -> Option<String> {
    let disturbance = diagnosis.disturbance()?;
    let spans = (disturbance.bursts.iter())
        .map(|burst| Span {
            from: burst.start,
            to: burst.end,
            label: String::new(),
            weight: 1.0,
            clear: true,
        })
        .collect();
    let line = Line::new("", Style::AFTER, disturbance.course.iter().copied());
    let y = format!("{}{}", disturbance.place, in_unit(&disturbance.unit));
    let panel = Panel::new(&y, vec![line]).spans(spans);
    let description = format!(
        "What pushes {} against time; {} bursts are larger than noise.",
        disturbance.place,
        disturbance.bursts.len()
    );
    let axis = ("t in s".to_owned(), vec![panel]);
    Some(chart("Disturbance", &description, &[axis]))
}

/// The proposed inputs against time, held over each step; `None` where none is proposed, or the twin has no input.
pub fn next_input(study: &Study, diagnosis: &Diagnosis) -> Option<String> {
    let next = diagnosis.cause.next_input.as_ref()?;
    let drive = &next.drive;
    let inputs = Units::of(study).signals.inputs;
    if inputs.is_empty() {
        return None;
    }
    let panels = (inputs.iter().enumerate())
        .filter(|(j, _)| *j < drive.inputs().ncols())
        .map(|(j, input)| {
            let held = (0..drive.samples()).flat_map(|k| {
                let u = drive.input(k)[j];
                [(drive.time(k), u), (drive.time(k + 1), u)]
            });
            Panel::new(&named(input), vec![Line::new("", Style::AFTER, held)]).height(120.0)
        })
        .collect();
    let (kind, samples) = (&next.kind, drive.samples());
    let description = format!(
        "{kind}: {samples} samples over {} s.",
        short(drive.time(samples))
    );
    let axis = ("t in s".to_owned(), panels);
    Some(chart(
        "The input to measure with next",
        &description,
        &[axis],
    ))
}

/// Missing functions with ± one standard error, beside the twin alone and on top of the accepted effects; `None` where none was fitted.
pub fn functions(study: &Study, diagnosis: &Diagnosis) -> Option<String> {
    let units = Units::of(study);
    let all = &diagnosis.location.functions;
    let first = all.first()?;
    let description = format!(
        "{} functions with bands of ± 1 standard error; the clearest depends on {} and joins the {}, {} nats.",
        all.len(),
        first.variable,
        units.place_name(&first.place),
        short(first.log_evidence)
    );
    let axes: Vec<_> = all.iter().map(|function| panel(&units, function)).collect();
    Some(chart("Missing functions", &description, &axes))
}

/// Returns the x axis and the panel of a function.
fn panel(units: &Units, function: &MissingFunction) -> (String, Vec<Panel>) {
    let points = || (function.values.iter().copied()).zip(function.mean.iter().copied());
    let band = (points().zip(&function.std_error))
        .map(|((value, mean), error)| (value, mean - error, mean + error))
        .collect();
    let ends = [function.values.first(), function.values.last()];
    let zero = ends.into_iter().flatten().map(|value| (*value, 0.0));
    let (beside, style) = match function.on_top {
        true => ("on top of the accepted effects", Style::BEFORE),
        false => ("beside the twin alone", Style::AFTER),
    };
    let label = format!("{beside}, {} nats", short(function.log_evidence));
    let lines = vec![
        Line::new("", Style::ZERO, zero),
        Line::new(&label, style, points()),
    ];
    let panel = Panel::new(&units.place(&function.place), lines)
        .height(130.0)
        .area(Area {
            label: "± 1 standard error".into(),
            points: band,
        });
    (units.named(&function.variable), vec![panel])
}
