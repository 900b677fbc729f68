//! Every part of a report tells the same verdict, place, effects and probabilities.

use super::statement::headline;
use super::{gap_document, gap_json, gap_pictures};
use crate::diagnose::answer::tests::{Dice, random_diagnosis};
use crate::diagnose::{Decision, Diagnosis, EffectFit, Verdict};
use crate::report::digits::{chance, error, percent, short};
use crate::report::document::escaped;
use crate::report::fixture::{diagnoses, made, oscillator, tanks, validator};
use crate::report::units::Units;
use crate::study::Study;
use serde_json::Value;
use std::collections::BTreeSet;

/// Elements that have no end tag.
const VOID: [&str; 1] = ["meta"];

fn page(study: &Study, diagnosis: &Diagnosis) -> String {
    gap_document(study, diagnosis).html()
}

/// Text as one line, so that breaks do not matter.
fn text(study: &Study, diagnosis: &Diagnosis) -> String {
    let text = gap_document(study, diagnosis).text();
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

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
    let others = others.map(|diagnosis| (oscillator(), diagnosis));
    tanks.into_iter().chain(others).collect()
}

fn names(list: &Value) -> BTreeSet<String> {
    let names = list.as_array().unwrap().iter();
    names
        .map(|name| name.as_str().unwrap().to_owned())
        .collect()
}

/// Names of filled bars.
fn filled(svg: &str) -> BTreeSet<String> {
    let names = svg
        .split("text-anchor=\"end\" font-weight=\"600\">")
        .skip(1);
    names
        .map(|rest| rest.split('<').next().unwrap().to_owned())
        .collect()
}

/// Statements of text, page and JSON that contradict each other.
fn contradictions(study: &Study, diagnosis: &Diagnosis) -> Vec<String> {
    let (json, text) = (gap_json(diagnosis), text(study, diagnosis));
    let page = page(study, diagnosis);
    let headline = headline(&Units::of(study), diagnosis);
    let which = &json["which"];
    let p = |kind: &str| which["probabilities"][kind].as_f64().unwrap();
    let [listed, partial, unknown, nothing] = ["listed", "partial", "unknown", "nothing"].map(p);
    let effects: Vec<(String, f64)> = (which["effects"].as_array().unwrap().iter())
        .map(|e| {
            let key = format!(
                "{}@{}",
                e["id"].as_str().unwrap(),
                e["target"].as_str().unwrap()
            );
            (key, e["probability"].as_f64().unwrap())
        })
        .collect();
    let of = |key: &str| {
        effects
            .iter()
            .find(|(own, _)| own == key)
            .map_or(0.0, |(_, p)| *p)
    };
    let accepted = names(&which["accepted"]);
    let decision = which["decision"].as_str().unwrap();
    let is_gap = json["verdict"] == "structural-gap";
    let interrupted = json["interrupted"] == true;
    let mut all = vec![];
    let mut check = |name: &str, holds: bool| {
        if !holds {
            all.push(format!("{name}: {headline} / {which}"));
        }
    };
    check("page has the headline", page.contains(&escaped(&headline)));
    check("text begins with it", text.starts_with(&headline));
    check("a headline is two lines", headline.chars().count() <= 140);
    let sum = listed + partial + unknown + nothing;
    check("kinds add up to one", (sum - 1.0).abs() < 1e-9);
    let all_p = effects
        .iter()
        .map(|e| e.1)
        .chain([listed, partial, unknown, nothing]);
    check(
        "probabilities are in 0 to 1",
        all_p.clone().all(|p| (0.0..=1.0).contains(&p)),
    );
    check(
        "a gap is called where it is probable",
        is_gap == (nothing < 0.5),
    );
    check(
        "a gap is told",
        is_gap == headline.starts_with("Structural gap"),
    );
    // An all-clear is whole, and sure.
    for clear in [
        "No gap",
        "explains the record",
        "use the twin",
        "No effect is needed",
    ] {
        let is_said = text.contains(clear) || page.contains(clear);
        check(clear, !is_said || (!is_gap && !interrupted));
    }
    let is_clear = headline.starts_with("No gap:");
    check("no doubtful all-clear", !is_clear || nothing >= 0.9);
    check(
        "the twin is used where nothing is missing",
        is_clear || !text.contains("use the twin"),
    );
    check(
        "an interruption is told",
        !interrupted || headline.contains("ot finished"),
    );
    let parts = ["named", "class", "partial"].contains(&decision);
    check("names are accepted", parts != accepted.is_empty());
    check(
        "names have half of all mass",
        !parts || listed + partial >= 0.5,
    );
    check(
        "what remains is probable",
        !parts || (decision == "partial") == (partial > listed),
    );
    let sure = accepted.iter().all(|key| of(key) >= 0.5);
    check(
        "a name is more probable than not",
        decision != "named" || sure,
    );
    if decision == "none-of-these" {
        check(
            "no probable name below none",
            effects.iter().all(|e| e.1 < 0.5),
        );
        let outside = headline.contains("outside the library");
        check(
            "outside is more probable",
            !outside || unknown >= listed + partial,
        );
        check("nothing is accepted", !text.contains(" accepted "));
    }
    if let Some((_, rest)) = text.split_once("Next: add ") {
        let added = rest.split(" to the study").next().unwrap();
        let added: Vec<&str> = added.split(" and ").collect();
        check(
            "what is added is sure",
            added.iter().all(|key| of(key) >= 0.5),
        );
        check(
            "what is added is in the table",
            page.contains("magnitudes = {"),
        );
    }
    check(
        "evidence is one number",
        text.contains(&format!("nothing is missing: {}", chance(nothing))),
    );
    let pictures = gap_pictures(study, diagnosis);
    if let Some((_, svg)) = pictures.iter().find(|(name, _)| *name == "which") {
        check("bold bars are accepted", filled(svg).is_subset(&accepted));
    }
    all
}

