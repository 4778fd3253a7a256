"""Balls in photographs that nobody here made: what is found without a click, and what must hold without a truth.

The lights that a mirror shows must explain a matte ball under the same flashes: its pixels by Lambert's law on the
analytic sphere, and least squares on its pixels must give the sphere's own normals. Nothing of that is used by the
calibration itself.
"""

import json
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from calibrate.calibrate import calibrate
from calibrate.calibration import Calibration
from calibrate.known_lights.read_known import read_lights
from calibrate.photometry.matte_shading import read_surface, shading_directions
from formats.pictures import linear_from_srgb
from scene.camera import Camera
from scene.errors import CalibrationError
from scene.frames import Frames, encode
from scene.lights import Lights
from scene.normals import angular_error_deg
from scene.spheres import Sphere, SphereRequest

REAL = Path(__file__).resolve().parents[1] / ".." / "shared" / "real"
FACING = 0.3
"""Cosine to the viewer below which a pixel of the matte ball counts as its limb."""
Array = NDArray[np.float64]


@dataclass(frozen=True)
class MatteBall:
    """A matte ball that is explained by lights.

    Parameters
    ----------
    pixels : (P, 2) int
        (u, v) of the ball's face.
    residual : (F, P) float64
        Measured minus Lambert's value with one albedo for the whole ball, over the ball's mean: NaN where the light is
        below the horizon or the pixel is clipped.
    error_deg : (P,) float64
        Least squares over the lit frames against the sphere's normals; NaN where fewer than three light a pixel.
    """

    pixels: NDArray[np.intp]
    residual: Array
    error_deg: Array

    @property
    def residual_percent(self) -> float:
        """Root mean square."""
        return 100 * float(np.sqrt(np.nanmean(self.residual**2)))

    @property
    def median_deg(self) -> float:
        return float(np.nanmedian(self.error_deg))


def explain(frames: Frames, camera: Camera, ball: Sphere, lights: Lights) -> MatteBall:
    """Hold a matte ball's pixels, and its normals by least squares, against the sphere under given lights."""
    rows, columns = np.nonzero(ball.mask(camera))
    normals, points = ball.normals(camera, np.stack([columns, rows], -1))
    view = [0.0, 0.0, 1.0] if camera.is_orthographic else -points / np.linalg.norm(points, axis=1, keepdims=True)
    face = np.sum(normals * view, 1) > FACING
    rows, columns, normals, points = rows[face], columns[face], normals[face], points[face]
    values = np.stack([frames.frame(f)[rows, columns].mean(-1) for f in range(len(frames))]).astype(np.float64)
    clipped = np.stack([frames.saturated(frames=[f])[0][rows, columns] for f in range(len(frames))])
    vectors = lights.at(points).mean(2)
    shading = np.einsum("fpi,pi->fp", vectors, normals)
    use = (shading > 0.1 * shading.max()) & ~clipped
    albedo = np.sum(values[use] * shading[use]) / np.sum(shading[use] ** 2)
    residual = np.where(use, values - albedo * shading, np.nan) / values[use].mean()
    # Least squares over the frames that light a pixel; with fewer than three there is no normal.
    lit = np.where(use, 1.0, 0.0)
    normal = np.einsum("fp,fpi,fpj->pij", lit, vectors, vectors)
    determined = (use.sum(0) >= 3) & (np.linalg.cond(normal) < 1e6)
    right = np.einsum("fp,fpi,fp->pi", lit, vectors, values)
    found = np.full_like(normals, np.nan)
    found[determined] = np.linalg.solve(normal[determined], right[determined][..., None])[..., 0]
    found /= np.linalg.norm(found, axis=1, keepdims=True)
    return MatteBall(np.stack([columns, rows], -1), residual, angular_error_deg(found, normals))


def need(*parts: str) -> Path:
    """Return a capture's folder.

    Raises
    ------
    FileNotFoundError
        The captures are not there; they are handed out beside the repository, not in it.
    """
    folder = REAL.joinpath(*parts)
    if not folder.is_dir():
        raise FileNotFoundError(f"{folder} is absent: the captures made by others are handed out beside the repository")
    return folder


