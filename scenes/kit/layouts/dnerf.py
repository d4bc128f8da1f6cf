"""D-NeRF's layout: pictures each with its own camera and its own time, cameras, and masks of what moves."""

import json

from .. import cameras, masks, pictures

SIZE = (400, 400)
SPLITS = {"train": 100, "test": 20, "val": 10}
# Masks of motion are for measuring, and training views are not measured.
MASKED = ("test", "val")
# Another pattern of noise in each picture, and the same one each time.
SEEDS = {"train": 0, "test": 100003, "val": 200003}


def write(scene, folder, size, threads, only=None):
    """Renders all splits of a scene. `only`: instead of everything, one picture, such as `train:12`."""
    plan = {split: cameras.frames(split, count, scene.seed) for split, count in SPLITS.items()}
    for split in plan:
        (folder / split).mkdir(parents=True, exist_ok=True)
        described = json.dumps({"camera_angle_x": cameras.OPENING, "frames": plan[split]}, indent=1)
        (folder / f"transforms_{split}.json").write_text(described)
    camera = pictures.set_up(scene, cameras.Lens(*size, cameras.OPENING), threads)
    wanted = [_picture(split, index, frame, folder / split) for split, frames in plan.items() for index, frame in enumerate(frames)]
    pictures.render(scene, camera, pictures.chosen(wanted, only), size)
    if only is None:
        todo = [_picture(split, index, frame, folder / "mask" / split) for split in MASKED for index, frame in enumerate(plan[split])]
        masks.write(scene, camera, todo, size)


def _picture(split, index, frame, folder):
    return pictures.Picture(f"{split}:{index}", folder / f"r_{index:03d}.png", frame["time"], frame["transform_matrix"], index * 7 + SEEDS[split])
