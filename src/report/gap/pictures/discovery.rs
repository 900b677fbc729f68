//! The missing term and its candidates: exploratory.

use crate::diagnose::Diagnosis;
use crate::report::chart::{Area, Bar, BarChart, BarGroup, Chart, Panel, Series, Style};
use crate::report::digits::{percent, short, unit_suffix};
use crate::report::units::Units;
use crate::study::Study;

/// The smoothed missing term with ± one standard deviation, and the regression over it; `None` where nothing was explored.
pub fn missing(study: &Study, diagnosis: &Diagnosis) -> Option<String> {
    let d = diagnosis
        .discovery
        .as_ref()
        .filter(|d| !d.times.is_empty())?;
    let line = |values: &[f64]| -> Vec<(f64, f64)> {
        d.times
            .iter()
            .copied()
            .zip(values.iter().copied())
            .collect()
    };
    let band = (d.times.iter().zip(&d.missing).zip(&d.std_error))
        .map(|((t, m), s)| (*t, m - s, m + s))
        .collect();
    let series = vec![
        Series::new("smoothed", Style::RECORD, line(&d.missing)),
        Series::new("regression", Style::BEFORE, line(&d.fitted)),
    ];
    let quantity = Units::of(study).equation(&d.equation);
    let chart = Chart {
        title: "The missing term over time".into(),
        description: format!(
            "Missing term of the {quantity}, smoothed, with its standard deviation; the regression explains {} of its variance.",
            percent(d.explained)
        ),
        x: "t in s".into(),
        panels: vec![Panel::new(&quantity, series).area(Area {
            label: "± 1 standard deviation".into(),
            points: band,
        })],
    };
    Some(chart.svg())
}

/// Terms of the regression by how often resampled records include them; `None` where there is none.
pub fn terms(study: &Study, diagnosis: &Diagnosis) -> Option<String> {
    let d = diagnosis.discovery.as_ref()?;
    let first = d.terms.first()?;
    let bars = (d.terms.iter())
        .map(|t| {
            let [low, high] = t.interval.map(short);
            let (often, factor) = (percent(t.inclusion), short(t.coefficient));
            let note = format!("{often}, {factor} ({low} to {high})");
            Bar::new(&t.name, t.inclusion, &note)
        })
        .collect();
    let unit = unit_suffix(&Units::of(study).equation_unit(&d.equation));
    let label = if unit.is_empty() {
        "share of records that include it; factor (90 % interval)".to_owned()
    } else {
        format!("share of records that include it; factor in{unit} (90 % interval)")
    };
    let chart = BarChart {
        title: "Terms that may be missing".into(),
        description: format!(
            "Bars of {} terms; the most frequent is {} in {} of resampled records.",
            d.terms.len(),
            first.name,
            percent(first.inclusion)
        ),
        groups: vec![BarGroup::new(&label, Some(1.0), bars)],
    };
    Some(chart.svg())
}
