//! The page of an estimate or a fit: record and twin, parameters, draws, residuals, warnings.

use super::estimate::{estimate_text, overlay_svg, rows};
use super::fit::{described, posterior_svg};
use super::page::{Section, escaped, figure, page, preformatted};
use super::parameters::{Line, ParameterRow, parameter_table};
use super::residuals::{Left, residual_figures};
use crate::estimator::Estimate;
use crate::fit::{Fit, Posterior, Warning};
use crate::record::Record;
use crate::study::Study;
use crate::twin::{Parameter, Role};

/// The page of an estimate.
pub(crate) fn estimate_html(study: &Study, record: &Record, estimate: &Estimate) -> String {
    let before = (estimate.refit()).and_then(|refit| refit.tracking_initial.as_ref());
    let before = before.map(|run| &run.outputs);
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
        residuals: (residuals.iter())
            .map(|outputs| Left {
                inputs: record.drive().inputs(),
                outputs,
            })
            .collect(),
        of_what: "record − twin",
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
        residuals: (records.iter().zip(&fit.residuals))
            .map(|(record, outputs)| Left {
                inputs: record.drive().inputs(),
                outputs,
            })
            .collect(),
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
    residuals: Vec<Left<'a>>,
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
        if !self.residuals.is_empty() {
            let body = residual_figures(study, self.of_what, self.is_white, &self.residuals);
            sections.push(Section::new("residuals", "Residuals", body));
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
        let fit = (found
            .study
            .fit_with(&records, &settings, &Progress::silent()))
        .unwrap();
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
