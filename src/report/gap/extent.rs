//! Section on the share of the gap that closes on held-out data.

use super::pictures;
use super::share::{closed_sentence, no_share};
use crate::diagnose::{Diagnosis, Shrinkage};
use crate::report::digits::short;
use crate::report::document::{Block, Section};

pub(super) fn section(diagnosis: &Diagnosis) -> Section {
    let section = Section::new("extent", "How far the gap closes", vec![]);
    let Some(s) = &diagnosis.shrinkage else {
        return section.brief(vec![Block::Paragraph(no_share(diagnosis))]);
    };
    let mut rest = vec![];
    if s.metric == Shrinkage::LOG_SCORE {
        rest.push(Block::paragraph(
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
        rest.push(Block::picture(svg, format!(
            "Root mean squares over the standard deviation of the output. The share counts squared errors above the floor: the true \
             system has 100 % in expectation. It says how much a correction helps, not that its name is right.{wrong}"
        )));
    }
    rest.extend(pictures::horizons(diagnosis).map(|svg| Block::picture(
        svg,
        "Predictions begin anew from what the record has shown, and reach so far ahead; a free run never does. Floor: errors of records \
         that the twin with effects makes itself, with its fitted noise.",
    )));
    if let Some([before, after]) = s.log_score.filter(|_| s.metric != Shrinkage::LOG_SCORE) {
        rest.push(Block::Paragraph(format!(
            "Mean log density of a held-out sample: {} → {} nats; higher is better.",
            short(before),
            short(after)
        )));
    }
    if let Some((after, floor)) = s.hidden_by_noise() {
        rest.push(Block::Paragraph(format!(
            "No share is given: the error before ({}) and the floor ({}) are too close; the error after is {}.",
            short(s.before),
            short(floor),
            short(after)
        )));
    }
    Section { rest, ..section }.brief(vec![Block::Paragraph(closed_sentence(s))])
}
