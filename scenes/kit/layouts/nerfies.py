"""The layout of nerfies and HyperNeRF, with one camera that moves, and that of NeRF-DS, with two and masks of motion."""

import json

import numpy as np

from .. import cameras, masks, pictures, points

# Pictures have half of the size that the cameras' files say.
SHRINK = 2
SIDES = ("left", "right")
# The testing views of one camera: the third of every four.
EVERY, THIRD = 4, 2


def write(scene, folder, size, frames, threads, only=None):
    """Renders the first `frames` moments of a capture. `only`: one picture, by the name of its file."""
    pair = scene.layout == "nerfds"
    lens = cameras.Lens(size[0] * SHRINK, size[1] * SHRINK, scene.opening)
    views = {_name(view, pair): view for view in scene.views() if view.frame < frames}
    cloud = folder / points.FILE
    wanted = [_picture(name, view, folder / "rgb" / f"{SHRINK}x" / f"{name}.png", number) for number, (name, view) in enumerate(views.items())]
    # Refuses another size before a file is written.
    pictures.missing(wanted, size)
    if _write_cameras(folder, views, lens, pair):
        # Of another number of moments.
        cloud.unlink(missing_ok=True)
    camera = pictures.set_up(scene, lens, threads, transparent=False)
    pictures.render(scene, camera, pictures.chosen(wanted, only), size, SHRINK)
    if only is not None:
        return
    if not cloud.exists():
        _write_points(scene, lens, [(view, picture.path) for view, picture in zip(views.values(), wanted)], folder, cloud, pair)
    if pair:
        # A mask's name is that of its picture, and an ending.
        todo = [_picture(name, view, folder / "mask" / f"{SHRINK}x" / f"{name}.png.png", 0) for name, view in views.items()]
        masks.write(scene, camera, todo, size, moving=0)


def _name(view, pair):
    """HyperNeRF counts from 1, and NeRF-DS from 0."""
    return f"{view.frame:06d}_{SIDES[view.camera]}" if pair else f"{view.frame + 1:06d}"


def _is_testing(view, pair):
    return view.camera == 1 if pair else view.frame % EVERY == THIRD


def _picture(name, view, path, number):
    return pictures.Picture(name, path, view.time, view.matrix, number * 13 + 1)


def _write_cameras(folder, views, lens, pair):
    """`camera/NAME.json`, and which picture was taken when and is for what. Gives whether there were other pictures."""
    (folder / "camera").mkdir(parents=True, exist_ok=True)
    for name, view in views.items():
        # World to camera, axes of OpenCV: right, down, forward.
        orientation = (view.matrix[:3, :3] @ np.diag([1, -1, -1])).T
        _write_json(folder / "camera" / f"{name}.json", {
            "orientation": orientation.tolist(), "position": view.matrix[:3, 3].tolist(), "focal_length": lens.focal,
            "principal_point": [lens.width / 2, lens.height / 2], "skew": 0.0, "pixel_aspect_ratio": 1.0,
            "radial_distortion": [0.0, 0.0, 0.0], "tangential_distortion": [0.0, 0.0], "image_size": [lens.width, lens.height],
        })
    _write_json(folder / "metadata.json", {
        name: {"warp_id": view.frame, "appearance_id": view.frame, "camera_id": view.camera, "time_id": view.frame}
        for name, view in views.items()
    })
    testing = [name for name, view in views.items() if _is_testing(view, pair)]
    training = [name for name in views if name not in testing]
    path = folder / "dataset.json"
    before = path.read_text() if path.exists() else None
    _write_json(path, {
        "count": len(views), "num_exemplars": len(training), "ids": list(views), "train_ids": training, "val_ids": testing,
    })
    return before not in (None, path.read_text())


def _write_points(scene, lens, taken, folder, path, pair):
    """The cloud at time 0 as some of the training views see it, points that stand, and the extent of both and of the cameras."""
    random = np.random.default_rng(5)
    scene.move(0.0)
    training = [(view, picture) for view, picture in taken if not _is_testing(view, pair)][::3 if pair else 4]
    found = points.seen(points.sampled(random, scene.surroundings), scene, lens, training, (min(2, len(training)), 1))
    cloud = points.cloud(random, found)
    still = found.positions[~found.moving]
    still = still[random.choice(len(still), min(len(still), 4000), replace=False)]
    np.save(folder / "points.npy", (still + random.normal(0, points.OFF, still.shape)).astype(np.float32))
    extent = np.concatenate([still, [view.matrix[:3, 3] for view, _ in taken]])
    center = (np.percentile(extent, 0.5, 0) + np.percentile(extent, 99.5, 0)) / 2
    scale = 1 / np.linalg.norm(extent - center, axis=1).max()
    depths = np.concatenate([lens.seen(view.matrix, still)[1] for view, _ in taken[::5]])
    near, far = np.percentile(depths[depths > 0.05], (.1, 99.9)) * (0.8, 1.2) * scale
    box = [((still.min(0) - center) * scale).tolist(), ((still.max(0) - center) * scale).tolist()]
    _write_json(folder / "scene.json", {"scale": float(scale), "center": center.tolist(), "near": float(near), "far": float(far), "bbox": box})
    points.write_ply(path, cloud)


def _write_json(path, value):
    path.write_text(json.dumps(value, indent=1))
