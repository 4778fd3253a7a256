"""Ground-truth normals that are already registered: files of DiLiGenT and its relatives."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from scene.errors import AlignError

SUFFIXES = (".mat", ".txt", ".npy", ".png")


def read_normals(path: Path, height: int, width: int) -> NDArray[np.float32]:
    """Read a normal map that lies on the frames' pixels.

    Parameters
    ----------
    path : Path
        .mat (`Normal_gt` or the only H x W x 3 array; MATLAB 5 to 7.3), .txt (H * W rows of 3, row by row),
        .npy (H, W, 3), or .png of 8 or 16 bits, RGB = (n + 1) / 2.
    height, width : int
        The frames' size.

    Returns
    -------
    normals : (H, W, 3) float32
        Unit, camera frame (x right, y up, z toward the viewer), NaN where the file has none.

    Raises
    ------
    AlignError
        The file cannot be read, has another size, no unit vectors, or looks away from the camera.
    """
    path = Path(path)
    if not path.is_file():
        raise AlignError(f"{path}: there is no such file. Check normals under [object] in session.toml.")
    readers = {".mat": _read_mat, ".txt": _read_text, ".npy": _read_npy, ".png": _read_png}
    suffix = path.suffix.lower()
    if suffix not in readers:
        raise AlignError(f"{path}: cannot read normals with the ending {suffix!r}; expected {', '.join(SUFFIXES)}.")
    try:
        values = readers[suffix](path, height, width)
    except AlignError:
        raise
    except Exception as error:
        # scipy and h5py raise whatever they stumble over; all of it means a damaged file.
        raise AlignError(f"{path}: cannot be read as a normal map ({error}).") from error
    if values.shape != (height, width, 3):
        raise AlignError(
            f"{path}: found an array of {' x '.join(map(str, values.shape))}, expected {height} x {width} x 3, "
            "the size of the frames."
        )
    return _checked(path, values, tolerance=0.02 if suffix == ".png" else 0.01)


def _read_mat(path: Path, height: int, width: int) -> NDArray:
    import h5py
    import scipy.io

    if h5py.is_hdf5(path):
        with h5py.File(path) as file:
            # MATLAB 7.3 stores columns first: the axes come out reversed.
            arrays = {name: np.asarray(item).T for name, item in file.items() if isinstance(item, h5py.Dataset)}
    else:
        arrays = {name: item for name, item in scipy.io.loadmat(path).items() if isinstance(item, np.ndarray)}
    maps = {name: item for name, item in arrays.items() if item.ndim == 3 and item.shape[2] == 3}
    if "Normal_gt" in maps:
        return maps["Normal_gt"]
    if len(maps) != 1:
        found = ", ".join(f"{name} {item.shape}" for name, item in arrays.items()) or "nothing"
        raise AlignError(f"{path}: expected `Normal_gt` or one H x W x 3 array, found {found}.")
    return next(iter(maps.values()))


def _read_text(path: Path, height: int, width: int) -> NDArray:
    table = np.loadtxt(path, ndmin=2)
    if table.shape != (height * width, 3):
        raise AlignError(
            f"{path}: found {table.shape[0]} rows of {table.shape[1]} numbers, expected {height * width} rows "
            f"of 3 ({height} x {width} pixels, row by row)."
        )
    return table.reshape(height, width, 3)


def _read_npy(path: Path, height: int, width: int) -> NDArray:
    return np.load(path, allow_pickle=False)


def _read_png(path: Path, height: int, width: int) -> NDArray:
    import cv2

    image = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
    if image is None or image.ndim != 3 or image.shape[2] < 3:
        raise ValueError("no RGB image of 8 or 16 bits")
    code = image[..., 2::-1].astype(np.float64)
    normals = code / (65535 if image.dtype == np.uint16 else 255) * 2 - 1
    if image.shape[2] == 4:
        normals[image[..., 3] == 0] = 0
    # Outside the object such maps are black, or the middle gray of a zero vector.
    normals[(code == 0).all(-1)] = 0
    return normals


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
