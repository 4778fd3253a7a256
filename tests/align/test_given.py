"""Normal maps that others registered: every format gives the same map, every fault its reason."""

import cv2
import h5py
import numpy as np
import pytest
import scipy.io

from align.truth import read_normals
from scene.errors import AlignError
from scene.normals import angular_error_deg, unit

HEIGHT, WIDTH = 12, 17


@pytest.fixture
def dome():
    """Normals of a dome that lean right and up in the upper right; zero outside."""
    v, u = np.mgrid[0:HEIGHT, 0:WIDTH].astype(float)
    x, y = (u - 8) / 8, -(v - 6) / 7
    inside = x * x + y * y < 0.8
    normals = np.stack([x, y, np.sqrt(np.maximum(1 - x * x - y * y, 0.1))], -1)
    return np.where(inside[..., None], unit(normals), 0)


def write(folder, normals, kind):
    folder.mkdir(exist_ok=True)
    path = folder / f"{kind.replace(' ', '_')}.{kind.split()[0]}"
    if kind == "mat 5":
        scipy.io.savemat(path, {"Normal_gt": normals, "mask": np.ones((HEIGHT, WIDTH))})
    elif kind == "mat other name":
        scipy.io.savemat(path, {"n": normals})
    elif kind == "mat 7.3":
        with h5py.File(path, "w") as file:
            file["Normal_gt"] = normals.T
    elif kind == "txt":
        np.savetxt(path, normals.reshape(-1, 3))
    elif kind == "npy":
        np.save(path, normals.astype(np.float32))
    else:
        top = 255 if "8" in kind else 65535
        code = np.round((normals + 1) / 2 * top).astype(np.uint8 if top == 255 else np.uint16)
        code[(normals == 0).all(-1)] = 0
        cv2.imwrite(str(path), code[..., ::-1])
    return path


@pytest.mark.parametrize("kind", ["mat 5", "mat other name", "mat 7.3", "txt", "npy", "png 8", "png 16"])
def test_every_format_gives_the_same_map(tmp_path, dome, kind):
    found = read_normals(write(tmp_path, dome, kind), HEIGHT, WIDTH)
    assert found.dtype == np.float32
    known = (dome != 0).any(-1)
    assert (np.isfinite(found).all(-1) == known).all()
    assert angular_error_deg(found, dome)[known].max() < (0.6 if kind == "png 8" else 0.01)


def test_faults_are_named(tmp_path, dome):
    (tmp_path / "x.bin").write_bytes(b"")
    (tmp_path / "broken.mat").write_bytes(b"not matlab at all, by a long way")
    for path, size, words in (
        (write(tmp_path / "one", dome, "npy"), (5, 5), "expected 5 x 5 x 3"),
        (write(tmp_path / "one", dome, "txt"), (5, 5), "rows"),
        (write(tmp_path / "two", dome * 0.6, "npy"), dome.shape[:2], "length"),
        (write(tmp_path / "three", dome * [1, -1, -1], "npy"), dome.shape[:2], "flip the signs of y and z"),
        (write(tmp_path / "four", dome * 0, "npy"), dome.shape[:2], "no pixel"),
        (tmp_path / "absent.npy", dome.shape[:2], "no such file"),
        (tmp_path / "x.bin", (5, 5), "ending"),
        (tmp_path / "broken.mat", dome.shape[:2], "cannot be read"),
    ):
        with pytest.raises(AlignError, match=words):
            read_normals(path, *size)


def test_a_variable_with_a_name_of_pages_is_named_in_a_line(tmp_path):
    with h5py.File(tmp_path / "n.mat", "w") as file:
        file["x\n" * 30_000] = np.ones((3, 4))
    with pytest.raises(AlignError, match="found x x") as caught:
        read_normals(tmp_path / "n.mat", HEIGHT, WIDTH)
    assert len(str(caught.value)) < 1000
