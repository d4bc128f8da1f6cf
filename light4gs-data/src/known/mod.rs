//! Is a folder a copy of a scene that others have too, and is the copy whole?
//!
//! `scenes.json` has the names of the files of each known scene and a short hash of their bytes. Pixels are not compared: a
//! picture that was stored anew differs, although it may look the same.

mod table;

use crate::digest::Content;
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, HashMap};
use std::fmt;
use std::path::Path;
use std::sync::LazyLock;
use table::FileTable;

/// A scene that many have, by name and files.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
struct KnownScene {
    name: String,
    /// Who made it, such as `D-NeRF`.
    source: String,
    /// What a difference may come from, if not from a damaged copy.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    hint: String,
    files: FileTable,
}

/// What a folder is a copy of; [`KnownCopy::of`] finds it. As text it is a sentence without its end.
///
/// ```
/// use light4gs_data::KnownCopy;
///
/// # let folder = tempfile::tempdir().unwrap();
/// if let Some(copy) = KnownCopy::of(folder.path()) {
///     println!("this folder is {copy}"); // such as: lego (D-NeRF), complete: all 84 files are the same
/// }
/// ```
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct KnownCopy {
    /// Name of the scene, such as `bouncingballs`.
    pub name: String,
    /// Who made it, such as `D-NeRF`.
    pub source: String,
    /// Number of files that the scene has.
    pub files: usize,
    /// Files with other bytes, relative to the folder, in the order of their names.
    pub differing: Vec<String>,
    /// Files that are not there, or that cannot be read.
    pub missing: Vec<String>,
    /// What a difference may come from, if not from a damaged copy; may be empty.
    pub hint: String,
}

/// Of a folder with fewer equal files nothing is said: one alone may be equal by chance, such as a mask that is all black.
const LEAST_EQUAL: usize = 2;
/// Files that are named in the text.
const NAMED: usize = 3;

static KNOWN: LazyLock<Vec<KnownScene>> = LazyLock::new(|| {
    serde_json::from_str(include_str!("scenes.json")).expect("the table of known scenes, which a test reads")
});

impl KnownCopy {
    /// The known scene of which this folder has the most files; none if it has hardly any of one. Files beyond those of the
    /// scene do not count.
    ///
    /// Of a file larger than 32 KiB only eight blocks of 4 KiB are read, so hundreds of images take milliseconds.
    pub fn of(folder: &Path) -> Option<Self> {
        Self::among(&KNOWN, folder)
    }

    /// Whether no file differs, and none is missing.
    pub fn is_complete(&self) -> bool {
        self.differing.is_empty() && self.missing.is_empty()
    }

    fn among(known: &[KnownScene], folder: &Path) -> Option<Self> {
        // Scenes of one layout have the same names: each file is read once.
        let mut read: HashMap<String, Option<String>> = HashMap::new();
        let copies = known.iter().map(|scene| Self::compared(scene, folder, &mut read));
        copies.max_by_key(Self::equal).filter(|copy| copy.equal() >= LEAST_EQUAL)
    }

    fn compared(scene: &KnownScene, folder: &Path, read: &mut HashMap<String, Option<String>>) -> Self {
        let (mut differing, mut missing) = (Vec::new(), Vec::new());
        let expected: BTreeMap<String, String> = scene.files.expanded();
        let files = expected.len();
        for (file, hash) in expected {
            let found =
                read.entry(file.clone()).or_insert_with(|| Some(Content::of(&folder.join(&file)).ok()?.short()));
            match found {
                Some(found) if *found == hash => {}
                Some(_) => differing.push(file),
                None => missing.push(file),
            }
        }
        Self {
            name: scene.name.clone(),
            source: scene.source.clone(),
            files,
            differing,
            missing,
            hint: scene.hint.clone(),
        }
    }

    fn equal(&self) -> usize {
        self.files - self.differing.len() - self.missing.len()
    }
}

