//! Commands on files whose header promises what is not there, and folders with the frames of another time.

use std::fs::{self, File};

use crate::PROGRAM;
use light4gs_tests::program::{Workspace, assert_refused, assert_success};

/// A workspace with the file `scene.l4gs`.
fn with_scene() -> Workspace {
    let w = Workspace::new(PROGRAM);
    let scene = concat!(env!("CARGO_MANIFEST_DIR"), "/../bindings/web/tests/data/quickstart.l4gs");
    fs::copy(scene, w.path("scene.l4gs")).unwrap();
    w
}

/// Read to its end, such a file would take more memory than there is.
#[cfg(unix)]
#[test]
fn a_promised_length_is_not_read() {
    let w = with_scene();
    let scene = fs::read(w.path("scene.l4gs")).unwrap();
    for (length, limits, word) in [
        (1_u64 << 36, "default", "length of the stream is 68719476736, at most 1073741824"),
        (1 << 35, "large", "the whole"),
    ] {
        let mut promise = scene.clone();
        promise[20..28].copy_from_slice(&length.to_le_bytes());
        fs::write(w.path("sparse.l4gs"), &promise).unwrap();
        let file = File::options().write(true).open(w.path("sparse.l4gs")).unwrap();
        // In the second case the file is shorter than it says.
        file.set_len(length.min(1 << 36) - u64::from(limits == "large")).unwrap();
        for command in [
            &["info", "sparse.l4gs", "--limits", limits][..],
            &["decode", "sparse.l4gs", "--out", "x.safetensors", "--limits", limits],
            &["export", "sparse.l4gs", "--out", "frames", "--limits", limits],
            &["render", "sparse.l4gs", "--out", "pictures", "--limits", limits],
        ] {
            assert_refused(&w.run(command.iter().copied()), &["sparse.l4gs", word]);
        }
    }
    assert_refused(&w.run(["view", "sparse.l4gs"]), &["sparse.l4gs", "length of the stream is"]);
    assert_refused(&w.run(["export", "sparse.l4gs", "--html", "x.html"]), &["sparse.l4gs", "length of the stream is"]);
}

#[test]
fn a_folder_holds_the_frames_of_one_sequence() {
    let w = with_scene();
    let export = |frames: &str| w.run(["export", "scene.l4gs", "--out", "frames", "--frames", frames]);
    let render =
        |frames: &str| w.run(["render", "scene.l4gs", "--out", "pictures", "--width", "16", "--frames", frames]);
    assert_success(&export("10"));
    assert_success(&render("4"));
    fs::write(w.path("frames/notes.txt"), "mine").unwrap();
    assert_refused(&export("3"), &["frames", "0003.ply to 0009.ply", "7 numbered files", "remove them"]);
    assert_refused(&render("3"), &["pictures", "0003.png", "remove them"]);
    assert_eq!(w.names("frames").len(), 11);
    assert_success(&export("10"));
    assert_success(&render("5"));
    (3..10).for_each(|frame| fs::remove_file(w.path(&format!("frames/{frame:04}.ply"))).unwrap());
    assert_success(&export("3"));
    assert_eq!(w.names("frames"), ["0000.ply", "0001.ply", "0002.ply", "notes.txt"]);
}
