"""The attributes of the Gaussians: "`gaussians`, explicit"."""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np

from .. import limits
from ..container import QUANTIZED, Section
from ..entropy.range_coder import RangeDecoder
from ..errors import Refused
from ..limits import Budget
from ..reader import Reader
from .channels import find_neighbors, read_channels
from .positions import read_cells

FIRST_ATTRIBUTES = (("means", 3), ("log_scales", 3), ("quats", 4), ("opacity_logits", 1), ("sh_dc", 3))

_FLOAT32, _GRID, _CHANNELS, _COLORS = range(4)
_CODER_NAMES = ("float32", "grid", "channels", "colors")
_QUANTIZED_CODERS = {
    "means": _GRID,
    "log_scales": _CHANNELS,
    "quats": _CHANNELS,
    "opacity_logits": _CHANNELS,
    "sh_dc": _COLORS,
}
# The order of the channels of colors in a stream.
_COLOR_ORDER = (1, 0, 2)
_MAY_BE_LEFT_OUT = 0x80
_LARGEST_INDEX = 1 << 23
_MOST_BITS = 20
_LEGAL_NAME = re.compile(r"[a-z0-9_-]{1,64}")


@dataclass
class Gaussians:
    """Values of every Gaussian, in the order of the stream."""

    count: int
    attributes: dict[str, np.ndarray]  # by name: [count, width] float32
    optional: set[str]  # those that a reader may leave out
    rows: list[tuple[str, int, int, bool]]  # name, width, coder, mark of each attribute in the list


@dataclass
class _Attribute:
    name: str
    width: int
    coder: int
    optional: bool
    length: int  # bytes, but for coder 0


