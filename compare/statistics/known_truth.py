"""A session whose truth is known, judged: lights, balls, pose, normals.

The truth lies beside the session as `truth.json` and `truth.npz`; no step reads it but this one.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scene.camera import Camera
from scene.mesh import Mesh
from scene.normals import angular_error_deg
from scene.pose import Pose
from scene.reading import json_of, numbers, reading
from scene.store import Store

BARS = {"direction_median_deg": 1.0, "intensity_rms_percent": 3.0, "registration_rms_px": 1.0, "truth_median_deg": 1.0}
"""What a session with two chrome balls, a white one and a laser scan must reach."""

Truth = dict[str, NDArray]
"""The files' values by their names; `balls` (K, 3): centre and radius, pixels, of each kind that is in `kinds` (K,)."""
SHAPES = {
    "object_centre_mm": (3,),
    "directions_at_object": (-1, 3),
    "relative_intensity_rgb_at_object": (-1, 3),
    "camera_from_scan": (4, 4),
}


def read_truth(folder: Path) -> Truth:
    """Return what truth.json and truth.npz of the folder hold; SceneError where one is damaged."""
    fault, path = "does not hold a session's truth", folder / "truth.npz"
    values = json_of(folder / "truth.json")
    with reading(folder / "truth.json", fault):
        truth: Truth = {name: numbers(values[name], *shape) for name, shape in SHAPES.items()}
        balls = [[*ball["centre_px"], ball["radius_px"]] for ball in values["spheres"]]
        truth["balls"] = numbers(balls, -1, 3) if balls else np.empty((0, 3))
        truth["kinds"] = np.array([str(ball["kind"]) for ball in values["spheres"]])
    # numpy leaves a damaged file open that it opened itself.
    with reading(path, fault), path.open("rb") as file, np.load(file) as arrays:
        truth |= {name: arrays[name] for name in ("light_positions_mm", "mask")}
        truth["normals"] = np.where(truth["mask"][..., None], arrays["normals"].astype(np.float64), np.nan)
    return truth


def known_truth(
    store: Store, truth_folder: Path, *, methods: Sequence[str], mesh: Mesh | None
) -> dict[str, dict[str, Any]]:
    """Compare a session's results with its known truth.

    Parameters
    ----------
    store : Store
        The output folder, after `align` and `solve`.
    truth_folder : Path
        Holds truth.json and truth.npz.
    methods : sequence of str
        Whose normals to judge.
    mesh : Mesh or None
        The scan, for the reprojection error of the pose.

    Returns
    -------
    dict
        One row a figure: {"value", "unit", "text"}, and "bar" where a value is asked for.

    Raises
    ------
    SceneError
        The truth cannot be read.
    """
    truth = read_truth(truth_folder)
    center, positions = truth["object_centre_mm"], truth["light_positions_mm"]
    true_pose = Pose(truth["camera_from_scan"])
    rows: dict[str, dict[str, Any]] = {}

    def row(key: str, value: float, unit: str, text: str) -> None:
        rows[key] = {"value": float(value), "unit": unit, "text": text} | ({"bar": BARS[key]} if key in BARS else {})

    lights = store.load_lights().seen_from(center)
    direction = angular_error_deg(lights.directions, truth["directions_at_object"])
    row("direction_median_deg", np.median(direction), "degrees", "light direction at the object, median")
    row("direction_max_deg", direction.max(), "degrees", "light direction at the object, worst")
    if lights.positions_mm is not None:
        error = np.linalg.norm(lights.positions_mm - positions, axis=1) / np.linalg.norm(positions - center, axis=1)
        row("position_median_percent", 100 * np.median(error), "%", "light position, median, of its distance")
    expected = truth["relative_intensity_rgb_at_object"]
    relative = lights.intensities / (expected / expected.mean(0)) - 1
    row("intensity_rms_percent", 100 * np.sqrt(np.mean(relative**2)), "%", "light intensity per channel, rms")
    row("intensity_max_percent", 100 * np.abs(relative).max(), "%", "light intensity per channel, worst")
    row("sphere_max_px", _sphere_error(store, truth), "px", "balls' centres and radii, worst")
    if mesh is not None and store.path("pose.json").exists():
        pose = store.load_pose()
        off_px = reprojection_px(mesh, store.load_camera(), pose, true_pose)
        row("registration_rms_px", off_px, "px", "registration, rms over the scan")
        row("registration_deg", (pose @ true_pose.inverse()).angle_deg(), "degrees", "registration, rotation")
        error = angular_error_deg(store.load_normals("truth"), truth["normals"])
        row("truth_median_deg", np.nanmedian(error), "degrees", "ground-truth normals, median")
        mask = store.load_mask()
        overlap = np.count_nonzero(mask & truth["mask"]) / np.count_nonzero(mask | truth["mask"])
        row("mask_overlap", overlap, "", "mask, intersection over union")
    for method in methods:
        error = angular_error_deg(store.load_normals(method), truth["normals"])
        text = f"`{method}` against the true normals, median"
        row(f"{method}_median_deg", np.nanmedian(error), "degrees", text)
    return rows


def _sphere_error(store: Store, truth: Truth) -> float:
    """Return the largest error in pixels of centre or radius; infinite where a ball is missing or too many."""
    found, worst = store.load_spheres(), 0.0
    kinds = {sphere.kind for sphere in found}
    if len(found) != len(truth["kinds"]) or not kinds >= set(truth["kinds"].tolist()):
        return float("inf")
    for kind, (u, v, radius_px) in zip(truth["kinds"], truth["balls"], strict=True):
        same = [sphere for sphere in found if sphere.kind == kind]
        off, nearest = min(((np.linalg.norm(s.center_px - [u, v]), s) for s in same), key=lambda pair: pair[0])
        worst = max(worst, float(off), abs(nearest.radius_px - radius_px))
    return worst


def reprojection_px(mesh: Mesh, camera: Camera, pose: Pose, true: Pose) -> float:
    """Return the rms distance in pixels between the scan's vertices projected under both poses."""
    facing = np.sum(true.rotate(mesh.vertex_normals) * true.apply(mesh.vertices), -1) < 0
    points = mesh.vertices[facing]
    difference = camera.project(pose.apply(points)) - camera.project(true.apply(points))
    return float(np.sqrt(np.mean(np.sum(difference**2, -1))))
