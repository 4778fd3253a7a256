"""Files that the tests photograph themselves: Bayer DNG written by tifffile, pictures, session folders."""

import functools

import cv2
import numpy as np
import pytest
import tifffile

from scene.files import write_png

BLACK, WHITE_DN = 512, 16383


def _rational(value):
    return (round(value * 1_000_000), 1_000_000)


def write_dng(
    path,
    values,
    *,
    pattern="RGGB",
    period=(2, 2),
    black=(BLACK,) * 4,
    white=WHITE_DN,
    exposure_s=None,
    iso=None,
    aperture=None,
    more=(),
    **how,
):
    """Write a mosaic (H, W), or all colours (H, W, 3), as a DNG; no code is shared with the product.

    `more`: further tags; `how`: of tifffile's writer.
    """
    letters = bytes("RGB".index(letter) for letter in pattern)
    tags = [
        (50706, 1, 4, b"\x01\x07\x00\x00", True),
        (50708, 2, 0, "Test One", True),
        (50717, 4, 1, white, True),
        (50721, 10, 9, tuple(v for x in np.eye(3).ravel() for v in (int(x * 10000), 10000)), True),
        (50728, 5, 3, (62, 100, 1, 1, 71, 100), True),
        (50778, 3, 1, 21, True),
        *more,
    ]
    if values.ndim == 2:
        tags += [(33421, 3, 2, period, True), (33422, 1, len(letters), letters, True)]
    if black is not None:
        tags += [(50713, 3, 2, (2, 2), True), (50714, 3, 4, tuple(black), True)]
    if exposure_s:
        tags.append((33434, 5, 1, _rational(exposure_s), True))
    if aperture:
        tags.append((33437, 5, 1, _rational(aperture), True))
    if iso:
        tags.append((34855, 3, 1, iso, True))
    kind = {2: "cfa", 3: "linear_raw"}[values.ndim]
    tifffile.imwrite(path, values, photometric=kind, extratags=tags, metadata=None, software="test", **how)
    return path


def mosaic_of(linear, pattern="RGGB", *, black=BLACK, white=WHITE_DN):
    """Return the DN (H, W) that a noiseless sensor records of linear RGB (H, W, 3); clips at white.

    `white` None: linear values as they are, of floating point.
    """
    height, width, _ = linear.shape
    v, u = np.mgrid[:height, :width]
    channel = np.array(["RGB".index(letter) for letter in pattern])[(v % 2) * 2 + u % 2]
    values = np.take_along_axis(linear, channel[..., None], 2)[..., 0]
    if white is None:
        return values
    return np.clip(np.round(black + values * (white - black)), 0, white).astype(np.uint16)


def linear_png(path, image):
    """Write 0..1 (H, W, 3) in 16 bits."""
    write_png(path, (np.clip(image, 0, 1) * 65535).round().astype(np.uint16))


@pytest.fixture
def picture_session(tmp_path):
    """Write linear pictures (F, H, W, 3) as 16-bit PNG with a session.toml; return the folder."""

    def write(images, *, more="", table="linear = true", ambient=None):
        folder = tmp_path / "session"
        folder.mkdir(exist_ok=True)
        for i, image in enumerate(images):
            linear_png(folder / f"flash_{i:03d}.png", image)
        if ambient is not None:
            linear_png(folder / "ambient.png", ambient)
            table += '\nambient = "ambient.png"'
        (folder / "session.toml").write_text(f'[frames]\nflash = "flash_*.png"\n{table}\n{more}')
        return folder

    return write


@functools.cache
def lit_scene(count=12, *, shape=(240, 320), seed=0):
    """Return linear pictures (F, H, W, 3) of a bumpy, textured ground under lights around it, with shadows.

    Heights are low-passed noise: shading, attached shadows and albedo edges as a photograph has them; the camera
    stands still.
    """
    rng = np.random.default_rng(seed)
    height = cv2.GaussianBlur(rng.normal(size=shape), (0, 0), 12.0) * 12 * 8
    albedo = 0.3 + 0.5 * (cv2.GaussianBlur(rng.normal(size=shape), (0, 0), 4.0) > 0)
    albedo = cv2.GaussianBlur(albedo, (0, 0), 0.7)[..., None] * np.array([1.0, 0.9, 0.7])
    dy, dx = np.gradient(height)
    normals = np.stack([-dx, dy, np.ones(shape)], -1)
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    azimuth = np.linspace(0, 2 * np.pi, count, endpoint=False)
    lights = np.stack([0.5 * np.cos(azimuth), 0.5 * np.sin(azimuth), np.full(count, 0.87)], -1)
    shading = np.maximum(np.einsum("hwc,fc->fhw", normals, lights), 0)
    clean = 0.6 * albedo * shading[..., None]
    return clean + rng.normal(size=clean.shape) * np.sqrt(1e-6 + clean * 2e-5)


@pytest.fixture
def scene_pictures():
    """Return a test's own copy of the lit scene, which is made once."""
    return lambda *given, **more: lit_scene(*given, **more).copy()
