//! Missing terms of the equations by ranges of states and inputs.

use crate::diagnose::{Diagnosis, Equation};
use crate::report::chart::{Facet, FacetRow, Multiples, Step};
use crate::report::digits::{percent, probability, unit_suffix};
use crate::report::units::Units;
use crate::study::Study;

/// Equations that are drawn.
const SHOWN: usize = 3;

/// The mean missing term of the most probable equations by ranges of states and inputs; `None` where none was looked for.
pub fn equations(study: &Study, diagnosis: &Diagnosis) -> Option<String> {
    let units = Units::of(study);
    let with_term = || (diagnosis.location.equations.iter()).filter(|e| !e.term.is_empty());
    let first = with_term().next()?;
    let rows = (with_term().take(SHOWN))
        .map(|equation| FacetRow {
            label: format!(
                "{}, {}: {}",
                percent(equation.share),
                probability(equation.p_value),
                units.equation(&equation.equation)
            ),
            clear: equation.p_value < diagnosis.detection.alpha,
            facets: facets(&units, equation),
        })
        .collect();
    let picture = Multiples {
        title: "Missing terms of the equations".into(),
        description: format!(
            "Mean missing term by ranges of states and inputs; most probable in {} with {}.",
            units.equation(&first.equation),
            percent(first.share)
        ),
        rows,
    };
    Some(picture.svg())
}

/// A facet a variable, in the order in which they come.
fn facets(units: &Units, equation: &Equation) -> Vec<Facet> {
    let mut variables: Vec<&str> = vec![];
    for range in &equation.term {
        if !variables.contains(&range.variable.as_str()) {
            variables.push(&range.variable);
        }
    }
    let facet = |variable: &str| {
        let unit = match unit_suffix(units.variable(variable)) {
            unit if unit.is_empty() => unit,
            unit => format!(" in{unit}"),
        };
        let own = (equation.term.iter()).filter(|range| range.variable == variable);
        let mut steps: Vec<Step> = own
            .map(|range| Step {
                low: range.low,
                high: range.high,
                mean: range.mean,
                error: range.std_error,
            })
            .collect();
        steps.sort_by(|a, b| a.low.total_cmp(&b.low));
        Facet {
            x: format!("{variable}{unit}"),
            steps,
        }
    };
    variables.into_iter().map(facet).collect()
}
