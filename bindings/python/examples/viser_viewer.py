"""Plays a .l4gs file in the browser with viser (pip install viser).

    python viser_viewer.py scene.l4gs [--port 8080] [--host 127.0.0.1]

viser draws one color for each Gaussian, so the spherical harmonics beyond degree 0 are left out.
"""

import argparse
import time

import numpy as np
import viser

import light4gs

#: The constant function among the spherical harmonics.
SH_0 = 0.28209479


def splats(scene: light4gs.Scene, moment: float) -> dict:
    """Centers, covariances, colors and opacities at a time in [0, 1], as viser takes them."""
    gaussians = scene.gaussians(moment)
    w, x, y, z = gaussians.quats.T
    rotations = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    ).transpose(2, 0, 1)
    factors = rotations * gaussians.scales[:, None, :]
    return dict(
        centers=gaussians.means,
        covariances=factors @ factors.transpose(0, 2, 1),
        rgbs=np.clip(0.5 + SH_0 * gaussians.sh[:, 0], 0, 1),
        opacities=gaussians.opacities[:, None],
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("file")
    parser.add_argument("--host", default="127.0.0.1", help="0.0.0.0 for other machines")
    parser.add_argument("--port", type=int, default=8080)
    arguments = parser.parse_args()

    scene = light4gs.open(arguments.file)
    server = viser.ViserServer(host=arguments.host, port=arguments.port)
    server.scene.set_up_direction("+z")
    handle = server.scene.add_gaussian_splats("/scene", **splats(scene, 0.0))
    frames = max(scene.frame_count, 1)
    frame = server.gui.add_slider("frame", min=0, max=max(frames - 1, 1), step=1, initial_value=0)
    plays = server.gui.add_checkbox("play", initial_value=frames > 1)
    fps = scene.fps or 20.0

    shown = 0
    while True:
        begin = time.monotonic()
        if plays.value and frames > 1:
            frame.value = (frame.value + 1) % frames
        if frame.value != shown:
            shown = frame.value
            handle.set_gaussians(**splats(scene, min(shown / max(frames - 1, 1), 1.0)))
        time.sleep(max(0.0, 1 / fps - (time.monotonic() - begin)))


if __name__ == "__main__":
    main()
