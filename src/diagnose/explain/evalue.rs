//! E-value of a validation record against the twin, for any θ.

use crate::diagnose::explain::attribute::Explanation;

/// log E: the likelihood of the validation record under a mixture of explanations fitted on the record, over that under the
/// twin refitted on the validation record itself.
///
/// ```text
/// w_c ∝ exp(gain_c − BIC_c)        E = Σ w_c·L_c(validation) / max_θ L(validation)
/// ```
///
/// The explanations never saw the validation record, the twin did: where the twin is right, the mean of E is at most 1, and
/// so P(E ≥ 1/α) ≤ α. Unknown starts must be refitted there by both; `starts` of them cost ½·log N each.
///
/// Source: Wasserman, Ramdas & Balakrishnan, "Universal inference" (2020).
pub(in crate::diagnose) fn log_e(
    explanations: &[Explanation],
    refitted: f64,
    starts: usize,
    samples: usize,
) -> Option<f64> {
    let usable: Vec<(f64, f64)> = (explanations.iter())
        .filter_map(|e| Some((e.penalised, e.validation_likelihood?)))
        .collect();
    let weight = log_sum(&usable.iter().map(|(w, _)| *w).collect::<Vec<_>>())?;
    let mixture = log_sum(
        &usable
            .iter()
            .map(|(w, l)| w - weight + l)
            .collect::<Vec<_>>(),
    )?;
    Some(mixture - refitted - 0.5 * starts as f64 * (samples as f64).ln())
}

/// log Σ exp(v).
fn log_sum(values: &[f64]) -> Option<f64> {
    let top = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    top.is_finite()
        .then(|| top + values.iter().map(|v| (v - top).exp()).sum::<f64>().ln())
}

/// p = min(1, 2·min(p_rank, 1/E)).
pub(in crate::diagnose) fn combined(p_rank: f64, log_e: Option<f64>) -> f64 {
    match log_e {
        Some(log_e) => (2.0 * p_rank.min((-log_e).exp())).min(1.0),
        None => p_rank,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_record_alone_is_not_doubled() {
        assert_eq!(combined(0.03, None), 0.03);
        assert_eq!(combined(0.03, Some(0.0)), 0.06);
        assert!((combined(0.5, Some(5.0)) - 2.0 * (-5.0f64).exp()).abs() < 1e-12);
        assert_eq!(combined(0.9, Some(-20.0)), 1.0);
    }

    #[test]
    fn sums_of_exponentials_do_not_overflow() {
        assert!((log_sum(&[1e4, 1e4]).unwrap() - 1e4 - 2f64.ln()).abs() < 1e-9);
        assert_eq!(log_sum(&[]), None);
    }
}
