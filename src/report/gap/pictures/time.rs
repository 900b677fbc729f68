//! Windows of time of all outputs, before and after the accepted effects, and the time of a change.

use crate::diagnose::{Cell, Diagnosis, Maps, Onset};
use crate::report::chart::{HeatGroup, HeatMap, HeatRow, Mark, Span};
use crate::report::digits::{percent, short};
use crate::report::gap::statement::accepted_ids;

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
    let map = HeatMap {
        title: "Windows of time".into(),
        description: format!(
            "{} of {} windows stand out, the clearest in {} from {} to {} s with {} of the gap{after}.",
            windows(maps),
            maps.windows.len(),
            clearest.channel,
            short(clearest.start),
            short(clearest.end),
            percent(clearest.share),
        ),
        x: "t in s".into(),
        groups,
    };
    Some(map.svg())
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
    spans.sort_by(|a, b| a.from.total_cmp(&b.from));
    spans
}

/// The time of a change.
pub(super) fn mark(onset: &Onset) -> Mark {
    Mark {
        x: onset.time,
        label: format!("change at {} s", short(onset.time)),
    }
}
