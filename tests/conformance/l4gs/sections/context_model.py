"""How context-coded planes are described: "`context_model`"."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from .. import limits
from ..container import Section
from ..entropy.ans import Distribution
from ..entropy.frequency_tables import read_tables
from ..limits import Budget
from ..networks.description import Network, read_network
from ..networks.weights import read_weights
from ..reader import Reader
from .planes import AXIS_NAMES, Place, Planes

# Sources 0 to 5 are planes of the same scale.
ANCHORS, LATENT, BELOW = 6, 7, 8


@dataclass
class Condition:
    """A network and the sources of its inputs; `None` stands for zeros."""

    network: int | None
    sources: list[int] = field(default_factory=list)


@dataclass
class Prior:
    distribution: int  # a network
    conditions: list[Condition]

    def reads(self, source: int) -> bool:
        return any(source in condition.sources for condition in self.conditions)


@dataclass
class ContextModel:
    channels: int
    center: np.float32
    center_with_time: np.float32
    latent_channels: int
    networks: list[Network]
    weights: list[list[np.ndarray]]
    priors: list[Prior]
    prior_of: dict[Place, Prior]
    latent_tables: list[Distribution]
    medians: np.ndarray  # [latent_channels]


def read_context_model(section: Section, planes: Planes, budget: Budget) -> ContextModel:
    """Needs the head of the planes, since it has a prior for each."""
    reader = Reader(section.name, section.data)
    channels = reader.varint("channels", limits.PLANE_CHANNELS)
    center, center_with_time = reader.f32("center"), reader.f32("center with time")
    latent_channels = reader.varint("channels of the latent", limits.PLANE_CHANNELS)
    network_count = reader.varint("number of networks", limits.NETWORKS)
    networks = [read_network(reader, f"network {i}") for i in range(network_count)]
    prior_count = reader.varint("number of priors", limits.NETWORKS)
    priors = [_read_prior(reader, f"prior {i}", networks, channels, latent_channels) for i in range(prior_count)]
    plane_count = reader.varint("number of planes")
    reader.require(plane_count == len(planes.sizes), "number of planes", f"that of the planes, {len(planes.sizes)}")
    prior_of = {}
    for place in planes.sizes:
        prior = reader.varint(f"{place.name}: prior")
        reader.require(prior < len(priors), f"{place.name}: prior", "the number of a prior")
        prior_of[place] = priors[prior]
    tables: list[Distribution] = []
    medians = np.zeros(0, np.float32)
    if latent_channels:
        tables = read_tables(
            section.name, "tables of the latent", reader.block("tables of the latent"), latent_channels, budget
        )
        medians = reader.f32s((latent_channels,), "medians")
    weights, _ = read_weights(reader, networks, [], section.encoding, budget)
    return ContextModel(
        channels, center, center_with_time, latent_channels, networks, weights, priors, prior_of, tables, medians
    )


def _read_prior(reader: Reader, name: str, networks: list[Network], channels: int, latent_channels: int) -> Prior:
    distribution = reader.varint(f"{name}: distribution")
    reader.require(distribution < len(networks), f"{name}: distribution", "the number of a network")
    network = networks[distribution]
    reader.require(not network.looks_beyond, f"{name}: distribution", "a network that looks at one place only")
    fits = network.output_channels == [2 * channels]
    reader.require(
        fits, f"{name}: distribution", f"one output of {2 * channels} channels, not {network.output_channels}"
    )
    count = reader.varint(f"{name}: number of conditions", limits.NODES)
    fits = count == len(network.inputs)
    reader.require(
        fits, f"{name}: number of conditions", f"one for each of {len(network.inputs)} inputs of the distribution"
    )
    conditions = []
    for i in range(count):
        conditions.append(_read_condition(reader, f"{name}: condition {i}", networks, channels, latent_channels))
        condition = conditions[-1]
        if condition.network is not None:
            output = networks[condition.network].output_channels
            fits = output == [network.inputs[i]]
            reader.require(fits, f"{name}: condition {i}", f"one output of {network.inputs[i]} channels, not {output}")
    return Prior(distribution, conditions)


def _read_condition(
    reader: Reader, name: str, networks: list[Network], channels: int, latent_channels: int
) -> Condition:
    number = reader.varint(f"{name}: network")
    if number == 0:
        return Condition(None)
    reader.require(number <= len(networks), f"{name}: network", "0, or 1 plus the number of a network")
    network = networks[number - 1]
    anchors = network.anchor_inputs()
    sources = []
    for i, wanted in enumerate(network.inputs):
        field = f"{name}: source {i}"
        source = reader.varint(field, BELOW)
        of_source = latent_channels if source == LATENT else channels
        reader.require(source != LATENT or latent_channels > 0, field, "no latent where there is none")
        reader.require(wanted == of_source, field, f"an input of {of_source} channels, not {wanted}")
        fits = (source == ANCHORS) == (i in anchors)
        reader.require(fits, field, "anchors exactly where a checkerboard convolution reads")
        sources.append(source)
    return Condition(number - 1, sources)


def coding_order(reader: Reader, model: ContextModel, planes: Planes) -> list[Place]:
    """The planes in the order in which they are coded."""
    order: list[Place] = []
    for scale in range(planes.scales):
        waiting = [place for place in planes.sizes if place.scale == scale]
        for place in waiting:
            prior = model.prior_of[place]
            for condition in prior.conditions:
                for source in condition.sources:
                    if source < ANCHORS:
                        there = Place(scale, source) in planes.sizes
                        reader.require(
                            there, f"{place.name}: prior", f"planes that exist, not {scale}.{AXIS_NAMES[source]}"
                        )
                    elif source == BELOW:
                        there = Place(scale - 1, place.axes) in planes.sizes
                        reader.require(there, f"{place.name}: prior", "a plane one scale below")
        while waiting:
            ready = [
                place for place in waiting if not any(model.prior_of[place].reads(other.axes) for other in waiting)
            ]
            reader.require(
                len(ready) > 0, f"{waiting[0].name}: prior", "planes that do not depend on each other in a circle"
            )
            order += ready
            waiting = [place for place in waiting if place not in ready]
    return order
