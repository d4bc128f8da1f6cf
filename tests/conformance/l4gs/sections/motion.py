"""The motion of the Gaussians: "`motion`"."""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np

from .. import limits
from ..container import Section
from ..errors import Refused
from ..limits import Budget
from ..networks.description import Network, read_network
from ..networks.execution import run
from ..networks.weights import read_weights
from ..reader import Reader
from .coordinates import SceneCoordinates
from .gaussians import FIRST_ATTRIBUTES, Gaussians
from .harmonics import Harmonics
from .planes import Planes

_FEATURES, _POINT, _TIME, _ATTRIBUTE = range(4)
# Outputs 0 to 4 are added to these, 5 to 9 take their place.
_OUTPUTS = ("means", "log_scales", "quats", "opacity_logits", "spherical harmonics")
_WIDTHS = (3, 3, 4, 1)
_HARMONICS = 4
_HARMONICS_WIDTHS = tuple(3 * (degree + 1) ** 2 for degree in range(4))
_LEGAL_KIND = re.compile(r"[a-z0-9_.-]{0,64}")
_MOST_AXES = 8


@dataclass
class Source:
    """The source of an input of the network; `attribute` is empty unless it is an attribute."""

    kind: int
    attribute: str = ""


@dataclass
class Motion:
    kind: str
    network: Network | None
    sources: list[Source]
    outputs: list[int]
    weights: list[np.ndarray]
    tensors: dict[str, np.ndarray]


def read_motion(section: Section, budget: Budget) -> Motion:
    reader = Reader(section.name, section.data)
    kind = reader.block("kind").decode("latin-1")
    reader.require(_LEGAL_KIND.fullmatch(kind) is not None, "kind", "at most 64 of a-z, 0-9, -, _, .")
    has_network = reader.u8("whether there is a network")
    reader.require(has_network <= 1, "whether there is a network", f"0 or 1, not {has_network}")
    network = None
    sources: list[Source] = []
    outputs: list[int] = []
    if has_network:
        network = read_network(reader, "network")
        reader.require(not network.looks_beyond, "network", "operations that stay at one place")
        sources = [_read_source(reader, f"input {i}") for i in range(len(network.inputs))]
        outputs = _read_outputs(reader, network)
    tensor_count = reader.varint("number of tensors", limits.NODES)
    names: list[str] = []
    shapes: list[tuple[int, ...]] = []
    for i in range(tensor_count):
        names.append(_read_name(reader, f"tensor {i}: name"))
        axes = reader.varint(f"tensor {i}: number of axes", _MOST_AXES)
        shapes.append(tuple(reader.varint(f"tensor {i}: length of axis {j}", (1 << 32) - 1) for j in range(axes)))
    nothing_moves = network is None and tensor_count == 0
    reader.require((kind == "") == nothing_moves, "kind", "empty exactly where there is no network and no tensor")
    reader.require(len(set(names)) == len(names), "tensors", "names that are there once")
    networks = [network] if network else []
    weights, tensors = read_weights(reader, networks, shapes, section.encoding, budget)
    return Motion(kind, network, sources, outputs, weights[0] if network else [], dict(zip(names, tensors)))


def _read_name(reader: Reader, field: str) -> str:
    raw = reader.block(field)
    reader.require(len(raw) <= limits.NAME_BYTES, field, f"at most {limits.NAME_BYTES} bytes")
    return reader.text(raw, field)


def _read_source(reader: Reader, name: str) -> Source:
    kind = reader.u8(name)
    reader.require(kind <= _ATTRIBUTE, name, f"a known input, not {kind}")
    return Source(kind, _read_name(reader, f"{name}: attribute") if kind == _ATTRIBUTE else "")


