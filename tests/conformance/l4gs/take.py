"""A take: a base, segments in time, and their index: "Takes"."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from . import limits
from .checksum import crc32c
from .container import VERSION, read_extra_entries
from .decoder import decode
from .entropy.range_coder import AdaptiveBit, RangeDecoder
from .errors import Refused
from .networks.arithmetic import exponential, logarithm
from .reader import Reader
from .sections.gaussians import FIRST_ATTRIBUTES
from .sections.motion import Scene

MAGIC = b"\x89L4GT\r\n\x1a"
PRELUDE_BYTES = 44
ROW_BYTES = 64
_LONGEST = 1e9
_CONTEXT_BITS = 6
_MOST_LOGIT = 80
_NAMES = [*(name for name, _ in FIRST_ATTRIBUTES), "sh_rest"]


@dataclass
class Row:
    """A slot of the index that is in use."""

    times: tuple[float, float, float, float]  # begin, end, those of the stream, in seconds of the take
    frames: int
    offset: int
    length: int
    hidden_bytes: int
    checksum: int


@dataclass
class Segment:
    times: tuple[float, float, float, float]
    frames: int
    hidden: list[int]  # a bit for each Gaussian of the base, or nothing
    scene: Scene


@dataclass
class Take:
    base: Scene
    segments: list[Segment]  # by rising begins

    def at(self, seconds: float) -> dict[str, np.ndarray]:
        """The attributes of the Gaussians that are drawn, without further ones."""
        base = {name: self.base.attributes()[name] for name in _NAMES}
        drawn = self._drawn_at(seconds)
        visible = np.ones(len(base["means"]), bool)
        if drawn:
            shown = np.array([~np.array(segment.hidden, bool) if segment.hidden else visible for segment, _ in drawn])
            visible = shown.any(0)
            base["opacity_logits"] = base["opacity_logits"].copy()
            for (_, weight), by_this_one in zip(drawn, shown):
                alone = by_this_one & (shown.sum(0) == 1)
                base["opacity_logits"][alone] = _faded(base["opacity_logits"][alone], weight)
        parts = [{name: values[visible] for name, values in base.items()}]
        for segment, weight in drawn:
            _, _, stream_begin, stream_end = segment.times
            share = (seconds - stream_begin) / (stream_end - stream_begin)
            moved = segment.scene.at(np.float32(min(max(share, 0.0), 1.0)))
            parts.append({**moved, "opacity_logits": _faded(moved["opacity_logits"], weight)})
        return _together(parts)

    def _drawn_at(self, seconds: float) -> list[tuple[Segment, np.float32]]:
        """The segments that are drawn, and their weights: two within a fade."""
        for earlier, later in zip(self.segments, self.segments[1:]):
            if earlier.times[1] == later.times[0]:
                join = later.times[0]
                begin = max(later.times[2], _middle(earlier))
                end = min(max(earlier.times[3], earlier.times[1]), _middle(later))
                if begin < seconds < end:
                    weight = (seconds - begin) / (end - begin)
                    return [(earlier, np.float32(1.0 - weight)), (later, np.float32(weight))]
        return [(segment, np.float32(1)) for segment in self.segments if segment.times[0] <= seconds < segment.times[1]]


def _middle(segment: Segment) -> float:
    return 0.5 * (segment.times[0] + segment.times[1])


def _faded(logits: np.ndarray, weight: np.float32) -> np.ndarray:
    """The logits of the opacities `1 - (1 - o)^weight`."""
    if weight == 1:
        return logits
    most = np.float32(_MOST_LOGIT)
    clipped = np.fmin(np.fmax(logits, -most), most)
    density = logarithm(np.float32(1) + exponential(clipped))
    return np.fmax(logarithm(exponential(weight * density) - np.float32(1)), -most)


def _together(parts: list[dict[str, np.ndarray]]) -> dict[str, np.ndarray]:
    """The Gaussians of the base, then those of the segments, with harmonics of the largest degree."""
    width = max(part["sh_rest"].shape[1] for part in parts)
    for part in parts:
        part["sh_rest"] = np.pad(part["sh_rest"], ((0, 0), (0, width - part["sh_rest"].shape[1])))
    return {name: np.concatenate([part[name] for part in parts]) for name in _NAMES}


def is_take(data: bytes) -> bool:
    return data.startswith(MAGIC)


def decode_take(data: bytes) -> Take:
    """Decodes a take with all its segments, or raises `Refused`."""
    prelude = Reader("take", data[:PRELUDE_BYTES])
    prelude.take(8, "magic")
    version = prelude.u16("version")
    prelude.require(version == VERSION, "version", f"{VERSION}, not {version}")
    prelude.require(prelude.u16("flags") == 0, "flags", "0")
    meta_bytes = prelude.u32("length of the meta")
    prelude.require(meta_bytes <= limits.META_BYTES, "length of the meta", f"at most {limits.META_BYTES}")
    slots = prelude.u32("slots")
    prelude.require(slots <= limits.SEGMENTS, "slots", f"at most {limits.SEGMENTS}")
    base_offset = prelude.u64("offset of the base")
    base_bytes = prelude.u64("length of the base")
    prelude.require(base_bytes <= limits.STREAM_BYTES, "length of the base", f"at most {limits.STREAM_BYTES}")
    base_gaussians = prelude.u32("Gaussians of the base")
    prelude.require(base_gaussians <= limits.GAUSSIANS, "Gaussians of the base", f"at most {limits.GAUSSIANS}")
    checksum = prelude.u32("checksum")
    block = -(-(PRELUDE_BYTES + meta_bytes) // ROW_BYTES) * ROW_BYTES
    front = block + ROW_BYTES * (1 + slots)
    prelude.require(base_offset == front, "offset of the base", "where the first block of the index ends")
    prelude.require(front + base_bytes <= len(data), "length of the base", "index and base within the file")
    prelude.require(crc32c(data[:40], data[44:block]) == checksum, "checksum", "that of prelude, meta and zeros")
    prelude.require(not any(data[PRELUDE_BYTES + meta_bytes : block]), "bytes after the meta", "zeros")
    _check_meta(Reader("meta of the take", data[PRELUDE_BYTES : PRELUDE_BYTES + meta_bytes]))

    base_end = base_offset + base_bytes
    rows = sorted(_read_index(data, block, slots, base_end, base_gaussians), key=lambda row: row.times[0])
    for earlier, later in zip(rows, rows[1:]):
        prelude.require(earlier.times[1] <= later.times[0], "times of two segments", "one segment at a time")
    _, base = decode(data[base_offset:base_end])
    base.check_shown()
    prelude.require(base.motion.kind == "", "base", "a scene that stands still")
    count = base.gaussians.count
    prelude.require(count == base_gaussians, "Gaussians of the base", f"those of the base, {count}")
    return Take(base, [_read_segment(data, row, base_gaussians) for row in rows])


def _check_meta(reader: Reader) -> None:
    reader.string("name", limits.NAME_BYTES)
    reader.require(bool(reader.f32("frames a second") >= 0), "frames a second", "not negative")
    reader.require(0 <= reader.f64("seconds") <= _LONGEST, "seconds", f"from 0 to {_LONGEST}")
    read_extra_entries(reader)
    reader.end()


def _read_index(data: bytes, block: int, slots: int, base_end: int, base_gaussians: int) -> list[Row]:
    """The rows that are in use, of all blocks."""
    rows: list[Row] = []
    all_slots = 0
    while True:
        end = block + ROW_BYTES * (1 + slots)
        reader = Reader("index", data[block:end], block)
        link = _used(reader, "link")
        for _ in range(slots):
            row = _used(reader, "slot")
            if row:
                rows.append(_read_slot(row, len(data), base_end, base_gaussians))
        all_slots += slots
        if link is None:
            return rows
        after = max(end, base_end)
        block = link.u64("offset of a block")
        link.require(block >= after, "offset of a block", f"{after} or more, behind what is before it")
        link.require(block % ROW_BYTES == 0, "offset of a block", f"a multiple of {ROW_BYTES}")
        slots = link.u32("slots of a block")
        link.require(slots > 0, "slots of a block", "1 or more")
        link.require(all_slots + slots <= limits.SEGMENTS, "slots of a block", f"at most {limits.SEGMENTS} in all")
        link.require(not any(link.take(link.left, "rest of a link")), "rest of a link", "zeros")


def _used(reader: Reader, field: str) -> Reader | None:
    """The next row without its checksum, or nothing where it is not in use."""
    row = reader.take(ROW_BYTES, field)
    if not any(row):
        return None
    reader.require(crc32c(row[:60]) == int.from_bytes(row[60:], "little"), f"checksum of a {field}", "that of the row")
    return Reader("index", row[:60])


def _read_slot(row: Reader, file_bytes: int, base_end: int, base_gaussians: int) -> Row:
    times = (row.f64("begin"), row.f64("end"), row.f64("begin of the stream"), row.f64("end of the stream"))
    for name, seconds in zip(("begin", "end", "begin of the stream", "end of the stream"), times):
        row.require(-_LONGEST <= seconds <= _LONGEST, name, f"within {_LONGEST} seconds")
    begin, end, stream_begin, stream_end = times
    row.require(0 <= begin < end, "end", "begins from 0 on, and later ends")
    row.require(stream_begin <= begin < stream_end, "end of the stream", "times within which the segment begins")
    offset = row.u64("offset")
    row.require(offset >= base_end, "offset", f"{base_end} or more, behind the base")
    length = row.u64("length")
    frames = row.u32("frames")
    row.require(frames <= limits.FRAMES, "frames", f"at most {limits.FRAMES}")
    hidden_bytes = row.u32("length of the hidden list")
    most = 2 * base_gaussians + 16
    row.require(hidden_bytes <= most, "length of the hidden list", f"at most {most}")
    row.require(hidden_bytes < length, "length", "more than that of the hidden list")
    row.require(length - hidden_bytes <= limits.STREAM_BYTES, "length", f"at most {limits.STREAM_BYTES} of the stream")
    row.require(offset + length <= file_bytes, "length", "a segment within the file")
    return Row(times, frames, offset, length, hidden_bytes, row.u32("checksum"))


def _read_segment(data: bytes, row: Row, base_gaussians: int) -> Segment:
    content = data[row.offset : row.offset + row.length]
    if crc32c(content) != row.checksum:
        raise Refused("segment", "checksum", "that of the segment's bytes")
    hidden = _read_hidden(content[: row.hidden_bytes], base_gaussians)
    _, scene = decode(content[row.hidden_bytes :])
    scene.check_shown()
    return Segment(row.times, row.frames, hidden, scene)


def _read_hidden(data: bytes, gaussians: int) -> list[int]:
    if not data:
        return []
    decoder = RangeDecoder("segment", "hidden list", data)
    bits = [AdaptiveBit() for _ in range(1 << _CONTEXT_BITS)]
    context = 0
    hidden: list[int] = []
    for _ in range(gaussians):
        hidden.append(bits[context].read(decoder))
        context = (2 * context + hidden[-1]) % len(bits)
    return hidden
