"""Planes under a context model: "`feature_planes`, context coded"."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..entropy.ans import SymbolDecoder
from ..entropy.gaussian_tables import distribution, levels
from ..limits import Budget
from ..networks.arithmetic import F
from ..networks.execution import run
from ..reader import Reader
from .context_model import ANCHORS, BELOW, LATENT, Condition, ContextModel, Prior, coding_order
from .planes import Place, Planes, take_memory

_LARGEST_MEAN = F(1 << 20)
_SMALLEST_STEP = F(2.0**-60)


def read_step(reader: Reader, field: str) -> np.float32:
    """A step of values that are coded as symbols."""
    step = reader.f32(field)
    reader.require(bool(step >= _SMALLEST_STEP), field, "2^-60 or more")
    return step


def usable_means(means: np.ndarray) -> np.ndarray:
    """0 in place of means that are not within 2^20."""
    return np.where(np.abs(means) <= _LARGEST_MEAN, means, F(0)).astype(np.float32)


def read_context_coded_planes(reader: Reader, planes: Planes, model: ContextModel, budget: Budget) -> None:
    """Reads the bytes after the head, and fills in the planes' values."""
    take_memory(reader, planes, budget)
    fits = planes.channels == model.channels
    reader.require(fits, "channels", f"those of the context model, {model.channels}, not {planes.channels}")
    for place, (height, width) in planes.sizes.items():
        reader.require(height % 4 == 0 and width % 4 == 0, f"{place.name}: size", "multiples of 4")
    step_count = reader.varint("number of steps")
    reader.require(step_count in (1, planes.scales), "number of steps", f"1 or {planes.scales}, not {step_count}")
    # [step_count, 2]: without time, with time.
    steps = [[read_step(reader, "step") for _ in range(2)] for _ in range(step_count)]
    order = coding_order(reader, model, planes)
    parts = [(place, part) for place in order for part in _parts(model.prior_of[place])]
    lengths = [reader.varint(f"{place.name}: length of {part}") for place, part in parts]
    streams = {key: reader.take(length, f"{key[0].name}: {key[1]}") for key, length in zip(parts, lengths)}
    reader.end()
    for place in order:
        step = steps[min(place.scale, step_count - 1)][place.has_time]
        _PlaneDecoder(reader.part, planes, model, place, step).read(streams)


def _parts(prior: Prior) -> list[str]:
    """The sub-streams of a plane."""
    parts = ["latent"] if prior.reads(LATENT) else []
    return parts + (["anchors", "other places"] if prior.reads(ANCHORS) else ["all places"])


@dataclass
class _PlaneDecoder:
    """Decodes one plane, after those that it depends on."""

    part: str
    planes: Planes
    model: ContextModel
    place: Place
    step: np.float32

    def read(self, streams: dict[tuple[Place, str], bytes]) -> None:
        """Fills in the values of the plane."""
        prior = self.model.prior_of[self.place]
        height, width = self.planes.sizes[self.place]
        self._center = self._center_of(self.place)
        self._latent: np.ndarray | None = None
        if prior.reads(LATENT):
            self._latent = self._read_latent(streams[self.place, "latent"])
        values = np.zeros((self.planes.channels, height, width), np.float32)
        odd = (np.arange(height)[:, None] + np.arange(width)) % 2 == 1
        if prior.reads(ANCHORS):
            # At the places of anchors, conditions that read anchors are zeros: nothing here needs anchors yet.
            self._read_symbols(streams[self.place, "anchors"], "anchors", values, odd, self._parameters(None, odd))
            anchors = np.where(odd, values - self._center, F(0))
            self._read_symbols(
                streams[self.place, "other places"], "other places", values, ~odd, self._parameters(anchors, odd)
            )
        else:
            everywhere = np.ones_like(odd)
            self._read_symbols(
                streams[self.place, "all places"], "all places", values, everywhere, self._parameters(None, odd)
            )
        self.planes.values[self.place] = values

    def _center_of(self, place: Place) -> np.float32:
        return self.model.center_with_time if place.has_time else self.model.center

    def _read_latent(self, data: bytes) -> np.ndarray:
        """`[N, H / 4, W / 4]`."""
        field = f"{self.place.name}: latent"
        decoder = SymbolDecoder(self.part, field, data)
        height, width = self.planes.sizes[self.place]
        latent = np.empty((self.model.latent_channels, height // 4, width // 4), np.float32)
        for channel, table in enumerate(self.model.latent_tables):
            symbols = [decoder.symbol(table) for _ in range(latent[channel].size)]
            latent[channel] = np.array(symbols, np.float32).reshape(latent[channel].shape) + self.model.medians[channel]
        decoder.end()
        return latent

    def _parameters(self, anchors: np.ndarray | None, odd: np.ndarray) -> np.ndarray:
        """Scales, then means, at every place: `[2 C, H, W]`. Without anchors, conditions that need them are zeros everywhere."""
        prior = self.model.prior_of[self.place]
        network = self.model.networks[prior.distribution]
        size = self.planes.sizes[self.place]
        inputs = []
        for i, condition in enumerate(prior.conditions):
            reads_anchors = ANCHORS in condition.sources
            if condition.network is None or (reads_anchors and anchors is None):
                inputs.append(np.zeros((network.inputs[i], *size), np.float32))
                continue
            value = self._condition(condition, anchors)
            inputs.append(np.where(odd, F(0), value) if reads_anchors else value)
        name = f"{self.place.name}: distribution"
        return run(self.part, name, network, self.model.weights[prior.distribution], inputs, size)[0]

    def _condition(self, condition: Condition, anchors: np.ndarray | None) -> np.ndarray:
        assert condition.network is not None
        inputs = [self._source(source, anchors) for source in condition.sources]
        network = self.model.networks[condition.network]
        weights = self.model.weights[condition.network]
        size = self.planes.sizes[self.place]
        return run(self.part, f"{self.place.name}: condition", network, weights, inputs, size)[0]

    def _source(self, source: int, anchors: np.ndarray | None) -> np.ndarray:
        if source == ANCHORS:
            assert anchors is not None
            return anchors
        if source == LATENT:
            assert self._latent is not None
            return self._latent
        place = Place(self.place.scale - 1, self.place.axes) if source == BELOW else Place(self.place.scale, source)
        return self.planes.values[place] - self._center_of(place)

    def _read_symbols(
        self, data: bytes, part: str, values: np.ndarray, mask: np.ndarray, parameters: np.ndarray
    ) -> None:
        """Fills in the values at the places of the mask, in the order row, channel, column."""
        decoder = SymbolDecoder(self.part, f"{self.place.name}: {part}", data)
        channels, height, _ = values.shape
        level_of = levels(parameters[:channels])
        means = usable_means(parameters[channels:])
        for row in range(height):
            columns = np.flatnonzero(mask[row])
            for channel in range(channels):
                symbols = [decoder.symbol(distribution(int(level_of[channel, row, x]))) for x in columns]
                with np.errstate(over="ignore"):
                    value = (np.array(symbols, np.float32) + means[channel, row, columns]) * self.step
                values[channel, row, columns] = value + self._center
        decoder.end()
        if not np.isfinite(values).all():
            decoder.refuse("finite numbers")
