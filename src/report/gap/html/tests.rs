use super::*;
use crate::diagnose::{Decision, EffectFit, Verdict};
use crate::report::fixture::{diagnoses, made, oscillator, tanks};
use crate::report::gap::gap_json;
use crate::report::gap::headline::headline;

/// Elements that have no end tag.
const VOID: [&str; 1] = ["meta"];

/// No gap, a named effect, and what is made of them: a parameter gap, a class, a gap without a listed cause, nothing held back;
/// then the rest of the fixture, and what is written down by hand.
fn cases() -> Vec<Diagnosis> {
    let [no_gap, named, rest @ ..] = diagnoses() else {
        panic!("the fixture has at least two diagnoses");
    };
    let mut parameter = no_gap.clone();
    parameter.verdict = Verdict::ParameterGap;
    let mut class = named.clone();
    class.cause.decision = Decision::Class;
    class.cause.class = vec!["cubic-stiffness@x2".into(), "power-law@x2".into()];
    let mut none = named.clone();
    none.cause.decision = Decision::NoneOfThese;
    none.cause.accepted.clear();
    none.cause.class.clear();
    let mut short = named.clone();
    short.shrinkage = None;
    short.validation_runs = None;
    short.free_runs.times.truncate(100);
    let made = [no_gap.clone(), named.clone(), parameter, class, none, short];
    let by_hand = [
        made::tanks_class(),
        made::oscillator_none(),
        made::oscillator_no_gap(),
        made::rig_pair(),
    ];
    [&made, rest, &by_hand].concat()
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
    for diagnosis in cases() {
        let page = gap_html(&oscillator(), &diagnosis);
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

#[test]
fn every_section_is_there_under_every_verdict() {
    let units = Units::of(&oscillator());
    for diagnosis in cases() {
        let page = gap_html(&oscillator(), &diagnosis);
        assert_eq!(page.matches("class=\"first\"").count(), 1);
        let sections = [
            "where",
            "which",
            "extent",
            "parameters",
            "limits",
            "next",
            "residuals",
        ];
        for section in sections {
            assert_eq!(
                page.matches(&format!("<section id=\"{section}\"")).count(),
                1,
                "{section}"
            );
        }
        let more = [
            diagnosis.discovery.is_some(),
            diagnosis.validation_runs.is_some(),
        ];
        let more: usize = more.into_iter().map(usize::from).sum();
        assert_eq!(page.matches("<h2").count(), sections.len() + more);
        assert_eq!(page.matches("<h1>").count(), 1);
        assert!(page.contains(&escaped(&headline(&units, &diagnosis))));
        let pictures = page.matches("<svg").count();
        assert!(pictures > 0);
        assert_eq!(page.matches("role=\"img\"").count(), pictures);
        assert_eq!(page.matches("<desc>").count(), pictures);
        assert_eq!(page.matches("<figcaption>").count(), pictures);
    }
}

/// The page has the numbers of the JSON.
#[test]
fn the_numbers_of_the_json_are_on_the_page() {
    use crate::report::digits::{chance, error, percent, short};
    for diagnosis in cases() {
        let (page, json) = (gap_html(&oscillator(), &diagnosis), gap_json(&diagnosis));
        let number = |value: &serde_json::Value| value.as_f64().unwrap();
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
        for place in json["where"]["targets"].as_array().unwrap() {
            let name = place["target"].as_str().unwrap();
            expected.push(format!(
                "<th scope=\"row\">{name}</th><td class=\"n\">{}</td>",
                escaped(&chance(number(&place["probability"])))
            ));
        }
        for region in json["where"]["regions"].as_array().unwrap() {
            expected.push(format!(
                "{} … {}",
                short(number(&region["low"])),
                short(number(&region["high"]))
            ));
        }
        for effect in json["which"]["effects"].as_array().unwrap() {
            let (p, nats) = (
                number(&effect["probability"]),
                number(&effect["log_evidence"]),
            );
            expected.extend([chance(p), short(nats)]);
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
            assert!(
                page.contains(&text) || page.contains(&escaped(&text)),
                "{text}"
            );
        }
    }
}

#[test]
fn each_answer_says_what_to_do_with_it() {
    for (diagnosis, expected) in cases().iter().zip([
        "Use the twin with the refitted parameters",
        "Add cubic-stiffness@x2 to the twin",
        "Check the refitted parameters",
        "Separate the rivals (cubic-stiffness@x2, power-law@x2)",
        "examples/own_effect.rs",
        "No share of the gap closed: the record is too short",
    ]) {
        let page = gap_html(&oscillator(), diagnosis);
        assert!(page.contains(expected), "{expected}");
    }
    let named = gap_html(&oscillator(), &cases()[1]);
    let table = "[[effect]]\nid = &quot;cubic-stiffness&quot;\ntarget = &quot;x2&quot;\nfrom = &quot;x1&quot;\n";
    assert!(named.contains(table), "{named}");
}

/// Each section shows what the diagnosis holds, in words and as a picture.
#[test]
fn every_part_of_the_answer_has_its_place() {
    let class = gap_html(&tanks(), &made::tanks_class());
    for text in [
        "43.9 nats; probability that nothing is missing: &lt; 0.01; p &lt; 0.0099 (100 simulations).",
        "A change of k1 at 612 s explains the record best. 8 of 16 windows stand out from white noise.",
        "With state-ceiling@h1 added: no window stands out from white noise.",
        "<title>Windows of time</title>",
        ">change at 612 s<",
        ">0.93<",
        "<title>Missing functions</title>",
        ">rate of h1 in V/s<",
        ">output y in V<",
        ">beside the twin alone, 41.2 nats<",
        ">on top of the accepted effects, 1.20 nats<",
        ">h2 in V<",
        ">± 1 standard error<",
        ">y on the past of u<",
        ">40.0 … 77.5 s<",
        ">0.00625 … 0.0125 Hz<",
        "One class: not separated by this record",
        "rival, same class",
        "cannot separate it from power-law@h1, quadratic-drag@h1 within 3 nats.",
        ">unlisted only<",
        "something unknown at h2 adds 1.20 nats (3 % of all).",
        "next-input.csv, beside this page, holds steps over the whole range",
        "in 18 of 20 cases",
        "again do so in 6 of 20",
        "<title>The input to measure with next</title>",
        "measure the record below",
        "simulated by the fitted twin with as much evidence is p &lt; 0.0099 (100 simulations).",
        "<title>Residuals against inputs</title>",
        "of the twin with the accepted effects, over their standard deviation, of all 2 records.",
        "Not tested (excluded by the call or the study, or without a filter model): outliers@sensor",
        "<td class=\"n\">5.20 V</td>",
        "<td class=\"n\">not detectable</td>",
        "1 of 4 listed effects are not detectable",
    ] {
        assert!(class.contains(text), "{text}");
    }
    assert!(!class.contains("Exploratory"));
    let none = gap_html(&oscillator(), &made::oscillator_none());
    for text in [
        "Exploratory, not a test",
        "missing function of x1 at the rate of x2",
        "explain 83 % of its variance",
        ">98 %, −0.620 (−0.744 to −0.496)<",
        "share of draws that include it",
        "the exploration points to x1",
    ] {
        assert!(none.contains(text), "{text}");
    }
    let partial = gap_html(&oscillator(), &made::rig_pair());
    for text in [
        "more remains at enthalpy.",
        "explains most of the gap; something unknown remains.",
        "Look at enthalpy",
    ] {
        assert!(partial.contains(text), "{text}");
    }
    let no_gap = gap_html(&oscillator(), &made::oscillator_no_gap());
    assert!(no_gap.contains("Detectable magnitudes"));
    let (parameters, place) = (
        no_gap.find("<section id=\"parameters"),
        no_gap.find("<section id=\"where"),
    );
    assert!(parameters < place, "the parameters are the answer");
    for page in [class, none, partial, no_gap] {
        balanced(&page);
    }
}

#[test]
fn a_twin_without_inputs_is_told_to_measure_instants() {
    let mut diagnosis = made::oscillator_none();
    diagnosis.cause.next_input = made::tanks_class().cause.next_input;
    let page = gap_html(&oscillator(), &diagnosis);
    assert!(page.contains("the file holds only the time column"));
    assert!(!page.contains("The input to measure with next"));
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
    let page = gap_html(&oscillator(), &diagnosis);
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
        let page = gap_html(&oscillator(), &diagnosis);
        let elements = balanced(&page);
        assert!(!elements.iter().any(|e| e == "script" || e == "img"));
        assert!(!page.contains('\u{1b}'));
        assert!(page.contains("&lt;script&gt;"));
    }
}
