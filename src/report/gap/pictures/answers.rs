//! Explanations by probability, errors on held-out data, terms of the missing function.

use crate::diagnose::{Decision, Diagnosis, EffectFit, Horizon, Shrinkage};
use crate::math::median;
use crate::report::chart::{Bar, BarGroup, Line, Panel, Style, TimeMark, bar_chart, chart};
use crate::report::digits::{SHOWN, chance, in_unit, percent, short};
use crate::report::gap::share::{measure, share_with_interval};
use crate::report::units::Units;
use crate::study::Study;

/// Listed effects by probability, then the kinds of explanation; `None` where no effect was fitted.
pub fn explanations(diagnosis: &Diagnosis) -> Option<String> {
    let which = &diagnosis.cause;
    let first = which.effects.first()?;
    let bar = |effect: &EffectFit| {
        let (key, gain) = (effect.key(), short(effect.log_evidence));
        let note = format!("{}, {gain} nats", chance(effect.probability));
        Bar::new(&key, effect.probability, &note).clear(which.accepted.contains(&key))
    };
    let shown = || which.effects.iter().take(SHOWN.explanations);
    let has_class =
        which.decision != Decision::Absorbed && which.class.len() > which.accepted.len();
    let is_inside = |e: &&EffectFit| has_class && which.class.contains(&e.key());
    let inside: Vec<Bar> = shown().filter(is_inside).map(bar).collect();
    let others: Vec<Bar> = shown().filter(|e| !is_inside(e)).map(bar).collect();
    let p = &which.probabilities;
    let kinds = [
        ("listed effects only", p.listed),
        ("listed and unlisted", p.partial),
        ("unlisted only", p.unknown),
        ("nothing", p.nothing),
    ];
    let kinds = kinds.map(|(label, p)| Bar::new(label, p, &chance(p)));
    let (first_label, second_label) = match has_class {
        true => (
            "One class: not separated by this record",
            "Outside the class",
        ),
        false => ("", "Effects"),
    };
    let groups = [
        (first_label, inside),
        (second_label, others),
        ("Missing, all in all", kinds.to_vec()),
    ];
    let groups: Vec<BarGroup> = (groups.into_iter())
        .filter(|(_, bars)| !bars.is_empty())
        .map(|(label, bars)| BarGroup::new(label, Some(1.0), bars))
        .collect();
    let description = format!(
        "Bars of the best explanations; the first is {} with {}.",
        first.key(),
        chance(first.probability)
    );
    Some(bar_chart(
        "Explanations by probability",
        &description,
        &groups,
    ))
}

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
    let title = match s.after {
        Some(_) => "How far the gap closes",
        None => "Errors on held-out data",
    };
    let description = format!("{}: {} before{after}.", measure(s), short(s.before));
    Some(bar_chart(title, &description, &groups))
}

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
        Line::new(label, style, points)
    };
    let lines = vec![
        line("twin", Style::BEFORE, |h| h.before),
        line("twin with effects", Style::AFTER, |h| h.after),
        line("floor, noise alone", Style::OTHERS[2], |h| h.floor),
    ];
    let mark = free.map(|_| TimeMark {
        x: beside,
        label: "free run".into(),
    });
    let description = format!(
        "Prediction errors of twin, twin with effects, and noise alone, at {} horizons{}.",
        ahead.len(),
        free.map_or("", |_| " and of the free run")
    );
    let panel = Panel::new("error over deviation", lines).marks(mark.into_iter().collect());
    let axis = ("seconds ahead".to_owned(), vec![panel]);
    Some(chart("Error by how far ahead", &description, &[axis]))
}

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
    let unit = in_unit(&Units::of(study).place_unit(&d.equation));
    let label = format!("share of draws that include it; factor{unit} (90 % interval)");
    let description = format!(
        "Bars of {} terms; the most frequent is {} in {} of draws.",
        d.terms.len(),
        first.name,
        percent(first.inclusion)
    );
    let group = BarGroup::new(&label, Some(1.0), bars).per_cent();
    Some(bar_chart(
        "Terms that may be missing",
        &description,
        &[group],
    ))
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
