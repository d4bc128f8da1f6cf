"""Takes that every decoder must refuse: one for each rule of the container. kit/refusals.py puts them into its list.

A rule has a name, a take, and what to change in it: the name of a field of the prelude (`prelude FIELD`), of the link of the first
block (`link FIELD`) or of a slot of it (`slot N FIELD`), and the bytes in its place. Then the checksums of the prelude and of the
rows that were changed are computed again. Changes of the part `file` have an offset and a length; they come last, and no
checksum is computed after them.
"""

from __future__ import annotations

import math
import struct

from l4gs.checksum import crc32c

from .forging import Edit

_FOLDER = "../streams/takes/"
SEGMENTS, APPENDED, NOTHING = (f"{_FOLDER}{name}.l4gs" for name in ("segments", "appended", "nothing"))
_PRELUDE, _ROW = 44, 64
_OFFSETS = {
    "prelude": {"magic": 0, "version": 8, "flags": 10, "meta": 12, "slots": 16, "base": 20, "bytes": 28, "gaussians": 36},
    "link": {"offset": 0, "slots": 8, "rest": 12},
    "slot": {
        **{"begin": 0, "end": 8, "stream_begin": 16, "stream_end": 24, "offset": 32, "bytes": 40},
        **{"frames": 48, "hidden": 52, "checksum": 56},
    },
}

Change = tuple[str, bytes]


def _f64(value: float) -> bytes:
    return struct.pack("<d", value)


def _u64(value: int) -> bytes:
    return struct.pack("<Q", value)


def _u32(value: int) -> bytes:
    return struct.pack("<I", value)


TAKE_RULES: list[tuple[str, str, list[Change]]] = [
    ("take-magic", SEGMENTS, [("file 4-1", b"U")]),
    ("take-named-a-stream", SEGMENTS, [("file 4-1", b"S")]),
    ("take-version-0", SEGMENTS, [("prelude version", b"\0\0")]),
    ("take-version-2", SEGMENTS, [("prelude version", b"\2\0")]),
    ("take-flags", SEGMENTS, [("prelude flags", b"\1\0")]),
    ("take-meta-too-long", SEGMENTS, [("file 12-4", _u32(1 << 21))]),
    ("take-too-many-slots", SEGMENTS, [("file 16-4", _u32(100_001))]),
    ("take-base-elsewhere", SEGMENTS, [("prelude base", _u64(1024))]),
    ("take-base-too-long", SEGMENTS, [("prelude bytes", _u64(1 << 31))]),
    ("take-base-beyond-the-end", NOTHING, [("prelude bytes", _u64(379))]),
    ("take-base-of-other-gaussians", SEGMENTS, [("prelude gaussians", _u32(61))]),
    ("take-checksum", SEGMENTS, [("file 40-1", b"\0")]),
    ("take-checksum-covers-the-meta", SEGMENTS, [("file 50-1", b"A")]),
    ("take-name-with-a-control-character", SEGMENTS, [("prelude name", b"\x1b")]),
    ("take-frames-a-second-nan", NOTHING, [("prelude fps", struct.pack("<f", math.nan))]),
    ("take-frames-a-second-negative", NOTHING, [("prelude fps", struct.pack("<f", -1.0))]),
    ("take-seconds-nan", NOTHING, [("prelude seconds", _f64(math.nan))]),
    ("take-seconds-negative", NOTHING, [("prelude seconds", _f64(-1.0))]),
    ("take-bytes-after-the-meta", SEGMENTS, [("prelude zeros", b"\1")]),
    ("take-begin-nan", SEGMENTS, [("slot 0 begin", _f64(math.nan))]),
    ("take-begin-negative", SEGMENTS, [("slot 1 begin", _f64(-0.01))]),
    ("take-end-infinite", SEGMENTS, [("slot 0 end", _f64(math.inf)), ("slot 0 stream_end", _f64(math.inf))]),
    ("take-end-beyond-the-longest", SEGMENTS, [("slot 0 end", _f64(2e9)), ("slot 0 stream_end", _f64(2e9))]),
    ("take-segment-without-time", SEGMENTS, [("slot 0 end", _f64(0.5))]),
    ("take-stream-that-begins-too-late", SEGMENTS, [("slot 1 stream_begin", _f64(0.01))]),
    ("take-stream-that-ends-too-early", SEGMENTS, [("slot 1 stream_end", _f64(0.0))]),
    ("take-segments-that-overlap", SEGMENTS, [("slot 1 end", _f64(0.51)), ("slot 1 stream_end", _f64(0.51))]),
    ("take-segment-in-the-base", SEGMENTS, [("slot 0 offset", _u64(1024))]),
    ("take-segment-beyond-the-end", SEGMENTS, [("slot 0 bytes", _u64(1 << 20))]),
    ("take-segment-that-wraps", SEGMENTS, [("slot 0 offset", _u64((1 << 64) - 100))]),
    ("take-segment-without-a-stream", SEGMENTS, [("slot 1 hidden", _u32(40)), ("slot 1 bytes", _u64(40))]),
    ("take-segment-of-too-many-frames", SEGMENTS, [("slot 0 frames", _u32(100_001))]),
    ("take-hidden-list-too-long", SEGMENTS, [("slot 1 hidden", _u32(137))]),
    ("take-hidden-list-cut-short", SEGMENTS, [("slot 1 hidden", _u32(2))]),
    ("take-checksum-of-a-slot", SEGMENTS, [("file slot 0 4-1", b"\1")]),
    ("take-checksum-of-a-segment", SEGMENTS, [("file end 1-1", b"\0")]),
    ("take-link-to-the-index", APPENDED, [("link offset", _u64(128))]),
    ("take-link-to-an-odd-place", APPENDED, [("link offset", _u64(8001))]),
    ("take-link-beyond-the-end", APPENDED, [("link offset", _u64(64 << 10))]),
    ("take-link-to-no-slots", APPENDED, [("link slots", _u32(0))]),
    ("take-link-to-too-many-slots", APPENDED, [("link slots", _u32(100_000))]),
    ("take-link-with-more", APPENDED, [("link rest", b"\1")]),
    ("take-checksum-of-a-link", APPENDED, [("file link 8-1", b"\1")]),
]


