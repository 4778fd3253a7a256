"""Ground-truth normals and their sigma against surfaces whose normals are known, at the true pose.

First the Stanford bunny: its mesh, smoothed by subdivision, is the truth, the same decimated the scan. Then shapes with
exact normals (`fixtures/star_shapes.py`). Seeds 0 to 999 are the benchmark's alone.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from align.pose.scan_view import View
from align.scan.smooth_normals import smooth_normals
from align.truth import ground_truth
from benchmarks.harness import SHARED, Figures, Scale, Table, markdown
from fixtures import star_shapes
from scene.camera import Camera
from scene.clock import now, since
from scene.mesh import Mesh
from scene.normals import angular_error_deg, unit
from scene.pose import Pose
from scene.rays import RayCaster, import_open3d

BUNNY = SHARED / "real" / "scan_meshes" / "data" / "stanford-bunny.obj"
SHAPES = ("blob", "brick", "relief", "cube", "gear")
CAMERA = Camera(600, 500, 1900.0, 1900.0, 301.0, 247.0)
SCANS = ((60, 0.0, False), (60, 0.05, False), (60, 0.1, False), (60, 0.05, True), (20, 0.05, False), (200, 0.05, False))
"""Thousands of faces, noise in mm, and whether neighbours share it."""
Scanner = Callable[[int], Mesh]
"""Takes a number of faces; returns a scan without noise."""


@dataclass(frozen=True)
class TruthRow:
    """One scan: medians over the pixels whose normal is known; `known` of the pixels that show the scan."""

    shape: str
    thousand_faces: int
    noise: str
    faces_mean_deg: float
    median_deg: float
    p90_deg: float
    sigma_deg: float
    under_two_sigma: float
    known: float
    processor_s: float


def _star(name: str, seed: int, pose: Pose, vertices: int) -> tuple[NDArray, Scanner]:
    """Return a shape's exact normals (P, 3) in the picture, and its scanner; a mesh of many vertices meets the rays."""
    shape = getattr(star_shapes, name)(seed)
    fine = RayCaster(shape.mesh(vertices, np.random.default_rng(seed + 900)))
    hits = View(fine, CAMERA, pose).hits(CAMERA.grid().reshape(-1, 2))
    normals = np.full((len(hits.hit), 3), np.nan)
    normals[hits.hit] = pose.rotate(shape.normals(unit(hits.interpolate(fine.mesh, fine.mesh.vertices)[hits.hit])))
    return normals, lambda faces: shape.mesh(faces // 2, np.random.default_rng(seed))


def _bunny(pose: Pose) -> tuple[NDArray, Scanner]:
    """Return the same of the bunny, 120 mm long; its scans are decimated by quadric errors."""
    import trimesh

    raw = trimesh.load_mesh(BUNNY)
    vertices = np.array(raw.vertices)
    vertices = (vertices - vertices.mean(0)) * (120.0 / np.ptp(vertices, 0).max())
    smooth, faces = trimesh.remesh.subdivide_loop(vertices, np.array(raw.faces), 1)
    fine = Mesh(np.array(smooth), np.array(faces, np.int64))
    hits = View(RayCaster(fine), CAMERA, pose).hits(CAMERA.grid().reshape(-1, 2))

    def scan(faces: int) -> Mesh:
        open3d = import_open3d()
        model = open3d.geometry.TriangleMesh(
            open3d.utility.Vector3dVector(fine.vertices), open3d.utility.Vector3iVector(fine.faces.astype(np.int32))
        ).simplify_quadric_decimation(faces)
        model.remove_unreferenced_vertices()
        return Mesh(np.asarray(model.vertices), np.asarray(model.triangles).astype(np.int64))

    return unit(pose.rotate(hits.interpolate(fine, fine.vertex_normals))), scan


def _measured(
    name: str, seed: int, scans: Sequence[tuple[int, float, bool]], vertices: int = 400_000
) -> list[TruthRow]:
    turn = np.linalg.qr(np.random.default_rng(seed).standard_normal((3, 3)))[0]
    pose = Pose.from_rotation_translation(turn * np.linalg.det(turn), [0, 0, -650.0])
    exact, scanner = _bunny(pose) if name == "bunny" else _star(name, seed, pose, vertices)
    exact, rows = exact.reshape(CAMERA.height, CAMERA.width, 3), []
    for thousand, noise_mm, is_shared in scans:
        scan = star_shapes.shaken(
            scanner(1000 * thousand), noise_mm, np.random.default_rng(seed + 500), correlated=is_shared
        )
        start = now()
        found = smooth_normals(scan)
        spent = since(start)["processor_seconds"]
        truth = ground_truth(scan, pose, CAMERA, at_vertices=found)
        plain = ground_truth(scan, pose, CAMERA, at_vertices=(scan.vertex_normals, np.zeros(len(scan.vertices))))
        error = angular_error_deg(truth.normals, exact)
        known = np.isfinite(error)
        error, sigma = error[known], truth.sigma_deg[known]
        rows.append(
            TruthRow(
                name, thousand, f"{noise_mm:g}{' shared' if is_shared else ''}",
                float(np.nanmedian(angular_error_deg(plain.normals, exact))), float(np.median(error)),
                float(np.quantile(error, 0.9)), float(np.median(sigma)), float(np.mean(error < 2 * sigma)),
                float(known.sum() / truth.mask.sum()), spent,
            )
        )  # fmt: skip
    return rows


def _cases(scale: Scale) -> list[tuple]:
    if scale == "small":
        return [("cube", 3, ((5, 0.05, False),), 20_000)]
    names = (*(("bunny",) if BUNNY.is_file() else ()), *SHAPES)
    if scale == "gates":
        return [(name, 0, SCANS[1:2]) for name in names]
    return [(name, seed, SCANS) for seed, name in enumerate(names)]


def _figures(rows: Sequence[TruthRow]) -> Figures:
    groups = {name: [row for row in rows if row.shape == name] for name in dict.fromkeys(row.shape for row in rows)}
    return {
        f"{name}: {key}": float(np.median([getattr(row, key) for row in some]))
        for name, some in groups.items()
        for key in ("median_deg", "under_two_sigma", "known")
    }


COLUMNS = {
    "shape": "{shape}", "faces": "{thousand_faces} k", "noise, mm": "{noise}", "faces' mean": "{faces_mean_deg:.2f}°",
    "this": "**{median_deg:.2f}°**", "90 %": "{p90_deg:.2f}°", "sigma": "{sigma_deg:.2f}°",
    "under 2 sigma": "{under_two_sigma:.0%}", "known": "{known:.0%}",
}  # fmt: skip
TABLES = (
    Table(
        "ground-truth", "table", ("align.truth", "align.scan.smooth_normals"), TruthRow, _cases, _measured,
        lambda rows: markdown(COLUMNS, rows), _figures,
    ),
)  # fmt: skip
