"""Writes a scene as a data set, in one of the layouts that are read."""

from .. import digest, pictures
from . import dnerf, neu3d, nerfies

# Of captures, which have a number of moments. Scenes that name no layout have D-NeRF's.
CAPTURES = {"neu3d": neu3d.write, "hypernerf": nerfies.write, "nerfds": nerfies.write}


def write(name, scene, folder, side, frames, threads, only):
    """Renders a scene. `side`: the longer one of a picture, `frames`: how many moments of a capture; None: as the scene says."""
    layout = layout_of(scene)
    usual = scene.size if layout in CAPTURES else dnerf.SIZE
    size = _scaled(usual, side or max(usual))
    if layout in CAPTURES:
        wanted = frames or scene.frames
        if wanted > scene.frames:
            raise pictures.Refused(f"--frames {wanted}: {name} has {scene.frames}")
        CAPTURES[layout](scene, folder, size, wanted, threads, only)
        usual_length = wanted == scene.frames
    elif frames is not None:
        raise pictures.Refused(f"--frames {frames}: {name} is no capture, and each of its pictures has a time of its own; leave --frames out")
    else:
        dnerf.write(scene, folder, size, threads, only)
        usual_length = True
    if only is None:
        pictures.say(f"{folder}: {digest.compared(name, size == usual and usual_length, digest.of(folder))}")


def layout_of(scene):
    """The name of a scene's layout."""
    return getattr(scene, "layout", "dnerf")


def _scaled(size, side):
    """A size with this longer side, and about the same shape; the other side is even, as videos need it."""
    if side == max(size):
        return size
    shorter = 2 * round(min(size) * side / max(size) / 2)
    return tuple(side if length == max(size) else shorter for length in size)
