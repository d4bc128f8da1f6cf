"""Files that every decoder must refuse: one for each rule. `check --write` makes manifest/refused.txt of it.

A rule has a name, a file, and what to change in it. A change names a field as `fields` prints it: `PART: FIELD` or, for its
`n`-th occurrence, `PART: FIELD #n`, from 0. After `=` come the bytes in its place, in hexadecimal; `{same}` stands for those that were
there, `{same-1}` for all of them but the last. Where a change does not name a field, it is an edit as in forging.py, in which `{table}`,
`{meta}`, `{size}` or the name of a section stand for where the table begins, or for lengths in bytes.
"""

from __future__ import annotations

import math
import pathlib
import struct

from l4gs.errors import Refused
from l4gs.text import lines

from .fields import fields
from .forging import Edit, forge, split
from .takes import TAKE_RULES, edits_of_take

GOLDEN, STREAMS = "../../golden-streams/", "../streams/"
FLOAT32, COMPACT, PAPER, NODES = (f"{GOLDEN}{name}.l4gs" for name in ("float32", "compact", "paper", "nodes"))
ALL, EQUAL = STREAMS + "motion-all.l4gs", STREAMS + "equal.l4gs"
RARE, OWN_SIZES, CLUSTERS, FAR = (
    f"{STREAMS}{name}.l4gs" for name in ("rare-operations", "own-sizes", "clusters", "far-values")
)
LAYERS, LAYERS_TABLES, LAYERS_CHANNELS, LAYERS_FLOAT32 = (
    f"{STREAMS}layers/{name}.l4gs" for name in ("networks", "tables", "channels", "float32")
)


def f32(*values: float) -> str:
    return struct.pack(f"<{len(values)}f", *values).hex()


def block(value: str) -> str:
    """Its length as a varint below 128, and its bytes."""
    return f"{len(value):02x}" + value.encode().hex()


NAN, INFINITY = f32(math.nan), f32(math.inf)

