"""Damaged files and wrong arguments are exceptions."""

import math
import os
import pickle
import random
import threading

import numpy as np
import pytest
from conftest import GOLDEN, PLAYER

import light4gs

STREAM = (GOLDEN / "compact.l4gs").read_bytes()

#: Errors that a caller may get; anything else, `pyo3_runtime.PanicException` above all, is a fault.
EXPECTED = (ValueError, TypeError, OverflowError)


def kind_of(data: bytes, **arguments) -> str:
    with pytest.raises(light4gs.Error) as caught:
        light4gs.from_bytes(data, **arguments)
    assert str(caught.value)
    return caught.value.kind


def test_damage_has_a_kind():
    assert issubclass(light4gs.Error, ValueError)
    assert kind_of(b"") == "truncated" and kind_of(b"PK\3\4" * 8) == "not-l4gs"
    assert kind_of(STREAM[:-1]) == "truncated"
    assert kind_of(STREAM + b"x") == "trailing-bytes"
    assert kind_of(STREAM[:-1] + bytes([STREAM[-1] ^ 1])) == "checksum"
    assert kind_of(STREAM[:8] + b"\2" + STREAM[9:]) == "newer-version"


def test_every_cut_and_many_flips_are_found():
    for end in range(len(STREAM)):
        kind_of(STREAM[:end])
    for at in range(0, len(STREAM), 3):
        damaged = bytearray(STREAM)
        damaged[at] ^= 1 << at % 8
        with pytest.raises(light4gs.Error):
            light4gs.from_bytes(damaged)


def test_errors_name_the_file_and_can_be_pickled(tmp_path):
    path = tmp_path / "cut.l4gs"
    path.write_bytes(STREAM[:500])
    with pytest.raises(light4gs.Error, match="cut.l4gs") as caught:
        light4gs.open(path)
    again = pickle.loads(pickle.dumps(caught.value))
    assert (again.kind, str(again)) == (caught.value.kind, str(caught.value))


def test_what_the_system_refuses_is_an_oserror(tmp_path):
    with pytest.raises(FileNotFoundError, match="nowhere"):
        light4gs.open(tmp_path / "nowhere.l4gs")
    with pytest.raises(OSError):
        light4gs.open(tmp_path)
    with pytest.raises((OSError, ValueError)):
        light4gs.open("a\0b")


def test_limits():
    assert light4gs.limits()["memory_bytes"] == 256 << 20
    assert light4gs.limits("large")["memory_bytes"] == 64 << 30
    assert kind_of(STREAM, limits={"gaussians": 5}) == "over-limit"
    assert kind_of(STREAM, limits={"file_bytes": 10}) == "over-limit"
    assert light4gs.from_bytes(STREAM, limits=light4gs.limits("large")).gaussian_count == 6
    for wrong, error in [
        ({"gausians": 5}, ValueError),
        ({"gaussians": -1}, ValueError),
        ({"gaussians": 2**70}, ValueError),
        ({"gaussians": 2**40}, OverflowError),
        ({"gaussians": 1.5}, TypeError),
        ({"gaussians": True}, TypeError),
        ({1: 2}, ValueError),
        ("large", TypeError),
        (5, TypeError),
    ]:
        with pytest.raises(error):
            light4gs.from_bytes(STREAM, limits=wrong)
    with pytest.raises(ValueError):
        light4gs.limits("huge")
    with pytest.raises(TypeError):
        light4gs.limits(3)


def test_an_image_beyond_the_limits_is_refused(quickstart):
    for width, height in [(20_000, 10), (10, 20_000), (16_000, 16_000), (2**32 - 1, 2**32 - 1)]:
        camera = light4gs.Camera(width, height, width, height, width / 2, height / 2, np.eye(3), (0, 0, 4))
        with pytest.raises(light4gs.Error) as caught:
            quickstart.render(camera, 0.5)
        assert caught.value.kind == "over-limit"
    # All Gaussians over all of a large image: memory is counted before it is taken.
    little = light4gs.open(PLAYER / "quickstart.l4gs", limits={"memory_bytes": 24 << 20})
    near = light4gs.Camera.look_at((0, -0.6, 0), (0, 0, 0), (0, 0, 1), 0.1, 2500, 2500)
    with pytest.raises(light4gs.Error, match="memory of the image"):
        little.render(near, 0.5)


