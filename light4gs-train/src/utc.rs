//! Date and time as text. Compiling a crate for dates would take longer than reading this.

use std::time::{SystemTime, UNIX_EPOCH};

/// For example `2026-11-23 08:47:05 UTC`.
pub fn now() -> String {
    let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    at(since.as_secs())
}

/// For example `2026-11-23 08:47 UTC`.
pub fn now_to_the_minute() -> String {
    to_the_minute(&now())
}

fn to_the_minute(words: &str) -> String {
    format!("{} UTC", &words[..words.len() - ":05 UTC".len()])
}

/// Seconds since 1970 as text.
fn at(seconds: u64) -> String {
    let (days, second) = (seconds / 86_400, seconds % 86_400);
    let (year, month, day) = date(days);
    format!("{year:04}-{month:02}-{day:02} {:02}:{:02}:{:02} UTC", second / 3600, second / 60 % 60, second % 60)
}

/// Year, month and day of a number of days since 1970. Years begin in March here, so that a leap day is the last of its
/// year; 400 years always have the same number of days (Hinnant, "chrono-compatible low-level date algorithms").
fn date(days: u64) -> (u64, u64, u64) {
    let days = days + 719_468;
    let (era, day_of_era) = (days / 146_097, days % 146_097);
    let year_of_era = (day_of_era - day_of_era / 1460 + day_of_era / 36_524 - day_of_era / 146_096) / 365;
    let day_of_year = day_of_era - (365 * year_of_era + year_of_era / 4 - year_of_era / 100);
    let month_from_march = (5 * day_of_year + 2) / 153;
    let day = day_of_year - (153 * month_from_march + 2) / 5 + 1;
    let month = if month_from_march < 10 { month_from_march + 3 } else { month_from_march - 9 };
    (400 * era + year_of_era + u64::from(month <= 2), month, day)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// As printed by `date -u -d @SECONDS`.
    #[test]
    fn known_moments() {
        for (seconds, words) in [
            (0, "1970-01-01 00:00:00 UTC"),
            (951_782_399, "2000-02-28 23:59:59 UTC"),
            (951_782_400, "2000-02-29 00:00:00 UTC"),
            (951_868_800, "2000-03-01 00:00:00 UTC"),
            (1_795_423_625, "2026-11-23 08:47:05 UTC"),
            (4_107_542_399, "2100-02-28 23:59:59 UTC"),
            (4_107_542_400, "2100-03-01 00:00:00 UTC"),
        ] {
            assert_eq!(at(seconds), words);
        }
    }

    #[test]
    fn without_seconds() {
        assert_eq!(to_the_minute("2026-11-23 08:47:05 UTC"), "2026-11-23 08:47 UTC");
    }
}
