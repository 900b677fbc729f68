//! Section on parameters, starts and noise levels.

use crate::diagnose::Diagnosis;
use crate::report::digits::{Digits, error, short, unit_suffix};
use crate::report::page::Column::{Number, Text};
use crate::report::page::{Section, paragraph, table};
use crate::report::units::Units;

pub(super) fn section_of(units: &Units, diagnosis: &Diagnosis) -> Section {
    let beside = if diagnosis.cause.accepted.is_empty() {
        "refitted"
    } else {
        "refitted together with the accepted effects"
    };
    let rows: Vec<Vec<String>> = (diagnosis.parameters.iter())
        .map(|p| {
            let unit = unit_suffix(&p.unit);
            let known = match (p.identified, p.prior.contains(p.refitted)) {
                (false, _) => "not identified",
                (true, false) => "outside the prior",
                (true, true) => "",
            };
            vec![
                p.name.clone(),
                p.initial.map_or("–".into(), short),
                Digits::supported(p.refitted, p.std_error).write(p.refitted),
                error(p.std_error),
                unit.trim_start().to_owned(),
                format!("{} … {}", short(p.prior.low()), short(p.prior.high())),
                known.into(),
            ]
        })
        .collect();
    let head = [
        ("parameter", Text),
        ("first estimate", Number),
        ("refitted", Number),
        ("std. error", Number),
        ("unit", Text),
        ("prior", Number),
        ("", Text),
    ];
    let caption = format!(
        "The twin's own parameters, {beside}. Not identified: the record adds nothing to the prior."
    );
    let mut body = table(&caption, &head, &rows);
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
