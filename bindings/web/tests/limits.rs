//! The player's scripts and its decoder take files of the same length.

#[test]
fn the_scripts_have_the_limit_of_the_decoder() {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/player/bytes/sources.js");
    let sources = std::fs::read_to_string(path).expect("the player's sources");
    assert!(
        light4gs_web::MOST_BYTES.is_power_of_two() && light4gs_web::limits().file_bytes == light4gs_web::MOST_BYTES
    );
    let line = format!("export const MOST_BYTES = 2 ** {};", light4gs_web::MOST_BYTES.ilog2());
    assert!(sources.contains(&line), "{path} lacks `{line}`");
}
