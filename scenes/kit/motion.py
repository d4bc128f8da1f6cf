"""Turns, and curves in time."""

import math

import numpy as np

TURN = 2 * math.pi


def rotation(axis, angle):
    """3×3 matrix that turns by `angle` radians about `axis`."""
    axis = np.asarray(axis, float)
    axis = axis / np.linalg.norm(axis)
    cross = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
    return np.eye(3) + math.sin(angle) * cross + (1 - math.cos(angle)) * cross @ cross


def smooth(x):
    """From 0 to 1 without a kink at either end; constant outside."""
    x = np.clip(x, 0, 1)
    return x * x * (3 - 2 * x)


def applied(matrix, points):
    """Points (n, 3) under a 4×4 matrix."""
    return points @ matrix[:3, :3].T + matrix[:3, 3]
