"""Takes: minutes in one file."""

import math

import numpy as np
import pytest
from conftest import ROOT

import light4gs

TAKES = ROOT / "tests" / "conformance" / "streams" / "takes"
SEGMENTS = TAKES / "segments.l4gs"


@pytest.fixture(scope="module")
def take() -> light4gs.Take:
    found = light4gs.open(SEGMENTS)
    assert isinstance(found, light4gs.Take)
    return found


def test_what_a_take_says_of_itself(take):
    assert (take.name, take.seconds, take.fps) == ("a take \N{TENNIS RACQUET AND BALL}", 1.5, pytest.approx(29.97))
    assert take.segments == [(0.0, 0.3), (0.5, 0.97)]
    assert (take.gaussian_count, take.sh_degree) == (60, 1)
    assert repr(take) == f"<light4gs.Take {take.name!r}: 1.5 seconds, 2 segments, 60 Gaussians in the base>"
    assert "two lines" in take.extra["camera"]


def test_gaussians_of_base_and_segment(take):
    base = take.gaussians(0.4)
    assert len(base.means) == 60 and base.sh_degree == 1
    first, second = take.gaussians(0.1), take.gaussians(0.6)
    # Of the base 22 are hidden: 7 of each 20, and one more.
    assert len(first.means) > 60 - 22 and np.array_equal(first.means[0], base.means[7])
    assert len(second.means) == 60 + 2 and np.array_equal(second.means[:60], base.means)
    for found in (base, first, second):
        assert found.sh.shape == (len(found.means), (found.sh_degree + 1) ** 2, 3)
        assert found.quats.shape == (len(found.means), 4)
    inria = take.gaussians(0.1, convention="inria")
    assert np.array_equal(inria.means, first.means) and inria.further == {}
    assert inria.sh_degree == first.sh_degree and inria.f_rest.shape[1] == 3 * ((first.sh_degree + 1) ** 2 - 1)
    assert not np.array_equal(take.gaussians(0.1).means, take.gaussians(0.2).means)
    assert len(take.gaussians(-5).means) == len(take.gaussians(100).means) == 60


def test_images(take, camera):
    image = take.render(camera, 0.1)
    assert image.shape == (camera.height, camera.width, 3) and np.isfinite(image).all()
    assert light4gs.from_bytes(SEGMENTS.read_bytes()).render(camera, 0.1).tobytes() == image.tobytes()


def test_a_take_without_anything():
    nothing = light4gs.open(TAKES / "nothing.l4gs")
    assert len(nothing.gaussians(3).means) == 0 and nothing.gaussians(3, convention="inria").f_rest.shape[0] == 0


def test_errors(take, camera):
    for wrong in (math.nan, math.inf):
        with pytest.raises(ValueError, match="finite number of seconds"):
            take.gaussians(wrong)
        with pytest.raises(ValueError):
            take.render(camera, wrong)
    with pytest.raises(TypeError):
        take.gaussians("1")
    data = SEGMENTS.read_bytes()
    with pytest.raises(light4gs.Error) as caught:
        light4gs.from_bytes(data[:-1])
    assert caught.value.kind == "truncated"
    # The second segment in the file is the first in time.
    damaged = light4gs.from_bytes(data[:-1] + bytes([data[-1] ^ 1]))
    assert len(damaged.gaussians(0.6).means) == 62
    with pytest.raises(light4gs.Error, match="segment 0 of the take") as caught:
        damaged.gaussians(0.1)
    assert caught.value.kind == "checksum"
    with pytest.raises(TypeError):
        light4gs.Take(None)  # type: ignore[arg-type]
