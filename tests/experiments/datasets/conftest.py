"""A small dataset with a truth of the tests' own: a striped ball under twelve uneven lights, seen straight."""

import numpy as np
import pytest
from scipy.io import savemat

from fixtures.lit_surfaces import dome, even_cap, lights_along, matte
from formats.diligent_layout import write_diligent
from scene.frames import Frames


@pytest.fixture
def striped(tmp_path):
    """Its folder."""
    normals, mask = dome(44, rim=0.07)
    rng = np.random.default_rng(10001)
    lights = lights_along(even_cap(12, 60.0), rng.uniform(0.4, 1.6, (12, 1)) * rng.uniform(0.9, 1.1, (12, 3)))
    albedo = 0.2 + 0.2 * ((np.arange(44) // 6) % 2)[None, :, None] * np.array([1.0, 0.6, 0.3])
    folder = tmp_path / "striped"
    write_diligent(folder, Frames.from_linear(lights.names, matte(lights, normals, normals, albedo)), lights, mask)
    savemat(folder / "Normal_gt.mat", {"Normal_gt": normals})
    return folder