RULES: list[tuple[str, str, list[str]]] = [
    # The frame.
    ("empty", FLOAT32, ["file@0-{size}="]),
    ("seven-bytes", FLOAT32, ["file@7-{size-7}="]),
    ("only-a-prelude", FLOAT32, ["file@32-{size-32}="]),
    ("magic", FLOAT32, ["header@0-1=88"]),
    ("magic-changed-by-text-transfer", FLOAT32, ["file@5-1="]),
    ("version-0", FLOAT32, ["header@8-2=0000"]),
    ("version-2", FLOAT32, ["header@8-2=0200"]),
    ("version-256", FLOAT32, ["header@8-2=0001"]),
    ("flags", FLOAT32, ["header@10-2=0100"]),
    ("flags-upper", FLOAT32, ["header@10-2=0080"]),
    ("too-many-sections", FLOAT32, ["file@12-4=ffffffff"]),
    ("meta-beyond-the-end", FLOAT32, ["file@16-4=00000800"]),
    ("length-too-small", FLOAT32, ["header@20-1={length-1}"]),
    ("length-too-large", FLOAT32, ["header@20-1={length+1}"]),
    ("one-byte-too-many", FLOAT32, ["file@{size}-0=00"]),
    ("one-byte-too-few", FLOAT32, ["file@{size-1}-1="]),
    ("checksum-of-the-header", FLOAT32, ["file@28-1=00"]),
    ("checksum-covers-the-prelude", FLOAT32, ["file@12-1=04"]),
    ("checksum-covers-the-meta", FLOAT32, ["file@36-1=54"]),
    ("checksum-covers-the-table", FLOAT32, ["file@{table+3}-1=01"]),
    ("checksum-of-a-section", FLOAT32, ["file@{size-1}-1=7f"]),
    ("bytes-after-the-last-section", FLOAT32, ["file@{size}-0=00", "header@20-1={length+1}"]),
    # The meta.
    ("meta-too-long", FLOAT32, ["meta@{meta}-0=00"]),
    ("meta-too-short", FLOAT32, ["meta@{meta-1}-1="]),
    ("name-not-utf8", FLOAT32, ["meta: name #1=74696e7920ff3fbe2e"[:-2]]),
    ("name-with-a-surrogate", FLOAT32, ["meta: name #0=03000000", "meta: name #1=eda080"]),
    ("name-overlong-utf8", FLOAT32, ["meta: name #0=02000000", "meta: name #1=c0af"]),
    ("name-with-a-line-feed", FLOAT32, ["meta: name #1=74696e790af09f8ebe"]),
    ("name-with-a-control-character", FLOAT32, ["meta: name #1=74696e791bf09f8ebe"]),
    ("name-with-delete", FLOAT32, ["meta: name #1=74696e797ff09f8ebe"]),
    ("name-with-a-c1-control", FLOAT32, ["meta: name #1=74696e797ac2852020"]),
    ("name-that-changes-direction", FLOAT32, ["meta: name #1=74696e792020e280ae"]),
    ("name-with-an-isolate", FLOAT32, ["meta: name #1=74696e792020e281a6"]),
    ("name-with-an-arabic-letter-mark", FLOAT32, ["meta: name #1=74696e79202020d89c"]),
    ("name-of-1025-bytes", FLOAT32, ["meta: name #0=01040000", "meta: name #1=" + "61" * 1025]),
    ("name-beyond-the-meta", FLOAT32, ["meta: name #0=ffffffff"]),
    ("too-many-frames", FLOAT32, ["meta: frame count=a1860100"]),
    ("negative-frames-a-second", FLOAT32, ["meta: frames a second=" + f32(-1)]),
    ("frames-a-second-nan", FLOAT32, ["meta: frames a second=" + NAN]),
    ("box-the-wrong-way-round", FLOAT32, ["meta: largest corner=" + f32(1, -2.5, 3.5)]),
    ("box-infinite", FLOAT32, ["meta: largest corner=" + f32(1, 2, math.inf)]),
    ("background-nan", FLOAT32, ["meta: background=" + f32(1, math.nan, 1)]),
    ("width-too-large", FLOAT32, ["meta: width=01400000"]),
    ("height-too-large", FLOAT32, ["meta: height=01400000"]),
    ("too-many-pixels", FLOAT32, ["meta: width=00400000", "meta: height=01080000"]),
    ("field-of-view-of-pi", FLOAT32, ["meta: field of view=" + f32(math.pi)]),
    ("negative-field-of-view", FLOAT32, ["meta: field of view=" + f32(-0.5)]),
    ("too-many-extra-entries", FLOAT32, ["meta: number of extra entries=01040000"]),
    ("keys-not-sorted", FLOAT32, ["meta: key #3=" + b"aaaaaa".hex()]),
    ("a-key-twice", FLOAT32, ["meta: key #3=" + b"author".hex()]),
    ("key-with-a-tab", FLOAT32, ["meta: key #3=" + b"wr\tter".hex()]),
    ("key-of-1025-bytes", FLOAT32, ["meta: key #2=01040000", "meta: key #3=" + "77" * 1025]),
    ("value-with-a-control-character", FLOAT32, ["meta: value #1=612074650d74"]),
    ("value-longer-than-it-may-be", FLOAT32, ["meta: value #0=01000100"]),
    # The table.
    ("unknown-section", FLOAT32, ["table@0-2=0700"]),
    ("section-0", FLOAT32, ["table@0-2=0000"]),
    ("section-twice", FLOAT32, ["table@48-2=0300"]),
    ("section-missing", FLOAT32, ["table@64-16=", "feature_planes@0-{feature_planes}="]),
    ("context-model-without-need", FLOAT32, ["table@80-0=06000100" + "00" * 12]),
    ("context-model-missing", COMPACT, ["table@80-16=", "context_model@0-{context_model}="]),
    ("unknown-kind-of-gaussians", FLOAT32, ["table@2-1=02"]),
    ("unknown-kind-of-sh", FLOAT32, ["table@18-1=06"]),
    ("kind-0", FLOAT32, ["table@34-1=00"]),
    ("unknown-encoding", FLOAT32, ["table@3-1=02"]),
    ("encoding-of-another-kind", FLOAT32, ["table@19-1=01"]),
    ("scene-coordinates-quantized", FLOAT32, ["table@35-1=01"]),
    ("section-beyond-the-end", FLOAT32, ["header@{table+72}-8=ffffffffffffffff"]),
    ("section-shorter-than-its-bytes", FLOAT32, ["header@{table+72}-2=ff00"]),
    # Layers.
    ("layer-without-harmonics", LAYERS, ["table@112-16=", "sh_2@0-{sh_2}="]),
    ("harmonics-without-a-layer", LAYERS, ["table@96-4=02000501"]),
    ("first-harmonics-that-continue", LAYERS, ["table@82-2=0501"]),
    ("further-networks", LAYERS, ["table@114-1=03"]),
    ("further-tables", LAYERS_TABLES, ["table@114-1=02"]),
    ("channels-that-continue", LAYERS_CHANNELS, ["table@114-1=05"]),
    ("explicit-harmonics-that-continue", LAYERS_FLOAT32, ["table@98-2=0501"]),
    ("further-layer-in-another-encoding", LAYERS, ["table@99-1=00"]),
    ("further-layer-of-another-degree", LAYERS, ["sh_2: degree=01"]),
    ("further-channels-of-another-degree", LAYERS_CHANNELS, ["sh_2: degree=01", "sh_2: length of degree 2=", "sh_2: degree 2="]),
    ("further-float32-of-another-degree", LAYERS_FLOAT32, ["sh_2: degree=00", "sh_2: coefficients="]),
    ("further-layer-of-another-number", LAYERS, ["sh_2: number of Gaussians=12"]),
    ("further-layer-with-another-attribute", LAYERS, ["gaussians_2: attribute 5: name #1=" + b"agf".hex()]),
    ("further-layer-with-another-mark", LAYERS, ["gaussians_2: attribute 5 (age): coder=02"]),
    (
        "further-layer-with-another-coder",
        LAYERS_CHANNELS,
        [
            "gaussians_2: attribute 6 (label): coder=8901",
            "gaussians_2: label=00",
        ],
    ),
    ("further-layer-cut-off", LAYERS, ["sh_2@{sh_2-1}-1="]),
    ("further-layer-too-long", LAYERS, ["gaussians_2@{gaussians_2}-0=01"]),
    # Fields of every section.
    ("varint-with-a-last-group-of-0", FLOAT32, ["feature_planes: channels=8100"]),
    ("varint-beyond-64-bits", FLOAT32, ["motion: number of tensors=ffffffffffffffffff02"]),
    ("varint-of-eleven-bytes", FLOAT32, ["motion: number of tensors=8080808080808080808001"]),
    ("varint-cut-off", FLOAT32, ["sh@0-{sh}=80"]),
    ("block-beyond-the-section", FLOAT32, ["motion: kind #0=ffffffffffffffff7f"]),
    # Gaussians.
    ("gaussians-cut-off", FLOAT32, ["gaussians@{gaussians-1}-1="]),
    ("gaussians-too-long", FLOAT32, ["gaussians@{gaussians}-0=00"]),
    ("more-gaussians-than-bytes", FLOAT32, ["gaussians: number of Gaussians=03000000"]),
    ("too-many-gaussians", FLOAT32, ["gaussians: number of Gaussians=01000004"]),
    ("too-many-quantized-gaussians", COMPACT, ["gaussians: number of Gaussians=00000004"]),
    ("four-attributes", FLOAT32, ["gaussians: number of attributes=04"]),
    ("65-attributes", FLOAT32, ["gaussians: number of attributes=41"]),
    ("attributes-in-another-order", FLOAT32, ["gaussians: attribute 2: name #1=" + b"quatz".hex()]),
    ("attribute-with-an-upper-case-letter", FLOAT32, ["gaussians: attribute 5: name #1=" + b"Age".hex()]),
    ("attribute-with-a-dot", FLOAT32, ["gaussians: attribute 5: name #1=" + b"a.e".hex()]),
    ("attribute-without-a-name", FLOAT32, ["gaussians: attribute 5: name #0=00", "gaussians: attribute 5: name #1="]),
    (
        "attribute-with-65-letters",
        FLOAT32,
        ["gaussians: attribute 5: name #0=41", "gaussians: attribute 5: name #1=" + "61" * 65],
    ),
    (
        "attribute-twice",
        FLOAT32,
        ["gaussians: attribute 5: name #0=" + block("quats"), "gaussians: attribute 5: name #1="],
    ),
    (
        "attribute-sh-rest",
        FLOAT32,
        ["gaussians: attribute 5: name #0=" + block("sh_rest"), "gaussians: attribute 5: name #1="],
    ),
    ("attribute-of-width-0", FLOAT32, ["gaussians: attribute 5 (age): width=00"]),
    ("attribute-of-width-257", FLOAT32, ["gaussians: attribute 5 (age): width=8102"]),
    ("quats-of-width-3", FLOAT32, ["gaussians: attribute 2 (quats): width=03"]),
    ("means-may-be-left-out", FLOAT32, ["gaussians: attribute 0 (means): coder=80"]),
    ("coder-in-encoding-0", FLOAT32, ["gaussians: attribute 5 (age): coder=8208"]),
    ("unknown-coder-in-encoding-0", FLOAT32, ["gaussians: attribute 5 (age): coder=8908"]),
    ("means-nan", FLOAT32, ["gaussians@65-4=" + NAN]),
    ("quats-infinite", FLOAT32, ["gaussians@113-4=" + INFINITY]),
    ("means-without-grid", COMPACT, ["gaussians: attribute 0 (means): coder=02"]),
    ("grid-of-another-attribute", COMPACT, ["gaussians: attribute 1 (log_scales): coder=01"]),
    ("colors-of-width-2", COMPACT, ["gaussians: attribute 5 (age): coder=83"]),
    ("unknown-coder-that-counts", COMPACT, ["gaussians: attribute 5 (age): coder=04"]),
    ("length-of-an-attribute-too-large", COMPACT, ["gaussians: attribute 5 (age): length=7f"]),
    ("corner-nan", COMPACT, ["gaussians: means: corner=" + f32(0, math.nan, 0)]),
    ("corner-too-far", COMPACT, ["gaussians: means: corner=" + f32(0, 0, 2e30)]),
    ("grid-of-step-0", COMPACT, ["gaussians: means: step=" + f32(0)]),
    ("grid-of-a-subnormal-step", COMPACT, ["gaussians: means: step=" + f32(1e-39)]),
    ("grid-of-a-negative-step", COMPACT, ["gaussians: means: step=" + f32(-0.1)]),
    ("grid-of-a-huge-step", COMPACT, ["gaussians: means: step=" + f32(2e30)]),
    ("grid-of-21-bits", COMPACT, ["gaussians: means: bits=15"]),
    ("step-of-an-attribute-nan", COMPACT, ["gaussians: quats: step=" + NAN]),
    ("step-of-an-attribute-infinite", COMPACT, ["gaussians: sh_dc: step=" + INFINITY]),
    (
        "range-coded-bytes-cut-off",
        CLUSTERS,
        ["gaussians: attribute 1 (log_scales): length=06", "gaussians: log_scales #1=5151"],
    ),
    ("point-beyond-the-range", COMPACT, ["gaussians: means #1=" + "ff" * 26]),
    ("fill-not-zero", EQUAL, ["gaussians@{gaussians-1}-1=01"]),
    ("fill-missing", EQUAL, ["gaussians@{gaussians-1}-1="]),
    ("fill-too-long", EQUAL, ["gaussians@{gaussians}-0=00"]),
    (
        "index-of-channels-too-large",
        NODES,
        ["sh: length of degree 1=16", "sh: degree 1=a95a50c7a65b2c362727272727272727272727272727"],
    ),
    ("attribute-that-nothing-reads", FLOAT32, ["gaussians: attribute 5 (age): coder=00"]),
    # Scene coordinates.
    ("coordinates-cut-off", FLOAT32, ["scene_coordinates@56-4="]),
    ("coordinates-too-long", FLOAT32, ["scene_coordinates@60-0=00"]),
    ("coordinates-nan", FLOAT32, ["scene_coordinates@0-4=" + NAN]),
    ("contraction-2", ALL, ["scene_coordinates: contraction=02"]),
    ("mapping-infinite", ALL, ["scene_coordinates: time=" + f32(math.inf, 0)]),
    # Motion, and networks in it.
    ("kind-with-a-space", FLOAT32, ["motion: kind #1=" + b"test field".hex()]),
    ("kind-of-65-letters", FLOAT32, ["motion: kind #0=41", "motion: kind #1=" + "61" * 65]),
    ("motion-without-a-kind", FLOAT32, ["motion: kind #0=00", "motion: kind #1="]),
    ("kind-where-nothing-moves", STREAMS + "nothing.l4gs", ["motion: kind #0=0161"]),
    ("network-neither-0-nor-1", FLOAT32, ["motion: whether there is a network=02"]),
    ("too-many-inputs", FLOAT32, ["motion: network: number of inputs=8102"]),
    ("input-of-0-channels", FLOAT32, ["motion: network: channels of input 1=00"]),
    ("too-many-nodes", FLOAT32, ["motion: network: number of nodes=8102"]),
    ("unknown-operation", FLOAT32, ["motion: network: node 2: operation=9a"]),
    ("node-that-reads-itself", FLOAT32, ["motion: network: node 4 (linear): input 0=06"]),
    (
        "node-before-any-value",
        STREAMS + "motion-operations.l4gs",
        [
            "motion: network: number of inputs=00",
            "motion: network: channels of input 0=",
            "motion: network: channels of input 1=",
            "motion: network: channels of input 2=",
            "motion: network: channels of input 3=",
            "motion: network: channels of input 4=",
            "motion: network: node 0: operation=80",
        ],
    ),
    (
        "concatenation-of-one",
        FLOAT32,
        [
            "motion: network: node 0 (concatenate): number of inputs=01",
            "motion: network: node 0 (concatenate): input 1=",
        ],
    ),
    (
        "concatenation-of-nothing",
        FLOAT32,
        [
            "motion: network: node 0 (concatenate): number of inputs=00",
            "motion: network: node 0 (concatenate): input 0=",
            "motion: network: node 0 (concatenate): input 1=",
        ],
    ),
    ("layer-of-0-outputs", FLOAT32, ["motion: network: node 1 (linear): outputs=00"]),
    ("layer-of-too-many-outputs", FLOAT32, ["motion: network: node 1 (linear): outputs=818008"]),
    (
        "channels-that-do-not-divide",
        STREAMS + "motion-operations.l4gs",
        ["motion: network: node 2 (subtract): input 1=02"],
    ),
    (
        "group-that-does-not-divide",
        STREAMS + "motion-operations.l4gs",
        ["motion: network: node 4 (group sum): group=02"],
    ),
    ("group-of-0", STREAMS + "motion-operations.l4gs", ["motion: network: node 4 (group sum): group=00"]),
    ("affine-nan", STREAMS + "motion-operations.l4gs", ["motion: network: node 5 (affine): scale=" + NAN]),
    (
        "select-beyond-the-channels",
        STREAMS + "motion-operations.l4gs",
        ["motion: network: node 14 (select): run 0: first=03"],
    ),
    (
        "select-nothing",
        STREAMS + "motion-operations.l4gs",
        [
            "motion: network: node 14 (select): run 0: length=00",
            "motion: network: node 14 (select): run 1: length=00",
            "motion: network: node 14 (select): run 2: length=00",
        ],
    ),
    ("clamp-the-wrong-way-round", ALL, ["motion: network: node 9 (clamp): least=" + f32(0.7)]),
    ("slope-infinite", ALL, ["motion: network: node 2 (leaky ReLU with a slope): slope=" + INFINITY]),
    ("groups-that-do-not-divide", ALL, ["motion: network: node 10 (convolution): groups=03"]),
    ("groups-0", ALL, ["motion: network: node 10 (convolution): groups=00"]),
    ("motion-that-looks-beyond", ALL, ["motion: network: node 10 (convolution): kernel=03"]),
    ("motion-with-a-mean", FLOAT32, ["motion: network: node 2: operation=89"]),
    ("output-that-is-no-value", FLOAT32, ["motion: network: output 1=08"]),
    ("too-many-outputs", FLOAT32, ["motion: network: number of outputs=8102"]),
    ("unknown-source-of-motion", FLOAT32, ["motion: input 1=04"]),
    ("source-of-other-channels", FLOAT32, ["motion: input 1=01"]),
    ("attribute-that-gaussians-lack", ALL, ["motion: input 4: attribute #1=" + b"agf".hex()]),
    ("unknown-output-of-motion", FLOAT32, ["motion: output 1=0a"]),
    ("output-of-other-channels", FLOAT32, ["motion: output 1=01"]),
    ("an-attribute-changed-twice", FLOAT32, ["motion: network: output 1=05", "motion: output 1=05"]),
    ("too-many-tensors", FLOAT32, ["motion: number of tensors=8102"]),
    ("tensor-with-a-control-character", FLOAT32, ["motion: tensor 0: name #1=" + b"no\x01es".hex()]),
    ("tensor-not-utf8", FLOAT32, ["motion: tensor 0: name #1=ffffffffff"]),
    (
        "tensor-of-nine-axes",
        FLOAT32,
        ["motion: tensor 0: number of axes=09", "motion: tensor 0: length of axis 0=01010101010101" + "02"],
    ),
    ("tensor-twice", ALL, ["motion: tensor 1: name #0=" + block("a line"), "motion: tensor 1: name #1="]),
    ("tensor-too-large", FLOAT32, ["motion: tensor 0: length of axis 0=8080808008"]),
    ("weights-cut-off", FLOAT32, ["motion@{motion-1}-1="]),
    ("weights-too-long", FLOAT32, ["motion@{motion}-0=00"]),
    ("weight-nan", FLOAT32, ["motion: weights #0=" + NAN + "00" * 32]),
    ("quantized-weights-of-no-bytes", COMPACT, ["motion: weights="]),
    ("quantized-weights-cut-off", COMPACT, ["motion: weights=" + "51" * 8]),
    ("step-of-weights", COMPACT, ["motion: weights=38b4e652e44da7f2370d9e26" + "ca" * 40]),
    ("order-of-weights-3", COMPACT, ["motion: weights=424212578fe0feb17b4aa559" + "fe" * 40]),
    ("fewer-bytes-than-256-weights-need", COMPACT, ["motion: tensor 0: length of axis 0=808001"]),
    # Feature planes.
    ("planes-of-0-channels", FLOAT32, ["feature_planes: channels=00"]),
    ("planes-of-too-many-channels", FLOAT32, ["feature_planes: channels=8120"]),
    ("too-many-scales", FLOAT32, ["feature_planes: number of scales=11"]),
    ("scale-without-planes", FLOAT32, ["feature_planes: scale 0: planes=00"]),
    ("bit-7-of-a-scale", FLOAT32, ["feature_planes: scale 0: planes=bf"]),
    ("plane-of-size-0", FLOAT32, ["feature_planes: scale 0: size along y=00"]),
    ("plane-too-large", FLOAT32, ["feature_planes: scale 0: size along y=818004"]),
    (
        "own-sizes-that-agree",
        FLOAT32,
        [
            "feature_planes: scale 0: planes=41",
            "feature_planes: scale 0: size along z=",
            "feature_planes: scale 0: size along t=",
        ],
    ),
    ("more-planes-than-bytes", FLOAT32, ["feature_planes: scale 0: size along x=808004"]),
    ("plane-nan", FLOAT32, ["feature_planes@12-4=" + NAN]),
    ("planes-cut-off", FLOAT32, ["feature_planes@{feature_planes-1}-1="]),
    ("planes-too-long", FLOAT32, ["feature_planes@{feature_planes}-0=00"]),
    ("channels-of-another-model", COMPACT, ["feature_planes: channels=05"]),
    ("size-no-multiple-of-4", COMPACT, ["feature_planes: scale 0: size along x=06"]),
    ("number-of-steps", COMPACT, ["feature_planes: number of steps=03"]),
    ("no-steps", COMPACT, ["feature_planes: number of steps=00"]),
    ("step-of-planes-too-small", COMPACT, ["feature_planes: step #0=" + f32(2.0**-61)]),
    ("step-of-planes-negative", COMPACT, ["feature_planes: step #1=" + f32(-0.1)]),
    ("planes-that-overflow", COMPACT, ["feature_planes: step #0=" + f32(3e38), "feature_planes: step #1=" + f32(3e38)]),
    ("step-of-planes-nan", COMPACT, ["feature_planes: step #1=" + NAN]),
    ("sub-stream-beyond-the-section", COMPACT, ["feature_planes: 1.zt: length of all places=7f"]),
    (
        "sub-stream-too-short",
        COMPACT,
        ["feature_planes: 1.zt: length of all places=26", "feature_planes: 1.zt: all places={same-1}"],
    ),
    (
        "sub-stream-ends-with-0",
        COMPACT,
        ["feature_planes: 1.zt: length of all places=28", "feature_planes: 1.zt: all places={same}00"],
    ),
    (
        "sub-stream-with-another-word",
        COMPACT,
        ["feature_planes: 1.zt: length of all places=2b", "feature_planes: 1.zt: all places=01000000{same}"],
    ),
    ("latent-too-short", COMPACT, ["feature_planes: 0.xt: length of latent=00", "feature_planes: 0.xt: latent="]),
    (
        "escape-with-24-zeros",
        FAR,
        ["feature_planes: 0.xy: length of anchors=04", "feature_planes: 0.xy: anchors=ffffff01"],
    ),
    ("context-coded-too-long", COMPACT, ["feature_planes@{feature_planes}-0=01"]),
    # Context model.
    ("center-nan", PAPER, ["context_model: center=" + NAN]),
    ("latent-of-too-many-channels", COMPACT, ["context_model: channels of the latent=8120"]),
    ("too-many-networks", COMPACT, ["context_model: number of networks=21"]),
    ("even-kernel", COMPACT, ["context_model: network 0: node 4 (convolution): kernel=04"]),
    ("kernel-of-9", COMPACT, ["context_model: network 0: node 4 (convolution): kernel=09"]),
    ("checkerboard-of-kernel-1", COMPACT, ["context_model: network 1: node 0 (checkerboard): kernel=01"]),
    ("checkerboard-of-a-node", COMPACT, ["context_model: network 3: node 1: operation=84"]),
    (
        "look-beyond-after-a-checkerboard",
        RARE,
        ["context_model: network 2: node 2: operation=81", "context_model: network 2: node 2 (linear): outputs=080301"],
    ),
    ("another-reader-of-anchors", RARE, ["context_model: network 2: node 1: operation=0500"]),
    ("anchors-as-an-output", COMPACT, ["context_model: network 1: output 0=00"]),
    ("too-many-priors", COMPACT, ["context_model: number of priors=21"]),
    ("distribution-that-is-no-network", COMPACT, ["context_model: prior 0: distribution=05"]),
    ("distribution-that-looks-beyond", COMPACT, ["context_model: prior 0: distribution=00"]),
    ("distribution-of-other-outputs", COMPACT, ["context_model: network 4: node 5 (linear): outputs=09"]),
    (
        "number-of-conditions",
        COMPACT,
        ["context_model: prior 4: number of conditions=01", "context_model: prior 4: condition 1: network="],
    ),
    ("condition-that-is-no-network", COMPACT, ["context_model: prior 4: condition 0: network=06"]),
    ("unknown-source-of-a-condition", COMPACT, ["context_model: prior 4: condition 0: source 0=09"]),
    ("source-without-anchors", COMPACT, ["context_model: prior 0: condition 1: source 0=00"]),
    ("anchors-without-checkerboard", COMPACT, ["context_model: prior 4: condition 0: source 0=06"]),
    ("latent-as-a-plane", COMPACT, ["context_model: prior 4: condition 0: source 0=07"]),
    ("number-of-planes", COMPACT, ["context_model: number of planes=0b", "context_model: 1.zt: prior="]),
    ("prior-that-is-not-there", COMPACT, ["context_model: 1.zt: prior=05"]),
    ("no-plane-one-scale-below", COMPACT, ["context_model: 0.xy: prior=04"]),
    ("plane-that-is-not-there", OWN_SIZES, ["context_model: prior 1: condition 0: source 0=05"]),
    ("planes-in-a-circle", COMPACT, ["context_model: 0.xt: prior=01"]),
    (
        "tables-cut-off",
        COMPACT,
        ["context_model: tables of the latent #0=02", "context_model: tables of the latent #1=0102"],
    ),
    (
        "table-without-slots",
        COMPACT,
        ["context_model: tables of the latent #0=10", "context_model: tables of the latent #1=2fa8" + "aa" * 14],
    ),
    (
        "code-of-a-table-0",
        COMPACT,
        ["context_model: tables of the latent #0=0f", "context_model: tables of the latent #1=63" + "32" * 14],
    ),
    ("median-infinite", COMPACT, ["context_model: medians=" + INFINITY]),
    ("output-of-another-size", COMPACT, ["context_model: network 3: node 0: operation=8b"]),
    ("sizes-that-differ", COMPACT, ["context_model: network 2: node 4: operation=85"]),
    ("context-weights-too-long", PAPER, ["context_model@{context_model}-0=00"]),
    # Spherical harmonics.
    ("another-number-of-gaussians", FLOAT32, ["sh: number of Gaussians=03"]),
    ("degree-4", FLOAT32, ["sh: degree=04"]),
    ("harmonics-cut-off", FLOAT32, ["sh@{sh-4}-4="]),
    ("harmonics-too-long", FLOAT32, ["sh@{sh}-0=00000000"]),
    ("coefficient-nan", FLOAT32, ["sh@2-4=" + NAN]),
    ("step-of-tables-too-small", PAPER, ["sh: step=" + f32(2.0**-61)]),
    ("harmonics-that-overflow", PAPER, ["sh: step=" + f32(3e38)]),
    ("step-of-networks-infinite", COMPACT, ["sh: step=" + INFINITY]),
    ("step-of-channels-too-large", NODES, ["sh: step=" + f32(2e30)]),
    ("sh-tables-cut-off", PAPER, ["sh: tables #0=02", "sh: tables #1=0102"]),
    ("fewer-priors-than-channels", COMPACT, ["sh: number of priors=01"]),
    ("prior-of-an-odd-output", COMPACT, ["sh: prior 0: node 2 (linear): outputs=11"]),
    ("prior-that-looks-beyond", COMPACT, ["sh: prior 0: node 1: operation=8b"]),
    ("source-of-a-prior", COMPACT, ["sh: prior 0: source 0=07"]),
    ("source-of-a-prior-of-other-channels", COMPACT, ["sh: prior 0: source 0=05"]),
    ("weights-of-priors-cut-off", COMPACT, ["sh: weights #0=08", "sh: weights #1=5151515151515151"]),
    ("symbols-of-a-degree-cut-off", COMPACT, ["sh: length of degree 1=60", "sh: degree 1={same-1}"]),
    ("symbols-of-a-table-cut-off", PAPER, ["sh: length of degree 1=17", "sh: degree 1={same-1}"]),
    ("channels-of-a-degree-cut-off", NODES, ["sh: length of degree 1=02", "sh: degree 1=5151"]),
]


