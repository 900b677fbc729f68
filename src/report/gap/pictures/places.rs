//! Places: in the twin, at values of its variables, by output, lag and frequency.

use crate::diagnose::{Band, Cell, Diagnosis, Lag, Region};
use crate::report::chart::{Bar, BarChart, BarGroup};
use crate::report::digits::{chance, percent, short, unit_suffix};
use crate::report::gap::statement::places;
use crate::report::units::Units;
use crate::study::Study;

/// Shares that are drawn: what rounds to nothing stands in the numbers below the picture.
const VISIBLE: f64 = 0.005;

/// A cell as a bar.
fn bar(label: &str, cell: &impl Cell) -> Bar {
    Bar::new(label, cell.share(), &percent(cell.share()))
}

/// Cells by what they are of, in the order of their first ones' names.
fn grouped<'c, C, K: Ord + Copy>(
    cells: &'c [C],
    key: impl Fn(&'c C) -> K,
) -> impl Iterator<Item = (K, Vec<&'c C>)> {
    let mut groups = std::collections::BTreeMap::<K, Vec<&C>>::new();
    for cell in cells {
        groups.entry(key(cell)).or_default().push(cell);
    }
    groups.into_iter()
}

/// Places in the twin by the probability of what explains the records there; `None` where nothing was looked for.
pub fn targets(diagnosis: &Diagnosis) -> Option<String> {
    let targets = &diagnosis.location.targets;
    let first = targets.first()?;
    let answer = places(diagnosis);
    let bars = (targets.iter())
        .filter(|t| t.probability >= VISIBLE || answer.contains(&t.target.as_str()))
        .map(|t| {
            let is_answer = answer.contains(&t.target.as_str());
            Bar::new(&t.target, t.probability, &chance(t.probability)).clear(is_answer)
        })
        .collect();
    let chart = BarChart {
        title: "Where in the twin".into(),
        description: format!(
            "Bars of {} places; the first is {} with {}.",
            targets.len(),
            first.target,
            chance(first.probability)
        ),
        groups: vec![BarGroup::new("", Some(1.0), bars)],
    };
    Some(chart.svg())
}

/// Ranges of states, inputs and predicted outputs that stand out; `None` where none does.
pub fn regions(study: &Study, diagnosis: &Diagnosis) -> Option<String> {
    let units = Units::of(study);
    let mut regions = diagnosis.location.maps.notable().regions;
    regions.retain(|r| r.share >= VISIBLE);
    let clearest = regions.first()?;
    let groups = grouped(&regions, |r| &r.variable)
        .map(|(variable, mut own)| {
            let unit = unit_suffix(units.variable(variable));
            own.sort_by(|a, b| a.low.total_cmp(&b.low));
            let bar = |r: &&Region| {
                let label = format!("{} … {}{unit}", short(r.low), short(r.high));
                bar(&label, *r)
            };
            BarGroup::new(variable, None, own.iter().map(bar).collect()).per_cent()
        })
        .collect();
    let chart = BarChart {
        title: "At which values".into(),
        description: format!(
            "Bars of {} ranges; the longest is {} from {} to {}.",
            regions.len(),
            clearest.variable,
            short(clearest.low),
            short(clearest.high)
        ),
        groups,
    };
    Some(chart.svg())
}

/// Outputs that stand out; `None` where none does, or there is but one.
pub fn channels(study: &Study, diagnosis: &Diagnosis) -> Option<String> {
    let channels = diagnosis.location.maps.notable().channels;
    let clearest = channels.first()?;
    if Units::of(study).signals.outputs.len() < 2 {
        return None;
    }
    let bars = (channels.iter()).map(|c| bar(&c.channel, c)).collect();
    let chart = BarChart {
        title: "In which outputs".into(),
        description: format!(
            "Bars of {} outputs; the longest is {} with {}.",
            channels.len(),
            clearest.channel,
            percent(clearest.share)
        ),
        groups: vec![BarGroup::new("", Some(1.0), bars).per_cent()],
    };
    Some(chart.svg())
}

/// Lags at which innovations still depend on the past; `None` where they do not.
pub fn lags(diagnosis: &Diagnosis) -> Option<String> {
    let lags = diagnosis.location.maps.notable().lags;
    let clearest = lags.first()?;
    let between = |l: &Lag| {
        if l.from == l.to {
            format!("{} s", short(l.from))
        } else {
            format!("{} … {} s", short(l.from), short(l.to))
        }
    };
    let groups = grouped(&lags, |l| (l.channel.as_str(), l.signal.as_str()))
        .map(|((channel, signal), mut own)| {
            own.sort_by(|a, b| a.from.total_cmp(&b.from));
            let bars = own.iter().map(|l| bar(&between(l), *l)).collect();
            BarGroup::new(&past(channel, signal), None, bars).per_cent()
        })
        .collect();
    let chart = BarChart {
        title: "Dependence of innovations on the past".into(),
        description: format!(
            "Bars of {} lags; the clearest is {} at {}.",
            lags.len(),
            past(&clearest.channel, &clearest.signal),
            between(clearest)
        ),
        groups,
    };
    Some(chart.svg())
}

/// Whose past an output depends on.
fn past(channel: &str, signal: &str) -> String {
    if channel == signal {
        format!("{channel} on its own past")
    } else {
        format!("{channel} on the past of {signal}")
    }
}

/// Frequency bands that stand out; `None` where none does.
pub fn bands(diagnosis: &Diagnosis) -> Option<String> {
    let bands = diagnosis.location.maps.notable().bands;
    let clearest = bands.first()?;
    let between = |b: &Band| format!("{} … {} Hz", short(b.low), short(b.high));
    let groups = grouped(&bands, |b| b.channel.as_str())
        .map(|(channel, mut own)| {
            own.sort_by(|a, b| a.low.total_cmp(&b.low));
            let bars = own.iter().map(|b| bar(&between(b), *b)).collect();
            BarGroup::new(channel, None, bars).per_cent()
        })
        .collect();
    let chart = BarChart {
        title: "At which frequencies".into(),
        description: format!(
            "Bars of {} bands; the clearest is {} at {}.",
            bands.len(),
            clearest.channel,
            between(clearest)
        ),
        groups,
    };
    Some(chart.svg())
}
