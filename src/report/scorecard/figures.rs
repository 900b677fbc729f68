//! The pictures of a scorecard: answers by expected information, and reliability.

use super::tables::{nats, of};
use crate::evaluate::trials::{BreakdownLine, Scorecard};
use crate::report::chart::{Bar, BarChart, BarGroup, Chart, Dot, Dots, Panel, Series, Style};

/// Delivered answers by expected information as bars; `None` without gaps.
pub(super) fn delivered_svg(card: &Scorecard) -> Option<String> {
    let bins = card.breakdown("by_information")?;
    let last = bins.lines.last()?;
    let delivered = |line: &BreakdownLine| bins.count(line, "delivered").unwrap_or_default();
    let bar = |line: &BreakdownLine| {
        let delivered = delivered(line);
        let (low, high) = delivered.interval();
        Bar::new(
            &nats(line),
            delivered.share().unwrap_or(f64::NAN),
            &of(delivered),
        )
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
            bars: (bins
                .lines
                .iter()
                .filter(|line| line.label("truths") == truths))
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
            of(delivered(last))
        ),
        groups,
    };
    Some(chart.svg())
}

/// Right answers by stated probability; `None` where no effect was stated.
pub(super) fn reliability_svg(card: &Scorecard) -> Option<String> {
    let dot = |line: &BreakdownLine| {
        let right = line.counts.first().copied().flatten()?;
        let (low, high) = right.interval();
        Some(Dot {
            x: line.label("stated").as_f64()?,
            y: right.share()?,
            low,
            high,
        })
    };
    let lines = &card.breakdown("reliability")?.lines;
    let points: Vec<Dot> = lines.iter().filter_map(dot).collect();
    if points.is_empty() {
        return None;
    }
    let diagonal = [(0.0, 0.0), (1.0, 1.0)];
    let series = vec![Series::new("as stated", Style::RECORD, diagonal)];
    let dots = Dots {
        label: "share, 95 % interval".into(),
        points,
    };
    let chart = Chart {
        title: "How often the most probable effect is right".into(),
        description:
            "Share of right answers by stated probability, with 95 % intervals; the diagonal is perfect."
                .into(),
        x: "stated probability".into(),
        panels: vec![Panel::new("share right", series).dots(dots).range(-0.03, 1.03)],
    };
    Some(chart.svg())
}
