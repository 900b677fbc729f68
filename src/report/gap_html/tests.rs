use super::*;
use crate::diagnose::{Decision, EffectFit, Verdict};
use crate::report::fixture::{diagnoses, oscillator};
use crate::report::gap_json;

/// Elements that have no end tag.
const VOID: [&str; 1] = ["meta"];

/// No gap, a named effect, and what is made of them: a parameter gap, a class, a gap without a listed cause, nothing held back;
/// then the rest of the fixture.
fn cases() -> Vec<Diagnosis> {
    let [no_gap, named, rest @ ..] = diagnoses() else {
        panic!("the fixture has at least two diagnoses");
    };
    let mut parameter = no_gap.clone();
    parameter.verdict = Verdict::ParameterGap;
    let mut class = named.clone();
    class.which.decision = Decision::Class;
    class.which.class = vec!["cubic-stiffness@x2".into(), "power-law@x2".into()];
    let mut none = named.clone();
    none.which.decision = Decision::NoneOfThese;
    none.which.accepted.clear();
    none.which.class.clear();
    none.which.catch_all = Some("x2".into());
    let mut short = named.clone();
    short.shrinkage = None;
    short.validation_runs = None;
    short.free_runs.times.truncate(100);
    let made = [no_gap.clone(), named.clone(), parameter, class, none, short];
    [&made, rest].concat()
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
    for found in cases() {
        let page = gap_html(&oscillator(), &found);
        let elements = balanced(&page);
        for loads in ["script", "link", "img", "iframe", "object", "a"] {
            assert!(!elements.iter().any(|e| e == loads), "<{loads}>");
        }
        // The one address is the name of SVG's vocabulary.
        let addresses = page.matches("http").count();
        assert_eq!(
            addresses,
            page.matches("xmlns=\"http://www.w3.org/2000/svg\"").count()
        );
        assert!(!page.contains("src=") && !page.contains("href=") && !page.contains("url("));
        assert!(!page.contains("NaN") && !page.contains("inf"));
    }
}

#[test]
fn every_section_is_there_under_every_verdict() {
    for found in cases() {
        let page = gap_html(&oscillator(), &found);
        let sections = [
            "runs",
            "where",
            "which",
            "extent",
            "parameters",
            "limits",
            "next",
        ];
        for section in sections {
            assert_eq!(
                page.matches(&format!("<section id=\"{section}\"")).count(),
                1,
                "{section}"
            );
        }
        assert_eq!(page.matches("<h2").count(), sections.len());
        assert_eq!(page.matches("<h1>").count(), 1);
        assert!(page.contains(&escaped(&verdict_sentence(&found))));
        let pictures = page.matches("<svg").count();
        assert!(pictures > 0);
        assert_eq!(page.matches("role=\"img\"").count(), pictures);
        assert_eq!(page.matches("<desc>").count(), pictures);
        assert_eq!(page.matches("<figcaption>").count(), pictures);
    }
}

/// What the JSON says in numbers, the page says too.
#[test]
fn the_numbers_of_the_json_are_on_the_page() {
    use crate::report::digits::{chance, error, percent, probability, short};
    for found in cases() {
        let (page, json) = (gap_html(&oscillator(), &found), gap_json(&found));
        let number = |value: &serde_json::Value| value.as_f64().unwrap();
        let mut expected = vec![probability(number(&json["detection"]["p_value"]))];
        for p in json["parameters"].as_array().unwrap() {
            expected.extend([
                p["name"].as_str().unwrap().to_owned(),
                error(number(&p["std_error"])),
            ]);
        }
        for place in json["where"]["targets"].as_array().unwrap() {
            let (share, p) = (number(&place["share"]), number(&place["p_value"]));
            expected.push(format!("{}, {}", percent(share), probability(p)));
        }
        for region in json["where"]["regions"].as_array().unwrap() {
            expected.push(format!(
                "{} … {}",
                short(number(&region["low"])),
                short(number(&region["high"]))
            ));
        }
        for effect in json["which"]["effects"].as_array().unwrap() {
            let (p, gain) = (
                number(&effect["probability"]),
                number(&effect["log_score_gain"]),
            );
            expected.extend([chance(p), short(gain)]);
            expected.extend(
                effect["magnitudes"]
                    .as_object()
                    .unwrap()
                    .values()
                    .filter_map(|m| Some(short(m.as_f64()?))),
            );
        }
        let shrinkage = &json["shrinkage"];
        for key in ["before", "after", "floor"] {
            expected.extend(shrinkage[key].as_f64().map(short));
        }
        expected.extend(shrinkage["controls"]["placebo"].as_f64().map(short));
        expected.extend(shrinkage["closed"].as_f64().map(percent));
        for text in expected {
            assert!(page.contains(&escaped(&text)), "{text}");
        }
    }
}

#[test]
fn each_answer_says_what_to_do_with_it() {
    for (found, expected) in cases().iter().zip([
        "Use the twin with the refitted parameters",
        "Add cubic-stiffness@x2 to the twin",
        "Take the refitted parameters",
        "Tell the rivals apart (cubic-stiffness@x2, power-law@x2)",
        "examples/own_effect.rs",
        "Too short to hold anything back: no share",
    ]) {
        let page = gap_html(&oscillator(), found);
        assert!(page.contains(expected), "{expected}");
    }
    let named = gap_html(&oscillator(), &cases()[1]);
    let table = "[[effect]]\nid = &quot;cubic-stiffness&quot;\ntarget = &quot;x2&quot;\nfrom = &quot;x1&quot;\n";
    assert!(named.contains(table), "{named}");
}

#[test]
fn absurd_numbers_and_hostile_names_stay_short_and_harmless() {
    let mut found = diagnoses()[1].clone();
    assert_eq!(found.verdict, Verdict::StructuralGap);
    found.twin = "<script>alert(1)</script>".into();
    found.which.effects.push(EffectFit {
        id: "a&b".into(),
        target: "\"x\"".into(),
        probability: 1e-300,
        magnitudes: vec![
            ("size".into(), -1.234_567e9),
            ("low".into(), f64::NEG_INFINITY),
        ],
        log_score_gain: 1.234_567e9,
        p_value: Some(0.0),
    });
    let page = gap_html(&oscillator(), &found);
    assert!(!balanced(&page).iter().any(|e| e == "script"));
    assert!(
        page.contains("1.23e9") && page.contains("size −1.23e9<") && page.contains("&lt; 0.01")
    );
    assert!(page.contains("a&amp;b@&quot;x&quot;"));
}
