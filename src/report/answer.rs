//! The page of an estimate or a fit: record and twin, parameters, draws, residuals, warnings.

use super::chart::{Area, Dot, Dots, Panel, Series, Style};
use super::chart::{Chart, Curves};
use super::estimate::{estimate_text, overlay_svg, rows};
use super::fit::{described, posterior_svg};
use super::page::{Section, escaped, figure, page, paragraph, preformatted};
use super::parameters::{Line, ParameterRow, parameter_table};
use crate::estimator::Estimate;
use crate::fit::{Fit, Posterior, Warning};
use crate::record::{Record, Signal};
use crate::study::Study;
use crate::twin::{Parameter, Role};
use statrs::distribution::{ContinuousCDF, Normal};

/// Lags of the correlations.
const LAGS: usize = 20;
/// Standard deviations of 95 % of white noise.
const BAND: f64 = 1.96;
/// Points of a quantile plot: more only blot.
const QUANTILES: usize = 200;

/// The page of an estimate.
pub(crate) fn estimate_html(study: &Study, record: &Record, estimate: &Estimate) -> String {
    let before = estimate.tracking_initial.as_ref().map(|run| &run.outputs);
    let after = estimate.tracking.as_ref().map(|run| &run.outputs);
    let picture = after.map(|after| overlay_svg(study, record, before, after));
    let residuals = after.map(|after| record.outputs() - after);
    let space = study.twin().parameters();
    let lines = space.iter().cloned().zip(rows(study, estimate)).collect();
    let text = estimate_text(study, estimate);
    let answer = Answer {
        title: format!("{}: estimate", study.name()),
        summary: text
            .lines()
            .take_while(|line| !line.is_empty())
            .collect::<Vec<_>>()
            .join(" "),
        pictures: picture.into_iter().collect(),
        lines,
        posterior: estimate.posterior.as_ref(),
        residuals: residuals.as_ref(),
        of_what: "record − free run",
        is_white: false,
        warnings: &estimate.warnings,
        text,
    };
    answer.html(study)
}

/// The page of a fit.
pub(crate) fn fit_html(study: &Study, records: &[Record], fit: &Fit) -> String {
    let runs = records.iter().zip(&fit.free_runs);
    let pictures =
        runs.filter_map(|(record, run)| Some(overlay_svg(study, record, None, run.as_ref()?)));
    let space = study.twin().parameters();
    let answer = Answer {
        title: format!("{}: fit", study.name()),
        summary: format!(
            "{} parameters, fitted to {} samples.",
            fit.parameters.len(),
            fit.samples
        ),
        pictures: pictures.collect(),
        lines: fit
            .parameters
            .iter()
            .map(|p| described(p, &space))
            .collect(),
        posterior: fit.posterior.as_ref(),
        residuals: fit.residuals.first(),
        of_what: "one-step errors over their standard deviation",
        is_white: true,
        warnings: &fit.warnings,
        text: super::fit::fit_text(study, fit),
    };
    answer.html(study)
}

/// Contents of both pages.
struct Answer<'a> {
    title: String,
    summary: String,
    pictures: Vec<String>,
    lines: Vec<(Parameter, ParameterRow)>,
    posterior: Option<&'a Posterior>,
    residuals: Option<&'a Signal>,
    of_what: &'static str,
    /// Residuals of a right twin are white: one-step errors are, differences from a free run are not if the states have noise.
    is_white: bool,
    warnings: &'a [Warning],
    text: String,
}

impl Answer<'_> {
    fn html(&self, study: &Study) -> String {
        let mut pictures = self.pictures.iter();
        let first = pictures.next().map_or_else(String::new, |svg| {
            figure(
                svg,
                "The twin runs from the inputs alone, without noise. Below: record − twin.",
            )
        });
        let warnings: String = (self.warnings.iter())
            .map(|w| format!("<li>{}; {}</li>\n", escaped(&w.what), escaped(w.remedy)))
            .collect();
        let warnings = match warnings.is_empty() {
            true => String::new(),
            false => format!("<ul>\n{warnings}</ul>\n"),
        };
        let lead = format!(
            "<div class=\"first\">\n<div>\n<p class=\"verdict\">{}</p>\n{warnings}</div>\n{first}</div>\n",
            escaped(&self.summary)
        );
        let mut sections = vec![Section::new("parameters", "Parameters", self.table())];
        if let Some(posterior) = self.posterior {
            let svg = posterior_svg(study, posterior);
            let caption = "Each dot is a draw of the posterior: a system that the record allows.";
            sections.push(Section::new(
                "draws",
                "Posterior draws",
                figure(&svg, caption),
            ));
        }
        let others: String = pictures
            .map(|svg| figure(svg, "A further record."))
            .collect();
        if !others.is_empty() {
            sections.push(Section::new("records", "Further records", others));
        }
        if let Some(residuals) = self.residuals {
            sections.push(Section::new(
                "residuals",
                "Residuals",
                self.residual_figures(study, residuals),
            ));
        }
        let text = preformatted(&self.text);
        sections.push(Section::new("text", "As on the terminal", text));
        page(&self.title, &lead, &sections)
    }

    fn table(&self) -> String {
        let lines: Vec<Line> = (self.lines.iter())
            .map(|(parameter, line)| {
                let name = match parameter.role {
                    Role::Start => format!("start of {}", parameter.target()),
                    _ => line.name.clone(),
                };
                (name, parameter.role, line.clone(), vec![])
            })
            .collect();
        let caption = "Prior: the range that was trained on or expected. Not identified: the record says no more than the prior.";
        parameter_table(caption, &[], &lines)
    }

    fn residual_figures(&self, study: &Study, residuals: &Signal) -> String {
        let names: Vec<String> = (study.twin().signals().outputs.into_iter())
            .map(|output| output.name)
            .collect();
        let what = format!("Of {}.", self.of_what);
        let whiteness = match self.is_white {
            true => "Band: 95 % of white noise. One-step errors of a right twin are white.",
            false => {
                "A right twin's are white only without process noise: a state that noise has moved stays off for a while. `truetwin fit` shows one-step errors, which are white for every right twin."
            }
        };
        let lags = figure(
            &correlations(&names, residuals, self.is_white),
            &format!("{what} {whiteness}"),
        );
        let quantiles = figure(
            &quantiles(&names, residuals),
            &format!(
                "{what} Sorted, against those of a normal distribution of the same size: on the line if they are normal."
            ),
        );
        paragraph("What the twin leaves, over time and by size.") + &lags + &quantiles
    }
}

