//! `export --site`: folders for a static server.

use std::fs;

use crate::PROGRAM;
use light4gs_tests::program::{Workspace, assert_refused, assert_success};

#[test]
fn a_site_has_all_that_a_static_server_needs() {
    let w = Workspace::new(PROGRAM);
    let scene = concat!(env!("CARGO_MANIFEST_DIR"), "/../bindings/web/tests/data/quickstart.l4gs");
    fs::copy(scene, w.path("scene.l4gs")).unwrap();
    let export = |more: &[&str]| w.command(["export", "scene.l4gs", "--site", "site"]).args(more).output().unwrap();
    assert_success(&export(&[]));
    let page = || fs::read_to_string(w.path("site/index.html")).unwrap();
    // Relative addresses: the folder works wherever it is put.
    for part in
        ["src=\"scene.l4gs\"", "cameras=\"cameras.json\"", "src=\"light4gs-player.js\"", "content=\"preview.jpg\""]
    {
        assert!(page().contains(part), "{part}");
    }
    assert!(fs::read(w.path("site/scene.l4gs")).unwrap() == fs::read(scene).unwrap());
    let picture = fs::read(w.path("site/preview.jpg")).unwrap();
    let picture = image::load_from_memory_with_format(&picture, image::ImageFormat::Jpeg).unwrap();
    assert_eq!([picture.width(), picture.height()], [800, 600]);

    assert_success(&export(&["--url", "https://example.org/balls/"]));
    assert!(page().contains("content=\"https://example.org/balls/preview.jpg\""));
    assert_success(&export(&["--title", "Two balls & a tree"]));
    assert!(page().contains("<title>Two balls &amp; a tree"), "{}", page());
    fs::write(w.path("site/thesis.tex"), "").unwrap();
    assert_refused(&export(&[]), &["site holds other files", "thesis.tex"]);
    assert_refused(&w.command(["export", ".", "--site", "x", "--out", "y"]).output().unwrap(), &["--site", "--out"]);
    fs::create_dir(w.path("empty")).unwrap();
    let none = w.command(["export", "empty", "--site", "x"]).output().unwrap();
    assert_refused(&none, &["neither scene.l4gs nor take.l4gs"]);
    assert!(!w.path("x").exists());
}
