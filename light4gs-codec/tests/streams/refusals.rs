//! Scenes that the encoder refuses.

use crate::common;

use common::sample;
use light4gs_codec::{
    CodecError, MotionNetwork, MotionOutput, PerGroup, SceneData,
    attributes::AttributeSteps,
    checks, encode,
    network::Layer,
    plane_layout::{PlaneAxes, PlaneLayout},
};

fn network(scene: &mut SceneData) -> &mut MotionNetwork {
    scene.motion.network.as_mut().unwrap()
}

/// The first layer of the sample's motion.
fn layer(scene: &mut SceneData) -> &mut Layer {
    network(scene).network.layers_mut().next().unwrap()
}

/// The message for the sample after a change by `spoil`.
fn message(spoil: impl FnOnce(&mut SceneData)) -> String {
    let mut scene = sample();
    spoil(&mut scene);
    let error = encode(&scene).expect_err("spoilt");
    assert!(!error.is_internal(), "{error}");
    error.to_string()
}

#[test]
fn arrays_of_other_lengths() {
    let text = "expected 2 (one for each of the means)";
    assert!(message(|scene| scene.gaussians.quats.truncate(1)).contains(text));
    assert!(message(|scene| scene.gaussians.opacity_logits.push(0.0)).contains(text));
    assert!(message(|scene| scene.gaussians.sh_dc.clear()).contains(text));
    assert!(message(|scene| scene.gaussians.log_scales.clear()).contains("length of log_scales is 0"));
    assert!(message(|scene| scene.gaussians.sh_rest.push(0.0)).contains("expected 18"));
    assert!(message(|scene| scene.gaussians.sh_degree = 4).contains("degree is 4, expected 0, 1, 2 or 3"));
    assert!(message(|scene| scene.feature_planes.planes[7].values.push(0.0)).contains("values of plane 1.xz"));
    assert!(message(|scene| layer(scene).weight.clear()).contains("length of the network, node 1, weight"));
    assert!(message(|scene| layer(scene).bias.push(0.0)).contains("length of the network, node 1, bias"));
    assert!(message(|scene| scene.motion.tensors[0].values.push(0.0)).contains("length of nodes is 7"));
}

#[test]
fn shapes_that_contradict_each_other() {
    assert!(message(|scene| scene.feature_planes.planes[0].width = 3).contains("values of plane 0.xy"));
    assert!(message(|scene| scene.feature_planes.planes[4].height = 0).contains("height of plane 0.yt is 0"));
    // A plane twice, one out of order, a scale without planes.
    let order = "planes stand scale by scale";
    assert!(message(|scene| scene.feature_planes.planes[1].axes = PlaneAxes::Xy).contains("plane 1 is 0.xy"));
    assert!(message(|scene| scene.feature_planes.planes.swap(2, 3)).contains(order));
    assert!(message(|scene| scene.feature_planes.planes[0].scale = 1).contains(order));
    assert!(message(|scene| scene.feature_planes.planes[11].scale = 2).contains("Features is 2, expected 3"));
    assert!(message(|scene| scene.feature_planes.planes[11].scale = 3).contains("plane 11 is 3.zt"));
    assert!(message(|scene| scene.feature_planes.planes[11].scale = u32::MAX).contains(order));
    assert!(message(|scene| scene.feature_planes.channels = 0).contains("channels is 0"));
    assert!(message(|scene| scene.motion.tensors.push(scene.motion.tensors[0].clone())).contains("each name once"));
    assert!(message(|scene| layer(scene).inputs = 0).contains("node 1, inputs is 0"));
    assert!(message(|scene| layer(scene).inputs = 4).contains("inputs of node 1 is 4, expected 3"));
    assert!(message(|scene| scene.motion.kind.clear()).contains("kind is"));
    assert!(message(|scene| scene.motion.kind = "Ünknown".into()).contains("kind is"));
    assert!(message(|scene| network(scene).outputs[0] = MotionOutput::OpacityLogit).contains("OpacityLogit"));
    assert!(message(|scene| network(scene).outputs[1] = MotionOutput::Position).contains("Position"));
    assert!(message(|scene| network(scene).sources.truncate(1)).contains("number of sources is 1"));
    assert!(
        message(|scene| scene.feature_planes = common::hexplane(3, [2, 1, 1, 3], &[1, 2]))
            .contains("Features is 2, expected 6")
    );
    assert!(message(|scene| scene.meta.bounds.reverse()).contains("bounds"));
    assert!(message(|scene| scene.meta.fps = -1.0).contains("fps is -1"));
}