impl fmt::Display for KnownCopy {
    fn fmt(&self, out: &mut fmt::Formatter) -> fmt::Result {
        write!(out, "{} ({}), ", self.name, self.source)?;
        if self.is_complete() {
            return write!(out, "complete: all {} files are the same", self.files);
        }
        write!(out, "but of its {} files ", self.files)?;
        let parts = [(&self.differing, ["differs", "differ"]), (&self.missing, ["is missing", "are missing"])];
        let parts: Vec<String> = parts
            .into_iter()
            .filter(|(files, _)| !files.is_empty())
            .map(|(files, what)| {
                let more = if files.len() > NAMED { ", ..." } else { "" };
                let verb = what[usize::from(files.len() > 1)];
                format!("{} {verb} ({}{more})", files.len(), files[..files.len().min(NAMED)].join(", "))
            })
            .collect();
        out.write_str(&parts.join(" and "))?;
        if !self.differing.is_empty() && !self.hint.is_empty() {
            write!(out, "; {}", self.hint)?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    fn folder_with(files: &[(&str, &str)]) -> tempfile::TempDir {
        let folder = tempfile::tempdir().unwrap();
        for (file, text) in files {
            let path = folder.path().join(file);
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            fs::write(path, text).unwrap();
        }
        folder
    }

    fn scene_of(name: &str, folder: &Path) -> KnownScene {
        KnownScene {
            name: name.into(),
            source: "Ours".into(),
            hint: String::new(),
            files: FileTable::of(folder).unwrap(),
        }
    }

    const FILES: [(&str, &str); 4] =
        [("transforms_train.json", "{}"), ("train/r_0.png", "a"), ("train/r_1.png", "b"), ("test/r_000.png", "c")];

    #[test]
    fn a_copy_is_recognized_and_its_faults_are_named() {
        let folder = folder_with(&FILES);
        let other = folder_with(&[("transforms_train.json", "{ }"), ("train/r_0.png", "x"), ("train/r_1.png", "y")]);
        let known = [scene_of("other", other.path()), scene_of("balls", folder.path())];
        let copy = || KnownCopy::among(&known, folder.path());
        let said = || copy().expect("it is recognized").to_string();
        assert_eq!(said(), "balls (Ours), complete: all 4 files are the same");
        assert!(copy().unwrap().is_complete());
        // More files do no harm.
        fs::write(folder.path().join("notes.txt"), "mine").unwrap();
        assert!(copy().unwrap().is_complete());
        fs::write(folder.path().join("train/r_1.png"), "B").unwrap();
        assert_eq!(said(), "balls (Ours), but of its 4 files 1 differs (train/r_1.png)");
        fs::remove_file(folder.path().join("test/r_000.png")).unwrap();
        assert_eq!(
            said(),
            "balls (Ours), but of its 4 files 1 differs (train/r_1.png) and 1 is missing (test/r_000.png)"
        );
        // What is left may be chance.
        fs::remove_file(folder.path().join("train/r_0.png")).unwrap();
        assert_eq!(copy(), None);
    }

    #[test]
    fn a_hint_is_given_where_files_differ() {
        let folder = folder_with(&FILES);
        let known = [KnownScene { hint: "another processor".into(), ..scene_of("balls", folder.path()) }];
        assert!(!KnownCopy::among(&known, folder.path()).unwrap().to_string().contains("processor"));
        fs::write(folder.path().join("train/r_1.png"), "B").unwrap();
        assert!(KnownCopy::among(&known, folder.path()).unwrap().to_string().ends_with("; another processor"));
    }

    #[test]
    fn a_folder_of_another_scene_is_none() {
        assert_eq!(KnownCopy::of(tempfile::tempdir().unwrap().path()), None);
        assert_eq!(KnownCopy::of(Path::new("no such folder")), None);
        assert_eq!(KnownCopy::of(folder_with(&FILES).path()), None);
    }

    /// The table can be read, its names are unique, and no two scenes are taken for each other.
    #[test]
    fn the_table_of_known_scenes_is_sound() {
        let mut names: Vec<&str> = KNOWN.iter().map(|scene| scene.name.as_str()).collect();
        names.sort_unstable();
        assert!(names.windows(2).all(|pair| pair[0] != pair[1]), "a name stands twice: {names:?}");
        for scene in KNOWN.iter() {
            let files = scene.files.expanded();
            assert!(files.len() > 50, "{} has {} files", scene.name, files.len());
            let others = KNOWN.iter().filter(|other| other.name != scene.name);
            for other in others {
                let shared =
                    other.files.expanded().iter().filter(|(file, hash)| files.get(*file) == Some(hash)).count();
                assert!(shared < LEAST_EQUAL, "{} and {} share {shared} files", scene.name, other.name);
            }
        }
    }

    /// Adds scenes to the table, or replaces them:
    /// `LIGHT4GS_KNOWN='D-NeRF/lego=/data/dnerf/lego' cargo test -p light4gs-data known`. Several are separated by spaces.
    #[test]
    fn scenes_are_added_to_the_table_on_demand() {
        let Ok(wanted) = std::env::var("LIGHT4GS_KNOWN") else { return };
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("src/known/scenes.json");
        let mut scenes: Vec<KnownScene> = serde_json::from_str(&fs::read_to_string(&path).unwrap()).unwrap();
        for item in wanted.split_whitespace() {
            let (title, folder) = item.split_once('=').expect("SOURCE/NAME=FOLDER");
            let (source, name) = title.split_once('/').expect("SOURCE/NAME");
            let hint =
                scenes.iter().find(|scene| scene.source == source).map_or_else(String::new, |scene| scene.hint.clone());
            let files = FileTable::of(Path::new(folder)).unwrap();
            scenes.retain(|scene| scene.name != name);
            scenes.push(KnownScene { name: name.into(), source: source.into(), hint, files });
        }
        scenes.sort_by(|a, b| (&a.source, &a.name).cmp(&(&b.source, &b.name)));
        fs::write(&path, serde_json::to_string_pretty(&scenes).unwrap() + "\n").unwrap();
    }

    /// Of a large file samples are read, and its length counts as well.
    #[test]
    fn a_byte_behind_a_large_file_is_noticed() {
        let folder = folder_with(&FILES);
        let large = folder.path().join("train/r_0.png");
        fs::write(&large, vec![7; 100_000]).unwrap();
        let known = [scene_of("balls", folder.path())];
        for length in [99_999, 100_001] {
            fs::write(&large, vec![7; length]).unwrap();
            assert_eq!(KnownCopy::among(&known, folder.path()).unwrap().differing, ["train/r_0.png"], "{length}");
        }
    }
}
