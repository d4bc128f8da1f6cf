//! What lies in a capture's folder and is not used.

use super::all;
use crate::layouts::shared::files::{entries, is_image, name_of};
use crate::scene::Scene;
use std::collections::HashSet;
use std::path::{Path, PathBuf};

/// Entries of folders that are looked at.
const MOST_ENTRIES: usize = 20_000;
/// Folders and images that are named.
const MOST_NAMED: usize = 6;
/// How deep folders are looked into.
const DEEPEST: usize = 4;

/// Folders of images of which none is used, and images that are not used beside others that are, with their number.
/// Empty if there are none.
pub(super) fn unused(scene: &Scene) -> String {
    let masks = all(scene).filter_map(|frame| Some(frame.mask.as_ref()?.path.as_path()));
    let used: HashSet<&Path> = all(scene).map(|frame| frame.path.as_path()).chain(masks).collect();
    let mut walk = Walk { used: &used, left: MOST_ENTRIES, found: Vec::new() };
    walk.folder(&scene.root, 0);
    let more = walk.found.len().saturating_sub(MOST_NAMED);
    let name = |(path, count): &(PathBuf, usize)| {
        let path = path.strip_prefix(&scene.root).unwrap_or(path).display().to_string();
        let path = if path.is_empty() { "the folder itself".to_owned() } else { path };
        format!("{count} {} in {path}", if *count == 1 { "image" } else { "images" })
    };
    let mut parts: Vec<String> = walk.found.iter().take(MOST_NAMED).map(name).collect();
    if more > 0 {
        parts.push(format!("{more} other folders"));
    }
    parts.join(", ")
}

struct Walk<'a> {
    used: &'a HashSet<&'a Path>,
    /// Entries that may still be looked at.
    left: usize,
    found: Vec<(PathBuf, usize)>,
}

impl Walk<'_> {
    fn folder(&mut self, folder: &Path, depth: usize) {
        let Ok(paths) = entries(folder, |_| true) else { return };
        let paths = &paths[..paths.len().min(self.left)];
        self.left -= paths.len();
        let unused = paths.iter().filter(|path| is_image(path) && !self.used.contains(path.as_path())).count();
        if unused > 0 {
            self.found.push((folder.to_path_buf(), unused));
        }
        // Links are not followed: they may lead in a circle.
        let folders = paths.iter().filter(|path| path.is_dir() && !path.is_symlink() && !name_of(path).is_empty());
        if depth < DEEPEST {
            folders.for_each(|path| self.folder(path, depth + 1));
        }
    }
}
