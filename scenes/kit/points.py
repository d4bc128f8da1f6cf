"""The cloud of points of a capture: samples of the surfaces that cameras see, in the colors of the pictures, with some noise."""

from dataclasses import dataclass

import bpy
import numpy as np
from mathutils import Vector
from PIL import Image

# As 4DGaussians calls it.
FILE = "points3D_downsample2.ply"
# Samples of what moves, of things that stand, and of the large surfaces around them. Most of them are hidden from the cameras, so these are more than the cloud keeps.
MOVING, STANDING, AROUND = 9000, 9000, 14000
# What a cloud keeps of them: all, and those that move among them.
KEPT, KEPT_MOVING = 5000, 1800
# Standard deviations: 6 mm, as photogrammetry is off by, and 2 of 255 in a color.
OFF, SHADE_OFF = 0.006, 2.0


@dataclass
class Points:
    """Positions and normals (n, 3), colors from 0 to 255, and which of the points move."""

    positions: np.ndarray
    normals: np.ndarray
    colors: np.ndarray
    moving: np.ndarray


def sampled(random, surroundings):
    """Points even over the surfaces at this time, without colors. `surroundings`: the names of the large surfaces."""
    placed = [item for item in bpy.context.scene.collection.objects if item.type == "MESH"]
    still = [item for item in placed if item["still"]]
    parts = [
        _on(random, [item for item in placed if not item["still"]], MOVING),
        _on(random, [item for item in still if item.name not in surroundings], STANDING),
        _on(random, [item for item in still if item.name in surroundings], AROUND),
    ]
    positions, normals = (np.concatenate(part) for part in zip(*parts))
    return Points(positions, normals, np.zeros((len(positions), 3)), np.arange(len(positions)) < MOVING)


def seen(points, scene, lens, taken, least):
    """Those points that views see, in the mean of the colors that the views have there.

    `taken`: views with the files of their pictures. Those that move are where they were sampled at time 0 only. `least`: views that
    must see a point for it to be kept, and the same for one that moves.
    """
    colors, counts = np.zeros((len(points.positions), 3)), np.zeros(len(points.positions))
    for view, path in taken:
        scene.move(view.time)
        candidates = ~points.moving if view.time > 0 else np.full(len(points.moving), True)
        free, pixels = _free(candidates, view.matrix, lens, points.positions)
        with Image.open(path) as image:
            picture = np.asarray(image.convert("RGB"), float)
        colors[free] += _between(picture, pixels[free] * picture.shape[1] / lens.width)
        counts[free] += 1
    kept = counts >= np.where(points.moving, least[1], least[0])
    return Points(points.positions[kept], points.normals[kept], colors[kept] / counts[kept][:, None], points.moving[kept])


def cloud(random, points):
    """A cloud as a program for photogrammetry would find it."""
    moving, standing = np.where(points.moving)[0], np.where(~points.moving)[0]
    of_moving = min(len(moving), KEPT_MOVING)
    of_standing = min(len(standing), KEPT - of_moving)
    chosen = np.concatenate([random.choice(moving, of_moving, replace=False), random.choice(standing, of_standing, replace=False)])
    positions = points.positions[chosen] + random.normal(0, OFF, (len(chosen), 3))
    colors = points.colors[chosen] + random.normal(0, SHADE_OFF, (len(chosen), 3))
    return Points(positions, points.normals[chosen], np.clip(np.round(colors), 0, 255), points.moving[chosen])


def write_ply(path, points):
    """Positions, normals and colors as a PLY file."""
    kinds = [(name, "<f4") for name in ("x", "y", "z", "nx", "ny", "nz")] + [(name, "u1") for name in ("red", "green", "blue")]
    rows = np.empty(len(points.positions), kinds)
    for (name, _), column in zip(kinds, np.hstack([points.positions, points.normals, points.colors]).T):
        rows[name] = column
    words = {"<f4": "float", "u1": "uchar"}
    header = ["ply", "format binary_little_endian 1.0", f"element vertex {len(rows)}",
              *(f"property {words[kind]} {name}" for name, kind in kinds), "end_header", ""]
    path.write_bytes("\n".join(header).encode() + rows.tobytes())


def _on(random, placed, count):
    """Positions and normals of points on meshes, as many for an area everywhere."""
    corners = np.concatenate([_triangles(item.data) for item in placed])
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    areas = np.linalg.norm(across, axis=1)
    owners = np.concatenate([np.full(len(item.data.loop_triangles), number) for number, item in enumerate(placed)])
    picked = random.choice(len(areas), count, p=areas / areas.sum())
    shares = np.zeros((count, 2))
    for number in range(len(placed)):
        own = owners[picked] == number
        drawn = random.random((own.sum(), 2))
        outside = drawn.sum(1) > 1
        drawn[outside] = 1 - drawn[outside]
        shares[own] = drawn
    first, second, third = (corners[picked, corner] for corner in range(3))
    return first + shares[:, :1] * (second - first) + shares[:, 1:] * (third - first), across[picked] / areas[picked, None]


def _triangles(mesh):
    """Corners of the triangles of a mesh, (n, 3, 3)."""
    mesh.calc_loop_triangles()
    vertices = np.empty(len(mesh.vertices) * 3, np.float32)
    mesh.vertices.foreach_get("co", vertices)
    indices = np.empty(len(mesh.loop_triangles) * 3, np.int32)
    mesh.loop_triangles.foreach_get("vertices", indices)
    return vertices.reshape(-1, 3).astype(float)[indices.reshape(-1, 3)]


def _free(candidates, matrix, lens, positions):
    """Which of the candidates are inside a picture, with nothing before them, and the pixels of all points."""
    pixels, depths = lens.seen(matrix, positions)
    free = (candidates & (depths > 0.05) & (pixels[:, 0] > 1) & (pixels[:, 1] > 1)
            & (pixels[:, 0] < lens.width - 2) & (pixels[:, 1] < lens.height - 2))
    bpy.context.view_layer.update()
    blender, graph = bpy.context.scene, bpy.context.evaluated_depsgraph_get()
    camera = matrix[:3, 3]
    for index in np.where(free)[0]:
        ray = positions[index] - camera
        length = np.linalg.norm(ray)
        hit, place, *_ = blender.ray_cast(graph, Vector(camera), Vector(ray / length), distance=length + 1)
        # As much as the point itself may be beside its surface.
        free[index] = hit and abs((np.array(place) - camera) @ ray / length - length) <= OFF
    return free, pixels


def _between(picture, pixels):
    """Colors of a picture between its pixels, whose middles are at halves."""
    height, width, _ = picture.shape
    at = pixels - 0.5
    low = np.floor(at).astype(int)
    share = at - low

    def color(right, down):
        return picture[np.clip(low[:, 1] + down, 0, height - 1), np.clip(low[:, 0] + right, 0, width - 1)]

    right, down = share[:, :1], share[:, 1:]
    return ((color(0, 0) * (1 - right) + color(1, 0) * right) * (1 - down) + (color(0, 1) * (1 - right) + color(1, 1) * right) * down)
