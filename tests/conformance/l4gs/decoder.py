"""A whole stream: its sections in the order in which they need each other."""

from __future__ import annotations

from .container import CONTEXT_CODED, Meta, read_container
from .errors import Refused
from .limits import Budget
from .reader import Reader
from .sections.context_coding import read_context_coded_planes
from .sections.context_model import read_context_model
from .sections.coordinates import read_scene_coordinates
from .sections.gaussians import Gaussians, all_gaussians, check_further_layer, read_gaussians
from .sections.harmonics import Harmonics, Surroundings, all_harmonics, read_harmonics
from .sections.motion import Scene, read_motion
from .sections.planes import Planes, read_explicit_planes, read_head


def decode(data: bytes) -> tuple[Meta, Scene]:
    """Decodes a stream, or raises `Refused`."""
    container = read_container(data)
    sections = container.sections
    budget = Budget(len(data))
    coordinates = read_scene_coordinates(sections["scene_coordinates"])
    motion = read_motion(sections["motion"], budget)
    planes = _read_planes(container.sections, budget)
    gaussians: list[Gaussians] = []
    harmonics: list[Harmonics] = []
    coding = None
    for of_gaussians, of_harmonics in container.layers():
        gaussians.append(read_gaussians(of_gaussians, budget))
        around = Surroundings(gaussians[-1], planes, coordinates)
        values, coding = read_harmonics(of_harmonics, around, coding, budget)
        harmonics.append(values)
        check_further_layer(of_gaussians.name, gaussians)
        same = values.degree == harmonics[0].degree
        if not same:
            raise Refused(of_harmonics.name, "degree", f"that of the first layer, {harmonics[0].degree}")
    scene = Scene(all_gaussians(gaussians), all_harmonics(harmonics), planes, coordinates, motion)
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
