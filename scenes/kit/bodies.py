"""Bodies that are grown from distances to capsules, and skeletons that bend them."""

import numpy as np
from skimage.measure import marching_cubes

from .motion import applied


def capsule(points, start, end, start_radius, end_radius, flatness=1.0):
    """Distance of points (n, 3) to a capsule that tapers. `flatness` above 1: it is thinner along y."""
    stretch = np.array([1, flatness, 1])
    start = np.array(start, float)
    from_start = (points - start) * stretch
    axis = (np.array(end, float) - start) * stretch
    share = np.clip((from_start @ axis) / max(axis @ axis, 1e-9), 0, 1)
    return np.linalg.norm(from_start - share[:, None] * axis, axis=1) - (start_radius + (end_radius - start_radius) * share)


def blended(first, second, width):
    """The smaller of two distances, rounded where they are within `width` of each other."""
    share = np.clip(0.5 + 0.5 * (second - first) / width, 0, 1)
    return second + (first - second) * share - width * share * (1 - share)


def grown(distance, low, high, voxel):
    """The surface on which `distance`, a function of points (n, 3), is 0, between two corners, as vertices and faces."""
    low, high = np.array(low, float), np.array(high, float)
    counts = np.ceil((high - low) / voxel).astype(int) + 1
    axes = [low[axis] + voxel * np.arange(counts[axis]) for axis in range(3)]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), -1).reshape(-1, 3)
    vertices, faces, _, _ = marching_cubes(distance(points).reshape(counts), 0.0, spacing=(voxel,) * 3, gradient_direction="ascent")
    vertices = vertices + low
    a, b, c = (vertices[faces[:, corner]] for corner in range(3))
    if np.einsum("ij,ij->i", a, np.cross(b, c)).sum() < 0:
        # A negative volume: the faces look inward.
        faces = faces[:, ::-1]
    return vertices, faces


class Skeleton:
    """Bones by name: (parent, head, tail, radius), parents first. A pose is a rotation about the head of each bone, 3×3."""

    def __init__(self, bones):
        self.bones = bones
        self.names = list(bones)

    def weights(self, vertices, sharpness):
        """How much each vertex follows each bone, (n, bones): the near ones, in units of their radius."""
        distances = np.array([capsule(vertices, head, tail, 0, 0) / radius for _, head, tail, radius in self.bones.values()]).T
        weights = np.exp(-(distances - distances.min(1, keepdims=True)) / sharpness)
        weights[weights < 0.02] = 0
        return weights / weights.sum(1, keepdims=True)

    def transforms(self, pose):
        """A 4×4 matrix for each bone. Bones without a rotation follow their parent."""
        placed = {}
        for name in self.names:
            parent, head, _, _ = self.bones[name]
            turn, head = pose.get(name, np.eye(3)), np.array(head, float)
            own = np.eye(4)
            own[:3, :3] = turn
            own[:3, 3] = head - turn @ head
            placed[name] = own if parent is None else placed[parent] @ own
        return placed

    def bent(self, vertices, weights, placed):
        """Vertices that follow the bones by their weights (linear blend skinning)."""
        moved = np.zeros_like(vertices)
        for index, name in enumerate(self.names):
            weight = weights[:, index:index + 1]
            if weight.max() > 0:
                moved += weight * applied(placed[name], vertices)
        return moved
