//! Positions at a time, on a scene small enough to do by hand.

mod common;

use common::{hexplane, sample};
use light4gs_codec::{HeadFlags, LinearLayer, NetworkArrays, SceneData, SceneFrameArrays};

fn layer(name: &str, inputs: u32, outputs: u32, weight: &[f32], bias: &[f32]) -> LinearLayer {
    LinearLayer { name: name.into(), inputs, outputs, weight: weight.into(), bias: bias.into() }
}

/// One channel; all planes are 1 but xt, which rises from 0 to 2 over time; the network passes the feature on.
fn scene() -> SceneData {
    let mut scene = SceneData { gaussians: common::gaussians(1, 0), ..sample() };
    scene.gaussians.means = vec![[0.5, 0.0, 0.0]];
    scene.frame = SceneFrameArrays::default();
    scene.hexplane = hexplane(1, [2, 2, 2, 3], &[1]);
    for (index, plane) in scene.hexplane.planes.iter_mut().enumerate() {
        plane.values.fill(1.0);
        if index == 2 {
            plane.values = vec![0.0, 0.0, 1.0, 1.0, 2.0, 2.0];
        }
    }
    scene.deformation = NetworkArrays {
        width: 1,
        depth: 1,
        heads: HeadFlags { position: true, ..Default::default() },
        layers: vec![
            layer("trunk.0", 1, 1, &[2.0], &[-1.0]),
            layer("position.hidden", 1, 1, &[1.0], &[0.5]),
            layer("position.output", 1, 3, &[1.0, -1.0, 0.0], &[0.0, 0.0, 4.0]),
        ],
    };
    scene
}

#[test]
fn features_move_positions() {
    let scene = scene();
    // time, feature: 2 f - 1, rectified, plus 0.5.
    for (time, hidden) in [(0.0, 0.5), (0.25, 0.5), (0.5, 1.5), (0.75, 2.5), (1.0, 3.5), (7.0, 3.5)] {
        assert_eq!(scene.positions_at(time).unwrap(), [[0.5 + hidden, -hidden, 4.0]], "at {time}");
    }
}

#[test]
fn what_does_not_move_stays() {
    let mut still = scene();
    still.deformation.heads.position = false;
    assert_eq!(still.positions_at(0.5).unwrap(), still.gaussians.means);
    assert!(SceneData::default().positions_at(0.5).unwrap().is_empty());
}

#[test]
fn a_network_without_its_layers_is_refused() {
    let message = |spoil: fn(&mut NetworkArrays)| {
        let mut scene = scene();
        spoil(&mut scene.deformation);
        scene.positions_at(0.0).unwrap_err().to_string()
    };
    assert!(message(|network| network.depth = 2).contains("without trunk.1"));
    assert!(message(|network| network.layers.truncate(2)).contains("without position.output"));
    assert!(message(|network| network.layers[1].inputs = 2).contains("position.hidden.inputs is 2, expected 1"));
    assert!(message(|network| network.layers[2].outputs = 4).contains("expected 3"));
}
