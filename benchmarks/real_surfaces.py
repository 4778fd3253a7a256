"""Photographs that nobody here made, with the poses that others gave their objects.

DiLiGenT's ground-truth normals are those of a laser scan that its makers registered by hand; the scan itself is not
published. Integrated, the normals are a surface again, seen from the front, whose place is known: the pose given by the
set is the identity. YCB-Video's photograph has poses found by others, and the objects' coordinates at every pixel.
"""

import json
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from align.truth import read_normals
from benchmarks.harness import SHARED
from benchmarks.real_captures import photographs
from calibrate.known_lights.read_known import read_lights
from fixtures.mesh_scene import random_rotation
from scene.camera import FROM_OPENCV, Camera
from scene.frames import Frames
from scene.lights import Lights
from scene.mesh import Mesh
from scene.pose import Pose

Array = NDArray[np.float64]
Projection = Literal["orthographic", "perspective"]

DILIGENT, YCB = SHARED / "real" / "diligent", SHARED / "real" / "ycbv"
FOCAL_PX, DISTANCE_MM = 3750.0, 1500.0
"""A camera that DiLiGenT may have had: 50 mm before pixels of 13.8 micrometres (four of the sensor's), 1.5 m away."""
FULL_SIZE = (612, 512)
"""DiLiGenT's pictures before they were cropped."""
YCB_NAMES = {8: "009_gelatin_box", 14: "025_mug", 21: "061_foam_brick"}


@dataclass(frozen=True)
class RealObject:
    """Photographs, lights, mask, and normals that others registered."""

    frames: Frames
    lights: Lights
    camera: Camera
    mask: NDArray[np.bool_]
    normals: NDArray[np.float32]
    """(H, W, 3), the set's ground truth."""
    surface: Mesh
    """The normals' surface, mm, camera frame: the scan at the pose that the set gives."""


