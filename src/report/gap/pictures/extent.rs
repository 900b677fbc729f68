//! Errors on held-out data.

use crate::diagnose::{Diagnosis, Shrinkage};
use crate::report::chart::{Bar, BarChart, BarGroup};
use crate::report::digits::{percent, short};

/// Free-run errors on held-out data, and the share of the gap that closes; `None` without such data, and for effects that move
/// no free run.
pub fn extent(diagnosis: &Diagnosis) -> Option<String> {
    let s = diagnosis.shrinkage.as_ref()?;
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
    let mut groups = vec![BarGroup::new(
        &format!("{}, {}", s.metric, s.held_out),
        None,
        bars,
    )];
    if let (Some(closed), Some(ends)) = (s.closed, s.interval) {
        let [low, high] = ends.map(percent);
        let note = format!("{} ({low} to {high})", percent(closed));
        let bars = vec![
            Bar::new("closed, 90 % interval", closed, &note)
                .clear(true)
                .interval(Some(ends)),
        ];
        groups.push(BarGroup::new("Share of the gap", Some(1.0), bars));
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
