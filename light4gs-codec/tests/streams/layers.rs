//! Layers of Gaussians: files that are shown while they come.

use crate::common;

use common::{
    compression::{ALL_PARTS, ShKind, compact_shape, input, scene, sh_networks, sh_tables, tiny},
    sample,
};
use light4gs_codec::{
    CodecError, CompressionInput, Demand, GaussianArrays, GaussianLayers, Limits, Profile, SceneData, SectionInfo,
    ShCoding, StreamDecoder, decode, decode_with_limits, encode, encode_compressed, info,
};
use proptest::prelude::*;

/// Every coding of the harmonics and every profile, in some layers.
fn inputs() -> Vec<(SceneData, CompressionInput)> {
    let scene = scene(37, 2, 4, [8, 4, 4, 4], &[1, 2]);
    let mut all = Vec::new();
    for profile in [Profile::Compact, Profile::Paper] {
        let codings = [
            sh_tables(2),
            sh_networks(ShKind::Everything, 2, 8),
            sh_networks(ShKind::Autoregressive, 2, 8),
            ShCoding::Channels { step: 0.02 },
        ];
        for (sh, count) in codings.into_iter().zip([2, 3, 4, 8]) {
            let layers = GaussianLayers::new(count);
            all.push((
                scene.clone(),
                CompressionInput { sh, layers, ..input(&scene, profile, compact_shape(4, ALL_PARTS)) },
            ));
        }
    }
    let (planeless, others) = all.last().cloned().unwrap();
    let planeless = SceneData { feature_planes: Default::default(), motion: Default::default(), ..planeless };
    all.push((planeless, CompressionInput { planes: None, ..others }));
    all
}

fn streams() -> Vec<Vec<u8>> {
    inputs().iter().map(|(scene, input)| encode_compressed(scene, input).unwrap().bytes).collect()
}

/// All numbers of each Gaussian as bits, sorted.
fn as_a_set(gaussians: &GaussianArrays) -> Vec<Vec<u32>> {
    let one = |index: usize| {
        let rows = gaussians.attributes().flat_map(|row| row.values[index * row.width..][..row.width].to_vec());
        rows.map(f32::to_bits).collect()
    };
    let mut all: Vec<_> = (0..gaussians.len()).map(one).collect();
    all.sort();
    all
}

/// The Gaussians `0..count`.
fn first(gaussians: &GaussianArrays, count: usize) -> GaussianArrays {
    gaussians.gathered(&(0..count as u32).collect::<Vec<_>>())
}

#[test]
fn layers_hold_the_same_gaussians_to_the_bit() {
    for (scene, layered) in inputs() {
        let plain = CompressionInput { layers: GaussianLayers::default(), ..layered.clone() };
        let plain = encode_compressed(&scene, &plain).unwrap().decoded;
        let coded = encode_compressed(&scene, &layered).unwrap();
        assert_eq!(decode(&coded.bytes).unwrap(), coded.decoded);
        assert_eq!(as_a_set(&plain.gaussians), as_a_set(&coded.decoded.gaussians));
        assert_eq!(plain.feature_planes, coded.decoded.feature_planes);
        assert_eq!(plain.motion, coded.decoded.motion);
    }
}

#[test]
fn info_tells_the_bytes_to_the_first_image() {
    for (scene, input) in inputs() {
        let bytes = encode_compressed(&scene, &input).unwrap().bytes;
        let info = info(&bytes).unwrap();
        let sizes: Vec<_> = info.layers.iter().map(|layer| layer.gaussians as usize).collect();
        assert_eq!(sizes, input.layers.sizes(37));
        assert_eq!((info.gaussian_count, info.sh_degree), (37, 2));
        let attributes: u64 = info.attributes.iter().map(|attribute| attribute.bytes).sum();
        let by_name = SectionInfo::bytes_by_name(&info.sections);
        let gaussians = by_name.iter().find(|(name, _)| *name == "gaussians").unwrap().1;
        assert!(attributes < gaussians);
        assert_eq!(by_name.iter().map(|(_, bytes)| bytes).sum::<u64>() + info.header_bytes, info.bytes);

        // These bytes suffice, and one less does not.
        for (index, layer) in info.layers.iter().enumerate() {
            for (missing, decoded) in [(0, index + 1), (1, index)] {
                let mut decoder = StreamDecoder::new();
                decoder.push(&bytes[..layer.bytes_to_show as usize - missing]).unwrap();
                assert_eq!(decoder.decode().unwrap(), decoded);
            }
        }
        assert_eq!(info.bytes_to_first_image(), info.layers[0].bytes_to_show);
        assert!(info.bytes_to_first_image() < info.bytes);
    }
    let plain = encode(&sample()).unwrap();
    assert_eq!(info(&plain).unwrap().bytes_to_first_image(), plain.len() as u64);
}

