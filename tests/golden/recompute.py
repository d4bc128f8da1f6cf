#!/usr/bin/env python3
"""Computes golden vectors again from their inputs, in float64, from the formulas alone: see tests/README.md.

usage: recompute.py [--set FOLDER] [--write FOLDER]

Compares with what is stored, and fails where an output is further away than float32 explains. `--write` writes the files with
the recomputed outputs in place of the stored ones.
"""

import argparse
import json
import math
import pathlib
import struct
import sys

import numpy as np

TYPES = {"F32": "<f4", "I32": "<i4", "U8": "u1"}


def load(path):
    """Tensors of a safetensors file by name, and its header."""
    data = path.read_bytes()
    (length,) = struct.unpack("<Q", data[:8])
    header = json.loads(data[8 : 8 + length])
    body = data[8 + length :]
    tensors = {}
    for name, entry in header.items():
        if name == "__metadata__":
            continue
        begin, end = entry["data_offsets"]
        tensors[name] = np.frombuffer(body[begin:end], TYPES[entry["dtype"]]).reshape(entry["shape"])
    return tensors


def save(path, tensors):
    header, body = {}, b""
    for name, value in tensors.items():
        data = np.ascontiguousarray(value).tobytes()
        kind = next(kind for kind, dtype in TYPES.items() if np.dtype(dtype) == value.dtype)
        header[name] = {"dtype": kind, "shape": list(value.shape), "data_offsets": [len(body), len(body) + len(data)]}
        body += data
    text = json.dumps(header).encode()
    text += b" " * (-len(text) % 8)
    path.write_bytes(struct.pack("<Q", len(text)) + text + body)


def gradient(function, at, step=1e-6):
    """Central differences of a sum over rows whose terms depend on their own row alone: [N, K] -> [N, K]."""
    columns = []
    for k in range(at.shape[1]):
        delta = np.zeros(at.shape[1])
        delta[k] = step
        columns.append((function(at + delta) - function(at - delta)) / (2 * step))
    return np.stack(columns, 1)


# --- c01: contraction, PCA ---------------------------------------------------------------------------------------------


def contract(x):
    norm = np.linalg.norm(x, axis=1, keepdims=True)
    return np.where(norm <= 1, x, (2 - 1 / np.maximum(norm, 1)) * x / np.maximum(norm, 1))


def contract_pca(t):
    out = {"contract.out": contract(t["contract.x"]), "contract.loss": (contract(t["contract.x"]) * t["contract.w"]).sum()}
    # Of points 1e4 away the differences have no digits left; the formula's own derivative: J = a I + b x xᵀ.
    norm = np.linalg.norm(t["contract.x"], axis=1, keepdims=True)
    far = np.maximum(norm, 1)
    along = (t["contract.x"] * t["contract.w"]).sum(1, keepdims=True)
    outside = (2 - 1 / far) / far * t["contract.w"] + (2 / far**4 - 2 / far**3) * along * t["contract.x"]
    out["contract.grad_x"] = np.where(norm <= 1, t["contract.w"], outside)
    points = t["pca.points"]
    mean = points.mean(0)
    covariance = np.cov(points.T)
    values, vectors = np.linalg.eigh(covariance)
    values, vectors = values[::-1], vectors[:, ::-1]
    vectors = vectors * np.sign(vectors[np.abs(vectors).argmax(0), range(3)])
    projected = (points - mean) @ vectors
    out |= {"pca.mean": mean, "pca.cov": covariance, "pca.eigvals_desc": values, "pca.eigvecs_cols": vectors}
    out |= {"pca.std": np.sqrt(values), "pca.projected": projected, "pca.standardised": projected / np.sqrt(values)}

    def paper(p):
        return contract(((p - t["pca.mean"]) @ t["pca.eigvecs_cols"]) / t["pca.std"])

    out |= {"paper.out": paper(points), "paper.out_half": paper(points) / 2, "paper.loss": (paper(points) * t["paper.w"]).sum()}
    out["paper.grad_points"] = gradient(lambda p: (paper(p) * t["paper.w"]).sum(1), points)
    low, high = t["ref.aabb_min"], t["ref.aabb_max"]
    standardised = ((points - t["pca.mean"]) @ t["pca.eigvecs_cols"]) / t["pca.std"]
    out["ref.out01"] = contract((standardised - low) / (high - low) * 2 - 1) / 4 + 0.5
    out["ref.query4"] = np.concatenate([out["ref.out01"], 2 * t["ref.t"] - 1], 1)
    return out