/// Auto-correlations of the residuals of each output.
fn correlations(names: &[String], residuals: &Signal, is_white: bool) -> String {
    let panels = names.iter().enumerate().map(|(j, name)| {
        let values = present(residuals, j);
        let n = values.len().max(1) as f64;
        let mean = values.iter().sum::<f64>() / n;
        let at = |lag: usize| -> f64 {
            let product = |i: usize| (values[i] - mean) * (values[i + lag] - mean);
            (0..values.len().saturating_sub(lag)).map(product).sum()
        };
        let all = at(0).max(f64::MIN_POSITIVE);
        let reach = BAND / n.sqrt();
        let dots = (1..=LAGS).map(|lag| {
            let (x, y) = (lag as f64, at(lag) / all);
            Dot {
                x,
                y,
                low: y.min(0.0),
                high: y.max(0.0),
            }
        });
        let ends = [(0.5, -reach, reach), (LAGS as f64 + 0.5, -reach, reach)];
        let zero = ends.map(|(x, ..)| (x, 0.0));
        let panel = Panel::new(
            &format!("correlation of {name}"),
            vec![Series::new("", Style::ZERO, zero)],
        );
        let panel = match is_white {
            true => panel.area(Area {
                label: "95 % of white noise".into(),
                points: ends.to_vec(),
            }),
            false => panel,
        };
        panel.height(120.0).dots(Dots {
            label: String::new(),
            points: dots.collect(),
        })
    });
    Chart {
        title: "Residuals against themselves".into(),
        description: format!("Auto-correlations of the residuals at lags 1 to {LAGS}."),
        x: "lag in samples".into(),
        panels: panels.collect(),
    }
    .svg()
}

/// Quantiles of the residuals of each output against normal ones.
fn quantiles(names: &[String], residuals: &Signal) -> String {
    let normal = Normal::standard();
    let panels = names.iter().enumerate().map(|(j, name)| {
        let mut values = present(residuals, j);
        values.sort_unstable_by(f64::total_cmp);
        let n = values.len().max(1) as f64;
        let size = (values.iter().map(|v| v * v).sum::<f64>() / n).sqrt();
        let every = values.len().div_ceil(QUANTILES).max(1);
        let points: Vec<(f64, f64)> = (values.iter().enumerate().step_by(every))
            .map(|(i, v)| (normal.inverse_cdf((i as f64 + 0.5) / n), *v))
            .collect();
        let ends = [points.first(), points.last()].into_iter().flatten();
        let line: Vec<(f64, f64)> = ends.map(|(x, _)| (*x, x * size)).collect();
        let lines = vec![
            Series::new("normal", Style::ZERO, line),
            Series::new("residuals", Style::AFTER, points),
        ];
        (
            "normal quantile".to_owned(),
            Panel::new(&format!("residual of {name}"), lines),
        )
    });
    Curves {
        title: "Sizes of residuals".into(),
        description: "Sorted residuals against quantiles of a normal distribution.".into(),
        panels: panels.collect(),
    }
    .svg()
}

fn present(residuals: &Signal, output: usize) -> Vec<f64> {
    let values = residuals.column(output);
    values.iter().copied().filter(|v| v.is_finite()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fit::FitSettings;
    use crate::progress::Progress;
    use crate::report::fixture::estimates;

    #[test]
    fn both_pages_show_parameters_residuals_and_draws() {
        let found = estimates();
        let settings = FitSettings {
            draws: 50,
            ..FitSettings::default()
        };
        let records = [found.record.clone()];
        let fit = (found.study.fit(&records, &settings, &Progress::silent())).unwrap();
        let of_fit = fit_html(&found.study, &records, &fit);
        assert!(of_fit.contains("id=\"draws\""));
        for page in [
            of_fit.clone(),
            estimate_html(&found.study, &found.record, &found.refined),
        ] {
            for part in [
                "<!doctype html>",
                "id=\"parameters\"",
                "id=\"residuals\"",
                "± std error",
                "nu",
            ] {
                assert!(page.contains(part), "{part}");
            }
            assert!(!page.contains("NaN") && !page.contains("<script"));
        }
        // Only one-step errors are to be white.
        let of_estimate = estimate_html(&found.study, &found.record, &found.refined);
        assert!(of_fit.contains("95 % of white noise"));
        assert!(!of_estimate.contains("95 % of white noise"));
        assert!(of_estimate.contains("white only without process noise"));
    }
}