#[test]
fn each_layer_is_that_of_the_whole() {
    for bytes in streams() {
        let whole = decode(&bytes).unwrap();
        let layers = info(&bytes).unwrap().layers;
        let mut decoder = StreamDecoder::new();
        let mut seen = 0;
        for (at, byte) in bytes.iter().enumerate() {
            decoder.push(&[*byte]).unwrap();
            let decoded = decoder.decode().unwrap();
            assert!(decoded == seen || decoded == seen + 1);
            if decoded == seen {
                continue;
            }
            seen = decoded;
            assert_eq!(layers[decoded - 1].bytes_to_show, at as u64 + 1);
            let count = layers[..decoded].iter().map(|layer| layer.gaussians as usize).sum();
            let expected = SceneData { gaussians: first(&whole.gaussians, count), ..whole.clone() };
            assert_eq!(decoder.scene(), Some(&expected));
        }
        assert_eq!((seen, decoder.layers(), decoder.received()), (layers.len(), Some(seen), bytes.len() as u64));
        assert_eq!(decoder.finish().unwrap(), whole);
    }
}

#[test]
fn layers_may_be_decoded_one_at_a_time() {
    for bytes in streams() {
        let mut decoder = StreamDecoder::new();
        decoder.push(&bytes).unwrap();
        for layer in 0..=decoder.layers().unwrap() {
            assert_eq!(decoder.decode_until(layer).unwrap(), layer);
            assert_eq!(decoder.scene().is_some(), layer > 0);
        }
        assert_eq!(decoder.finish().unwrap(), decode(&bytes).unwrap());
    }
}

#[test]
fn a_given_significance_says_what_comes_first() {
    let (scene, input) = tiny(Profile::Compact);
    let significance = (0..6).map(|index| if index == 4 { 1.0 } else { 0.0 }).collect();
    let layers = GaussianLayers { count: 2, significance: Some(significance) };
    let coded = encode_compressed(&scene, &CompressionInput { layers, ..input.clone() }).unwrap();
    assert_eq!(info(&coded.bytes).unwrap().layers[0].gaussians, 2);
    let label = &coded.decoded.gaussians.further[1];
    assert!(label.values[..2].contains(&scene.gaussians.further[1].values[4]));

    let short = GaussianLayers { count: 2, significance: Some(vec![1.0]) };
    let problem =
        encode_compressed(&scene, &CompressionInput { layers: short, ..input.clone() }).unwrap_err().to_string();
    assert_eq!(problem, "layers: number of significances is 1, expected 6, one for each Gaussian");
    let many = CompressionInput { layers: GaussianLayers::new(9), ..input };
    assert_eq!(encode_compressed(&scene, &many).unwrap_err().to_string(), "layers: count is 9, expected 1 to 8");
}

#[test]
fn a_scene_without_gaussians_has_empty_layers() {
    let scene = SceneData { gaussians: GaussianArrays::default(), ..sample() };
    let scene = SceneData { motion: Default::default(), ..scene };
    let others = input(&tiny(Profile::Compact).0, Profile::Compact, compact_shape(4, ALL_PARTS));
    let layers = GaussianLayers::new(3);
    let input = CompressionInput { planes: None, sh: ShCoding::Channels { step: 0.02 }, layers, ..others };
    let bytes = encode_compressed(&scene, &input).unwrap().bytes;
    assert_eq!(info(&bytes).unwrap().layers.len(), 3);
    assert!(decode(&bytes).unwrap().gaussians.is_empty());
}

/// The error of a decoder that gets these pieces, and the number of bytes before it.
fn refusal(pieces: &[&[u8]]) -> Option<(CodecError, u64)> {
    let mut decoder = StreamDecoder::new();
    let mut pushed = 0;
    for piece in pieces {
        pushed += piece.len() as u64;
        if let Err(error) = decoder.push(piece).and_then(|()| decoder.decode()) {
            assert!(decoder.push(&[]).unwrap_err().to_string().contains("expected a new decoder"));
            assert!(decoder.decode().is_err() && decoder.scene().is_none());
            return Some((error, pushed));
        }
    }
    decoder.finish().err().map(|error| (error, pushed))
}

#[test]
fn damage_is_found_when_its_section_is_complete() {
    for bytes in streams() {
        let info = info(&bytes).unwrap();
        let pieces: Vec<_> = bytes.chunks(1).collect();
        assert!(refusal(&pieces).is_none());
        for section in &info.sections {
            for at in [section.offset, section.offset + section.bytes / 2] {
                let mut damaged = bytes.clone();
                damaged[at as usize] ^= 4;
                let (error, pushed) = refusal(&damaged.chunks(1).collect::<Vec<_>>()).unwrap();
                assert!(matches!(error, CodecError::Checksum { section: name, .. } if name == section.name), "{error}");
                assert_eq!(pushed, section.offset + section.bytes);
            }
        }
        let mut damaged = bytes.clone();
        damaged[33] ^= 1;
        let (error, pushed) = refusal(&damaged.chunks(1).collect::<Vec<_>>()).unwrap();
        assert!(error.to_string().starts_with("header: checksum"), "{error}");
        assert_eq!(pushed, info.header_bytes);
    }
}

