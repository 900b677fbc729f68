//! Terms of the missing function: exploratory.

use crate::diagnose::Diagnosis;
use crate::report::chart::{Bar, BarChart, BarGroup};
use crate::report::digits::{percent, short, unit_suffix};
use crate::report::units::Units;
use crate::study::Study;

/// Terms by how often draws of the missing function include them; `None` where there is none.
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
    let unit = unit_suffix(&Units::of(study).place_unit(&d.equation));
    let label = if unit.is_empty() {
        "share of draws that include it; factor (90 % interval)".to_owned()
    } else {
        format!("share of draws that include it; factor in{unit} (90 % interval)")
    };
    let chart = BarChart {
        title: "Terms that may be missing".into(),
        description: format!(
            "Bars of {} terms; the most frequent is {} in {} of draws.",
            d.terms.len(),
            first.name,
            percent(first.inclusion)
        ),
        groups: vec![BarGroup::new(&label, Some(1.0), bars).per_cent()],
    };
    Some(chart.svg())
}