# --- c02: hexplane -----------------------------------------------------------------------------------------------------

PAIRS = [(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)]


def sample(plane, first, second, upstream=None):
    """Bilinear samples [N, C] of a plane [C, H, W]; with `upstream` [N, C] also the gradient of the plane."""
    _, height, width = plane.shape
    x = (np.clip(first, -1, 1) + 1) / 2 * (width - 1)
    y = (np.clip(second, -1, 1) + 1) / 2 * (height - 1)
    x0 = np.minimum(np.floor(x).astype(int), width - 2)
    y0 = np.minimum(np.floor(y).astype(int), height - 2)
    corners = [(y0 + j, x0 + i, (y - y0 if j else 1 - y + y0) * (x - x0 if i else 1 - x + x0)) for j in (0, 1) for i in (0, 1)]
    if upstream is None:
        return sum(plane[:, row, column] * weight for row, column, weight in corners).T
    back = np.zeros_like(plane)
    for row, column, weight in corners:
        for c in range(plane.shape[0]):
            np.add.at(back[c], (row, column), upstream[:, c] * weight)
    return back


def query(t, points):
    scales = range(len(t["multires"]))
    samples = [[sample(t[f"scale{s}.plane{k}"][0], points[:, a], points[:, b]) for k, (a, b) in enumerate(PAIRS)] for s in scales]
    return np.concatenate([np.prod(scale, 0) for scale in samples], 1), samples


def plane_gradients(t, points, w):
    out = {}
    _, samples = query(t, points)
    channels = w.shape[1] // len(samples)
    for s, scale in enumerate(samples):
        upstream = w[:, s * channels : (s + 1) * channels]
        for k, (a, b) in enumerate(PAIRS):
            others = np.prod([values for other, values in enumerate(scale) if other != k], 0)
            plane = t[f"scale{s}.plane{k}"][0]
            out[f"scale{s}.plane{k}"] = sample(plane, points[:, a], points[:, b], upstream * others)[None]
    return out


def hexplane(t):
    points, w = t["direct.pts"], t["direct.w"]
    value, _ = query(t, points)
    out = {"direct.out": value, "direct.loss": (value * w).sum(), "edge.out": query(t, t["edge.pts"])[0]}
    inside = np.abs(points) <= 1
    out["direct.grad_pts"] = gradient(lambda p: (query(t, p)[0] * w).sum(1), points, 1e-7) * inside
    out |= {f"direct.grad.{name}": value for name, value in plane_gradients(t, points, w).items()}
    time = 2 * t["ref.t"] - 1

    def standardised(xyz):
        return ((xyz - t["ref.mean"]) @ t["ref.rotation"]) / t["ref.std"]

    def reference(xyz):
        low, high = t["ref.aabb_min"], t["ref.aabb_max"]
        return np.concatenate([contract((standardised(xyz) - low) / (high - low) * 2 - 1) / 4 + 0.5, time], 1)

    def paper(xyz):
        return np.concatenate([contract(standardised(xyz)) / 2, time], 1)

    w, xyz = t["ref.w"], t["ref.xyz"]
    for name, place in [("ref", reference), ("paper", paper)]:
        value, _ = query(t, place(xyz))
        out |= {f"{name}.out": value, f"{name}.loss": (value * w).sum()}
    out |= {f"ref.grad.{name}": value for name, value in plane_gradients(t, reference(xyz), w).items()}
    return out


# --- c05: Gaussian conditional -----------------------------------------------------------------------------------------

