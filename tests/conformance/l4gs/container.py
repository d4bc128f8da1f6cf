"""The frame of the stream: prelude, meta, table, and the bytes of each section."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from . import limits
from .checksum import crc32c
from .errors import Refused
from .reader import Reader

MAGIC = b"\x89L4GS\r\n\x1a"
VERSION = 1
PRELUDE_BYTES = 32
ENTRY_BYTES = 16

FLOAT32, QUANTIZED = 0, 1

SECTION_NAMES = {1: "gaussians", 2: "sh", 3: "scene_coordinates", 4: "motion", 5: "feature_planes", 6: "context_model"}

# The encodings that each kind of each section may have.
KINDS: dict[str, dict[int, tuple[int, ...]]] = {
    "gaussians": {1: (0, 1)},
    "sh": {1: (0,), 2: (1,), 3: (0, 1), 4: (1,), 5: (1,)},
    "scene_coordinates": {1: (0,), 2: (0,)},
    "motion": {1: (0, 1)},
    "feature_planes": {1: (0,), 2: (1,)},
    "context_model": {1: (0, 1)},
}
CONTEXT_CODED = 2
# Sections that there are once for each layer of Gaussians.
LAYERED = ("gaussians", "sh")
SH_TABLES, SH_NETWORKS, SH_CONTINUED = 2, 3, 5


@dataclass
class Meta:
    """Facts about the scene, from the header."""

    name: str
    frames: int
    frames_a_second: np.float32
    smallest: np.ndarray  # [3], world units
    largest: np.ndarray  # [3], world units
    background: np.ndarray  # [3]: red, green, blue
    digest: bytes  # 32
    width: int  # pixels
    height: int  # pixels
    field_of_view: np.float32  # radians
    extra: dict[str, str]


@dataclass
class Section:
    """A section's bytes, and its entry of the table."""

    name: str
    kind: int
    encoding: int
    data: bytes


@dataclass
class Container:
    meta: Meta
    # Those of further layers have a number after their names: `gaussians_2`.
    sections: dict[str, Section]

    def layers(self) -> list[tuple[Section, Section]]:
        """`gaussians` and `sh` of each layer."""
        count = sum(name.startswith(LAYERED[0]) for name in self.sections)
        return [(self.sections[of_layer("gaussians", n)], self.sections[of_layer("sh", n)]) for n in range(1, count + 1)]


def of_layer(name: str, layer: int) -> str:
    """The name of a section of a layer, counted from 1."""
    return name if layer == 1 else f"{name}_{layer}"


def read_container(data: bytes) -> Container:
    """Splits a stream into its parts, and checks all lengths and checksums."""
    prelude = Reader("prelude", data[:PRELUDE_BYTES])
    prelude.require(prelude.take(8, "magic") == MAGIC, "magic", "the bytes of a .l4gs stream")
    version = prelude.u16("version")
    prelude.require(version == VERSION, "version", f"{VERSION}, not {version}")
    prelude.require(prelude.u16("flags") == 0, "flags", "0")
    section_count = prelude.u32("number of sections")
    prelude.require(section_count <= limits.SECTIONS, "number of sections", f"at most {limits.SECTIONS}")
    meta_bytes = prelude.u32("length of the meta")
    prelude.require(meta_bytes <= limits.META_BYTES, "length of the meta", f"at most {limits.META_BYTES}")
    stream_bytes = prelude.u64("length of the stream")
    prelude.require(stream_bytes <= limits.STREAM_BYTES, "length of the stream", f"at most {limits.STREAM_BYTES}")
    prelude.require(
        stream_bytes == len(data), "length of the stream", f"that of the file, {len(data)}, not {stream_bytes}"
    )
    checksum = prelude.u32("checksum")
    table_begin = PRELUDE_BYTES + meta_bytes
    table_end = table_begin + ENTRY_BYTES * section_count
    prelude.require(table_end <= len(data), "length of the meta", "meta and table within the stream")
    prelude.require(crc32c(data[:28], data[32:table_end]) == checksum, "checksum", "that of prelude, meta and table")

    meta = _read_meta(Reader("meta", data[PRELUDE_BYTES:table_begin]))
    sections = _read_table(Reader("table", data[table_begin:table_end]), section_count, data[table_end:])
    return Container(meta, sections)


