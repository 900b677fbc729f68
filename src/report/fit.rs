//! A fit as JSON and as a document.

use super::chart::{Line, Panel, Style, TimeMark, chart, pair_plot};
use super::digits::{SHOWN, in_unit, percent, short, with_error, with_unit};
use super::document::Column::{Number, Text};
use super::document::{Block, Document, Picture, Section};
use super::parameters::{ParameterRow, priors, values};
use super::record::overlay_svg;
use super::residuals::{Left, residual_blocks};
use crate::fit::{Fit, FittedNoise, FittedStart, FittedValue, Posterior, Profile, depth};
use crate::record::Record;
use crate::setting::{count, own_unit, unit_suffix};
use crate::study::Study;
use crate::twin::{Parameter, ParameterSpace};
use serde_json::{Value, json};

/// The fit as one JSON object, `truetwin.fit/1`.
///
/// | key | holds |
/// |---|---|
/// | `parameters` | name, unit, value, standard error, interval (null where the search has not arrived, and an end that is none), prior, bounds; `prior_share`: variance over the prior's; `at_bound`: `low`, `high` or null. Of a magnitude that the readings show the error is 0; of an end that is off, the value is null |
/// | `noise` | fitted levels: states in units per √s, outputs in their own, `y.share` the share of \|y\| that is added to that of `y`; `declared` is null where nothing was declared; `at_bound` as of parameters |
/// | `starts` | states at the first sample of each record, given all of it |
/// | `level` | level of the intervals |
/// | `profiles` | profile likelihoods: name, unit, values, log-likelihoods below the highest, ends of the interval, null where a bound is inside |
/// | `log_likelihood`, `evidence` | in nats; `evidence.std_error` is null where Laplace's approximation stands alone, `evidence.gained`: over the twin without its fitted effects |
/// | `convergence` | `converged`; `distance` to the top in standard deviations; `agreeing` of `searches` |
/// | `errors` | of each output: root mean square of one-step and free-run errors, deviation of the record; `correlation` of one-step errors with the row before |
/// | `warnings` | `code`, `what`, `remedy` |
/// | `posterior` | of posterior draws: names, how many independent ones they are worth, share and mean of each mode; null where none were asked for |
/// | `steps` | of a twin with adaptive steps: samples, substeps, most of one sample, samples with implicit steps |
/// | `samples`, `seconds` | size of the records, time that it took |
/// | `interrupted` | stopped behind its search: what was left to ask of the records stands as without |
pub(super) fn fit_json(study: &Study, fit: &Fit) -> Value {
    let mut value = json!({ "schema": "truetwin.fit/1", "twin": study.name() });
    if let (Some(all), Ok(Value::Object(own))) = (value.as_object_mut(), serde_json::to_value(fit))
    {
        all.extend(own);
        let space = study.twin().parameters();
        let described = fit.parameters.iter().map(|p| described(p, &space));
        all["parameters"] = (described.zip(&fit.parameters))
            .map(|(line, p)| {
                let mut line = json!(line);
                line["low"] = json!(p.low);
                line["high"] = json!(p.high);
                line["by_profile"] = json!(p.by_profile);
                line
            })
            .collect();
        all.insert("posterior".into(), posterior_json(fit.posterior.as_ref()));
    }
    value
}

/// Posterior draws in short: their table is in files of its own.
pub(super) fn posterior_json(posterior: Option<&Posterior>) -> Value {
    posterior.map_or(Value::Null, |posterior| {
        json!({
            "names": posterior.names,
            "draws": posterior.values.nrows(),
            "effective": posterior.effective,
            "modes": posterior.summary(),
        })
    })
}

