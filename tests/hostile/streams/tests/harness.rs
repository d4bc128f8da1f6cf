//! Tests of the harness itself.

use light4gs_codec::{SceneData, decode, encode};
use light4gs_hostile::{
    Inputs,
    parts::Parts,
    takes::{Answer, Takes, record},
    watch::Decoder,
};

#[test]
fn taking_apart_and_assembling_changes_nothing() {
    let bytes = encode(&SceneData::default()).unwrap();
    assert_eq!(Parts::of(&bytes).assemble(), bytes);
}

#[test]
fn repaired_checksums_are_accepted() {
    let bytes = encode(&SceneData::default()).unwrap();
    let mut parts = Parts::of(&bytes);
    parts.meta[4..8].copy_from_slice(&77u32.to_le_bytes());
    assert_eq!(decode(&parts.assemble()).unwrap().meta.frame_count, 77);
}

#[test]
fn inputs_follow_from_seed_and_number() {
    let (one, other) = (Inputs::new(3), Inputs::new(3));
    for number in [0, 7, 1000] {
        assert_eq!(one.input(number), other.input(number));
    }
}

#[test]
fn takes_follow_from_seed_and_number() {
    let (one, other) = (Takes::new(3), Takes::new(3));
    for number in [0, 7, 1000] {
        assert_eq!(one.take(number), other.take(number));
    }
}

#[test]
fn another_picture_is_a_fault() {
    let (takes, decoder) = (Takes::new(1), Decoder::on_this_thread());
    let whole = takes.whole(&decoder);
    let take = takes.sound(1);
    assert!(takes.run(&take, &whole, &decoder).outcome.fault().is_none());
    let mut answers = whole[1].clone();
    answers[0] = Answer::Refused("checksum".into());
    assert_eq!(takes.fault(&take, &answers, &whole[1]), None);
    for wrong in [whole[1][1].clone(), whole[2][0].clone(), Answer::Large] {
        answers[0] = wrong;
        assert_eq!(takes.fault(&take, &answers, &whole[1]), Some("wrong picture"));
    }
    answers.pop();
    assert_eq!(takes.fault(&take, &answers, &whole[1]), Some("wrong picture"));
    // Only a row that was erased excuses the base alone.
    let alone = vec![whole[1].last().expect("a time after the last segment").clone(); whole[1].len()];
    assert_eq!(takes.fault(&take, &alone, &whole[1]), Some("wrong picture"));
    let mut erased = take;
    erased.bytes[128..256].fill(0);
    assert_eq!(takes.fault(&erased, &alone, &whole[1]), None);
    // A take whose whole front is another's is that one.
    let mut other = takes.sound(3);
    other.sound = 1;
    assert_eq!(takes.fault(&other, &whole[3], &whole[1]), None);
}

#[test]
fn a_record_is_a_line_and_the_file() {
    let (takes, decoder) = (Takes::new(1), Decoder::on_this_thread());
    let take = takes.sound(3);
    let bytes = record(7, &take, &takes.whole(&decoder)[3]);
    let line = bytes.iter().position(|&byte| byte == b'\n').expect("a line");
    assert!(bytes[line + 1..] == take.bytes);
    let line = String::from_utf8_lossy(&bytes[..line]);
    let expected = "{\"number\":7,\"kind\":\"sound\",\"sound\":3,\"forged\":false,\"bomb\":false,\"bytes\":505,\"asked\":[[0.0,\"shown\",0,0]],\"drawn\":[[]]}";
    assert_eq!(line, expected);
}
