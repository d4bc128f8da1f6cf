//! Feature planes other than a hexplane: other axes, different axes at each scale, sizes that differ along a common
//! axis.

use super::common;
use super::common::compression::{
    ALL_PARTS, ShKind, compact_shape, input, model, plane_coding, scene, sh_networks, step, with_planes,
};
use super::common::{planes, sample, with_payload};
use light4gs_codec::{
    CodecError, CompressionInput, FeaturePlaneArrays, Limits, Plane, Profile, SceneData, decode, decode_with_limits,
    encode, encode_compressed, info,
    plane_layout::PlaneAxes::{self, Xt, Xy, Xz, Yt, Yz, Zt},
};
use proptest::prelude::*;

const CHANNELS: u32 = 4;

/// One plane, without values yet.
fn plane(scale: u32, axes: PlaneAxes, [width, height]: [u32; 2]) -> Plane {
    Plane { scale, axes, height, width, values: vec![0.0; (CHANNELS * width * height) as usize] }
}

/// Sets of planes that a field may have.
pub(crate) fn sets() -> Vec<(&'static str, FeaturePlaneArrays)> {
    let of = |axes: &[PlaneAxes], multipliers: &[u32]| planes(axes, CHANNELS, [8, 12, 4, 16], multipliers);
    let list = |planes: Vec<Plane>| FeaturePlaneArrays { channels: CHANNELS, planes };
    vec![
        ("tri-plane", of(&PlaneAxes::SPACE_ONLY, &[1, 2])),
        ("space-time planes", of(&PlaneAxes::SPACE_TIME, &[1, 2])),
        ("one space-time plane", of(&[Yt], &[1])),
        ("one plane over space", of(&[Xz], &[1, 2, 4])),
        ("half a hexplane", of(&[Xy, Xt, Yt], &[1, 2])),
        (
            "other planes at each scale",
            list(vec![
                plane(0, Xy, [8, 12]),
                plane(0, Xt, [8, 4]),
                plane(0, Yt, [12, 4]),
                plane(1, Xz, [16, 8]),
                plane(1, Zt, [8, 8]),
                plane(2, Xy, [32, 16]),
                plane(2, Xz, [32, 4]),
            ]),
        ),
        (
            "sizes of their own",
            list(vec![
                plane(0, Xy, [8, 12]),
                plane(0, Xt, [4, 8]),
                plane(0, Yz, [8, 8]),
                plane(0, Yt, [12, 4]),
                plane(1, Xy, [24, 4]),
                plane(1, Xt, [24, 8]),
            ]),
        ),
    ]
}

pub(crate) fn scene_of(planes: FeaturePlaneArrays) -> SceneData {
    with_planes(scene(5, 2, CHANNELS, [4; 4], &[1]), planes)
}

#[test]
fn any_set_of_planes_round_trips() {
    for (name, planes) in sets() {
        let scene = scene_of(planes);
        let bytes = encode(&scene).unwrap();
        let decoded = decode(&bytes).unwrap();
        assert_eq!(decoded, scene, "{name}");
        assert_eq!(encode(&decoded).unwrap(), bytes, "{name}");
        assert_eq!(info(&bytes).unwrap().planes, scene.feature_planes.layout().unwrap(), "{name}");
    }
}

#[test]
fn any_set_of_planes_is_coded_under_a_context_model() {
    for (name, planes) in sets() {
        let scene = scene_of(planes);
        for profile in [Profile::Compact, Profile::Paper] {
            let features = scene.feature_planes.features() as usize;
            let input = CompressionInput {
                sh: sh_networks(ShKind::HexPlaneCoupled, 2, features),
                ..input(&scene, profile, compact_shape(CHANNELS, ALL_PARTS))
            };
            let encoded = encode_compressed(&scene, &input).unwrap();
            assert_eq!(decode(&encoded.bytes).unwrap(), encoded.decoded, "{name}");
            let pairs = scene.feature_planes.planes.iter().zip(&encoded.decoded.feature_planes.planes);
            for (index, (given, decoded)) in pairs.enumerate() {
                assert_eq!(given.shape(), decoded.shape(), "{name}");
                let errors = given.values.iter().zip(&decoded.values).map(|(a, b)| (a - b).abs());
                assert!(errors.fold(0.0, f32::max) <= 0.0501, "{name}, plane {}", given.shape().name());
                // A latent for planes that no other part of the model predicts.
                let layout = scene.feature_planes.layout().unwrap();
                let alone = layout.one_scale_below(index).is_none() && layout.over_time(index).is_none();
                assert_eq!(encoded.info.plane_bytes[index].latent > 0, alone, "{name}, plane {}", given.shape().name());
            }
            let info = info(&encoded.bytes).unwrap();
            assert_eq!(info.planes, scene.feature_planes.layout().unwrap(), "{name}");
            assert_eq!(info, encoded.info, "{name}");
        }
    }
}

