"""Meshes in the scene: those that stand, and those that a scene moves."""

import bpy
import numpy as np


class Mesh:
    """A mesh of which the faces stay, and the vertices may be set for every moment.

    The attribute `rest` gives its paint coordinates that move with it: `rest`, or else the first vertices.
    `still`: nothing moves it, and the masks of motion are black where it is seen.
    """

    def __init__(self, name, vertices, faces, material, rest=None, smooth=True, still=False):
        vertices = np.asarray(vertices, np.float64)
        self.data = bpy.data.meshes.new(name)
        self.placed = bpy.data.objects.new(name, self.data)
        bpy.context.scene.collection.objects.link(self.placed)
        self.data.materials.append(material)
        self.data.from_pydata(vertices.tolist(), [], [list(map(int, face)) for face in faces])
        self.data.polygons.foreach_set("use_smooth", np.full(len(self.data.polygons), smooth, bool))
        self.attribute("rest", vertices if rest is None else rest)
        self.data.update()
        # Blender keeps it with the mesh, so that whoever makes the masks finds it.
        self.placed["still"] = still

    def attribute(self, name, vectors):
        """Keeps a vector for each vertex, which paint reads by its name."""
        attribute = self.data.attributes.get(name) or self.data.attributes.new(name, "FLOAT_VECTOR", "POINT")
        attribute.data.foreach_set("vector", np.asarray(vectors, np.float32).ravel())

    def move(self, vertices):
        """Sets all vertices, in world coordinates."""
        self.data.vertices.foreach_set("co", np.asarray(vertices, np.float64).astype(np.float32).ravel())
        self.data.update()
        self.data.update_tag()
