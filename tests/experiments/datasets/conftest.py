"""A small dataset with a truth of the tests' own: a dented ball under twelve uneven lights, seen straight."""

from pathlib import Path

import cv2
import numpy as np
import pytest
from scipy.io import savemat

HEIGHT, WIDTH = 40, 52


def surface():
    """Return mask and normals (H, W, 3) of a ball with a hump, which no mirror and no turn leaves as it is."""
    v, u = np.mgrid[0:HEIGHT, 0:WIDTH]
    x, y = (u - 28) / 18.0, -(v - 19) / 18.0
    mask = x**2 + y**2 < 0.995
    z = np.sqrt(np.where(mask, 1 - x**2 - y**2, 1))
    hump = 0.3 * np.exp(-((x - 0.35) ** 2 + (y - 0.2) ** 2) / 0.07)
    slope_x, slope_y = -x / z - hump * 2 * (x - 0.35) / 0.07, -y / z - hump * 2 * (y - 0.2) / 0.07
    normals = np.stack([-slope_x, -slope_y, np.ones_like(x)], -1)
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    return mask, np.where(mask[..., None], normals, 0)


def write(folder: Path):
    """Write the dataset: Lambert."""
    generator = np.random.default_rng(10001)
    mask, normals = surface()
    z = generator.uniform(0.5, 0.98, 12)
    around = generator.uniform(0, 2 * np.pi, 12)
    lights = np.stack([np.sqrt(1 - z**2) * np.cos(around), np.sqrt(1 - z**2) * np.sin(around), z], -1)
    power = generator.uniform(0.4, 1.6, (12, 1)) * generator.uniform(0.9, 1.1, (12, 3))
    albedo = 0.2 + 0.2 * ((np.arange(WIDTH) // 6) % 2)[None, :, None] * np.array([1.0, 0.6, 0.3])
    folder.mkdir(parents=True)
    for number, (light, strength) in enumerate(zip(lights, power, strict=True), 1):
        value = strength * albedo * np.maximum(normals @ light, 0)[..., None]
        codes = np.clip(np.round(value * mask[..., None] * 65535), 0, 65535).astype(np.uint16)
        cv2.imwrite(str(folder / f"{number:03d}.png"), codes[..., ::-1])
    (folder / "filenames.txt").write_text("".join(f"{number:03d}.png\n" for number in range(1, 13)))
    np.savetxt(folder / "light_directions.txt", lights, fmt="%.6f")
    np.savetxt(folder / "light_intensities.txt", power, fmt="%.6f")
    cv2.imwrite(str(folder / "mask.png"), mask.astype(np.uint8) * 255)
    savemat(folder / "Normal_gt.mat", {"Normal_gt": normals})
    return folder


@pytest.fixture
def dented(tmp_path):
    """Its folder."""
    return write(tmp_path / "dented")
