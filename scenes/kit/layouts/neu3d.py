"""Neu3D's layout: a rig of cameras that stand, a video each; `cam00` is for testing, and has its pictures without loss too."""

import shutil

import numpy as np

from .. import cameras, pictures, points, video

# Of the published captures: pictures are a part of this width, and poses say it.
PUBLISHED_WIDTH = 2704
TESTING = 0
# Pictures of the other cameras are kept there until there are videos of them.
RENDERED = "rendered"


def write(scene, folder, size, frames, threads, only=None):
    """Renders the first `frames` moments of a capture. `only`: one picture, such as `cam03:12`."""
    if size[0] % 2 or size[1] % 2:
        raise pictures.Refused(f"--size {max(size)}: pictures would have {size[0]}×{size[1]} pixels, and a video needs even numbers")
    lens = cameras.Lens(*size, scene.opening)
    views = [view for view in scene.views() if view.frame < frames]
    count = 1 + max(view.camera for view in views)
    done = [camera for camera in range(count) if _is_there(folder, camera, size, frames)]
    wanted = [_picture(folder, view, count) for view in views if view.camera not in done or view.camera == TESTING]
    camera = pictures.set_up(scene, lens, threads, transparent=False)
    pictures.render(scene, camera, pictures.chosen(wanted, only), size)
    if only is not None:
        return
    cloud = folder / points.FILE
    if not cloud.exists():
        _write_points(scene, lens, [view for view in views if view.frame == 0], folder, cloud, count)
    for number in range(count):
        if number not in done:
            video.write(_images(folder, number) / "%04d.png", folder / f"cam{number:02d}.mp4")
            pictures.say(f"{folder}/cam{number:02d}.mp4")
    shutil.rmtree(folder / RENDERED, ignore_errors=True)


def _images(folder, camera):
    name = f"cam{camera:02d}"
    return folder / name / "images" if camera == TESTING else folder / RENDERED / name


def _picture(folder, view, count):
    path = _images(folder, view.camera) / f"{view.frame:04d}.png"
    return pictures.Picture(f"cam{view.camera:02d}:{view.frame}", path, view.time, view.matrix, (view.frame * count + view.camera) * 13 + 1)


def _is_there(folder, camera, size, frames):
    """Whether the video of a camera was made before, with this size and length."""
    path = folder / f"cam{camera:02d}.mp4"
    if not path.exists():
        return False
    found, length = video.measured(path)
    pictures.refuse_other_size(path, found, size)
    if length != frames:
        raise pictures.Refused(f"{path} has {length} frames, and {frames} are wanted: name another folder with --out, or remove this one")
    return True


def _write_points(scene, lens, first, folder, path, count):
    """The cloud at time 0 as the training cameras see it, and before it the poses, with depths of the cloud."""
    random = np.random.default_rng(5)
    scene.move(0.0)
    training = [(view, _picture(folder, view, count).path) for view in first if view.camera != TESTING]
    cloud = points.cloud(random, points.seen(points.sampled(random, scene.surroundings), scene, lens, training, (2, 2)))
    rows = []
    for view in first:
        pixels, depths = lens.seen(view.matrix, cloud.positions)
        inside = (depths > 0.05) & (pixels > 0).all(1) & (pixels < (lens.width, lens.height)).all(1)
        # LLFF's axes: down, right, backward.
        scale = PUBLISHED_WIDTH / lens.width
        right, up, backward, position = view.matrix[:3].T
        pose = np.stack([-up, right, backward, position, np.array([lens.height, lens.width, lens.focal]) * scale], 1)
        rows.append([*pose.ravel(), np.percentile(depths[inside], .1), np.percentile(depths[inside], 99.9)])
    np.save(folder / "poses_bounds.npy", np.array(rows, np.float64))
    points.write_ply(path, cloud)