@pytest.mark.parametrize("time", [-0.001, 1.001, math.nan, math.inf, -math.inf, 1e300])
def test_times_outside_are_refused(quickstart, camera, time):
    for call in [lambda: quickstart.gaussians(time), lambda: quickstart.render(camera, time)]:
        with pytest.raises(ValueError):
            call()


@pytest.mark.parametrize("time", [None, "0.5", [0.5], True, 1j, np.zeros(3), object()])
def test_what_is_no_time_is_refused(quickstart, camera, time):
    for call in [lambda: quickstart.gaussians(time), lambda: quickstart.render(camera, time)]:
        with pytest.raises(TypeError):
            call()


def test_wrong_types_are_refused(quickstart):
    for wrong in [None, 5, 1.5, [], object(), STREAM]:
        with pytest.raises(TypeError):
            light4gs.open(wrong)
    for wrong in [None, 5, "x", [1, 2], object(), np.zeros(3)]:
        with pytest.raises(TypeError):
            light4gs.from_bytes(wrong)
        with pytest.raises(TypeError):
            light4gs.Scene(wrong)
        with pytest.raises(TypeError):
            quickstart.render(wrong, 0.5)
    with pytest.raises(ValueError):
        quickstart.gaussians(0.5, convention="ply")
    with pytest.raises(ValueError):
        quickstart.gaussians(0.5, convention=None)
    assert light4gs.from_bytes(bytearray(STREAM)).gaussian_count == 6
    assert light4gs.from_bytes(memoryview(STREAM)).gaussian_count == 6


GOOD = dict(width=40, height=30, fx=50, fy=50, cx=20, cy=15, rotation=np.eye(3), translation=(0, 0, 4))


def test_a_camera_from_the_players_list(quickstart):
    entry = {"name": "r_0", "split": "test", "time": 0.5, **GOOD, "rotation": [1, 0, 0, 0, 1, 0, 0, 0, 1]}
    assert light4gs.Camera.from_dict(entry) == light4gs.Camera(**GOOD)
    image = quickstart.render(entry, 0.5)
    assert np.array_equal(image, quickstart.render(light4gs.Camera(**GOOD), 0.5))


@pytest.mark.parametrize(
    "change",
    [
        dict(width=0),
        dict(height=-3),
        dict(width=2**40),
        dict(width=4.0),
        dict(width=True),
        dict(width=None),
        dict(fx=0),
        dict(fy=-5),
        dict(fx=math.nan),
        dict(fx="wide"),
        dict(cx=math.inf),
        dict(cy=1e30),
        dict(rotation=np.zeros((3, 3))),
        dict(rotation=-np.eye(3)),
        dict(rotation=np.full((3, 3), math.nan)),
        dict(rotation=2 * np.eye(3)),
        dict(rotation=np.eye(4)),
        dict(rotation=[1, 0, 0]),
        dict(rotation=None),
        dict(rotation=[[1], [2, 3]]),
        dict(translation=(0, 0)),
        dict(translation=(0, 0, math.inf)),
        dict(translation=(0, 0, 1e30)),
        dict(translation="abc"),
    ],
)
def test_what_is_no_camera_is_refused(change):
    with pytest.raises(EXPECTED):
        light4gs.Camera(**{**GOOD, **change})
    with pytest.raises(EXPECTED):
        light4gs.Camera.from_dict({**GOOD, **change})


