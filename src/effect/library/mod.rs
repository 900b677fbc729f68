//! The library: tables of effects by what they bend, one row an effect.

mod actuator;
mod parameter;
mod sensor;
mod shared;
mod state;

pub(crate) use shared::{clamp, lag};

use super::kind::EffectKind;

/// Every effect of the library, in the order of the table of `docs/choosing-effects.md`.
pub(super) fn rows() -> Vec<EffectKind> {
    [
        sensor::rows(),
        actuator::rows(),
        state::rows(),
        parameter::rows(),
    ]
    .concat()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The table that people read says what the code does.
    #[test]
    fn the_table_of_the_docs_is_the_library() {
        let page = include_str!("../../../docs/choosing-effects.md");
        let list = page.split("## The list").nth(1).unwrap();
        let list = list.split("\n## ").next().unwrap();
        let table: Vec<_> = (list.lines()).filter(|l| l.starts_with("| `")).collect();
        let written: Vec<String> = (rows().iter())
            .map(|kind| {
                let magnitudes: Vec<_> = (kind.magnitudes().iter())
                    .map(|m| {
                        let shape = if m.off.is_none() { "shape " } else { "" };
                        let off = match m.off {
                            Some(f64::INFINITY) => ", off ∞",
                            Some(f64::NEG_INFINITY) => ", off −∞",
                            _ => "",
                        };
                        format!("{shape}`{}` ({}{off})", m.name, m.unit)
                    })
                    .collect();
                let other =
                    (kind.other_state()).map_or(String::new(), |o| format!(", `{}`", o.key()));
                format!(
                    "| `{}` | {}{other} | {} | {} |",
                    kind.id(),
                    kind.law().target().name(),
                    magnitudes.join(", "),
                    kind.formula()
                )
            })
            .collect();
        assert_eq!(table, written);
    }

    /// Every effect has a sentence, and every word in braces is a magnitude of it or a place.
    #[test]
    fn every_effect_has_its_sentence() {
        for kind in rows() {
            let sentence = kind.sentence().unwrap_or_else(|| panic!("{}", kind.id()));
            for part in sentence.split('{').skip(1) {
                let name = part.split('}').next().unwrap().trim_start_matches('%');
                let known = kind.magnitudes().iter().any(|m| m.name == name);
                let is_other = name == "other" && kind.other_state().is_some();
                assert!(
                    known || is_other || name == "place",
                    "{}: {name}",
                    kind.id()
                );
            }
        }
    }
}
