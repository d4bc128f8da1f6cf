//! Takes for readers in other languages: each is a line of JSON, and then the bytes of the file.

use std::fmt::Write;

use light4gs_codec::{Limits, take::Take};

use super::{Answer, DamagedTake, Sums};

/// A take as a line of JSON and its bytes. `asked` has an entry for each time: the seconds, and what our reader says: `"shown"` with
/// both checksums of [`Sums`], `"refused"` with the kind of the error, or `"large"`. `drawn` has the begins of the segments that are
/// drawn at each time.
pub fn record(number: u64, take: &DamagedTake, answers: &[Answer]) -> Vec<u8> {
    let DamagedTake { kind, sound, forged, bomb, bytes, times } = take;
    let mut asked = String::new();
    for (seconds, answer) in times.iter().zip(answers) {
        let comma = if asked.is_empty() { "" } else { "," };
        // Writing to a string does not fail. Rust prints the shortest number that is read back to the same bits.
        let _ = match answer {
            Answer::Refused(kind) => write!(asked, "{comma}[{seconds:?},\"refused\",\"{kind}\"]"),
            Answer::Large => write!(asked, "{comma}[{seconds:?},\"large\"]"),
            Answer::Shown(Sums { all, means }) => write!(asked, "{comma}[{seconds:?},\"shown\",{all},{means}]"),
        };
    }
    let opened = Take::read(bytes.clone(), &Limits::default());
    let begins = |seconds: &f64| -> Vec<f64> {
        let Ok(take) = &opened else { return Vec::new() };
        let drawn = take.drawn_at(*seconds).into_iter();
        drawn.map(|one| take.index().segments()[one.segment].times.begin).collect()
    };
    let drawn: Vec<Vec<f64>> = times.iter().map(begins).collect();
    let line = format!(
        "{{\"number\":{number},\"kind\":\"{kind}\",\"sound\":{sound},\"forged\":{forged},\"bomb\":{bomb},\"bytes\":{},\"asked\":[{asked}],\"drawn\":{drawn:?}}}\n",
        bytes.len()
    );
    [line.as_bytes(), bytes].concat()
}