def test_a_camera_must_be_whole():
    with pytest.raises(ValueError, match="lacks fx"):
        light4gs.Camera.from_dict({name: value for name, value in GOOD.items() if name != "fx"})
    for wrong in [(0, 0, 0), None, 4]:
        with pytest.raises(EXPECTED):
            light4gs.Camera.look_at((0, -4, 0), (0, 0, 0), (0, 0, 1), wrong, 40, 30)
    with pytest.raises(EXPECTED):
        light4gs.Camera.look_at((0, -4, math.nan), (0, 0, 0), (0, 0, 1), 0.7, 40, 30)


def test_wrong_backgrounds_are_refused(quickstart, camera):
    for wrong in [(1, 2), (math.nan, 0, 0), "red", 5, (1e300, 0, 0)]:
        with pytest.raises(EXPECTED):
            quickstart.render(camera, 0.5, background=wrong)


def test_threads_may_share_a_scene(quickstart, camera):
    """They also run at once: the interpreter's lock is released."""
    alone = quickstart.render(camera, 0.5)
    images = {}

    def draw(index):
        images[index] = quickstart.render(camera, 0.5)
        quickstart.gaussians(0.25)

    threads = [threading.Thread(target=draw, args=(index,)) for index in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(images) == 8 and all(np.array_equal(image, alone) for image in images.values())


def odd(chance: random.Random):
    """Some value that somebody might pass."""
    return chance.choice(
        [
            None, True, 0, 1, -1, 7, 40, 2**31, 2**32, 2**63, 2**64, 10**400, 0.0, -0.0, 0.5, 1.0, 1e-320, 1e38, 1e300,
            -1e300, math.nan, math.inf, -math.inf, 1j, "", "x", "inria", "0.5", b"", b"\x89L4GS\r\n\x1a", "\ud800", "a\0b",
            [], [1, 2, 3], [0.0] * 9, (0, 0, 1), [[1, 0, 0], [0, 1, 0], [0, 0, 1]], {}, {"width": 3}, {"gaussians": 1},
            np.eye(3), np.zeros(0), np.float32(0.25), np.int8(5), np.array("x"), np.array([None]), object(), int, len,
        ]
    )  # fmt: skip


def test_odd_arguments_are_exceptions(quickstart):
    """`LIGHT4GS_HOSTILE_CASES=100000` for a long run."""
    cases = int(os.environ.get("LIGHT4GS_HOSTILE_CASES", "3000"))
    seed = int(os.environ.get("LIGHT4GS_HOSTILE_SEED", "1"))
    chance = random.Random(seed)
    small = light4gs.from_bytes(STREAM)
    good = light4gs.Camera(**GOOD)
    returned = 0

    def value(usual):
        return usual if chance.random() < 0.5 else odd(chance)

    for _ in range(cases):
        damaged = bytearray(STREAM)
        for _ in range(chance.randrange(1, 4)):
            damaged[chance.randrange(len(damaged))] = chance.randrange(256)
        call = chance.choice(
            [
                lambda: small.gaussians(value(0.5)),
                lambda: small.gaussians(value(0.5), convention=value("inria")),
                lambda: small.render(value(good), value(0.5), background=value((0, 0, 0))),
                lambda: light4gs.Camera(**{name: value(usual) for name, usual in GOOD.items()}),
                lambda: small.render({**GOOD, chance.choice(list(GOOD)): odd(chance)}, 0.5),
                lambda: light4gs.Camera.look_at(*[value(x) for x in [(0, -4, 0), (0, 0, 0), (0, 0, 1), 0.7, 40, 30]]),
                lambda: light4gs.from_bytes(value(STREAM), limits=value(None)),
                lambda: light4gs.from_bytes(damaged),
                lambda: light4gs.from_bytes(STREAM, limits={value("gaussians"): odd(chance)}),
                lambda: light4gs.open(odd(chance)),
                lambda: light4gs.limits(odd(chance)),
            ]
        )
        try:
            call()
            returned += 1
        except (*EXPECTED, OSError):
            pass
    print(f"{cases} calls of seed {seed}: {returned} returned, the others were refused")
