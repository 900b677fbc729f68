//! Numbers for people: as many as there is room for, with the digits that they are worth.

use crate::record::Quantity;
use crate::setting::{own_unit, unit_suffix};

numbers! {
    /// Limits of a page, a picture and the terminal, and of what a sentence is sure of. The JSON has everything.
    pub(super) const SHOWN: ShownLimits = {
        /// Significant digits of a standard error.
        digits_of_error: i32 = 2,
        /// Significant digits of a number without an error.
        digits: i32 = 3,
        /// Most significant digits of a value, however small its error.
        most_digits: i32 = 7,
        /// Characters of a headline: two lines of a page.
        headline: usize = 140,
        /// Words of the answer: with heading and caption there are at most 60 on the first screen.
        answer_words: usize = 46,
        /// Probability that nothing is missing below which *no gap* is said with a reservation.
        clear: f64 = 0.9,
        /// Names in one sentence.
        names: usize = 3,
        /// Terms of a missing function that a sentence names.
        terms: usize = 3,
        /// Effects on the terminal.
        effects: usize = 4,
        /// Windows and ranges that the terminal names.
        windows: usize = 2,
        /// Bursts that the text names.
        bursts: usize = 3,
        /// Weak combinations of parameters.
        combinations: usize = 2,
        /// Characters of a combination.
        combination: usize = 90,
        /// Level below which records are said to disagree.
        disagreement: f64 = 0.01,
        /// Parameters of each record.
        of_record: usize = 6,
        /// Share of the prior from which on a remark names it.
        leaning: f64 = 0.1,
        /// Explanations that are drawn.
        explanations: usize = 8,
        /// Share of a place from which on it is drawn: what rounds to nothing is left to the JSON.
        visible: f64 = 0.005,
        /// Quantities that a pair plot has room for.
        paired: usize = 6,
        /// Lags of the correlations of residuals, in samples.
        lags: usize = 20,
        /// Standard deviations of 95 % of white noise.
        white_band: f64 = 1.96,
        /// Points of a quantile plot: more only blot.
        quantiles: usize = 200,
        /// Panels of cross-correlations; more pairs of output and input are left out.
        cross_panels: usize = 12,
        /// Parameters that a comparison of estimators draws: more panels are a roll, not a picture.
        panels: usize = 6,
    }
}

/// Notation of the numbers of one quantity, the same for all of them so that they can be compared.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Digits {
    /// Digits after the point.
    Fixed(usize),
    /// Digits after the point of the mantissa.
    Scientific(usize),
}

impl Digits {
    /// Digits that `std_error` supports for numbers of the size of `value`: two of the error, at most seven of the value.
    pub(super) fn supported(value: f64, std_error: f64) -> Self {
        if !(std_error > 0.0 && std_error.is_finite()) {
            return Self::significant(value, SHOWN.digits + 1);
        }
        let last =
            rounded_magnitude(std_error, SHOWN.digits_of_error) - (SHOWN.digits_of_error - 1);
        let largest = value.abs().max(std_error);
        Self::down_to(
            last.max(magnitude(largest) - (SHOWN.most_digits - 1)),
            largest,
        )
    }

    /// `digits` significant ones.
    pub(super) fn significant(value: f64, digits: i32) -> Self {
        Self::down_to(rounded_magnitude(value, digits) - (digits - 1), value.abs())
    }

    /// Down to the place 10^last, for numbers up to `largest`.
    pub(super) fn down_to(last: i32, largest: f64) -> Self {
        let first = magnitude(largest);
        if first >= 6 || (first < -3 && last < -5) {
            Self::Scientific((first - last).clamp(0, 15) as usize)
        } else {
            Self::Fixed((-last).clamp(0, 15) as usize)
        }
    }

    /// The number with a true minus sign; a dash where it is none.
    pub(super) fn write(self, value: f64) -> String {
        if !value.is_finite() {
            return "–".into();
        }
        let text = match self {
            Self::Fixed(places) => format!("{value:.places$}"),
            Self::Scientific(places) => format!("{value:.places$e}"),
        };
        if value == 0.0 && matches!(self, Self::Scientific(_)) {
            return "0".into();
        }
        let zero = !text.contains(|c: char| ('1'..='9').contains(&c));
        match text.strip_prefix('-') {
            Some(rest) if zero => rest.into(),
            _ => text.replace('-', "−"),
        }
    }
}

