"""Shapes as vertices (n, 3) and faces, lists of indices that run counterclockwise seen from outside."""

import math

import bmesh
import numpy as np


def joined(*parts):
    """Several shapes as one."""
    vertices, faces, start = [], [], 0
    for part_vertices, part_faces in parts:
        vertices.append(part_vertices)
        faces += [tuple(index + start for index in face) for face in part_faces]
        start += len(part_vertices)
    return np.concatenate(vertices), faces


def grid_faces(rows, columns, wrap_rows=False, wrap_columns=False):
    """Faces of a grid in which vertex `row * columns + column` stands at (row, column)."""
    faces = []
    for row in range(rows if wrap_rows else rows - 1):
        for column in range(columns if wrap_columns else columns - 1):
            next_row, next_column = (row + 1) % rows, (column + 1) % columns
            faces.append((row * columns + column, next_row * columns + column,
                          next_row * columns + next_column, row * columns + next_column))
    return faces


def rectangle(corner, first, second, rows, columns):
    """A grid of vertices from a corner along two sides, its faces, and where each vertex lies along the sides, from the corner."""
    corner, first, second = (np.array(vector, float) for vector in (corner, first, second))
    along, across = np.meshgrid(np.linspace(0, 1, rows), np.linspace(0, 1, columns), indexing="ij")
    vertices = corner + along[..., None] * first + across[..., None] * second
    lengths = np.stack([along * np.linalg.norm(first), across * np.linalg.norm(second), 0 * along], -1)
    return vertices.reshape(-1, 3), grid_faces(rows, columns), lengths.reshape(-1, 3)


def sphere(around=96, down=48):
    """The unit sphere, with one vertex at each pole."""
    vertices = [(0, 0, 1)]
    for ring in range(1, down):
        polar = math.pi * ring / down
        for step in range(around):
            turn = 2 * math.pi * step / around
            vertices.append((math.sin(polar) * math.cos(turn), math.sin(polar) * math.sin(turn), math.cos(polar)))
    vertices.append((0, 0, -1))
    faces = [(0, 1 + step, 1 + (step + 1) % around) for step in range(around)]
    for ring in range(down - 2):
        for step in range(around):
            here, beside = 1 + ring * around + step, 1 + ring * around + (step + 1) % around
            faces.append((here, here + around, beside + around, beside))
    last = len(vertices) - 1
    lowest = 1 + (down - 2) * around
    faces += [(lowest + step, last, lowest + (step + 1) % around) for step in range(around)]
    return np.array(vertices, float), faces


def lathe(profile, around=96):
    """A profile of (radius, height), from bottom to top outside, turned about z. A radius of 0 at an end closes it."""
    vertices, rings = [], []
    for radius, height in profile:
        if radius < 1e-9:
            rings.append([len(vertices)])
            vertices.append((0, 0, height))
        else:
            rings.append(list(range(len(vertices), len(vertices) + around)))
            for step in range(around):
                turn = 2 * math.pi * step / around
                vertices.append((radius * math.cos(turn), radius * math.sin(turn), height))
    faces = []
    for below, above in zip(rings[:-1], rings[1:]):
        if len(below) == 1 and len(above) == 1:
            continue
        for step in range(around):
            beside = (step + 1) % around
            if len(below) == 1:
                faces.append((below[0], above[beside], above[step]))
            elif len(above) == 1:
                faces.append((below[step], below[beside], above[0]))
            else:
                faces.append((below[step], below[beside], above[beside], above[step]))
    return np.array(vertices, float), faces


def box(width, depth, height, bevel=0.02, segments=3):
    """A box about the origin with rounded edges."""
    mesh = bmesh.new()
    bmesh.ops.create_cube(mesh, size=1.0)
    for vertex in mesh.verts:
        vertex.co.x *= width
        vertex.co.y *= depth
        vertex.co.z *= height
    if bevel > 0:
        bmesh.ops.bevel(mesh, geom=list(mesh.edges), offset=bevel, segments=segments, profile=0.5, affect="EDGES")
    mesh.verts.index_update()
    vertices = np.array([list(vertex.co) for vertex in mesh.verts], float)
    faces = [tuple(vertex.index for vertex in face.verts) for face in mesh.faces]
    mesh.free()
    return vertices, faces


def tube_vertices(path, radius, around=16, closed=False):
    """The vertices of `tube`, for a path that moves."""
    path = np.asarray(path, float)
    count = len(path)
    radii = np.full(count, radius) if np.isscalar(radius) else np.asarray(radius)
    tangents = np.roll(path, -1, 0) - np.roll(path, 1, 0) if closed else np.gradient(path, axis=0)
    tangents = tangents / np.linalg.norm(tangents, axis=1, keepdims=True)
    # The frame turns as little as it can from one point to the next.
    normals = np.zeros_like(tangents)
    first = np.array([0, 0, 1.0]) if abs(tangents[0, 2]) < 0.9 else np.array([1.0, 0, 0])
    normals[0] = first - tangents[0] * (first @ tangents[0])
    normals[0] /= np.linalg.norm(normals[0])
    for index in range(1, count):
        carried = normals[index - 1] - tangents[index] * (normals[index - 1] @ tangents[index])
        normals[index] = carried / np.linalg.norm(carried)
    twist = 0.0
    if closed:
        # What is left at the end is spread over the whole path.
        carried = normals[-1] - tangents[0] * (normals[-1] @ tangents[0])
        carried /= np.linalg.norm(carried)
        twist = math.atan2(carried @ np.cross(tangents[0], normals[0]), carried @ normals[0])
    binormals = np.cross(tangents, normals)
    turns = 2 * math.pi * np.arange(around) / around - twist * np.arange(count)[:, None] / count
    ring = np.cos(turns)[..., None] * normals[:, None] + np.sin(turns)[..., None] * binormals[:, None]
    vertices = (path[:, None] + radii[:, None, None] * ring).reshape(-1, 3)
    return vertices if closed else np.concatenate([vertices, path[:1], path[-1:]])


def tube(path, radius, around=16, closed=False):
    """A circle swept along a path (n, 3). `radius` may differ from point to point. An open one is capped."""
    count = len(path)
    # Along the path and then around it runs clockwise, seen from outside.
    faces = [face[::-1] for face in grid_faces(count, around, wrap_rows=closed, wrap_columns=True)]
    if not closed:
        start, end = count * around, count * around + 1
        for step in range(around):
            faces.append((start, (step + 1) % around, step))
            faces.append((end, (count - 1) * around + step, (count - 1) * around + (step + 1) % around))
    return tube_vertices(path, radius, around, closed), faces
