//! Tests of takes.

use light4gs_codec::{
    MotionArrays, MotionNetwork, MotionOutput, MotionSource, Network, SceneData, encode,
    network::Layer,
    take::{NewSegment, TakeMeta, write_take},
};

use super::*;

/// Gaussians in a row along x, from a place on; their harmonics have a degree, and all numbers are 1.
fn gaussians(count: usize, from: f32, sh_degree: u8) -> GaussianArrays {
    GaussianArrays {
        means: (0..count).map(|index| [from + index as f32, 0.0, 0.0]).collect(),
        log_scales: vec![[-1.5; 3]; count],
        quats: vec![[1.0, 0.0, 0.0, 0.0]; count],
        opacity_logits: vec![4.0; count],
        sh_dc: vec![[1.0; 3]; count],
        sh_degree,
        sh_rest: vec![1.0; count * 3 * light4gs_codec::sh_rest_coefficients(sh_degree)],
        further: Vec::new(),
    }
}

/// A Gaussian above the row whose z is the time of its stream.
fn moving(sh_degree: u8) -> Vec<u8> {
    let (mut network, [time]) = Network::new([1]);
    let position = network.layer(time, Layer::linear(vec![0.0, 0.0, 1.0], vec![0.0; 3]));
    network.output(position);
    let motion = MotionArrays {
        kind: "test-rising".into(),
        network: Some(MotionNetwork {
            network,
            sources: vec![MotionSource::Time],
            outputs: vec![MotionOutput::Position],
        }),
        tensors: Vec::new(),
    };
    encode(&SceneData { gaussians: gaussians(1, 0.0, sh_degree), motion, ..SceneData::default() }).expect("a stream")
}

/// Segments from 0 to 2, 2 to 4 and 6 to 8 seconds with margins of a second; the second one hides two of three.
fn take() -> Vec<u8> {
    let base = encode(&SceneData { gaussians: gaussians(3, -1.0, 1), ..SceneData::default() }).expect("a stream");
    let segment = |begin: f64, hidden: &[bool], sh_degree: u8| NewSegment {
        times: SegmentTimes {
            begin,
            end: begin + 2.0,
            stream_begin: begin - 1.0,
            stream_end: begin + 3.0,
            frames: 120,
        },
        stream: moving(sh_degree),
        hidden: hidden.to_vec(),
    };
    let segments = [segment(0.0, &[], 0), segment(2.0, &[true, false, true], 2), segment(6.0, &[false; 3], 1)];
    write_take(&TakeMeta::default(), &base, &segments, 0).expect("a take")
}

fn playable() -> PlayableTake {
    PlayableTake::decode(take(), &Limits::default()).expect("a take")
}

#[test]
fn segments_move_by_their_own_times_and_fade_at_the_joins() {
    let take = playable();
    // (seconds, Gaussians of the base, heights of the segments'): margins are a quarter of each stream, and the fade takes the
    // margins of both.
    let expected: [(f64, usize, &[f32]); 11] = [
        (0.0, 3, &[0.25]),
        (1.0, 3, &[0.5]),
        (1.5, 3, &[0.625, 0.125]),
        (2.0, 3, &[0.75, 0.25]),
        (3.0, 1, &[0.5]),
        (3.5, 1, &[0.625]),
        (4.0, 3, &[]),
        (5.0, 3, &[]),
        (6.0, 3, &[0.25]),
        (8.0, 3, &[]),
        (-1.0, 3, &[]),
    ];
    for (seconds, of_base, heights) in expected {
        let found = take.at(seconds).expect("Gaussians");
        assert_eq!(found.len(), of_base + heights.len(), "{seconds}");
        for (height, mean) in heights.iter().zip(&found.means[of_base..]) {
            assert!((mean[2] - height).abs() < 1e-5, "{seconds}: {mean:?}");
        }
    }
    let hidden = take.at(3.5).expect("Gaussians");
    assert_eq!(hidden.means[0], [0.0, 0.0, 0.0], "the middle one is not hidden");
    // All opacities are equal; a quarter of the way, the later segment has a quarter, and what it hides three quarters.
    let logits = take.at(1.5).expect("Gaussians").opacity_logits;
    assert_eq!((logits[1], logits[0], logits[2]), (4.0, logits[3], logits[3]));
    assert!(logits[4] < logits[3] && logits[3] < 4.0, "{logits:?}");
}

#[test]
fn harmonics_are_padded_to_the_larger_degree() {
    let take = playable();
    let degrees = [1.0, 3.0, 5.0, 7.0].map(|seconds| take.at(seconds).expect("Gaussians").sh_degree);
    assert_eq!(degrees, [1, 2, 1, 1]);
    let padded = take.at(3.0).expect("Gaussians").sh_rest;
    assert_eq!((padded.len(), padded.iter().sum::<f32>()), (2 * 24, 9.0 + 24.0));
}

