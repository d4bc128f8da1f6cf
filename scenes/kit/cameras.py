"""Cameras of a data set: where they stand, when they look, and where they see a point."""

import math
from dataclasses import dataclass

import numpy as np

# Those of the published D-NeRF scenes: opening angle in radians, and distance from the origin.
OPENING = 0.6911112070083618
DISTANCE = 4.031128874149275
# Lowest and highest camera, as heights on the unit sphere: none looks up from below, or straight down.
LOWEST, HIGHEST = 0.06, 0.97


@dataclass(frozen=True)
class View:
    """What one of the cameras of a capture sees at a time: number of the moment, number of the camera, time, camera to world."""

    frame: int
    camera: int
    time: float
    matrix: np.ndarray


@dataclass(frozen=True)
class Lens:
    """What is alike in all pictures of a scene: their size in pixels, and the angle from left to right in radians."""

    width: int
    height: int
    opening: float

    @property
    def focal(self):
        """Focal length in pixels."""
        return self.width / 2 / math.tan(self.opening / 2)

    def seen(self, matrix, points):
        """Where a camera sees points (n, 3): pixels right and down (n, 2), and depths (n)."""
        from_camera = (points - matrix[:3, 3]) @ matrix[:3, :3]
        depth = -from_camera[:, 2]
        scale = self.focal / depth
        return np.stack([self.width / 2 + from_camera[:, 0] * scale, self.height / 2 - from_camera[:, 1] * scale], 1), depth


def look_at(position, target=(0, 0, 0), up=(0, 0, 1)):
    """Camera to world, 4×4, axes of OpenGL and Blender: x right, y up, z backward."""
    position = np.asarray(position, float)
    backward = position - np.asarray(target, float)
    backward /= np.linalg.norm(backward)
    right = np.cross(up, backward)
    right /= np.linalg.norm(right)
    matrix = np.eye(4)
    matrix[:3, 0], matrix[:3, 1], matrix[:3, 2], matrix[:3, 3] = right, np.cross(backward, right), backward, position
    return matrix


def frames(split, count, seed):
    """`count` frames of a split, as `transforms_*.json` has them: each its own camera and its own time.

    Cameras are spread evenly over the upper half of a sphere, and look at the origin. Training times are even from 0 to 1;
    those of the other splits are drawn between.
    """
    number = {"train": 1, "test": 2, "val": 3}[split]
    random = np.random.default_rng(1000 * number + seed)
    times = np.linspace(0, 1, count) if split == "train" else np.sort(random.uniform(0.004, 0.996, count))
    made = []
    for index in range(count):
        # Even in height is even on a sphere.
        height = random.uniform(LOWEST, HIGHEST)
        turn = random.uniform(0, 2 * math.pi)
        reach = math.sqrt(1 - height * height)
        position = DISTANCE * np.array([reach * math.cos(turn), reach * math.sin(turn), height])
        made.append({
            "file_path": f"./{split}/r_{index:03d}",
            "rotation": 2 * math.pi / count,
            "time": float(round(times[index], 10)),
            "transform_matrix": look_at(position).tolist(),
        })
    return made


def wandering(count, seed, reach, rates=(1.0, 1.7, 2.3)):
    """A smooth way of `count` steps about the origin, (count, 3). `reach`: how far along each axis; `rates`: swings on the way."""
    random = np.random.default_rng(seed)
    share = np.linspace(0, 1, count)
    way = np.zeros((count, 3))
    for axis in range(3):
        for number, rate in enumerate(rates):
            way[:, axis] += reach[axis] * 0.6 ** number * np.sin(2 * math.pi * (rate * share + random.uniform()))
    return way
