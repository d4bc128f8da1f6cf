"""The same bits as the decoder in Rust, and pictures like those of `light4gs render`."""

import math

import numpy as np
import pytest
from conftest import GOLDEN, PLAYER
from PIL import Image

import light4gs


def table():
    """The table of CRC-32C, which Python's library lacks."""
    entries = []
    for byte in range(256):
        for _ in range(8):
            byte = byte >> 1 ^ (0x82F63B78 if byte & 1 else 0)
        entries.append(byte)
    return entries


TABLE = table()


def crc32c(data: bytes) -> int:
    value = 0xFFFFFFFF
    for byte in data:
        value = value >> 8 ^ TABLE[(value ^ byte) & 255]
    return value ^ 0xFFFFFFFF


def test_the_checksum_is_that_of_the_format():
    assert crc32c(b"123456789") == 0xE3069283


FRAMES = [line.split() for line in (GOLDEN / "frames.txt").read_text().splitlines()]


@pytest.mark.parametrize("name,time,expected", FRAMES)
def test_every_time_has_the_bits_on_record(name, time, expected):
    scene = light4gs.open(GOLDEN / f"{name}.l4gs")
    g = scene.gaussians(float(time), convention="inria")
    # From all coefficients of red, then green, then blue to red, green, blue of each.
    rest = g.f_rest.reshape(scene.gaussian_count, 3, -1).transpose(0, 2, 1)
    parts = [g.means, g.scale, g.rot, g.opacity, g.f_dc, rest, *g.further.values()]
    assert f"{crc32c(b''.join(np.ascontiguousarray(part).tobytes() for part in parts)):08x}" == expected
    same = light4gs.from_bytes((GOLDEN / f"{name}.l4gs").read_bytes()).gaussians(float(time), convention="inria")
    assert same.means.tobytes() == g.means.tobytes()


def test_the_lossless_streams_are_those_of_the_compressed_ones():
    for path in GOLDEN.glob("*.decoded.l4gs"):
        compressed = light4gs.open(GOLDEN / path.name.replace(".decoded", "")).gaussians(0.5)
        decoded = light4gs.open(path).gaussians(0.5)
        for name in ("means", "quats", "scales", "opacities", "sh"):
            assert getattr(compressed, name).tobytes() == getattr(decoded, name).tobytes(), (path, name)


@pytest.mark.parametrize("stream", sorted(path.stem for path in GOLDEN.glob("*.l4gs")))
def test_the_conventions_agree(stream):
    scene = light4gs.open(GOLDEN / f"{stream}.l4gs")
    g, raw = scene.gaussians(0.25), scene.gaussians(0.25, convention="inria")
    n, k = scene.gaussian_count, (scene.sh_degree + 1) ** 2
    shapes = {"means": (n, 3), "quats": (n, 4), "scales": (n, 3), "opacities": (n,), "sh": (n, k, 3)}
    assert {name: getattr(g, name).shape for name in shapes} == shapes
    assert all(getattr(g, name).dtype == np.float32 and getattr(g, name).flags["W"] for name in shapes)
    assert np.array_equal(g.means, raw.means)
    np.testing.assert_allclose(g.scales, np.exp(np.minimum(raw.scale, 40)), rtol=1e-6)
    np.testing.assert_allclose(g.opacities, 1 / (1 + np.exp(-raw.opacity)), rtol=1e-6)
    np.testing.assert_allclose(g.quats, raw.rot / np.linalg.norm(raw.rot, axis=1, keepdims=True), atol=1e-6)
    assert np.array_equal(g.sh[:, 0], raw.f_dc)
    assert np.array_equal(g.sh[:, 1:].transpose(0, 2, 1).reshape(n, -1), raw.f_rest)


def psnr(a, b) -> float:
    error = float(np.mean((a.astype(np.float64) - b.astype(np.float64)) ** 2))
    return math.inf if error == 0 else -10 * math.log10(error)


@pytest.mark.parametrize("folder,radius,elevation", [("near", 3, 10), ("above", 4.5, 60)])
@pytest.mark.parametrize("frame,time", [(0, 0.0), (1, 0.5), (2, 1.0)])
def test_pictures_are_those_of_light4gs_render(quickstart, folder, radius, elevation, frame, time):
    """The pictures were made by `light4gs render --path fixed`, with the kernels of a back end of Burn."""
    angle = math.radians(elevation)
    eye = (0, -radius * math.cos(angle), radius * math.sin(angle))
    camera = light4gs.Camera.look_at(eye, (0, 0, 0), (0, 0, 1), quickstart.fov_x, 200, 200)
    image = quickstart.render(camera, time)
    assert image.shape == (200, 200, 3) and image.dtype == np.float32
    expected = np.asarray(Image.open(PLAYER / folder / f"{frame:04}.png"), dtype=np.float64) / 255
    bytes_ = np.round(np.clip(image, 0, 1) * 255) / 255
    # One pixel of a thousand that is rounded to the next byte is 78 dB.
    found = psnr(bytes_, expected)
    print(f"{folder} {time}: {found:.1f} dB")
    assert found > 70


def test_a_background_can_be_chosen(quickstart):
    away = light4gs.Camera.look_at((0, -4, 0), (0, -8, 0), (0, 0, 1), 0.7, 5, 4)
    assert np.array_equal(quickstart.render(away, 0.5), np.ones((4, 5, 3), np.float32))
    image = quickstart.render(away, 0.5, background=(0.25, 0.5, 0))
    assert np.array_equal(image, np.broadcast_to(np.float32([0.25, 0.5, 0]), (4, 5, 3)))


def test_metadata(quickstart):
    assert quickstart.name == "q-scene" and quickstart.frame_count == 100
    assert quickstart.gaussian_count == 6415 and quickstart.sh_degree == 3
    assert quickstart.bounds.shape == (2, 3) and (quickstart.bounds[0] <= quickstart.bounds[1]).all()
    assert quickstart.background == (1.0, 1.0, 1.0) and (quickstart.width, quickstart.height) == (200, 200)
    assert quickstart.bytes == (PLAYER / "quickstart.l4gs").stat().st_size
    assert list(quickstart.sections)[:2] == ["gaussians", "sh"]
    assert 0 < sum(quickstart.sections.values()) < quickstart.bytes
    assert "q-scene" in repr(quickstart)
