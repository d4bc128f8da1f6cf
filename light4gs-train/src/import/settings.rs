//! `cfg_args`, which 4DGaussians writes beside its checkpoints: `Namespace(name=value, ...)` on one line.

use std::path::Path;

use light4gs_data::{DataError, read_regular_text};

/// More than the arguments of a training take.
const MAX_BYTES: u64 = 1 << 20;

/// The arguments that are used.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Settings {
    pub(super) no_dx: bool,
    pub(super) no_ds: bool,
    pub(super) no_dr: bool,
    pub(super) no_do: bool,
    pub(super) no_dshs: bool,
    pub(super) apply_rotation: bool,
    pub(super) white_background: bool,
}

impl Default for Settings {
    /// The defaults of that program.
    fn default() -> Self {
        Self {
            no_dx: false,
            no_ds: false,
            no_dr: false,
            no_do: true,
            no_dshs: true,
            apply_rotation: false,
            white_background: true,
        }
    }
}

impl Settings {
    /// Reads the file; arguments that it does not mention keep their defaults.
    pub(super) fn read(path: &Path) -> Result<Self, DataError> {
        let text = read_regular_text(path, MAX_BYTES).map_err(DataError::io("read", path))?;
        let mut settings = Self::default();
        for (name, value) in [
            ("no_dx", &mut settings.no_dx),
            ("no_ds", &mut settings.no_ds),
            ("no_dr", &mut settings.no_dr),
            ("no_do", &mut settings.no_do),
            ("no_dshs", &mut settings.no_dshs),
            ("apply_rotation", &mut settings.apply_rotation),
            ("white_background", &mut settings.white_background),
        ] {
            let Some(found) = argument(&text, name) else { continue };
            *value = match found {
                "True" => true,
                "False" => false,
                other => {
                    let problem = format!("`{}`, expected True or False", other.chars().take(40).collect::<String>());
                    return Err(DataError::field(path, name, problem, "copy the file again, or remove it"));
                }
            };
        }
        Ok(settings)
    }
}

/// The value of an argument, up to the next comma or the end.
fn argument<'a>(text: &'a str, name: &str) -> Option<&'a str> {
    let assignment = format!("{name}=");
    let mut places = text.match_indices(&assignment).map(|(at, _)| at);
    let begin = places.find(|at| matches!(text[..*at].chars().next_back(), None | Some('(' | ' ' | ',')))?;
    let value = &text[begin + assignment.len()..];
    Some(value[..value.find([',', ')', '\n']).unwrap_or(value.len())].trim())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn arguments_are_found_by_their_whole_name() {
        let text = "Namespace(sh_degree=3, really_no_do=True, no_do=False, apply_rotation=False)";
        assert_eq!(argument(text, "no_do"), Some("False"));
        assert_eq!(argument(text, "apply_rotation"), Some("False"));
        assert_eq!(argument(text, "no_ds"), None);
    }

    #[test]
    fn what_is_not_mentioned_keeps_its_default() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("cfg_args");
        std::fs::write(&path, "Namespace(no_do=False, white_background=False)").unwrap();
        let expected = Settings { no_do: false, white_background: false, ..Settings::default() };
        assert_eq!(Settings::read(&path).unwrap(), expected);
        std::fs::write(&path, "Namespace(no_dx=maybe)").unwrap();
        let message = Settings::read(&path).unwrap_err().to_string();
        assert!(message.contains("no_dx") && message.contains("maybe") && message.contains("cfg_args"), "{message}");
    }
}
