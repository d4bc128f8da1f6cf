//! Compressed scenes: the decoded scene is the one that the encoder promised, for every shape and every part.

use crate::common;

use common::compression::{
    ALL_PARTS, Parts, Random, ShKind, compact_shape, condition, distribution, input, model, plane_coding,
    reference_shape, scene, sh_networks, sh_tables, step,
};
use light4gs_codec::{
    CodecError, CompressionInput, ContextModelArrays, Distributions, Encoded, GaussianArrays, Kind, LatentArrays,
    Network, OpenStream, PerGroup, PlaneCoding, PlanePrior, PlaneSource, Profile, SceneData, ShCoding, decode,
    encode_compressed, encode_planes, info,
    network::{LayerKind, Operation, Value},
    plane_distributions,
    plane_layout::PlaneAxes,
};
use proptest::prelude::*;

/// Encodes, and checks the encoder's promises.
fn round_trip(scene: &SceneData, input: &CompressionInput) -> Encoded {
    let encoded = encode_compressed(scene, input).unwrap();
    assert_eq!(decode(&encoded.bytes).unwrap(), encoded.decoded);
    let info = info(&encoded.bytes).unwrap();
    assert_eq!(info, encoded.info);
    let sections: u64 = info.sections.iter().map(|section| section.bytes).sum();
    assert_eq!(info.header_bytes + sections, encoded.bytes.len() as u64);
    assert_eq!((info.version, info.profile), (1, Some(input.profile)));
    assert_eq!(info.gaussian_count as usize, scene.gaussians.len());
    assert_eq!(info.planes, scene.feature_planes.layout().unwrap());
    encoded
}

fn largest_error(given: &[f32], decoded: &[f32]) -> f32 {
    assert_eq!(given.len(), decoded.len());
    given.iter().zip(decoded).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max)
}

#[test]
fn errors_are_at_most_half_a_step() {
    let scene = scene(50, 3, 4, [8, 8, 12, 4], &[1, 2]);
    for profile in [Profile::Compact, Profile::Paper] {
        for shape in [compact_shape(4, ALL_PARTS), reference_shape(4, ALL_PARTS)] {
            let encoded = round_trip(&scene, &input(&scene, profile, shape));
            for (given, decoded) in scene.feature_planes.planes.iter().zip(&encoded.decoded.feature_planes.planes) {
                assert!(largest_error(&given.values, &decoded.values) <= 0.0501);
            }
            if profile == Profile::Paper {
                assert!(largest_error(&scene.gaussians.sh_rest, &encoded.decoded.gaussians.sh_rest) <= 0.01001);
                assert_eq!(encoded.decoded.gaussians.means, scene.gaussians.means);
                assert_eq!(encoded.decoded.motion, scene.motion);
            }
        }
    }
}

#[test]
fn every_combination_of_parts() {
    let scene = scene(3, 1, 4, [8, 4, 4, 4], &[1, 2]);
    for bits in 0..32 {
        let [hyperprior, checkerboard, inter_plane, inter_scale, high_scale_hyperprior] =
            [0, 1, 2, 3, 4].map(|bit| bits >> bit & 1 == 1);
        let parts = Parts { hyperprior, checkerboard, inter_plane, inter_scale, high_scale_hyperprior };
        if high_scale_hyperprior && !(hyperprior && inter_scale) {
            continue;
        }
        let encoded = round_trip(&scene, &input(&scene, Profile::Paper, compact_shape(4, parts)));
        for bytes in &encoded.info.plane_bytes {
            let low = bytes.plane < 6 || !inter_scale;
            let space_time = [2, 4, 5].contains(&(bytes.plane % 6));
            assert_eq!(bytes.anchors > 0, checkerboard && low, "{parts:?} {bytes:?}");
            let latent = if low { hyperprior && (space_time || !inter_plane) } else { high_scale_hyperprior };
            assert!(bytes.latent == 0 || latent, "{parts:?} {bytes:?}");
        }
    }
}

