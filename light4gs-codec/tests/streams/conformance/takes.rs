//! Takes of the set.

use std::fs;

use super::written::{clusters, compressed};
use crate::common::{compression::tiny, further, sample};
use light4gs_codec::{
    CompressionInput, FeaturePlaneArrays, GaussianArrays, MotionArrays, Profile, SceneData, ShCoding,
    attributes::AttributeSteps,
    encode,
    take::{NewSegment, SegmentTimes, TakeFile, TakeMeta, write_take},
};

/// A scene of these Gaussians that stands still.
fn still(gaussians: GaussianArrays) -> SceneData {
    SceneData { gaussians, feature_planes: FeaturePlaneArrays::default(), motion: MotionArrays::default(), ..sample() }
}

fn times(begin: f64, end: f64, margins: f64) -> SegmentTimes {
    let frames = (30.0 * (end - begin + 2.0 * margins)) as u32;
    SegmentTimes { begin, end, stream_begin: begin - margins, stream_end: end + margins, frames }
}

/// Takes by their names in the folder of streams.
pub(super) fn takes() -> Vec<(&'static str, Vec<u8>)> {
    // A base of degree 1; segments of degrees 1 and 2, coded and without loss; a gap in between, and not in their order.
    let base = still(clusters(60));
    let coding = CompressionInput {
        profile: Profile::Compact,
        planes: None,
        sh: ShCoding::Channels { step: 0.01 },
        attributes: AttributeSteps::default().with("wide", 0.02).with("outliers", 0.01),
        weights: Default::default(),
        layers: Default::default(),
    };
    let coded = compressed(&base, &coding);
    let (moving, input) = tiny(Profile::Compact);
    let moving = compressed(&moving, &input);
    let clustered: Vec<bool> = (0..60).map(|index| index % 20 < 7 || index == 11).collect();
    let first = NewSegment { times: times(0.0, 0.3, 0.125), stream: moving.clone(), hidden: clustered };
    let second = NewSegment { times: times(0.5, 0.97, 0.0), stream: encode(&sample()).unwrap(), hidden: Vec::new() };
    let extra = [("camera".to_owned(), "two lines\nand a\ttab".to_owned())].into();
    let meta = TakeMeta { name: "a take 🎾".into(), fps: 29.97, seconds: 1.5, extra };
    let segments = write_take(&meta, &coded, &[second, first.clone()], 2).unwrap();

    // Segments that meet and were appended, one of them by a process that was killed; blocks of 1 and 64 slots. Of the times that are
    // asked for, 0.25 is in a fade before its middle, 0.37 in the middle of one.
    let mut base = still(GaussianArrays { sh_degree: 0, sh_rest: Vec::new(), ..clusters(9) });
    base.gaussians.further = vec![further("age", 1, 9)];
    let join = |begin: f64, end: f64, hidden: &[bool]| NewSegment {
        times: times(begin, end, 0.1),
        stream: moving.clone(),
        hidden: hidden.to_vec(),
    };
    let all = join(0.26, 0.37, &[true; 9]);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("appended.l4gs");
    fs::write(&path, write_take(&TakeMeta::default(), &encode(&base).unwrap(), &[], 1).unwrap()).unwrap();
    TakeFile::append(&path, &join(0.37, 2.0, &[false; 9])).unwrap();
    fs::write(&path, [&fs::read(&path).unwrap()[..], b"killed while it wrote"].concat()).unwrap();
    TakeFile::append(&path, &all).unwrap();
    TakeFile::append(&path, &join(0.0, 0.26, &[])).unwrap();
    let appended = fs::read(&path).unwrap();

    let empty = encode(&still(GaussianArrays::default())).unwrap();
    let nothing = write_take(&TakeMeta::default(), &empty, &[], 0).unwrap();
    vec![("takes/segments", segments), ("takes/appended", appended), ("takes/nothing", nothing)]
}
