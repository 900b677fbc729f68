//! A diagnosis as one page that needs nothing else.

use super::chart::{Chart, Panel, Series, Style};
use super::digits::{probability, short};
use super::gap_text::verdict_sentence;
use crate::diagnose::Diagnosis;

/// Explanations that are listed.
const SHOWN: usize = 8;

/// The diagnosis as a self-contained page: the verdict, measured and twin before and after, effects by probability, what
/// closes.
pub fn gap_html(found: &Diagnosis) -> String {
    let verdict = escaped(&verdict_sentence(found));
    let mut rows = String::new();
    for effect in found.which.effects.iter().take(SHOWN) {
        let magnitudes: Vec<String> = (effect.magnitudes.iter())
            .filter(|(_, v)| v.is_finite())
            .map(|(name, v)| format!("{name} {}", short(*v)))
            .collect();
        let accepted = found.which.accepted.contains(&effect.key());
        rows.push_str(&format!(
            "<tr{}><td>{}</td><td>{}</td><td class=\"n\">{:.2}</td><td class=\"n\">{}</td></tr>\n",
            if accepted { " class=\"a\"" } else { "" },
            escaped(&effect.key()),
            escaped(&magnitudes.join(", ")),
            effect.probability,
            short(effect.log_score_gain),
        ));
    }
    let effects = match rows.is_empty() {
        true => String::new(),
        false => format!(
            "<h2>Effects, best first</h2>\n<table>\n<tr><th>effect</th><th>magnitudes</th><th>probability</th><th>gain in nats</th></tr>\n{rows}</table>\n"
        ),
    };
    let closed = match found.shrinkage.as_ref().map(|s| (s, s.closed, s.interval)) {
        Some((s, Some(closed), Some([low, high]))) => format!(
            "<p>{:.0} % of the gap closes on the {} ({:.0} to {:.0} %): {} {} → {}, noise alone {}.</p>\n",
            100.0 * closed,
            s.held_out,
            100.0 * low,
            100.0 * high,
            s.metric,
            short(s.before),
            s.after.map_or("–".into(), short),
            s.floor.map_or("–".into(), short),
        ),
        Some((s, ..)) => format!(
            "<p>{} on the {}: {}{}.</p>\n",
            s.metric,
            s.held_out,
            short(s.before),
            s.after
                .map_or(String::new(), |after| format!(" → {}", short(after))),
        ),
        None => String::new(),
    };
    let title = escaped(&format!("{}: what the twin lacks", found.twin));
    format!(
        "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><meta name=\"viewport\" content=\"width=device-width\">\
         <title>{title}</title>\n<style>body{{font:16px/1.5 system-ui,sans-serif;max-width:60rem;margin:2rem auto;padding:0 1rem;color:#222;background:#fff}}\
         .v{{font-size:1.3rem;font-weight:600}}table{{border-collapse:collapse}}td,th{{padding:.2rem .8rem;text-align:left;border-bottom:1px solid #ddd}}\
         .n{{text-align:right}}.a{{font-weight:600}}</style></head>\n<body>\n<h1>{title}</h1>\n<p class=\"v\">{verdict}</p>\n\
         <p>Structural test, parameters refitted: {} at level {}.</p>\n{closed}{}\n{effects}</body></html>\n",
        probability(found.detection.p_value),
        found.detection.alpha,
        picture(found),
    )
}

/// Measured outputs and free runs.
fn picture(found: &Diagnosis) -> String {
    let runs = &found.free_runs;
    let line = |signal: &crate::twin::Signal, j: usize| -> Vec<(f64, f64)> {
        let values = signal.column(j).to_vec();
        runs.times.iter().copied().zip(values).collect()
    };
    let panels = (0..runs.measured.ncols())
        .map(|j| {
            let mut series = vec![Series::new(
                "measured",
                Style::RECORD,
                line(&runs.measured, j),
            )];
            if let Some(before) = &runs.before {
                series.push(Series::new(
                    "twin, refitted",
                    Style::BEFORE,
                    line(before, j),
                ));
            }
            if let Some(after) = &runs.after {
                series.push(Series::new("with the effect", Style::AFTER, line(after, j)));
            }
            Panel::new(&format!("output {}", j + 1), series)
        })
        .collect();
    Chart {
        title: "Measured, and the twin running free".into(),
        description: "The measured outputs, the refitted twin without noise, and the twin with the accepted effects.".into(),
        x: "t in s".into(),
        panels,
    }
    .svg()
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('>', "&gt;")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::fixture::diagnoses;

    #[test]
    fn the_page_stands_alone() {
        for found in diagnoses() {
            let page = gap_html(found);
            assert!(page.starts_with("<!doctype html>") && page.ends_with("</html>\n"));
            assert!(page.contains("<svg") && page.contains(&escaped(&verdict_sentence(found))));
            assert!(!page.contains("src=") && !page.contains("href="));
        }
    }
}