phi = np.vectorize(lambda x: 0.5 * math.erfc(-x / math.sqrt(2)))


def likelihood(values, means, scales):
    distance, scale = np.abs(values - means), np.maximum(scales, 0.11)
    return np.maximum(phi((0.5 - distance) / scale) - phi((-0.5 - distance) / scale), 1e-9)


def gaussian_conditional(t):
    y, means, scales = t["in.y"], t["in.means"], t["in.scales"]
    rounded = np.round(y - means) + means
    out = {"eval.out": rounded, "eval.likelihood": likelihood(rounded, means, scales)}
    out["eval.bits"] = -np.log2(out["eval.likelihood"]).sum()
    noisy = y + t["noise.noise"]
    out["noise.likelihood"] = likelihood(noisy, means, scales)
    out["noise.likelihood_no_means"] = likelihood(noisy, np.zeros_like(means), scales)
    out["noise.loss"] = (out["noise.likelihood"] * t["noise.w"]).sum()
    out["bits.total"] = -np.log2(out["noise.likelihood"]).sum()
    table = t["scale_table"]
    # The first entry of the table is the bound itself: compared in float32, as both are stored.
    out["indexes"] = (np.maximum(scales, np.float32(0.11))[..., None] > table[:-1]).sum(-1)
    out["code.symbols"] = np.round(y - means)
    out["code.decoded"] = rounded
    return out


# --- c07: spherical harmonics ------------------------------------------------------------------------------------------


def basis(d):
    x, y, z = d.T
    xx, yy, zz = x * x, y * y, z * z
    return np.stack(
        [
            np.full_like(x, 0.28209479177387814),
            -0.4886025119029199 * y,
            0.4886025119029199 * z,
            -0.4886025119029199 * x,
            1.0925484305920792 * x * y,
            -1.0925484305920792 * y * z,
            0.31539156525252005 * (2 * zz - xx - yy),
            -1.0925484305920792 * x * z,
            0.5462742152960396 * (xx - yy),
            -0.5900435899266435 * y * (3 * xx - yy),
            2.890611442640554 * x * y * z,
            -0.4570457994644658 * y * (4 * zz - xx - yy),
            0.3731763325901154 * z * (2 * zz - 3 * xx - 3 * yy),
            -0.4570457994644658 * x * (4 * zz - xx - yy),
            1.445305721320277 * z * (xx - yy),
            -0.5900435899266435 * x * (xx - 3 * yy),
        ],
        1,
    )


def harmonics(t):
    def directions(means):
        away = means - t["campos"]
        return away / np.linalg.norm(away, axis=1, keepdims=True)

    out = {"dirs": directions(t["means"])}
    for degree in range(4):
        count, w = (degree + 1) ** 2, t[f"deg{degree}.w"]

        def raw(dirs):
            return (basis(dirs)[:, :count, None] * t["sh"][:, :count]).sum(1) + 0.5

        def loss(dirs):
            return (np.maximum(raw(dirs), 0) * w).sum(1)

        clamped = raw(out["dirs"]) < 0
        gradient_sh = np.zeros_like(t["sh"])
        gradient_sh[:, :count] = basis(out["dirs"])[:, :count, None] * (w * ~clamped)[:, None]
        out |= {f"deg{degree}.{name}": value for name, value in {
            "color": np.maximum(raw(out["dirs"]), 0),
            "clamped": clamped,
            "loss": loss(out["dirs"]).sum(),
            "grad_sh": gradient_sh,
            "grad_dirs": gradient(loss, out["dirs"]),
            "grad_means": gradient(lambda means: loss(directions(means)), t["means"]),
        }.items()}
    return out


# --- c09: losses and regularizers --------------------------------------------------------------------------------------


