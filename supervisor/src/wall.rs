//! Wall time as people read it in records: never used to decide anything.

/// Seconds since the Unix epoch as UTC, `2026-11-22T21:48:34.120Z` (proleptic Gregorian, no leap seconds).
pub fn utc(unix_s: f64) -> String {
    let millis = (unix_s * 1e3).max(0.0) as u64;
    let (days, in_day) = (millis / 86_400_000, millis % 86_400_000);
    let (year, month, day) = date(days);
    let (hour, minute, second) = (in_day / 3_600_000, in_day / 60_000 % 60, in_day / 1_000 % 60);
    format!("{year:04}-{month:02}-{day:02}T{hour:02}:{minute:02}:{second:02}.{:03}Z", in_day % 1_000)
}

/// Year, month and day of the `days`-th day after 1970-01-01 (H. Hinnant, "chrono-compatible low-level date
/// algorithms"): years run from March, so that the leap day is the last of its year.
fn date(days: u64) -> (u64, u64, u64) {
    let days = days + 719_468;
    let (era, in_era) = (days / 146_097, days % 146_097);
    let year_in_era = (in_era - in_era / 1_460 + in_era / 36_524 - in_era / 146_096) / 365;
    let in_year = in_era - (365 * year_in_era + year_in_era / 4 - year_in_era / 100);
    let month_from_march = (5 * in_year + 2) / 153;
    let day = in_year - (153 * month_from_march + 2) / 5 + 1;
    let month = if month_from_march < 10 { month_from_march + 3 } else { month_from_march - 9 };
    (era * 400 + year_in_era + u64::from(month <= 2), month, day)
}

/// A span as people say it: `0.8 s`, `42 s`, `12 min`, `3 h`, `5 days`.
pub fn span(seconds: f64) -> String {
    match seconds {
        s if s < 10.0 => format!("{s:.1} s"),
        s if s < 120.0 => format!("{s:.0} s"),
        s if s < 7_200.0 => format!("{:.0} min", s / 60.0),
        s if s < 172_800.0 => format!("{:.0} h", s / 3_600.0),
        s => format!("{:.0} days", s / 86_400.0),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn known_instants_read_as_the_calendar_has_them() {
        assert_eq!(utc(0.0), "1970-01-01T00:00:00.000Z");
        assert_eq!(utc(951_782_400.5), "2000-02-29T00:00:00.500Z");
        assert_eq!(utc(4_107_542_399.0), "2100-02-28T23:59:59.000Z");
        assert_eq!(utc(4_107_542_400.0), "2100-03-01T00:00:00.000Z");
    }

    #[test]
    fn spans_take_the_unit_that_people_would() {
        assert_eq!([0.31, 42.4, 700.0, 9_000.0, 400_000.0].map(span), ["0.3 s", "42 s", "12 min", "2 h", "5 days"]);
    }
}