/// Any posterior: no statement on page, terminal or in JSON contradicts another.
#[test]
fn a_thousand_answers_do_not_contradict_themselves() {
    let study = tanks();
    let mut base = made::tanks_class();
    base.power.clear();
    base.residuals.clear();
    base.validation_runs = None;
    base.location.functions.clear();
    base.location.onset = None;
    (base.free_runs.times, base.free_runs.measured) = (vec![], ndarray::Array2::zeros((0, 1)));
    (base.free_runs.before, base.free_runs.after) = (None, None);
    let mut all = vec![];
    for case in 0..1000 {
        let diagnosis = random_diagnosis(base.clone(), &mut Dice::new(case));
        let found = contradictions(&study, &diagnosis);
        all.extend(found.into_iter().map(|c| format!("{case}: {c}")));
    }
    assert!(
        all.is_empty(),
        "{} of 1000\n{}",
        all.len(),
        all[..all.len().min(20)].join("\n")
    );
}

/// Tanks with these effects and probabilities, so many of them accepted.
fn told(decision: Decision, effects: &[(&str, f64)], count: usize) -> String {
    let mut diagnosis = made::tanks_class();
    let cause = &mut diagnosis.cause;
    let first = cause.effects[0].clone();
    cause.decision = decision;
    cause.effects = (effects.iter())
        .map(|(key, probability)| {
            let (id, target) = key.split_once('@').unwrap();
            let mut fit = first.clone();
            (fit.id, fit.target) = (id.into(), target.into());
            fit.probability = *probability;
            fit
        })
        .collect();
    cause.class = cause.effects.iter().map(EffectFit::key).collect();
    cause.accepted = cause.class[..count].to_vec();
    headline(&Units::of(&tanks()), &diagnosis)
}

#[test]
fn rivals_and_what_is_beside_them_are_told_apart() {
    let ceiling = ("state-ceiling@h1", 0.61);
    let power = ("power-law@h1", 0.25);
    let limit = ("actuator-rate-limit@actuator", 0.98);
    let lag = ("sensor-lag@sensor", 0.4);
    let bias = ("sensor-bias@sensor", 0.35);
    for (decision, effects, count, expected) in [
        (
            Decision::Named,
            &[limit][..],
            1,
            "the twin lacks a rate limit at the actuator of",
        ),
        (
            Decision::Class,
            &[ceiling, power],
            1,
            "the twin lacks a ceiling or a power law at the upper tank (h1); this record cannot tell which.",
        ),
        (
            Decision::Partial,
            &[ceiling, power],
            1,
            "most of it is explained by a ceiling or a power law at the upper tank (h1) (together 0.86); this record cannot tell",
        ),
        (
            Decision::Class,
            &[limit, lag, bias],
            2,
            "the twin lacks actuator-rate-limit@actuator and sensor-lag@sensor or sensor-bias@sensor; this record",
        ),
        (Decision::Named, &[limit, lag], 1, "and perhaps"),
        (
            Decision::Partial,
            &[limit],
            1,
            "; more remains at the lower tank (h2).",
        ),
    ] {
        let told = told(decision, effects, count);
        assert!(told.contains(expected), "{told}");
        assert!(told.chars().count() <= 140, "{told}");
    }
}

