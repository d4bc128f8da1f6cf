"""Scenes, and the arrays that come from them."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal, Union, cast, overload

import numpy as np
import numpy.typing as npt

from . import _native
from ._camera import Camera, floats
from ._errors import Error

Floats = npt.NDArray[np.float32]


@dataclass(frozen=True)
class Gaussians:
    """The Gaussians at one time as gsplat's ``rasterization`` takes them; float32 arrays of N rows.

    A Gaussian whose quaternion has no direction is drawn by nobody: it has the identity and opacity 0.
    """

    #: ``[N, 3]``, centers in world units.
    means: Floats
    #: ``[N, 4]``, unit quaternions (w, x, y, z).
    quats: Floats
    #: ``[N, 3]``, standard deviations in world units.
    scales: Floats
    #: ``[N]``, in [0, 1].
    opacities: Floats
    #: ``[N, K, 3]``, spherical harmonics of all degrees, K = (degree + 1)**2.
    sh: Floats
    #: Degree of the spherical harmonics, 0 to 3.
    sh_degree: int


@dataclass(frozen=True)
class InriaGaussians:
    """The Gaussians at one time as the PLY files of the original 3D Gaussian Splatting have them; float32 arrays of N rows.

    The numbers are those before the activations, the same bits on every machine.
    """

    #: ``[N, 3]``, centers in world units: ``x``, ``y``, ``z``.
    means: Floats
    #: ``[N, 3]``, harmonics of degree 0: ``f_dc_0`` to ``f_dc_2``.
    f_dc: Floats
    #: ``[N, 3 (K - 1)]``, the others: ``f_rest_0`` and so on, all coefficients of red, then green, then blue.
    f_rest: Floats
    #: ``[N]``, logits of the opacities.
    opacity: Floats
    #: ``[N, 3]``, natural logarithms of the standard deviations: ``scale_0`` to ``scale_2``.
    scale: Floats
    #: ``[N, 4]``, quaternions (w, x, y, z) of any length: ``rot_0`` to ``rot_3``.
    rot: Floats
    #: Attributes beyond the layout, by name, ``[N, width]``.
    further: dict[str, Floats]
    #: Degree of the spherical harmonics, 0 to 3.
    sh_degree: int


def _array(data: bytearray, *shape: int) -> Floats:
    # Of memory that is ours alone, so it can be written.
    return np.frombuffer(data, dtype=np.float32).reshape(shape)


def _number(value: object) -> float:
    if isinstance(value, bool) or not isinstance(value, (int, float, np.integer, np.floating)):
        raise TypeError(f"the time must be a number, not {type(value).__name__}")
    return float(value)


#: Degrees of spherical harmonics by the number of their coefficients.
_DEGREES = {(degree + 1) ** 2: degree for degree in range(4)}


class Scene:
    """A decoded scene. It does not change, and several threads may use it at once.

    :func:`light4gs.open` and :func:`light4gs.from_bytes` make scenes.
    """

    #: Name for display.
    name: str
    #: Frames of the source; time 0 is the first, time 1 the last.
    frame_count: int
    #: Frames per second of the source, 0 where not known.
    fps: float
    #: ``[2, 3]``: smallest and largest corner of the scene's box, world units.
    bounds: Floats
    #: Red, green, blue behind the Gaussians.
    background: tuple[float, float, float]
    #: Width of the source's default camera in pixels, 0 where not known.
    width: int
    #: Its height.
    height: int
    #: Its horizontal field of view in radians, 0 where not known.
    fov_x: float
    #: Further entries of the file.
    extra: dict[str, str]
    #: Number of Gaussians, N.
    gaussian_count: int
    #: Degree of the spherical harmonics, 0 to 3.
    sh_degree: int
    #: Length of the stream in bytes.
    bytes: int
    #: Length of each section in bytes, by name, in the order of the stream.
    sections: dict[str, int]

    def __init__(self, native: Union[_native.Scene, _native.Take]) -> None:
        if not isinstance(native, self._made_of()):
            raise TypeError("light4gs.open and light4gs.from_bytes make scenes")
        self._native = native
        # What comes from the native part has the types above.
        entries = cast("dict[str, Any]", native.metadata())
        entries["bounds"] = np.array(entries["bounds"], dtype=np.float32)
        entries["background"] = tuple(entries["background"])
        entries["sections"] = dict(entries["sections"])
        for name, value in entries.items():
            setattr(self, name, value)

    @staticmethod
    def _made_of() -> type:
        return _native.Scene

    def _time(self, value: object) -> float:
        """The time of a call, checked."""
        time = _number(value)
        if not 0.0 <= time <= 1.0:
            raise ValueError(f"the time is {time}, expected a number from 0 (first frame) to 1 (last)")
        return time

    def __repr__(self) -> str:
        return (
            f"<light4gs.Scene {self.name!r}: {self.gaussian_count} Gaussians, {self.frame_count} frames, "
            f"{self.bytes} bytes>"
        )

    @overload
    def gaussians(self, time: float, *, convention: Literal["gsplat"] = "gsplat") -> Gaussians: ...

    @overload
    def gaussians(self, time: float, *, convention: Literal["inria"]) -> InriaGaussians: ...

    def gaussians(self, time: float, *, convention: str = "gsplat") -> Union[Gaussians, InriaGaussians]:
        """The Gaussians at a time in [0, 1]: new arrays, which the caller may change.

        Raises ``ValueError`` for another time or convention, ``TypeError`` for a time that is no number.
        """
        checked = self._time(time)
        if convention == "gsplat":
            means, quats, scales, opacities, sh = self._native.gsplat(checked)
            # Three numbers a Gaussian, and three a coefficient. A take has more Gaussians at some times than at others.
            count, coefficients = len(means) // 12, len(sh) // len(means) if means else (self.sh_degree + 1) ** 2
            return Gaussians(
                means=_array(means, count, 3),
                quats=_array(quats, count, 4),
                scales=_array(scales, count, 3),
                opacities=_array(opacities, count),
                sh=_array(sh, count, coefficients, 3),
                sh_degree=_DEGREES[coefficients],
            )
        if convention == "inria":
            (means, f_dc, f_rest, opacity, scale, rot), further = self._native.inria(checked)
            count, coefficients = len(means) // 12, 1 + len(f_rest) // len(means) if means else (self.sh_degree + 1) ** 2
            return InriaGaussians(
                means=_array(means, count, 3),
                f_dc=_array(f_dc, count, 3),
                f_rest=_array(f_rest, count, 3 * (coefficients - 1)),
                opacity=_array(opacity, count),
                scale=_array(scale, count, 3),
                rot=_array(rot, count, 4),
                further={name: _array(data, count, width) for name, (width, data) in further.items()},
                sh_degree=_DEGREES[coefficients],
            )
        raise ValueError(f'the convention is {convention!r}, expected "gsplat" or "inria"')

    def render(
        self,
        camera: Union[Camera, Mapping[str, Any]],
        time: float,
        *,
        background: Any = None,
    ) -> Floats:
        """An image ``[height, width, 3]`` of the scene at a time in [0, 1], drawn on the CPU.

        Red, green, blue, 0 or more and not clamped above: clip to [0, 1] before you store bytes. ``camera`` is a
        :class:`Camera` or a mapping that :meth:`Camera.from_dict` takes; ``background`` is a color instead of that of the
        scene. The interpreter's lock is released meanwhile.

        Raises ``ValueError`` or ``TypeError`` for wrong arguments, :class:`Error` of kind ``"over-limit"`` for an image
        that is too large, or whose Gaussians would take too much memory.
        """
        if not isinstance(camera, Camera):
            camera = Camera.from_dict(camera)
        color = list(self.background) if background is None else floats("background", background, 3)
        data = self._native.render(
            (camera.width, camera.height),
            camera._intrinsics(),
            list(camera.rotation),
            list(camera.translation),
            self._time(time),
            color,
        )
        return _array(data, camera.height, camera.width, 3)


class Take(Scene):
    """Minutes in one file: a base that stands still, and segments in time. :func:`light4gs.open` gives one for such a file.

    :meth:`gaussians` and :meth:`render` take **seconds of the take** in place of a time in [0, 1]. Where no segment is, the base
    alone is there. The number of Gaussians and the degree of their harmonics change from segment to segment; the attributes
    ``gaussian_count``, ``sh_degree``, ``bounds``, ``background``, ``frame_count``, ``width``, ``height``, ``fov_x``, ``bytes`` and ``sections`` are
    those of the base. Segments are read and decoded when they are needed, and the last three are kept.
    """

    #: Seconds of the take.
    seconds: float
    #: Begin and end of each segment in seconds, by rising begins.
    segments: list[tuple[float, float]]

    @staticmethod
    def _made_of() -> type:
        return _native.Take

    def _time(self, value: object) -> float:
        seconds = _number(value)
        if not math.isfinite(seconds):
            raise ValueError(f"the time is {seconds}, expected a finite number of seconds")
        return seconds

    def __repr__(self) -> str:
        return (
            f"<light4gs.Take {self.name!r}: {self.seconds:g} seconds, {len(self.segments)} segments, "
            f"{self.gaussian_count} Gaussians in the base>"
        )


def open(path: Union[str, os.PathLike[str]], *, limits: Mapping[str, int] | None = None) -> Scene:
    """Reads a file: a scene, or a :class:`Take`, of which the segments are read when they are needed.

    ``limits`` changes the default limits of the decoder by name; see :func:`light4gs.limits`. The interpreter's lock is
    released while the file is decoded.

    Raises :class:`Error` for a file that cannot be decoded, ``OSError`` for one that cannot be read.
    """
    if not isinstance(path, (str, os.PathLike)):
        raise TypeError(f"the path must be a str or a path, not {type(path).__name__}; from_bytes takes bytes")
    checked = _limits(limits)
    try:
        return Scene(_native.Scene.open(path, checked))
    except Error as error:
        if error.kind != "is-take":
            raise
    return Take(_native.Take.open(path, checked))


def from_bytes(data: Union[bytes, bytearray, memoryview], *, limits: Mapping[str, int] | None = None) -> Scene:
    """Reads a stream or a take in memory. Otherwise as :func:`open`."""
    if not isinstance(data, (bytes, bytearray, memoryview)):
        raise TypeError(f"the stream must be bytes, not {type(data).__name__}; open takes a path")
    # Others could change while the lock is released.
    own, checked = bytes(data), _limits(limits)
    try:
        return Scene(_native.Scene.from_bytes(own, checked))
    except Error as error:
        if error.kind != "is-take":
            raise
    return Take(_native.Take.from_bytes(own, checked))


def _limits(limits: Mapping[str, int] | None) -> dict[str, int] | None:
    if limits is None:
        return None
    if not isinstance(limits, Mapping):
        raise TypeError(f"limits must be a mapping from names to numbers, not {type(limits).__name__}")
    for name, value in limits.items():
        if isinstance(value, bool) or not isinstance(value, (int, np.integer)):
            raise TypeError(f"the limit {name} must be an int, not {type(value).__name__}")
        if not 0 <= value < 2**64:
            raise ValueError(f"the limit {name} is {value}, expected 0 to 2**64 - 1")
    return {str(name): int(value) for name, value in limits.items()}


def limits(name: Literal["default", "large"] = "default") -> dict[str, int]:
    """The limits of the decoder by name, to be changed and passed on: ``"default"`` for files of strangers, ``"large"`` for
    files that you trust. Rendering may take eight times ``memory_bytes``.
    """
    if not isinstance(name, str):
        raise TypeError(f"the name must be a str, not {type(name).__name__}")
    return _native.limits(name)
