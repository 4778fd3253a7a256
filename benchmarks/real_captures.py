"""Balls in photographs that nobody here made: what is found without a click, against circles and lights by others.

Where a matte ball stood under the same flashes, it judges too: the lights that a mirror shows must explain its pixels
by Lambert's law on the analytic sphere, and least squares on its pixels must give the sphere's own normals. Nothing of
that is used by the calibration itself.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from benchmarks.calibration import is_same
from benchmarks.harness import SHARED, Figures, Table, markdown
from calibrate.calibrate import calibrate
from calibrate.calibration import Calibration
from calibrate.known_lights.read_known import read_lights
from calibrate.photometry.matte_shading import read_surface, shading_directions
from formats.picture_files import linear_from_srgb
from scene.camera import Camera
from scene.frames import Frames, encode
from scene.lights import Lights
from scene.normals import angular_error_deg, unit
from scene.spheres import Kind, Sphere, SphereRequest

REAL = SHARED / "real"
FACING = 0.3
"""Cosine to the viewer below which a pixel of the matte ball counts as its limb."""
PSDATA_SIZE = (3888, 2592)
"""Of the photographs of which PSData's files are cut out, pixels."""
Array = NDArray[np.float64]


@dataclass(frozen=True)
class Capture:
    """Photographs, what `calibrate` makes of them, and what others say of them.

    Parameters
    ----------
    frames : Frames
        Of the matte ball where one is judged, else of the chrome balls.
    camera : Camera
    found : Calibration
    by_hand : tuple of Sphere
        The balls' circles, of masks or points that somebody drew.
    references : dict of (F, 3) float64
        Unit directions of the lights, by their source.
    matte : Sphere or None
        The matte ball, as found.
    strengths : (F, 3) float64 or None
        The lights' intensities as the set gives them.
    """

    frames: Frames
    camera: Camera
    found: Calibration
    by_hand: tuple[Sphere, ...]
    references: dict[str, Array]
    matte: Sphere | None = None
    strengths: Array | None = None


class Explained(NamedTuple):
    """How well lights explain a matte ball: rms residual in percent of its mean; its normals' median error."""

    residual_percent: float
    normals_deg: float


def explain(frames: Frames, camera: Camera, ball: Sphere, lights: Lights) -> Explained:
    """Hold a matte ball's pixels, and its normals by least squares, against the sphere under given lights.

    One albedo for the whole ball. The limb, clipped pixels and those whose light is at the horizon are left out; no
    normal where fewer than three lights are left.
    """
    rows, columns = np.nonzero(ball.mask(camera))
    normals, points = ball.normals(camera, np.stack([columns, rows], -1))
    view = [0.0, 0.0, 1.0] if camera.is_orthographic else -unit(points)
    face = np.sum(normals * view, 1) > FACING
    rows, columns, normals, points = rows[face], columns[face], normals[face], points[face]
    values = np.stack([frames.frame(f)[rows, columns].mean(-1) for f in range(len(frames))]).astype(np.float64)
    clipped = np.stack([frames.saturated(frames=[f])[0][rows, columns] for f in range(len(frames))])
    vectors = lights.at(points).mean(2)
    shading = np.einsum("fpi,pi->fp", vectors, normals)
    use = (shading > 0.1 * shading.max()) & ~clipped
    albedo = np.sum(values[use] * shading[use]) / np.sum(shading[use] ** 2)
    residual = (values - albedo * shading)[use] / values[use].mean()
    normal = np.einsum("fp,fpi,fpj->pij", use.astype(float), vectors, vectors)
    known = (use.sum(0) >= 3) & (np.linalg.cond(normal) < 1e6)
    right = np.einsum("fp,fpi,fp->pi", use.astype(float), vectors, values)
    found = unit(np.linalg.solve(normal[known], right[known][..., None])[..., 0])
    error = np.median(angular_error_deg(found, normals[known]))
    return Explained(100 * float(np.sqrt(np.mean(residual**2))), float(error))


def photographs(paths: Sequence[Path], encoding: Literal["linear", "srgb"] = "linear") -> Frames:
    """Return 8 or 16-bit photographs as linear frames."""
    return Frames.from_linear(tuple(path.stem for path in paths), np.stack([_read(path, encoding) for path in paths]))


def _read(path: Path, encoding: str) -> NDArray[np.float32]:
    import cv2

    image = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
    assert image is not None, path
    image = np.repeat(image[..., None], 3, -1) if image.ndim == 2 else image[..., 2::-1]
    image = image / np.float32(255 if image.dtype == np.uint8 else 65_535)
    return linear_from_srgb(image) if encoding == "srgb" else image


