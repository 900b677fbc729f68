//! The pages that are written, in a real browser: nothing is cut off, nothing lies over anything, no script fails, the keyboard
//! reaches everything, everything has a name, and it prints.
//!
//! Needs Chromium on the path (or `TRUETWIN_CHROMIUM`); without one the tests are ignored, unless
//! `TRUETWIN_BROWSER=required`. `TRUETWIN_PAGES=DIR` keeps the pages there with pictures of them at each width and as PDF.
mod devtools;
#[path = "../../src/report/fixture/made.rs"]
mod made;
mod pictures;

use devtools::{Browser, chromium};
use serde_json::json;
use std::fs;
use std::path::{Path, PathBuf};
use truetwin::diagnose::{
    Band, Cause, Channel, Decision, Detection, Diagnosis, Discovery, EffectFit, FittedParameter,
    FreeRuns, Horizon, Lag, Location, Maps, MissingFunction, NextInput, Onset, Probabilities,
    Region, Remains, Shrinkage, TargetShare, Term, Verdict, Visible, Window,
};
use truetwin::estimator::{PretrainOptions, pretrain};
use truetwin::evaluate::paper::reference_studies;
use truetwin::evaluate::trials::{Scorecard, TrialSettings, Withheld};
use truetwin::fit::{FitSettings, Nuisance};
use truetwin::progress::Progress;
use truetwin::record::{Drive, Quantity, Record, Signal};
use truetwin::study::{RecordPlan, Study};
use truetwin::twin::{
    DigitalTwin, Interval, Noise, Now, Outline, Parameter, ParameterSpace, Role, StateSpace,
};
use truetwin::twins::VanDerPol;

/// Phone, tablet, desktop.
const WIDTHS: [u32; 3] = [360, 800, 1280];
/// Checks of all pages.
const HEIGHT: u64 = 800;
/// A sheet of A4 between its margins, in CSS pixels.
const SHEET: u32 = 718;
/// Words of the method that a first-time reader does not know.
const JARGON: [&str; 8] = [
    "nat",
    "innovation",
    "onset",
    "placebo",
    "floor",
    "class",
    "omnibus",
    "absorbed",
];
/// Words in the first 800 px: headings, sentences and captions, without those inside pictures and the list of links.
const FIRST_SCREEN: &str = include_str!("first_screen.js");
const MEASURE: &str = include_str!("measure.js");

/// Returns whether there is a browser; one that is required and missing is a failure.
pub fn is_at_hand() -> bool {
    let found = chromium().is_some();
    let required = std::env::var("TRUETWIN_BROWSER").is_ok_and(|v| v == "required");
    assert!(
        found || !required,
        "TRUETWIN_BROWSER=required, and no chromium is on the path; install it, or name it in TRUETWIN_CHROMIUM"
    );
    found
}

fn browser() -> Browser {
    Browser::start(&chromium().expect("the test is ignored without a browser"))
}

/// A plant of three states, two inputs and two outputs, with long names.
struct Rig;
impl StateSpace for Rig {
    fn outline(&self) -> Outline {
        let quantities = |names: &[(&str, &str)]| -> Vec<Quantity> {
            names
                .iter()
                .map(|(n, unit)| Quantity::new(n, unit))
                .collect()
        };
        Outline {
            parameters: ParameterSpace::new([Parameter::new("k", "1/s", 0.1, 1.0)]),
            states: quantities(&[
                ("enthalpy", "kJ/kg"),
                ("a_state_with_a_name_that_is_long", "V"),
                ("x3", "-"),
            ]),
            inputs: quantities(&[("feed", "kg/s"), ("bypass", "-")]),
            outputs: quantities(&[("temperature_of_the_condenser", "K"), ("y2", "-")]),
            ..Outline::new()
        }
    }
    fn drift(&self, _: &Now<'_>, _: &[f64], rates: &mut [f64]) {
        rates.fill(0.0);
    }
    fn observe(&self, _: &Now<'_>, x: &[f64], y: &mut [f64]) {
        y.copy_from_slice(&x[..2]);
    }
}

/// Scores of a few trials.
fn scorecard() -> Scorecard {
    let study = &Study::new("oscillator", VanDerPol, RecordPlan::autonomous(0.1, 80)).unwrap();
    let settings = TrialSettings {
        trials: 4,
        ..TrialSettings::default()
    };
    let place = tempfile::tempdir().unwrap();
    let (trials, silent) = (place.path().join("trials"), Progress::silent());
    let sealed = Withheld::new(study, settings).and_then(|t| t.seal(&trials, &silent));
    sealed.and_then(|sealed| sealed.score(&silent)).unwrap()
}

