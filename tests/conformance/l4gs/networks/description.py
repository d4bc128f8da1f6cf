"""Networks as they stand in a section, and the rules for them."""

from __future__ import annotations

from dataclasses import dataclass, field
from math import prod

from .. import limits
from ..reader import Reader

LINEAR, CONVOLUTION, HALVING, DOUBLING, CHECKERBOARD = range(5)
RELU, LEAKY_RELU, LEAKY_RELU_WITH_SLOPE = 5, 6, 7
RESIZE, MEAN_OVER_HEIGHT, MEAN_OVER_WIDTH, TRANSPOSE, SPREAD, CONCATENATE = range(8, 14)
ADD, MULTIPLY, SUBTRACT, DIVIDE = range(14, 18)
EXPONENTIAL, LOGARITHM, SQUARE_ROOT, AFFINE, CLAMP = range(18, 23)
GROUP_SUM, GROUP_MAXIMUM, SELECT = 23, 24, 25

_NAMES = (
    "linear, convolution, halving, doubling, checkerboard, ReLU, leaky ReLU, leaky ReLU with a slope, resize, mean over height, "
    "mean over width, transpose, spread, concatenate, add, multiply, subtract, divide, exponential, logarithm, square root, "
    "affine, clamp, group sum, group maximum, select"
).split(", ")

_LAYERS = range(LINEAR, CHECKERBOARD + 1)
_PAIRS = range(ADD, DIVIDE + 1)
# The inputs of a network are numbers of values below this one.
_BEFORE_BIT = 0x80


@dataclass
class Node:
    """One operation. Numbers that it does not have are 0."""

    operation: int
    inputs: list[int]
    outputs: int = 0
    kernel: int = 1
    groups: int = 1
    first: float = 0.0  # slope, scale, least
    second: float = 0.0  # offset, most
    size: int = 0  # of a group
    runs: list[tuple[int, int]] = field(default_factory=list)

    @property
    def name(self) -> str:
        return _NAMES[self.operation]

    @property
    def looks_beyond(self) -> bool:
        """Whether a place of the result reads other places of the inputs."""
        if self.operation in (LINEAR, CONVOLUTION):
            return self.kernel > 1
        return self.operation in (HALVING, DOUBLING) or RESIZE <= self.operation <= SPREAD


