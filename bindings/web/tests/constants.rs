//! The player's `constants.js` has the program's constants of rendering.

use light4gs_codec::rendering::{DILATION, FRUSTUM_MARGIN, MAX_ALPHA, MIN_ALPHA, NEAR};
use light4gs_web::{ENTRY, ROW};

/// `LIGHT4GS_WRITE=1` writes the file anew.
#[test]
fn the_player_has_the_constants_of_rendering() {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/player/drawing/constants.js");
    let mut text = "// Constants of rendering and of the draw list, from light4gs-codec/src/rendering.rs and src/draw_list.rs.\n\
         // Written by tests/constants.rs: LIGHT4GS_WRITE=1 cargo test --release --package light4gs-web --test constants\n"
        .to_owned();
    for (name, value, meaning) in [
        ("NEAR", NEAR, "What lies nearer along the view axis is not drawn, world units."),
        ("DILATION", DILATION, "Variance that every projected Gaussian gets on top, square pixels."),
        (
            "FRUSTUM_MARGIN",
            FRUSTUM_MARGIN,
            "The Jacobian is taken no further from the middle of the image, half images.",
        ),
        ("MIN_ALPHA", MIN_ALPHA, "A contribution with less alpha is skipped."),
        ("MAX_ALPHA", MAX_ALPHA, "Alpha is clamped here."),
    ] {
        // The shortest number that is the same float32.
        text += &format!("\n/** {meaning} */\nexport const {name} = {value:?};\n");
    }
    for (name, value, meaning) in [
        ("ENTRY", ENTRY, "Numbers of a Gaussian in a draw list, four to a texel."),
        ("ROW", ROW, "Gaussians of a texture's row."),
    ] {
        text += &format!("\n/** {meaning} */\nexport const {name} = {value};\n");
    }
    if std::env::var_os("LIGHT4GS_WRITE").is_some() {
        std::fs::write(path, &text).expect("the file can be written");
    }
    let found = std::fs::read_to_string(path).expect("the player has constants");
    assert_eq!(found, text, "{path} is stale; write it with LIGHT4GS_WRITE=1");
}
