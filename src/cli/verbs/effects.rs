//! `effects`: lists the effects that a twin may lack.

use crate::cli::prelude::*;
use crate::effect::{Effect, EffectKind, Magnitude};

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
    fn run(&self, context: &Context<'_>) -> Result<ExitCode, Failure> {
        let study = context.study(&self.subject)?;
        let possible = study.candidates();
        let places = |kind: &EffectKind| -> Vec<String> {
            let key = kind.other_state().map_or("with", |other| other.key());
            let effects = possible.iter().filter(|effect| effect.id() == kind.id());
            let place = |effect: &Effect| match effect.other() {
                Some(other) => format!("{} ({key} {other})", effect.target()),
                None => effect.target().to_owned(),
            };
            effects.map(place).collect()
        };
        let kinds: Vec<(&EffectKind, Vec<String>)> = (study.catalogue().kinds().iter())
            .map(|kind| (&**kind, places(kind)))
            .filter(|(_, places)| !places.is_empty())
            .collect();
        let finite = |value: f64| Some(value).filter(|v| v.is_finite());
        let magnitude = |m: &Magnitude| {
            json!({
                "name": m.name, "unit": m.unit, "shape": m.off.is_none(), "off": m.off.and_then(finite),
                "low": finite(m.limits.low()), "high": finite(m.limits.high()),
            })
        };
        let effect = |(kind, places): &(&EffectKind, Vec<String>)| {
            let magnitudes: Vec<Value> = kind.magnitudes().iter().map(magnitude).collect();
            json!({ "id": kind.id(), "targets": places, "law": kind.formula(), "magnitudes": magnitudes })
        };
        let json = json!({
            "schema": "truetwin.effects/1", "twin": study.name(),
            "effects": kinds.iter().map(effect).collect::<Vec<_>>(),
        });
        let lines = |(kind, places): &(&EffectKind, Vec<String>)| {
            let magnitudes = kind.magnitudes().iter().map(|m| match m.unit {
                "" => m.name.to_owned(),
                unit => format!("{} [{unit}]", m.name),
            });
            format!(
                "{:<22} {}\n{:<22} on {}; magnitudes {}",
                kind.id(),
                kind.formula(),
                "",
                places.join(", "),
                magnitudes.collect::<Vec<_>>().join(", ")
            )
        };
        context.print(&json, || {
            kinds.iter().map(lines).collect::<Vec<_>>().join("\n")
        })
    }
}
