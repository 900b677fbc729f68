//! Residuals as people know them: auto-correlation, cross-correlation with the inputs, quantiles.

use super::chart::{Area, Dot, Dots, Line, Panel, Style, chart};
use super::document::Block;
use crate::record::Signal;
use crate::report::digits::SHOWN;
use crate::study::Study;
use statrs::distribution::{ContinuousCDF, Normal};

/// Inputs of one record, N × inputs, and its residuals, N × outputs; NaN where nothing was measured.
pub(super) type Left<'a> = (&'a Signal, &'a Signal);

/// The pictures of the residuals of all records, which are `of_what`; those of a right twin are white, or are not.
pub(super) fn residual_blocks(
    study: &Study,
    of_what: &str,
    is_white: bool,
    all: &[Left<'_>],
) -> Vec<Block> {
    let signals = study.twin().signals();
    let names = |channels: Vec<crate::record::Quantity>| -> Vec<String> {
        channels.into_iter().map(|q| q.name).collect()
    };
    let (inputs, outputs) = (names(signals.inputs), names(signals.outputs));
    let of = match all.len() {
        1 => format!("Residuals are {of_what}."),
        n => format!("Residuals are {of_what}, of all {n} records."),
    };
    let whiteness = match is_white {
        true => "Band: 95 % of white noise. Residuals of a right twin's predictions are white.",
        false => {
            "Errors of a right twin's free run are white only without process noise; one-step errors of a fit are white for every right twin."
        }
    };
    let mut blocks = vec![
        Block::Paragraph(of),
        Block::picture(auto_correlations(&outputs, is_white, all), whiteness),
    ];
    if let Some(svg) = cross_correlations(&outputs, &inputs, is_white, all) {
        blocks.push(Block::picture(
            svg,
            match is_white {
                true => {
                    "Residuals against inputs some samples before. Band: 95 % of white noise. Outside it, the twin misses a part of what the \
                     input does."
                }
                false => "Residuals against inputs some samples before.",
            },
        ));
    }
    blocks.push(Block::picture(
        quantiles(&outputs, all),
        "Sorted, against those of a normal distribution of the same size: on the line if they are normal.",
    ));
    blocks
}

/// A column less its mean over all records; missing values are 0, which adds nothing to a product.
fn centred<'a>(
    all: &'a [Left<'a>],
    pick: impl Fn(&Left<'a>) -> &'a Signal,
    j: usize,
) -> Vec<Vec<f64>> {
    let columns: Vec<Vec<f64>> = all.iter().map(|l| pick(l).column(j).to_vec()).collect();
    let there = || columns.iter().flatten().filter(|v| v.is_finite());
    let mean = there().sum::<f64>() / there().count().max(1) as f64;
    let centre = |v: f64| if v.is_finite() { v - mean } else { 0.0 };
    (columns.into_iter())
        .map(|column| column.into_iter().map(centre).collect())
        .collect()
}

/// Correlation of `late` with `early` so many samples before, over all records.
fn correlation(late: &[Vec<f64>], early: &[Vec<f64>], lag: usize) -> f64 {
    let product: f64 = (late.iter().zip(early))
        .map(|(a, b)| {
            let shifted = a.iter().skip(lag);
            shifted.zip(b).map(|(x, y)| x * y).sum::<f64>()
        })
        .sum();
    let size = |all: &[Vec<f64>]| all.iter().flatten().map(|v| v * v).sum::<f64>();
    product / (size(late) * size(early)).sqrt().max(f64::MIN_POSITIVE)
}

/// A panel of correlations at some lags, with the band of white noise of so many values, if given.
fn panel(label: &str, at: impl Fn(usize) -> f64, lags: [usize; 2], count: Option<usize>) -> Panel {
    let dots = (lags[0]..=lags[1]).map(|lag| {
        let y = at(lag);
        Dot {
            x: lag as f64,
            y,
            low: y.min(0.0),
            high: y.max(0.0),
        }
    });
    let ends = [lags[0] as f64 - 0.5, lags[1] as f64 + 0.5];
    let zero = Line::new("", Style::ZERO, ends.map(|x| (x, 0.0)));
    let panel = Panel::new(label, vec![zero]).height(120.0);
    let panel = match count {
        None => panel,
        Some(count) => {
            let reach = SHOWN.white_band / (count.max(1) as f64).sqrt();
            panel.area(Area {
                label: "95 % of white noise".into(),
                points: ends.map(|x| (x, -reach, reach)).to_vec(),
            })
        }
    };
    panel.dots(Dots {
        label: String::new(),
        points: dots.collect(),
    })
}

