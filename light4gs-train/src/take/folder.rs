//! The folder of a take in training: a run for the base, a run for each segment, and the file that they give.

use std::io::Write;
use std::path::{Path, PathBuf};

use light4gs_codec::take::{NewSegment, TakeMeta, write_take};
use light4gs_codec::{Limits, legal_name, read_stream};
use light4gs_data::{DataError, Scene, is_temporary_name, read_regular_file, sweep_leftovers, write_atomically};
use light4gs_model::FieldKind;
use serde::{Deserialize, Serialize};

use super::base::HIDDEN;
use super::plan::{PlannedSegment, TakePlan};
use crate::config::{Config, MAX_CONFIG_BYTES, Overrides};
use crate::error::TrainError;
use crate::run::RunFolder;
use crate::sampling::SamplerKind;

/// Names the take's dataset, and has its plan.
const RECORD: &str = "take.json";
const CONFIG: &str = "config.toml";
/// The file of the base, from the folder of a segment's run.
const BASE_FROM_SEGMENT: &str = "../../base/scene.l4gs";
/// Images of the base, about: enough to see every place several times, few enough to be read quickly.
const BASE_IMAGES: usize = 300;
const FEWEST_BASE_TIMES: usize = 24;
/// The cap on Gaussians of a segment, as a share of that of a clip: the base has what stands still.
pub const SEGMENT_SHARE: f64 = 0.5;
/// MiB of decoded images that any training keeps.
const LEAST_IN_MEMORY: u64 = 16;
/// At most, bytes of a take's front without the rows of its segments, and of a row with the hidden list of a segment.
const FRONT_BYTES: usize = 1500;
const ROW_BYTES: usize = 500;

/// `take.json`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TakeRecord {
    /// Absolute path of the dataset.
    pub scene: PathBuf,
    /// Times from which the base is trained.
    pub base_times: usize,
    /// MiB of the training images of the longest segment: the base keeps no more in memory than that.
    pub images_of_segment_mib: u64,
    /// The segments.
    pub plan: TakePlan,
}

/// The folder of a take.
#[derive(Clone, Debug)]
pub struct TakeFolder {
    root: PathBuf,
    record: TakeRecord,
    config: Config,
}

impl TakeFolder {
    /// Makes the folder of a take, or opens it where it holds the same one already.
    ///
    /// # Errors
    /// [`TrainError::Input`] for a folder that holds something else; [`TrainError::Data`] for one that cannot be written.
    pub fn create(
        root: &Path,
        scene: &Path,
        data: &Scene,
        plan: TakePlan,
        config: &Config,
    ) -> Result<Self, TrainError> {
        let cameras = (data.train.len() / plan.frames.max(1)).max(1);
        let record = TakeRecord {
            scene: std::path::absolute(scene).map_err(DataError::io("find", scene))?,
            base_times: (BASE_IMAGES / cameras).max(FEWEST_BASE_TIMES),
            images_of_segment_mib: images_of_segment(data, &plan).div_ceil(1 << 20),
            plan,
        };
        let folder = Self { root: root.to_owned(), record, config: config.clone() };
        if root.join(RECORD).exists() {
            let found = Self::open(root)?;
            if found.record != folder.record || found.config != folder.config {
                return Err(TrainError::Input(format!(
                    "{} holds a take of another dataset, plan or configuration; name another folder, or remove that one",
                    root.display()
                )));
            }
            return Ok(found);
        }
        if let Some(name) = foreign(root) {
            let root = root.display();
            return Err(TrainError::Input(format!(
                "{root} holds files but no take, among them `{name}`; name another folder"
            )));
        }
        std::fs::create_dir_all(root).map_err(DataError::io("create", root))?;
        sweep_leftovers(root);
        write_atomically(&root.join(CONFIG), |file| file.write_all(config.to_toml().as_bytes()))?;
        folder.write_record()?;
        Ok(folder)
    }

    fn write_record(&self) -> Result<(), TrainError> {
        let text = serde_json::to_string_pretty(&self.record).expect("plain data has a JSON form");
        Ok(write_atomically(&self.root.join(RECORD), |file| writeln!(file, "{text}"))?)
    }