/// A feature is the product of exactly those planes that exist.
#[test]
fn motion_reads_the_planes_that_are_there() {
    let moved = |planes: FeaturePlaneArrays| {
        let mut scene = scene_of(planes);
        // The same network and Gaussians for all.
        scene.motion = common::motion(CHANNELS);
        scene.feature_planes.planes.iter_mut().for_each(|plane| {
            let value = |index: usize| 1.0 + 0.01 * (plane.axes as usize * 7 + index) as f32;
            plane.values = (0..plane.values.len()).map(value).collect();
        });
        scene
    };
    let all = moved(planes(&PlaneAxes::ALL, CHANNELS, [4, 8, 4, 8], &[1]));
    for axes in [&PlaneAxes::SPACE_ONLY[..], &PlaneAxes::SPACE_TIME, &[Xy, Zt], &[Xt, Zt], &[Yt]] {
        let some = moved(planes(axes, CHANNELS, [4, 8, 4, 8], &[1]));
        let mut ones = all.clone();
        for plane in &mut ones.feature_planes.planes {
            if !axes.contains(&plane.axes) {
                plane.values.fill(1.0);
            }
        }
        for time in [0.0, 0.4, 1.0] {
            let (found, expected) = (some.positions_at(time).unwrap(), ones.positions_at(time).unwrap());
            for (a, b) in found.as_flattened().iter().zip(expected.as_flattened()) {
                assert!((a - b).abs() <= 1e-5 * b.abs().max(1.0), "{axes:?}: {a} against {b}");
            }
        }
    }
}

/// Hostile bytes in the list of planes.
#[test]
fn lists_of_planes_that_lie() {
    // Channels, 2 scales, which planes there are, cells along x, y, z, t.
    let head = [1, 2, 0b11_1111, 2, 1, 1, 3, 0b11_1111, 4, 2, 2, 3];
    let bytes = encode(&sample()).unwrap();
    let values = &common::payload(&bytes, 4)[head.len()..];
    let refuse = |head: &[u8]| {
        let forged = with_payload(&bytes, 4, &[head, values].concat());
        assert!(info(&forged).is_err() || decode(&forged).is_err());
        decode(&forged).unwrap_err()
    };
    let spoilt = |at: usize, value: u8| {
        let mut head = head;
        head[at] = value;
        refuse(&head)
    };
    let no_bits = spoilt(2, 0).to_string();
    assert!(no_bits.contains("planes of scale 0 is 0b00000000, expected a bit for each of xy"), "{no_bits}");
    assert!(spoilt(7, 0b1011_1111).to_string().contains("planes of scale 1"));
    // Planes with sizes of their own must not agree: that has another encoding.
    let own = [1, 1, 0b100_0011, 2, 1, 2, 1];
    assert!(refuse(&own).to_string().contains("sizes of scale 0 is one for each plane"));
    // One size differs: then there are too many bytes of values.
    let own = [1, 1, 0b100_0011, 2, 1, 1, 1];
    assert!(matches!(refuse(&own), CodecError::TrailingBytes { section: "feature_planes", .. }));
    assert!(matches!(spoilt(1, 17), CodecError::OverLimit { limit: 16, .. }));
    assert!(spoilt(6, 0).to_string().contains("height of plane 0.xt is 0"));
    // Fewer planes than there are values for, and more.
    assert!(matches!(spoilt(2, 0b01_1111), CodecError::Invalid { .. } | CodecError::TrailingBytes { .. }));
    assert!(matches!(refuse(&[1, 2, 0b11_1111, 3, 2, 2, 3, 0b11_1111, 4, 2, 2, 3]), CodecError::Truncated { .. }));
    // Sixteen scales of the largest planes, without their bytes: nothing is allocated for them.
    let large: Vec<u8> = (0..16).flat_map(|_| [&[0b11_1111][..], &[0x80, 0x80, 0x04].repeat(4)].concat()).collect();
    let error = refuse(&[&[1, 16][..], &large].concat());
    assert!(matches!(error, CodecError::Truncated { .. }), "{error}");
}

