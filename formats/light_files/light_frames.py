"""Others' frames of reference and names: the one file of the light formats that knows an axis, an origin, a unit.

| file | axes | origin | lengths |
|---|---|---|---|
| ours, `.lp`, DiLiGenT | x right, y up, z to the viewer: the camera frame as it is | camera | mm |
| AliceVision, near_ps | OpenCV's: x right, y down, z away from the viewer | camera | mm |
| RelightLab `.dome` | x right, y up, z to the viewer | the object, at the middle of the picture | mm |
"""

from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from scene.camera import FROM_OPENCV, Camera

Array = NDArray[np.float64]


class Photographs(NamedTuple):
    """What a format may say beside the lights: camera, the photographs' file names, AliceVision's .sfm of them."""

    camera: Camera
    files: tuple[str, ...]
    sfm: Path | None = None


def stem(name: str) -> str:
    """`folder/flash_000.dng` -> `flash_000`; light files are written on Windows too."""
    return Path(name.strip().replace("\\", "/")).stem


def nameless(count: int) -> tuple[str, ...]:
    """Return names for the lights of a file that has none.

    Never a frame's name: frames are often named by number, and row 1 need not be frame "1".
    """
    return tuple(f"(row {i + 1})" for i in range(count))


def to_opencv(vectors: ArrayLike) -> Array:
    """Return vectors (..., 3) of the camera frame in OpenCV's."""
    # Plus nothing: -0.0 in a file makes people look for a fault.
    return np.asarray(vectors, np.float64) @ FROM_OPENCV + 0.0


def from_opencv(vectors: ArrayLike) -> Array:
    """Return vectors (..., 3) of OpenCV's frame in the camera frame."""
    return to_opencv(vectors)


def matlab_matrix(camera: Camera) -> Array:
    """Return K (3, 3) for MATLAB, where the centre of the upper left pixel is (1, 1)."""
    return camera.matrix + [[0, 0, 1], [0, 0, 1], [0, 0, 0]]


def dome_origin(camera: Camera, depth_mm: float) -> Array:
    """Return a dome's origin (3,), mm, camera frame: what the picture's middle shows of the plane z = -depth_mm."""
    return camera.points_at_depth([(camera.width - 1) / 2, (camera.height - 1) / 2], -depth_mm)


def dome_image_width_mm(camera: Camera, depth_mm: float) -> float:
    """Return how wide a strip of the plane z = -depth_mm the picture shows."""
    return camera.width * depth_mm / camera.fx


def dome_depth_mm(camera: Camera, image_width_mm: float) -> float:
    """Return the distance at which the picture shows a strip so wide."""
    return image_width_mm * camera.fx / camera.width
