"""The input of gsplat's rasterizer from a .l4gs file.

    python gsplat_input.py scene.l4gs [TIME]

Without PyTorch, gsplat and CUDA it prints what the call would get.
"""

import importlib.util
import sys

import numpy as np

import light4gs


def rasterizer_input(scene: light4gs.Scene, camera: light4gs.Camera, time: float) -> dict:
    """The arguments of `gsplat.rasterization` for one camera, as NumPy arrays and numbers."""
    gaussians = scene.gaussians(time)
    view = np.eye(4, dtype=np.float32)
    view[:3, :3] = np.reshape(camera.rotation, (3, 3))
    view[:3, 3] = camera.translation
    intrinsics = np.array([[camera.fx, 0, camera.cx], [0, camera.fy, camera.cy], [0, 0, 1]], dtype=np.float32)
    return dict(
        means=gaussians.means,
        quats=gaussians.quats,
        scales=gaussians.scales,
        opacities=gaussians.opacities,
        colors=gaussians.sh,
        sh_degree=gaussians.sh_degree,
        viewmats=view[None],
        Ks=intrinsics[None],
        width=camera.width,
        height=camera.height,
        backgrounds=np.array([scene.background], dtype=np.float32),
        # As our own renderer has them; gsplat's own near plane is 0.01.
        near_plane=0.2,
        eps2d=0.3,
    )


def default_camera(scene: light4gs.Scene) -> light4gs.Camera:
    """A camera from which the middle of the scene's box is seen."""
    low, high = scene.bounds
    middle, size = (low + high) / 2, float(np.linalg.norm(high - low))
    eye = middle + np.float32([0, -1.2 * size, 0.4 * size])
    width, height = scene.width or 800, scene.height or 600
    return light4gs.Camera.look_at(eye, middle, (0, 0, 1), scene.fov_x or 0.9, width, height)


def main() -> None:
    scene = light4gs.open(sys.argv[1])
    time = float(sys.argv[2]) if len(sys.argv) > 2 else 0.5
    arguments = rasterizer_input(scene, default_camera(scene), time)
    for name, value in arguments.items():
        print(f"{name}: {value.dtype} {list(value.shape)}" if isinstance(value, np.ndarray) else f"{name}: {value}")
    missing = [name for name in ("torch", "gsplat") if importlib.util.find_spec(name) is None]
    if missing:
        print(f"not rendered: {' and '.join(missing)} not installed")
        return
    import gsplat
    import torch

    if not torch.cuda.is_available():
        print("not rendered: gsplat needs CUDA")
        return
    on_device = {
        name: torch.from_numpy(value).cuda() if isinstance(value, np.ndarray) else value
        for name, value in arguments.items()
    }
    image, alpha, _ = gsplat.rasterization(**on_device)
    print(f"image: {list(image.shape)}, alpha: {list(alpha.shape)}")


if __name__ == "__main__":
    main()
