//! Prediction errors over horizons.

use crate::diagnose::{Diagnosis, Horizon};
use crate::report::chart::{Chart, Mark, Panel, Series, Style};

/// Beside the curve: the mark of the free run, and the ends of its lines, beyond the longest horizon and over it.
const FREE_RUN: [f64; 3] = [0.08, 0.12, 0.3];

/// Errors of twin, accepted twin and floor by how far ahead predictions reach, the free run at the end; `None` where fewer than two
/// horizons were looked at.
pub fn horizons(diagnosis: &Diagnosis) -> Option<String> {
    let s = diagnosis.shrinkage.as_ref()?;
    let ahead: Vec<(f64, &Horizon)> = (s.horizons.iter())
        .filter_map(|h| Some((h.seconds?, h)))
        .collect();
    let (longest, _) = ahead.last()?;
    if ahead.len() < 2 {
        return None;
    }
    let free = s.horizons.iter().find(|h| h.samples.is_none());
    let [beside, from, to] = FREE_RUN.map(|beyond| longest * (1.0 + beyond));
    let line = |label: &str, style: Style, value: fn(&Horizon) -> f64| {
        let mut points: Vec<(f64, f64)> = ahead.iter().map(|(t, h)| (*t, value(h))).collect();
        // A free run has no horizon.
        if let Some(h) = free {
            points.extend([(beside, f64::NAN), (from, value(h)), (to, value(h))]);
        }
        Series::new(label, style, points)
    };
    let lines = vec![
        line("twin", Style::BEFORE, |h| h.before),
        line("twin with effects", Style::AFTER, |h| h.after),
        line("floor, noise alone", Style::OTHERS[2], |h| h.floor),
    ];
    let mark = free.map(|_| Mark {
        x: beside,
        label: "free run".into(),
    });
    let and = if free.is_some() {
        " and of the free run"
    } else {
        ""
    };
    let chart = Chart {
        title: "Error by how far ahead".into(),
        description: format!(
            "Prediction errors of twin, twin with effects, and noise alone, at {} horizons{and}.",
            ahead.len()
        ),
        x: "seconds ahead".into(),
        panels: vec![Panel::new("error over deviation", lines).marks(mark.into_iter().collect())],
    };
    Some(chart.svg())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::fixture::made;

    #[test]
    fn the_free_run_stands_at_the_end() {
        let mut diagnosis = made::tanks_class();
        assert!(horizons(&diagnosis).unwrap().contains(">free run<"));
        let all = &mut diagnosis.shrinkage.as_mut().unwrap().horizons;
        all.retain(|h| h.samples.is_some());
        assert!(!horizons(&diagnosis).unwrap().contains(">free run<"));
    }
}
