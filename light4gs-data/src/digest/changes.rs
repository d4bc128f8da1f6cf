//! The difference between two digests, as text.

use super::{DatasetDigest, FrameDigest};
use std::collections::HashMap;

/// Numbers that were converted between image sizes may differ in the last bits.
const TOLERANCE: f32 = 1e-4;

pub(super) fn between(before: &DatasetDigest, after: &DatasetDigest) -> Vec<String> {
    let mut changes = Vec::new();
    if before.layout != after.layout {
        changes.push(format!("the layout was `{}` and is `{}`", before.layout, after.layout));
    }
    for split in ["train", "test", "val"] {
        let of = |digest: &'_ DatasetDigest| -> Vec<FrameDigest> {
            digest.frames.iter().filter(|frame| frame.split == split).cloned().collect()
        };
        changes.extend(of_split(split, &of(before), &of(after)));
    }
    if before.points != after.points {
        changes.push("the point cloud is another one".into());
    }
    changes
}

/// A file, and the number of the frame among those with this file.
type Key<'a> = (&'a str, usize);

fn keyed(frames: &[FrameDigest]) -> Vec<(Key<'_>, &FrameDigest)> {
    let mut seen: HashMap<&str, usize> = HashMap::new();
    frames
        .iter()
        .map(|frame| {
            let count = seen.entry(&frame.file).or_default();
            *count += 1;
            ((frame.file.as_str(), *count), frame)
        })
        .collect()
}

