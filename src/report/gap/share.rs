//! The share of the gap that closes on held-out data, in words.

use crate::diagnose::{Diagnosis, SHORTEST_SPLIT, Shrinkage};
use crate::report::digits::{percent, short};

/// Returns the name of the measure with its horizon.
pub(super) fn measure(s: &Shrinkage) -> String {
    match (s.metric, s.horizon) {
        (Shrinkage::LOG_SCORE, _) => "Log density of a sample, in nats".into(),
        (_, Some(seconds)) => format!("Error of predictions {} s ahead", short(seconds)),
        (_, None) => "Error of the free run".into(),
    }
}

/// Returns errors on held-out data before and after, and the share of the gap closed.
pub(super) fn closed_sentence(s: &Shrinkage) -> String {
    let mut text = format!("{}, {}: {}", measure(s), s.held_out, short(s.before));
    if let Some(after) = s.after {
        text.push_str(&format!(" → {}", short(after)));
    }
    if s.metric != Shrinkage::LOG_SCORE {
        text.push_str(" deviations of the output");
    }
    if let Some(floor) = s.floor {
        text.push_str(&format!(", noise alone {}", short(floor)));
    }
    if let Some(share) = share_with_interval(s, " of the gap closed") {
        text.push_str(&format!("; {share}"));
    }
    if s.hidden_by_noise().is_some() {
        text.push_str("; too near to noise for a share of the gap");
    }
    text + "."
}

/// Returns the share of the gap, which is so much `of` it, with its 90 % interval. Where that is too wide for one number: its lower end,
/// if all of the gap may have closed, or else both ends.
pub(super) fn share_with_interval(s: &Shrinkage, of: &str) -> Option<String> {
    let ends = s.interval.filter(|_| s.hidden_by_noise().is_none())?;
    let [low, high] = ends.map(percent);
    Some(match s.closed {
        Some(closed) => format!("{}{of} ({low} to {high})", percent(closed)),
        None if ends[0] > 0.0 && ends[1] >= 1.0 => format!("at least {low}{of}"),
        None => format!("{low} to {high}{of}"),
    })
}

/// Returns the reason for missing errors on held-out data.
pub(super) fn no_share(diagnosis: &Diagnosis) -> String {
    if diagnosis.interrupted {
        return "No share of the gap closed: the work was interrupted before.".into();
    }
    if diagnosis.validation_runs.is_none() && diagnosis.free_runs.times.len() < SHORTEST_SPLIT {
        return format!(
            "No share of the gap closed: the record is too short to hold data back. Give a validation record, or a record of at least {SHORTEST_SPLIT} samples."
        );
    }
    "No share of the gap closed: the free run on the held-out data diverges.".into()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::fixture::made;

    #[test]
    fn a_wide_interval_is_told_without_a_share() {
        let mut share = made::tanks_class().shrinkage.unwrap();
        (share.closed, share.interval) = (Some(1.0), Some([0.93, 1.18]));
        let narrow = closed_sentence(&share);
        assert!(
            narrow.ends_with("; 100 % of the gap closed (93 % to 118 %)."),
            "{narrow}"
        );
        (share.closed, share.interval) = (None, Some([0.6, 1.2]));
        let wide = closed_sentence(&share);
        assert!(
            wide.ends_with("; at least 60 % of the gap closed."),
            "{wide}"
        );
        share.interval = Some([-0.2, 0.7]);
        let open = closed_sentence(&share);
        assert!(
            open.ends_with("; −20 % to 70 % of the gap closed."),
            "{open}"
        );
        for interval in [None, Some([-1.3, 4.9])] {
            share.interval = interval;
            let hidden = closed_sentence(&share);
            assert!(hidden.ends_with("; too near to noise for a share of the gap."));
        }
    }
}
