//! A study of many records, for figures.

use super::trials::*;
use truetwin::diagnose::{Decision, Verdict};
use truetwin::record::Record;
use truetwin::twin::{Noise, Twin};

fn number(name: &str, or: u64) -> u64 {
    std::env::var(name)
        .ok()
        .and_then(|v| v.parse().ok())
        .unwrap_or(or)
}

/// A study of many records; choose with TWIN, KIND, FROM, TRIALS, VALIDATION; BOX=1 hides the equations.
#[test]
#[ignore = "minutes; a study, not a test"]
fn study_of_many_records() {
    let name = std::env::var("TWIN").unwrap_or("tanks".into());
    let kind = std::env::var("KIND").unwrap_or("null".into());
    let only = std::env::var("ONLY").unwrap_or_default();
    let with_validation = number("VALIDATION", 0) == 1;
    let study = study(&name);
    let shown = match number("BOX", 0) {
        1 => boxed(&study),
        _ => study.clone(),
    };
    let (from, trials) = (number("FROM", 0), number("TRIALS", 20));
    let effects = clear(&name);
    let (mut structural, mut top, mut class, mut abstained, mut place) = (0, 0, 0, 0, 0);
    let mut sizes = 0;
    let mut seconds = 0.0;
    let mut done = 0;
    for i in from..from + trials {
        let noise = Noise::new(777, &format!("{name} {kind}"), i);
        let theta = theta(&study, kind == "null" && i % 2 == 1, noise);
        let twin = study.twin();
        let (truth, text) = match kind.as_str() {
            "listed" => {
                let (key, text) = effects[i as usize % effects.len()];
                if !key.contains(&only) {
                    continue;
                }
                (key.to_owned(), format!("[[effect]]\n{text}\n"))
            }
            _ => (
                format!(
                    "{kind} {}",
                    if kind == "null" {
                        i % 2
                    } else {
                        i % UNLISTED as u64
                    }
                ),
                String::new(),
            ),
        };
        let source = match kind.as_str() {
            "unlisted" => Twin::new(Unlisted {
                base: twin.clone(),
                kind: i as usize % UNLISTED,
            }),
            // Effects of signals are where a box can have them: behind its noise.
            "listed" if truth.contains("sensor") || truth.contains("actuator") => {
                shown.twin().clone()
            }
            _ => twin.clone(),
        };
        let make = |noise: Noise| -> Record {
            record(&source, &text, &theta, drive(&study, noise), noise)
        };
        let validation = with_validation.then(|| make(noise.child("validation")));
        let found = found(&shown, make(noise), validation);
        println!("{i:3} {}", line(&truth, &found));
        done += 1;
        seconds += found.seconds;
        if found.verdict == Verdict::StructuralGap {
            structural += 1;
            let first = found
                .cause
                .accepted
                .first()
                .cloned()
                .or(found.cause.effects.first().map(|e| e.key()))
                .unwrap_or_default();
            top += usize::from(
                found
                    .cause
                    .effects
                    .first()
                    .is_some_and(|e| e.key() == truth)
                    || first == truth,
            );
            class += usize::from(found.cause.class.contains(&truth));
            sizes += found.cause.class.len();
            abstained += usize::from(found.cause.decision == Decision::NoneOfThese);
            let target = truth.split('@').nth(1);
            place += usize::from(found.location.target.as_deref() == target);
        }
    }
    println!(
        "{name} {kind} validation {with_validation}: {structural}/{done} structural; top {top}, in class {class}, class size {:.2}, abstained {abstained}, where {place}; {:.2} s a record",
        sizes as f64 / structural.max(1) as f64,
        seconds / f64::from(done)
    );
}
