//! Time stamps of ISO 8601.

/// Nanoseconds of a second.
const SECOND: i128 = 1_000_000_000;
/// Nanoseconds of a minute.
const MINUTE: i128 = 60 * SECOND;
/// Days before 1970-01-01 in the calendar that starts in the year 0.
const EPOCH: i64 = 719_528;

/// An instant, or a local time without a zone.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Stamp {
    /// Nanoseconds since 1970-01-01, in UTC where a zone is given.
    nanoseconds: i128,
    /// `true` where the stamp has a zone.
    has_zone: bool,
}

impl Stamp {
    /// Parses `2024-03-01`, `2024-03-01T12:00`, `2024-03-01 12:00:00.25`, each with `Z` or `+01:00` or without. Digits beyond
    /// a nanosecond are cut off.
    pub fn parse(text: &str) -> Option<Self> {
        let (date, rest) = text.split_at_checked(10)?;
        let mut parts = date.split('-');
        let mut next = |length: usize| whole(parts.next()?, length);
        let (year, month, day) = (next(4)?, next(2)?, next(2)?);
        if parts.next().is_some() || !(1..=days(year, month)?).contains(&day) {
            return None;
        }
        let midnight = i128::from(day_number(year, month, day)) * 24 * 60 * MINUTE;
        let Some(rest) = rest.strip_prefix(['T', 't', ' ']) else {
            return rest.is_empty().then_some(Self {
                nanoseconds: midnight,
                has_zone: false,
            });
        };
        let zone_at = rest.find(['Z', 'z', '+', '-']).unwrap_or(rest.len());
        let (clock, zone) = rest.split_at(zone_at);
        let nanoseconds = midnight + time_of_day(clock)?;
        match zone {
            "" => Some(Self {
                nanoseconds,
                has_zone: false,
            }),
            zone => Some(Self {
                nanoseconds: nanoseconds - offset(zone)?,
                has_zone: true,
            }),
        }
    }

    /// Returns the seconds from `first` to this stamp.
    ///
    /// # Errors
    ///
    /// A zone in one of the two alone.
    pub fn since(self, first: Self) -> Result<f64, String> {
        if self.has_zone != first.has_zone {
            let (here, there) = match self.has_zone {
                true => ("has a time zone", "has none"),
                false => ("has no time zone", "has one"),
            };
            return Err(format!(
                "the time stamp {here}, the first {there}; give all of them one, or none"
            ));
        }
        Ok((self.nanoseconds - first.nanoseconds) as f64 / SECOND as f64)
    }

    /// Returns `true` for text that is meant as a date or a time of day.
    pub fn is_meant(text: &str) -> bool {
        let digits = text.chars().filter(char::is_ascii_digit).count();
        let signs = |c: char| matches!(c, ':' | '/' | '-' | '.' | ' ' | 'T');
        digits > 2 && text.chars().filter(|c| signs(*c)).count() > 1
    }
}

/// Parses a number of exactly `length` digits.
fn whole(text: &str, length: usize) -> Option<i64> {
    let is_number = text.len() == length && text.bytes().all(|b| b.is_ascii_digit());
    is_number.then(|| text.parse().ok())?
}

/// Returns the number of days of a month.
fn days(year: i64, month: i64) -> Option<i64> {
    let is_leap = year % 4 == 0 && (year % 100 != 0 || year % 400 == 0);
    match month {
        2 => Some(28 + i64::from(is_leap)),
        4 | 6 | 9 | 11 => Some(30),
        1..=12 => Some(31),
        _ => None,
    }
}

/// Returns the days from 1970-01-01 to a date; the year is not negative.
fn day_number(year: i64, month: i64, day: i64) -> i64 {
    // Leap days fall at the end of years that begin in March.
    let (year, month) = match month {
        1 | 2 => (year - 1, month + 9),
        _ => (year, month - 3),
    };
    let leap_days = year.div_euclid(4) - year.div_euclid(100) + year.div_euclid(400);
    // 60 days before the first of March of the year 0.
    365 * year + leap_days + (153 * month + 2) / 5 + day - 1 + 60 - EPOCH
}

/// Parses `12:00`, `12:00:00`, `12:00:00.25` as nanoseconds since midnight.
fn time_of_day(text: &str) -> Option<i128> {
    let mut parts = text.split(':');
    let (hour, minute) = (whole(parts.next()?, 2)?, whole(parts.next()?, 2)?);
    let (second, fraction) = match parts.next() {
        None => (0, 0),
        Some(second) => match second.split_once(['.', ',']) {
            None => (whole(second, 2)?, 0),
            Some((second, digits)) => (whole(second, 2)?, fraction(digits)?),
        },
    };
    if parts.next().is_some() || hour > 23 || minute > 59 || second > 59 {
        return None;
    }
    Some(i128::from(hour * 60 + minute) * MINUTE + i128::from(second) * SECOND + fraction)
}

/// Parses the digits behind the decimal sign of a second, in nanoseconds.
fn fraction(digits: &str) -> Option<i128> {
    let used = &digits[..digits.len().min(9)];
    if digits.is_empty() || !digits.bytes().all(|b| b.is_ascii_digit()) {
        return None;
    }
    let value: i128 = used.parse().ok()?;
    Some(value * 10i128.pow(9 - used.len() as u32))
}

/// Parses `Z`, `+01:00`, `+0100` or `+01` as nanoseconds ahead of UTC.
fn offset(zone: &str) -> Option<i128> {
    let (sign, rest) = match zone.split_at_checked(1)? {
        ("Z" | "z", "") => return Some(0),
        ("+", rest) => (1, rest),
        ("-", rest) => (-1, rest),
        _ => return None,
    };
    let digits = rest.replacen(':', "", 1);
    let (hours, minutes) = match digits.len() {
        2 => (whole(&digits, 2)?, 0),
        4 => {
            let (hours, minutes) = digits.split_at_checked(2)?;
            (whole(hours, 2)?, whole(minutes, 2)?)
        }
        _ => return None,
    };
    (hours < 24 && minutes < 60).then(|| sign * i128::from(hours * 60 + minutes) * MINUTE)
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
        let step = seconds("2024-01-01T00:00:00.000000001", "2024-01-01T00:00:00");
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
            "2024-01-01T12:00:60",
            "2024-01-01T12:00:00.",
            "2024-01-01T12:00:00+1",
            "2024-01-01T12:00:00+25:00",
            "2024-01-01Z",
            "01.03.2024 12:00",
            "2024-1-1",
            "2024-01-0\u{661}",
            "-024-01-01",
            "2024-01-01T1é:00",
        ] {
            assert_eq!(Stamp::parse(text), None, "{text}");
        }
        assert!(Stamp::is_meant("01.03.2024 12:00") && Stamp::is_meant("12:00:01"));
        assert!(!Stamp::is_meant("1.5") && !Stamp::is_meant("abc") && !Stamp::is_meant("-1e-3"));
    }
}