/// The fit for people; without records there are no pictures of them.
pub(super) fn fit_document(study: &Study, records: &[Record], fit: &Fit) -> Document {
    let space = study.twin().parameters();
    let rows: Vec<ParameterRow> = fit
        .parameters
        .iter()
        .map(|p| described(p, &space))
        .collect();
    let values = match rows.is_empty() {
        true => Block::paragraph("All parameters are fixed: noise alone is fitted."),
        false => values("", fit.level, &rows),
    };
    let mut pictures = (records.iter().zip(&fit.free_runs))
        .map(|(record, run)| overlay_svg(study, record, None, run.as_ref()));
    let picture = pictures.next().map(|svg| Picture {
        svg,
        caption: "The twin runs from the inputs alone, without noise. Below: record − twin.".into(),
    });
    let mut sections = vec![
        Section::new(
            "parameters",
            "Parameters, noise and starts",
            vec![priors(&[], &rows)],
        )
        .brief(levels(fit)),
        Section::new("errors", "Errors and convergence", vec![]).brief(quality(fit)),
    ];
    if !fit.profiles.is_empty() {
        let block = Block::picture(profiles_svg(study, fit), PROFILES);
        let section = Section::new("profiles", "Profile likelihoods", vec![block]);
        sections.push(section.brief(intervals(fit)));
    }
    sections.extend(fit.posterior.as_ref().map(|p| draws(study, p)));
    let others: Vec<Block> = pictures
        .map(|svg| Block::picture(svg, "A further record."))
        .collect();
    if !others.is_empty() {
        sections.push(Section::new("records", "Further records", others));
    }
    let residuals: Vec<Left<'_>> = (records.iter().zip(&fit.residuals))
        .map(|(record, outputs)| (record.drive().inputs(), outputs))
        .collect();
    if !residuals.is_empty() {
        let of_what = "one-step errors over their standard deviation";
        let blocks = residual_blocks(study, of_what, true, &residuals);
        sections.push(Section::new("residuals", "Residuals", blocks));
    }
    Document {
        title: format!("{}: fit", study.name()),
        answer: vec![
            Block::Headline(headline(fit)),
            values,
            Block::Doubts(fit.warnings.clone()),
            Block::paragraph(match off(fit) {
                Some(off) if off < 1.0 && fit.convergence.converged => {
                    "Next: diagnose whether the twin lacks something."
                }
                _ => "Next: diagnose what the twin lacks.",
            }),
        ],
        picture,
        sections,
        ..Document::default()
    }
}

/// Intervals of the profiles that the table of parameters has not.
fn intervals(fit: &Fit) -> Vec<Block> {
    let is_told = |name: &str| {
        fit.parameters
            .iter()
            .any(|p| p.by_profile && p.name == name)
    };
    let end = |end: Option<f64>| end.map_or("open".into(), short);
    let told = fit
        .profiles
        .iter()
        .filter(|profile| !is_told(&profile.name));
    let told: Vec<String> = told
        .map(|p| {
            format!(
                "{} [{}, {}]{}",
                p.name,
                end(p.low),
                end(p.high),
                unit_suffix(&p.unit)
            )
        })
        .collect();
    let text = format!("Profile, {:.0} %: {}.", 100.0 * fit.level, told.join("; "));
    (!told.is_empty())
        .then(|| Block::paragraph(text))
        .into_iter()
        .collect()
}

/// Caption of profiles.
const PROFILES: &str = "The highest log-likelihood at each value of a parameter, everything else answering, without the prior. \
The interval of the profile ends where a curve falls below the line; a curve that stays above it up to a bound of the parameter leaves that \
side open.";

/// A picture of profile likelihoods, one below the other.
pub(crate) fn profiles_svg(study: &Study, fit: &Fit) -> String {
    let end = -depth(fit.level);
    let panel = |profile: &Profile| {
        let points: Vec<(f64, f64)> = (profile.values.iter().copied())
            .zip(profile.log_likelihoods.iter().copied())
            .collect();
        let ends = points.first().zip(points.last());
        let line = ends.map_or(vec![], |(first, last)| vec![(first.0, end), (last.0, end)]);
        let fitted = fit.parameters.iter().find(|p| p.name == profile.name);
        let mark = fitted.map(|p| TimeMark {
            x: p.value,
            label: "fit".into(),
        });
        let level = format!("{:.0} % interval", 100.0 * fit.level);
        let series = vec![
            Line::new(&level, Style::ZERO, line),
            Line::new("profile", Style::AFTER, points),
        ];
        let panel = Panel::new("log-likelihood below the top, nats", series).height(110.0);
        let name = format!("{}{}", profile.name, in_unit(&profile.unit));
        (name, vec![panel.marks(mark.into_iter().collect())])
    };
    let axes: Vec<_> = fit.profiles.iter().map(panel).collect();
    let title = format!("{}: profile likelihoods", study.name());
    let names: Vec<&str> = fit.profiles.iter().map(|p| p.name.as_str()).collect();
    let description = format!(
        "One curve each of {}, with the line that ends intervals.",
        names.join(", ")
    );
    chart(&title, &description, &axes)
}