def photographs(paths: list[Path], encoding: str = "linear") -> Frames:
    """Return 8 or 16-bit photographs, linear or sRGB, as linear frames."""
    import cv2

    images = []
    for path in paths:
        image = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
        assert image is not None, path
        image = np.repeat(image[..., None], 3, -1) if image.ndim == 2 else image[..., 2::-1]
        image = image / np.float32(np.iinfo(image.dtype).max)
        images.append(linear_from_srgb(image) if encoding == "srgb" else image)
    return Frames.from_linear(tuple(path.stem for path in paths), np.stack(images))


@dataclass(frozen=True)
class Washington:
    """University of Washington, psmImages: chrome and gray ball, each apart, 12 lights, 8 bits."""

    camera: Camera
    gray: Frames
    found: Calibration
    chrome_ball: Sphere
    gray_ball: Sphere
    given: Lights
    shaded: Array
    """(12, 3), by the gray ball's shading alone."""


def washington() -> Washington:
    """Calibrate psmImages from its chrome ball; the gray one is found, but tells no direction."""
    folder = need("uw_psm")

    def shots(name: str) -> Frames:
        return photographs([folder / "png" / name / f"{name}.{i}.png" for i in range(12)])

    camera, gray = Camera.orthographic(512, 340), shots("gray")
    requests = [SphereRequest("chrome", frames=shots("chrome")), SphereRequest("white", frames=gray)]
    found = calibrate(shots("buddha"), camera, requests)
    chrome_ball, gray_ball = (next(s for s in found.spheres if s.kind == kind) for kind in ("chrome", "white"))
    rows = np.loadtxt(folder / "lights.txt", skiprows=1)
    directions = rows / np.linalg.norm(rows, axis=1, keepdims=True)
    given = Lights(found.lights.names, directions, np.ones((12, 3)))
    shaded, _ = shading_directions(read_surface(gray, camera, gray_ball))
    return Washington(camera, gray, found, chrome_ball, gray_ball, given, shaded)


@dataclass(frozen=True)
class Harvard:
    """PSBox, LightProbe-1: one scratched chrome ball that fills the picture, 12 lights, 8-bit sRGB."""

    found: Calibration
    ball: Sphere  # its circle by hand
    given: Array  # (12, 3) directions from highlights that were marked by hand


def harvard() -> Harvard:
    """Find the ball and the lights."""
    folder = need("harvard_probe")
    frames = photographs(sorted(folder.glob("Image_*.JPG")), encoding="srgb")
    u, from_below, radius = np.loadtxt(folder / "circle_data.txt")
    ball = Sphere("chrome", np.array([u, frames.height - 1 - from_below]), float(radius))
    given = np.loadtxt(folder / "light_directions.txt").T
    found = calibrate(frames, Camera.orthographic(frames.width, frames.height), [SphereRequest("chrome")])
    return Harvard(found, ball, given / np.linalg.norm(given, axis=1, keepdims=True))


def mask_circle(path: Path) -> tuple[float, float, float]:
    """Return centre (u, v) and radius of a round mask."""
    import cv2

    mask = cv2.imread(str(path), cv2.IMREAD_GRAYSCALE)
    assert mask is not None, path
    rows, columns = np.nonzero(mask > 127)
    return (
        float(columns.min() + columns.max()) / 2,
        float(rows.min() + rows.max()) / 2,
        float(np.sqrt(len(rows) / np.pi)),
    )


@dataclass(frozen=True)
class DiligentBall:
    """DiLiGenT's ball, found as a ball: 96 known lights, 16 bits, ground truth normals."""

    camera: Camera
    frames: Frames
    ball: Sphere
    outline: tuple[float, float, float]
    by_itself: bool
    """False: told where it is."""
    found: Lights
    mirrored: Lights
    """By the highlights alone, as if it were chrome."""
    given: Lights
    truth: NDArray[np.float32]


