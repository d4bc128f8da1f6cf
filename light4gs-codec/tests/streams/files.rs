//! Files.

use crate::common;

use std::{
    fs::{self, File},
    io::{Seek, SeekFrom, Write},
    path::Path,
};

use common::{ENTRY, compression::tiny, forge_header, put, sample, start, table_at, u64_at};
use light4gs_codec::{
    CodecError, Limits, Profile, encode, encode_compressed, info, read_file, read_file_with_limits, read_info,
    read_info_with_limits, read_stream,
};

#[test]
fn a_scene_through_a_file() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scene.l4gs");
    let (scene, bytes) = (sample(), encode(&sample()).unwrap());
    fs::write(&path, &bytes).unwrap();
    assert_eq!(read_file(&path).unwrap(), scene);
    assert_eq!(read_info(&path).unwrap().bytes, bytes.len() as u64);
    assert!(matches!(read_file(&folder.path().join("missing")), Err(CodecError::Io { .. })));
    assert!(read_file(folder.path()).unwrap_err().to_string().contains("it is a folder"));
}

/// Opening a pipe would wait for its writer, and a device may never end.
#[cfg(target_os = "linux")]
#[test]
fn only_regular_files_are_opened() {
    let folder = tempfile::tempdir().unwrap();
    let pipe = folder.path().join("pipe.l4gs");
    assert!(std::process::Command::new("mkfifo").arg(&pipe).status().unwrap().success());
    for path in [pipe.as_path(), "/dev/zero".as_ref()] {
        for error in [read_file(path).unwrap_err(), read_info(path).unwrap_err()] {
            assert!(error.to_string().contains("it is a pipe, a socket or a device"), "{error}");
            assert!(!error.is_internal());
        }
    }
}

/// A file is described by the beginnings of its sections as it is by all of its bytes.
#[test]
fn a_description_of_a_file_is_that_of_its_bytes() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scene.l4gs");
    let (scene, input) = tiny(Profile::Compact);
    for bytes in [encode(&sample()).unwrap(), encode_compressed(&scene, &input).unwrap().bytes] {
        fs::write(&path, &bytes).unwrap();
        let expected = info(&bytes).unwrap();
        assert_eq!(read_info(&path).unwrap(), expected);
        assert_eq!(read_stream(&path, &Limits::default()).unwrap(), (bytes.clone(), expected));
        for at in (0..bytes.len()).step_by(7) {
            let mut damaged = bytes.clone();
            damaged[at] ^= 4;
            fs::write(&path, &damaged).unwrap();
            assert!(read_info(&path).is_err() && read_stream(&path, &Limits::default()).is_err(), "at {at}");
        }
    }
}

/// Writes the sample with zeros behind a section, which take no room on the disk. Table and header say so.
fn write_stretched(path: &Path, section: usize, zeros: u64) {
    let mut bytes = encode(&sample()).unwrap();
    let end = if section == 4 { bytes.len() } else { start(&bytes, section + 1) };
    let at = table_at(&bytes) + ENTRY * section + 8;
    let length = u64_at(&bytes, at) + zeros;
    put(&mut bytes, at, &length.to_le_bytes());
    let whole = bytes.len() as u64 + zeros;
    put(&mut bytes, 20, &whole.to_le_bytes());
    forge_header(&mut bytes);
    let mut file = File::create(path).unwrap();
    file.write_all(&bytes[..end]).unwrap();
    file.seek(SeekFrom::Current(zeros as i64)).unwrap();
    file.write_all(&bytes[end..]).unwrap();
    file.set_len(whole).unwrap();
}

/// Such a file takes no time and no memory: reading it would take minutes, and more memory than there is.
#[cfg(unix)]
#[test]
fn a_file_whose_length_is_a_promise_is_not_read() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scene.l4gs");
    let large = Limits::large();
    for section in 0..5 {
        write_stretched(&path, section, 1 << 36);
        for error in [read_file(&path).unwrap_err(), read_info(&path).unwrap_err()] {
            assert!(error.to_string().contains("length of the stream is 687"), "{error}");
        }
        write_stretched(&path, section, 1 << 35);
        let refused = [
            read_file_with_limits(&path, &large).map(|_| ()),
            read_info_with_limits(&path, &large).map(|_| ()),
            read_stream(&path, &large).map(|_| ()),
        ];
        for refused in refused {
            let error = refused.unwrap_err().to_string();
            assert!(error.contains("scene.l4gs") && error.contains("length of the section is 3"), "{error}");
        }
    }
    // The header is right, and the file is not as long; or it is longer.
    let bytes = encode(&sample()).unwrap();
    fs::write(&path, &bytes).unwrap();
    File::options().write(true).open(&path).unwrap().set_len(1 << 40).unwrap();
    let error = read_file_with_limits(&path, &large).unwrap_err();
    assert!(matches!(error.kind(), "trailing-bytes"), "{error}");
    write_stretched(&path, 4, 1 << 35);
    File::options().write(true).open(&path).unwrap().set_len(1 << 20).unwrap();
    let error = read_info_with_limits(&path, &large).unwrap_err();
    assert!(matches!(error.kind(), "truncated"), "{error}");
}

#[test]
fn messages_name_the_file() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scene.l4gs");
    assert!(read_file(&path).unwrap_err().to_string().contains("cannot read"));

    let mut bytes = encode(&sample()).unwrap();
    bytes.push(0);
    fs::write(&path, &bytes).unwrap();
    let error = read_info(&path).unwrap_err();
    assert!(error.to_string().contains("scene.l4gs: stream: 1 bytes too many"), "{error}");

    fs::write(&path, &bytes[..bytes.len() - 2]).unwrap();
    assert!(read_file(&path).unwrap_err().to_string().contains("cut short"));
    fs::write(&path, "ply\n").unwrap();
    assert!(read_file(&path).unwrap_err().to_string().contains("not a .l4gs stream"));
}