fn of_split(split: &str, before: &[FrameDigest], after: &[FrameDigest]) -> Vec<String> {
    let (before, after) = (keyed(before), keyed(after));
    let old: HashMap<Key, &FrameDigest> = before.iter().copied().collect();
    let new: HashMap<Key, &FrameDigest> = after.iter().copied().collect();
    let mut changes = Vec::new();
    let mut say = |files: Vec<&str>, what: &dyn Fn(&str) -> String| {
        if let Some(first) = files.first() {
            let (count, plural) = (files.len(), if files.len() == 1 { "" } else { "s" });
            let which = if count == 1 { format!(": {first}") } else { format!(", the first is {first}") };
            changes.push(format!("{split}: {}{which}", what(&format!("{count} frame{plural}"))));
        }
    };
    let were = |frames: &str| if frames.starts_with("1 ") { "was" } else { "were" };
    let lacking = |from: &[(Key<'_>, &FrameDigest)], other: &HashMap<Key, &FrameDigest>| -> Vec<String> {
        from.iter().filter(|(key, _)| !other.contains_key(key)).map(|(key, _)| key.0.to_owned()).collect()
    };
    let (removed, added) = (lacking(&before, &new), lacking(&after, &old));
    say(removed.iter().map(String::as_str).collect(), &|frames| format!("{frames} {} removed", were(frames)));
    say(added.iter().map(String::as_str).collect(), &|frames| format!("{frames} {} added", were(frames)));
    let kept_before = before.iter().filter(|(key, _)| new.contains_key(key)).map(|(key, _)| key);
    let kept_after = after.iter().filter(|(key, _)| old.contains_key(key)).map(|(key, _)| key);
    let moved: Vec<&str> = kept_before.zip(kept_after).filter(|(a, b)| a != b).map(|(_, b)| b.0).collect();
    say(moved, &|frames| format!("{frames} stand{} in another order", if frames.starts_with("1 ") { "s" } else { "" }));
    let kept: Vec<(&str, &FrameDigest, &FrameDigest)> =
        after.iter().filter_map(|(key, new)| Some((key.0, *old.get(key)?, *new))).collect();
    let differing = |test: fn(&FrameDigest, &FrameDigest) -> bool| -> Vec<&str> {
        kept.iter().filter(|(_, old, new)| test(old, new)).map(|(file, _, _)| *file).collect()
    };
    say(differing(|a, b| a.content != b.content || a.size != b.size), &|frames| {
        let images = if frames.starts_with("1 ") { "the image of 1 frame was" } else { "" };
        if images.is_empty() { format!("the images of {frames} were replaced") } else { format!("{images} replaced") }
    });
    say(differing(|a, b| a.mask != b.mask), &|frames| format!("masks of {frames} changed"));
    say(differing(|a, b| far(&a.pose, &b.pose)), &|frames| format!("poses of {frames} changed"));
    say(differing(|a, b| far(&a.intrinsics, &b.intrinsics) || a.lens != b.lens), &|frames| {
        format!("intrinsics of {frames} changed")
    });
    say(differing(|a, b| far(&[a.time], &[b.time])), &|frames| format!("times of {frames} changed"));
    changes
}

fn far(a: &[f32], b: &[f32]) -> bool {
    a.iter().zip(b).any(|(a, b)| (a - b).abs() > TOLERANCE * a.abs().max(1.0))
}

#[cfg(test)]
mod tests {
    use super::super::content::Content;
    use super::*;

    fn frame(file: &str) -> FrameDigest {
        let content: Content = serde_json::from_str("{\"length\": 1, \"hash\": \"00\"}").unwrap();
        FrameDigest {
            split: "train".into(),
            file: file.into(),
            size: [8, 8],
            content,
            mask: None,
            time: 0.5,
            pose: [0.0; 12],
            intrinsics: [1.0, 1.0, 0.5, 0.5],
            lens: String::new(),
        }
    }

    fn digest(frames: Vec<FrameDigest>) -> DatasetDigest {
        DatasetDigest { layout: "dnerf".into(), frames, points: "aa".into() }
    }

    #[test]
    fn every_change_is_said() {
        let before = digest(["a", "b", "c", "d"].map(frame).into());
        assert!(before.changes_since(&before).is_empty());
        let text = serde_json::to_string(&before).unwrap();
        assert_eq!(serde_json::from_str::<DatasetDigest>(&text).unwrap(), before);
        let changes = |change: &dyn Fn(&mut DatasetDigest)| {
            let mut after = before.clone();
            change(&mut after);
            after.changes_since(&before)
        };
        assert_eq!(changes(&|d| drop(d.frames.remove(1))), ["train: 1 frame was removed: b"]);
        assert_eq!(changes(&|d| drop(d.frames.drain(1..3))), ["train: 2 frames were removed, the first is b"]);
        assert_eq!(changes(&|d| d.frames.insert(0, frame("x"))), ["train: 1 frame was added: x"]);
        // The same file twice: the second is another frame.
        assert_eq!(changes(&|d| d.frames.push(frame("a"))), ["train: 1 frame was added: a"]);
        assert_eq!(changes(&|d| d.frames.swap(0, 2)), ["train: 2 frames stand in another order, the first is c"]);
        assert_eq!(changes(&|d| d.frames[2].size = [9, 8]), ["train: the image of 1 frame was replaced: c"]);
        assert_eq!(changes(&|d| d.frames[2].pose[3] = 0.1), ["train: poses of 1 frame changed: c"]);
        assert_eq!(changes(&|d| d.frames[2].intrinsics[0] = 1.1), ["train: intrinsics of 1 frame changed: c"]);
        assert!(changes(&|d| d.frames[2].intrinsics[0] = 1.00001).is_empty());
        assert_eq!(changes(&|d| d.frames[2].lens = "x".into()), ["train: intrinsics of 1 frame changed: c"]);
        assert_eq!(changes(&|d| d.frames[0].time = 0.4), ["train: times of 1 frame changed: a"]);
        assert_eq!(changes(&|d| d.points = "bb".into()), ["the point cloud is another one"]);
        assert_eq!(changes(&|d| d.layout = "colmap".into()), ["the layout was `dnerf` and is `colmap`"]);
        let to_test = changes(&|d| d.frames[3].split = "test".into());
        assert_eq!(to_test, ["train: 1 frame was removed: d", "test: 1 frame was added: d"]);
    }
}
