"""Scene coordinates, and samples of planes at points in them: "`scene_coordinates`" and "Coordinates"."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from ..container import Section
from ..networks.arithmetic import F, interpolate
from ..reader import Reader

_MAPPED = 2


@dataclass
class SceneCoordinates:
    mean: np.ndarray  # [3], world units
    axes: np.ndarray  # [3, 3]: row j is axis j
    deviations: np.ndarray  # [3], world units
    contracted: bool = True
    scale: np.ndarray = field(default_factory=lambda: np.full(3, 0.5, np.float32))
    offset: np.ndarray = field(default_factory=lambda: np.zeros(3, np.float32))
    time_scale: np.float32 = F(1)
    time_offset: np.float32 = F(0)

    def of_points(self, points: np.ndarray) -> np.ndarray:
        """Points `[N, 3]` of the world in the planes' coordinates: `[N, 3]`, -1 to 1 within the planes."""
        with np.errstate(all="ignore"):
            o = points - self.mean
            u = np.empty_like(o)
            for j in range(3):
                a = self.axes[j]
                u[:, j] = ((o[:, 0] * a[0] + o[:, 1] * a[1]) + o[:, 2] * a[2]) / self.deviations[j]
            i = np.ones(len(points), np.float32)
            if self.contracted:
                n = (u[:, 0] * u[:, 0] + u[:, 1] * u[:, 1]) + u[:, 2] * u[:, 2]
                i = np.where(n > F(1), F(1) / np.sqrt(n), F(1)).astype(np.float32)
            factor = (F(2) - i) * i
            return u * (factor[:, None] * self.scale) + self.offset

    def field_time(self, time: np.float32) -> np.float32:
        """The field's time of a time of the scene."""
        return F(time * self.time_scale + self.time_offset)


def read_scene_coordinates(section: Section) -> SceneCoordinates:
    reader = Reader(section.name, section.data)
    result = SceneCoordinates(reader.f32s((3,), "mean"), reader.f32s((3, 3), "axes"), reader.f32s((3,), "deviations"))
    if section.kind == _MAPPED:
        contracted = reader.u8("contraction")
        reader.require(contracted <= 1, "contraction", f"0 or 1, not {contracted}")
        result.contracted = contracted == 1
        result.scale = reader.f32s((3,), "scale")
        result.offset = reader.f32s((3,), "offset")
        result.time_scale, result.time_offset = (F(value) for value in reader.f32s((2,), "time"))
    reader.end()
    return result


def sample(plane: np.ndarray, along_width: np.ndarray, along_height: np.ndarray) -> np.ndarray:
    """A plane `[C, H, W]` at points, whose coordinates are `[N]`: `[C, N]`. Along both rows first, then between them."""
    column, next_column, column_share = _cell(along_width, plane.shape[2])
    row, next_row, row_share = _cell(along_height, plane.shape[1])
    first = interpolate(plane[:, row, column], plane[:, row, next_column], column_share)
    second = interpolate(plane[:, next_row, column], plane[:, next_row, next_column], column_share)
    return interpolate(first, second, row_share)


def sample_at_time(plane: np.ndarray, along_width: np.ndarray, time: np.ndarray) -> np.ndarray:
    """A plane `[C, H, W]` over time at points, whose coordinates are `[N]`, at one time `[1]`: `[C, N]`.

    Between both rows first, then along the row that this gives: it is the same for all points.
    """
    column, next_column, column_share = _cell(along_width, plane.shape[2])
    row, next_row, row_share = _cell(time, plane.shape[1])
    line = interpolate(plane[:, row[0]], plane[:, next_row[0]], row_share[0])
    return interpolate(line[:, column], line[:, next_column], column_share)


def _cell(coordinate: np.ndarray, size: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """For coordinates `[N]` along an axis of `size` samples: the sample before, the one after, and the share of the latter."""
    with np.errstate(all="ignore"):
        p = ((coordinate + F(1)) * F(0.5)) * F(size - 1)
        p = np.where(p > 0, p, F(0)).astype(np.float32)
        cell = np.minimum(np.floor(p), F(size - 1)).astype(np.float32)
        share = np.minimum(p - cell, F(1))
    index = cell.astype(np.int64)
    return index, np.minimum(index + 1, size - 1), share
