"""Reads ``.l4gs`` files, dynamic scenes of 3D Gaussians, and draws them on the CPU.

>>> import light4gs
>>> scene = light4gs.open("scene.l4gs")
>>> gaussians = scene.gaussians(0.5)
>>> camera = light4gs.Camera.look_at((0, -4, 1), (0, 0, 0), (0, 0, 1), 0.7, 400, 300)
>>> image = scene.render(camera, 0.5)
"""

from ._camera import Camera
from ._errors import Error
from ._native import __version__
from ._scene import Gaussians, InriaGaussians, Scene, Take, from_bytes, limits, open

__all__ = [
    "Camera",
    "Error",
    "Gaussians",
    "InriaGaussians",
    "Scene",
    "Take",
    "__version__",
    "from_bytes",
    "limits",
    "open",
]
