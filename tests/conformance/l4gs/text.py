"""The text that the conformance set compares: checksums of all arrays, a line each. See tests/conformance/README.md."""

from __future__ import annotations

from typing import Iterable

import numpy as np

from .checksum import crc32c
from .decoder import decode
from .sections.motion import Scene

_FIRST = ("means", "log_scales", "quats", "opacity_logits", "sh_dc", "sh_rest")


def lines(data: bytes, times: Iterable[str]) -> list[str]:
    """The lines of a stream, or `Refused`. Times are numbers as text; they stand in the lines as they are given."""
    _, scene = decode(data)
    scene.check_shown()
    result = [f"scene {name} {_checksum([values])}" for name, values in _in_order(scene.attributes())]
    result += [f"scene {name} {_checksum(arrays)}" for name, arrays in _beyond_gaussians(scene)]
    for time in times:
        attributes = _in_order(scene.at(np.float32(time)))
        result += [f"{time} {name} {_checksum([values])}" for name, values in attributes]
        result.append(f"{time} all {_checksum([values for _, values in attributes])}")
    return result


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
