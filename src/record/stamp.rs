//! Time stamps of ISO 8601.

use jiff::Timestamp;
use jiff::civil::DateTime;
use std::borrow::Cow;

/// Form of a date.
const DATE: &str = "2024-03-31";
/// Digits of a fraction that a nanosecond has.
const DIGITS: usize = 9;

/// An instant, or a local time without a zone.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Stamp {
    Instant(Timestamp),
    Local(DateTime),
}

impl Stamp {
    /// Parses `2024-03-01`, `2024-03-01T12:00`, `2024-03-01 12:00:00.25`, each with `Z` or `+01:00` or without. Digits beyond
    /// a nanosecond are cut off.
    pub fn parse(text: &str) -> Option<Self> {
        // Without its signs a date is a number.
        let is_date = text.get(4..5) == Some("-");
        if !is_date || !has_zone_of_a_clock(text) || has_leap_second(text) {
            return None;
        }
        let text = without_surplus_digits(text);
        let instant = text.parse().map(Self::Instant);
        (instant.or_else(|_| text.parse().map(Self::Local))).ok()
    }

    /// Returns the seconds from `first` to this stamp.
    ///
    /// # Errors
    ///
    /// A zone in one of the two alone.
    pub fn since(self, first: Self) -> Result<f64, String> {
        let (here, there) = match (self, first) {
            (Self::Instant(to), Self::Instant(from)) => {
                return Ok(to.duration_since(from).as_secs_f64());
            }
            (Self::Local(to), Self::Local(from)) => {
                return Ok(to.duration_since(from).as_secs_f64());
            }
            (Self::Instant(_), _) => ("has a time zone", "has none"),
            (Self::Local(_), _) => ("has no time zone", "has one"),
        };
        Err(format!(
            "the time stamp {here}, the first {there}; give all of them one, or none"
        ))
    }

    /// Returns `true` for text that is meant as a date or a time of day.
    pub fn is_meant(text: &str) -> bool {
        let digits = text.chars().filter(char::is_ascii_digit).count();
        let signs = |c: char| matches!(c, ':' | '/' | '-' | '.' | ' ' | 'T');
        digits > 2 && text.chars().filter(|c| signs(*c)).count() > 1
    }
}

/// Returns `false` for a zone without hours, such as `+:01`, and for one of a day or more, which the parser takes.
fn has_zone_of_a_clock(text: &str) -> bool {
    let sign = text.rfind(['+', '-']).map_or(text.len(), |at| at + 1);
    let digits: String = text[sign..].chars().take(2).collect();
    let hours = digits.parse::<u8>();
    match sign > DATE.len() {
        true => digits.is_empty() || hours.is_ok_and(|hours| hours < 24),
        // The sign before a day.
        false => digits.chars().all(|c| c.is_ascii_digit()),
    }
}

/// Returns `true` for a second 60, which the parser takes for 59: two rows would have one time.
fn has_leap_second(text: &str) -> bool {
    let time = text.chars().skip(DATE.len() + 1).filter(|c| *c != ':');
    time.skip(4).take(2).eq("60".chars())
}

/// Cuts the fraction of a second to nanoseconds, which the parser asks for.
fn without_surplus_digits(text: &str) -> Cow<'_, str> {
    let Some(sign) = text.find(['.', ',']) else {
        return Cow::Borrowed(text);
    };
    let digits = text[sign + 1..]
        .bytes()
        .take_while(u8::is_ascii_digit)
        .count();
    let end = sign + 1 + digits;
    Cow::Owned(format!(
        "{}{}",
        &text[..end.min(sign + 1 + DIGITS)],
        &text[end..]
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn seconds(text: &str, first: &str) -> f64 {
        let stamp = |text| Stamp::parse(text).unwrap();
        stamp(text).since(stamp(first)).unwrap()
    }

    #[test]
    fn days_are_those_of_the_calendar() {
        let days = |text| seconds(text, "1970-01-01") / 86_400.0;
        for (text, expected) in [
            ("1970-01-01", 0.0),
            ("2000-02-29", 11_016.0),
            ("2000-03-01", 11_017.0),
            ("2024-12-31T12:00", 20_088.5),
            ("1969-12-31", -1.0),
            ("0000-03-01", -719_468.0),
        ] {
            assert_eq!(days(text), expected, "{text}");
        }
    }

    #[test]
    fn fractions_zones_and_daylight_saving_are_exact() {
        let first = "2024-03-31T01:59:59.75+01:00";
        assert_eq!(seconds("2024-03-31T03:00:00+02:00", first), 0.25);
        assert_eq!(seconds("2024-03-31 01:00:00.5Z", first), 0.75);
        assert_eq!(seconds("2024-03-31 01:00:00,5Z", first), 0.75);
        let step = seconds("2024-01-01T00:00:00.000000001987", "2024-01-01T00:00:00");
        assert_eq!(step, 1e-9);
        let one = |text| Stamp::parse(text).unwrap();
        let mixed = one("2024-01-01T00:00").since(one("2024-01-01T00:00Z"));
        assert!(mixed.unwrap_err().contains("has no time zone"));
    }

    #[test]
    fn what_is_no_stamp_is_refused() {
        for text in [
            "",
            "12:00",
            "2023-02-29",
            "2024-13-01",
            "2024-00-10",
            "2024-01-01T24:00",
            "2024-01-01T12:60",
            "2024-01-01T12:00:00.",
            "2024-01-01T12:00:00+1",
            "2024-01-01T12:00:00+:01",
            "2024-01-01T12:00:00+25:00",
            "2024-01-01T12:00-24:00",
            "2024-01-01T12:00:00+26:00",
            "20240101",
            "2016-12-31T23:59:60Z",
            "2016-12-31 23:59:60.5",
            "2024-01-01Z",
            "01.03.2024 12:00",
            "2024-1-1",
            "2024-01-0\u{661}",
            "-024-01-01",
            "2024-01-01T1é:00",
            "2024-03-31T12:00:00.12345678é",
        ] {
            assert_eq!(Stamp::parse(text), None, "{text}");
        }
        assert!(Stamp::is_meant("01.03.2024 12:00") && Stamp::is_meant("12:00:01"));
        assert!(!Stamp::is_meant("1.5") && !Stamp::is_meant("abc") && !Stamp::is_meant("-1e-3"));
    }
}