/// The bytes of a network besides its weights.
#[test]
fn a_description_is_short() {
    let scene = scene(0, 0, 16, [4, 4, 4, 4], &[1, 2]);
    let encoded = round_trip(&scene, &input(&scene, Profile::Paper, compact_shape(16, ALL_PARTS)));
    let model = model(compact_shape(16, ALL_PARTS), &scene.feature_planes, 3);
    let stored = |network: &Network| -> u64 {
        let layers = network.layers().map(|layer| match layer.kind {
            LayerKind::Checkerboard => layer.weights() / 25 * 12 + u64::from(layer.outputs),
            _ => layer.weights() + u64::from(layer.outputs),
        });
        layers.sum()
    };
    let weights: u64 = model.networks.iter().map(stored).sum();
    // Besides the description there are the latent's medians and its tables, some 20 bytes each.
    let description = encoded.info.sections[5].bytes - 4 * weights;
    assert!(description < 200, "{description} bytes");
}

/// A context model unlike any built-in one: halved and doubled maps, sums, products and rectifiers, planes that read
/// planes over other axes in a chain, two networks over anchors, a latent at higher scales alone.
#[test]
fn a_composition_of_ones_own() {
    const M: u32 = 4;
    let scene = scene(5, 1, M, [8, 12, 4, 8], &[1, 2]);
    let mut random = Random::new(21);
    let mut networks = Vec::new();

    // 0: from a decoded plane of any size: halved, rectified, doubled, plus itself through a 7 x 7 kernel.
    let (mut network, [plane]) = Network::new([M]);
    let resized = network.node(Operation::Resize, &[plane]);
    let half = network.layer(resized, random.layer(LayerKind::Halving, M, 3, 5, 1));
    let half = network.relu(half);
    let whole = network.layer(half, random.layer(LayerKind::Doubling, 3, 2 * M, 5, 1));
    let wide = network.layer(resized, random.layer(LayerKind::Convolution, M, 2 * M, 7, 2));
    let sum = network.node(Operation::Add, &[whole, wide]);
    network.output(sum);
    networks.push(network);

    // 1: anchors through two kernels, one of which gates the other.
    let (mut network, [anchors, again]) = Network::new([M, M]);
    let near = network.layer(anchors, random.layer(LayerKind::Checkerboard, M, M, 3, 1));
    let far = network.layer(again, random.layer(LayerKind::Checkerboard, M, M, 7, M));
    let gate = network.leaky_relu(far, 0.25);
    let product = network.node(Operation::Multiply, &[near, gate]);
    let output = network.layer(product, random.linear(M, 2 * M));
    network.output(output);
    networks.push(network);

    // 2: the latent, each channel's mean over columns beside its values, at the plane's size.
    let (mut network, [latent]) = Network::new([2]);
    let mean = network.node(Operation::MeanOverWidth, &[latent]);
    let mean = network.layer(mean, random.layer(LayerKind::Convolution, 2, 2, 3, 1));
    let mean = network.node(Operation::Resize, &[mean]);
    let values = network.node(Operation::Resize, &[latent]);
    let both = network.node(Operation::Concatenate, &[mean, values, mean]);
    let output = network.layer(both, random.linear(6, 2 * M));
    network.output(output);
    networks.push(network);
    networks.push(distribution(&mut random, M, [7, 9]));

    let other = |axes| condition(0, &[PlaneSource::SameScale(axes)]);
    let anchors = || condition(1, &[PlaneSource::Anchors, PlaneSource::Anchors]);
    let prior = |first, second| PlanePrior { conditions: vec![first, second], distribution: 3 };
    let priors = vec![
        prior(None, anchors()),
        prior(other(PlaneAxes::Xy), None),
        prior(other(PlaneAxes::Xz), anchors()),
        prior(other(PlaneAxes::Zt), other(PlaneAxes::Xt)),
        prior(condition(0, &[PlaneSource::LowerScale]), condition(2, &[PlaneSource::Latent])),
        prior(condition(2, &[PlaneSource::Latent]), anchors()),
    ];
    let model = ContextModelArrays {
        channels: M,
        centers: PerGroup { space_only: 0.2, space_time: 0.9 },
        latent: Some(LatentArrays {
            tables: vec![common::compression::laplace_table(0.5); 2],
            medians: vec![0.25, -0.5],
        }),
        networks,
        priors,
        // xy, then xz from it, then xt from that, then yz, yt and zt from those before them.
        plane_priors: vec![0, 1, 2, 3, 0, 2, 4, 5, 4, 5, 4, 0],
    };
    for profile in [Profile::Compact, Profile::Paper] {
        let planes = Some(plane_coding(&scene.feature_planes, model.clone(), step(0.1)));
        let input = CompressionInput { planes, ..input(&scene, profile, compact_shape(M, ALL_PARTS)) };
        let encoded = round_trip(&scene, &input);
        for (given, decoded) in scene.feature_planes.planes.iter().zip(&encoded.decoded.feature_planes.planes) {
            assert!(largest_error(&given.values, &decoded.values) <= 0.0501);
        }
        let has_latent: Vec<_> = encoded.info.plane_bytes.iter().map(|plane| plane.latent > 0).collect();
        assert_eq!(has_latent[..6], [false; 6]);
        assert_eq!(has_latent[6..], [true, true, true, true, true, false]);
    }

    // Planes that depend on each other, and on planes that do not exist.
    let sound = self::model(compact_shape(M, ALL_PARTS), &scene.feature_planes, 1);
    let refused = |spoil: &dyn Fn(&mut ContextModelArrays)| {
        let mut model = model.clone();
        spoil(&mut model);
        let coding = PlaneCoding { model, ..plane_coding(&scene.feature_planes, sound.clone(), step(0.1)) };
        encode_planes(&scene.feature_planes, &coding).unwrap_err().to_string()
    };
    assert!(refused(&|model| model.plane_priors[..6].fill(2)).contains("planes that depend on this one"));
    assert!(
        refused(&|model| model.priors[2].conditions[0] = other(PlaneAxes::Xt))
            .contains("planes that depend on this one")
    );
    assert!(refused(&|model| model.plane_priors[0] = 4).contains("a source of plane 0.xy is the scale below"));
    assert!(refused(&|model| model.plane_priors[0] = 9).contains("prior of planes[0] is 9, expected less than 6"));
    assert!(refused(&|model| model.plane_priors.truncate(11)).contains("number of planes with a prior is 11"));
    assert!(refused(&|model| model.plane_priors.push(0)).contains("number of planes with a prior is 13"));
    assert!(refused(&|model| model.plane_priors = vec![0; 97]).contains("number of planes is 97, at most 96"));
    assert!(refused(&|model| model.priors[0].distribution = 0).contains("looks at one place only"));
    assert!(refused(&|model| model.priors[0].conditions[1] = other(PlaneAxes::Xy)).contains(""));
    assert!(refused(&|model| model.latent = None).contains("those of its source Latent"));
    assert!(refused(&|model| model.networks[1].outputs = vec![Value(0)]).contains("an output is anchors"));
    let sources = [PlaneSource::Anchors, PlaneSource::LowerScale];
    assert!(
        refused(&|model| model.priors[0].conditions[1] = condition(1, &sources)).contains("which a checkerboard reads")
    );
    assert!(
        refused(&|model| model.priors[0].conditions[1] = condition(0, &[PlaneSource::Anchors])).contains("no anchors")
    );
    let blur = |model: &mut ContextModelArrays| {
        let layer = Random::new(1).layer(LayerKind::Convolution, 2 * M, 2 * M, 3, 1);
        let output = model.networks[1].outputs[0];
        model.networks[1].outputs = vec![model.networks[1].clone().layer(output, layer.clone())];
        model.networks[1].layer(output, layer);
    };
    assert!(refused(&blur).contains("half a map"));
    let half = |model: &mut ContextModelArrays| model.networks[0].outputs = vec![Value(3)];
    assert!(refused(&half).contains("channels of the outputs"));
}