    /// Takes in the frames that a longer take has after those of this one: its base and its segments stay as they are.
    ///
    /// # Errors
    /// [`TrainError::Input`] where a segment is not trained yet, and as [`TakePlan::extended`].
    pub fn extend(&mut self, scene: &Path, data: &Scene, seconds: f64, cuts: &[usize]) -> Result<(), TrainError> {
        let scene = std::path::absolute(scene).map_err(DataError::io("find", scene))?;
        if scene == self.record.scene && self.record.plan.has_all_of(data) {
            // An extension that was stopped goes on.
            return Ok(());
        }
        if let Some(number) = (0..self.record.plan.segments.len()).find(|number| !self.is_trained(*number)) {
            let root = self.root.display();
            return Err(TrainError::Input(format!(
                "segment {number} of {root} is not trained yet; finish it first, with the `train` command that began the take"
            )));
        }
        self.record.plan = self.record.plan.extended(data, seconds, cuts)?;
        self.record.scene = scene;
        self.write_record()
    }

    /// Opens the folder of a take.
    ///
    /// # Errors
    /// [`TrainError::Input`] if there is none, or if its record is damaged; [`TrainError::Config`] for its configuration.
    pub fn open(root: &Path) -> Result<Self, TrainError> {
        let path = root.join(RECORD);
        let shown = root.display();
        if !path.is_file() {
            return Err(TrainError::Input(format!("{shown} is not the folder of a take: it has no {RECORD}")));
        }
        let bytes = read_regular_file(&path, MAX_CONFIG_BYTES).map_err(DataError::io("read", &path))?;
        let record = serde_json::from_slice(&bytes).map_err(|error| {
            TrainError::Input(format!("{} is damaged: {error}; begin the take in another folder", path.display()))
        })?;
        Ok(Self { root: root.to_owned(), record, config: Config::from_file(root.join(CONFIG))? })
    }

    /// Whether this is the folder of a take.
    pub fn is_one(root: &Path) -> bool {
        root.join(RECORD).is_file()
    }

    /// What the take is.
    pub fn record(&self) -> &TakeRecord {
        &self.record
    }

    /// The configuration that base and segments have in common.
    pub fn config(&self) -> &Config {
        &self.config
    }

    /// The folder itself.
    pub fn root(&self) -> &Path {
        &self.root
    }

    /// The run of the base.
    pub fn base(&self) -> PathBuf {
        self.root.join("base")
    }

    /// The run of a segment.
    pub fn segment(&self, number: usize) -> PathBuf {
        self.root.join("segments").join(format!("{number:04}"))
    }

    /// The file of the take.
    pub fn file(&self) -> PathBuf {
        self.root.join("take.l4gs")
    }

    /// The configuration of the base: nothing moves, and few times are used, in any order. `compression.target_bytes` is that of
    /// the take; the base has a share of it.
    pub fn config_of_base(&self) -> Config {
        let plan = &self.record.plan;
        let growth = plan.base_growth;
        let mut config = self.config.for_schedule(growth, &Overrides::default());
        let most = &mut config.train.densify.strategies.adaptive.max_gaussians;
        *most = (*most as f64 * growth).round() as usize;
        config.model.field = FieldKind::Still;
        config.data.most_times = Some(self.record.base_times);
        let in_memory = &mut config.data.memory_limit_mib;
        *in_memory = self.record.images_of_segment_mib.clamp(LEAST_IN_MEMORY, *in_memory);
        config.train.sampling = SamplerKind::Shuffled;
        config.train.guided_sampling.iterations.clear();
        config.train.losses.photometric.l2_until = 0;
        config.compression.target_bytes = (self.config.compression.target_bytes as f64 * plan.base_share()) as usize;
        // What moves is missing in it: its quality says nothing, and all test views of the take would be measured.
        config.compression.target_db = 0.0;
        config.eval.splits.clear();
        config.eval.interval = 0;
        config
    }

