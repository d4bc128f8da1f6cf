"""One stage of finding poses, by the package pycolmap. The first argument is JSON; see `python.rs`, which runs this.

Lines that begin with `light4gs` are results; the rest is the package's own log.
"""

import json
import sys

import pycolmap

SEED = 1


def features(job):
    reader = pycolmap.ImageReaderOptions()
    reader.camera_model = job["camera_model"]
    options = pycolmap.FeatureExtractionOptions()
    options.use_gpu = False
    options.max_image_size = job["size"]
    options.sift.max_num_features = job["features"]
    options.sift.first_octave = job["first_octave"]
    with open(job["list"], encoding="utf-8") as file:
        names = file.read().splitlines()
    mode = pycolmap.CameraMode.PER_FOLDER if job["rig"] else pycolmap.CameraMode.SINGLE
    pycolmap.extract_features(
        job["database"],
        job["images"],
        image_names=names,
        camera_mode=mode,
        reader_options=reader,
        extraction_options=options,
        device=pycolmap.Device.cpu,
    )


def matches(job):
    options = pycolmap.FeatureMatchingOptions()
    options.use_gpu = False
    pairs = pycolmap.ImportedPairingOptions()
    pairs.match_list_path = job["pairs"]
    pairs.block_size = 16
    geometry = pycolmap.TwoViewGeometryOptions()
    geometry.ransac.random_seed = SEED
    pycolmap.match_image_pairs(
        job["database"],
        matching_options=options,
        pairing_options=pairs,
        verification_options=geometry,
        device=pycolmap.Device.cpu,
    )
    turning(job["database"])


def turning(path):
    """Says how many pairs moved far in the image, and in how many of them a rotation or a plane explains it all."""
    database = pycolmap.Database.open(path)
    cameras = {camera.camera_id: camera for camera in database.read_all_cameras()}
    width = {image.image_id: cameras[image.camera_id].width for image in database.read_all_images()}
    points = {i: database.read_keypoints(i) for i in width}
    flat = (
        pycolmap.TwoViewGeometryConfiguration.PLANAR,
        pycolmap.TwoViewGeometryConfiguration.PANORAMIC,
        pycolmap.TwoViewGeometryConfiguration.PLANAR_OR_PANORAMIC,
    )
    moved = explained = 0
    for pair, geometry in zip(*database.read_two_view_geometries()):
        a, b = pycolmap.pair_id_to_image_pair(pair) if isinstance(pair, int) else pair
        inliers = geometry.inlier_matches
        if len(inliers) < 30:
            continue
        shift = points[a][inliers[:, 0], :2] - points[b][inliers[:, 1], :2]
        lengths = sorted((shift**2).sum(axis=1) ** 0.5)
        if lengths[len(lengths) // 2] < 0.1 * width[a]:
            continue
        moved += 1
        explained += geometry.config in flat
    print("light4gs turning", explained, moved, flush=True)


def poses(job):
    if job["global"]:
        pycolmap.calibrate_view_graph(job["database"])
        options = pycolmap.GlobalPipelineOptions()
        options.random_seed = SEED
        options.mapper.bundle_adjustment.ceres.solver_options.max_num_iterations = 50
        pycolmap.global_mapping(job["database"], job["images"], job["sparse"], options)
    else:
        options = pycolmap.IncrementalPipelineOptions()
        options.random_seed = SEED
        options.max_runtime_seconds = job["seconds"]
        # All poses are refined together after each 30 % more images, and twice at most: two thirds of the time, and no
        # worse poses.
        options.ba_global_frames_ratio = options.ba_global_points_ratio = 1.3
        options.ba_global_max_refinements = 2
        pycolmap.incremental_mapping(job["database"], job["images"], job["sparse"], options)


if __name__ == "__main__":
    job = json.loads(sys.argv[1])
    {"features": features, "matches": matches, "poses": poses}[job["stage"]](job)
