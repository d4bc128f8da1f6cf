//! The player's scripts and its decoder take the same files.

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

#[test]
fn the_scripts_know_a_take() {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/player/take/magic.js");
    let script = std::fs::read_to_string(path).expect("the player's sources");
    let list = script.split_once("MAGIC = [").and_then(|(_, rest)| rest.split_once(']')).expect("a list").0;
    let byte = |text: &str| u8::from_str_radix(text.trim().trim_start_matches("0x"), 16).expect("a byte");
    let magic: Vec<u8> = list.split(',').map(byte).collect();
    assert!(magic.len() == 8 && light4gs_codec::take::is_take(&magic), "{magic:02x?}");
}
