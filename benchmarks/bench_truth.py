"""Ground-truth normals and their sigma, against surfaces whose normals are known, into docs/evidence/ground-truth.md.

    .venv/bin/python -m benchmarks.bench_truth [--write] [--seed 0]

Scans of shapes with exact normals (`fixtures/star_shapes.py`), and where ../shared is, of the Stanford bunny: its mesh,
smoothed by subdivision, is the truth, the same decimated the scan. The pose is exact: what is measured is the scan's
part. Beside it, two simpler ways: the faces' mean at each vertex, and smoothing all of the mesh by its noise.
Seeds 0 to 999 are the benchmark's alone.
"""

import argparse
import os
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from align.pose.scan_view import View
from align.scan.scan_noise import Neighbours, scan_noise
from align.scan.smooth_normals import smooth_normals
from align.truth import ground_truth
from benchmarks.pages import put
from fixtures import star_shapes
from scene.camera import Camera
from scene.mesh import Mesh
from scene.normals import angular_error_deg, unit
from scene.pose import Pose
from scene.rays import RayCaster, import_open3d

ROOT = Path(__file__).resolve().parents[1]
BUNNY = ROOT / ".." / "shared" / "real" / "scan_meshes" / "data" / "stanford-bunny.obj"
SHAPES = ("blob", "brick", "relief", "cube", "gear")
CAMERA = Camera(600, 500, 1900.0, 1900.0, 301.0, 247.0)
CASES = [
    (60, 0.0, ""),
    (60, 0.05, ""),
    (60, 0.1, ""),
    (60, 0.05, "shared"),
    (20, 0.05, ""),
    (200, 0.05, ""),
]

RIVAL = (60, 0.05, "")
"""The one case that is smoothed at once, too: its search for a strength is slow."""


@dataclass(frozen=True)
class Subject:
    """A surface at its pose: its true normals per pixel, and how to scan it."""

    name: str
    pose: Pose
    normals: NDArray
    scan: object