/// Pages of diagnoses.
fn diagnoses() -> Vec<(&'static str, String)> {
    let studies = reference_studies().unwrap();
    let [oscillator, tanks] = studies.as_slice() else {
        panic!("two reference twins");
    };
    let rig = Study::new("rig", Rig, RecordPlan::autonomous(0.1, 4)).unwrap();
    vec![
        ("class", made::tanks_class().html(tanks)),
        ("none", made::oscillator_none().html(oscillator)),
        ("no-gap", made::oscillator_no_gap().html(oscillator)),
        ("partial", made::rig_pair().html(&rig)),
    ]
}

/// Every kind of page.
fn pages() -> Vec<(&'static str, String)> {
    let mut all = diagnoses();
    all.extend([
        ("scorecard", scorecard().html()),
        ("fit", fit()),
        ("estimate", estimate()),
    ]);
    all
}

/// A record of the oscillator, so many samples of it.
fn oscillation(sample: u64, samples: usize) -> Record {
    let drive = Drive::autonomous(0.05, samples).unwrap();
    let noise = Noise::new(7, "browser", sample);
    let outputs = VanDerPol.simulate(&[1.5], &drive, noise).unwrap();
    Record::new(drive, outputs).unwrap()
}

/// The page of a fit to two records, with draws.
fn fit() -> String {
    let study = Study::new("oscillator", VanDerPol, RecordPlan::autonomous(0.05, 200)).unwrap();
    let records = [0, 1].map(|sample| oscillation(sample, 200));
    let settings = FitSettings {
        draws: 50,
        ..FitSettings::default()
    };
    let fit = study
        .fit_with(&records, &settings, &Progress::silent())
        .unwrap();
    fit.html(&study, &records)
}

/// The page of an estimate of a small estimator.
fn estimate() -> String {
    let study = Study::new("oscillator", VanDerPol, RecordPlan::autonomous(0.05, 200)).unwrap();
    let options = PretrainOptions {
        bank_size: Some(100),
        epochs: Some(2),
        ..PretrainOptions::default()
    };
    let silent = Progress::silent();
    let (estimator, _) = pretrain(&study, &options, &silent).unwrap();
    let record = oscillation(2, 200);
    let estimate = estimator.estimate(&record);
    estimate.unwrap().html(&study, &record)
}

/// A page in a file.
fn written(folder: &Path, name: &str, page: &str) -> PathBuf {
    let path = folder.join(format!("{name}.html"));
    fs::write(&path, page).unwrap();
    path
}

/// Everything that is wrong with a page.
fn complaints(browser: &mut Browser, path: &Path) -> Vec<String> {
    let mut all = vec![];
    browser.media("screen");
    browser.resize(WIDTHS[0], HEIGHT);
    browser.open(path);
    for unfolded in [false, true] {
        browser.evaluate(&format!(
            "document.querySelectorAll('details').forEach((d) => d.open = {unfolded})"
        ));
        for width in WIDTHS {
            browser.resize(width, HEIGHT);
            all.extend(measured(browser, width).map(|c| format!("{width} px: {c}")));
        }
    }
    all.extend(unreached(browser));
    all.extend(unnamed(browser));
    // Folded on the screen, whole on paper.
    browser.evaluate("document.querySelectorAll('details').forEach((d) => d.open = false)");
    browser.media("print");
    browser.resize(SHEET, HEIGHT);
    all.extend(measured(browser, SHEET).map(|c| format!("in print: {c}")));
    let folded = browser.evaluate(
        "[...document.querySelectorAll('details > :not(summary)')].filter((e) => !e.checkVisibility()).length",
    );
    if folded != 0 {
        all.push(format!("in print: {folded} parts stay folded"));
    }
    let sheet = json!({ "printBackground": true, "paperWidth": 8.27, "paperHeight": 11.69 });
    let printed = browser.ask("Page.printToPDF", sheet);
    let pdf = pictures::decoded(printed["data"].as_str().unwrap());
    if !pdf.starts_with(b"%PDF-") || pdf.len() < 10_000 {
        all.push(format!("it prints as {} bytes", pdf.len()));
    }
    browser.media("screen");
    all.extend(browser.complaints());
    all
}

fn measured(browser: &mut Browser, width: u32) -> impl Iterator<Item = String> + use<> {
    let found = browser.evaluate(&format!("{MEASURE}({width})"));
    let found: Vec<String> = serde_json::from_value(found).unwrap();
    found.into_iter()
}

/// Elements that take the focus, but not by the Tab key, or without showing it.
fn unreached(browser: &mut Browser) -> Vec<String> {
    let count = browser.evaluate(
        "window.stops = [...document.querySelectorAll('a, summary, .wide')]; document.activeElement.blur(); scrollTo(0, 0); stops.length",
    );
    let count = count.as_u64().unwrap();
    for _ in 0..count + 2 {
        browser.press("Tab", 9);
        browser.evaluate(
            "{ const e = document.activeElement; e.reached = true; e.seen = getComputedStyle(e).outlineStyle !== 'none' }",
        );
    }
    let missed = browser.evaluate(
        "stops.filter((e) => !e.reached || !e.seen).map((e) => `${e.tagName} \"${e.textContent.trim().slice(0, 30)}\": ${e.reached ? 'focus not seen' : 'never reached by Tab'}`)",
    );
    serde_json::from_value(missed).unwrap()
}