#[test]
fn empty_sets_and_other_numbers_of_scales() {
    for (count, degree) in [(0, 0), (0, 3), (5, 0)] {
        let scene = scene(count, degree, 2, [4, 4, 4, 4], &[1]);
        round_trip(&scene, &input(&scene, Profile::Compact, compact_shape(2, ALL_PARTS)));
        round_trip(&scene, &input(&scene, Profile::Paper, compact_shape(2, ALL_PARTS)));
    }
    for multipliers in [&[][..], &[1], &[2], &[1, 2, 4], &[1, 3, 2]] {
        let mut scene = scene(2, 2, 4, [4, 8, 4, 4], multipliers);
        if multipliers.is_empty() {
            scene.motion = Default::default();
        }
        round_trip(&scene, &input(&scene, Profile::Paper, compact_shape(4, ALL_PARTS)));
        let plain = CompressionInput {
            profile: Profile::Compact,
            planes: None,
            ..input(&scene, Profile::Compact, compact_shape(4, ALL_PARTS))
        };
        assert_eq!(round_trip(&scene, &plain).decoded.feature_planes, scene.feature_planes);
    }
    let empty = SceneData::default();
    let plain = CompressionInput {
        planes: None,
        ..common::compression::input(&empty, Profile::Compact, compact_shape(4, ALL_PARTS))
    };
    round_trip(&empty, &plain);
}

