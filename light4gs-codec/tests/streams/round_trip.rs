//! A decoded scene is the given one, to the last bit.

use crate::common;

use common::{gaussians, hexplane, motion, sample};
use light4gs_codec::{CoordinateMapping, MotionArrays, Plane, SceneData, SceneMeta, decode, encode, info};
use proptest::{collection::btree_map, prelude::*};

#[test]
fn an_empty_scene() {
    let scene = SceneData::default();
    let bytes = encode(&scene).unwrap();
    assert_eq!(decode(&bytes).unwrap(), scene);
    assert_eq!(info(&bytes).unwrap().gaussian_count, 0);
}

#[test]
fn the_sign_of_zero_and_the_smallest_numbers_survive() {
    let mut scene = sample();
    let odd = [-0.0, f32::from_bits(1), f32::MAX];
    scene.gaussians.means[1] = odd;
    let decoded = decode(&encode(&scene).unwrap()).unwrap();
    assert_eq!(decoded.gaussians.means[1].map(f32::to_bits), odd.map(f32::to_bits));
}

#[test]
fn time_may_be_multiplied() {
    let mut scene = sample();
    let multiplied = hexplane(1, [4, 2, 2, 6], &[1]).planes.into_iter().map(|plane| Plane { scale: 1, ..plane });
    scene.feature_planes.planes.splice(6.., multiplied);
    assert_eq!(decode(&encode(&scene).unwrap()).unwrap(), scene);
}

#[test]
fn info_tells_what_is_inside() {
    let scene = sample();
    let bytes = encode(&scene).unwrap();
    let info = info(&bytes).unwrap();
    assert_eq!(info.meta, scene.meta);
    assert_eq!((info.version, info.flags, info.bytes), (1, 0, bytes.len() as u64));
    assert_eq!((info.gaussian_count, info.sh_degree), (2, 1));
    assert_eq!((info.plane_channels, &info.planes), (1, &scene.feature_planes.layout().unwrap()));
    assert_eq!((info.planes.len(), info.planes.planes()[11].name()), (12, "1.zt".to_owned()));
    let network = info.motion.network.unwrap();
    assert!(network.network.has_structure_of(&scene.motion.network.unwrap().network));
    assert_eq!((&info.motion.kind[..], &info.motion.tensors[0].shape[..]), ("test-field", &[2, 3][..]));
    assert_eq!(info.profile, None);
    let names: Vec<_> = info.sections.iter().map(|section| section.name).collect();
    assert_eq!(names, ["gaussians", "sh", "scene_coordinates", "motion", "feature_planes"]);
    assert!(info.sections.iter().all(|section| section.encoding.name() == "float32"));
    let kinds: Vec<_> = info.sections.iter().map(|section| section.kind.name()).collect();
    assert_eq!(kinds, ["explicit", "explicit", "principal axes", "description", "explicit"]);
    assert_eq!(info.header_bytes + info.sections.iter().map(|section| section.bytes).sum::<u64>(), info.bytes);
    for section in &info.sections {
        let payload = &bytes[section.offset as usize..(section.offset + section.bytes) as usize];
        assert_eq!(crc32c::crc32c(payload), section.crc);
    }
}

prop_compose! {
    fn metas()(
        // No control characters, and none that change the direction of text (general categories Cc and Cf).
        name in "[^\\p{Cc}\\p{Cf}]{0,12}",
        frame_count in 0u32..=100_000,
        // At most 2^25 pixels.
        size_of_images in prop::array::uniform2(0u32..=5792),
        fps in 0.0f32..1e6,
        corner in prop::array::uniform3(-1e6f32..1e6),
        size in prop::array::uniform3(0.0f32..1e6),
        background in prop::array::uniform3(any::<f32>().prop_filter("finite", |x| x.is_finite())),
        config_digest in any::<[u8; 32]>(),
        fov_x in 0.0f32..3.0,
        extra in btree_map("[^\\p{Cc}\\p{Cf}]{0,6}", "[^\\p{Cc}\\p{Cf}]{0,12}", 0..4),
    ) -> SceneMeta {
        let [width, height] = size_of_images;
        let high = std::array::from_fn(|axis| corner[axis] + size[axis]);
        SceneMeta {
            name, frame_count, fps, bounds: [corner, high], background, config_digest, width, height, fov_x, extra,
        }
    }
}

