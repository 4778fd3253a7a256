"""Normal maps in the files of other programs."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from formats.mat_files import arrays_of_mat
from formats.picture_files import read_values
from scene.errors import SceneError
from scene.reading import array_of, reading, shortened

SUFFIXES = (".mat", ".txt", ".npy", ".png")


def read_normal_map(path: Path, height: int, width: int) -> NDArray:
    """Read a map of vectors as it is written: neither their length nor their axes are looked at.

    Parameters
    ----------
    path : Path
        .mat (`Normal_gt`, `Normal_est` or the only H x W x 3 array; MATLAB 5 to 7.3), .txt (H * W rows of 3, row by
        row), .npy (H, W, 3), or .png of 8 or 16 bits, RGB = (n + 1) / 2.
    height, width : int
        What is expected.

    Returns
    -------
    values : (H, W, 3) float

    Raises
    ------
    SceneError
        The file cannot be read, or has another size.
    """
    readers = {".mat": _read_mat, ".txt": lambda path: np.loadtxt(path, ndmin=2), ".npy": array_of, ".png": _read_png}
    suffix = path.suffix.lower()
    if suffix not in readers:
        raise SceneError(f"{path}: cannot read normals with the ending {suffix!r}; expected {', '.join(SUFFIXES)}.")
    with reading(path, "cannot be read as a normal map", do="Save it again."):
        values = readers[suffix](path)
    if suffix == ".txt" and values.shape == (height * width, 3):
        values = values.reshape(height, width, 3)
    if values.shape != (height, width, 3):
        turned = values.shape == (width, height, 3)
        hint = f", or {height * width} rows of 3 in a .txt" if suffix == ".txt" else ""
        raise SceneError(
            f"{path}: found an array of {' x '.join(map(str, values.shape))}, expected {height} x {width} x 3, the "
            f"size of the frames{hint}.{' It is transposed: store rows as the photographs lie.' if turned else ''}"
        )
    return values


def _read_mat(path: Path) -> NDArray:
    arrays = {name: item for name, item in arrays_of_mat(path).items() if item.dtype.kind in "iuf"}
    maps = {name: item for name, item in arrays.items() if item.ndim == 3 and item.shape[2] == 3}
    for name in ("Normal_gt", "Normal_est"):
        if name in maps:
            return maps[name]
    if len(maps) != 1:
        found = shortened(", ".join(f"{name} {item.shape}" for name, item in arrays.items())) or "nothing"
        raise SceneError(f"{path}: expected `Normal_gt` or one H x W x 3 array, found {found}.")
    return next(iter(maps.values()))


def _read_png(path: Path) -> NDArray:
    image, white = read_values(path)
    if image.ndim != 3 or image.shape[2] < 3:
        raise ValueError("no RGB image of 8 or 16 bits")
    code = image[..., :3].astype(np.float64)
    normals = code / white * 2 - 1
    if image.shape[2] == 4:
        normals[image[..., 3] == 0] = 0
    # Outside the object such maps are black, or the middle gray of a zero vector.
    normals[(code == 0).all(-1)] = 0
    return normals
