//! How far the gap closes, on data that no fit has seen.

use crate::diagnose::{Diagnosis, Shrinkage};
use crate::report::digits::short;
use crate::report::gap::pictures;
use crate::report::gap::text::{closed_sentence, no_share};
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
            "The score is the mean log density of a held-out sample in nats: more is better. The accepted effects are noise and \
             move no free run.",
        ));
    }
    if let Some(svg) = pictures::extent(diagnosis) {
        let wrong = match s.placebo {
            Some(_) => " A wrong effect, fitted alike, shows what any extra number gains.",
            None => "",
        };
        let caption = "Errors of free runs over the standard deviation of the output. The floor is what noise alone leaves.";
        body.push_str(&figure(&svg, &format!("{caption}{wrong}")));
    }
    if s.closed.is_none()
        && let (Some(after), Some(floor)) = (s.after, s.floor)
        && s.metric == Shrinkage::FREE_RUN
    {
        body.push_str(&paragraph(&format!(
            "No share is given: before ({}) and the floor ({}) are too close together for these data; after is {}.",
            short(s.before),
            short(floor),
            short(after)
        )));
    }
    body
}
