//! The index of a take as JSON for the page.

use std::ops::Range;

use light4gs_codec::take::{SegmentPlace, TakeIndex, TakeMeta};

use crate::description::{list, text};

/// The index: `{"name": ..., "base": [begin, end], "segments": [[begin, end, first byte, end of the bytes], ...]}`.
pub(crate) fn describe_index(index: &TakeIndex) -> String {
    let TakeMeta { name, fps, extra, .. } = index.meta();
    let extra = extra.iter().map(|(key, value)| format!("{}:{}", text(key), text(value)));
    let segments = index.segments().iter().map(|place| {
        let SegmentPlace { times, .. } = place;
        let Range { start, end } = place.range();
        // Rust prints the shortest number that is read back to the same bits.
        format!("[{},{},{start},{end}]", times.begin, times.end)
    });
    format!(
        "{{\"name\":{},\"fps\":{fps},\"seconds\":{},\"base\":{},\"segments\":{},\"extra\":{{{}}}}}",
        text(name),
        index.seconds(),
        list([index.base().start, index.base().end]),
        list(segments),
        extra.collect::<Vec<_>>().join(","),
    )
}

/// The range of the file that the index needs next.
pub(crate) fn describe_range(range: &Range<u64>) -> String {
    format!("{{\"needed\":{}}}", list([range.start, range.end]))
}
