//! Windows of time and the onset, as marks of a picture.

use crate::diagnose::{Cell, Diagnosis, Maps, Onset};
use crate::report::chart::{Mark, Span};
use crate::report::digits::{percent, short};

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
