//! The paper's trajectory figures: what the twin shows at each method's answer.

use crate::evaluate::baseline::Initialisation::Bad;
use crate::evaluate::paper::{AnswerRuns, MeanRuns, ScoredMethod};
use crate::record::Signal;
use crate::report::chart::{Chart, Panel, Series, Style, roomy};
use crate::report::digits::named;
use crate::study::Study;

/// Which methods a panel shows.
type Belongs = fn(ScoredMethod) -> bool;

/// The paper's trajectory figure: noise-free runs of the twin at the truth and, as means over the records, at the
/// answers of each family of methods. `None` where the twin diverges at the truth.
pub fn mean_runs_svg(study: &Study, means: &MeanRuns) -> Option<String> {
    let truth = means.truth.as_ref()?;
    let families: [(&str, Belongs); 3] = [
        ("Two-Stage", |m| {
            matches!(
                m,
                ScoredMethod::TsPre | ScoredMethod::TsFine | ScoredMethod::Final
            )
        }),
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
    let chart = Chart {
        title: format!(
            "{}: truth, and mean of {} predictions",
            study.name(),
            means.runs
        ),
        description: format!(
            "Noise-free outputs of the twin at the true parameters, and at the estimates of each method: means over \
             {} simulated records.",
            means.runs
        ),
        x: "t in s".into(),
        panels,
    };
    Some(chart.svg())
}

/// One record and free runs at what it made of the pretrained network, of the final answer, and of both baselines from their bad starts.
pub fn first_run_svg(study: &Study, runs: &AnswerRuns) -> String {
    let drive = runs.record.drive();
    let times: Vec<f64> = (0..drive.samples()).map(|k| drive.time(k)).collect();
    let outputs = study.twin().signals().outputs;
    let ours: Belongs = |m| {
        matches!(
            m,
            ScoredMethod::TsPre | ScoredMethod::TsFine | ScoredMethod::Final
        )
    };
    let theirs: Belongs = |m| matches!(m, ScoredMethod::PredictionError(start) | ScoredMethod::DualFilter(start) if start == Bad);
    let panels = (outputs.iter().enumerate())
        .flat_map(|(channel, quantity)| {
            let measured = Trajectory("measured".into(), Style::RECORD, runs.record.outputs());
            let of = |belongs: Belongs| lines(&runs.answers, belongs, |method| method.to_string());
            let (ours, theirs) = (of(ours), of(theirs));
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
    let chart = Chart {
        title: format!("{}: the first record and its twins", study.name()),
        description: "The first simulated record, and noise-free outputs of the twin at what each method estimated from \
                      it."
            .into(),
        x: "t in s".into(),
        panels,
    };
    chart.svg()
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
            Series::new(label, *style, points).within(shown.clone())
        });
    Panel::new(title, series.collect()).height(150.0)
}