@dataclass
class Network:
    """Values are numbered from 0: the inputs, then one for each node."""

    inputs: list[int]  # channels of each
    nodes: list[Node]
    outputs: list[int]  # numbers of values
    channels: list[int]  # of every value

    @property
    def output_channels(self) -> list[int]:
        return [self.channels[value] for value in self.outputs]

    @property
    def looks_beyond(self) -> bool:
        return any(node.looks_beyond or node.operation == CHECKERBOARD for node in self.nodes)

    def weight_shapes(self) -> list[tuple[int, ...]]:
        """The shapes of the weights as they are stored: for each layer its weight, then its bias."""
        shapes: list[tuple[int, ...]] = []
        for node in self.nodes:
            if node.operation not in _LAYERS:
                continue
            channels = self.channels[node.inputs[0]]
            if node.operation == DOUBLING:
                shapes.append((channels, node.outputs, 5, 5))
            elif node.operation == CHECKERBOARD:
                shapes.append((node.outputs, channels // node.groups, node.kernel * node.kernel // 2))
            else:
                shapes.append((node.outputs, channels // node.groups, node.kernel, node.kernel))
            shapes.append((node.outputs,))
        return shapes

    def anchor_inputs(self) -> set[int]:
        """Inputs that checkerboard convolutions read."""
        return {node.inputs[0] for node in self.nodes if node.operation == CHECKERBOARD}


def read_network(reader: Reader, name: str) -> Network:
    """The description of a network, without its weights."""
    count = reader.varint(f"{name}: number of inputs", limits.NODES)
    inputs = [reader.varint(f"{name}: channels of input {i}", limits.LAYER_SIZE, 1) for i in range(count)]
    channels = list(inputs)
    node_count = reader.varint(f"{name}: number of nodes", limits.NODES)
    nodes = []
    for i in range(node_count):
        node = _read_node(reader, f"{name}: node {i}", channels)
        nodes.append(node)
    total = sum(channels)
    reader.require(total <= limits.LAYER_SIZE, f"{name}: channels", f"at most {limits.LAYER_SIZE} of all values")
    output_count = reader.varint(f"{name}: number of outputs", limits.NODES)
    outputs = []
    for i in range(output_count):
        value = reader.varint(f"{name}: output {i}")
        reader.require(value < len(channels), f"{name}: output {i}", "the number of a value")
        outputs.append(value)
    network = Network(inputs, nodes, outputs, channels)
    _check_checkerboards(reader, name, network)
    return network


def _read_node(reader: Reader, name: str, channels: list[int]) -> Node:
    """A node, whose channels it appends."""
    byte = reader.u8(f"{name}: operation")
    operation = byte & ~_BEFORE_BIT
    reader.require(operation <= SELECT, f"{name}: operation", f"a known operation, not {operation}")
    name = f"{name} ({_NAMES[operation]})"
    count = 2 if operation in _PAIRS else 1
    if operation == CONCATENATE:
        count = reader.varint(f"{name}: number of inputs", limits.NODES, 2)
    inputs = []
    for i in range(count):
        if i == 0 and byte & _BEFORE_BIT:
            reader.require(len(channels) > 0, f"{name}: operation", "a value before the node")
            inputs.append(len(channels) - 1)
            continue
        value = reader.varint(f"{name}: input {i}")
        reader.require(value < len(channels), f"{name}: input {i}", f"a value before the node's own, not {value}")
        inputs.append(value)
    node = Node(operation, inputs)
    channels.append(_read_parameters(reader, name, node, channels))
    return node


def _read_parameters(reader: Reader, name: str, node: Node, channels: list[int]) -> int:
    """Reads the parameters of a node into it. The channels of its result."""
    operation = node.operation
    read = [channels[value] for value in node.inputs]
    if operation in _LAYERS:
        node.outputs = reader.varint(f"{name}: outputs", limits.LAYER_SIZE, 1)
        node.kernel = 5 if operation == DOUBLING else 1
        if operation in (CONVOLUTION, HALVING, CHECKERBOARD):
            kernels = (3, 5, 7) if operation == CHECKERBOARD else (1, 3, 5, 7)
            node.kernel = reader.u8(f"{name}: kernel")
            reader.require(node.kernel in kernels, f"{name}: kernel", f"one of {kernels}, not {node.kernel}")
            node.groups = reader.varint(f"{name}: groups", least=1)
            divides = read[0] % node.groups == 0 and node.outputs % node.groups == 0
            reader.require(divides, f"{name}: groups", "a divisor of inputs and outputs")
        weights = prod((read[0] // node.groups, node.kernel, node.kernel))
        reader.require(
            weights <= limits.LAYER_SIZE, f"{name}: kernel", f"at most {limits.LAYER_SIZE} weights of an output"
        )
        return node.outputs
    if operation == LEAKY_RELU:
        node.first = 0.01
    elif operation == LEAKY_RELU_WITH_SLOPE:
        node.first = float(reader.f32(f"{name}: slope"))
    elif operation == AFFINE:
        node.first = float(reader.f32(f"{name}: scale"))
        node.second = float(reader.f32(f"{name}: offset"))
    elif operation == CLAMP:
        node.first = float(reader.f32(f"{name}: least"))
        node.second = float(reader.f32(f"{name}: most"))
        reader.require(node.first <= node.second, f"{name}: least", "not above most")
    elif operation == CONCATENATE:
        return sum(read)
    elif operation in _PAIRS:
        reader.require(read[0] % read[1] == 0, f"{name}: input 1", f"channels that divide {read[0]}, not {read[1]}")
    elif operation in (GROUP_SUM, GROUP_MAXIMUM):
        node.size = reader.varint(f"{name}: group", least=1)
        reader.require(read[0] % node.size == 0, f"{name}: group", f"a divisor of {read[0]}, not {node.size}")
        return read[0] // node.size
    elif operation == SELECT:
        return _read_runs(reader, name, node, read[0])
    return read[0]


def _read_runs(reader: Reader, name: str, node: Node, channels: int) -> int:
    count = reader.varint(f"{name}: number of runs", limits.LAYER_SIZE)
    for i in range(count):
        first = reader.varint(f"{name}: run {i}: first")
        length = reader.varint(f"{name}: run {i}: length", limits.LAYER_SIZE)
        reader.require(first + length <= channels, f"{name}: run {i}", f"channels below {channels}")
        node.runs.append((first, length))
    total = sum(length for _, length in node.runs)
    reader.require(1 <= total <= limits.LAYER_SIZE, f"{name}: runs", f"1 to {limits.LAYER_SIZE} channels")
    return total


def _check_checkerboards(reader: Reader, name: str, network: Network) -> None:
    """Only checkerboard convolutions read anchors, and nothing that reads their results looks beyond one place."""
    anchors = network.anchor_inputs()
    partial: set[int] = set()
    for i, node in enumerate(network.nodes):
        where = f"{name}: node {i} ({node.name})"
        value = len(network.inputs) + i
        if node.operation == CHECKERBOARD:
            reader.require(
                node.inputs[0] < len(network.inputs), where, "an input of the network, for a checkerboard convolution"
            )
            partial.add(value)
            continue
        reader.require(not anchors.intersection(node.inputs), where, "no input that a checkerboard convolution reads")
        if partial.intersection(node.inputs):
            reader.require(
                not node.looks_beyond, where, "an operation that stays at one place, after a checkerboard convolution"
            )
            partial.add(value)
    reader.require(
        not anchors.intersection(network.outputs), f"{name}: outputs", "no input that a checkerboard convolution reads"
    )
