//! Places: in the twin, at values of its variables, by output, lag and frequency.

use crate::diagnose::{Cell, Diagnosis};
use crate::math::ascending;
use crate::report::chart::{Bar, BarGroup, bar_chart};
use crate::report::digits::{SHOWN, chance, percent, short, with_unit};
use crate::report::gap::statement::places;
use crate::report::units::Units;
use crate::study::Study;
use std::collections::BTreeMap;

/// Places in the twin by the probability of what explains the records there; `None` where nothing was looked for.
pub fn targets(diagnosis: &Diagnosis) -> Option<String> {
    let targets = &diagnosis.location.targets;
    let first = targets.first()?;
    let answer = places(diagnosis);
    let bars = (targets.iter())
        .filter(|t| t.probability >= SHOWN.visible || answer.contains(&t.target.as_str()))
        .map(|t| {
            let is_answer = answer.contains(&t.target.as_str());
            Bar::new(&t.target, t.probability, &chance(t.probability)).clear(is_answer)
        });
    let description = format!(
        "Bars of {} places; the first is {} with {}.",
        targets.len(),
        first.target,
        chance(first.probability)
    );
    let group = BarGroup::new("", Some(1.0), bars.collect());
    Some(bar_chart("Where in the twin", &description, &[group]))
}

/// Cells that stand out as bars, clearest first; `at` gives the group of a cell, its place in the group and its name there.
fn shares<C: Cell>(
    title: &str,
    cells: &[C],
    at: impl Fn(&C) -> (String, f64, String),
) -> Option<String> {
    let (group, _, name) = at(cells.first()?);
    let mut groups: BTreeMap<String, Vec<(f64, Bar)>> = BTreeMap::new();
    for cell in cells.iter().filter(|cell| cell.share() >= SHOWN.visible) {
        let (group, place, name) = at(cell);
        let bar = Bar::new(&name, cell.share(), &percent(cell.share()));
        groups.entry(group).or_default().push((place, bar));
    }
    let groups = groups.into_iter().map(|(group, mut bars)| {
        ascending(&mut bars, |a| a.0);
        let bars = bars.into_iter().map(|(_, bar)| bar).collect();
        BarGroup::new(&group, None, bars).per_cent()
    });
    let groups: Vec<BarGroup> = groups.collect();
    let parts = cells.len();
    let description = format!("Bars of {parts} parts; the clearest is {group} {name}.");
    (!groups.is_empty()).then(|| bar_chart(title, &description, &groups))
}

fn between(low: f64, high: f64, unit: &str) -> String {
    match low == high {
        true => with_unit(low, unit),
        false => format!("{} … {}", short(low), with_unit(high, unit)),
    }
}

/// Ranges of states, inputs and predicted outputs that stand out; `None` where none does.
pub fn regions(study: &Study, diagnosis: &Diagnosis) -> Option<String> {
    let units = Units::of(study);
    let regions = diagnosis.location.maps.notable().regions;
    shares("At which values", &regions, |r| {
        let range = between(r.low, r.high, units.variable(&r.variable));
        (r.variable.clone(), r.low, range)
    })
}

/// Outputs that stand out; `None` where none does, or there is but one.
pub fn channels(study: &Study, diagnosis: &Diagnosis) -> Option<String> {
    let channels = diagnosis.location.maps.notable().channels;
    let several = study.twin().signals().outputs.len() > 1;
    shares("In which outputs", &channels, |c| {
        (String::new(), -c.share(), c.channel.clone())
    })
    .filter(|_| several)
}

/// Lags at which innovations still depend on the past; `None` where they do not.
pub fn lags(diagnosis: &Diagnosis) -> Option<String> {
    let lags = diagnosis.location.maps.notable().lags;
    shares("Dependence of innovations on the past", &lags, |l| {
        let past = match l.channel == l.signal {
            true => format!("{} on its own past", l.channel),
            false => format!("{} on the past of {}", l.channel, l.signal),
        };
        (past, l.from, between(l.from, l.to, "s"))
    })
}

/// Frequency bands that stand out; `None` where none does.
pub fn bands(diagnosis: &Diagnosis) -> Option<String> {
    let bands = diagnosis.location.maps.notable().bands;
    shares("At which frequencies", &bands, |b| {
        (b.channel.clone(), b.low, between(b.low, b.high, "Hz"))
    })
}