def diligent_object(name: str, projection: Projection, *, shots: int = 96) -> RealObject:
    """Return one of DiLiGenT's objects ("ball", "cat") under either projection, with about `shots` of its frames."""
    import cv2

    folder = DILIGENT / f"{name}PNG"
    frames = photographs(sorted(folder.glob("[0-9]*.png"))[:: max(1, 96 // shots)])
    every = read_lights(folder / "light_directions.txt", tuple(f"{i:03d}" for i in range(1, 97)))
    kept = [int(stem) - 1 for stem in frames.names]
    lights = Lights(frames.names, every.directions[kept], every.intensities[kept]).normalised()
    drawn = cv2.imread(str(folder / "mask.png"), cv2.IMREAD_GRAYSCALE)
    assert drawn is not None, folder
    crop = json.loads((folder / "crop.json").read_text()) if (folder / "crop.json").exists() else {"x0": 0, "y0": 0}
    if projection == "orthographic":
        camera = Camera.orthographic(frames.width, frames.height)
    else:
        center = ((FULL_SIZE[0] - 1) / 2 - crop["x0"], (FULL_SIZE[1] - 1) / 2 - crop["y0"])
        camera = Camera(frames.width, frames.height, FOCAL_PX, FOCAL_PX, *center)
        lights = Lights(
            lights.names, lights.directions, lights.intensities, reference_point_mm=np.array([0, 0, -DISTANCE_MM])
        )
    normals = read_normals(folder / "Normal_gt.mat", frames.height, frames.width)
    mask = np.asarray(drawn, np.uint8).astype(bool)
    return RealObject(frames, lights, camera, mask, normals, integrated(normals, mask, camera))


def integrated(normals: NDArray, mask: NDArray[np.bool_], camera: Camera) -> Mesh:
    """Return the surface (mm, camera frame) whose normals these are, by least squares.

    Its vertices are the pixels' corners, so that it ends where the mask ends. A pixel's normal n asks of each two
    neighbouring corners i, j of it, on rays d: n . (p_j - p_i) = 0. Orthographic, that is linear in z; perspective,
    with p = depth d, it is log depth_j - log depth_i = log(n . d_i / n . d_j). Each equation is weighed with n . d: a
    grazing normal says little of depth. Where the surface jumps the map cannot say by how much: it comes out as a wall.
    """
    from scipy.sparse import csr_matrix, identity
    from scipy.sparse.linalg import splu

    mask = mask & np.isfinite(normals).all(-1)
    v, u = np.nonzero(mask)
    normal = normals[mask].astype(np.float64)
    # Upper left, upper right, lower right, lower left.
    corners = np.stack([u, v], -1)[:, None] + [[0, 0], [1, 0], [1, 1], [0, 1]]
    at, index = np.unique(corners.reshape(-1, 2), axis=0, return_inverse=True)
    index = index.reshape(-1, 4)
    origins, rays = camera.rays(at - 0.5)
    rays = rays / -rays[:, 2:]
    pairs, slopes, weights = [], [], []
    for one, two in ((0, 1), (1, 2), (2, 3), (3, 0)):
        pair = index[:, [one, two]]
        if camera.is_orthographic:
            weight = np.maximum(normal[:, 2], 0.02)
            slope = -np.sum(normal * (origins[pair[:, 1]] - origins[pair[:, 0]]), 1) / weight
        else:
            first, second = (np.maximum(-np.sum(normal * rays[pair[:, side]], 1), 0.02) for side in (0, 1))
            weight, slope = np.minimum(first, second), np.log(first / second)
        pairs.append(pair)
        slopes.append(slope)
        weights.append(weight)
    pair, slope, weight = np.concatenate(pairs), np.concatenate(slopes), np.concatenate(weights)
    row = np.arange(len(pair)).repeat(2)
    matrix = csr_matrix((np.stack([-weight, weight], -1).ravel(), (row, pair.ravel())), (len(pair), len(at)))
    # The constant is free; a whisker of the identity fixes it.
    height = splu((matrix.T @ matrix + 1e-9 * identity(len(at))).tocsc()).solve(matrix.T @ (weight * slope))
    height -= height.mean()
    points = origins + [0.0, 0.0, 1.0] * (height - DISTANCE_MM)[:, None]
    if not camera.is_orthographic:
        points = rays * (DISTANCE_MM * np.exp(height))[:, None]
    return Mesh(points, np.concatenate([index[:, [0, 3, 2]], index[:, [0, 2, 1]]]).astype(np.int64))


def moved_scan(surface: Mesh, seed: int) -> tuple[Mesh, Pose]:
    """Return the surface in a frame of its own, any rotation and up to 300 mm away, and its pose camera_from_scan."""
    generator = np.random.default_rng([seed, 3])
    motion = Pose.from_rotation_translation(random_rotation(generator), generator.uniform(-300, 300, 3))
    return Mesh(motion.apply(surface.vertices), surface.faces), motion.inverse()


def sphere_center(points: Array) -> Array:
    """Return the centre (3,) of the sphere that fits points (P, 3) by linear least squares."""
    middle = points.mean(0)
    system = np.column_stack([2 * (points - middle), np.ones(len(points))])
    return middle + np.linalg.lstsq(system, np.sum((points - middle) ** 2, 1), rcond=None)[0][:3]


def mirrored(mesh: Mesh) -> Mesh:
    """Return the mesh with its x reversed, its front still in front."""
    return Mesh(mesh.vertices * [-1.0, 1.0, 1.0], mesh.faces[:, [0, 2, 1]])


@dataclass(frozen=True)
class YcbObject:
    """One object of YCB-Video's photograph."""

    name: str
    camera: Camera
    pose: Pose
    """camera_from_scan, mm, as the set gives it, in this project's frame."""
    label: NDArray[np.bool_]
    points: Array
    """(2620, 3), mm, of the object's scan."""
    seen: Array
    """(H, W, 3), mm, scan frame: what each pixel of the label shows; NaN elsewhere."""


def ycb_objects() -> list[YcbObject]:
    """Return the objects of the photograph."""
    import cv2
    from scipy.io import loadmat

    folder = YCB
    meta = loadmat(folder / "data" / "000001-meta.mat")
    labels = cv2.imread(str(folder / "data" / "000001-label.png"), cv2.IMREAD_UNCHANGED)
    assert labels is not None, folder
    k = meta["intrinsic_matrix"]
    camera = Camera(labels.shape[1], labels.shape[0], k[0, 0], k[1, 1], k[0, 2], k[1, 2])
    found = []
    for number, given in zip(meta["cls_indexes"].ravel(), np.moveaxis(meta["poses"], 2, 0), strict=True):
        label = labels == number
        # Rounded to seven figures there: the nearest rotation.
        u, _, v = np.linalg.svd(FROM_OPENCV @ given[:, :3])
        pose = Pose.from_rotation_translation(u @ v, 1000 * FROM_OPENCV @ given[:, 3])
        points = 1000 * np.loadtxt(folder / "models" / YCB_NAMES[int(number)] / "points.xyz")
        seen = np.where(label[..., None], 1000 * meta["vertmap"].astype(np.float64), np.nan)
        found.append(YcbObject(YCB_NAMES[int(number)], camera, pose, label, points, seen))
    return found
