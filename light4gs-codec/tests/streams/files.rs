//! Files.

use crate::common;

use std::fs;

use common::sample;
use light4gs_codec::{CodecError, encode, read_file, read_info};

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
