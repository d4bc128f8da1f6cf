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

/// The changes of a split's frames: removed and added frames, their order, and then differences of frames that are in
/// both digests.
fn of_split(split: &str, before: &[FrameDigest], after: &[FrameDigest]) -> Vec<String> {
    let (before, after) = (KeyedFrames::new(before), KeyedFrames::new(after));
    let kept = kept_frames(&before, &after);
    let differing = |differ: fn(&FrameDigest, &FrameDigest) -> bool| -> Vec<&str> {
        kept.iter().filter(|(old, new)| differ(old, new)).map(|(_, new)| new.file.as_str()).collect()
    };
    let image = differing(|a, b| a.content != b.content || a.size != b.size);
    let mask = differing(|a, b| a.mask != b.mask);
    let pose = differing(|a, b| far(&a.pose, &b.pose));
    let intrinsics = differing(|a, b| far(&a.intrinsics, &b.intrinsics) || a.lens != b.lens);
    let time = differing(|a, b| far(&[a.time], &[b.time]));
    let changes = [
        change(&before.missing_in(&after), |count| format!("{} removed", frames_were(count))),
        change(&after.missing_in(&before), |count| format!("{} added", frames_were(count))),
        change(&moved(&before, &after), |count| format!("{} in another order", frames_stand(count))),
        change(&image, |count| format!("{} replaced", images_were(count))),
        change(&mask, |count| format!("masks of {} changed", frames(count))),
        change(&pose, |count| format!("poses of {} changed", frames(count))),
        change(&intrinsics, |count| format!("intrinsics of {} changed", frames(count))),
        change(&time, |count| format!("times of {} changed", frames(count))),
    ];
    changes.into_iter().flatten().map(|change| format!("{split}: {change}")).collect()
}

/// A file, and the number of the frame among those with this file.
type Key<'a> = (&'a str, usize);

/// Frames in their order, found by their keys.
struct KeyedFrames<'a> {
    in_order: Vec<(Key<'a>, &'a FrameDigest)>,
    by_key: HashMap<Key<'a>, &'a FrameDigest>,
}

impl<'a> KeyedFrames<'a> {
    fn new(frames: &'a [FrameDigest]) -> Self {
        let mut seen: HashMap<&str, usize> = HashMap::new();
        let key = |frame: &'a FrameDigest| {
            let count = seen.entry(&frame.file).or_default();
            *count += 1;
            (frame.file.as_str(), *count)
        };
        let keys: Vec<Key> = frames.iter().map(key).collect();
        let in_order: Vec<_> = keys.into_iter().zip(frames).collect();
        Self { by_key: in_order.iter().copied().collect(), in_order }
    }

    /// Keys of the frames that others have too, in the order of these.
    fn shared_with(&self, others: &Self) -> Vec<Key<'a>> {
        self.in_order.iter().map(|(key, _)| *key).filter(|key| others.by_key.contains_key(key)).collect()
    }

    /// Files of the frames that others do not have.
    fn missing_in(&self, others: &Self) -> Vec<&'a str> {
        let missing = self.in_order.iter().filter(|(key, _)| !others.by_key.contains_key(key));
        missing.map(|(key, _)| key.0).collect()
    }
}

/// The frames of both digests, old and new, in the new order.
fn kept_frames<'a>(before: &KeyedFrames<'a>, after: &KeyedFrames<'a>) -> Vec<(&'a FrameDigest, &'a FrameDigest)> {
    after.in_order.iter().filter_map(|(key, new)| Some((*before.by_key.get(key)?, *new))).collect()
}

/// Files of the kept frames at whose place another kept frame stood.
fn moved<'a>(before: &KeyedFrames<'a>, after: &KeyedFrames<'a>) -> Vec<&'a str> {
    let pairs = before.shared_with(after).into_iter().zip(after.shared_with(before));
    pairs.filter(|(old, new)| old != new).map(|(_, new)| new.0).collect()
}

/// A sentence about some frames, which ends in the only file or the first one; none if there are no frames.
fn change(files: &[&str], sentence: fn(usize) -> String) -> Option<String> {
    let first = files.first()?;
    let which = if files.len() == 1 { format!(": {first}") } else { format!(", the first is {first}") };
    Some(sentence(files.len()) + &which)
}

fn frames(count: usize) -> String {
    if count == 1 { "1 frame".to_owned() } else { format!("{count} frames") }
}

fn frames_were(count: usize) -> String {
    format!("{} {}", frames(count), if count == 1 { "was" } else { "were" })
}

fn frames_stand(count: usize) -> String {
    format!("{} {}", frames(count), if count == 1 { "stands" } else { "stand" })
}

fn images_were(count: usize) -> String {
    if count == 1 { "the image of 1 frame was".to_owned() } else { format!("the images of {count} frames were") }
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