prop_compose! {
    fn scenes()(
        meta in metas(),
        count in 0usize..20,
        sh_degree in 0u8..=3,
        channels in 1u32..4,
        resolution in prop::array::uniform4(1u32..5),
        multipliers in prop::collection::vec(1u32..4, 0..=3),
        moves in any::<bool>(),
        values in prop::collection::vec(any::<f32>().prop_filter("finite", |x| x.is_finite()), 1..64),
    ) -> SceneData {
        let features = channels * multipliers.len() as u32;
        let mut scene = SceneData {
            meta,
            gaussians: gaussians(count, sh_degree),
            coordinates: sample().coordinates,
            feature_planes: hexplane(channels, resolution, &multipliers),
            motion: if moves && features > 0 { motion(features) } else { MotionArrays::default() },
        };
        // Any finite bit pattern may occur anywhere.
        let mut random = values.iter().cycle();
        let arrays = [scene.gaussians.means.as_flattened_mut(), scene.gaussians.sh_rest.as_mut_slice()];
        let planes = scene.feature_planes.planes.iter_mut().map(|plane| plane.values.as_mut_slice());
        let network = scene.motion.network.iter_mut().flat_map(|motion| motion.network.layers_mut());
        let weights = network.map(|layer| layer.weight.as_mut_slice());
        for array in arrays.into_iter().chain(planes).chain(weights) {
            array.fill_with(|| *random.next().unwrap());
        }
        scene
    }
}

proptest! {
    #[test]
    fn every_legal_scene(scene in scenes()) {
        let bytes = encode(&scene).unwrap();
        let decoded = decode(&bytes).unwrap();
        prop_assert_eq!(&decoded, &scene);
        // The same bits, not only equal numbers.
        prop_assert_eq!(encode(&decoded).unwrap(), bytes.clone());
        prop_assert_eq!(info(&bytes).unwrap().planes, scene.feature_planes.layout().unwrap());
    }

    #[test]
    fn noise_is_refused(noise in prop::collection::vec(any::<u8>(), 0..200)) {
        prop_assert!(decode(&noise).is_err());
        let mut bytes = encode(&SceneData::default()).unwrap();
        bytes.truncate(12);
        bytes.extend(noise);
        prop_assert!(decode(&bytes).is_err());
        prop_assert!(info(&bytes).is_err());
    }
}

#[test]
fn a_mapping_of_coordinates_is_kept_and_used() {
    let mut scene = sample();
    scene.coordinates.mapping = CoordinateMapping {
        contracts: false,
        scale: [-0.5, 0.25, 1.5],
        offset: [0.1, -0.2, 0.3],
        time_scale: 0.5,
        time_offset: 0.5,
    };
    let bytes = encode(&scene).unwrap();
    assert_eq!(decode(&bytes).unwrap(), scene);
    let kinds: Vec<&str> = info(&bytes).unwrap().sections.iter().map(|section| section.kind.name()).collect();
    assert!(kinds.contains(&"mapped principal axes"), "{kinds:?}");
    // The contraction's flag stands 60 bytes into the section; a section that is cut short is refused too.
    let mut paper = scene.clone();
    paper.coordinates.mapping = CoordinateMapping::default();
    assert_eq!(encode(&paper).unwrap().len() + 33, bytes.len());
    // Half the time from the middle on: the beginning of this scene is the middle of the other.
    let mut late = scene.clone();
    late.coordinates.mapping = CoordinateMapping { time_scale: 1.0, time_offset: 0.0, ..scene.coordinates.mapping };
    assert_eq!(scene.positions_at(0.0).unwrap(), late.positions_at(0.5).unwrap());
    assert_eq!(scene.positions_at(1.0).unwrap(), late.positions_at(1.0).unwrap());
}
