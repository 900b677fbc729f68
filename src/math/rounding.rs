//! Numbers without the noise of their last bits.

/// The value to six significant digits: a step of 0.09999999999999999 s is one of 0.1 s to people.
pub(crate) fn six_digits(value: f64) -> f64 {
    format!("{value:.5e}").parse().unwrap_or(value)
}

/// The value to three significant digits, for messages.
pub(crate) fn three_digits(value: f64) -> f64 {
    format!("{value:.2e}").parse().unwrap_or(value)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn last_bits_go_and_nothing_else() {
        assert_eq!(six_digits(0.1 - 1e-17), 0.1);
        assert_eq!(six_digits(-1.234_567_89e9), -1.234_57e9);
        assert_eq!(six_digits(0.0016384), 0.0016384);
        assert_eq!(six_digits(f64::INFINITY), f64::INFINITY);
        assert!(six_digits(f64::NAN).is_nan());
    }
}
