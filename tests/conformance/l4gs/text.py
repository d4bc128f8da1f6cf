"""The text that the conformance set compares: checksums of all arrays, a line each. See tests/conformance/README.md."""

from __future__ import annotations

import struct
from typing import Iterable

import numpy as np

from .checksum import crc32c
from .decoder import decode
from .sections.motion import Scene
from .take import decode_take, is_take

_FIRST = ("means", "log_scales", "quats", "opacity_logits", "sh_dc", "sh_rest")


def lines(data: bytes, times: Iterable[str]) -> list[str]:
    """The lines of a stream or a take, or `Refused`.

    Times are numbers as text; they stand in the lines as they are given. Those of a take are seconds.
    """
    if is_take(data):
        return _take_lines(data, times)
    _, scene = decode(data)
    scene.check_shown()
    result = _scene_lines("scene", scene)
    for time in times:
        result += _frame(time, scene.at(np.float32(time)))
    return result


def _take_lines(data: bytes, times: Iterable[str]) -> list[str]:
    """The times of the segments, the base, each segment, and what is drawn at each time."""
    take = decode_take(data)
    numbers = [struct.pack("<4dI", *segment.times, segment.frames) for segment in take.segments]
    result = [f"take times {crc32c(*numbers):08x}", *_scene_lines("base", take.base)]
    for i, segment in enumerate(take.segments):
        result.append(f"segment-{i} hidden {crc32c(bytes(segment.hidden)):08x}")
        result += _scene_lines(f"segment-{i}", segment.scene)
    for time in times:
        result += _frame(time, take.at(float(time)))
    return result


def _scene_lines(what: str, scene: Scene) -> list[str]:
    result = [f"{what} {name} {_checksum([values])}" for name, values in _in_order(scene.attributes())]
    return result + [f"{what} {name} {_checksum(arrays)}" for name, arrays in _beyond_gaussians(scene)]


def _frame(time: str, moved: dict[str, np.ndarray]) -> list[str]:
    attributes = _in_order(moved)
    result = [f"{time} {name} {_checksum([values])}" for name, values in attributes]
    return [*result, f"{time} all {_checksum([values for _, values in attributes])}"]


def _in_order(attributes: dict[str, np.ndarray]) -> list[tuple[str, np.ndarray]]:
    """The attributes of every scene, and then others as the stream has them."""
    others = [name for name in attributes if name not in _FIRST]
    return [(name, attributes[name]) for name in (*_FIRST, *others)]


def _beyond_gaussians(scene: Scene) -> list[tuple[str, list[np.ndarray]]]:
    coordinates, motion = scene.coordinates, scene.motion
    mapping = [float(coordinates.contracted), *coordinates.scale, *coordinates.offset]
    mapping += [coordinates.time_scale, coordinates.time_offset]
    of_coordinates = [coordinates.mean, coordinates.axes, coordinates.deviations, np.array(mapping, np.float32)]
    return [
        ("coordinates", of_coordinates),
        ("planes", [scene.planes.values[place] for place in scene.planes.sizes]),
        ("motion", motion.weights + list(motion.tensors.values())),
    ]


def _checksum(arrays: list[np.ndarray]) -> str:
    """Of float32 numbers, row-major, one array after the other."""
    return f"{crc32c(*(np.ascontiguousarray(array, '<f4').tobytes() for array in arrays)):08x}"