#[test]
fn time_may_be_multiplied() {
    let mut scene = scene(2, 0, 4, [4, 8, 4, 4], &[1, 2]);
    for plane in scene.feature_planes.planes.iter_mut().filter(|plane| plane.scale == 1 && plane.axes.is_space_time()) {
        plane.height *= 2;
        plane.values.resize(2 * plane.values.len(), 1.0);
    }
    round_trip(&scene, &input(&scene, Profile::Paper, compact_shape(4, ALL_PARTS)));
}

#[test]
fn steps_of_each_scale_and_group() {
    let scene = scene(2, 0, 4, [8, 8, 8, 4], &[1, 2]);
    let steps = [(0.2, 0.01), (0.05, 0.4)].map(|(space_only, space_time)| PerGroup { space_only, space_time }).to_vec();
    let input = CompressionInput {
        profile: Profile::Paper,
        planes: Some(plane_coding(
            &scene.feature_planes,
            model(compact_shape(4, ALL_PARTS), &scene.feature_planes, 9),
            steps.clone(),
        )),
        ..input(&scene, Profile::Paper, compact_shape(4, ALL_PARTS))
    };
    let encoded = round_trip(&scene, &input);
    for (index, plane) in scene.feature_planes.planes.iter().enumerate() {
        let step = steps[plane.scale as usize].of(plane.axes);
        let error = largest_error(&plane.values, &encoded.decoded.feature_planes.planes[index].values);
        assert!(error <= 0.501 * step && error > 0.4 * step, "plane {index}: {error}");
    }
}

#[test]
fn harmonics_under_networks() {
    for degree in 0..=3 {
        let scene = scene(21, degree, 4, [4, 4, 4, 4], &[1, 2]);
        for kind in [ShKind::Autoregressive, ShKind::HexPlaneCoupled, ShKind::Everything] {
            for profile in [Profile::Compact, Profile::Paper] {
                let sh = sh_networks(kind, degree, 8);
                let input = CompressionInput { sh, ..input(&scene, profile, compact_shape(4, ALL_PARTS)) };
                let encoded = round_trip(&scene, &input);
                if profile == Profile::Paper {
                    let decoded = &encoded.decoded.gaussians.sh_rest;
                    assert!(largest_error(&scene.gaussians.sh_rest, decoded) <= 0.01001);
                }
                assert_eq!(encoded.info.sections[1].kind, Kind::ShNetworks);
            }
        }
    }
}

