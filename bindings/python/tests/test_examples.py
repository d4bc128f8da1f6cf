"""The examples run."""

import importlib.util
import socket
import subprocess
import sys
import time
import urllib.request
from pathlib import Path

import numpy as np
import pytest
from conftest import PLAYER

EXAMPLES = Path(__file__).resolve().parents[1] / "examples"
FILE = PLAYER / "quickstart.l4gs"


def load(name: str):
    spec = importlib.util.spec_from_file_location(name, EXAMPLES / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_input_of_gsplat():
    printed = subprocess.run(
        [sys.executable, EXAMPLES / "gsplat_input.py", FILE, "0.25"], check=True, capture_output=True, text=True
    ).stdout
    assert "means: float32 [6415, 3]" in printed and "colors: float32 [6415, 16, 3]" in printed
    assert "viewmats: float32 [1, 4, 4]" in printed and "Ks: float32 [1, 3, 3]" in printed


def test_the_camera_of_gsplat_sees_the_scene(quickstart):
    module = load("gsplat_input")
    camera = module.default_camera(quickstart)
    arguments = module.rasterizer_input(quickstart, camera, 0.5)
    points = arguments["means"] @ arguments["viewmats"][0, :3, :3].T + arguments["viewmats"][0, :3, 3]
    assert (points[:, 2] > 0).all()
    pixels = points @ arguments["Ks"][0].T
    inside = pixels[:, 0] / pixels[:, 2]
    assert np.mean((inside > 0) & (inside < camera.width)) > 0.9


def test_the_viewer_serves(quickstart):
    viser = pytest.importorskip("viser")
    assert viser
    arrays = load("viser_viewer").splats(quickstart, 0.5)
    assert arrays["covariances"].shape == (6415, 3, 3)
    assert (np.linalg.eigvalsh(arrays["covariances"].astype(np.float64)) > -1e-9).all()
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    viewer = subprocess.Popen([sys.executable, EXAMPLES / "viser_viewer.py", FILE, "--port", str(port)])
    try:
        for _ in range(120):
            assert viewer.poll() is None, "the viewer ended"
            try:
                with urllib.request.urlopen(f"http://127.0.0.1:{port}/", timeout=5) as page:
                    assert page.status == 200 and b"<html" in page.read().lower()
                break
            except OSError:
                time.sleep(0.5)
        else:
            pytest.fail("the viewer does not serve")
        # It plays: a second of frames, and it is still there.
        time.sleep(1)
        assert viewer.poll() is None
    finally:
        viewer.kill()
        viewer.wait()
