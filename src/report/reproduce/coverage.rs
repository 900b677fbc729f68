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
    let records = |point: &PointScore| point.coverage.first().map_or(0, |c| c.held.of);
    let (least, all) = (
        points.iter().map(records).min()?,
        points.iter().map(records).sum::<u64>(),
    );
    let each = match all == least * points.len() as u64 {
        true => least.to_string(),
        false => format!("at least {least}"),
    };
    let space = study.twin().parameters();
    let panels = space
        .iter()
        .enumerate()
        .take(SHOWN)
        .flat_map(|(j, parameter)| {
            let dots = |dot: &dyn Fn(&PointScore) -> Dot| -> Vec<Dot> {
                let mut dots: Vec<Dot> = points.iter().map(dot).collect();
                dots.sort_by(|a, b| a.x.total_cmp(&b.x));
                dots
            };
            let shares = dots(&|point| {
                let (coverage, (low, high)) =
                    (&point.coverage[j], point.coverage[j].held.interval());
                Dot {
                    x: point.theta[j],
                    y: coverage.share,
                    low,
                    high,
                }
            });
            let errors = dots(&|point| {
                let y = point.rmse[j];
                Dot {
                    x: point.theta[j],
                    y,
                    low: y,
                    high: y,
                }
            });
            let x = match parameter.unit.as_str() {
                "" | "-" => format!("true {}", parameter.name),
                unit => format!("true {} in {unit}", parameter.name),
            };
            let share = panel(parameter, "share held", ("nominal", INTERVAL_LEVEL))
                .height(COVERAGE)
                .range(0.0, 1.0)
                .dots(Dots {
                    label: "records at one θ, 95 % interval".into(),
                    points: shares,
                });
            let error = panel(parameter, "rms error", ("", 0.0))
                .height(ERROR)
                .dots(Dots {
                    label: String::new(),
                    points: errors,
                });
            [(x.clone(), share), (x, error)]
        });
    let picture = Curves {
        title: format!("{}: coverage and error over the truth", study.name()),
        description: format!(
            "Share of {:.0} % intervals that held the true value, and root mean square error, at {} fixed points with {each} records \
             each, {all} in all.",
            100.0 * INTERVAL_LEVEL,
            points.len(),
        ),
        panels: panels.collect(),
    };
    Some(picture.svg())
}

/// A panel over the bounds of a parameter, with a line at a level and a bar at the prior.
fn panel(parameter: &Parameter, what: &str, (label, level): (&str, f64)) -> Panel {
    let (bounds, prior) = (parameter.bounds, parameter.prior);
    let line = [(bounds.low(), level), (bounds.high(), level)];
    let series = vec![Series::new(label, Style::ZERO, line)];
    Panel::new(&format!("{}: {what}", parameter.name), series).spans(vec![Span {
        from: prior.low(),
        to: prior.high(),
        label: "prior".into(),
        weight: 0.3,
        clear: false,
    }])
}