/// Harmonics that are alike in places take fewer bits than their values have digits.
#[test]
fn harmonics_are_predicted_from_neighbors() {
    let mut scene = scene(3000, 1, 4, [4, 4, 4, 4], &[1]);
    let GaussianArrays { means, sh_rest, .. } = &mut scene.gaussians;
    let mut random = Random::new(5);
    for (mean, row) in means.iter_mut().zip(sh_rest.chunks_exact_mut(9)) {
        *mean = [0; 3].map(|_| random.uniform());
        // Each number spans up to a hundred steps from one end of the scene to the other, in its own way.
        for (number, value) in row.iter_mut().enumerate() {
            *value = ((1.0 + 0.3 * number as f32) * mean[number % 3]).sin();
        }
    }
    let sh = ShCoding::Channels { step: 0.02 };
    let encoded =
        round_trip(&scene, &CompressionInput { sh, ..input(&scene, Profile::Compact, compact_shape(4, ALL_PARTS)) });
    let bits = 8.0 * encoded.sh.degrees[0] as f64 / scene.gaussians.sh_rest.len() as f64;
    assert!(bits < 0.6 * 100_f64.log2(), "{bits} bits a number");
    assert!(bits > 0.5, "{bits} bits a number");
}

#[test]
fn harmonics_need_no_planes_unless_coupled() {
    let scene = scene(9, 2, 4, [4, 4, 4, 4], &[1]);
    for sh in [sh_tables(2), ShCoding::Channels { step: 0.02 }, sh_networks(ShKind::Autoregressive, 2, 4)] {
        let encoded = round_trip(
            &scene,
            &CompressionInput { sh, ..input(&scene, Profile::Compact, compact_shape(4, ALL_PARTS)) },
        );
        let stream = OpenStream::new(&encoded.bytes).unwrap();
        assert!(!stream.sh_needs_feature_planes().unwrap());
        let gaussians = stream.gaussians().unwrap();
        let gaussians = stream.sh(gaussians, &stream.coordinates().unwrap(), &Default::default()).unwrap();
        assert_eq!(gaussians, encoded.decoded.gaussians);
    }
}

/// The distributions of the decoded planes are those under which the planes were coded: they expect as many bits as
/// there are.
#[test]
fn the_coded_bits_are_those_of_the_distributions() {
    let scene = scene(0, 0, 16, [32, 32, 32, 16], &[1, 2]);
    let input = input(&scene, Profile::Paper, compact_shape(16, ALL_PARTS));
    let encoded = round_trip(&scene, &input);
    let planes = input.planes.as_ref().unwrap();
    let bytes = encode_planes(&scene.feature_planes, planes).unwrap();
    assert_eq!(bytes.len() as u64, encoded.info.sections[4].bytes);
    for (index, plane) in encoded.decoded.feature_planes.planes.iter().enumerate() {
        let Distributions { scales, means } =
            plane_distributions(&encoded.decoded.feature_planes, planes, index).unwrap();
        let center = if [2, 4, 5].contains(&(index % 6)) { 1.0 } else { 0.0 };
        let mut ideal = 0.0;
        for ((&value, &scale), &mean) in plane.values.iter().zip(&scales).zip(&means) {
            let distance = (f64::from((value - center) / 0.1) - f64::from(mean)).round().abs();
            let scale = f64::from(scale.max(0.11));
            ideal -= (upper_tail((distance - 0.5) / scale) - upper_tail((distance + 0.5) / scale)).max(2e-9).log2();
        }
        let sizes = encoded.info.plane_bytes[index];
        let coded = 8.0 * (sizes.anchors + sizes.others) as f64;
        assert!((coded / ideal - 1.0).abs() < 0.01, "plane {index}: {coded} bits, ideal {ideal}");
    }
}

/// The probability that a standard normal variable is above `x`: Simpson's rule on the density.
fn upper_tail(x: f64) -> f64 {
    let (steps, end) = (400, x + 9.0);
    let width = (end - x) / f64::from(steps);
    let density = |i: i32| (-0.5 * (x + f64::from(i) * width).powi(2)).exp() / std::f64::consts::TAU.sqrt();
    let inner: f64 = (1..steps).map(|i| density(i) * if i % 2 == 1 { 4.0 } else { 2.0 }).sum();
    (density(0) + inner + density(steps)) * width / 3.0
}

