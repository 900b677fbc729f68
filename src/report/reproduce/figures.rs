//! The figures of scores over many records: what the twin shows at each method's answer; coverage and error over a grid.

use crate::estimator::INTERVAL_LEVEL;
use crate::evaluate::baseline::Initialisation::Bad;
use crate::evaluate::paper::{AnswerRuns, MeanRuns, PointScore, ScoredMethod};
use crate::math::ascending;
use crate::record::Signal;
use crate::report::chart::{Dot, Dots, Line, Panel, Span, Style, chart, roomy};
use crate::report::digits::{SHOWN, in_unit, named};
use crate::study::Study;
use crate::twin::Parameter;

/// Which methods a panel shows.
type Belongs = fn(ScoredMethod) -> bool;

fn is_two_stage(method: ScoredMethod) -> bool {
    use ScoredMethod::{Final, TsFine, TsPre};
    matches!(method, TsPre | TsFine | Final)
}

/// The paper's trajectory figure: noise-free runs of the twin at the truth and, as means over the records, at the
/// answers of each family of methods. `None` where the twin diverges at the truth.
pub fn mean_runs_svg(study: &Study, means: &MeanRuns) -> Option<String> {
    let truth = means.truth.as_ref()?;
    let families: [(&str, Belongs); 3] = [
        ("Two-Stage", is_two_stage),
        ("PEM", |m| matches!(m, ScoredMethod::PredictionError(_))),
        ("dual-EKF", |m| matches!(m, ScoredMethod::DualFilter(_))),
    ];
    let outputs = study.twin().signals().outputs;
    let mut panels = Vec::new();
    for (channel, quantity) in outputs.iter().enumerate() {
        let back = Trajectory("truth".into(), Style::RECORD, truth);
        for (family, belongs) in families {
            let lines = lines(&means.answers, belongs, |method| {
                match method.initialisation() {
                    // The panel names the method.
                    Some(start) => start.to_string(),
                    None => method.to_string(),
                }
            });
            if !lines.is_empty() {
                let title = format!("{family}: {}", named(quantity));
                panels.push(panel(&title, &means.times, channel, &back, &lines));
            }
        }
    }
    let (name, runs) = (study.name(), means.runs);
    let title = format!("{name}: truth, and mean of {runs} predictions");
    let description = format!(
        "Noise-free outputs of the twin at the true parameters, and at the estimates of each method: means over {runs} simulated records."
    );
    Some(chart(&title, &description, &[("t in s".into(), panels)]))
}

/// One record and free runs at what it made of the pretrained network, of the final answer, and of both baselines from their bad starts.
pub fn first_run_svg(study: &Study, runs: &AnswerRuns) -> String {
    let times = runs.record.drive().times();
    let outputs = study.twin().signals().outputs;
    let theirs: Belongs = |m| matches!(m, ScoredMethod::PredictionError(start) | ScoredMethod::DualFilter(start) if start == Bad);
    let panels = (outputs.iter().enumerate())
        .flat_map(|(channel, quantity)| {
            let measured = Trajectory("measured".into(), Style::RECORD, runs.record.outputs());
            let of = |belongs: Belongs| lines(&runs.answers, belongs, |method| method.to_string());
            let (ours, theirs) = (of(is_two_stage), of(theirs));
            [("Two-Stage", ours), ("bad starts", theirs)]
                .into_iter()
                .filter(|(_, lines)| !lines.is_empty())
                .map(|(family, lines)| {
                    let title = format!("{family}: {}", named(quantity));
                    panel(&title, &times, channel, &measured, &lines)
                })
                .collect::<Vec<_>>()
        })
        .collect();
    let title = format!("{}: the first record and its twins", study.name());
    let description = "The first simulated record, and noise-free outputs of the twin at what each method estimated from it.";
    chart(&title, description, &[("t in s".into(), panels)])
}

/// A trajectory with its name.
struct Trajectory<'a>(String, Style, &'a Signal);

/// Lines of the methods that belong to a family and have something to show.
fn lines(
    answers: &[(ScoredMethod, Option<Signal>)],
    belongs: Belongs,
    label: impl Fn(ScoredMethod) -> String,
) -> Vec<Trajectory<'_>> {
    let family = answers.iter().filter(|(method, _)| belongs(*method));
    // A method keeps its style whether or not its neighbours have an answer.
    (family.zip(Style::OTHERS.iter().cycle()))
        .filter_map(|((method, signal), style)| {
            Some(Trajectory(label(*method), *style, signal.as_ref()?))
        })
        .collect()
}

/// One output over time, `back` behind the others.
fn panel(
    title: &str,
    times: &[f64],
    channel: usize,
    back: &Trajectory<'_>,
    lines: &[Trajectory<'_>],
) -> Panel {
    let shown = roomy(back.2.column(channel).iter().copied());
    let series = std::iter::once(back)
        .chain(lines)
        .map(|Trajectory(label, style, signal)| {
            let points = times.iter().copied().zip(signal.column(channel).to_vec());
            Line::new(label, *style, points).within(shown.clone())
        });
    Panel::new(title, series.collect()).height(150.0)
}

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
        .take(SHOWN.panels)
        .flat_map(|(j, parameter)| {
            let dots = |dot: &dyn Fn(&PointScore) -> Dot| -> Vec<Dot> {
                let mut dots: Vec<Dot> = points.iter().map(dot).collect();
                ascending(&mut dots, |a| a.x);
                dots
            };
            let shares = dots(&|point| {
                let (x, y) = (point.theta[j], point.coverage[j].share);
                let (low, high) = point.coverage[j].held.interval();
                Dot { x, y, low, high }
            });
            let errors = dots(&|point| {
                let (x, y) = (point.theta[j], point.rmse[j]);
                let (low, high) = (y, y);
                Dot { x, y, low, high }
            });
            let x = format!("true {}{}", parameter.name, in_unit(&parameter.unit));
            let share = over_bounds(parameter, "share held", ("nominal", INTERVAL_LEVEL))
                .height(150.0)
                .range(0.0, 1.0)
                .dots(Dots {
                    label: "records at one θ, 95 % interval".into(),
                    points: shares,
                });
            let error = over_bounds(parameter, "rms error", ("", 0.0))
                .height(110.0)
                .dots(Dots {
                    label: String::new(),
                    points: errors,
                });
            [(x.clone(), vec![share]), (x, vec![error])]
        });
    let title = format!("{}: coverage and error over the truth", study.name());
    let description = format!(
        "Share of {:.0} % intervals that held the true value, and root mean square error, at {} fixed points with {each} records \
         each, {all} in all.",
        100.0 * INTERVAL_LEVEL,
        points.len(),
    );
    Some(chart(&title, &description, &panels.collect::<Vec<_>>()))
}

/// A panel over the bounds of a parameter, with a line at a level and a bar at the prior.
fn over_bounds(parameter: &Parameter, what: &str, (label, level): (&str, f64)) -> Panel {
    let (bounds, prior) = (parameter.bounds, parameter.prior);
    let line = [(bounds.low(), level), (bounds.high(), level)];
    let series = vec![Line::new(label, Style::ZERO, line)];
    Panel::new(&format!("{}: {what}", parameter.name), series).spans(vec![Span {
        from: prior.low(),
        to: prior.high(),
        label: "prior".into(),
        weight: 0.3,
        clear: false,
    }])
}