def _read_outputs(reader: Reader, network: Network) -> list[int]:
    outputs: list[int] = []
    for i, channels in enumerate(network.output_channels):
        output = reader.u8(f"output {i}")
        reader.require(output < 2 * len(_OUTPUTS), f"output {i}", f"a known output, not {output}")
        attribute = output % len(_OUTPUTS)
        twice = any(other % len(_OUTPUTS) == attribute for other in outputs)
        reader.require(not twice, f"output {i}", f"each attribute at most once, {_OUTPUTS[attribute]} too")
        wanted = _HARMONICS_WIDTHS if attribute == _HARMONICS else (_WIDTHS[attribute],)
        reader.require(channels in wanted, f"output {i}", f"one of {wanted} channels, not {channels}")
        outputs.append(output)
    return outputs


@dataclass
class Scene:
    """The values that the network may read, and those that it changes."""

    gaussians: Gaussians
    harmonics: Harmonics
    planes: Planes
    coordinates: SceneCoordinates
    motion: Motion

    def attributes(self) -> dict[str, np.ndarray]:
        """All attributes of the Gaussians by name, `[N, width]` each, as motion may read them."""
        result = dict(self.gaussians.attributes)
        result["sh_rest"] = self.harmonics.values.reshape(self.gaussians.count, self.harmonics.values.shape[1] * 3)
        return result

    def check_sources(self, part: str) -> None:
        """Refuses inputs of the motion that this scene does not have."""
        if self.motion.network is None:
            return
        reader = Reader(part, b"")
        there = self.attributes()
        for i, (source, channels) in enumerate(zip(self.motion.sources, self.motion.network.inputs)):
            if source.kind == _ATTRIBUTE:
                reader.require(
                    source.attribute in there,
                    f"input {i}",
                    f"an attribute that the Gaussians have, not {source.attribute}",
                )
                wanted = there[source.attribute].shape[1]
            else:
                wanted = {_FEATURES: self.planes.scales * self.planes.channels, _POINT: 3, _TIME: 1}[source.kind]
            reader.require(channels == wanted, f"input {i}", f"{wanted} channels, not {channels}")

    def check_shown(self) -> None:
        """Refuses to show a scene that would look wrong, since one of its attributes is not known.

        Motion without a network is of a kind that only its own program knows; here such scenes stand still.
        """
        known = {name for name, _ in FIRST_ATTRIBUTES} | {source.attribute for source in self.motion.sources}
        if self.motion.network is None and self.motion.kind:
            return
        for name in self.gaussians.attributes:
            if name not in known and name not in self.gaussians.optional:
                raise Refused("gaussians", name, "an attribute that may be left out, or that the motion reads")

    def at(self, time: np.float32) -> dict[str, np.ndarray]:
        """The attributes at a time from 0 to 1: by name, `[N, width]` each."""
        result = self.attributes()
        motion = self.motion
        if motion.network is None or self.gaussians.count == 0:
            return result
        count = self.gaussians.count
        points = self.coordinates.of_points(result["means"])
        field_time = self.coordinates.field_time(time)
        inputs = []
        for source in motion.sources:
            if source.kind == _FEATURES:
                value = self.planes.features(points, field_time)
            elif source.kind == _POINT:
                value = points.T
            elif source.kind == _TIME:
                value = np.full((1, count), field_time, np.float32)
            else:
                value = result[source.attribute].T
            inputs.append(np.ascontiguousarray(value)[:, None, :])
        changes = run("motion", "network", motion.network, motion.weights, inputs, (1, count))
        for output, change in zip(motion.outputs, changes):
            attribute, replaces = output % len(_OUTPUTS), output >= len(_OUTPUTS)
            self._apply(result, attribute, replaces, change[:, 0, :].T)
        return result

    @staticmethod
    def _apply(result: dict[str, np.ndarray], attribute: int, replaces: bool, change: np.ndarray) -> None:
        """Puts a change `[N, channels]` of an attribute into the result."""
        if attribute != _HARMONICS:
            name = _OUTPUTS[attribute]
            result[name] = change if replaces else result[name] + change
            return
        begin = 0
        for name in ("sh_dc", "sh_rest"):
            old = result[name]
            here = change[:, begin : begin + old.shape[1]]
            begin += old.shape[1]
            new = old.copy()
            new[:, : here.shape[1]] = here if replaces else old[:, : here.shape[1]] + here
            result[name] = new