def star_subject(name: str, seed: int) -> Subject:
    """Return a shape with exact normals, turned at random."""
    shape = getattr(star_shapes, name)(seed)
    pose = _pose(seed)
    fine = RayCaster(shape.fine_mesh())
    hits = View(fine, CAMERA, pose).hits(CAMERA.grid().reshape(-1, 2))
    normals = np.full((len(hits.hit), 3), np.nan)
    points = hits.interpolate(fine.mesh, fine.mesh.vertices)[hits.hit]
    normals[hits.hit] = pose.rotate(shape.normals(points / np.linalg.norm(points, axis=1, keepdims=True)))

    def scan(faces: int) -> Mesh:
        return shape.mesh(faces // 2, np.random.default_rng(seed))

    return Subject(name, pose, normals.reshape(CAMERA.height, CAMERA.width, 3), scan)


def bunny_subject(seed: int) -> Subject:
    """Return the bunny, 120 mm long; scans of it are decimated by quadric errors."""
    import trimesh

    raw = trimesh.load_mesh(BUNNY)
    vertices = np.array(raw.vertices)
    vertices = (vertices - vertices.mean(0)) * (120.0 / np.ptp(vertices, 0).max())
    fine = trimesh.Trimesh(*trimesh.remesh.subdivide_loop(vertices, np.array(raw.faces), 1), process=False)
    mesh = Mesh(np.array(fine.vertices), np.array(fine.faces, np.int64))
    pose = _pose(seed)
    hits = View(RayCaster(mesh), CAMERA, pose).hits(CAMERA.grid().reshape(-1, 2))
    normals = unit(pose.rotate(hits.interpolate(mesh, mesh.vertex_normals)))

    def scan(faces: int) -> Mesh:
        open3d = import_open3d()
        model = open3d.geometry.TriangleMesh(
            open3d.utility.Vector3dVector(mesh.vertices), open3d.utility.Vector3iVector(mesh.faces.astype(np.int32))
        ).simplify_quadric_decimation(faces)
        model.remove_unreferenced_vertices()
        return Mesh(np.asarray(model.vertices), np.asarray(model.triangles).astype(np.int64))

    return Subject("bunny", pose, normals.reshape(CAMERA.height, CAMERA.width, 3), scan)


def _pose(seed: int) -> Pose:
    q = np.linalg.qr(np.random.default_rng(seed).standard_normal((3, 3)))[0]
    return Pose.from_rotation_translation(q * np.linalg.det(q), [0, 0, -650.0])


def smoothed_at_once(mesh: Mesh) -> NDArray:
    """Return normals (V, 3) of the mesh under one bilaplacian smoothing, as strong as its noise (discrepancy)."""
    from scipy.sparse import eye
    from scipy.sparse.linalg import cg

    near = Neighbours.of(mesh)
    sigma = scan_noise(mesh, near).sigma_mm
    rough = eye(len(mesh.vertices)) - near.average
    penalty = (rough.T @ rough).T @ (rough.T @ rough)
    result = mesh.vertices
    for strength in 4.0 ** np.arange(-3, 8):
        system = eye(len(mesh.vertices)) + strength * penalty
        moved = np.stack([cg(system, x, x0=x, rtol=1e-6, maxiter=200)[0] for x in mesh.vertices.T], -1)
        if np.median(np.abs(np.einsum("vk,vk->v", moved - mesh.vertices, mesh.vertex_normals))) > 0.6745 * sigma:
            break
        result = moved
    return Mesh(result, mesh.faces).vertex_normals


def row(subject: Subject, thousand: int, noise_mm: float, kind: str, seed: int) -> str:
    """Measure one scan and return its line of the table."""
    clean = subject.scan(1000 * thousand)
    scan = star_shapes.shaken(clean, noise_mm, np.random.default_rng(seed + 500), correlated=kind == "shared")
    start = time.perf_counter()
    found = smooth_normals(scan)
    seconds = time.perf_counter() - start
    truth = ground_truth(scan, subject.pose, CAMERA, at_vertices=found)
    error = angular_error_deg(truth.normals, subject.normals)
    known = np.isfinite(error)
    others = []
    for way in (lambda scan: scan.vertex_normals, smoothed_at_once if (thousand, noise_mm, kind) == RIVAL else None):
        if way is None:
            others.append("")
            continue
        normals = way(scan)
        other = ground_truth(scan, subject.pose, CAMERA, at_vertices=(normals, np.zeros(len(normals))))
        others.append(f"{np.nanmedian(angular_error_deg(other.normals, subject.normals)):.2f}")
    error, sigma = error[known], truth.sigma_deg[known]
    return (
        f"| {subject.name} | {thousand} k | {noise_mm:g}{' ' + kind if kind else ''} | {others[0]} | {others[1]} | "
        f"**{np.median(error):.2f}** | {np.quantile(error, 0.9):.2f} | {np.median(sigma):.2f} | "
        f"{100 * (error < 2 * sigma).mean():.0f} % | {100 * known.sum() / truth.mask.sum():.0f} % | {seconds:.1f} |"
    )


def main() -> None:
    """Measure, print, and with --write put the table into docs/evidence/ground-truth.md."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--write", action="store_true")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", default="")
    arguments = parser.parse_args()
    lines = [
        "| shape | faces | noise, mm | faces' mean | all at once | this | 90 % | sigma | under 2 sigma | known | s |",
        "|---|---|---|---|---|---|---|---|---|---|---|",
    ]
    print("\n".join(lines))
    for number, name in enumerate((*SHAPES, *(("bunny",) if BUNNY.is_file() else ()))):
        if arguments.only and name not in arguments.only:
            continue
        seed = arguments.seed + number
        subject = bunny_subject(seed) if name == "bunny" else star_subject(name, seed)
        for case in CASES:
            lines.append(row(subject, *case, seed))
            print(lines[-1], flush=True)
    if arguments.write:
        path = ROOT / "docs" / "evidence" / "ground-truth.md"
        text = "\n".join(lines) + f"\n\nMeasured on {os.cpu_count()} cores by `benchmarks/bench_truth.py`.\n"
        put(path, "table", text)


if __name__ == "__main__":
    main()
