//! Reading whole files from others: regular files only, up to a size.

use std::fs::{self, File, Metadata};
use std::io::{self, Read};
use std::path::Path;

/// Opens a file to read it.
///
/// A pipe, a device or a folder is refused before it is opened: opening a pipe would wait for its writer, and a device
/// may never end. It is looked at once more when it is open, since it may be another file by then.
///
/// # Errors
/// As the system says; [`io::ErrorKind::InvalidInput`] for anything but a regular file.
pub fn open_regular_file(path: &Path) -> io::Result<File> {
    only_regular(&fs::metadata(path)?)?;
    let file = File::open(path)?;
    only_regular(&file.metadata()?)?;
    Ok(file)
}

fn only_regular(found: &Metadata) -> io::Result<()> {
    if found.is_file() {
        return Ok(());
    }
    let what = if found.is_dir() { "a folder" } else { "a pipe, a socket or a device" };
    Err(io::Error::new(io::ErrorKind::InvalidInput, format!("it is {what}, expected a regular file")))
}

/// Reads a file of at most `limit` bytes, opened as [`open_regular_file`] does.
///
/// # Errors
/// As [`open_regular_file`]; [`io::ErrorKind::FileTooLarge`] for a file that is longer than `limit`.
pub fn read_regular_file(path: &Path, limit: u64) -> io::Result<Vec<u8>> {
    let file = open_regular_file(path)?;
    let too_large = |length: u64| {
        let problem = || io::Error::new(io::ErrorKind::FileTooLarge, format!("it is longer than {limit} bytes"));
        if length > limit { Err(problem()) } else { Ok(()) }
    };
    // Before memory is taken; and once more, since it may grow.
    too_large(file.metadata()?.len())?;
    let mut bytes = Vec::new();
    file.take(limit.saturating_add(1)).read_to_end(&mut bytes)?;
    too_large(bytes.len() as u64)?;
    Ok(bytes)
}

/// The same for text. The byte order mark (U+FEFF) with which some programs of Windows begin a file is left out.
///
/// # Errors
/// As [`read_regular_file`]; [`io::ErrorKind::InvalidData`] for bytes that are not UTF-8.
pub fn read_regular_text(path: &Path, limit: u64) -> io::Result<String> {
    let mut text = String::from_utf8(read_regular_file(path, limit)?)
        .map_err(|_| io::Error::new(io::ErrorKind::InvalidData, "it is not UTF-8 text"))?;
    if text.starts_with('\u{feff}') {
        text.drain(..'\u{feff}'.len_utf8());
    }
    Ok(text)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_regular_files_up_to_a_size() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a");
        fs::write(&path, "abc").unwrap();
        assert_eq!(read_regular_text(&path, 3).unwrap(), "abc");
        assert_eq!(read_regular_text(&path, 2).unwrap_err().kind(), io::ErrorKind::FileTooLarge);
        assert_eq!(read_regular_file(folder.path(), 9).unwrap_err().kind(), io::ErrorKind::InvalidInput);
        fs::write(&path, "\u{feff}a\u{feff}").unwrap();
        assert_eq!(read_regular_text(&path, 9).unwrap(), "a\u{feff}");
        fs::write(&path, [0xff]).unwrap();
        assert_eq!(read_regular_text(&path, 3).unwrap_err().kind(), io::ErrorKind::InvalidData);
        #[cfg(target_os = "linux")]
        assert_eq!(read_regular_file(Path::new("/dev/zero"), 9).unwrap_err().kind(), io::ErrorKind::InvalidInput);
    }
}
