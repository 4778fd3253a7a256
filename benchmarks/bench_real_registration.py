"""Register scans on photographs that nobody here made; written into docs/evidence/registration.md.

    .venv/bin/python -m benchmarks.bench_real_registration [ROW ...] [--write]

Rows: right (DiLiGenT's cat and ball, their own surfaces, turned anyhow), wrong (surfaces that must be refused), picks
(YCB-Video's photograph: poses from picked points). Results are kept in out/bench_real_registration.json, so that rows
can be run one by one; `--write` puts the tables of what is there into the document. Where a surface comes from and what
that leaves to be measured: `benchmarks/real_surfaces.py`, and the document.
"""

import argparse
import json
import subprocess
import sys
import time
from dataclasses import asdict
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from align.pose.photographed import Photographs
from align.pose.picks import misses_px, pose_of, refined
from align.pose.pose_check import check_pose
from align.pose.register import register
from align.pose.scan_outline import find_outline
from align.pose.scan_view import View
from align.truth import ground_truth
from benchmarks.pages import put
from benchmarks.real_surfaces import (
    Projection,
    RealObject,
    YcbObject,
    diligent_object,
    mirrored,
    moved_scan,
    sphere_center,
    ycb_objects,
)
from scene.errors import AlignError
from scene.mesh import Mesh
from scene.normals import angular_error_deg
from scene.pose import Pose
from scene.rays import RayCaster
from solve.solve import solve

ROOT = Path(__file__).resolve().parents[1]
RESULTS = ROOT / "out" / "bench_real_registration.json"
RIGHT: tuple[tuple[str, Projection, int], ...] = (
    ("cat", "perspective", 1), ("cat", "perspective", 2), ("cat", "orthographic", 1),
    ("ball", "perspective", 1), ("ball", "perspective", 2), ("ball", "orthographic", 1),
)  # fmt: skip
WRONG: tuple[tuple[str, Projection, str], ...] = (
    ("cat", "perspective", "the ball's surface"), ("cat", "orthographic", "the ball's surface"),
    ("cat", "perspective", "its own, mirrored"), ("cat", "orthographic", "its own, mirrored"),
    ("cat", "perspective", "its own, a fifth wider"), ("ball", "perspective", "the cat's surface"),
)  # fmt: skip
PICKS, PICK_TRIALS = 8, 200


def register_real(made: RealObject, scan: Mesh, pose: Pose) -> dict:
    """Register a scan as its user would, with the set's mask and lights; compare with the pose given (of `scan`)."""
    normals = solve("iterative", made.frames, made.lights, made.camera, made.mask).normals
    start = time.perf_counter()
    try:
        found = register(scan, Photographs(made.camera, made.frames, made.lights, made.mask), normals)
    except AlignError as error:
        return {"refused": str(error), "seconds": time.perf_counter() - start}
    off = found.pose @ pose.inverse()
    seen = made.camera.project(found.pose.apply(scan.vertices)) - made.camera.project(pose.apply(scan.vertices))
    twist = np.concatenate([Rotation.from_matrix(off.rotation).as_rotvec(), _shift(off, pose.apply(scan.center_mm))])
    if made.camera.is_orthographic:
        twist[5] = 0.0
    both = (found.pose, pose)
    truth, at_given = (ground_truth(scan, where, made.camera).normals for where in both)
    center = sphere_center(scan.vertices)
    return {
        "seconds": time.perf_counter() - start,
        "degrees": off.angle_deg(),
        "twist": twist,
        "apart_px": float(np.sqrt(np.mean((seen**2).sum(1)))),
        "mean_px": seen.mean(0),
        "center_px": float(
            np.linalg.norm(np.diff(made.camera.project([where.apply(center) for where in both]), axis=0))
        ),
        "inside_square": float(twist @ np.linalg.pinv(found.covariance, rcond=1e-14, hermitian=True) @ twist),
        "sigma_deg": found.sigma_deg,
        "truth_deg": float(np.nanmedian(angular_error_deg(truth, made.normals))),
        "truth_at_given_deg": float(np.nanmedian(angular_error_deg(at_given, made.normals))),
        "evidence": found.evidence,
        "ambiguous": found.ambiguous,
        "said": found.warnings,
        "solved_deg": float(np.nanmedian(angular_error_deg(normals, made.normals))),
        "pose": found.pose.matrix,
    }


def _shift(off: Pose, pivot: np.ndarray) -> np.ndarray:
    return off.apply(pivot) - pivot


def unexplained(made: RealObject, scan: Mesh, pose: Pose) -> dict[str, float]:
    """Return what the photographs leave unexplained at a pose, on the same pixels wherever it is."""
    photographs = Photographs(made.camera, made.frames, made.lights, made.mask)
    return asdict(check_pose(scan, pose, photographs).here)