def read_gaussians(section: Section, budget: Budget) -> Gaussians:
    reader = Reader(section.name, section.data)
    count = reader.u32("number of Gaussians")
    reader.require(count <= limits.GAUSSIANS, "number of Gaussians", f"at most {limits.GAUSSIANS}")
    quantized = section.encoding == QUANTIZED
    attributes = _read_list(reader, quantized)
    rows = [(row.name, row.width, row.coder, row.optional) for row in attributes]
    result = Gaussians(count, {}, {row.name for row in attributes if row.optional}, rows)
    neighbors = np.zeros((0, 4), np.int64)
    if quantized:
        budget.take(section.name, "number of Gaussians", count, 136)
        least = -(-count // 8)
        reader.require(
            len(section.data) >= least, "number of Gaussians", f"a section of at least {least} bytes for {count}"
        )
    for attribute in attributes:
        name, width = attribute.name, attribute.width
        if attribute.coder == _FLOAT32:
            budget.take(section.name, name, count * width, 4)
            result.attributes[name] = reader.f32s((count, width), name)
            continue
        data = reader.part_of(attribute.length, name)
        if attribute.coder == _GRID:
            cells, values = _read_grid(data, name, count)
            neighbors = find_neighbors(cells)
            result.attributes[name] = values
        elif attribute.coder in (_CHANNELS, _COLORS):
            budget.take(section.name, name, count * width, 28)
            result.attributes[name] = _read_quantized(data, attribute, count, neighbors)
        # Any other coder is unknown, and the attribute may be left out.
    if quantized:
        fill = max(-(-count // 8) - reader.position, 0)
        reader.require(not any(reader.take(fill, "fill")), "fill", "zeros")
    reader.end()
    return result


def check_further_layer(part: str, layers: list[Gaussians]) -> None:
    """Refuses a last layer that does not fit those before it."""
    if layers[-1].rows != layers[0].rows:
        raise Refused(part, "attributes", f"those of the first layer, {layers[0].rows}")
    count = sum(layer.count for layer in layers)
    if count > limits.GAUSSIANS:
        raise Refused(part, "number of Gaussians", f"at most {limits.GAUSSIANS} in all layers, not {count}")


def all_gaussians(layers: list[Gaussians]) -> Gaussians:
    """The Gaussians of all layers, one layer after the other."""
    first = layers[0]
    attributes = {name: np.concatenate([layer.attributes[name] for layer in layers]) for name in first.attributes}
    return Gaussians(sum(layer.count for layer in layers), attributes, first.optional, first.rows)


def _read_list(reader: Reader, quantized: bool) -> list[_Attribute]:
    """The list of attributes, and the rules for it."""
    attributes: list[_Attribute] = []
    attribute_count = reader.varint("number of attributes", limits.ATTRIBUTES, len(FIRST_ATTRIBUTES))
    names: set[str] = set()
    for i in range(attribute_count):
        field = f"attribute {i}"
        raw_name = reader.block(f"{field}: name").decode("latin-1")
        legal = _LEGAL_NAME.fullmatch(raw_name) is not None
        reader.require(legal, f"{field}: name", "1 to 64 of a-z, 0-9, -, _")
        field = f"{field} ({raw_name})"
        reader.require(
            raw_name not in names and raw_name != "sh_rest", f"{field}: name", "a name that is there once, not sh_rest"
        )
        names.add(raw_name)
        width = reader.varint(f"{field}: width", limits.ATTRIBUTE_WIDTH, 1)
        byte = reader.u8(f"{field}: coder")
        coder, optional = byte & ~_MAY_BE_LEFT_OUT, bool(byte & _MAY_BE_LEFT_OUT)
        if i < len(FIRST_ATTRIBUTES):
            wanted = FIRST_ATTRIBUTES[i]
            reader.require((raw_name, width) == wanted, f"{field}: name", f"{wanted[0]} of width {wanted[1]}")
            reader.require(not optional, f"{field}: coder", "no mark that it may be left out")
        if not quantized:
            reader.require(coder == _FLOAT32, f"{field}: coder", f"0 in encoding 0, not {coder}")
        elif i == 0:
            reader.require(coder == _GRID, f"{field}: coder", f"1 for means in encoding 1, not {coder}")
        else:
            reader.require(coder != _GRID, f"{field}: coder", "1 for means alone")
        reader.require(
            coder < len(_CODER_NAMES) or optional,
            f"{field}: coder",
            f"a known coder, not {coder}, where the attribute may not be left out",
        )
        if coder == _COLORS:
            reader.require(width == 3, f"{field}: width", f"3 for the coder of colors, not {width}")
        length = reader.varint(f"{field}: length") if coder != _FLOAT32 else 0
        attributes.append(_Attribute(raw_name, width, coder, optional, length))
    return attributes


def _read_grid(reader: Reader, name: str, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Cells `[count, 3]` as integers, and centers `[count, 3]`."""
    corner = reader.f32s((3,), f"{name}: corner")
    legal = bool((np.abs(corner) <= np.float32(1e30)).all())
    reader.require(legal, f"{name}: corner", "at most 1e30 in magnitude")
    step = reader.step(f"{name}: step")
    bits = reader.u8(f"{name}: bits")
    reader.require(bits <= _MOST_BITS, f"{name}: bits", f"at most {_MOST_BITS}, not {bits}")
    cells = read_cells(RangeDecoder(reader.part, name, reader.take(reader.left, name)), count, bits)
    with np.errstate(over="ignore"):
        values = cells.astype(np.float32) * step + corner
    reader.require(bool(np.isfinite(values).all()), name, "finite numbers")
    return cells, values


def _read_quantized(reader: Reader, attribute: _Attribute, count: int, neighbors: np.ndarray) -> np.ndarray:
    name, width = attribute.name, attribute.width
    step = reader.step(f"{name}: step")
    decoder = RangeDecoder(reader.part, name, reader.take(reader.left, name))
    integers = read_channels(decoder, count, width, neighbors, _LARGEST_INDEX)
    if attribute.coder == _COLORS:
        in_order = np.empty_like(integers)
        in_order[:, _COLOR_ORDER] = integers
        integers = in_order
    with np.errstate(over="ignore"):
        values = integers.astype(np.float32) * step
    reader.require(bool(np.isfinite(values).all()), name, "finite numbers")
    return values
