//! Names, which are printed on terminals and pages.

use crate::{CodecError, Limits, limits::at_most};

/// Characters of a refused text that a message shows.
const SHOWN: usize = 40;

/// Refuses a name that is too long, or that has characters which control a terminal.
pub(crate) fn check_name(section: &'static str, field: &str, name: &str, limits: &Limits) -> Result<(), CodecError> {
    at_most(section, format!("length of {field}"), name.len() as u64, limits.name_bytes)?;
    check_text(section, field, name, |_| true)
}

/// Refuses text with characters that control a terminal: those for which `obeys` holds.
pub(crate) fn check_text(
    section: &'static str,
    field: &str,
    text: &str,
    obeys: impl Fn(char) -> bool,
) -> Result<(), CodecError> {
    if !text.contains(|c| is_obeyed(c) && obeys(c)) {
        return Ok(());
    }
    // Escaped.
    let start: String = text.chars().take(SHOWN).collect();
    Err(CodecError::invalid(section, field, format!("{start:?}"), "text without control characters"))
}

/// The name, with every character that `check_name` refuses replaced: for names of folders and files, which may have
/// any.
///
/// ```
/// use light4gs_codec::legal_name;
///
/// assert_eq!(legal_name("bouncing balls \u{1f3be}"), "bouncing balls \u{1f3be}");
/// assert_eq!(legal_name("a\u{1b}[31mb\n"), "a\u{fffd}[31mb\u{fffd}");
/// ```
pub fn legal_name(name: &str) -> String {
    let mut legal: String = name.chars().map(|c| if is_obeyed(c) { char::REPLACEMENT_CHARACTER } else { c }).collect();
    legal.truncate(legal.floor_char_boundary(Limits::default().name_bytes as usize));
    legal
}

/// Control characters, and marks that change the direction of writing.
fn is_obeyed(c: char) -> bool {
    let turns = matches!(c, '\u{61c}' | '\u{200e}' | '\u{200f}' | '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}');
    c.is_control() || turns
}
