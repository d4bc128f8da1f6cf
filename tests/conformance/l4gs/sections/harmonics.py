"""Spherical harmonics beyond degree 0: "`sh`"."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .. import limits
from ..container import SH_CONTINUED, SH_NETWORKS, SH_TABLES, Section
from ..entropy.ans import LARGEST_SYMBOL, SymbolDecoder
from ..entropy.frequency_tables import read_tables
from ..entropy.gaussian_tables import distribution, levels
from ..entropy.range_coder import RangeDecoder
from ..limits import Budget
from ..networks.arithmetic import F
from ..networks.description import Network, read_network
from ..networks.execution import run
from ..networks.weights import read_weights
from ..reader import Reader
from .channels import find_neighbors, read_channels
from .context_coding import read_step, usable_means
from .coordinates import SceneCoordinates
from .gaussians import Gaussians
from .planes import Planes

_EXPLICIT = 1
_MOST_DEGREE = 3
# Gaussians whose symbols stand prior by prior.
_GROUP = 8

_SH_DC, _CHANNELS_BEFORE, _SPACE_FEATURES, _POINT, _LOG_SCALES, _QUATERNION, _OPACITY = range(7)
_ATTRIBUTES = {_SH_DC: "sh_dc", _LOG_SCALES: "log_scales", _QUATERNION: "quats", _OPACITY: "opacity_logits"}


@dataclass
class Harmonics:
    degree: int
    values: np.ndarray  # [N, coefficients beyond degree 0, 3]: red, green, blue


@dataclass
class Surroundings:
    """The sections that networks read."""

    gaussians: Gaussians
    planes: Planes
    coordinates: SceneCoordinates


@dataclass
class _Prior:
    network: Network
    weights: list[np.ndarray]
    sources: list[int]
    channels: int


def channels_of_degree(degree: int) -> range:
    """The channels that belong to one degree."""
    begin = 3 * (degree * degree - 1)
    return range(begin, begin + 3 * (2 * degree + 1))


@dataclass
class Coding:
    """How symbols become coefficients."""

    kind: int
    degree: int
    step: np.float32
    tables: list
    priors: list[_Prior]


def all_harmonics(layers: list[Harmonics]) -> Harmonics:
    """The harmonics of all layers, one layer after the other."""
    return Harmonics(layers[0].degree, np.concatenate([layer.values for layer in layers]))


def read_harmonics(
    section: Section, around: Surroundings, first: Coding | None, budget: Budget
) -> tuple[Harmonics, Coding | None]:
    """The harmonics, and the coding for layers that continue these; `first` is the one that is continued here."""
    reader = Reader(section.name, section.data)
    count = reader.varint("number of Gaussians", limits.GAUSSIANS)
    expected = around.gaussians.count
    reader.require(count == expected, "number of Gaussians", f"that of the section gaussians, {expected}, not {count}")
    degree = reader.u8("degree")
    reader.require(degree <= _MOST_DEGREE, "degree", f"at most {_MOST_DEGREE}, not {degree}")
    coefficients = (degree + 1) ** 2 - 1
    shape = (count, coefficients, 3)
    budget.take(section.name, "degree", count * coefficients * 3, 4)
    if section.kind == _EXPLICIT:
        values = reader.f32s(shape, "coefficients")
        reader.end()
        return Harmonics(degree, values), None
    channels = 3 * coefficients
    if section.kind == SH_CONTINUED and first is not None:
        coding = first
        reader.require(degree == first.degree, "degree", f"that of the first layer, {first.degree}, not {degree}")
    else:
        coding = Coding(section.kind, degree, read_step(reader, "step"), [], [])
    if section.kind == SH_TABLES:
        coding.tables = read_tables(section.name, "tables", reader.block("tables"), channels, budget)
    elif section.kind == SH_NETWORKS:
        coding.priors = _read_priors(reader, section.encoding, channels, around, budget)
    step, tables, priors = coding.step, coding.tables, coding.priors
    lengths = [reader.varint(f"length of degree {g}") for g in range(1, degree + 1)]
    streams = [reader.take(length, f"degree {g}") for g, length in enumerate(lengths, 1)]
    reader.end()

    values = np.zeros((count, channels), np.float32)
    with np.errstate(over="ignore"):
        if coding.kind == SH_TABLES:
            for g, data in enumerate(streams, 1):
                decoder = SymbolDecoder(section.name, f"degree {g}", data)
                own = channels_of_degree(g)
                symbols = [[decoder.symbol(tables[channel]) for channel in own] for _ in range(count)]
                decoder.end()
                values[:, own.start : own.stop] = np.array(symbols, np.float32).reshape(count, len(own)) * step
        elif coding.kind == SH_NETWORKS:
            _Decoder(section.name, priors, around, step, values).read(streams)
        else:
            reader.require(bool(step <= np.float32(1e30)), "step", "at most 1e30")
            neighbors = find_neighbors(around.gaussians.attributes["means"].astype(np.float64))
            for g, data in enumerate(streams, 1):
                own = channels_of_degree(g)
                adaptive = RangeDecoder(section.name, f"degree {g}", data)
                integers = read_channels(adaptive, count, len(own), neighbors, LARGEST_SYMBOL)
                values[:, own.start : own.stop] = integers.astype(np.float32) * step
    reader.require(bool(np.isfinite(values).all()), "coefficients", "finite numbers")
    return Harmonics(degree, values.reshape(shape)), coding


def _read_priors(reader: Reader, encoding: int, channels: int, around: Surroundings, budget: Budget) -> list[_Prior]:
    count = reader.varint("number of priors", limits.NETWORKS)
    priors = []
    before = 0
    for i in range(count):
        name = f"prior {i}"
        network = read_network(reader, name)
        reader.require(not network.looks_beyond, name, "a network that looks at one Gaussian only")
        outputs = network.output_channels
        fits = len(outputs) == 1 and outputs[0] % 2 == 0
        reader.require(fits, f"{name}: outputs", f"one output of an even number of channels, not {outputs}")
        own = outputs[0] // 2
        widths = {
            _SH_DC: 3,
            _CHANNELS_BEFORE: before,
            _SPACE_FEATURES: around.planes.scales * around.planes.channels,
            _POINT: 3,
            _LOG_SCALES: 3,
            _QUATERNION: 4,
            _OPACITY: 1,
        }
        sources = []
        for j, wanted in enumerate(network.inputs):
            source = reader.varint(f"{name}: source {j}", _OPACITY)
            width = widths[source]
            reader.require(wanted == width, f"{name}: source {j}", f"an input of {width} channels, not {wanted}")
            sources.append(source)
        priors.append(_Prior(network, [], sources, own))
        before += own
    reader.require(before == channels, "priors", f"priors of all {channels} channels, not {before}")
    block = reader.part_of(reader.varint("weights"), "weights")
    weights, _ = read_weights(block, [prior.network for prior in priors], [], encoding, budget)
    for prior, own_weights in zip(priors, weights):
        prior.weights = own_weights
    return priors


class _Decoder:
    """Decodes harmonics whose distributions networks give."""

    def __init__(
        self, part: str, priors: list[_Prior], around: Surroundings, step: np.float32, values: np.ndarray
    ) -> None:
        self._part = part
        self._priors = priors
        self._around = around
        self._step = step
        # [N, channels]: filled in.
        self._values = values
        # Of each Gaussian and channel, as far as priors were evaluated.
        self._levels = np.zeros(values.shape, np.int64)
        self._means = np.zeros_like(values)
        self._points = around.coordinates.of_points(around.gaussians.attributes["means"])

    def read(self, streams: list[bytes]) -> None:
        decoders = [SymbolDecoder(self._part, f"degree {degree}", data) for degree, data in enumerate(streams, 1)]
        decoder_of = [decoder for degree, decoder in enumerate(decoders, 1) for _ in channels_of_degree(degree)]
        count = len(self._values)
        # Priors that read no channels before are evaluated for all Gaussians at once, which is faster.
        begins = [sum(prior.channels for prior in self._priors[:i]) for i in range(len(self._priors))]
        for i, prior in enumerate(self._priors):
            if _CHANNELS_BEFORE not in prior.sources:
                self._evaluate(i, begins[i], slice(0, count))
        for first in range(0, count, _GROUP):
            group = slice(first, min(first + _GROUP, count))
            for i, prior in enumerate(self._priors):
                if _CHANNELS_BEFORE in prior.sources:
                    self._evaluate(i, begins[i], group)
                for gaussian in range(group.start, group.stop):
                    for channel in range(begins[i], begins[i] + prior.channels):
                        symbol = decoder_of[channel].symbol(distribution(int(self._levels[gaussian, channel])))
                        value = (F(symbol) + self._means[gaussian, channel]) * self._step
                        self._values[gaussian, channel] = value
        for decoder in decoders:
            decoder.end()

    def _evaluate(self, number: int, begin: int, of: slice) -> None:
        """Levels and means of the channels from `begin` on, which a prior describes, for some Gaussians."""
        prior = self._priors[number]
        inputs = [self._source(source, begin, of) for source in prior.sources]
        size = (1, of.stop - of.start)
        parameters = run(self._part, f"prior {number}", prior.network, prior.weights, inputs, size)[0][:, 0, :].T
        end = begin + prior.channels
        self._levels[of, begin:end] = levels(parameters[:, : prior.channels])
        self._means[of, begin:end] = usable_means(parameters[:, prior.channels :])

    def _source(self, source: int, begin: int, of: slice) -> np.ndarray:
        """The values of an input for some Gaussians: `[channels, 1, Gaussians]`."""
        if source == _CHANNELS_BEFORE:
            value = self._values[of, :begin].T
        elif source == _SPACE_FEATURES:
            value = self._around.planes.space_features(self._points[of])
        elif source == _POINT:
            value = self._points[of].T
        else:
            value = self._around.gaussians.attributes[_ATTRIBUTES[source]][of].T
        return np.ascontiguousarray(value)[:, None, :]
