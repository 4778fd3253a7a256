"""A session whose truth is known, judged: lights, balls, pose, normals.

The truth lies beside the session as `truth.json` and `truth.npz`; no step reads it but this one.
"""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scene.camera import Camera
from scene.mesh import Mesh
from scene.normals import angular_error_deg
from scene.pose import Pose
from scene.store import Store

BARS = {"direction_median_deg": 1.0, "intensity_rms_percent": 3.0, "registration_rms_px": 1.0, "truth_median_deg": 1.0}
"""What a session with two chrome balls, a white one and a laser scan must reach."""


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
    """
    truth = json.loads((truth_folder / "truth.json").read_text())
    arrays = np.load(truth_folder / "truth.npz")
    rows: dict[str, dict[str, Any]] = {}

    def row(key: str, value: float, unit: str, text: str) -> None:
        rows[key] = {"value": float(value), "unit": unit, "text": text}
        if key in BARS:
            rows[key]["bar"] = BARS[key]

    center = np.array(truth["object_centre_mm"])
    lights = store.load_lights().seen_from(center)
    direction = angular_error_deg(lights.directions, np.array(truth["directions_at_object"]))
    row("direction_median_deg", np.median(direction), "degrees", "light direction at the object, median")
    row("direction_max_deg", direction.max(), "degrees", "light direction at the object, worst")
    if lights.positions_mm is not None:
        true = arrays["light_positions_mm"]
        range_mm = np.linalg.norm(true - center, axis=1)
        error = np.linalg.norm(lights.positions_mm - true, axis=1) / range_mm
        row("position_median_percent", 100 * np.median(error), "%", "light position, median, of its distance")
    expected = np.array(truth["relative_intensity_rgb_at_object"])
    relative = lights.intensities / (expected / expected.mean(0)) - 1
    row("intensity_rms_percent", 100 * np.sqrt(np.mean(relative**2)), "%", "light intensity per channel, rms")
    row("intensity_max_percent", 100 * np.abs(relative).max(), "%", "light intensity per channel, worst")
    row("sphere_max_px", _sphere_error(store, truth), "px", "balls' centres and radii, worst")

    true_normals = np.where(arrays["mask"][..., None], arrays["normals"].astype(np.float64), np.nan)
    if mesh is not None and store.path("pose.json").exists():
        camera, pose = store.load_camera(), store.load_pose()
        true_pose = Pose(np.array(truth["camera_from_scan"]))
        row(
            "registration_rms_px", _reprojection(mesh, camera, pose, true_pose), "px", "registration, rms over the scan"
        )
        row("registration_deg", (pose @ true_pose.inverse()).angle_deg(), "degrees", "registration, rotation")
        error = angular_error_deg(store.load_normals("truth"), true_normals)
        row("truth_median_deg", np.nanmedian(error), "degrees", "ground-truth normals, median")
        mask = store.load_mask()
        union = np.count_nonzero(mask | arrays["mask"])
        row("mask_overlap", np.count_nonzero(mask & arrays["mask"]) / union, "", "mask, intersection over union")
    for method in methods:
        error = angular_error_deg(store.load_normals(method), true_normals)
        text = f"`{method}` against the true normals, median"
        row(f"{method}_median_deg", np.nanmedian(error), "degrees", text)
    return rows


def _sphere_error(store: Store, truth: dict[str, Any]) -> float:
    """Return the largest error in pixels of centre or radius; infinite where a ball is missing or too many."""
    found = store.load_spheres()
    if len(found) != len(truth["spheres"]):
        return float("inf")
    worst = 0.0
    for ball in truth["spheres"]:
        center: NDArray = np.array(ball["centre_px"])
        same = [sphere for sphere in found if sphere.kind == ball["kind"]]
        if not same:
            return float("inf")
        nearest = min(same, key=lambda sphere: np.linalg.norm(sphere.center_px - center))
        off = np.linalg.norm(nearest.center_px - center)
        worst = max(worst, float(off), abs(nearest.radius_px - ball["radius_px"]))
    return worst


def _reprojection(mesh: Mesh, camera: Camera, pose: Pose, true: Pose) -> float:
    """Return the rms distance in pixels between the scan's vertices projected under both poses."""
    facing = np.sum(true.rotate(mesh.vertex_normals) * true.apply(mesh.vertices), -1) < 0
    points = mesh.vertices[facing]
    difference = camera.project(pose.apply(points)) - camera.project(true.apply(points))
    return float(np.sqrt(np.mean(np.sum(difference**2, -1))))