def mask_circle(path: Path, kind: Kind) -> Sphere:
    """Return the ball whose round mask this is."""
    rows, columns = np.nonzero(_read(path, "linear")[..., 0] > 0.5)
    center = np.array([columns.min() + columns.max(), rows.min() + rows.max()]) / 2
    return Sphere(kind, center, float(np.sqrt(len(rows) / np.pi)))


def washington() -> Capture:
    """Calibrate psmImages by its chrome ball, photographed apart, as all its things; its gray one is matte."""
    folder = REAL / "uw_psm" / "png"

    def shots(name: str) -> Frames:
        return photographs([folder / name / f"{name}.{i}.png" for i in range(12)])

    camera, gray = Camera.orthographic(512, 340), shots("gray")
    requests = [SphereRequest("chrome", frames=shots("chrome")), SphereRequest("white", frames=gray)]
    found = calibrate(shots("buddha"), camera, requests)
    matte = next(ball for ball in found.spheres if ball.kind == "white")
    shaded, _ = shading_directions(read_surface(gray, camera, matte))
    by_hand = (
        mask_circle(folder / "chrome/chrome.mask.png", "chrome"),
        mask_circle(folder / "gray/gray.mask.png", "white"),
    )
    given = unit(np.loadtxt(folder.parent / "lights.txt", skiprows=1))
    return Capture(gray, camera, found, by_hand, {"the gray ball's shading": shaded, "its lights.txt": given}, matte)


def diligent_ball(kind: Kind) -> Capture:
    """Calibrate DiLiGenT's glossy ball by its shading, or as "chrome" by its highlights; its lights are put aside."""
    folder = REAL / "diligent" / "ballPNG"
    frames = photographs(sorted(folder.glob("[0-9]*.png")))
    camera = Camera.orthographic(frames.width, frames.height)
    found = calibrate(frames, camera, [SphereRequest(kind)])
    given, matte = read_lights(folder / "light_directions.txt", frames.names), replace(found.spheres[0], kind="white")
    by_hand = (mask_circle(folder / "mask.png", kind),)
    return Capture(frames, camera, found, by_hand, {"the set's": given.directions}, matte, given.intensities)


def columbia() -> Capture:
    """Calibrate Columbia's white sphere by its shading.

    The set's frame 0, called ambient, is white all over the ball: it cannot be subtracted. The pedestal of some 75
    codes is found as ambient light, and is subtracted from the frames that are returned.
    """
    folder = REAL / "columbia_sphere_object"
    frames, camera = photographs([folder / f"sphere{i}.pgm" for i in (1, 2, 3)]), Camera.orthographic(640, 480)
    found = calibrate(frames, camera, [SphereRequest("white")])
    pedestal = np.zeros(3) if found.lights.ambient is None else found.lights.ambient
    frames = replace(frames, ambient=encode(np.broadcast_to(pedestal, (frames.height, frames.width, 3))))
    by_eye = (Sphere("white", np.array([368.0, 220.5]), 78.5),)
    return Capture(frames, camera, found, by_eye, {}, found.spheres[0])


def harvard() -> Capture:
    """Calibrate PSBox's LightProbe-1: one scratched chrome ball that fills the picture; v is counted from below."""
    folder = REAL / "harvard_probe"
    frames = photographs(sorted(folder.glob("Image_*.JPG")), "srgb")
    u, from_below, radius = np.loadtxt(folder / "circle_data.txt")
    by_hand = (Sphere("chrome", np.array([u, frames.height - 1 - from_below]), float(radius)),)
    camera = Camera.orthographic(frames.width, frames.height)
    given = unit(np.loadtxt(folder / "light_directions.txt").T)
    found = calibrate(frames, camera, [SphereRequest("chrome")])
    return Capture(frames, camera, found, by_hand, {"highlights by hand": given})