/// Pictures without a name for those who hear the page.
fn unnamed(browser: &mut Browser) -> Vec<String> {
    let tree = browser.ask("Accessibility.getFullAXTree", json!({}));
    let nodes = tree["nodes"].as_array().unwrap();
    let images =
        || (nodes.iter()).filter(|n| matches!(n["role"]["value"].as_str(), Some("image" | "img")));
    let mut all = vec![];
    if images().count() == 0 {
        all.push("no picture is there to hear".into());
    }
    let nameless = images().filter(|n| n["name"]["value"].as_str().unwrap_or_default().is_empty());
    all.extend(nameless.map(|n| format!("a picture without a name: {n}")));
    all
}

pub fn every_page_is_whole_at_every_width_and_in_print() {
    let mut browser = browser();
    let folder = tempfile::tempdir().unwrap();
    let mut all = vec![];
    for (name, page) in pages() {
        let path = written(folder.path(), name, &page);
        all.extend((complaints(&mut browser, &path).into_iter()).map(|c| format!("{name}: {c}")));
        if let Some(kept) = std::env::var_os("TRUETWIN_PAGES") {
            let path = written(Path::new(&kept), name, &page);
            pictures::take(&mut browser, &path, &WIDTHS);
        }
    }
    assert!(all.is_empty(), "{}", all.join("\n"));
}

/// A diagnosis is answered on the first screen of a desktop, in few words and without those of the method.
pub fn the_first_screen_answers_in_sixty_words() {
    let mut browser = browser();
    let folder = tempfile::tempdir().unwrap();
    browser.media("screen");
    browser.resize(1280, HEIGHT);
    for (name, page) in diagnoses() {
        browser.open(&written(folder.path(), name, &page));
        let shown = browser.evaluate(FIRST_SCREEN);
        let words: Vec<String> = serde_json::from_value(shown).unwrap();
        let text = words.join(" ");
        assert!(words.len() <= 60, "{name}: {} words: {text}", words.len());
        assert!(words.len() > 15, "{name}: {text}");
        for jargon in JARGON {
            let is_there = words
                .iter()
                .any(|word| word.to_lowercase().starts_with(jargon));
            assert!(!is_there, "{name}: {jargon}: {text}");
        }
        assert!(!text.contains("free run"), "{name}: {text}");
    }
}

/// The test sees what it is to see: pages broken on purpose.
pub fn a_broken_page_is_complained_of() {
    let mut browser = browser();
    let folder = tempfile::tempdir().unwrap();
    let page = made::oscillator_no_gap().html(&reference_studies().unwrap()[0]);
    let body = |extra: &str| page.replacen("</main>", &format!("{extra}</main>"), 1);
    let picture = |text: &str| {
        body(&format!(
            "<svg role=\"img\" viewBox=\"0 0 520 100\" width=\"520\"><title>a</title><desc>b</desc>{text}</svg>"
        ))
    };
    for (name, broken, expected) in [
        (
            "wide",
            body("<p style=\"width:900px\">wide</p>"),
            "wide on a screen of",
        ),
        (
            "outside",
            picture("<text x=\"500\" y=\"50\">beyond the edge</text>"),
            "leaves its picture",
        ),
        (
            "over",
            picture("<text x=\"5\" y=\"50\">one</text><text x=\"9\" y=\"52\">two</text>"),
            "lies over",
        ),
        (
            "nameless",
            page.replacen("<title>van-der-pol: record", "<title></title><title>", 1),
            "no title",
        ),
        (
            "throws",
            body("<script>throw new Error('lost')</script>"),
            "exceptionThrown",
        ),
        (
            "console",
            body("<script>console.error('lost')</script>"),
            "consoleAPICalled",
        ),
        (
            "loads",
            body("<img alt=\"a\" src=\"http://127.0.0.1:9/a.png\">"),
            "requestWillBeSent",
        ),
        (
            "unreached",
            page.replacen(
                "<a href=\"#which\"",
                "<a tabindex=\"-1\" href=\"#which\"",
                1,
            ),
            "never reached by Tab",
        ),
        ("pale", body("<p style=\"color:#999\">pale</p>"), "contrast"),
        (
            "folded",
            page.replacen("details::details-content", "b", 1),
            "stay folded",
        ),
    ] {
        assert_ne!(broken, page, "{name}");
        let path = written(folder.path(), name, &broken);
        let all = complaints(&mut browser, &path);
        assert!(all.iter().any(|c| c.contains(expected)), "{name}: {all:?}");
    }
}