#[test]
fn numbers_that_are_not_finite() {
    for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        assert!(message(|scene| scene.gaussians.means[1][2] = bad).starts_with("gaussians: value 5 of means is"));
        assert!(message(|scene| scene.gaussians.sh_rest[3] = bad).starts_with("sh: value 3 of sh_rest is"));
        assert!(
            message(|scene| scene.coordinates.axes[0][1] = bad).starts_with("scene_coordinates: value 1 of axes is")
        );
        assert!(message(|scene| scene.feature_planes.planes[3].values[0] = bad).contains("values of plane 0.yz"));
        assert!(message(|scene| layer(scene).bias[0] = bad).contains("layers[0].bias"));
        assert!(message(|scene| scene.motion.tensors[0].values[1] = bad).contains("value 1 of nodes"));
        assert!(message(|scene| scene.meta.background[0] = bad).starts_with("meta: value 0 of background is"));
    }
}

#[test]
fn numbers_beyond_the_limits() {
    let over = |spoil: fn(&mut SceneData)| {
        let mut scene = sample();
        spoil(&mut scene);
        assert!(matches!(encode(&scene), Err(CodecError::OverLimit { .. })));
    };
    over(|scene| scene.meta.name = "n".repeat(70_000));
    over(|scene| scene.meta.extra = (0..20).map(|i| (i.to_string(), "v".repeat(65_000))).collect());
    over(|scene| scene.feature_planes.channels = u32::MAX);
    over(|scene| scene.feature_planes.planes[2].height = u32::MAX);
    over(|scene| scene.motion.tensors[0].shape = vec![u32::MAX; 5]);
    over(|scene| layer(scene).outputs = u32::MAX);
}

/// The checks that a configuration can call before training are those of the encoder.
#[test]
fn what_is_refused_before_training() {
    let planes = |channels: u32, resolution: [usize; 4], multipliers: &[usize]| {
        checks::feature_planes(channels, &PlaneLayout::multiscale(&PlaneAxes::ALL, resolution, multipliers))
    };
    let hexplane = |multipliers: &[usize]| planes(32, [64, 64, 64, 24], multipliers);
    assert!(hexplane(&[1, 2, 4]).is_ok());
    assert!(hexplane(&[1; 16]).is_ok());
    assert!(hexplane(&[1; 17]).unwrap_err().to_string().contains("number of scales is 17, at most 16"));
    assert!(hexplane(&[1, 2000]).unwrap_err().to_string().contains("of plane 1.xy is 128000, at most 65536"));
    assert!(planes(5000, [64; 4], &[1]).unwrap_err().to_string().contains("channels is 5000"));
    assert!(planes(8, [64, 64, 63, 24], &[1]).unwrap_err().to_string().contains("63 along z"));

    for step in [1e-45, 0.0, -0.1, 0.99e-5, 2e30, f32::NAN, f32::INFINITY] {
        assert!(checks::plane_step(step).is_err(), "{step}");
        assert!(checks::sh_step(step).is_err(), "{step}");
        let steps = AttributeSteps::default().with("quats", step);
        assert!(steps.check().unwrap_err().to_string().starts_with("gaussians: step of quats is"), "{step}");
        assert!(steps.clamped().check().is_ok(), "{step}");
        let steps = checks::nearest_plane_steps(PerGroup { space_only: step, space_time: 0.1 });
        assert!(checks::plane_step(steps.space_only).is_ok() && steps.space_time == 0.1, "{step}");
    }
    assert!(checks::plane_step(checks::LEAST_STEP).is_ok());

    assert!(checks::positions(&[[0.0; 3], [1e30, -1e30, 0.0]]).is_ok());
    for bad in [3e38, -3e38, f32::NAN, f32::INFINITY] {
        assert!(checks::positions(&[[0.0; 3], [0.0, bad, 0.0]]).unwrap_err().to_string().contains("in value 4"));
    }
    assert!(checks::scene(&sample()).is_ok());
}