def psdata(name: str) -> Capture:
    """Calibrate a PSData capture by its two chrome balls, each in its place in the whole photograph, at half the size.

    Boxes are x0 x1 y0 y1, counted from 1, y from below; circles are u, v from below, radius within their box.
    """
    import cv2

    folder, (width, height) = REAL / f"psdata_{name}", PSDATA_SIZE
    probes, by_hand = {}, []
    for number, box in enumerate(np.loadtxt(folder / "ManualData" / "probes_bbox.txt").astype(int), 1):
        probe, (left, right, low, high) = folder / f"LightProbe-{number}", box
        rows, columns = probes[probe] = slice(height - high, height - low + 1), slice(left - 1, right)
        u, from_below, radius = np.loadtxt(probe / "circle_data.txt").ravel()
        center = np.array([columns.start + u - 1, rows.stop - from_below]) / 2
        by_hand.append(Sphere("chrome", center, float(radius) / 2))
    paths, images = sorted((folder / "LightProbe-1").glob("Image_*.JPG")), []
    for path in paths:
        whole = np.zeros((height, width, 3), np.float32)
        for probe, place in probes.items():
            whole[place] = _read(probe / path.name, "srgb")
        images.append(cv2.resize(whole, (width // 2, height // 2), interpolation=cv2.INTER_AREA))
    frames = Frames.from_linear(tuple(path.stem for path in paths), np.stack(images))
    camera = Camera.orthographic(frames.width, frames.height)
    found = calibrate(frames, camera, 2 * [SphereRequest("chrome")])
    by_hand_lights, refined = (
        unit(np.array((folder / file).read_text().replace(",", " ").split(), float).reshape(3, -1).T)
        for file in ("light_directions.txt", "refined_light.txt")
    )
    references = {"highlights by hand, two balls": by_hand_lights, "these, refined by the set": refined}
    return Capture(frames, camera, found, tuple(by_hand), references)


CAPTURES: dict[str, Callable[[], Capture]] = {
    "Columbia, white sphere, 3 lights": columbia,
    "Washington, chrome and gray ball, 12": washington,
    "DiLiGenT's ball by its shading, 96": lambda: diligent_ball("white"),
    "DiLiGenT's ball by its highlights, 96": lambda: diligent_ball("chrome"),
    "Harvard, one chrome ball, 12": harvard,
    "Harvard, pig, two chrome balls, 20": lambda: psdata("pig"),
    "Harvard, scholar, two chrome balls, 20": lambda: psdata("scholar"),
}


@dataclass(frozen=True)
class CaptureRow:
    """One capture against one reference. None: not to be had.

    `off_px`: of the balls found, radius. `residual_percent`, `normals_deg`: of the matte ball under the lights found;
    with `given_`, under the reference's.
    """

    capture: str
    by_hand: int
    off_px: tuple[float, ...]
    reference: str
    median_deg: float | None
    worst_deg: float | None
    sigma_deg: float | None
    residual_percent: float | None
    normals_deg: float | None
    given_residual_percent: float | None
    given_normals_deg: float | None
    warnings: int


def _measured(name: str) -> list[CaptureRow]:
    one = CAPTURES[name]()
    lights, sigma = one.found.lights, one.found.lights.direction_sigma_deg
    pairs = [(ball, hand) for hand in one.by_hand for ball in one.found.spheres if is_same(ball, hand)]
    off = tuple(float(ball.radius_px - hand.radius_px) for ball, hand in pairs)

    def judged(by: Lights | None) -> tuple[float, float] | tuple[None, None]:
        return (None, None) if by is None or one.matte is None else explain(one.frames, one.camera, one.matte, by)

    def row(reference: str, directions: Array | None) -> CaptureRow:
        median, worst, given = None, None, None
        if directions is not None:
            error = angular_error_deg(lights.directions, directions)
            median, worst = float(np.median(error)), float(np.max(error))
            strengths = np.ones((len(lights), 3)) if one.strengths is None else one.strengths
            given = Lights(lights.names, directions, strengths)
        return CaptureRow(
            name, len(one.by_hand), off, reference, median, worst, None if sigma is None else float(np.median(sigma)),
            *judged(lights), *judged(given), len(one.found.warnings),
        )  # fmt: skip

    return [row(*one) for one in one.references.items()] or [row("", None)]


def _figures(rows: Sequence[CaptureRow]) -> Figures:
    found: Figures = {}
    for row in rows:
        name = ", against ".join(filter(None, (row.capture, row.reference)))
        for key in ("median_deg", "sigma_deg", "residual_percent", "normals_deg"):
            value = getattr(row, key)
            found |= {} if value is None else {f"{name}: {key}": value}
        found[f"{row.capture}: balls"] = float(len(row.off_px))
    return found


TABLES = (
    Table(
        "real-captures", "captures", ("calibrate.calibrate",), CaptureRow,
        lambda scale: [(name,) for name in list(CAPTURES)[: {"small": 1, "gates": 2, "full": None}[scale]]], _measured,
        lambda rows: markdown(
            {
                "capture": "{capture}", "balls found": "{found} of {by_hand}", "radius off by, px": "{off}",
                "lights against": "{reference}", "median": "{median_deg:.2f}°", "worst": "{worst_deg:.2f}°",
                "stated sigma": "{sigma_deg:.2f}°",
                "matte ball's normals": "{normals_deg:.2f}°", "under the reference": "{given_normals_deg:.2f}°",
            },
            [
                vars(row) | {"found": len(row.off_px), "off": ", ".join(f"{value:+.1f}" for value in row.off_px)}
                for row in rows
            ],
        ),
        _figures, needs=(REAL,),
    ),
)  # fmt: skip