def edits_of_take(data: bytes, changes: list[Change]) -> list[Edit]:
    """Edits of the part `file` for these changes, with the checksums that fit."""
    changed = bytearray(data)
    meta_bytes = struct.unpack_from("<I", data, 12)[0]
    block = -(-(_PRELUDE + meta_bytes) // _ROW) * _ROW
    begins = {"prelude": 0, "link": block, "end": len(data)}
    for what, new in sorted(changes, key=lambda change: change[0].startswith("file")):
        words = what.split()
        if words[0] == "file":
            offset = int(words[-1].split("-")[0])
            begin = _begin_of(words[1:-1], begins, block)
            at = begin - offset if "end" in words else begin + offset
        else:
            begin = _begin_of(words[:-1], begins, block)
            at = begin + _offset(words, meta_bytes)
        changed[at : at + len(new)] = new
        if words[0] != "file":
            _seal(changed, begin, block)
    return [Edit("file", at, length, bytes(changed[at : at + length])) for at, length in _differences(data, changed)]


def _begin_of(words: list[str], begins: dict[str, int], block: int) -> int:
    if words and words[0] == "slot":
        return block + _ROW * (1 + int(words[1]))
    return begins[words[0]] if words else 0


def _offset(words: list[str], meta_bytes: int) -> int:
    """Where a field begins in its row or in the prelude, of which the meta and what follows it are a part."""
    of_meta = {"name": 4, "fps": 4, "seconds": 8, "zeros": meta_bytes}
    if words[0] == "prelude" and words[-1] in of_meta:
        return _PRELUDE + of_meta[words[-1]]
    return _OFFSETS[words[0]][words[-1]]


def _seal(data: bytearray, begin: int, block: int) -> None:
    """Computes the checksum of the prelude, or of a row, again."""
    if begin == 0:
        struct.pack_into("<I", data, 40, crc32c(bytes(data[:40]), bytes(data[_PRELUDE:block])))
    else:
        struct.pack_into("<I", data, begin + 60, crc32c(bytes(data[begin : begin + 60])))


def _differences(old: bytes, new: bytes | bytearray) -> list[tuple[int, int]]:
    """Runs of bytes that differ: where each begins, and its length."""
    runs: list[tuple[int, int]] = []
    for at in (at for at in range(len(old)) if old[at] != new[at]):
        if runs and sum(runs[-1]) == at:
            runs[-1] = (runs[-1][0], runs[-1][1] + 1)
        else:
            runs.append((at, 1))
    return runs