/// The largest free-run error of an output over its deviation, not a number where neither ever moves; none where a free run diverges.
fn off(fit: &Fit) -> Option<f64> {
    let each = fit.errors.iter().map(|e| Some(e.free_run? / e.deviation));
    each.collect::<Option<Vec<f64>>>()
        .map(|all| all.into_iter().fold(f64::NAN, f64::max))
}

fn headline(fit: &Fit) -> String {
    // What readings show is not fitted, and has no error.
    let count = (fit.parameters.iter())
        .filter(|p| p.std_error != 0.0)
        .count();
    let samples = fit.samples;
    let parameters = match count {
        1 => "parameter",
        _ => "parameters",
    };
    let fitted = format!("{count} {parameters} fitted to {samples} samples");
    match off(fit) {
        _ if !fit.convergence.converged => {
            format!("Not converged: {fitted}, the search has not arrived.")
        }
        None => format!("{fitted}: the free run diverges."),
        Some(off) if off >= 1.0 => format!("{fitted}: the free run does not follow the record."),
        Some(off) if off.is_nan() => format!("{fitted}: neither record nor free run ever moves."),
        Some(off) => format!(
            "{fitted}: the error of the free run is {} of the record's deviation.",
            percent(off)
        ),
    }
}

/// Fitted noise levels and starts.
fn levels(fit: &Fit) -> Vec<Block> {
    let stands = |error: f64| {
        if fit.convergence.converged {
            error
        } else {
            f64::NAN
        }
    };
    let noise = |level: &FittedNoise| {
        let [value, error] = with_error(level.value, stands(level.std_error));
        vec![
            match level.name.strip_suffix(".share") {
                Some(output) => format!("{output}, share of |{output}|"),
                None => level.name.clone(),
            },
            value,
            error,
            level.declared.map_or(String::new(), short),
            own_unit(&level.unit).to_owned(),
            level.at_bound.map_or("", |_| "at its bound").to_owned(),
        ]
    };
    let several = fit.starts.iter().any(|start| start.record > 1);
    // A start that is known needs no line.
    let estimated = (fit.starts.iter()).filter(|start| start.std_error > 0.0);
    let start = |start: &FittedStart| {
        let record = match several {
            true => format!(" (record {})", start.record),
            false => String::new(),
        };
        let [value, error] = with_error(start.value, stands(start.std_error));
        let unit = own_unit(&start.unit).to_owned();
        vec![start.name.clone() + &record, value, error, unit]
    };
    let [value, error] = [("value", Number), ("± std error", Number)];
    let head = [
        ("noise of", Text),
        value,
        error,
        ("declared", Number),
        ("unit", Text),
        ("", Text),
    ];
    let head_of_starts = [("start of", Text), value, error, ("unit", Text)];
    let tables: [(&[_], Vec<_>); 2] = [
        (&head, fit.noise.iter().map(noise).collect()),
        (&head_of_starts, estimated.map(start).collect()),
    ];
    let filled = tables.into_iter().filter(|(_, rows)| !rows.is_empty());
    filled
        .map(|(head, rows)| Block::table("", head, rows))
        .collect()
}

/// Errors of each output, convergence and evidence.
fn quality(fit: &Fit) -> Vec<Block> {
    let mut all: Vec<Block> = (fit.errors.iter())
        .map(|error| {
            let free =
                (error.free_run).map_or("diverges".into(), |rmse| with_unit(rmse, &error.unit));
            Block::Paragraph(format!(
                "{}: one-step error {}, free run {free}; the record varies by {}.",
                error.name,
                short(error.one_step),
                with_unit(error.deviation, &error.unit),
            ))
        })
        .collect();
    let c = fit.convergence;
    let mut search = match c.converged {
        true => format!(
            "Converged: {} of {} searches agree.",
            c.agreeing, c.searches
        ),
        false => "Not converged.".to_owned(),
    };
    if let Some(evidence) = &fit.evidence {
        let error = evidence
            .std_error
            .map_or(String::new(), |e| format!(" ± {}", short(e)));
        let nats = match evidence.log_evidence {
            huge if huge.abs() >= 1e6 => short(huge),
            nats => format!("{nats:.2}"),
        };
        let gained = evidence.gained.map_or(String::new(), |gained| {
            let sign = if gained < 0.0 { "less" } else { "more" };
            format!(", {} {sign} than without the effects", short(gained.abs()))
        });
        search += &format!(" Log evidence {nats}{error} nats{gained}.");
    }
    let steps = (fit.steps).map_or(String::new(), |taken| {
        format!(" The twin took {}.", taken.text())
    });
    all.push(Block::Paragraph(format!(
        "{search}{steps} {} s.",
        short(fit.seconds)
    )));
    all
}