def _edits(data: bytes, changes: list[str]) -> list[Edit]:
    """Edits of these changes, the last of a part first, so that earlier offsets stay what they are."""
    found = fields(data)
    parts = split(data)
    sizes = {name: len(part) for name, part in parts.items()}
    sizes.update(size=len(data), length=data[20], table=32 + len(parts["meta"]), meta=len(parts["meta"]))
    at_field: list[Edit] = []
    others: list[Edit] = []
    for change in changes:
        left, _, new = change.rpartition("=")
        part, separator, name = left.partition(": ")
        if not separator:
            others.append(Edit.parse(_filled(left, sizes) + "=" + _filled(new, sizes, True)))
            continue
        name, _, occurrence = name.partition(" #")
        here = [field for field in found if (field.part, field.name) == (part, name)]
        if not here:
            raise ValueError(f"{change}: no such field")
        field = here[int(occurrence or 0)]
        old = parts[part][field.offset : field.offset + field.length].hex()
        new = new.replace("{same-1}", old[:-2]).replace("{same}", old)
        at_field.append(Edit(part, field.offset, field.length, bytes.fromhex(new)))
    at_field.sort(key=lambda edit: -edit.offset)
    return at_field + others


def _filled(text: str, sizes: dict[str, int], as_byte: bool = False) -> str:
    """`{name+n}` by numbers: in hexadecimal as one byte, otherwise in decimal."""
    while "{" in text:
        before, _, rest = text.partition("{")
        inner, _, after = rest.partition("}")
        name, sign, number = inner.partition("+") if "+" in inner else inner.partition("-")
        value = sizes[name] + int(sign + number or "0")
        text = before + (f"{value % 256:02x}" if as_byte else str(value)) + after
    return text


def list_of_refusals(folder: pathlib.Path) -> str:
    """The text of manifest/refused.txt, with the message of the decoder of this folder about each file."""
    blocks = ["# Files that every decoder refuses. `check --write` makes this list of ../kit/refusals.py.\n"]
    for name, source, changes in RULES:
        data = (folder / source).read_bytes()
        blocks.append(_block(name, source, data, _edits(data, changes)))
    for name, source, of_take in TAKE_RULES:
        data = (folder / source).read_bytes()
        blocks.append(_block(name, source, data, edits_of_take(data, of_take)))
    return "\n".join(blocks)


def _block(name: str, source: str, data: bytes, edits: list[Edit]) -> str:
    """The lines of a file that is refused."""
    try:
        lines(forge(data, edits), ["0"])
        raise ValueError(f"{name} is accepted")
    except Refused as refused:
        said = refused
    block = [f"refused {name}", f"from {source}"]
    block += [f"edit {edit.part}@{edit.offset}-{edit.length}={edit.new.hex()}" for edit in edits]
    return "\n".join([*block, f"expects {said.part}: {said.field}: {said.expectation}"]) + "\n"