    /// The configuration of a segment. `compression.target_bytes` is that of the take; what the base leaves of it is shared alike.
    ///
    /// # Errors
    /// [`TrainError::Input`] where the take has a target that the base alone exceeds; [`TrainError::Data`] where the base is
    /// not there yet.
    pub fn config_of_segment(&self, segment: &PlannedSegment) -> Result<Config, TrainError> {
        let mut config = self.config.clone();
        config.model.base = Some(BASE_FROM_SEGMENT.into());
        config.data.between = self.record.plan.between(segment);
        let most = &mut config.train.densify.strategies.adaptive.max_gaussians;
        *most = (*most as f64 * SEGMENT_SHARE).ceil() as usize;
        let target = config.compression.target_bytes;
        if target > 0 {
            let file = self.base().join("scene.l4gs");
            let base = std::fs::metadata(&file).map_err(DataError::io("read", &file))?.len() as usize;
            let count = self.record.plan.segments.len();
            let each = target.saturating_sub(base + FRONT_BYTES) / count;
            config.compression.target_bytes = each.saturating_sub(ROW_BYTES);
            if config.compression.target_bytes == 0 {
                return Err(TrainError::Input(format!(
                    "--target-bytes {target}: the base of this take has {base} bytes, which leaves nothing for its {count} segments; \
                     give at least {}",
                    2 * (base + FRONT_BYTES + count * ROW_BYTES)
                )));
            }
        }
        Ok(config)
    }

    /// The segments whose files are there, by number.
    pub fn trained(&self) -> Vec<usize> {
        (0..self.record.plan.segments.len()).filter(|number| self.is_trained(*number)).collect()
    }

    fn is_trained(&self, number: usize) -> bool {
        // `bit_maps.json` is the last file that encoding writes.
        let run = self.segment(number);
        let coded = self.config.compression.profile.coded().is_some();
        run.join("scene.l4gs").is_file() && (!coded || run.join("bit_maps.json").is_file())
    }

    /// Writes the file of the take from the segments that are trained. Returns its bytes.
    ///
    /// # Errors
    /// [`TrainError::Input`] where the base is not trained yet; [`TrainError::Codec`] for a file of a run that is damaged.
    pub fn join(&self) -> Result<u64, TrainError> {
        let base_file = self.base().join("scene.l4gs");
        if !base_file.is_file() {
            return Err(TrainError::Input(format!(
                "{} has no base yet, without which nothing can be shown; go on with the training first",
                self.root.display()
            )));
        }
        let limits = Limits::large();
        let (base, info) = read_stream(&base_file, &limits)?;
        let mut segments = Vec::new();
        for number in self.trained() {
            let run = self.segment(number);
            let (stream, _) = read_stream(&run.join("scene.l4gs"), &limits)?;
            let (folder, ..) = RunFolder::open(&run)?;
            let hidden: Vec<u32> = folder.read_json(HIDDEN)?.unwrap_or_default();
            let times = self.record.plan.times(&self.record.plan.segments[number]);
            segments.push(NewSegment { times, hidden: bits(&hidden, info.gaussian_count as usize), stream });
        }
        let plan = &self.record.plan;
        let name = self.record.scene.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
        let meta = TakeMeta {
            name: legal_name(&name),
            fps: (1.0 / plan.interval()) as f32,
            seconds: plan.seconds,
            ..TakeMeta::default()
        };
        let spare = plan.segments.len() - segments.len();
        let bytes = write_take(&meta, &base, &segments, spare as u32)?;
        write_atomically(&self.file(), |file| file.write_all(&bytes))?;
        Ok(bytes.len() as u64)
    }
}

/// Bytes of the decoded training images of the longest segment.
fn images_of_segment(data: &Scene, plan: &TakePlan) -> u64 {
    let all: u64 =
        data.train.iter().map(|frame| 3 * u64::from(frame.camera.width) * u64::from(frame.camera.height)).sum();
    let longest = plan.segments.iter().map(|segment| segment.trained_frames).max().unwrap_or(0);
    all / plan.frames.max(1) as u64 * longest as u64
}

/// What lies in a folder and is not of a take that was stopped before it had its record.
fn foreign(root: &Path) -> Option<String> {
    let names = root.read_dir().into_iter().flatten().flatten();
    let mut names = names.map(|entry| entry.file_name().to_string_lossy().into_owned());
    names.find(|name| name != CONFIG && !is_temporary_name(name))
}

