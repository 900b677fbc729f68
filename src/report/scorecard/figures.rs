//! The pictures of a scorecard: detection and reliability.

use crate::evaluate::trials::{Count, Range, Scorecard};
use crate::report::chart::{Bar, BarChart, BarGroup, Chart, Dot, Dots, Panel, Series, Style};

/// Detection by strength; `None` without trials.
pub(super) fn strengths_svg(card: &Scorecard) -> Option<String> {
    let middle = |r: &Range| 0.5 * (r.low + r.high);
    let points: Vec<(f64, Count)> = (card.by_strength.iter())
        .map(|r| (middle(r), r.detected))
        .collect();
    let picture = Shares {
        title: "Called structural, by strength",
        description: "Share of trials with a structural truth that were called structural, with 95 % intervals.",
        x: "strength of the departure: 0 hardly visible, 1 obvious",
        y: "share detected",
        diagonal: false,
    };
    picture.svg(&points)
}

/// Right answers by stated probability; `None` where no effect was accepted.
pub(super) fn reliability_svg(card: &Scorecard) -> Option<String> {
    let points: Vec<(f64, Count)> = (card.reliability.iter())
        .map(|bin| (bin.stated, bin.right))
        .collect();
    let picture = Shares {
        title: "How often the effect on top is true",
        description: "Share of right answers by stated probability, with 95 % intervals; the diagonal is perfect.",
        x: "stated probability",
        y: "share right",
        diagonal: true,
    };
    picture.svg(&points)
}

/// Detection by gain as bars; `None` where no gain is known.
pub(super) fn gains_svg(card: &Scorecard) -> Option<String> {
    let last = card.by_gain.last()?;
    let bars = (card.by_gain.iter())
        .map(|r| {
            let (low, high) = r.detected.interval();
            Bar::new(
                &nats(r),
                r.detected.share().unwrap_or(f64::NAN),
                &of(r.detected),
            )
            .clear(true)
            .interval(Some([low, high]))
        })
        .collect();
    let chart = BarChart {
        title: "Called structural, by gain".into(),
        description: format!(
            "Bars with 95 % intervals; {} detected {}.",
            nats(last),
            of(last.detected)
        ),
        groups: vec![BarGroup {
            label: "share detected, 95 % interval".into(),
            full: Some(1.0),
            bars,
        }],
    };
    Some(chart.svg())
}

/// Returns `count of all`.
pub(super) fn of(count: Count) -> String {
    format!("{} of {}", count.count, count.of)
}

/// A range of gains.
pub(super) fn nats(r: &Range) -> String {
    match (r.low.is_finite(), r.high.is_finite()) {
        (true, true) => format!("{:.0} … {:.0} nats", r.low, r.high),
        (false, _) => format!("below {:.0} nats", r.high),
        (_, false) => format!("above {:.0} nats", r.low),
    }
}

/// A picture of shares with their intervals over x.
struct Shares {
    title: &'static str,
    description: &'static str,
    x: &'static str,
    y: &'static str,
    /// Stated equals found.
    diagonal: bool,
}

impl Shares {
    /// `None` where there are no points.
    fn svg(&self, points: &[(f64, Count)]) -> Option<String> {
        let dots: Vec<Dot> = (points.iter())
            .filter_map(|(x, count)| {
                let (low, high) = count.interval();
                Some(Dot {
                    x: *x,
                    y: count.share()?,
                    low,
                    high,
                })
            })
            .collect();
        if dots.is_empty() {
            return None;
        }
        let series = if self.diagonal {
            vec![Series::new(
                "as stated",
                Style::RECORD,
                [(0.5, 0.5), (1.0, 1.0)],
            )]
        } else {
            vec![]
        };
        let dots = Dots {
            label: "share, 95 % interval".into(),
            points: dots,
        };
        let chart = Chart {
            title: self.title.into(),
            description: self.description.into(),
            x: self.x.into(),
            panels: vec![Panel::new(self.y, series).dots(dots).range(-0.03, 1.03)],
        };
        Some(chart.svg())
    }
}
