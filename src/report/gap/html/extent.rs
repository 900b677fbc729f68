//! Section on the share of the gap that closes on held-out data.

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
            "The score is the mean log density of a held-out sample in nats; higher is better. The accepted effects change the noise \
             only, so free runs do not change.",
        ));
    }
    if let Some(svg) = pictures::extent(diagnosis) {
        let wrong = match s.placebo {
            Some(_) => {
                " The wrong effect, fitted in the same way, shows the gain of any extra parameter."
            }
            None => "",
        };
        let caption = "Errors of free runs over the standard deviation of the output. Floor: the error that noise alone causes.";
        body.push_str(&figure(&svg, &format!("{caption}{wrong}")));
    }
    if s.closed.is_none()
        && let (Some(after), Some(floor)) = (s.after, s.floor)
        && s.metric == Shrinkage::FREE_RUN
    {
        body.push_str(&paragraph(&format!(
            "No share is given: the error before ({}) and the floor ({}) are too close; the error after is {}.",
            short(s.before),
            short(floor),
            short(after)
        )));
    }
    body
}