/// Posterior draws in a line and a picture.
pub(super) fn draws(study: &Study, posterior: &Posterior) -> Section {
    let modes = posterior.summary();
    let several = match modes.len() {
        0 | 1 => String::new(),
        n => {
            let shares: Vec<String> = modes.iter().map(|m| percent(m.share)).collect();
            format!(" {n} modes hold {}.", shares.join(", "))
        }
    };
    let brief = Block::Paragraph(format!(
        "{}, worth {:.0} independent.{several}",
        count(posterior.values.nrows(), "posterior draw"),
        posterior.effective
    ));
    let caption = "Each dot is a draw of the posterior: a system that the record allows.";
    let rest = vec![Block::picture(posterior_svg(study, posterior), caption)];
    Section::new("draws", "Posterior draws", rest).brief(vec![brief])
}

/// A picture of posterior draws: histograms of the twin's parameters, or of whatever else was fitted, and each against each.
pub(crate) fn posterior_svg(study: &Study, posterior: &Posterior) -> String {
    let space = study.twin().parameters();
    let unit = |name: &str| (space.iter().find(|p| p.name == name)).map(|p| unit_suffix(&p.unit));
    let own = |j: &usize| unit(&posterior.names[*j]).is_some();
    let (own, others): (Vec<usize>, Vec<usize>) = (0..posterior.names.len()).partition(own);
    let columns = own.into_iter().chain(others).take(SHOWN.paired).map(|j| {
        let name = &posterior.names[j];
        let named = format!("{name}{}", unit(name).unwrap_or_default());
        (named, posterior.values.column(j).to_vec())
    });
    let modes = match posterior.modes.iter().copied().max().unwrap_or(1) {
        1 => "1 mode".to_owned(),
        modes => format!("{modes} modes, each in its colour"),
    };
    let (name, draws) = (study.name(), posterior.values.nrows());
    let groups: Vec<usize> = posterior.modes.iter().map(|mode| mode - 1).collect();
    pair_plot(
        &format!("{name}: {draws} posterior draws"),
        &format!("Histograms of posterior draws and each parameter against each; {modes}"),
        &columns.collect::<Vec<_>>(),
        &groups,
    )
}

/// The line of a fitted value in the table.
fn described(p: &FittedValue, space: &ParameterSpace) -> ParameterRow {
    let own = (space.iter().find(|own| own.name == p.name).cloned())
        .unwrap_or_else(|| Parameter::new(&p.name, &p.unit, p.low, p.high));
    ParameterRow {
        at_bound: p.at_bound,
        by_profile: p.by_profile,
        ..ParameterRow::new(&own, p.value, p.std_error, [p.low, p.high])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fit::FitSettings;
    use crate::progress::Progress;
    use crate::report::fixture::estimates;

    #[test]
    fn a_fit_opens_with_its_values_and_has_all_parts() {
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
        let document = fit_document(&found.study, &records, &fit);
        let page = document.html();
        let head = page.split("</header>").next().unwrap();
        assert!(head.contains("<th scope=\"row\">nu</th>") && head.contains("record − twin"));
        for part in ["id=\"draws\"", "id=\"residuals\"", "95 % of white noise"] {
            assert!(page.contains(part), "{part}");
        }
        assert!(!page.contains("NaN") && !page.contains("<script"));
        let text = document.text();
        assert!(text.lines().nth(3).unwrap().starts_with("nu "), "{text}");
        // A share of nothing is no share.
        let mut still = fit;
        still.convergence.converged = true;
        (still.errors[0].free_run, still.errors[0].deviation) = (Some(0.0), 0.0);
        assert!(headline(&still).ends_with("neither record nor free run ever moves."));
    }
}