/// A bit for each Gaussian of the base, set where it is hidden; empty where none is.
fn bits(hidden: &[u32], count: usize) -> Vec<bool> {
    if hidden.is_empty() {
        return Vec::new();
    }
    let mut bits = vec![false; count];
    for &index in hidden {
        if let Some(bit) = bits.get_mut(index as usize) {
            *bit = true;
        }
    }
    bits
}

#[cfg(test)]
mod tests {
    use light4gs_data::{Camera, Frame, PointCloud, SplitFrames};

    use super::super::plan::SegmentLength;
    use super::*;

    /// A take of one camera with images of `side` × `side` pixels, and its plan of segments of two seconds.
    fn take(seconds: usize, side: u32) -> (Scene, TakePlan) {
        let camera = Camera::look_at([4.0, 0.0, 0.5].into(), [0.0; 3].into(), [0.0, 0.0, 1.0].into(), 0.7, side, side);
        let count = 30 * seconds;
        let frame = |k| Frame::without_image(format!("{k}"), camera, k as f32 / (count - 1) as f32);
        let train: Vec<Frame> = (0..count).map(frame).collect();
        let frames = SplitFrames { test: train[..1].to_vec(), train, ..SplitFrames::default() };
        let scene = Scene::new("memory", Path::new("take"), frames, PointCloud::random(60, 0.8, 0), [1.0; 3]).unwrap();
        let plan = TakePlan::of(&scene, seconds as f64, SegmentLength::Seconds(2.0), &[]).unwrap();
        (scene, plan)
    }

    fn folder(root: &Path, seconds: usize, side: u32, config: &Config) -> TakeFolder {
        let (scene, plan) = take(seconds, side);
        TakeFolder::create(&root.join("take"), Path::new("take"), &scene, plan, config).unwrap()
    }

    /// A longer take needs no more memory: the base is trained from images of all of it, and decodes those that have no room again.
    #[test]
    fn the_base_keeps_no_more_images_than_a_segment_has() {
        let config = Config::default();
        let in_memory = |seconds, side| {
            let root = tempfile::tempdir().unwrap();
            folder(root.path(), seconds, side, &config).config_of_base().data.memory_limit_mib
        };
        // A segment in the middle has 60 frames and some of its neighbors.
        let short = in_memory(8, 320);
        assert!((18..=24).contains(&short), "{short} MiB");
        assert_eq!(in_memory(60, 320), short);
        // Never fewer than any training keeps, and never more than the configuration allows.
        assert_eq!(in_memory(8, 32), LEAST_IN_MEMORY);
        assert_eq!(in_memory(8, 4000), config.data.memory_limit_mib);
    }

    #[test]
    fn what_the_base_leaves_of_a_target_is_shared_alike() {
        let root = tempfile::tempdir().unwrap();
        let mut config = Config::default();
        config.compression.target_bytes = 100_000;
        let folder = folder(root.path(), 8, 32, &config);
        let of_base = folder.config_of_base().compression.target_bytes;
        assert!(of_base > 0 && of_base < config.compression.target_bytes);
        let segments = &folder.record.plan.segments;
        assert!(folder.config_of_segment(&segments[0]).is_err(), "there is no base yet");
        std::fs::create_dir_all(folder.base()).unwrap();
        std::fs::write(folder.base().join("scene.l4gs"), vec![0; of_base]).unwrap();
        let each: Vec<usize> =
            segments.iter().map(|one| folder.config_of_segment(one).unwrap().compression.target_bytes).collect();
        let sum = of_base + each.iter().sum::<usize>();
        assert!(each.iter().all(|bytes| *bytes == each[0]) && sum <= 100_000 && sum > 90_000, "{of_base} and {each:?}");
        // A base that is too large is an error that names a target for which there would be room.
        std::fs::write(folder.base().join("scene.l4gs"), vec![0; 100_000]).unwrap();
        let error = folder.config_of_segment(&segments[0]).unwrap_err().to_string();
        assert!(error.contains("--target-bytes 100000") && error.contains("at least 2"), "{error}");
    }
}
