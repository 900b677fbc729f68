//! Functions that the twin lacks.

use crate::diagnose::{Diagnosis, MissingFunction};
use crate::report::chart::{Area, Curves, Panel, Series, Style};
use crate::report::digits::short;
use crate::report::units::Units;
use crate::study::Study;

/// Height of a panel.
const HEIGHT: f64 = 130.0;

/// Missing functions with ± one standard error, beside the twin alone and on top of the accepted effects; `None` where none was fitted.
pub fn functions(study: &Study, diagnosis: &Diagnosis) -> Option<String> {
    let units = Units::of(study);
    let all = &diagnosis.location.functions;
    let first = all.first()?;
    let picture = Curves {
        title: "Missing functions".into(),
        description: format!(
            "{} functions with bands of ± 1 standard error; the clearest depends on {} and joins the {}, {} nats.",
            all.len(),
            first.variable,
            units.place_name(&first.place),
            short(first.log_evidence)
        ),
        panels: (all.iter())
            .map(|function| panel(&units, function))
            .collect(),
    };
    Some(picture.svg())
}

/// Returns the x axis and the panel of a function.
fn panel(units: &Units, function: &MissingFunction) -> (String, Panel) {
    let points = || (function.values.iter().copied()).zip(function.mean.iter().copied());
    let band = (points().zip(&function.std_error))
        .map(|((value, mean), error)| (value, mean - error, mean + error))
        .collect();
    let ends = [function.values.first(), function.values.last()];
    let zero = ends.into_iter().flatten().map(|value| (*value, 0.0));
    let (beside, style) = match function.on_top {
        true => ("on top of the accepted effects", Style::BEFORE),
        false => ("beside the twin alone", Style::AFTER),
    };
    let label = format!("{beside}, {} nats", short(function.log_evidence));
    let lines = vec![
        Series::new("", Style::ZERO, zero),
        Series::new(&label, style, points()),
    ];
    let panel = Panel::new(&units.place(&function.place), lines)
        .height(HEIGHT)
        .area(Area {
            label: "± 1 standard error".into(),
            points: band,
        });
    (units.named(&function.variable), panel)
}