#[test]
fn real_answers_do_not_contradict_themselves() {
    for diagnosis in diagnoses() {
        let all = contradictions(&oscillator(), diagnosis);
        assert!(all.is_empty(), "{}", all.join("\n"));
    }
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
        let (told, page) = (headline(&units, &diagnosis), page(&study, &diagnosis));
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
fn every_verdict_keeps_to_the_contract() {
    for (_, diagnosis) in cases()
        .into_iter()
        .chain([(oscillator(), made::rig_pair())])
    {
        let read: Value = serde_json::from_str(&gap_json(&diagnosis).to_string()).unwrap();
        let complaints: Vec<String> = (validator("gap").iter_errors(&read))
            .map(|error| format!("{}: {error}", error.instance_path()))
            .collect();
        assert!(complaints.is_empty(), "{complaints:?}");
        for (list, key) in [("targets", "probability"), ("windows", "share")] {
            let shares = read["where"][list].as_array().unwrap().iter();
            let sum: f64 = shares.map(|s| s[key].as_f64().unwrap()).sum();
            assert!(sum <= 1.0 + 1e-9, "{list}: {sum}");
        }
    }
}

#[test]
fn what_is_infinite_is_null() {
    let mut diagnosis = diagnoses()[1].clone();
    diagnosis.cause.effects[0].magnitudes = vec![("level".into(), f64::INFINITY)];
    let value = gap_json(&diagnosis);
    assert!(value["which"]["effects"][0]["magnitudes"]["level"].is_null());
}

/// Fails at the first tag that is not closed in order; returns the names of all elements.
fn balanced(page: &str) -> Vec<String> {
    let (mut open, mut all) = (Vec::new(), Vec::new());
    let body = page.strip_prefix("<!doctype html>").unwrap();
    for tag in body.split('<').skip(1) {
        let (inside, _) = tag
            .split_once('>')
            .unwrap_or_else(|| panic!("no end of <{tag}"));
        if let Some(name) = inside.strip_prefix('/') {
            let last: Option<String> = open.pop();
            assert_eq!(last.as_deref(), Some(name), "</{name}> closes {last:?}");
            continue;
        }
        let name = inside.split([' ', '/', '\n']).next().unwrap();
        all.push(name.to_owned());
        if !inside.ends_with('/') && !VOID.contains(&name) {
            open.push(name.to_owned());
        }
    }
    assert!(open.is_empty(), "left open: {open:?}");
    all
}

#[test]
fn the_page_is_well_formed_and_stands_alone() {
    for (study, diagnosis) in cases() {
        let page = page(&study, &diagnosis);
        let elements = balanced(&page);
        for loads in ["script", "link", "img", "iframe", "object"] {
            assert!(!elements.iter().any(|e| e == loads), "<{loads}>");
        }
        // The one address is the name of SVG's vocabulary.
        let addresses = page.matches("http").count();
        assert_eq!(
            addresses,
            page.matches("xmlns=\"http://www.w3.org/2000/svg\"").count()
        );
        assert!(!page.contains("src=") && !page.contains("url("));
        // Links lead to places on the page.
        for (at, _) in page.match_indices("href=\"") {
            let place = page[at + 6..].strip_prefix('#').unwrap();
            let id = place.split('"').next().unwrap();
            assert!(page.contains(&format!(" id=\"{id}\"")), "{id}");
        }
        assert!(!page.contains("NaN") && !page.contains("inf"));
    }
}

/// The page has the numbers of the JSON.
#[test]
fn the_numbers_of_the_json_are_on_the_page() {
    for (study, diagnosis) in cases() {
        let (page, json) = (page(&study, &diagnosis), gap_json(&diagnosis));
        let number = |value: &Value| value.as_f64().unwrap();
        let mut expected = vec![
            short(number(&json["detection"]["log_evidence"])),
            chance(number(&json["which"]["probabilities"]["nothing"])),
        ];
        for p in json["parameters"].as_array().unwrap() {
            expected.extend([
                p["name"].as_str().unwrap().to_owned(),
                error(number(&p["std_error"])),
            ]);
        }
        for effect in json["which"]["effects"].as_array().unwrap() {
            let values = ["probability", "log_evidence"].map(|key| number(&effect[key]));
            expected.extend([chance(values[0]), short(values[1])]);
            let magnitudes = effect["magnitudes"].as_object().unwrap().values();
            expected.extend(magnitudes.filter_map(|m| Some(short(m.as_f64()?))));
        }
        let shrinkage = &json["shrinkage"];
        for key in ["before", "after", "floor"] {
            expected.extend(shrinkage[key].as_f64().map(short));
        }
        expected.extend(shrinkage["closed"].as_f64().map(percent));
        for text in expected {
            assert!(
                page.contains(&text) || page.contains(&escaped(&text)),
                "{text}"
            );
        }
    }
}

/// A terminal shows the whole answer at once.
#[test]
fn the_terminal_is_not_left() {
    for (study, diagnosis) in cases() {
        let text = gap_document(&study, &diagnosis).text();
        assert!(text.lines().count() <= 36, "{text}");
        assert!(
            text.lines().take(8).any(|line| line.starts_with("Next: ")),
            "{text}"
        );
    }
}

/// Each section shows what the diagnosis holds, in words and as a picture.
#[test]
fn every_part_of_the_answer_has_its_place() {
    let class = page(&tanks(), &made::tanks_class());
    for text in [
        "43.9 nats (called above 3); probability that nothing is missing: &lt; 0.01; p &lt; 0.0099 (100 simulations).",
        "A change of k1 at 612 s explains the record best. 8 of 16 windows stand out from white noise.",
        "<title>Windows of time</title>",
        ">change at 612 s<",
        ">0.93<",
        "<title>Missing functions</title>",
        ">rate of h1 in V/s<",
        ">y on the past of u<",
        ">0.00625 … 0.0125 Hz<",
        "One class: not separated by this record",
        ">unlisted only<",
        "something unknown at h2 adds 1.20 nats (3 % of all).",
        "next-input.csv, beside this page, holds steps over the whole range",
        "<title>The input to measure with next</title>",
        "<title>Correlation of residuals with inputs</title>",
        "Not tested (excluded by the call or the study, or without a filter model): outliers@sensor",
        "<td class=\"n\">5.20 V</td>",
        "1 of 4 listed effects are not detectable",
        "y: record − twin in V",
    ] {
        assert!(class.contains(text), "{text}");
    }
    let none = page(&oscillator(), &made::oscillator_none());
    for text in [
        "missing function of x1 at the rate of x2",
        "the exploration points to x1",
    ] {
        assert!(none.contains(text), "{text}");
    }
    let mut outliers = made::tanks_class();
    outliers.outliers = vec!["sensor".into()];
    assert!(text(&tanks(), &outliers).contains("The noise has outliers at sensor."));
    let mut proportional = made::tanks_class();
    proportional.proportional_noise = vec!["sensor".into()];
    let told = "The noise grows with the signal at sensor.";
    assert!(text(&tanks(), &proportional).contains(told));
    let no_gap = page(&oscillator(), &made::oscillator_no_gap());
    let at = |id: &str| no_gap.find(&format!("<section id=\"{id}"));
    assert!(
        at("parameters") < at("where"),
        "the parameters are the answer"
    );
}

#[test]
fn absurd_numbers_and_hostile_names_stay_short_and_harmless() {
    let mut diagnosis = diagnoses()[1].clone();
    assert_eq!(diagnosis.verdict, Verdict::StructuralGap);
    diagnosis.twin = "<script>alert(1)</script>".into();
    diagnosis.cause.effects.push(EffectFit {
        id: "a&b".into(),
        target: "\"x\"".into(),
        probability: 1e-300,
        magnitudes: vec![
            ("size".into(), -1.234_567e9),
            ("low".into(), f64::NEG_INFINITY),
        ],
        log_evidence: 1.234_567e9,
        also: vec!["<script>alert(2)</script>@x".into()],
    });
    let page = page(&oscillator(), &diagnosis);
    assert!(!balanced(&page).iter().any(|e| e == "script"));
    assert!(
        page.contains("1.23e9") && page.contains("size −1.23e9<") && page.contains("&lt; 0.01")
    );
    assert!(page.contains("a&amp;b@&quot;x&quot;"));
}

/// Names may come from a program or an FMU: on a page they are text, whatever they hold.
#[test]
fn hostile_names_are_text_on_the_page() {
    const HOSTILE: &str = "<script>alert(1)</script><img src=x onerror=\"alert(2)\">'&\u{1b}[2J";
    for mut diagnosis in [
        made::tanks_class(),
        made::rig_pair(),
        made::oscillator_none(),
    ] {
        let hostile = || HOSTILE.to_owned();
        diagnosis.twin = hostile();
        for parameter in &mut diagnosis.parameters {
            (parameter.name, parameter.unit) = (hostile(), hostile());
        }
        diagnosis.location.target = diagnosis.location.target.as_ref().map(|_| hostile());
        for window in &mut diagnosis.location.maps.windows {
            window.channel = hostile();
        }
        for region in &mut diagnosis.location.maps.regions {
            region.variable = hostile();
        }
        for function in &mut diagnosis.location.functions {
            (function.place, function.variable) = (hostile(), hostile());
        }
        if let Some(onset) = &mut diagnosis.location.onset {
            onset.parameter = hostile();
        }
        if let Some(remains) = &mut diagnosis.cause.remains {
            remains.place = hostile();
        }
        for effect in &mut diagnosis.cause.effects {
            effect.target = hostile();
        }
        for key in (diagnosis.cause.accepted.iter_mut()).chain(&mut diagnosis.cause.class) {
            *key = hostile();
        }
        diagnosis.not_tested = vec![hostile()];
        let page = page(&oscillator(), &diagnosis);
        let elements = balanced(&page);
        assert!(!elements.iter().any(|e| e == "script" || e == "img"));
        assert!(!page.contains('\u{1b}'));
        assert!(page.contains("&lt;script&gt;"));
    }
}