#[test]
fn images_are_those_of_the_gaussians_and_at_a_join_the_mean_of_two() {
    let take = playable();
    let (eye, up) = ([0.0, -6.0, 0.0], [0.0, 0.0, 1.0]);
    let camera = Camera::look_at(eye.into(), [0.0; 3].into(), up.into(), 0.9, 65, 65);
    let background = [0.1, 0.2, 0.3];
    // The same Gaussians as one scene.
    let as_scene = |gaussians: GaussianArrays| {
        let stream = encode(&SceneData { gaussians, ..SceneData::default() }).expect("a stream");
        let scene = PlayableScene::decode(&stream, &Limits::default()).expect("a scene");
        scene.render(&camera, 0.0, background).expect("an image")
    };
    for seconds in [0.9, 3.1, 5.0] {
        let image = take.render(&camera, seconds, background).expect("an image");
        assert_eq!(image, as_scene(take.at(seconds).expect("Gaussians")));
    }
    // Three quarters of the way through the fade from 1 to 3 seconds: each segment alone with its part of the base.
    let alone = [0, 1].map(|number| {
        let shown = take.decoded_segment(number).expect("a segment");
        as_scene(take.gaussians(2.5, &[(shown, 1.0)]).expect("Gaussians"))
    });
    let image = take.render(&camera, 2.5, background).expect("an image");
    let mean = alone[0].iter().zip(&alone[1]).map(|(earlier, later)| 0.25 * earlier + 0.75 * later);
    assert!(image.iter().zip(mean).all(|(found, expected)| (found - expected).abs() < 1e-6));
    assert_ne!(alone[0], alone[1]);
    // Where a Gaussian is hidden, the background is.
    let left = |seconds: f64| {
        let image = take.render(&camera, seconds, [0.0; 3]).expect("an image");
        (0..32).map(|x| image[3 * (65 * 32 + x)]).sum::<f32>()
    };
    assert!(left(1.0) > 3.0 && left(3.0) < 0.5 * left(1.0), "{} and {}", left(1.0), left(3.0));
}

#[test]
fn a_bounded_number_of_segments_is_kept() {
    let take = playable().keeping(2);
    let after = |seconds: f64| {
        take.prepare(seconds).expect("a segment");
        take.decoded()
    };
    assert_eq!([1.0, 3.0, 0.5, 5.0].map(after), [vec![0], vec![0, 1], vec![1, 0], vec![1, 0]]);
    assert_eq!(after(7.0), [0, 2]);
    let two = playable().keeping(0);
    [7.0, 2.0].iter().for_each(|&seconds| two.prepare(seconds).expect("segments"));
    assert_eq!(two.decoded(), [0, 1]);
}

/// A thread that decodes may turn to the work of another one in the same pool: it must not wait for itself.
#[test]
fn threads_of_a_pool_may_call_it() {
    let take = Arc::new(playable().keeping(2));
    let (done, finished) = std::sync::mpsc::channel();
    std::thread::spawn(move || {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(4).build().expect("a pool");
        for _ in 0..200 {
            pool.scope(|scope| {
                for call in 0..32_usize {
                    let take = take.clone();
                    scope.spawn(move |_| drop(take.at([0.5, 3.5, 7.0][call % 3]).expect("Gaussians")));
                }
            });
        }
        done.send(()).expect("somebody waits");
    });
    finished.recv_timeout(std::time::Duration::from_secs(120)).expect("no deadlock");
}

#[test]
fn wrong_times_and_damage_are_refused() {
    let take = playable();
    for seconds in [f64::NAN, f64::INFINITY] {
        assert!(take.at(seconds).is_err() && take.prepare(seconds).is_err());
    }
    let mut bytes = self::take();
    *bytes.last_mut().expect("bytes") ^= 1;
    let damaged = PlayableTake::decode(bytes, &Limits::default()).expect("the index and the base are whole");
    assert!(damaged.at(1.0).is_ok());
    assert!(damaged.at(7.0).expect_err("a checksum").to_string().starts_with("segment 2 of the take"));
    let scene = encode(&SceneData::default()).expect("a stream");
    assert_eq!(PlayableTake::decode(scene, &Limits::default()).expect_err("no take").kind(), "not-take");
    let error = PlayableScene::decode(&self::take(), &Limits::default()).expect_err("a take").to_string();
    assert!(error.contains("PlayableTake"), "{error}");
}