def ssim(a, b, window):
    """Mean over pixels and channels, zeros around the image: [B, 3, H, W] -> [B]."""

    def blurred(image):
        padded = np.pad(image, ((0, 0), (0, 0), (5, 5), (5, 5)))
        return np.einsum("bchwij,ij->bchw", np.lib.stride_tricks.sliding_window_view(padded, (11, 11), (2, 3)), window)

    mean_a, mean_b = blurred(a), blurred(b)
    var_a, var_b, both = blurred(a * a) - mean_a**2, blurred(b * b) - mean_b**2, blurred(a * b) - mean_a * mean_b
    c1, c2 = 0.01**2, 0.03**2
    value = (2 * mean_a * mean_b + c1) * (2 * both + c2) / ((mean_a**2 + mean_b**2 + c1) * (var_a + var_b + c2))
    return value.mean((1, 2, 3))


def losses(t):
    image, truth = t["img"], t["gt"]
    difference = image - truth
    line = np.exp(-((np.arange(11) - 5) ** 2) / (2 * 1.5**2))
    window = np.outer(line / line.sum(), line / line.sum())
    # The reference makes its window in float32.
    per_image = ssim(image, truth, t["window11"])
    out = {"window11": window, "ssim.per_image": per_image, "ssim.value": per_image.mean()}
    out["ssim.dssim_from_ssim"] = (1 - per_image.mean()) / 2
    out |= {"l1.value": np.abs(difference).mean(), "l1.grad": np.sign(difference) / difference.size}
    out |= {"l2.value": (difference**2).mean(), "l2.grad": 2 * difference / difference.size}
    out["psnr.per_image"] = -10 * np.log10((difference**2).mean((1, 2, 3)))
    out["psnr.per_channel"] = -10 * np.log10((difference**2).mean((2, 3)))
    out["psnr.train_report_style"] = out["psnr.per_channel"].mean(1)
    planes = [[t[f"reg.plane.scale{s}.{k}"] for k in range(6)] for s in range(2)]

    def smoothness(which):
        return sum((np.diff(scale[k], 2, axis=2) ** 2).mean() for scale in planes for k in which)

    out["reg.plane_smooth.value"], out["reg.time_smooth.value"] = smoothness((0, 1, 3)), smoothness((2, 4, 5))
    out["reg.l1_time.value"] = sum(np.abs(1 - scale[k]).mean() for scale in planes for k in (2, 4, 5))
    time, l1, plane = t["reg.compute_regulation.weights_time_l1_plane"]
    terms = (plane * out["reg.plane_smooth.value"], time * out["reg.time_smooth.value"], l1 * out["reg.l1_time.value"])
    out["reg.compute_regulation.value"] = sum(terms)
    return out


# --- c10: Adam, learning rates -----------------------------------------------------------------------------------------


class Adam:
    def __init__(self, value):
        self.value, self.first, self.second, self.steps = value, np.zeros_like(value), np.zeros_like(value), 0

    def step(self, grad, rate):
        self.steps += 1
        self.first = 0.9 * self.first + 0.1 * grad
        self.second = 0.999 * self.second + 0.001 * grad**2
        first, second = self.first / (1 - 0.9**self.steps), self.second / (1 - 0.999**self.steps)
        self.value = self.value - rate * first / (np.sqrt(second) + 1e-15)


def schedule(step, init, final, delay_steps, delay, most):
    if step < 0 or (init == 0 and final == 0):
        return 0.0
    late = delay + (1 - delay) * np.sin(0.5 * np.pi * np.clip(step / delay_steps, 0, 1)) if delay_steps > 0 else 1.0
    along = np.clip(step / most, 0, 1)
    return late * np.exp(np.log(init) * (1 - along) + np.log(final) * along)


def adam(t):
    out = {}
    groups = {name[5:]: Adam(value) for name, value in t.items() if name.startswith("init.")}
    step = 1
    while f"step{step}.lr_xyz" in t:
        for name, group in groups.items():
            if f"step{step}.grad.{name}" in t:
                group.step(t[f"step{step}.grad.{name}"], t[f"step{step}.lr_xyz"] if name == "xyz" else t[f"lr.{name}"])
            out[f"step{step}.param.{name}"] = group.value
        step += 1
    for name, group in groups.items():
        out |= {f"final.exp_avg.{name}": group.first, f"final.exp_avg_sq.{name}": group.second, f"final.step.{name}": group.steps}
    table = t["lr_table.configs_init_final_delaysteps_delaymult_max"]
    out["lr_table.lr"] = np.array([[schedule(step, *row) for step in t["lr_table.steps"]] for row in table])
    return out


