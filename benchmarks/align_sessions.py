"""Sessions of known pose: shapes photographed by fixtures/mesh_scene and scanned by fixtures/mesh_shapes.

Lights are given with the errors that calibrating leaves; mask and normals are found from the photographs, as
`rgbn align` does. Seeds 0 to 999 are the benchmark's; nothing was tuned on them.
"""

from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from numpy.typing import NDArray

from align.mask.object_mask import find_object
from align.pose.photographed import Photographs, thinned
from benchmarks.harness import SHARED
from fixtures import star_shapes
from fixtures.mesh_scene import Scene, as_calibrated, random_rotation, random_scene
from fixtures.mesh_shapes import SHAPES, file_shape, scan_of
from scene.camera import Camera
from scene.frames import Frames
from scene.lights import Lights
from scene.mesh import Mesh
from scene.pose import Pose
from solve.solve import solve

BUNNY = SHARED / "real" / "scan_meshes" / "data" / "stanford-bunny.obj"
FAULTS = ("another object", "mirrored", "25.4 times too large", "back side only")
"""Scans that do not belong to the photographs."""


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
    return [*(["bunny"] if BUNNY.is_file() else []), *SHAPES]


@cache
def shape(name: str) -> Mesh:
    """Return a fine mesh about 105 mm across; "coarse" is one of few faces, for a session that is made quickly."""
    if name == "coarse":
        return star_shapes.blob(3).mesh(2000, np.random.default_rng(0))
    return SHAPES[name]() if name in SHAPES else file_shape(BUNNY)


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


def photographs_of(made: Session) -> tuple[Photographs, NDArray]:
    """Return photographs with mask and lights, and normals, as `rgbn align` has them before it registers."""
    camera = made.scene.camera
    mask = find_object(made.frames, camera, []).mask
    rows, columns = np.nonzero(mask)
    depth = float(made.lights.reference_point_mm[2])
    lights = made.lights.seen_from(camera.points_at_depth(np.array([columns.mean(), rows.mean()]), depth))
    normals = solve("iterative", made.frames, lights, camera, thinned(mask)).normals
    return Photographs(camera, made.frames, lights, mask), normals


def apart_px(camera: Camera, scan: Mesh, pose: Pose, true: Pose) -> float:
    """Return the rms distance, pixels, between a scan's pictures at two poses."""
    gap = camera.project(pose.apply(scan.vertices)) - camera.project(true.apply(scan.vertices))
    return float(np.sqrt(np.mean((gap**2).sum(1))))