def _read_meta(reader: Reader) -> Meta:
    name = reader.string("name", limits.NAME_BYTES)
    frames = reader.u32("frame count")
    reader.require(frames <= limits.FRAMES, "frame count", f"at most {limits.FRAMES}")
    frames_a_second = reader.f32("frames a second")
    reader.require(bool(frames_a_second >= 0), "frames a second", "not negative")
    smallest = reader.f32s((3,), "smallest corner")
    largest = reader.f32s((3,), "largest corner")
    reader.require(bool((smallest <= largest).all()), "largest corner", "on no axis less than the smallest")
    background = reader.f32s((3,), "background")
    digest = reader.take(32, "digest")
    width = reader.u32("width")
    height = reader.u32("height")
    reader.require(width <= limits.CAMERA_SIDE, "width", f"at most {limits.CAMERA_SIDE}")
    reader.require(height <= limits.CAMERA_SIDE, "height", f"at most {limits.CAMERA_SIDE}")
    reader.require(width * height <= limits.CAMERA_PIXELS, "height", f"at most {limits.CAMERA_PIXELS} pixels")
    field_of_view = reader.f32("field of view")
    reader.require(0 <= float(field_of_view) < math.pi, "field of view", "not negative, below pi")
    extra = read_extra_entries(reader)
    reader.end()
    return Meta(
        name, frames, frames_a_second, smallest, largest, background, digest, width, height, field_of_view, extra
    )


def read_extra_entries(reader: Reader) -> dict[str, str]:
    count = reader.u32("number of extra entries")
    reader.require(count <= limits.EXTRA_ENTRIES, "number of extra entries", f"at most {limits.EXTRA_ENTRIES}")
    extra: dict[str, str] = {}
    before: bytes | None = None
    for _ in range(count):
        key = reader.string("key", limits.NAME_BYTES)
        value = reader.string("value", lines=True)
        sorted_key = key.encode()
        reader.require(before is None or before < sorted_key, "key", "keys sorted by their bytes, none twice")
        before = sorted_key
        extra[key] = value
    return extra


def _read_table(table: Reader, count: int, data: bytes) -> dict[str, Section]:
    """The sections by name. `data` are the bytes after the table."""
    sections: dict[str, Section] = {}
    begin = 0
    for _ in range(count):
        number = table.u16("section")
        kind = table.u8("kind")
        encoding = table.u8("encoding")
        checksum = table.u32("checksum")
        length = table.u64("length")
        table.require(number in SECTION_NAMES, "section", f"a known section, not {number}")
        name = SECTION_NAMES[number]
        first = sections.get(name)
        once = first is None or name in LAYERED
        table.require(once, "section", f"each section once; {name} is there twice")
        table.require(kind in KINDS[name], "kind", f"a known kind of {name}, not {kind}")
        table.require(encoding in KINDS[name][kind], "encoding", f"one that kind {kind} of {name} has, not {encoding}")
        if first is None:
            begins = name != "sh" or kind != SH_CONTINUED
            table.require(begins, "kind", f"a kind of the first sh that continues no other, not {kind}")
        else:
            wanted = _of_further_layers(first)
            table.require((kind, encoding) == wanted, "kind", f"kind and encoding {wanted} of a further {name}")
            name = of_layer(name, 1 + sum(other.split("_")[0] == name for other in sections))
        table.require(length <= len(data) - begin, "length", f"{name} within the stream")
        content = data[begin : begin + length]
        begin += length
        if crc32c(content) != checksum:
            raise Refused(name, "checksum", "that of the section's bytes")
        sections[name] = Section(name, kind, encoding, content)
    table.require(
        begin == len(data), "length", f"sections to the end of the stream; {len(data) - begin} bytes are left"
    )
    for name in list(KINDS)[:5]:
        table.require(name in sections, "section", f"a section {name}")
    layers = [sum(name.split("_")[0] == layered for name in sections) for layered in LAYERED]
    table.require(layers[0] == layers[1], "section", f"a section sh for each of {layers[0]} gaussians, not {layers[1]}")
    context_coded = sections["feature_planes"].kind == CONTEXT_CODED
    table.require(
        context_coded == ("context_model" in sections), "section", "context_model exactly with context-coded planes"
    )
    return sections


def _of_further_layers(first: Section) -> tuple[int, int]:
    """Kind and encoding of the sections of further layers."""
    if first.name == "sh" and first.kind in (SH_TABLES, SH_NETWORKS):
        return SH_CONTINUED, QUANTIZED
    return first.kind, first.encoding
