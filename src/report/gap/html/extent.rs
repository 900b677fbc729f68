//! Section on the share of the gap that closes on held-out data.

use crate::diagnose::{Diagnosis, Shrinkage};
use crate::report::digits::short;
use crate::report::gap::pictures;
use crate::report::gap::share::{closed_sentence, no_share};
use crate::report::page::{Section, figure, paragraph};

pub(super) fn section_of(diagnosis: &Diagnosis) -> Section {
    Section::new("extent", "How far the gap closes", body(diagnosis))
}

fn body(diagnosis: &Diagnosis) -> String {
    let Some(s) = &diagnosis.shrinkage else {
        return paragraph(&no_share(diagnosis));
    };
    let mut body = paragraph(&closed_sentence(s));
    if s.metric == Shrinkage::LOG_SCORE {
        body.push_str(&paragraph(
            "The score is the mean log density of a held-out sample in nats; higher is better. The accepted effects change the noise \
             only, so predictions do not change.",
        ));
    }
    if let Some(svg) = pictures::extent(diagnosis) {
        let wrong = match s.placebo {
            Some(_) => {
                " Wrong effects, fitted in the same way, show what any extra parameter gains."
            }
            None => "",
        };
        let caption = "Root mean squares over the standard deviation of the output. The share counts squared errors above the floor: the \
             true system has 100 % in expectation.";
        body.push_str(&figure(&svg, &format!("{caption}{wrong}")));
    }
    if let Some(svg) = pictures::horizons(diagnosis) {
        body.push_str(&figure(
            &svg,
            "Predictions begin anew from what the record has shown, and reach so far ahead; a free run never does. Floor: errors of records \
             that the twin with effects makes itself, with its fitted noise.",
        ));
    }
    if let Some([before, after]) = s.log_score.filter(|_| s.metric != Shrinkage::LOG_SCORE) {
        body.push_str(&paragraph(&format!(
            "Mean log density of a held-out sample: {} → {} nats; higher is better.",
            short(before),
            short(after)
        )));
    }
    if let Some((after, floor)) = s.hidden_by_noise() {
        body.push_str(&paragraph(&format!(
            "No share is given: the error before ({}) and the floor ({}) are too close; the error after is {}.",
            short(s.before),
            short(floor),
            short(after)
        )));
    }
    body
}