#[test]
fn the_number_of_threads_does_not_matter() {
    let scene = scene(40, 3, 8, [16, 8, 8, 8], &[1, 2]);
    let input = input(&scene, Profile::Compact, compact_shape(8, ALL_PARTS));
    let with = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| encode_compressed(&scene, &input).unwrap().bytes)
    };
    let one = with(1);
    assert_eq!(with(2), one);
    assert_eq!(with(7), one);
}

#[test]
fn extreme_weights_do_no_harm() {
    let scene = scene(4, 1, 4, [4, 4, 4, 4], &[1, 2]);
    for huge in [1e38, -1e38, 3e20, f32::MIN_POSITIVE] {
        let mut input = input(&scene, Profile::Paper, compact_shape(4, ALL_PARTS));
        let planes = input.planes.as_mut().unwrap();
        for layer in planes.model.networks.iter_mut().flat_map(Network::layers_mut) {
            layer.weight.iter_mut().step_by(3).for_each(|weight| *weight *= huge);
        }
        round_trip(&scene, &input);
    }
}

#[test]
fn contradictions_are_refused() {
    let scene = scene(4, 1, 4, [4, 4, 4, 4], &[1, 2]);
    let good = input(&scene, Profile::Paper, compact_shape(4, ALL_PARTS));
    let hexplane = &scene.feature_planes;
    let message = |spoil: &dyn Fn(&mut CompressionInput)| {
        let mut input = good.clone();
        spoil(&mut input);
        let error = encode_compressed(&scene, &input).expect_err("spoilt");
        assert!(!error.is_internal(), "{error}");
        error.to_string()
    };
    let planes = |spoil: &dyn Fn(&mut PlaneCoding)| message(&|input| spoil(input.planes.as_mut().unwrap()));
    assert!(planes(&|planes| planes.steps.clear()).contains("number of steps is 0"));
    assert!(planes(&|planes| planes.steps = step(0.0)).contains("step is 0"));
    assert!(planes(&|planes| planes.steps = step(f32::NAN)).contains("step is NaN"));
    assert!(planes(&|planes| planes.steps = step(1e-12)).contains("make the step larger"));
    assert!(planes(&|planes| planes.latent_symbols[2][0] = i32::MIN).contains("latent of plane 0.xt"));
    assert!(planes(&|planes| planes.latent_symbols[2].clear()).contains("latent symbols of plane 0.xt is 0"));
    assert!(planes(&|planes| planes.latent_symbols[0].push(0)).contains("latent symbols of plane 0.xy is 1"));
    assert!(planes(&|planes| drop(planes.latent_symbols.pop())).contains("one list a plane"));
    assert!(planes(&|planes| drop(planes.model.networks.pop())).contains("network of priors[0] is 4"));
    fn layer(planes: &mut PlaneCoding) -> &mut light4gs_codec::network::Layer {
        planes.model.networks[0].layers_mut().nth(1).unwrap()
    }
    assert!(planes(&|planes| layer(planes).weight[0] = f32::NAN).contains("networks[0], node 2, weight is NaN"));
    assert!(planes(&|planes| layer(planes).bias.truncate(1)).contains("length of networks[0], node 2, bias"));
    assert!(planes(&|planes| layer(planes).kernel = 3).contains("kernel is 3, expected 5"));
    assert!(planes(&|planes| layer(planes).groups = 3).contains("a divisor of"));
    assert!(planes(&|planes| layer(planes).inputs = 7).contains("inputs of node 2 is 7"));
    assert!(planes(&|planes| layer(planes).kind = LayerKind::Checkerboard).contains("only checkerboard convolutions"));
    assert!(planes(&|planes| layer(planes).kind = LayerKind::Convolution).contains("size of an output"));
    assert!(
        planes(&|planes| planes.model.networks[0].nodes[1].inputs = vec![Value(9)])
            .contains("an input of node 1 (leaky")
    );
    assert!(planes(&|planes| planes.model.networks[0].nodes[1].inputs.clear()).contains("inputs of node 1"));
    assert!(
        planes(&|planes| planes.model.networks[0].nodes[1].operation = Operation::LeakyRelu(f32::NAN))
            .contains("slope")
    );
    assert!(planes(&|planes| planes.model.centers.space_time = f32::INFINITY).contains("center of space-time"));
    assert!(planes(&|planes| drop(planes.model.latent.as_mut().unwrap().tables.pop())).contains("0 tables, 1 medians"));
    assert!(planes(&|planes| planes.model.latent.as_mut().unwrap().medians[0] = f32::NAN).contains("latent is NaN"));
    assert!(
        planes(&|planes| planes.model = model(compact_shape(8, ALL_PARTS), hexplane, 1))
            .contains("channels is 4, expected 8")
    );
    assert!(message(&|input| input.sh = sh_tables(2)).contains("number of tables is 24, expected 9"));
    assert!(message(&|input| input.sh = sh_networks(ShKind::HexPlaneCoupled, 1, 5)).contains("SpaceFeatures"));
    assert!(
        message(&|input| input.sh = sh_networks(ShKind::Autoregressive, 2, 8)).contains("channels of all priors is 24")
    );
    assert!(
        message(&|input| {
            if let ShCoding::Tables { step, .. } = &mut input.sh {
                *step = -0.02;
            }
        })
        .contains("step is -0.02")
    );
    let odd = common::compression::scene(1, 0, 4, [4, 6, 4, 4], &[1]);
    let error = encode_compressed(&odd, &input(&odd, Profile::Paper, compact_shape(4, ALL_PARTS))).unwrap_err();
    assert!(matches!(error, CodecError::Invalid { section: "feature_planes", .. }), "{error}");
    assert!(error.to_string().contains("a multiple of 4"), "{error}");
}

