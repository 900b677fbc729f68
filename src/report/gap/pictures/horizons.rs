//! Prediction errors over horizons.

use crate::diagnose::{Diagnosis, Horizon};
use crate::report::chart::{Chart, Panel, Series, Style};

/// Errors of twin, accepted twin and floor by how far ahead predictions reach; `None` where fewer than two horizons were looked at.
pub fn horizons(diagnosis: &Diagnosis) -> Option<String> {
    let s = diagnosis.shrinkage.as_ref()?;
    let ahead: Vec<(f64, &Horizon)> = (s.horizons.iter())
        .filter_map(|h| Some((h.seconds?, h)))
        .collect();
    if ahead.len() < 2 {
        return None;
    }
    let line = |label: &str, style: Style, value: fn(&Horizon) -> f64| {
        let points: Vec<(f64, f64)> = ahead.iter().map(|(t, h)| (*t, value(h))).collect();
        Series::new(label, style, points)
    };
    let lines = vec![
        line("twin", Style::BEFORE, |h| h.before),
        line("twin with effects", Style::AFTER, |h| h.after),
        line("floor, noise alone", Style::OTHERS[2], |h| h.floor),
    ];
    let chart = Chart {
        title: "Error by how far ahead".into(),
        description: format!(
            "Prediction errors of twin, twin with effects, and noise alone, at {} horizons.",
            ahead.len()
        ),
        x: "seconds ahead".into(),
        panels: vec![Panel::new("error over deviation", lines)],
    };
    Some(chart.svg())
}