/// A p-value, three places.
pub(super) fn probability(p: f64) -> String {
    match p {
        p if p < 0.0005 => "p < 0.001".into(),
        p => format!("p = {p:.3}"),
    }
}

/// A standard error, two significant digits.
pub(super) fn error(value: f64) -> String {
    Digits::significant(value, SHOWN.digits_of_error).write(value)
}

/// Three significant digits.
pub(super) fn short(value: f64) -> String {
    Digits::significant(value, SHOWN.digits).write(value)
}

/// A share in percent; three digits where it is absurd.
pub(super) fn percent(share: f64) -> String {
    match 100.0 * share {
        p if p.abs() < 1000.0 => format!("{} %", Digits::Fixed(0).write(p)),
        p => format!("{} %", short(p)),
    }
}

/// The probability of one of many explanations, two places.
pub(super) fn chance(p: f64) -> String {
    match p {
        p if p < 0.005 => "< 0.01".into(),
        p if p >= 0.995 => "> 0.99".into(),
        p => format!("{p:.2}"),
    }
}

/// A value in the digits that its standard error supports, and that error.
pub(super) fn with_error(value: f64, std_error: f64) -> [String; 2] {
    let digits = Digits::supported(value, std_error);
    [digits.write(value), error(std_error)]
}

/// `3.00 V`: three significant digits and the unit, where there is one.
pub(super) fn with_unit(value: f64, unit: &str) -> String {
    short(value) + &unit_suffix(unit)
}

/// `y in V`.
pub(super) fn named(quantity: &Quantity) -> String {
    format!("{}{}", quantity.name, in_unit(&quantity.unit))
}

/// " in V", or nothing where a quantity has no unit.
pub(super) fn in_unit(unit: &str) -> String {
    match own_unit(unit) {
        "" => String::new(),
        unit => format!(" in {unit}"),
    }
}

/// The power of ten of the leading digit; 0 for zero.
fn magnitude(value: f64) -> i32 {
    match value.abs() {
        v if v > 0.0 && v.is_finite() => v.log10().floor() as i32,
        _ => 0,
    }
}

/// [`magnitude`] of the value rounded to `digits` significant ones: 0.0996 becomes 0.10.
fn rounded_magnitude(value: f64, digits: i32) -> i32 {
    let unit = 10f64.powi(magnitude(value) - (digits - 1));
    magnitude((value / unit).round() * unit * (1.0 + 1e-12))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_value_has_the_digits_of_its_error() {
        for (value, error, expected) in [
            (0.731_234, 0.0213, "0.731"),
            (0.731_234, 0.0996, "0.73"),
            (12.345_67, 3.21, "12.3"),
            (1234.5, 87.0, "1234"),
            (-0.000_123_4, 0.000_002_1, "−1.234e−4"),
            (4.2e8, 1.3e6, "4.200e8"),
            (0.001, 0.02, "0.001"),
            (0.5, f64::NAN, "0.5000"),
            (1.234_567_89e8, 0.01, "1.234568e8"),
            (-0.001, 0.2, "0.00"),
        ] {
            let written = Digits::supported(value, error).write(value);
            assert_eq!(written, expected, "{value} ± {error}");
        }
        assert_eq!(error(0.0996), "0.10");
        assert_eq!(Digits::Fixed(2).write(f64::NAN), "–");
    }

    #[test]
    fn shares_are_short_however_large() {
        assert_eq!(percent(0.634), "63 %");
        assert_eq!(percent(-0.2), "−20 %");
        assert_eq!(percent(-3e9), "−3.00e11 %");
    }

    #[test]
    fn probabilities_never_read_zero() {
        assert_eq!(chance(1e-9), "< 0.01");
        assert_eq!(probability(0.0001), "p < 0.001");
        assert_eq!(probability(0.005), "p = 0.005");
    }

    #[test]
    fn numbers_without_an_error_have_three_digits() {
        for (value, expected) in [
            (0.0, "0.00"),
            (0.61234, "0.612"),
            (9.996, "10.0"),
            (1234.0, "1234"),
            (1.2e-7, "1.20e−7"),
        ] {
            assert_eq!(short(value), expected);
        }
    }
}
