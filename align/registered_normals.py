"""Ground-truth normals that are already registered: files of DiLiGenT and its relatives."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from formats.normal_maps import read_normal_map
from scene.errors import AlignError, SceneError


def read_normals(path: Path, height: int, width: int) -> NDArray[np.float32]:
    """Read a normal map that lies on the frames' pixels.

    .mat (`Normal_gt` or the only H x W x 3 array; MATLAB 5 to 7.3), .txt (H * W rows of 3, row by row), .npy (H, W, 3),
    or .png of 8 or 16 bits, RGB = (n + 1) / 2. Return (H, W, 3): unit, camera frame (x right, y up, z toward the
    viewer), NaN where the file has none.

    Raises
    ------
    AlignError
        The file cannot be read, has another size, no unit vectors, or looks away from the camera.
    """
    path = Path(path)
    if not path.is_file():
        raise AlignError(f"{path}: there is no such file. Check normals under [object] in session.toml.")
    try:
        values = read_normal_map(path, height, width)
    except SceneError as error:
        raise AlignError(str(error)) from error
    return _checked(path, values, tolerance=0.02 if path.suffix.lower() == ".png" else 0.01)


def _checked(path: Path, values: NDArray, *, tolerance: float) -> NDArray[np.float32]:
    length = np.linalg.norm(values.astype(np.float64), axis=-1)
    known = np.isfinite(length) & (length > 0.1)
    if not known.any():
        raise AlignError(f"{path}: no pixel has a normal (all are zero or no numbers).")
    off = np.abs(length[known] - 1) > 5 * tolerance
    if off.mean() > 0.02:
        raise AlignError(
            f"{path}: {100 * off.mean():.0f} % of the vectors are not of length 1 (median length "
            f"{np.median(length[known]):.3f}). Store unit vectors"
            f"{', coded as (n + 1) / 2' if path.suffix.lower() == '.png' else ''}."
        )
    behind = values[known][:, 2] < 0
    if behind.mean() > 0.1:
        raise AlignError(
            f"{path}: {100 * behind.mean():.0f} % of the normals have z < 0 and look away from the camera; expected "
            "x right, y up, z toward the viewer. Normals in OpenCV's frame: flip the signs of y and z."
        )
    # A few vectors of a wrong length (interpolation at the border) are unknown, not errors of the whole map.
    known &= np.abs(length - 1) <= 5 * tolerance
    normals = np.full(values.shape, np.nan, np.float32)
    normals[known] = values[known] / length[known][:, None]
    return normals
