"""The head of the feature planes, and planes without loss: "`feature_planes`"."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .. import limits
from ..limits import Budget
from ..networks.arithmetic import F, without_tiny
from ..reader import Reader
from .coordinates import sample, sample_at_time

# The axes x, y, z, t of a plane: its width lies along the first, its height along the second.
AXES = ((0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3))
AXIS_NAMES = ("xy", "xz", "xt", "yz", "yt", "zt")
_TIME = 3
_SIZES_DIFFER = 0x40


@dataclass(frozen=True)
class Place:
    """Which plane: its scale, and the number of its axes in `AXES`."""

    scale: int
    axes: int

    @property
    def name(self) -> str:
        return f"{self.scale}.{AXIS_NAMES[self.axes]}"

    @property
    def has_time(self) -> bool:
        return AXES[self.axes][1] == _TIME


@dataclass
class Planes:
    channels: int
    scales: int
    sizes: dict[Place, tuple[int, int]]  # height, width; in the order of the stream
    values: dict[Place, np.ndarray]  # [channels, height, width]

    def features(self, points: np.ndarray, time: np.float32) -> np.ndarray:
        """For each scale and channel, the product of the samples of its planes: `[scales * channels, N]`.

        `points` are `[N, 3]` in the planes' coordinates, `time` is the field's.
        """
        over_time = np.ones((self.scales, self.channels, len(points)), np.float32)
        along_time = np.array([F(2) * time - F(1)], np.float32)
        with np.errstate(all="ignore"):
            for place, values in self.values.items():
                if place.has_time:
                    over_time[place.scale] *= sample_at_time(values, points[:, AXES[place.axes][0]], along_time)
            return self.space_features(points) * over_time.reshape(self.scales * self.channels, len(points))

    def space_features(self, points: np.ndarray) -> np.ndarray:
        """For each scale and channel, the product of 1 and the samples of its planes without time: `[scales * channels, N]`.

        `points` are `[N, 3]` in the planes' coordinates. What is below 2^-50 in magnitude is replaced by 0, as in networks.
        """
        result = np.ones((self.scales, self.channels, len(points)), np.float32)
        with np.errstate(all="ignore"):
            for place, values in self.values.items():
                if place.has_time:
                    continue
                width, height = AXES[place.axes]
                samples = without_tiny(sample(without_tiny(values), points[:, width], points[:, height]))
                result[place.scale] = without_tiny(result[place.scale] * samples)
        return result.reshape(self.scales * self.channels, len(points))


def read_head(reader: Reader) -> Planes:
    """What planes there are, without their values."""
    channels = reader.varint("channels", limits.PLANE_CHANNELS)
    scales = reader.varint("number of scales", limits.SCALES)
    reader.require(scales == 0 or channels >= 1, "channels", "at least 1 where there are planes")
    sizes: dict[Place, tuple[int, int]] = {}
    for scale in range(scales):
        byte = reader.u8(f"scale {scale}: planes")
        there = [axes for axes in range(len(AXES)) if byte >> axes & 1]
        reader.require(len(there) > 0, f"scale {scale}: planes", "at least one plane")
        reader.require(byte < 0x80, f"scale {scale}: planes", "a bit 7 of 0")
        if byte & _SIZES_DIFFER:
            for axes in there:
                place = Place(scale, axes)
                width = reader.varint(f"{place.name}: width", limits.SIDE, 1)
                height = reader.varint(f"{place.name}: height", limits.SIDE, 1)
                sizes[place] = (height, width)
            along: dict[int, set[int]] = {}
            for axes in there:
                for axis, size in zip(reversed(AXES[axes]), sizes[Place(scale, axes)]):
                    along.setdefault(axis, set()).add(size)
            differ = any(len(found) > 1 for found in along.values())
            reader.require(differ, f"scale {scale}: planes", "a bit 6 of 0 where no two planes differ in size")
        else:
            spanned = sorted({axis for axes in there for axis in AXES[axes]})
            length = {
                axis: reader.varint(f"scale {scale}: size along {'xyzt'[axis]}", limits.SIDE, 1) for axis in spanned
            }
            for axes in there:
                along_width, along_height = AXES[axes]
                sizes[Place(scale, axes)] = (length[along_height], length[along_width])
    return Planes(channels, scales, sizes, {})


def take_memory(reader: Reader, planes: Planes, budget: Budget) -> None:
    for place, (height, width) in planes.sizes.items():
        budget.take(reader.part, place.name, planes.channels * height * width, 4)


def read_explicit_planes(reader: Reader, budget: Budget) -> Planes:
    planes = read_head(reader)
    take_memory(reader, planes, budget)
    for place, (height, width) in planes.sizes.items():
        planes.values[place] = reader.f32s((planes.channels, height, width), place.name)
    reader.end()
    return planes
