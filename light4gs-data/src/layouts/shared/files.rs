//! Finding files: suffixes in upper or lower case, names in natural order, nothing outside of the dataset.

use crate::error::DataError;
use std::cmp::Ordering;
use std::ffi::OsStr;
use std::fs;
use std::path::{Component, Path, PathBuf};

/// Suffixes of images that can be decoded, lower case.
const SUFFIXES: [&str; 4] = ["png", "jpg", "jpeg", "gif"];
/// Suffixes of images that cannot be decoded, lower case: cameras and other programs write them.
const OTHER_SUFFIXES: [&str; 9] = ["tif", "tiff", "bmp", "webp", "heic", "heif", "avif", "exr", "jxl"];

/// Whether a file's suffix is that of an image, in upper or lower case.
pub(crate) fn is_image(path: &Path) -> bool {
    has_suffix(path, &SUFFIXES)
}

/// Whether a file has one of these suffixes (given in lower case), in upper or lower case.
pub(crate) fn has_suffix(path: &Path, suffixes: &[&str]) -> bool {
    path.extension().is_some_and(|found| suffixes.iter().any(|known| found.eq_ignore_ascii_case(known)))
}

/// The wanted entries of a folder, in natural order. Hidden files are skipped, since editors and file managers leave
/// some.
pub(crate) fn entries(folder: &Path, wanted: impl Fn(&Path) -> bool) -> Result<Vec<PathBuf>, DataError> {
    let mut found = Vec::new();
    for entry in fs::read_dir(folder).map_err(DataError::io("read", folder))? {
        let path = entry.map_err(DataError::io("read", folder))?.path();
        let hidden = path.file_name().is_some_and(|name| name.as_encoded_bytes().starts_with(b"."));
        if !hidden && wanted(&path) {
            found.push(path);
        }
    }
    found.sort_by(|a, b| natural(&name_of(a), &name_of(b)));
    Ok(found)
}

/// The images of a folder, in natural order.
pub(crate) fn images(folder: &Path) -> Result<Vec<PathBuf>, DataError> {
    entries(folder, |path| is_image(path) && path.is_file())
}

/// The last part of a path as text.
pub(crate) fn name_of(path: &Path) -> String {
    path.file_name().unwrap_or(OsStr::new("")).to_string_lossy().into_owned()
}

/// The last part of a path as text, without the suffix.
pub(crate) fn stem_of(path: &Path) -> String {
    path.file_stem().unwrap_or(OsStr::new("")).to_string_lossy().into_owned()
}

/// Natural order: `cam2` before `cam10`, `7.png` before `0010.png`.
pub(crate) fn natural(a: &str, b: &str) -> Ordering {
    let (mut left, mut right) = (a.as_bytes(), b.as_bytes());
    while let (Some(x), Some(y)) = (left.first(), right.first()) {
        let (step_left, step_right, order) = if x.is_ascii_digit() && y.is_ascii_digit() {
            let digits = |text: &[u8]| text.iter().take_while(|c| c.is_ascii_digit()).count();
            let (m, n) = (digits(left), digits(right));
            let value = |text: &[u8]| text.iter().position(|c| *c != b'0').map_or(Vec::new(), |i| text[i..].to_vec());
            let (u, v) = (value(&left[..m]), value(&right[..n]));
            (m, n, u.len().cmp(&v.len()).then(u.cmp(&v)))
        } else {
            (1, 1, x.cmp(y))
        };
        if order.is_ne() {
            return order;
        }
        (left, right) = (&left[step_left..], &right[step_right..]);
    }
    left.len().cmp(&right.len()).then_with(|| a.cmp(b))
}

/// A path from a file of the dataset, as a path below `root`. It may be absolute or climb out of the folder, if it comes
/// back into it; others are refused. Nothing is looked up but `root` itself.
///
/// `file` and `field` say where the path was found.
pub(crate) fn inside(root: &Path, file: &Path, field: &str, name: &str) -> Result<PathBuf, DataError> {
    // Files from Windows may have the other separator.
    let name = if name.contains('/') { name.to_owned() } else { name.replace('\\', "/") };
    let below = below(root, &name).ok_or_else(|| {
        DataError::field(
            file,
            field,
            format!("`{}` leads out of the dataset's folder", shorten(&name)),
            "copy the images into the folder and name them relative to it",
        )
    })?;
    if below.as_os_str().is_empty() {
        let problem = format!("`{}` names no file", shorten(&name));
        return Err(DataError::field(file, field, problem, "write the file's path, relative to the folder"));
    }
    Ok(root.join(below))
}

/// The path relative to `root`, without `.` and `..`; `None` if it leads out of it.
fn below(root: &Path, name: &str) -> Option<PathBuf> {
    // As on Windows, where no such component has its own name.
    if matches!(name.as_bytes(), [drive, b':', b'/', ..] if drive.is_ascii_alphabetic()) && cfg!(not(windows)) {
        return None;
    }
    let path = Path::new(name);
    if let Some(path) = normal(path).filter(|path| !path.has_root()) {
        return Some(path);
    }
    let folders = [std::path::absolute(root).ok(), root.canonicalize().ok()];
    folders.into_iter().flatten().find_map(|folder| {
        let folder = normal(&folder)?;
        Some(normal(&folder.join(path))?.strip_prefix(&folder).ok()?.to_path_buf())
    })
}

