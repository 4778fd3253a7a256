"""Sessions of known pose for the benchmark of align, and their marking.

Seeds 0 to 999 are the benchmark's; nothing was tuned on them. Object, photographs and scan are of fixtures/mesh_scene
and fixtures/mesh_shapes; lights are given with the errors that calibrating leaves; mask and normals are found from the
photographs, as `rgbn align` does.
"""

import time
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from align.mask.object_mask import find_object
from align.pose.photographed import Photographs, sparse_normals
from align.pose.register import Registration, register
from align.truth import ground_truth
from fixtures.mesh_scene import Scene, as_calibrated, random_rotation, random_scene
from fixtures.mesh_shapes import SHAPES, file_shape, scan_of
from scene.errors import SceneError
from scene.frames import Frames
from scene.lights import Lights
from scene.mesh import Mesh
from scene.normals import angular_error_deg
from scene.pose import Pose
from solve.solve import solve

SCANS = Path(__file__).resolve().parents[2] / "shared" / "real" / "scan_meshes"
FILES = {"bunny": "data/stanford-bunny.obj"}
FAULTS = ("another object", "mirrored", "25.4 times too large", "back side only")
"""Scans that do not belong to the photographs."""
FOUND_PX = 2.0
"""A pose whose picture is within this of the true one's (rms) was found; what is left is its refinement."""


@dataclass(frozen=True)
class Session:
    """A scene, its photographs, and what the user has: a scan in a frame of its own, and calibrated lights."""

    scene: Scene
    frames: Frames
    lights: Lights
    scan: Mesh
    pose: Pose
    """camera_from_scan, the truth."""


def shape_names() -> list[str]:
    """Return the shapes that can be made here."""
    return [*SHAPES, *(name for name, file in FILES.items() if (SCANS / file).exists())]


@cache
def shape(name: str) -> Mesh:
    """Return a fine mesh about 105 mm across."""
    return SHAPES[name]() if name in SHAPES else file_shape(SCANS / FILES[name])


def session(
    name: str, seed: int, *, width: int, height: int, flashes: int, faces: int, noise_mm: float = 0.05
) -> Session:
    """Photograph a shape and scan it."""
    mesh = shape(name)
    scene = random_scene(mesh, seed, width=width, height=height, flashes=flashes)
    generator = np.random.default_rng([seed, 9])
    # It was scanned standing otherwise than when it was photographed.
    stood = random_rotation(generator)
    scan = scan_of(mesh, generator, faces=faces, noise_mm=noise_mm, unscanned=stood[2])
    motion = Pose.from_rotation_translation(random_rotation(generator), generator.uniform(-300, 300, 3))
    scan = Mesh(motion.apply(scan.vertices), scan.faces)
    return Session(
        scene, scene.photograph(), as_calibrated(scene.lights, generator), scan, scene.pose @ motion.inverse()
    )


def with_fault(made: Session, name: str, fault: str) -> Session:
    """Return the session with a scan that must be refused; another object's scan is that of another shape."""
    scan = made.scan
    if fault == "another object":
        names = shape_names()
        other = shape(names[(names.index(name) + 3) % len(names)])
        scan = scan_of(other, np.random.default_rng(1), faces=len(scan.faces), noise_mm=0.05)
    elif fault == "mirrored":
        scan = Mesh(scan.vertices * [-1.0, 1.0, 1.0], scan.faces[:, [0, 2, 1]])
    elif fault == "25.4 times too large":
        scan = Mesh(25.4 * scan.vertices, scan.faces)
    else:
        toward = made.pose.apply(scan.vertices)
        away = np.einsum("tk,tk->t", made.pose.rotate(scan.face_normals), toward[scan.faces[:, 0]]) > 0
        used, inverse = np.unique(scan.faces[away], return_inverse=True)
        scan = Mesh(scan.vertices[used], inverse.reshape(-1, 3))
    return replace(made, scan=scan)


def prepared(made: Session) -> tuple[Lights, NDArray[np.bool_], NDArray]:
    """Return lights, mask and normals as `rgbn align` has them before it registers."""
    camera = made.scene.camera
    mask = find_object(made.frames, camera, []).mask
    rows, columns = np.nonzero(mask)
    depth = float(made.lights.reference_point_mm[2])
    lights = made.lights.seen_from(camera.points_at_depth(np.array([columns.mean(), rows.mean()]), depth))
    normals = sparse_normals(mask, lambda some: solve("iterative", made.frames, lights, camera, some).normals)
    return lights, mask, normals


def apart_px(made: Session, pose: Pose) -> float:
    """Return the rms distance between the pictures of the scan's visible part at a pose and at the true one."""
    camera, scan = made.scene.camera, made.scan
    points = made.pose.apply(scan.vertices)
    seen = np.einsum("vk,vk->v", made.pose.rotate(scan.vertex_normals), points) < 0
    gap = camera.project(pose.apply(scan.vertices[seen])) - camera.project(points[seen])
    return float(np.sqrt(np.mean((gap**2).sum(1))))


def mark(made: Session, *, with_truth: bool = False) -> dict:
    """Register a session as its user would, and compare with the truth."""
    start = time.perf_counter()
    out: dict = {"said": [], "refused": 0.0, "warned": 0.0}
    try:
        lights, mask, normals = prepared(made)
        begun = time.perf_counter()
        result = register(made.scan, Photographs(made.scene.camera, made.frames, lights, mask), normals)
    except SceneError as error:
        return out | {"refused": 1.0, "said": [str(error)]}
    out["register_seconds"] = time.perf_counter() - begun
    out["said"] = list(result.warnings)
    out["ambiguous"] = float(result.ambiguous)
    out["warned"] = float(len(result.warnings) > 0)
    out |= _mark_pose(made, result)
    if with_truth:
        out |= _mark_truth(made, result)
    return out | {"seconds": time.perf_counter() - start}


def _mark_pose(made: Session, result: Registration) -> dict:
    off = result.pose @ made.pose.inverse()
    pivot = made.pose.apply(made.scan.center_mm)
    turn = Rotation.from_matrix(off.rotation).as_rotvec()
    shift = off.apply(pivot) - pivot
    twist = np.concatenate([turn, shift])
    square = float(twist @ np.linalg.pinv(result.covariance, rcond=1e-14, hermitian=True) @ twist)
    return {
        "apart_px": apart_px(made, result.pose),
        "degrees": float(np.degrees(np.linalg.norm(turn))),
        "shift_mm": float(np.linalg.norm(shift[:2])),
        "depth_mm": float(abs(shift[2])),
        "inside_square": square,
        "sigma_deg": result.sigma_deg,
        "residual_px": result.residual_px,
        "misfit": result.evidence["misfit"],
    }


def _mark_truth(made: Session, result: Registration) -> dict:
    camera = made.scene.camera
    ours = ground_truth(made.scan, result.pose, camera, covariance=result.covariance)
    exact = ground_truth(made.scene.mesh, made.scene.pose, camera)
    error = angular_error_deg(ours.normals, exact.normals)
    at_pose = angular_error_deg(ground_truth(made.scan, made.pose, camera).normals, exact.normals)
    known = np.isfinite(error) & np.isfinite(ours.sigma_deg)
    return {
        "normal_deg": float(np.nanmedian(error[known])),
        "normal_at_true_pose_deg": float(np.nanmedian(at_pose)),
        "under_two_sigma": float(np.mean(error[known] < 2 * ours.sigma_deg[known])),
        "known_share": float(known.sum() / np.isfinite(exact.normals[..., 0]).sum()),
    }
