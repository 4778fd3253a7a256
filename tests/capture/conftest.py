"""Files that the tests photograph themselves: Bayer DNG written by tifffile, pictures, session folders."""

from pathlib import Path

import numpy as np
import pytest
import tifffile

SHARED = Path(__file__).parents[2] / ".." / "shared"
BLACK, WHITE_DN = 512, 16383


def _rational(value):
    return (round(value * 1_000_000), 1_000_000)


def write_dng_file(
    path,
    mosaic,
    *,
    pattern="RGGB",
    period=(2, 2),
    black=(BLACK,) * 4,
    white=WHITE_DN,
    active=None,
    exposure_s=None,
    iso=None,
    aperture=None,
):
    """Write a mosaic (H, W) uint16 as an uncompressed DNG; no code is shared with the product."""
    letters = bytes("RGB".index(letter) for letter in pattern)
    tags = [
        (33421, 3, 2, period, True),
        (33422, 1, len(letters), letters, True),
        (50706, 1, 4, b"\x01\x04\x00\x00", True),
        (50707, 1, 4, b"\x01\x01\x00\x00", True),
        (50708, 2, 0, "Test One", True),
        (50713, 3, 2, (2, 2), True),
        (50714, 3, 4, tuple(black), True),
        (50717, 4, 1, white, True),
        (50721, 10, 9, tuple(v for x in np.eye(3).ravel() for v in (int(x * 10000), 10000)), True),
        (50728, 5, 3, (62, 100, 1, 1, 71, 100), True),
        (50778, 3, 1, 21, True),
    ]
    if active:
        tags.append((50829, 4, 4, active, True))
    if exposure_s:
        tags.append((33434, 5, 1, _rational(exposure_s), True))
    if aperture:
        tags.append((33437, 5, 1, _rational(aperture), True))
    if iso:
        tags.append((34855, 3, 1, iso, True))
    tifffile.imwrite(path, mosaic, photometric=32803, compression=None, extratags=tags, metadata=None, software="test")
    return path


def mosaic_of(linear, pattern="RGGB", *, black=BLACK, white=WHITE_DN):
    """Return the DN (H, W) that a noiseless sensor records of linear RGB (H, W, 3); clips at white."""
    height, width, _ = linear.shape
    v, u = np.mgrid[:height, :width]
    channel = np.array(["RGB".index(letter) for letter in pattern])[(v % 2) * 2 + u % 2]
    values = np.take_along_axis(linear, channel[..., None], 2)[..., 0]
    return np.clip(np.round(black + values * (white - black)), 0, white).astype(np.uint16)


@pytest.fixture
def write_exr():
    """Write float32 (H, W, C) as EXR."""
    import drjit
    import mitsuba

    def write(path, values):
        # On one core the writer waits for ever, as the reader would.
        drjit.set_thread_count(max(drjit.thread_count(), 2))
        mitsuba.Bitmap(np.asarray(values, np.float32)).write(str(path))

    return write


@pytest.fixture
def write_dng():
    return write_dng_file


@pytest.fixture
def mosaic():
    return mosaic_of


@pytest.fixture
def shared():
    """Return a path under the shared captures, or skip where they are absent."""

    def at(name):
        path = SHARED / name
        if not path.exists():
            pytest.skip(f"{name} is not here: the shared captures are outside of the repository")
        return path

    return at


@pytest.fixture
def picture_session(tmp_path):
    """Write linear pictures (F, H, W, 3) as 16-bit PNG with a session.toml; return the folder."""

    def write(images, *, more="", names=None, table="linear = true", ambient=None):
        from scene.files import write_png

        folder = tmp_path / "session"
        folder.mkdir(exist_ok=True)
        names = names or [f"flash_{i:03d}" for i in range(len(images))]
        for name, image in zip(names, images, strict=True):
            write_png(folder / f"{name}.png", (np.clip(image, 0, 1) * 65535).round().astype(np.uint16))
        if ambient is not None:
            write_png(folder / "ambient.png", (np.clip(ambient, 0, 1) * 65535).round().astype(np.uint16))
            table += '\nambient = "ambient.png"'
        (folder / "session.toml").write_text(f'[frames]\nflash = "flash_*.png"\n{table}\n{more}')
        return folder

    return write


def lit_scene(count=12, *, shape=(240, 320), seed=0, lights=None):
    """Return linear pictures (F, H, W, 3) of a bumpy, textured ground under lights around it, with shadows.

    Heights are low-passed noise: shading, attached shadows and albedo edges as a photograph has them; the camera
    stands still.
    """
    import cv2

    rng = np.random.default_rng(seed)
    height = cv2.GaussianBlur(rng.normal(size=shape), (0, 0), 12.0) * 12 * 8
    albedo = 0.3 + 0.5 * (cv2.GaussianBlur(rng.normal(size=shape), (0, 0), 4.0) > 0)
    albedo = cv2.GaussianBlur(albedo, (0, 0), 0.7)[..., None] * np.array([1.0, 0.9, 0.7])
    dy, dx = np.gradient(height)
    normals = np.stack([-dx, dy, np.ones(shape)], -1)
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    if lights is None:
        azimuth = np.linspace(0, 2 * np.pi, count, endpoint=False)
        lights = np.stack([0.5 * np.cos(azimuth), 0.5 * np.sin(azimuth), np.full(count, 0.87)], -1)
    shading = np.maximum(np.einsum("hwc,fc->fhw", normals, lights), 0)
    clean = 0.6 * albedo * shading[..., None]
    return clean + rng.normal(size=clean.shape) * np.sqrt(1e-6 + clean * 2e-5)


@pytest.fixture
def scene_pictures():
    return lit_scene