/// A model that was made for other planes is refused.
#[test]
fn models_of_other_planes_are_refused() {
    let hexplane = planes(&PlaneAxes::ALL, CHANNELS, [8, 8, 8, 4], &[1, 2]);
    let message = |planes: FeaturePlaneArrays, change: &dyn Fn(&mut CompressionInput)| {
        let scene = scene_of(planes);
        let mut input = input(&scene, Profile::Paper, compact_shape(CHANNELS, ALL_PARTS));
        change(&mut input);
        encode_compressed(&scene, &input).unwrap_err().to_string()
    };
    let of_hexplane = model(compact_shape(CHANNELS, ALL_PARTS), &hexplane, 3);
    let coding = |planes: &FeaturePlaneArrays, priors: &[u32]| {
        let mut model = of_hexplane.clone();
        model.plane_priors = priors.to_vec();
        plane_coding(planes, model, step(0.1))
    };
    let triplane = planes(&PlaneAxes::SPACE_ONLY, CHANNELS, [8, 8, 8, 4], &[1, 2]);
    let priors = &of_hexplane.plane_priors;
    let of_space = [0, 1, 3, 6, 7, 9].map(|plane| priors[plane]);
    let found = message(triplane.clone(), &|input| input.planes = Some(coding(&triplane, priors)));
    assert!(found.contains("number of planes with a prior is 12, expected 6"), "{found}");
    let found = message(triplane.clone(), &|input| input.planes = Some(coding(&triplane, &of_space)));
    assert!(found.contains("a source of plane 0.xy is xt"), "{found}");
    // A plane at the upper scale without one below.
    let mut planes = hexplane.clone();
    planes.planes.remove(5);
    let mut some = priors.clone();
    some.remove(5);
    let found = message(planes.clone(), &|input| input.planes = Some(coding(&planes, &some)));
    assert!(found.contains("a source of plane 0.xz is zt"), "{found}");
    let single = planes.planes.split_off(5);
    let single: Vec<Plane> = single.into_iter().map(|plane| Plane { scale: 0, ..plane }).collect();
    let planes = FeaturePlaneArrays { channels: CHANNELS, planes: single };
    let found = message(planes.clone(), &|input| input.planes = Some(coding(&planes, &priors[6..])));
    assert!(found.contains("a source of plane 0.xy is the scale below"), "{found}");
}

prop_compose! {
    /// Any legal list of planes.
    fn lists()(
        bits in prop::collection::vec(1u8..64, 1..4),
        cells in prop::array::uniform4(1u32..4),
        own in any::<bool>(),
        other in prop::collection::vec(1u32..4, 36),
    ) -> FeaturePlaneArrays {
        let mut planes = Vec::new();
        for (scale, bits) in bits.into_iter().enumerate() {
            for axes in PlaneAxes::ALL.into_iter().filter(|axes| bits >> *axes as u8 & 1 == 1) {
                let [a, b] = axes.axes();
                let side = |axis: usize, at: usize| 4 * if own { other[at] } else { cells[axis] };
                let at = 2 * planes.len();
                planes.push(plane(scale as u32, axes, [side(a, at), side(b, at + 1)]));
            }
        }
        FeaturePlaneArrays { channels: CHANNELS, planes }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]
    #[test]
    fn every_legal_list(planes in lists(), cut in any::<prop::sample::Index>()) {
        let scene = scene_of(planes);
        let bytes = encode(&scene).unwrap();
        prop_assert_eq!(&decode(&bytes).unwrap(), &scene);
        let coded = encode_compressed(&scene, &input(&scene, Profile::Compact, compact_shape(CHANNELS, ALL_PARTS)));
        let coded = coded.unwrap();
        prop_assert_eq!(&decode(&coded.bytes).unwrap(), &coded.decoded);
        // With one changed bit in the head, the stream is refused or decodes; it never panics.
        let mut payload = common::payload(&coded.bytes, 4).to_vec();
        let bit = cut.index(8 * payload.len().min(32));
        payload[bit / 8] ^= 1 << (bit % 8);
        let limits = Limits { nanoseconds: 20_000_000, ..Limits::default() };
        let _ = decode_with_limits(&with_payload(&coded.bytes, 4, &payload), &limits);
    }
}
