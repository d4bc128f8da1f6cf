"""A whole stream: its sections in the order in which they need each other."""

from __future__ import annotations

from .container import CONTEXT_CODED, Meta, read_container
from .limits import Budget
from .reader import Reader
from .sections.context_coding import read_context_coded_planes
from .sections.context_model import read_context_model
from .sections.coordinates import read_scene_coordinates
from .sections.gaussians import read_gaussians
from .sections.harmonics import Surroundings, read_harmonics
from .sections.motion import Scene, read_motion
from .sections.planes import Planes, read_explicit_planes, read_head


def decode(data: bytes) -> tuple[Meta, Scene]:
    """Decodes a stream, or raises `Refused`."""
    container = read_container(data)
    sections = container.sections
    budget = Budget(len(data))
    gaussians = read_gaussians(sections["gaussians"], budget)
    coordinates = read_scene_coordinates(sections["scene_coordinates"])
    motion = read_motion(sections["motion"], budget)
    planes = _read_planes(container.sections, budget)
    harmonics = read_harmonics(sections["sh"], Surroundings(gaussians, planes, coordinates), budget)
    scene = Scene(gaussians, harmonics, planes, coordinates, motion)
    scene.check_sources("motion")
    return container.meta, scene


def _read_planes(sections: dict, budget: Budget) -> Planes:
    section = sections["feature_planes"]
    reader = Reader(section.name, section.data)
    if section.kind != CONTEXT_CODED:
        return read_explicit_planes(reader, budget)
    planes = read_head(reader)
    model = read_context_model(sections["context_model"], planes, budget)
    read_context_coded_planes(reader, planes, model, budget)
    return planes
