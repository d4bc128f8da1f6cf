"""Files that several tests read."""

from pathlib import Path

import pytest

import light4gs

ROOT = Path(__file__).resolve().parents[3]
GOLDEN = ROOT / "tests" / "golden-streams"
PLAYER = ROOT / "bindings" / "web" / "tests" / "data"


@pytest.fixture(scope="session")
def quickstart() -> light4gs.Scene:
    """The trained scene of the player's tests."""
    return light4gs.open(PLAYER / "quickstart.l4gs")


@pytest.fixture
def camera() -> light4gs.Camera:
    return light4gs.Camera.look_at((0, -4, 1), (0, 0, 0), (0, 0, 1), 0.7, 40, 30)