prop_compose! {
    fn cases()(
        resolution in prop::array::uniform4(1u32..4),
        channels in prop::sample::select(vec![1u32, 2, 3, 4, 6]),
        multipliers in prop::collection::vec(1u32..3, 0..3),
        bits in 0u8..16,
        counts in (0usize..20, 0u8..4),
        seed in any::<u64>(),
        step in prop::sample::select(vec![0.003f32, 0.1, 2.0]),
        reference in any::<bool>(),
        profile in prop::sample::select(vec![Profile::Compact, Profile::Paper]),
    ) -> (SceneData, CompressionInput) {
        let [hyperprior, checkerboard, inter_plane, inter_scale] = [0, 1, 2, 3].map(|bit| bits >> bit & 1 == 1);
        let high_scale_hyperprior = hyperprior && inter_scale && seed % 2 == 0;
        let parts = Parts { hyperprior, checkerboard, inter_plane, inter_scale, high_scale_hyperprior };
        let scene = scene(counts.0, counts.1, channels, resolution.map(|r| 4 * r), &multipliers);
        let shape = if reference { reference_shape(channels, parts) } else { compact_shape(channels, parts) };
        let steps = common::compression::step(step);
        let planes = Some(plane_coding(&scene.feature_planes, model(shape, &scene.feature_planes, seed), steps));
        let features = channels as usize * multipliers.len();
        let sh = match seed % 3 {
            0 if seed % 2 == 0 => ShCoding::Channels { step: 0.02 },
            0 => sh_tables(counts.1),
            1 => sh_networks(ShKind::Autoregressive, counts.1, features),
            _ if features == 0 => sh_tables(counts.1),
            _ if seed % 2 == 0 => sh_networks(ShKind::Everything, counts.1, features),
            _ => sh_networks(ShKind::HexPlaneCoupled, counts.1, features),
        };
        let others = input(&scene, profile, shape);
        (scene, CompressionInput { planes, sh, ..others })
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]
    #[test]
    fn every_legal_scene((scene, input) in cases()) {
        round_trip(&scene, &input);
    }
}
