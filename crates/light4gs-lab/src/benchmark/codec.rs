//! Timing of the entropy coders on a scene of the paper's size, with all threads and with one.

use std::time::Instant;

use burn::module::Param;
use burn::tensor::{Device, Distribution, Tensor};
use light4gs_codec::{
    CompressionInput, FeaturePlaneArrays, OpenStream, Profile, SceneMeta, attributes, encode_compressed, encode_planes,
    encode_sh,
};
use light4gs_data::PointCloud;
use light4gs_model::DynamicScene;
use light4gs_train::compression::{Compression, ConfiguredModels, compression_input};
use light4gs_train::config::Config;
use light4gs_train::error::TrainError;
use light4gs_train::table::{Align, Table};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::ThreadPoolBuilder;
use serde_json::json;

use crate::record::Row;

/// Gaussians of the scene: the number that the paper keeps of *bouncing balls*.
const GAUSSIANS: usize = 12_000;

/// Best time of one part.
#[derive(Clone, Debug)]
pub struct CoderTime {
    /// Its name.
    pub part: &'static str,
    /// Numbers that were coded.
    pub symbols: usize,
    /// With all threads.
    pub milliseconds: f64,
    /// With one thread.
    pub milliseconds_one_thread: f64,
}

impl CoderTime {
    /// Million symbols per second, all threads.
    pub fn megasymbols(&self) -> f64 {
        self.symbols as f64 / self.milliseconds / 1e3
    }
}

/// A scene of the paper's size, with planes and harmonics that vary as trained ones do.
fn scene(config: &Config, device: &Device) -> DynamicScene {
    let mut random = ChaCha8Rng::seed_from_u64(12);
    let positions = (0..GAUSSIANS).map(|_| std::array::from_fn(|_| random.random_range(-1.0..1.0))).collect();
    let colors = (0..GAUSSIANS).map(|_| std::array::from_fn(|_| random.random())).collect();
    device.seed(12);
    let mut scene = config.model.build().init(&PointCloud { positions, colors }, device);
    let vary = |spread: f64, shape: [usize; 3]| Tensor::random(shape, Distribution::Normal(0.0, spread), device);
    let rest = scene.gaussians.sh_rest.dims();
    scene.gaussians.sh_rest = Param::from_tensor(vary(0.05, rest));
    for plane in scene.planes_mut().into_iter().flat_map(|hexplane| &mut hexplane.planes) {
        *plane = Param::from_tensor(plane.val() + vary(0.05, plane.dims()));
    }
    scene
}

/// Times every coder; each time is the best of `repeats`.
///
/// # Errors
/// [`TrainError::Input`] if this build has no back end.
pub fn codec_benchmark(repeats: usize) -> Result<Vec<CoderTime>, TrainError> {
    let device = light4gs_train::device::any()?;
    let config = Config::from_preset("hexplane-dnerf")?;
    let scene = scene(&config, &device);
    let mut compression = Compression::new(&ConfiguredModels, &config, scene.planes(), &device)?;
    compression.start_from(scene.planes());
    let data = scene.to_arrays(SceneMeta::default())?;
    let input: CompressionInput =
        compression_input(&mut compression, &scene, &data, &config.compression, Profile::Compact)?;
    let planes = input.planes.as_ref().expect("the compact profile codes planes");
    let encoded = encode_compressed(&data, &input)?;
    let stream = OpenStream::new(&encoded.bytes)?;
    let (coordinates, gaussians) = (stream.coordinates()?, stream.gaussians()?);
    let no_planes = FeaturePlaneArrays::default();

    let plane_symbols = data.feature_planes.planes.iter().map(|plane| plane.values.len()).sum();
    let sh_symbols = data.gaussians.sh_rest.len();
    let attribute_symbols = GAUSSIANS * 14;
    let all = plane_symbols + sh_symbols + attribute_symbols;
    let one_thread = ThreadPoolBuilder::new().num_threads(1).build().expect("a pool of one thread");
    let best = |work: &(dyn Fn() + Sync)| {
        let time = || {
            let begin = Instant::now();
            work();
            begin.elapsed().as_secs_f64() * 1e3
        };
        let least = |times: Vec<f64>| times.into_iter().fold(f64::INFINITY, f64::min);
        let many = least((0..repeats).map(|_| time()).collect());
        let one = least((0..repeats).map(|_| one_thread.install(time)).collect());
        (many, one)
    };
    let mut times = Vec::new();
    let mut add = |part: &'static str, symbols: usize, work: &(dyn Fn() + Sync)| {
        let (milliseconds, milliseconds_one_thread) = best(work);
        times.push(CoderTime { part, symbols, milliseconds, milliseconds_one_thread });
    };
    // Everything was coded once above without an error, and coding is deterministic.
    add("encode planes", plane_symbols, &|| drop(encode_planes(&data.feature_planes, planes).unwrap()));
    add("decode planes", plane_symbols, &|| drop(stream.feature_planes().unwrap()));
    add("encode spherical harmonics", sh_symbols, &|| {
        drop(encode_sh(&data.gaussians, &input.sh, &coordinates, &no_planes).unwrap());
    });
    add("decode spherical harmonics", sh_symbols, &|| {
        drop(stream.sh(gaussians.clone(), &coordinates, &no_planes).unwrap());
    });
    add("encode attributes", attribute_symbols, &|| {
        drop(attributes::encode(&data.gaussians, &input.attributes).unwrap());
    });
    add("decode attributes", attribute_symbols, &|| drop(stream.gaussians().unwrap()));
    add("encode a scene, checked", all, &|| drop(encode_compressed(&data, &input).unwrap()));
    add("decode a scene", all, &|| drop(light4gs_codec::decode(&encoded.bytes).unwrap()));
    Ok(times)
}

/// A row for each coder.
pub fn codec_rows(times: &[CoderTime]) -> Vec<Row> {
    let of_coder = |time: &CoderTime| {
        let row = json!({
            "part": time.part,
            "symbols": time.symbols,
            "milliseconds": time.milliseconds,
            "milliseconds_one_thread": time.milliseconds_one_thread,
        });
        row.as_object().cloned()
    };
    times.iter().filter_map(of_coder).collect()
}

/// One row for each coder.
pub fn codec_table(times: &[CoderTime]) -> Table {
    let mut table = Table::new([
        ("coder", Align::Left),
        ("symbols", Align::Right),
        ("ms", Align::Right),
        ("Msymbols/s", Align::Right),
        ("ms, one thread", Align::Right),
    ]);
    for time in times {
        table.row([
            time.part.to_owned(),
            time.symbols.to_string(),
            format!("{:.1}", time.milliseconds),
            format!("{:.1}", time.megasymbols()),
            format!("{:.1}", time.milliseconds_one_thread),
        ]);
    }
    table
}
