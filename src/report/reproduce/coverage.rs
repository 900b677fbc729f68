//! The map of a grid: coverage and error at fixed θ, over each parameter.

use crate::estimator::INTERVAL_LEVEL;
use crate::evaluate::paper::PointScore;
use crate::report::chart::{Curves, Dot, Dots, Panel, Series, Span, Style};
use crate::study::Study;
use crate::twin::Parameter;

/// Parameters that are drawn: more panels are a roll, not a picture.
const SHOWN: usize = 6;
/// Heights of the two panels of a parameter.
const COVERAGE: f64 = 150.0;
const ERROR: f64 = 110.0;

/// For each parameter, over its true value: the share of intervals that held it, with its 95 % interval, and the root mean square
/// error of the refitted estimate. Bars below the axes mark the prior. `None` without a grid.
pub fn coverage_svg(study: &Study, points: &[PointScore]) -> Option<String> {
    let (first, records) = (points.first()?, points.iter().map(records).sum::<u64>());
    let space = study.twin().parameters();
    let parameters = space.iter().enumerate().take(SHOWN);
    let panels = parameters.flat_map(|(j, parameter)| {
        let x = format!("true {}", named(parameter));
        [
            (x.clone(), coverage(parameter, points, j)),
            (x, error(parameter, points, j)),
        ]
    });
    let level = 100.0 * INTERVAL_LEVEL;
    let picture = Curves {
        title: format!("{}: coverage and error over the truth", study.name()),
        description: format!(
            "Share of {level:.0} % intervals that held the true value, and root mean square error, at {} fixed points with {} records \
             each, {records} in all.",
            points.len(),
            records_each(first, points),
        ),
        panels: panels.collect(),
    };
    Some(picture.svg())
}

/// Records at a point.
fn records(point: &PointScore) -> u64 {
    point.coverage.first().map_or(0, |c| c.of)
}

fn records_each(first: &PointScore, points: &[PointScore]) -> String {
    let least = points.iter().map(records).min().unwrap_or(0);
    match points.iter().all(|p| records(p) == records(first)) {
        true => least.to_string(),
        false => format!("at least {least}"),
    }
}

/// Shares of intervals that held parameter `j`, beside the nominal level.
fn coverage(parameter: &Parameter, points: &[PointScore], j: usize) -> Panel {
    let level = over(parameter, INTERVAL_LEVEL);
    let line = Series::new("nominal", Style::ZERO, level);
    let dots = points.iter().map(|point| {
        let c = &point.coverage[j];
        let [low, high] = c.interval;
        Dot {
            x: point.theta[j],
            y: c.share,
            low,
            high,
        }
    });
    Panel::new(&format!("{}: share held", parameter.name), vec![line])
        .height(COVERAGE)
        .range(0.0, 1.0)
        .dots(Dots {
            label: "records at one θ, 95 % interval".into(),
            points: sorted(dots),
        })
        .spans(vec![prior(parameter)])
}

/// Root mean square errors of parameter `j`.
fn error(parameter: &Parameter, points: &[PointScore], j: usize) -> Panel {
    let dots = points.iter().map(|point| {
        let y = point.rmse[j];
        Dot {
            x: point.theta[j],
            y,
            low: y,
            high: y,
        }
    });
    let zero = Series::new("", Style::ZERO, over(parameter, 0.0));
    Panel::new(&format!("{}: rms error", parameter.name), vec![zero])
        .height(ERROR)
        .dots(Dots {
            label: String::new(),
            points: sorted(dots),
        })
        .spans(vec![prior(parameter)])
}

/// A level over all possible values.
fn over(parameter: &Parameter, level: f64) -> [(f64, f64); 2] {
    let bounds = parameter.bounds;
    [(bounds.low(), level), (bounds.high(), level)]
}

fn prior(parameter: &Parameter) -> Span {
    Span {
        from: parameter.prior.low(),
        to: parameter.prior.high(),
        label: "prior".into(),
        weight: 0.3,
        clear: false,
    }
}

fn sorted(dots: impl Iterator<Item = Dot>) -> Vec<Dot> {
    let mut dots: Vec<Dot> = dots.collect();
    dots.sort_by(|a, b| a.x.total_cmp(&b.x));
    dots
}

fn named(parameter: &Parameter) -> String {
    match parameter.unit.as_str() {
        "" | "-" => parameter.name.clone(),
        unit => format!("{} in {unit}", parameter.name),
    }
}
