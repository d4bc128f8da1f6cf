"""The camera of an image."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from . import _native


def whole(name: str, value: object) -> int:
    """A number of pixels."""
    if isinstance(value, bool) or not isinstance(value, (int, np.integer)):
        raise TypeError(f"{name} must be an int, not {type(value).__name__}")
    if not 1 <= value < 2**32:
        raise ValueError(f"{name} is {value}, expected 1 or more")
    return int(value)


def floats(name: str, value: object, count: int) -> list[float]:
    """`count` finite numbers from a sequence or an array of any shape."""
    try:
        array = np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise TypeError(f"{name} must be {count} numbers: {error}") from None
    if array.size != count:
        raise ValueError(f"{name} has {array.size} numbers, expected {count}")
    if not np.isfinite(array).all():
        raise ValueError(f"{name} must be finite")
    return [float(number) for number in array.reshape(-1)]


@dataclass(frozen=True)
class Camera:
    """An OpenCV pinhole camera: x right, y down, z forward, ``x_camera = rotation @ x_world + translation``.

    Lengths are in pixels; the middle of an image is at ``cx = width / 2``, ``cy = height / 2``. ``rotation`` has nine
    numbers, row-major (a 3 x 3 array will do), ``translation`` three, in world units.

    Raises ``ValueError`` for numbers that are no camera, ``TypeError`` for what is no number.
    """

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float
    rotation: Any
    translation: Any

    def __post_init__(self) -> None:
        for name in ("width", "height"):
            object.__setattr__(self, name, whole(name, getattr(self, name)))
        for name in ("fx", "fy", "cx", "cy"):
            object.__setattr__(self, name, floats(name, getattr(self, name), 1)[0])
        rotation = floats("rotation", self.rotation, 9)
        translation = floats("translation", self.translation, 3)
        _native.check_camera((self.width, self.height), self._intrinsics(), rotation, translation)
        object.__setattr__(self, "rotation", tuple(rotation))
        object.__setattr__(self, "translation", tuple(translation))

    def _intrinsics(self) -> tuple[float, float, float, float]:
        return (self.fx, self.fy, self.cx, self.cy)

    @classmethod
    def from_dict(cls, entry: Mapping[str, Any]) -> Camera:
        """A camera of the player's list (docs/player.md); its other entries, such as ``time``, are not read."""
        if not isinstance(entry, Mapping):
            raise TypeError(f"a camera must be a Camera or a mapping, not {type(entry).__name__}")
        names = ("width", "height", "fx", "fy", "cx", "cy", "rotation", "translation")
        missing = [name for name in names if name not in entry]
        if missing:
            raise ValueError(f"the camera lacks {', '.join(missing)}")
        return cls(**{name: entry[name] for name in names})

    @classmethod
    def look_at(
        cls,
        eye: Any,
        target: Any,
        up: Any,
        fov_x: float,
        width: int,
        height: int,
    ) -> Camera:
        """A camera at ``eye`` that looks at ``target``, with ``up`` upwards in the image; all world units.

        ``fov_x`` is the full horizontal field of view in radians; pixels are square.
        """
        angle = floats("fov_x", fov_x, 1)[0]
        if not 0.0 < angle < math.pi:
            raise ValueError(f"fov_x is {angle} rad, expected a value between 0 and pi")
        size = (whole("width", width), whole("height", height))
        focal, rotation, translation = _native.look_at(
            floats("eye", eye, 3), floats("target", target, 3), floats("up", up, 3), angle, size
        )
        return cls(size[0], size[1], focal, focal, size[0] / 2, size[1] / 2, rotation, translation)
