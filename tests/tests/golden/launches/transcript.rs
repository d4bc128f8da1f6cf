//! Launches and their outcomes as files: `launches.json`, and `blobs.bin` with the contents of the buffers.

use std::collections::{HashMap, HashSet};
use std::path::Path;

use light4gs_model::gpu::{Kernel, RecordedLaunch};
use light4gs_model::ops::kernels;
use light4gs_shaders::SUBGROUPS;
use serde_json::{Value, json};

/// Values of the last of a few launches, as they must be.
pub(super) struct Outcome {
    what: String,
    found: Vec<f32>,
    expected: Vec<f32>,
    tolerance: f32,
}

impl Outcome {
    /// `found` are the values of this machine, by which their place in the buffers is found.
    pub(super) fn within(what: &str, found: Vec<f32>, expected: Vec<f32>, tolerance: f32) -> Self {
        assert_eq!(found.len(), expected.len(), "{what}");
        Self { what: what.to_owned(), found, expected, tolerance }
    }

    /// The tolerance is a share of the largest expected magnitude.
    pub(super) fn within_share(what: &str, found: Vec<f32>, expected: Vec<f32>, share: f32) -> Self {
        let largest = expected.iter().fold(0.0f32, |m, v| m.max(v.abs()));
        Self::within(what, found, expected, share * largest.max(1e-12))
    }

    /// The last place that holds these values: launch, buffer, word.
    fn place(&self, launches: &[RecordedLaunch]) -> Option<[usize; 3]> {
        let places = launches.iter().enumerate().rev().flat_map(|(l, launch)| {
            let buffers = launch.buffers.iter().enumerate();
            buffers.filter_map(move |(b, buffer)| buffer.after.as_ref().map(|bytes| (l, b, bytes)))
        });
        places.into_iter().find_map(|(launch, buffer, bytes)| {
            let words: Vec<f32> = bytes.as_chunks::<4>().0.iter().map(|bytes| f32::from_le_bytes(*bytes)).collect();
            let word = words.windows(self.found.len()).position(|window| window == self.found)?;
            Some([launch, buffer, word])
        })
    }
}

/// Scenes, each a list of launches. A scene refers to kernels and contents by number.
#[derive(Default)]
pub(super) struct Transcript {
    kernels: Vec<Kernel>,
    /// The first kernels are all that the program has.
    listed: usize,
    contents: Vec<u8>,
    /// Start and length of each piece of `contents`, and its number.
    pieces: Vec<[usize; 2]>,
    numbers: HashMap<Vec<u8>, usize>,
    scenes: Vec<Value>,
    launched: HashSet<&'static str>,
}

impl Transcript {
    pub(super) fn new() -> Self {
        let kernels = kernels();
        Self { listed: kernels.len(), kernels, ..Self::default() }
    }

    fn piece(&mut self, bytes: Vec<u8>) -> usize {
        let number = self.pieces.len();
        *self.numbers.entry(bytes).or_insert_with_key(|bytes| {
            self.pieces.push([self.contents.len(), bytes.len()]);
            self.contents.extend(bytes);
            number
        })
    }

    fn kernel(&mut self, kernel: Kernel) -> usize {
        self.kernels.iter().position(|known| *known == kernel).unwrap_or_else(|| {
            self.kernels.push(kernel);
            self.kernels.len() - 1
        })
    }

    pub(super) fn add(&mut self, name: &str, mut launches: Vec<RecordedLaunch>, outcomes: Vec<Outcome>) {
        // The subgroups of this adapter are no rule for others.
        launches.retain(|launch| launch.kernel.name() != SUBGROUPS.name);
        assert!(!launches.is_empty(), "{name}: nothing was launched");
        let outcomes: Vec<Value> = outcomes
            .into_iter()
            .map(|outcome| {
                let [launch, buffer, word] =
                    outcome.place(&launches).unwrap_or_else(|| panic!("{name}: no launch wrote {}", outcome.what));
                let bytes = outcome.expected.iter().flat_map(|value| value.to_le_bytes()).collect();
                let (what, tolerance) = (outcome.what, outcome.tolerance);
                json!({ "what": what, "launch": launch, "buffer": buffer, "word": word, "expected": self.piece(bytes), "tolerance": tolerance })
            })
            .collect();
        let launches: Vec<Value> = launches
            .into_iter()
            .map(|launch| {
                let buffers = launch.buffers.into_iter();
                let buffers: Vec<_> = buffers
                    .map(|buffer| [Some(self.piece(buffer.before)), buffer.after.map(|bytes| self.piece(bytes))])
                    .collect();
                self.launched.insert(launch.kernel.name());
                let kernel = self.kernel(launch.kernel);
                json!({ "kernel": kernel, "groups": launch.groups, "buffers": buffers, "uniform": launch.uniform })
            })
            .collect();
        self.scenes.push(json!({ "name": name, "launches": launches, "outcomes": outcomes }));
    }

    /// Fails if a kernel was launched that the list of all kernels lacks, or if a shader was not launched.
    pub(super) fn assert_complete(&self) {
        let unlisted: Vec<String> = self.kernels[self.listed..].iter().map(Kernel::to_string).collect();
        assert!(unlisted.is_empty(), "launched, but not in the list of all kernels: {unlisted:?}");
        for shader in light4gs_shaders::ALL {
            let launched = self.launched.contains(shader.name) || shader.name == SUBGROUPS.name;
            assert!(launched, "no scene launches {}", shader.name);
        }
    }

    pub(super) fn write(&self, folder: &Path) {
        std::fs::create_dir_all(folder).expect("a folder for the launches");
        let kernels: Vec<Value> =
            self.kernels.iter().map(|kernel| json!({ "name": kernel.to_string(), "text": kernel.text() })).collect();
        let all = json!({ "kernels": kernels, "scenes": self.scenes, "pieces": self.pieces });
        std::fs::write(folder.join("launches.json"), all.to_string()).expect("launches.json");
        std::fs::write(folder.join("blobs.bin"), &self.contents).expect("blobs.bin");
    }
}