# --- c11: densification ------------------------------------------------------------------------------------------------


def densify(t):
    with np.errstate(invalid="ignore", divide="ignore"):
        average = np.nan_to_num(t["in.grad_accum"] / t["in.denom"], nan=0.0)
    large = np.exp(t["in.scaling_log"]).max(1) > t["in.percent_dense"] * t["in.extent"]
    moved = average[:, 0] >= t["in.grad_threshold"]
    clone, split = moved & ~large, moved & large
    rows = np.arange(len(average))
    source = np.concatenate([rows[~split], rows[clone], rows[split], rows[split]])
    out = {"avg_grad": average, "clone_mask": clone, "split_mask": split, "after_densify.source_index": source}
    for name, key in [("f_dc", "f_dc"), ("f_rest", "f_rest"), ("opacity_logit", "opacity_logit"), ("rotation", "rotation")]:
        out[f"after_densify.{name}"] = t[f"in.{key}"][source]
    points = t["init.points"]
    apart = ((points[:, None] - points[None]) ** 2).sum(-1)
    nearest = np.sort(apart + np.diag(np.full(len(points), np.inf)), 1)[:, :3].mean(1)
    out["init.mean_dist2"] = nearest
    out["init.scaling_log"] = np.repeat(np.log(np.sqrt(np.maximum(nearest, 1e-7)))[:, None], 3, 1)
    out["init.opacity_logit"] = math.log(0.1 / 0.9)
    for percent in ("05", "40", "60"):
        scores = t["sigprune.score"]
        out[f"sigprune.mask_{percent}"] = scores <= np.sort(scores)[int(int(percent) / 100 * (len(scores) - 1))]
    opacity = 1 / (1 + np.exp(-out["after_densify.opacity_logit"]))
    kept = np.minimum(opacity, 0.01)
    out["reset_opacity.logit"] = np.log(kept / (1 - kept))
    return out


CASES = {
    "c01_contract_pca": contract_pca,
    "c02_hexplane": hexplane,
    "c05_gaussian_conditional": gaussian_conditional,
    "c07_sh": harmonics,
    "c09_losses": losses,
    "c10_adam_lr": adam,
    "c11_densify": densify,
}


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--set", type=pathlib.Path, default=pathlib.Path(__file__).parent)
    parser.add_argument("--write", type=pathlib.Path)
    arguments = parser.parse_args()
    wrong = 0
    for case, function in CASES.items():
        for path in sorted(arguments.set.glob(f"{case}_?.safetensors")):
            stored = load(path)
            inputs = {name: value.astype(float) if value.dtype.kind == "f" else value for name, value in stored.items()}
            found = {name: np.asarray(value) for name, value in function(inputs).items()}
            worst, where = 0.0, "-"
            for name, value in found.items():
                expected = inputs[name]
                assert value.shape == expected.shape, f"{name}: {value.shape}, not {expected.shape}"
                largest = max(np.abs(expected).max(), 1e-12)
                off = np.abs(value.astype(float) - expected).max() / largest
                if off > worst:
                    worst, where = off, name
            verdict = "ok" if worst < 2e-6 else "WRONG"
            wrong += verdict != "ok"
            print(f"{path.name}: {len(found)} of {len(stored)} tensors, worst {worst:.1e} of the largest entry ({where}): {verdict}")
            if arguments.write:
                arguments.write.mkdir(parents=True, exist_ok=True)
                fresh = {name: found[name].astype(value.dtype) if name in found else value for name, value in stored.items()}
                save(arguments.write / path.name, fresh)
    sys.exit(1 if wrong else 0)


if __name__ == "__main__":
    main()