/// Number of residuals of an output that are there.
fn count(all: &[Left<'_>], j: usize) -> usize {
    let columns = all.iter().flat_map(|(_, outputs)| outputs.column(j));
    columns.filter(|v| v.is_finite()).count()
}

/// Auto-correlations of the residuals of each output.
fn auto_correlations(names: &[String], is_white: bool, all: &[Left<'_>]) -> String {
    let panels = names.iter().enumerate().map(|(j, name)| {
        let own = centred(all, |l| l.1, j);
        let at = |lag| correlation(&own, &own, lag);
        let label = format!("correlation of {name}");
        panel(&label, at, [1, SHOWN.lags], is_white.then(|| count(all, j)))
    });
    let axis = ("lag in samples".to_owned(), panels.collect());
    let description = format!(
        "Auto-correlations of the residuals at lags 1 to {}.",
        SHOWN.lags
    );
    chart("Autocorrelation of residuals", &description, &[axis])
}

/// Cross-correlations of the residuals of each output with each input before; `None` without inputs.
fn cross_correlations(
    outputs: &[String],
    inputs: &[String],
    is_white: bool,
    all: &[Left<'_>],
) -> Option<String> {
    let pairs = (0..outputs.len()).flat_map(|j| (0..inputs.len()).map(move |i| (j, i)));
    let panels: Vec<Panel> = pairs
        .take(SHOWN.cross_panels)
        .map(|(j, i)| {
            let late = centred(all, |l| l.1, j);
            let early = centred(all, |l| l.0, i);
            let label = format!("correlation of {} with {}", outputs[j], inputs[i]);
            let at = |lag| correlation(&late, &early, lag);
            panel(&label, at, [0, SHOWN.lags], is_white.then(|| count(all, j)))
        })
        .collect();
    if panels.is_empty() {
        return None;
    }
    let count = panels.len();
    let lags = SHOWN.lags;
    let description =
        format!("Cross-correlations of residuals with inputs at lags 0 to {lags}, {count} panels.");
    let axis = ("lag in samples".to_owned(), panels);
    let svg = chart(
        "Correlation of residuals with inputs",
        &description,
        &[axis],
    );
    Some(svg)
}

/// Quantiles of the residuals of each output against normal ones.
fn quantiles(names: &[String], all: &[Left<'_>]) -> String {
    let normal = Normal::standard();
    let panels = names.iter().enumerate().map(|(j, name)| {
        let columns = all
            .iter()
            .flat_map(|(_, outputs)| outputs.column(j).to_vec());
        let mut values: Vec<f64> = columns.filter(|v| v.is_finite()).collect();
        values.sort_unstable_by(f64::total_cmp);
        let n = values.len().max(1) as f64;
        let size = (values.iter().map(|v| v * v).sum::<f64>() / n).sqrt();
        let every = values.len().div_ceil(SHOWN.quantiles).max(1);
        let points: Vec<(f64, f64)> = (values.iter().enumerate().step_by(every))
            .map(|(i, v)| (normal.inverse_cdf((i as f64 + 0.5) / n), *v))
            .collect();
        let ends = [points.first(), points.last()].into_iter().flatten();
        let line: Vec<(f64, f64)> = ends.map(|(x, _)| (*x, x * size)).collect();
        let lines = vec![
            Line::new("normal", Style::ZERO, line),
            Line::new("residuals", Style::AFTER, points),
        ];
        let panel = Panel::new(&format!("residual of {name}"), lines);
        ("normal quantile".to_owned(), vec![panel])
    });
    let description = "Sorted residuals against quantiles of a normal distribution.";
    let axes: Vec<_> = panels.collect();
    chart("Quantiles of residuals", description, &axes)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A residual that is the input three samples before, in two records: the correlation is 1 there alone.
    #[test]
    fn a_missed_delay_shows_in_the_cross_correlation() {
        let noise = |k: usize| ((k * k * 7919 + k * 104_729) % 2003) as f64 / 1001.0 - 1.0;
        let inputs =
            [0, 5000].map(|from| Signal::from_shape_fn((400, 1), |(k, _)| noise(k + from)));
        let outputs = [0, 5000].map(|from| {
            Signal::from_shape_fn((400, 1), |(k, _)| match k {
                0..3 => f64::NAN,
                k => 0.5 * noise(k - 3 + from),
            })
        });
        let all: Vec<Left<'_>> = inputs.iter().zip(&outputs).collect();
        let late = centred(&all, |l| l.1, 0);
        let early = centred(&all, |l| l.0, 0);
        let at: Vec<f64> = (0..=SHOWN.lags)
            .map(|lag| correlation(&late, &early, lag))
            .collect();
        let band = SHOWN.white_band / (count(&all, 0) as f64).sqrt();
        assert!(at[3] > 0.99, "{at:?}");
        let outside = at.iter().filter(|r| r.abs() > 2.0 * band).count();
        assert_eq!(outside, 1, "{at:?}");
        assert_eq!(count(&all, 0), 794);
        assert!(correlation(&late, &late, 1).abs() < 2.0 * band);
    }
}
