//! `effects`: lists the effects that a twin may lack.

use crate::cli::prelude::*;

/// List the effects that a twin may lack, with targets and magnitudes.
#[derive(Debug, Args)]
#[command(after_help = "Example:\n  \
        truetwin effects --twin tanks\n\
        Next: simulate with --effect E.toml (docs/choosing-effects.md), or find effects with truetwin diagnose")]
pub(in crate::cli) struct Effects {
    #[command(flatten)]
    subject: Subject,
}

impl Verb for Effects {
    fn subject(&self) -> Option<&Subject> {
        Some(&self.subject)
    }

    fn run(&self, context: &Context<'_>) -> Result<ExitCode, Failure> {
        let study = context.study(&self.subject)?;
        let possible = study.candidates();
        let described: Vec<_> = (study.catalogue().kinds().iter())
            .filter_map(|kind| {
                let places: Vec<String> = (possible.iter())
                    .filter(|e| e.id() == kind.id())
                    .map(|e| match e.other() {
                        Some(other) => format!(
                            "{} ({} {other})",
                            e.target(),
                            kind.other_state().map_or("with", |other| other.key())
                        ),
                        None => e.target().to_owned(),
                    })
                    .collect();
                (!places.is_empty()).then_some((kind, places))
            })
            .collect();
        let effects: Vec<Value> = (described.iter())
                .map(|(d, places)| {
                    let magnitudes: Vec<Value> = (d.magnitudes().iter())
                        .map(|m| {
                            json!({
                                "name": m.name, "unit": m.unit, "shape": m.off.is_none(),
                                "off": m.off.filter(|v| v.is_finite()),
                                "low": Some(m.limits.low()).filter(|v| v.is_finite()),
                                "high": Some(m.limits.high()).filter(|v| v.is_finite()),
                            })
                        })
                        .collect();
                    json!({ "id": d.id(), "targets": places, "law": d.formula(), "magnitudes": magnitudes })
                })
                .collect();
        let json = json!({
            "schema": "truetwin.effects/1", "twin": study.name(), "effects": effects,
        });
        context.print(&json, || {
            let lines: Vec<String> = (described.iter())
                .map(|(d, places)| {
                    let magnitudes: Vec<String> = (d.magnitudes().iter())
                        .map(|m| match m.unit {
                            "" => m.name.to_owned(),
                            unit => format!("{} [{unit}]", m.name),
                        })
                        .collect();
                    format!(
                        "{:<22} {}\n{:<22} on {}; magnitudes {}",
                        d.id(),
                        d.formula(),
                        "",
                        places.join(", "),
                        magnitudes.join(", ")
                    )
                })
                .collect();
            lines.join("\n")
        })
    }
}