#[test]
fn what_is_no_stream_is_refused_at_once() {
    assert!(matches!(refusal(&[b"p", b"ly"]), Some((CodecError::NotL4gs { .. }, 1))));
    let mut newer = encode(&SceneData::default()).unwrap();
    newer[8] = 2;
    assert!(matches!(refusal(&[&newer[..10], &newer[10..]]), Some((CodecError::NewerVersion { found: 2 }, 10))));
    let limits = Limits { file_bytes: 100, ..Limits::default() };
    let mut decoder = StreamDecoder::with_limits(&limits);
    let bytes = encode(&SceneData::default()).unwrap();
    assert!(matches!(decoder.push(&bytes[..32]), Err(CodecError::OverLimit { .. })));
}

#[test]
fn an_end_too_early_or_too_late_is_refused() {
    let bytes = streams().remove(0);
    for length in 0..bytes.len() {
        let (error, _) = refusal(&[&bytes[..length]]).unwrap();
        assert!(matches!(error, CodecError::Truncated { section: "stream", .. }), "at {length}: {error}");
    }
    assert!(matches!(refusal(&[&bytes, &[0]]), Some((CodecError::TrailingBytes { section: "stream", bytes: 1 }, _))));
}

#[test]
fn a_connection_that_is_resumed_elsewhere_is_refused() {
    let bytes = streams().remove(1);
    for cut in (0..bytes.len()).step_by(97) {
        for resumed in (0..bytes.len()).step_by(131) {
            let refused = refusal(&[&bytes[..cut], &bytes[resumed..]]).is_some();
            assert_eq!(refused, cut != resumed, "cut at {cut}, resumed at {resumed}");
        }
    }
}

/// The first bytes alone do not allow the time that their contents take, but all bytes do.
#[test]
fn what_only_the_whole_may_ask_for_waits_for_the_whole() {
    let limits = Limits { nanoseconds: 0, ..Limits::default() };
    let mut waited = 0;
    for (scene, input) in inputs() {
        let coded = encode_compressed(&scene, &input).unwrap();
        let mut decoder = StreamDecoder::with_limits(&limits);
        let mut decoded = Vec::new();
        for piece in coded.bytes.chunks(50) {
            decoder.push(piece).unwrap();
            decoded.push(decoder.decode().map_err(drop));
        }
        let last = decoded.pop().unwrap();
        assert!(decoded.iter().all(|answer| answer.is_ok()), "an error before the whole was there");
        assert_eq!(last.is_ok(), decode_with_limits(&coded.bytes, &limits).is_ok());
        if last.is_ok() {
            waited += usize::from(decoded.iter().all(|&answer| answer == Ok(0)));
            assert_eq!(decoder.finish().unwrap(), coded.decoded);
        }
    }
    assert!(waited > 0);
}

#[test]
fn demand_is_that_of_the_whole() {
    for (scene, input) in inputs() {
        let coded = encode_compressed(&scene, &input).unwrap();
        let Demand { memory_bytes, nanoseconds } = coded.verify(&Limits::large()).unwrap();
        let answer = |memory_bytes, nanoseconds| {
            let limits = Limits { memory_bytes, nanoseconds, ..Limits::default() };
            let mut decoder = StreamDecoder::with_limits(&limits);
            let pieces = coded.bytes.chunks(1000);
            let answer = pieces.map(|piece| decoder.push(piece).and_then(|()| decoder.decode())).last().unwrap();
            assert_eq!(answer.is_ok(), decode_with_limits(&coded.bytes, &limits).is_ok());
            answer.is_ok()
        };
        assert!(answer(memory_bytes, nanoseconds));
        assert!(!answer(memory_bytes - 1, nanoseconds));
        let may_always = 400 * coded.bytes.len() as u64;
        assert!(!answer(memory_bytes, nanoseconds - 1) || may_always >= nanoseconds);
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(60))]

    #[test]
    fn any_pieces_give_the_same(which in 0..9_usize, cuts in prop::collection::vec((0.0..1.0_f64, any::<bool>()), 0..20)) {
        let (scene, input) = inputs().swap_remove(which);
        let coded = encode_compressed(&scene, &input).unwrap();
        let mut cuts: Vec<_> =
            cuts.into_iter().map(|(share, now)| ((share * coded.bytes.len() as f64) as usize, now)).collect();
        cuts.sort_unstable();
        let mut decoder = StreamDecoder::new();
        let mut begin = 0;
        for (end, now) in cuts {
            decoder.push(&coded.bytes[begin..end]).unwrap();
            begin = end;
            if now {
                let decoded = decoder.decode().unwrap();
                let counts = input.layers.sizes(scene.gaussians.len());
                let count = decoder.scene().map_or(0, |scene| scene.gaussians.len());
                prop_assert_eq!(counts[..decoded].iter().sum::<usize>(), count);
                prop_assert!(decoder.scene().is_none_or(|scene| scene.gaussians == first(&coded.decoded.gaussians, count)));
            }
        }
        decoder.push(&coded.bytes[begin..]).unwrap();
        prop_assert_eq!(decoder.finish().unwrap(), coded.decoded);
    }
}
