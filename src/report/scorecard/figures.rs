//! The pictures of a scorecard: answers by expected information, and reliability.

use super::text::{nats, of};
use crate::evaluate::trials::{Bin, Count, Scorecard};
use crate::report::chart::{Bar, BarChart, BarGroup, Chart, Dot, Dots, Panel, Series, Style};

/// Delivered answers by expected information as bars; `None` without gaps.
pub(super) fn delivered_svg(card: &Scorecard) -> Option<String> {
    let last = card.by_information.last()?;
    let bar = |bin: &Bin| {
        let (low, high) = bin.delivered.interval();
        let share = bin.delivered.share().unwrap_or(f64::NAN);
        Bar::new(&nats(bin), share, &of(bin.delivered))
            .clear(true)
            .interval(Some([low, high]))
    };
    let groups = [
        ("listed", "a listed effect is there"),
        ("random", "a law that nobody listed"),
    ];
    let groups = (groups.into_iter())
        .map(|(truths, label)| BarGroup {
            label: format!("{label}: share of right answers, 95 % interval"),
            full: Some(1.0),
            per_cent: true,
            bars: (card.by_information.iter())
                .filter(|bin| bin.truths == truths)
                .map(bar)
                .collect(),
        })
        .filter(|group: &BarGroup| !group.bars.is_empty())
        .collect();
    let chart = BarChart {
        title: "Right answers, by expected information".into(),
        description: format!(
            "Bars with 95 % intervals; {} {} delivered.",
            nats(last),
            of(last.delivered)
        ),
        groups,
    };
    Some(chart.svg())
}

/// Right answers by stated probability; `None` where no effect was stated.
pub(super) fn reliability_svg(card: &Scorecard) -> Option<String> {
    let dot = |stated: f64, count: Count| {
        let (low, high) = count.interval();
        Some(Dot {
            x: stated,
            y: count.share()?,
            low,
            high,
        })
    };
    let points: Vec<Dot> = (card.reliability.iter())
        .filter_map(|bin| dot(bin.stated, bin.right))
        .collect();
    if points.is_empty() {
        return None;
    }
    let series = vec![Series::new(
        "as stated",
        Style::RECORD,
        [(0.0, 0.0), (1.0, 1.0)],
    )];
    let dots = Dots {
        label: "share, 95 % interval".into(),
        points,
    };
    let chart = Chart {
        title: "How often the effect on top is right".into(),
        description:
            "Share of right answers by stated probability, with 95 % intervals; the diagonal is perfect."
                .into(),
        x: "stated probability".into(),
        panels: vec![
            Panel::new("share right", series)
                .dots(dots)
                .range(-0.03, 1.03),
        ],
    };
    Some(chart.svg())
}
