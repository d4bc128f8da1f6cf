//! Files: whole, or not at all.

mod common;

use std::{fs, path::Path};

use common::sample;
use light4gs_codec::{CodecError, encode, read_file, read_info, write_atomically, write_file};

fn names(folder: &Path) -> Vec<String> {
    let mut names: Vec<_> =
        fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}

#[test]
fn a_scene_through_a_file() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scene.l4gs");
    fs::write(&path, "an older file").unwrap();
    let scene = sample();
    let bytes = write_file(&path, &scene).unwrap();
    assert_eq!(bytes, fs::metadata(&path).unwrap().len());
    assert_eq!(fs::read(&path).unwrap(), encode(&scene).unwrap());
    assert_eq!(read_file(&path).unwrap(), scene);
    assert_eq!(read_info(&path).unwrap().bytes, bytes);
    assert_eq!(names(folder.path()), ["scene.l4gs"]);
}

#[test]
fn a_failure_leaves_nothing_and_keeps_the_old() {
    let folder = tempfile::tempdir().unwrap();
    let scene = sample();

    let error = write_file(&folder.path().join("missing/scene.l4gs"), &scene).unwrap_err();
    assert!(matches!(error, CodecError::Io { .. }));
    assert!(error.to_string().contains("missing"), "{error}");

    let target = folder.path().join("a-folder");
    fs::create_dir(&target).unwrap();
    assert!(write_file(&target, &scene).unwrap_err().to_string().contains("it is a folder"));
    assert!(read_file(&target).unwrap_err().to_string().contains("it is a folder"));

    let path = folder.path().join("scene.l4gs");
    fs::write(&path, "the old content").unwrap();
    let mut spoilt = sample();
    spoilt.meta.fps = f32::NAN;
    assert!(write_file(&path, &spoilt).is_err());
    assert_eq!(fs::read(&path).unwrap(), b"the old content");

    assert_eq!(names(folder.path()), ["a-folder", "scene.l4gs"]);
    assert_eq!(names(&target), [""; 0]);
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

#[test]
fn a_name_without_a_folder_is_in_the_current_one() {
    let name = format!("target-of-a-test-{}.tmp", std::process::id());
    write_atomically(Path::new(&name), b"x").unwrap();
    assert_eq!(fs::read(&name).unwrap(), b"x");
    fs::remove_file(&name).unwrap();
}

#[cfg(unix)]
#[test]
fn a_new_file_has_the_permissions_of_any_new_file() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("plain"), "").unwrap();
    write_atomically(&folder.path().join("atomic"), b"").unwrap();
    let permissions = |name| fs::metadata(folder.path().join(name)).unwrap().permissions();
    assert_eq!(permissions("atomic"), permissions("plain"));
}