def diligent_ball() -> DiligentBall:
    """Calibrate DiLiGenT's ball as if it were a white calibration ball, with its own lights put aside."""
    from align.registered_normals import read_normals

    folder = need("diligent", "ballPNG")
    frames = photographs(sorted(folder.glob("[0-9]*.png")))
    camera = Camera.orthographic(frames.width, frames.height)
    outline = mask_circle(folder / "mask.png")
    try:
        found = calibrate(frames, camera, [SphereRequest("white")])
    except CalibrationError:
        # Its gloss is four times as bright as its skin: it may be taken for a mirror.
        hint = SphereRequest("white", center_px=(round(outline[0]), round(outline[1])), radius_px=round(outline[2]))
        found, by_itself = calibrate(frames, camera, [hint]), False
    else:
        by_itself = True
    mirrored = calibrate(frames, camera, [SphereRequest("chrome")])
    return DiligentBall(
        camera,
        frames,
        found.spheres[0],
        outline,
        by_itself,
        found.lights,
        mirrored.lights,
        read_lights(folder / "light_directions.txt", frames.names),
        read_normals(folder / "Normal_gt.mat", frames.height, frames.width),
    )


@dataclass(frozen=True)
class Columbia:
    """Columbia's sphere: white, matte, 3 lights, 8 bits on a pedestal."""

    camera: Camera
    frames: Frames
    ball: Sphere
    found: Lights
    ambient_code: float
    """What the calibration found, 8-bit codes."""
    dark_code: float
    """What the frames show where there is nothing: their median, off the ball."""


def columbia() -> Columbia:
    """Calibrate Columbia's sphere from its shading; the dark beside it judges what is found of the pedestal.

    The set's frame 0, called ambient, is white all over the ball: it cannot be subtracted.
    """
    folder = need("columbia_sphere_object")
    frames = photographs([folder / f"sphere{i}.pgm" for i in (1, 2, 3)])
    camera = Camera.orthographic(640, 480)
    found = calibrate(frames, camera, [SphereRequest("white")])
    ball, ambient = found.spheres[0], found.lights.ambient
    pedestal = np.zeros(3) if ambient is None else ambient
    dark = frames.frame(0)[~ball.mask(camera, grow_px=20)]
    level = encode(np.broadcast_to(pedestal, (480, 640, 3)))
    return Columbia(
        camera,
        replace(frames, ambient=level),
        ball,
        found.lights,
        float(255 * pedestal.mean()),
        float(255 * np.median(dark)),
    )


@dataclass(frozen=True)
class Bunny:
    """A session rendered by a program that shares no code with this one: truth known, chrome and white beside it."""

    camera: Camera
    frames: Frames
    found: Calibration
    direction_error_deg: Array
    position_error_percent: Array
    intensity_error_percent: Array
    ball_error_px: Array


def bunny(scratch: Path) -> Bunny:
    """Calibrate the bunny session by its session.toml; its truth judges."""
    from capture.camera.session_camera import camera_of
    from capture.photographs.decode import decode
    from capture.session.requests import sphere_requests
    from capture.session.session import load_session
    from scene.store import Store

    folder = need("..", "sessions", "bunny")
    truth = json.loads((folder / "truth.json").read_text())
    positions = np.load(folder / "truth.npz")["light_positions_mm"]
    session, store = load_session(folder), Store(scratch)
    frames, report = decode(session, store)
    camera, _ = camera_of(session, report.exif, frames.width, frames.height)
    found = calibrate(frames, camera, sphere_requests(session, store)[0])
    center = np.array(truth["object_centre_mm"])
    lights = found.lights.seen_from(center)
    off = []
    for ball in truth["spheres"]:
        mine = min(found.spheres, key=lambda s: np.hypot(*(s.center_px - ball["centre_px"])))
        off.append([*(mine.center_px - ball["centre_px"]), mine.radius_px - ball["radius_px"]])
    distance = np.linalg.norm(positions - center, axis=1)
    placed = np.full((len(lights), 3), np.nan) if lights.positions_mm is None else lights.positions_mm
    return Bunny(
        camera,
        frames,
        found,
        angular_error_deg(lights.directions, np.array(truth["directions_at_object"])),
        100 * np.linalg.norm(placed - positions, axis=1) / distance,
        100 * (lights.intensities / np.array(truth["relative_intensity_rgb_at_object"]) - 1),
        np.array(off),
    )
