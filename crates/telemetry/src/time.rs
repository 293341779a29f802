//! Epochs and time scales, as far as a bundle needs them.
//!
//! ```text
//! Julian year = 2000 + (days from 2000-01-01T12:00) / 365.25
//! ```
//!
//! No leap seconds and no relativity: an epoch serves to move catalogue stars, and a minute moves
//! the fastest of them by 2e-5 arcsec.
//!
//! Source: calendar days by H. F. Fliegel, T. C. Van Flandern, Comm. ACM 11 (1968) 657.

use std::fmt;

use serde::{Serialize, Serializer};

/// Time scale of an epoch.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "UPPERCASE")]
pub enum TimeScale {
    /// Coordinated Universal Time.
    Utc,
    /// International Atomic Time.
    Tai,
    /// Terrestrial Time.
    Tt,
    /// Barycentric Dynamical Time.
    Tdb,
    /// GPS time.
    Gps,
}

impl TimeScale {
    /// All scales, by the names in files.
    pub const NAMES: [(&'static str, Self); 5] = [
        ("UTC", Self::Utc),
        ("TAI", Self::Tai),
        ("TT", Self::Tt),
        ("TDB", Self::Tdb),
        ("GPS", Self::Gps),
    ];
}

/// A calendar date and time of day, `YYYY-MM-DDThh:mm:ss[.fff]`, Gregorian.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Epoch {
    year: i32,
    month: u32,
    day: u32,
    hour: u32,
    minute: u32,
    second: f64,
}

impl Epoch {
    /// Reads `2018-07-25`, `2018-07-25T12:00`, `2018-07-25T12:00:00.5`, with a blank in place of
    /// the `T` or a `Z` at the end if you like. `None` for anything else, or a day or time that
    /// does not exist. Second 60 is allowed, for leap seconds.
    ///
    /// ```
    /// let epoch = telemetry::Epoch::parse("2018-07-25T12:00:00").expect("a date");
    /// // 18 years with 5 leap days, then 205 days of 2018
    /// let days = 18.0 * 365.0 + 5.0 + 205.0;
    /// assert!((epoch.julian_year(0.0) - 2000.0 - days / 365.25).abs() < 1e-12);
    /// assert!(telemetry::Epoch::parse("2018-02-30T12:00:00").is_none());
    /// ```
    #[must_use]
    pub fn parse(text: &str) -> Option<Self> {
        let text = text.trim();
        let text = text.strip_suffix('Z').unwrap_or(text);
        let (date, time) = match text.split_once(['T', ' ']) {
            Some((date, time)) => (date, time),
            None => (text, "00:00"),
        };
        let [year, month, day] = parts(date, '-')?;
        let mut clock = time.splitn(3, ':');
        let hour = digits(clock.next()?, 2)?;
        let minute = digits(clock.next()?, 2)?;
        let second = match clock.next() {
            Some(text) => seconds(text)?,
            None => 0.0,
        };
        let epoch = Self {
            year: i32::try_from(digits(year, 4)?).ok()?,
            month: digits(month, 2)?,
            day: digits(day, 2)?,
            hour,
            minute,
            second,
        };
        epoch.exists().then_some(epoch)
    }

    fn exists(&self) -> bool {
        let leap = self.year % 4 == 0 && (self.year % 100 != 0 || self.year % 400 == 0);
        let days = match self.month {
            1 | 3 | 5 | 7 | 8 | 10 | 12 => 31,
            4 | 6 | 9 | 11 => 30,
            2 => 28 + u32::from(leap),
            _ => return false,
        };
        (1..=days).contains(&self.day) && self.hour < 24 && self.minute < 60 && self.second < 61.0
    }

    /// Julian year `offset_s` seconds after the epoch.
    #[must_use]
    pub fn julian_year(&self, offset_s: f64) -> f64 {
        let day = f64::from(self.day_number() - 2_451_545); // from 2000-01-01, noon to noon
        let clock_s =
            f64::from(self.hour) * 3600.0 + f64::from(self.minute) * 60.0 + self.second - 43_200.0;
        2000.0 + (day + (clock_s + offset_s) / 86_400.0) / 365.25
    }

    /// Julian day number of the date's noon.
    fn day_number(&self) -> i32 {
        let month = i32::try_from(self.month).unwrap_or(1);
        let day = i32::try_from(self.day).unwrap_or(1);
        let a = (month - 14) / 12;
        day - 32_075 + 1461 * (self.year + 4800 + a) / 4 + 367 * (month - 2 - a * 12) / 12
            - 3 * ((self.year + 4900 + a) / 100) / 4
    }
}

fn parts(text: &str, separator: char) -> Option<[&str; 3]> {
    let mut parts = text.split(separator);
    let three = [parts.next()?, parts.next()?, parts.next()?];
    parts.next().is_none().then_some(three)
}

fn digits(text: &str, count: usize) -> Option<u32> {
    (text.len() == count && text.bytes().all(|b| b.is_ascii_digit()))
        .then(|| text.parse().ok())
        .flatten()
}

fn seconds(text: &str) -> Option<f64> {
    let (whole, fraction) = text.split_once('.').unwrap_or((text, "0"));
    let plain = !fraction.is_empty() && fraction.bytes().all(|b| b.is_ascii_digit());
    digits(whole, 2)?;
    plain.then(|| text.parse().ok()).flatten()
}

impl fmt::Display for Epoch {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            year,
            month,
            day,
            hour,
            minute,
            second,
        } = self;
        write!(f, "{year:04}-{month:02}-{day:02}T{hour:02}:{minute:02}:")?;
        let pad = if *second < 10.0 { "0" } else { "" };
        write!(f, "{pad}{second}")
    }
}

impl Serialize for Epoch {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        to.collect_str(self)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Julian day numbers of known dates: 2000-01-01 noon is 2451545, 1991-04-02 begins J1991.25
    /// (JD 2448349.0625).
    #[test]
    fn julian_years_of_known_dates() {
        let year = |text: &str| Epoch::parse(text).expect("a date").julian_year(0.0);
        assert!((year("2000-01-01T12:00:00") - 2000.0).abs() < 1e-12);
        assert!((year("1991-04-02T13:30:00") - 1991.25).abs() < 1e-9);
        assert!((year("2000-12-31T18:00:00") - 2001.0).abs() < 1e-9);
        let noon = Epoch::parse("2000-01-01T12:00:00").expect("a date");
        assert!((noon.julian_year(86_400.0 * 365.25) - 2001.0).abs() < 1e-12);
    }

    #[test]
    fn text_goes_round() {
        for text in ["2018-07-25T12:00:00", "1998-01-01T00:00:09.5"] {
            assert_eq!(Epoch::parse(text).expect("a date").to_string(), text);
        }
        for text in [
            "",
            "yesterday",
            "2018-13-01T00:00:00",
            "2019-02-29T00:00:00",
            "2018-07-25T24:00:00",
            "2018-07-25T12:00:0x",
            "2018-7-25T12:00:00",
        ] {
            assert!(Epoch::parse(text).is_none(), "{text} is no date");
        }
    }
}
