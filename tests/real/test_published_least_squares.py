"""DiLiGenT's published figures for least squares, by the profile that is named after them."""

import cv2
import numpy as np
import pytest
from scipy.io import loadmat

from scene.camera import Camera
from scene.frames import Frames
from scene.lights import Lights
from scene.normals import angular_error_deg
from solve.solve import solve


@pytest.mark.full
@pytest.mark.parametrize(("name", "published_deg"), [("ball", 4.10), ("cat", 8.41)])
def test_the_mean_error_is_the_published_one(shared, name, published_deg):
    folder = shared(f"real/diligent/{name}PNG")
    names = tuple((folder / "filenames.txt").read_text().split())
    photographs = [cv2.imread(str(folder / each), cv2.IMREAD_UNCHANGED)[..., ::-1] for each in names]
    frames = Frames.from_linear(names, np.stack(photographs).astype(np.float32) / 65535)
    # Intensities as they come: where gray ends at 1 depends on them.
    directions, intensities = (np.loadtxt(folder / f"light_{what}.txt") for what in ("directions", "intensities"))
    mask = cv2.imread(str(folder / "mask.png"), cv2.IMREAD_GRAYSCALE) > 127
    truth = loadmat(folder / "Normal_gt.mat")["Normal_gt"]
    camera = Camera.orthographic(frames.width, frames.height)
    found = solve("ls", frames, Lights(names, directions, intensities), camera, mask, profile="published")
    error = angular_error_deg(found.normals, truth)[mask]
    assert np.isfinite(error).all()
    assert error.mean() == pytest.approx(published_deg, abs=0.02)