/// A path without `.` and `..`; `None` if it climbs above its beginning.
fn normal(path: &Path) -> Option<PathBuf> {
    let mut out = PathBuf::new();
    for part in path.components() {
        match part {
            Component::CurDir => {}
            Component::ParentDir if !out.pop() => return None,
            Component::ParentDir => {}
            part => out.push(part),
        }
    }
    Some(out)
}

/// The image of a path with or without suffix, in upper or lower case; `None` where there is none. If there is no file
/// of this name, one with another suffix is taken: images may have been converted since their names were written.
pub(crate) fn find_image(path: &Path) -> Option<PathBuf> {
    if is_image(path) || has_suffix(path, &OTHER_SUFFIXES) {
        let converted = || SUFFIXES.iter().find_map(|suffix| with_any_case(&path.with_extension(suffix)));
        return Some(path).filter(|path| is_image(path)).and_then(with_any_case).or_else(converted);
    }
    let added = |suffix: &str| {
        let mut name = path.as_os_str().to_owned();
        name.push(".");
        name.push(suffix);
        PathBuf::from(name)
    };
    SUFFIXES
        .iter()
        .flat_map(|suffix| [added(suffix), added(&suffix.to_ascii_uppercase())])
        .find(|candidate| candidate.is_file())
}

/// The file of this path, or the one whose suffix has the other case.
fn with_any_case(path: &Path) -> Option<PathBuf> {
    if path.is_file() {
        return Some(path.to_path_buf());
    }
    let (lower, upper) = (path.extension()?.to_str()?.to_ascii_lowercase(), path.extension()?.to_ascii_uppercase());
    let capitalized = lower.get(..1)?.to_ascii_uppercase() + lower.get(1..)?;
    [lower.as_ref(), upper.as_os_str(), capitalized.as_ref()]
        .iter()
        .map(|suffix| path.with_extension(suffix))
        .find(|candidate| candidate.is_file())
}

/// Whether the file of this path, or the one whose suffix has the other case, exists in a format that cannot be
/// decoded.
pub(crate) fn is_of_other_format(path: &Path) -> bool {
    has_suffix(path, &OTHER_SUFFIXES) && with_any_case(path).is_some()
}

/// Text from a file, short and without control characters, for messages.
pub(crate) fn shorten(text: &str) -> String {
    let visible = |c: char| {
        let quote = matches!(c, '"' | '\'').then_some(c);
        quote.into_iter().chain(c.escape_debug().filter(move |_| quote.is_none()))
    };
    text.chars().take(80).flat_map(visible).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn natural_order() {
        let mut names = ["cam10", "cam2", "cam02", "b", "cam2a", "", "10", "9", "99999999999999999999999", "cam"];
        names.sort_by(|a, b| natural(a, b));
        assert_eq!(names, ["", "9", "10", "99999999999999999999999", "b", "cam", "cam02", "cam2", "cam2a", "cam10"]);
    }

    #[test]
    fn paths_stay_inside() {
        let root = Path::new("/data");
        let inside = |name: &str| inside(root, Path::new("t.json"), "file_path", name);
        assert_eq!(inside("./train/../test/a.png").unwrap(), root.join("test/a.png"));
        assert_eq!(inside("images\\a.png").unwrap(), root.join("images/a.png"));
        assert_eq!(inside("/data/images/a.png").unwrap(), root.join("images/a.png"));
        assert_eq!(inside("../data/images/a.png").unwrap(), root.join("images/a.png"));
        let drive = "C:/Users/x/images/a.png";
        for bad in ["../a.png", "/etc/passwd", "/database/a.png", "a/../../b", "", ".", "\x1b[31m/../../x", drive] {
            let message = inside(bad).unwrap_err().to_string();
            assert!(message.contains("t.json: file_path") && message.contains("; "), "{message}");
            assert!(!message.contains('\x1b'));
        }
    }

    #[test]
    fn text_for_messages_is_short_and_visible() {
        assert_eq!(shorten("\"48\" it's ä\n\x1b"), "\"48\" it's ä\\n\\u{1b}");
        assert_eq!(shorten(&"x".repeat(200)).len(), 80);
    }

    #[test]
    fn suffixes_in_any_case() {
        let folder = tempfile::tempdir().unwrap();
        for name in ["a.PNG", "b.Jpg", "c.jpeg", ".hidden.png", "notes.txt"] {
            fs::write(folder.path().join(name), "").unwrap();
        }
        let at = |name: &str| find_image(&folder.path().join(name)).map(|path| name_of(&path));
        assert_eq!(at("a.png").as_deref(), Some("a.PNG"));
        assert_eq!(at("a").as_deref(), Some("a.PNG"));
        assert_eq!(at("c.jpeg").as_deref(), Some("c.jpeg"));
        assert_eq!(at("d.png"), None);
        // Converted since the names were written.
        assert_eq!(at("b.png").as_deref(), Some("b.Jpg"));
        assert_eq!(at("c.tif").as_deref(), Some("c.jpeg"));
        assert_eq!(at("a.JPG").as_deref(), Some("a.PNG"));
        let names: Vec<String> = images(folder.path()).unwrap().iter().map(|path| name_of(path)).collect();
        assert_eq!(names, ["a.PNG", "b.Jpg", "c.jpeg"]);
    }
}
