//! Errors on held-out data.

use crate::diagnose::{Diagnosis, Shrinkage};
use crate::math::median;
use crate::report::chart::{Bar, BarChart, BarGroup};
use crate::report::digits::short;
use crate::report::gap::share::{measure, share_with_interval};

/// Errors on held-out data at the headline's horizon, and the share of the gap that closes; `None` without such data, and for effects
/// that move no prediction.
pub fn extent(diagnosis: &Diagnosis) -> Option<String> {
    let s = diagnosis.shrinkage.as_ref()?;
    if s.metric == Shrinkage::LOG_SCORE {
        return None;
    }
    let errors = [
        ("not refitted", s.unfitted, false),
        ("before, refitted", Some(s.before), false),
        ("best other effect", s.placebo, false),
        ("effects at random, median", median(&s.random).ok(), false),
        ("after, with effects", s.after, true),
        ("floor, noise alone", s.floor, false),
    ];
    let bars = (errors.into_iter())
        .filter_map(|(label, value, clear)| {
            Some(Bar::new(label, value?, &short(value?)).clear(clear))
        })
        .collect();
    let mut groups = vec![BarGroup::new(
        &format!("{}, {}", measure(s), s.held_out),
        None,
        bars,
    )];
    if let (Some(note), Some(ends)) = (share_with_interval(s, ""), s.interval) {
        let bars = vec![
            Bar::new("closed, 90 % interval", s.closed.unwrap_or(f64::NAN), &note)
                .clear(true)
                .interval(Some(ends)),
        ];
        groups.push(BarGroup::new("Share of the gap", Some(1.0), bars).per_cent());
    }
    let after = s
        .after
        .map_or(String::new(), |after| format!(", {} after", short(after)));
    let chart = BarChart {
        title: match s.after {
            Some(_) => "How far the gap closes".into(),
            None => "Errors on held-out data".into(),
        },
        description: format!("{}: {} before{after}.", measure(s), short(s.before)),
        groups,
    };
    Some(chart.svg())
}
