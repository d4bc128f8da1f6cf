"""Cameras of a data set: where they stand, and when they look."""

import math

import numpy as np

# Those of the published D-NeRF scenes: opening angle in radians, and distance from the origin.
OPENING = 0.6911112070083618
DISTANCE = 4.031128874149275
# Lowest and highest camera, as heights on the unit sphere: none looks up from below, or straight down.
LOWEST, HIGHEST = 0.06, 0.97


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