def _right(name: str, projection: Projection, seed: int) -> dict:
    made = diligent_object(name, projection)
    scan, given = moved_scan(made.surface, seed)
    mark = register_real(made, scan, given)
    if "refused" not in mark:
        mark["ours"] = unexplained(made, scan, Pose(mark["pose"]))
        mark["given"] = unexplained(made, scan, given)
    return mark


def wrong_surface(name: str, projection: Projection, fault: str) -> Mesh:
    """Return a surface that does not belong to the photographs."""
    if "mirrored" in fault:
        return mirrored(diligent_object(name, projection, shots=1).surface)
    if "wider" in fault:
        surface = diligent_object(name, projection, shots=1).surface
        return Mesh(surface.vertices * [1.2, 1.0, 1.0], surface.faces)
    return diligent_object("ball" if name == "cat" else "cat", projection, shots=1).surface


def _wrong(name: str, projection: Projection, fault: str) -> dict:
    made = diligent_object(name, projection, shots=24)
    return register_real(made, *moved_scan(wrong_surface(name, projection, fault), 1))


def picked(made: YcbObject, generator: np.random.Generator, noise_px: float) -> tuple[float, float, float]:
    """Return degrees, mm, px (rms over the scan) between the set's pose and that of picks with noise."""
    rows, columns = np.nonzero(made.label)
    chosen = generator.choice(len(rows), PICKS, replace=False)
    points = made.seen[rows[chosen], columns[chosen]]
    pixels = np.stack([columns, rows], -1)[chosen] + noise_px * generator.standard_normal((PICKS, 2))
    center, radius = made.points.mean(0), float(np.ptp(made.points, axis=0).max() / 2)
    pose = pose_of(made.camera, points, pixels, radius, center)
    assert pose is not None
    pose = refined(pose, made.camera, points, pixels, center)
    off = pose @ made.pose.inverse()
    shift = np.linalg.norm(_shift(off, made.pose.apply(center)))
    apart = misses_px(pose, made.camera, made.points, made.camera.project(made.pose.apply(made.points)))
    return off.angle_deg(), float(shift), float(np.sqrt(np.mean(apart**2)))


def silhouette_overlap(made: YcbObject) -> float:
    """Return intersection over union of label and scan at the set's pose; the scan's points in their convex hull."""
    from scipy.spatial import ConvexHull

    hull = ConvexHull(made.points)
    faces = hull.simplices.astype(np.int64)
    corners = made.points[faces]
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    inward = np.einsum("tk,tk->t", cross, hull.equations[:, :3]) < 0
    faces[inward] = faces[inward][:, ::-1]
    view = View(RayCaster(Mesh(made.points, faces)), made.camera, made.pose)
    return find_outline(view, cells=400).overlap(made.label)


def _picks() -> dict:
    out = {}
    for made in ycb_objects():
        here = made.camera.project(made.pose.apply(made.seen[made.label]))
        rows, columns = np.nonzero(made.label)
        row: dict = {
            "reprojection_px": float(np.abs(here - np.stack([columns, rows], -1)).max()),
            "overlap": silhouette_overlap(made),
        }
        for noise in (0.5, 2.0):
            generator = np.random.default_rng(1)
            trials = [picked(made, generator, noise) for _ in range(PICK_TRIALS)]
            row[str(noise)] = np.median(trials, axis=0)
        out[made.name] = row
    return out


def _run(rows: list[str]) -> dict:
    results = json.loads(RESULTS.read_text()) if RESULTS.exists() else {}
    if rows:
        commit = subprocess.run(["git", "rev-parse", "--short", "HEAD"], capture_output=True, text=True, cwd=ROOT)
        results["commit"] = commit.stdout.strip()
    for row in rows:
        if row == "picks":
            results[row] = _picks()
        elif row == "right":
            results[row] = [_told(task, _right(*task)) for task in RIGHT]
        else:
            results[row] = [_told(task, _wrong(*task)) for task in WRONG]
        RESULTS.parent.mkdir(exist_ok=True)
        RESULTS.write_text(json.dumps(results, indent=1, default=lambda value: np.asarray(value).tolist()))
    return json.loads(RESULTS.read_text())


def _told(task: tuple, mark: dict) -> tuple[tuple, dict]:
    print(*task, mark.get("refused") or mark["apart_px"], file=sys.stderr, flush=True)
    return task, mark


def main() -> None:
    """Measure, print, and with --write put the tables into the document."""
    from benchmarks.real_tables import tables

    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("rows", nargs="*", help="right, wrong, picks; none: write from what is there")
    parser.add_argument("--write", action="store_true")
    arguments = parser.parse_args()
    text = tables(_run(arguments.rows))
    print(text)
    if arguments.write:
        path = ROOT / "docs" / "evidence" / "registration.md"
        put(path, "real", f"\n{text}")


if __name__ == "__main__":
    main()
