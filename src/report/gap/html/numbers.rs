//! Section on parameters, starts and noise levels.

use crate::diagnose::Diagnosis;
use crate::report::digits::{Digits, error, short, unit_suffix};
use crate::report::page::Column::{Number, Text};
use crate::report::page::{Section, paragraph, table};
use crate::report::parameters::{Line, ParameterRow, parameter_table};
use crate::report::units::Units;
use crate::twin::Role;

pub(super) fn section_of(units: &Units, diagnosis: &Diagnosis) -> Section {
    let is_told = diagnosis.parameters.iter().any(|p| p.initial.is_some());
    let is_beside = !diagnosis.cause.accepted.is_empty();
    let further = [("first estimate", is_told), ("twin alone", is_beside)];
    let more: Vec<&str> = (further.iter().filter(|(_, there)| *there))
        .map(|(name, _)| *name)
        .collect();
    let lines: Vec<Line> = (diagnosis.parameters.iter())
        .map(|p| {
            let cells = [
                (p.initial.map_or("–".into(), short), is_told),
                (short(p.alone), is_beside),
            ];
            let cells = cells.into_iter().filter(|(_, there)| *there);
            let row = ParameterRow::diagnosed(p);
            (
                p.name.clone(),
                Role::Parameter,
                row,
                cells.map(|(cell, _)| cell).collect(),
            )
        })
        .collect();
    let beside = if is_beside {
        " beside the accepted effects; twin alone: fitted without them"
    } else {
        ""
    };
    let caption = format!(
        "The twin's own parameters{beside}.{}",
        match diagnosis.parameters.iter().all(|p| p.identified) {
            true => "",
            false => " Not identified: the record adds nothing to the prior.",
        }
    );
    let mut body = parameter_table(&caption, &more, &lines);
    if !diagnosis.nuisance.is_empty() {
        let rows: Vec<Vec<String>> = (diagnosis.nuisance.iter())
            .map(|n| {
                // A start of a further record is named `h1 (record 2)`.
                let name = n.name.split(' ').next().unwrap_or(&n.name);
                vec![
                    n.name.clone(),
                    n.role.to_owned(),
                    Digits::supported(n.value, n.std_error).write(n.value),
                    error(n.std_error),
                    unit_suffix(units.variable(name)).trim_start().to_owned(),
                ]
            })
            .collect();
        let head = [
            ("name", Text),
            ("role", Text),
            ("value", Number),
            ("std. error", Number),
            ("unit", Text),
        ];
        body.push_str(&table("Other estimated quantities.", &head, &rows));
    }
    if diagnosis.parameters.is_empty() {
        body = paragraph("The twin has no parameters of its own.");
    }
    Section::new("parameters", "Parameters", body)
}
