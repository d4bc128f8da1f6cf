//! Moments in the names of images: `2026-11-28_12-30-10`, `PXL_20261128_123010123`, `12-30-10`.

/// A moment in a name: where it stands, and when it is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Moment {
    /// First byte and end of the text.
    pub(super) place: (usize, usize),
    /// Since an arbitrary beginning.
    pub(super) seconds: f64,
    /// Whether the day is known. A time of day alone may be three numbers that count something else.
    pub(super) dated: bool,
}

/// The moment in a name, if there is one. A date with a time of day comes before a time of day alone.
pub(super) fn moment(name: &str) -> Option<Moment> {
    let begins = |i: usize| name.as_bytes()[i].is_ascii_digit() && (i == 0 || !name.as_bytes()[i - 1].is_ascii_digit());
    let starts: Vec<usize> = (0..name.len()).filter(|i| begins(*i)).collect();
    let find = |dated| starts.iter().find_map(|start| Reader { text: name.as_bytes(), at: *start }.moment(dated));
    find(true).or_else(|| find(false))
}

/// Reads numbers of a fixed width.
#[derive(Clone, Copy)]
struct Reader<'a> {
    text: &'a [u8],
    at: usize,
}

impl Reader<'_> {
    fn moment(mut self, dated: bool) -> Option<Moment> {
        let start = self.at;
        let day = if dated {
            let year = self.number(4, 1900..=2099)?;
            self.separator();
            let month = self.number(2, 1..=12)?;
            self.separator();
            let day = self.number(2, 1..=31)?;
            self.separator();
            days(year, month, day)
        } else {
            0
        };
        let hour = self.number(2, 0..=23)?;
        let separator = self.separator();
        let minute = self.number(2, 0..=59)?;
        // Six digits alone may count anything.
        if self.separator() != separator || !(dated || separator.is_some()) {
            return None;
        }
        let second = self.number(2, 0..=60)?;
        let end = self.at;
        let mut fraction = self;
        fraction.separator();
        let (milliseconds, end) = match fraction.number(3, 0..=999) {
            Some(milliseconds) if !fraction.digit(0) => (milliseconds, fraction.at),
            _ if self.digit(0) => return None,
            _ => (0, end),
        };
        let seconds = ((day * 24 + hour) * 60 + minute) * 60 + second;
        Some(Moment { place: (start, end), seconds: seconds as f64 + milliseconds as f64 / 1000.0, dated })
    }

    fn digit(&self, ahead: usize) -> bool {
        self.text.get(self.at + ahead).is_some_and(u8::is_ascii_digit)
    }

    fn number(&mut self, width: usize, legal: std::ops::RangeInclusive<i64>) -> Option<i64> {
        if !(0..width).all(|i| self.digit(i)) {
            return None;
        }
        let value = self.text[self.at..][..width].iter().fold(0, |value, digit| 10 * value + i64::from(digit - b'0'));
        self.at += width;
        legal.contains(&value).then_some(value)
    }

    fn separator(&mut self) -> Option<u8> {
        let found = self.text.get(self.at).copied().filter(|c| b"-_.: T".contains(c));
        self.at += usize::from(found.is_some());
        found
    }
}

/// Days since an arbitrary day, in the Gregorian calendar.
fn days(year: i64, month: i64, day: i64) -> i64 {
    // The year begins with March, so that the day of a leap year is its last.
    let (year, month) = if month > 2 { (year, month - 3) } else { (year - 1, month + 9) };
    365 * year + year / 4 - year / 100 + year / 400 + (153 * month + 2) / 5 + day
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn moments_of_cameras_and_programs() {
        let seconds = |name: &str| moment(name).map(|moment| moment.seconds);
        let dashes = seconds("2026-11-28_12-30-10").unwrap();
        for same in [
            "20261128_123010",
            "IMG_20261128_123010",
            "20261128123010",
            "2026-11-28T12:30:10",
            "VID 2026.11.28 12.30.10 a",
        ] {
            assert_eq!(seconds(same), Some(dashes), "{same}");
        }
        assert_eq!(seconds("2026-11-28_12-31-09"), Some(dashes + 59.0));
        assert_eq!(seconds("PXL_20261128_123010250"), Some(dashes + 0.25));
        assert_eq!(seconds("2026-11-28_12-30-10.250"), Some(dashes + 0.25));
        assert_eq!(seconds("2027-03-01_00-00-00").unwrap() - seconds("2027-02-28_00-00-00").unwrap(), 86_400.0);
        assert_eq!(seconds("2028-03-01_00-00-00").unwrap() - seconds("2028-02-28_00-00-00").unwrap(), 2.0 * 86_400.0);
        let alone = moment("shot_12-30-10").unwrap();
        assert_eq!((alone.seconds, alone.dated, alone.place), (45_010.0, false, (5, 13)));
        for none in ["frame_0001", "cam03_0017", "20261128", "123010", "99-99-99", "13-28_12", "1-2-3", "", "ä"] {
            assert_eq!(seconds(none), None, "{none}");
        }
        // A counter after a moment is not a part of it.
        assert_eq!(moment("20261128_123010_0001").unwrap().place, (0, 15));
    }
}
