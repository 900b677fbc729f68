//! Every part of a report tells the same place, the same effects and the same probabilities.

use super::headline::headline;
use super::{gap_html, gap_json, gap_pictures};
use crate::diagnose::{Decision, Diagnosis};
use crate::report::fixture::{diagnoses, made, oscillator, tanks};
use crate::report::units::Units;
use crate::study::Study;
use serde_json::Value;
use std::collections::BTreeSet;

/// Diagnoses of the tanks and the oscillator: a class, a pair, places that cannot be told apart, an unlisted law, and real ones.
fn cases() -> Vec<(Study, Diagnosis)> {
    let mut pair = made::tanks_class();
    pair.cause.decision = Decision::Partial;
    pair.cause.effects[3].probability = 0.9;
    pair.cause.accepted = vec!["state-ceiling@h1".into(), "cross-coupling@h2".into()];
    pair.cause.class.clone_from(&pair.cause.accepted);
    let mut several = made::oscillator_none();
    several.location.targets[0].probability = 0.6;
    let mut other = several.location.targets[0].clone();
    (other.target, other.probability) = ("x1".into(), 0.4);
    several.location.targets.push(other);
    several.location.class = vec!["x2".into(), "x1".into()];
    let tanks = [made::tanks_class(), pair].map(|diagnosis| (tanks(), diagnosis));
    let others = [made::oscillator_none(), several, made::oscillator_no_gap()];
    let others = others.into_iter().chain(diagnoses().iter().cloned());
    tanks
        .into_iter()
        .chain(others.map(|diagnosis| (oscillator(), diagnosis)))
        .collect()
}

fn names(list: &Value) -> BTreeSet<String> {
    let names = list.as_array().unwrap().iter();
    names
        .map(|name| name.as_str().unwrap().to_owned())
        .collect()
}

/// Names of filled bars.
fn filled(svg: &str) -> BTreeSet<String> {
    let bold = "text-anchor=\"end\" font-weight=\"600\">";
    let names = svg.split(bold).skip(1);
    names
        .map(|rest| rest.split('<').next().unwrap().to_owned())
        .collect()
}

#[test]
fn place_bars_equation_and_json_agree() {
    for (study, diagnosis) in cases() {
        let json = gap_json(&diagnosis);
        let accepted = names(&json["which"]["accepted"]);
        let mut places = names(&json["where"]["class"]);
        places.extend(json["where"]["target"].as_str().map(str::to_owned));
        places.extend(
            accepted
                .iter()
                .map(|key| key.split_once('@').unwrap().1.to_owned()),
        );
        let pictures = gap_pictures(&study, &diagnosis);
        let picture = |name| {
            let found = pictures.iter().find(|(known, _)| *known == name);
            found.map(|(_, svg)| filled(svg)).unwrap_or_default()
        };
        assert_eq!(picture("targets"), places);
        assert_eq!(picture("which"), accepted);
        let units = Units::of(&study);
        let (told, page) = (headline(&units, &diagnosis), gap_html(&study, &diagnosis));
        let stated = match json["which"]["decision"].as_str().unwrap() {
            "partial" => json["which"]["remains"]["place"].as_str(),
            _ => json["where"]["target"].as_str(),
        };
        if let Some(place) = stated {
            assert!(told.contains(&units.in_words(place)), "{place}: {told}");
        }
        if let Some(equation) = json["discovery"]["equation"].as_str() {
            assert_eq!(Some(equation), stated);
            assert!(page.contains(&format!("at the {}", units.place_name(equation))));
        }
    }
}

#[test]
fn probabilities_add_up_to_one() {
    for (study, diagnosis) in cases() {
        let json = gap_json(&diagnosis);
        let kinds = json["which"]["probabilities"].as_object().unwrap();
        let keys: Vec<&str> = kinds.keys().map(String::as_str).collect();
        assert_eq!(keys, ["listed", "partial", "unknown", "nothing"]);
        let sum: f64 = kinds.values().map(|p| p.as_f64().unwrap()).sum();
        assert!((sum - 1.0).abs() < 1e-9, "{sum}");
        // The bars of the picture are the same four.
        let pictures = gap_pictures(&study, &diagnosis);
        if let Some((_, svg)) = pictures.iter().find(|(name, _)| *name == "which") {
            for label in [
                "listed effects only",
                "listed and unlisted",
                "unlisted only",
                "nothing",
            ] {
                assert!(svg.contains(&format!(">{label}<")), "{label}");
            }
        }
    }
}
