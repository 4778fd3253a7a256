"""How other tools turn a ball into a light, on the same photographs as `calibrate`.

The models are written from what is known of the tools. Each is given what its user would give it, and a little more:
outlines as good as patient clicks, a picture developed without tone curve, white balanced so that a clipped highlight
is white. Directions are in the camera frame; NaN where a tool finds no highlight. Meshroom's model is as orthographic
as PSBox's, on whole pixels, and is left out.
"""

import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from benchmarks.calibration import read_truth, scenes_of
from benchmarks.calibration_sessions import OBJECT, directions_to, reflection_points
from benchmarks.harness import SHARED, Figures, Scale, Table, markdown, opened, spread
from calibrate.calibrate import calibrate
from fixtures.ball_scene import World, photograph
from lab.plan import STEPS
from scene.camera import Camera
from scene.frames import Frames
from scene.lights import Lights
from scene.normals import angular_error_deg, unit
from scene.spheres import Sphere
from twin.camera.virtual_camera import Sensor

Array = NDArray[np.float64]
TOWARD_CAMERA = np.array([0.0, 0.0, 1.0])
OFF_AXIS_MM, FOCAL_PX, LIGHTS = (0.0, 100.0, 200.0, 300.0), 8333.0, 24
"""Of a ball at 1 m in a picture of 6000 x 4000 pixels."""


@dataclass(frozen=True)
class Patch:
    """One ball's box in every frame: white-balanced linear RGB (F, h, w, 3) in 0..1, and its first column and row."""

    values: NDArray[np.float32]
    left: int
    top: int

    @property
    def grid(self) -> tuple[Array, Array]:
        """Columns and rows (h, w) of its pixels in the picture."""
        v, u = np.mgrid[0 : self.values.shape[1], 0 : self.values.shape[2]].astype(float)
        return u + self.left, v + self.top


def patch_of(frames: Frames, camera: Camera, sphere: Sphere, neutral: Sequence[float]) -> Patch:
    """Cut out a ball with a margin of three pixels."""
    outline = sphere.outline(camera)
    left, top = np.maximum(np.floor(outline.min(0)).astype(int) - 3, 0)
    right, bottom = np.ceil(outline.max(0)).astype(int) + 4
    values = frames.read(slice(top, bottom), columns=slice(left, right)) / np.array(neutral, np.float32)
    return Patch(np.clip(values, 0, 1), int(left), int(top))


def clicks(camera: Camera, sphere: Sphere, rng: np.random.Generator, *, count: int, sigma_px: float) -> Array:
    """Return (count, 2) points that a user clicks on the ball's outline."""
    outline = sphere.outline(camera, 3600)
    chosen = (rng.uniform(0, 3600 / count) + np.arange(count) * 3600 / count).astype(int) % 3600
    return outline[chosen] + rng.normal(0, sigma_px, (count, 2))


def circle_through(points: Array) -> Array:
    """Return centre and radius (3,) of the circle that fits points best."""
    a, b, c = np.linalg.lstsq(np.column_stack([2 * points, np.ones(len(points))]), np.sum(points**2, 1), rcond=None)[0]
    start = [a, b, np.sqrt(c + a * a + b * b)]
    return least_squares(lambda p: np.hypot(*(points - p[:2]).T) - p[2], start).x


def _orthographic(pixels: Array, circle: Array) -> Array:
    """Return the light (F, 3) by the law of the mirror: the normal of a disc's pixel, the view along the axis."""
    x, y = (pixels - circle[:2]).T / circle[2] * [[1.0], [-1.0]]
    with np.errstate(invalid="ignore"):
        normal = np.stack([x, y, np.sqrt(1 - x * x - y * y)], -1)
    return 2 * (normal @ TOWARD_CAMERA)[:, None] * normal - TOWARD_CAMERA


def psbox(patch: Patch, camera: Camera, sphere: Sphere, rng: np.random.Generator) -> Array:
    """Orthographic: a circle through 12 good clicks (half a pixel), the median pixel of 250 and more of 255."""
    circle = circle_through(clicks(camera, sphere, rng, count=12, sigma_px=0.5))
    u, v = patch.grid
    inside = np.hypot(u - circle[0], v - circle[1]) < circle[2]
    out = np.full((len(patch.values), 2), np.nan)
    for f, image in enumerate(np.round(255 * patch.values.mean(-1))):
        bright = inside & (image >= 250)
        if bright.any():
            out[f] = np.median(u[bright]), np.median(v[bright])
    return _orthographic(out, circle)


def relightlab(patch: Patch, camera: Camera, sphere: Sphere, rng: np.random.Generator) -> tuple[Array, Array]:
    """Perspective: the sphere by 6 clicks (one pixel), a thresholded centroid in 8-bit sRGB.

    The clicks are fitted by the ellipses that a sphere can have, three numbers: kinder than a free ellipse. Returns
    points on the ball (F, 3) and directions (F, 3).
    """
    points = clicks(camera, sphere, rng, count=6, sigma_px=1.0)

    def off(p: Array) -> Array:
        # Pixels between a click and the outline: the angle to the axis against the cone's half angle.
        one = Sphere("chrome", p[:2], float(p[2]), sphere.diameter_mm)
        center = one.center_mm(camera)
        _, rays = camera.rays(points)
        angle = np.arccos(np.clip(rays @ center / np.linalg.norm(center), -1, 1))
        return (angle - np.arcsin(one.radius_mm / np.linalg.norm(center))) * camera.fx

    x, y, radius = least_squares(off, circle_through(points)).x
    fitted = Sphere("chrome", np.array([x, y]), float(radius), sphere.diameter_mm)
    normals, places = fitted.normals(camera, _thresholded_centroids(patch, fitted))
    view = -unit(places)
    return places, 2 * np.sum(normals * view, 1, keepdims=True) * normals - view


def _thresholded_centroids(patch: Patch, sphere: Sphere) -> Array:
    """Lower a threshold from 240 by tens until 0.5 % of the inner box is found; then halve a window six times.

    The threshold stops at 127, where the tool says "shadow": a small flash never fills 0.5 %, and lower down everything
    is found.
    """
    half = int(sphere.radius_px * np.sin(np.deg2rad(50)))
    column, row = (int(c) for c in np.round(sphere.center_px - [patch.left, patch.top]))
    rows, columns = slice(max(row - half, 0), row + half + 1), slice(max(column - half, 0), column + half + 1)
    out = np.full((len(patch.values), 2), np.nan)
    for f, image in enumerate(patch.values):
        gray = image[rows, columns].mean(-1)
        coded = np.round(255 * np.where(gray <= 0.0031308, 12.92 * gray, 1.055 * gray ** (1 / 2.4) - 0.055))
        if coded.max() < 127:
            continue
        threshold = 240
        while (coded > threshold).mean() < 0.005 and threshold > 130:
            threshold -= 10
        v, u = np.nonzero(coded > threshold)
        at, size = np.array([u.mean(), v.mean()]), float(half)
        for _ in range(6):
            near = (np.abs(u - at[0]) <= size) & (np.abs(v - at[1]) <= size)
            if not near.any():
                break
            at = np.array([u[near].mean(), v[near].mean()])
            size /= 2
        out[f] = at + [columns.start + patch.left, rows.start + patch.top]
    return out


def intersected(points: Array, directions: Array) -> Array:
    """Return the lights (F, 3) nearest to every ball's ray, points and directions (S, F, 3); then RelightLab's rule:

    what stands more than 10 % nearer or farther than the median light is moved to the median distance.
    """
    out = np.full(points.shape[1:], np.nan)
    for f in range(points.shape[1]):
        good = np.isfinite(directions[:, f]).all(-1)
        if good.sum() >= 2:
            p, d = points[good, f], directions[good, f]
            across = np.eye(3) - d[:, :, None] * d[:, None, :]
            out[f] = np.linalg.solve(across.sum(0), np.einsum("sij,sj->i", across, p))
    middle = np.nanmean(points, axis=(0, 1))
    distance = np.linalg.norm(out - middle, axis=1)
    median = np.nanmedian(distance)
    wrong = np.abs(distance / median - 1) > 0.1
    out[wrong] = middle + (out[wrong] - middle) * (median / distance[wrong])[:, None]
    return out


@dataclass(frozen=True)
class PeerRow:
    """One tool on one session: errors of each light, NaN where it found none; positions in percent of the distance."""

    setting: str
    session: str
    tool: str
    direction_deg: tuple[float, ...]
    position_percent: tuple[float, ...]


def _judged(
    setting: str, name: str, frames: Frames, camera: Camera, balls: Sequence[Sphere], lights_mm: Array, found: Lights,
    *, neutral: Sequence[float] = (1, 1, 1), points: Array | None = None,
) -> list[PeerRow]:  # fmt: skip
    """Hold all tools against the lights' true places, at `points` or where `calibrate` says that directions hold.

    PSBox averages its balls' directions, RelightLab intersects their rays.
    """
    rng, chrome = np.random.default_rng([len(name), 11]), [ball for ball in balls if ball.kind == "chrome"]
    patches = [(patch_of(frames, camera, ball, neutral), camera, ball) for ball in chrome]
    rays = [relightlab(*one, rng) for one in patches]
    at = found.reference_point_mm if points is None else points
    places = {"RelightLab": intersected(*np.stack(rays, 1))} if len(chrome) > 1 else {}
    directions = {
        "PSBox, select-ball": unit(np.mean([psbox(*one, rng) for one in patches], 0)),
        "RelightLab": directions_to(places["RelightLab"], at) if places else rays[0][1],
        "rgbn": found.directions,
    }
    if found.positions_mm is not None:
        places["rgbn"] = found.positions_mm
    truth, away = directions_to(lights_mm, at), np.linalg.norm(lights_mm - at, axis=1)
    off = {tool: 100 * np.linalg.norm(place - lights_mm, axis=1) / away for tool, place in places.items()}
    return [
        PeerRow(setting, name, tool, tuple(angular_error_deg(ways, truth)), tuple(off.get(tool, ())))
        for tool, ways in directions.items()
    ]


def _others(folder: str) -> list[PeerRow]:
    """Return the tools on a session that somebody else's program rendered."""
    scene, truth = Path(folder), read_truth(Path(folder))
    place = scene / "asked" if (scene / "asked").is_dir() else scene
    with tempfile.TemporaryDirectory() as out, opened(place, Path(out)) as job:
        job.run(STEPS, "calibrate")
        store = job.store
        given = store.load_frames(), store.load_camera(), truth.balls, truth.lights_mm, store.load_lights()
        return _judged("two balls or more, rendered by others", scene.name, *given)


def _off_axis(offset_mm: float, seed: int, count: int) -> list[PeerRow]:
    """Return the tools on one ball of 167 px `offset_mm` off the axis at 1 m, a window of the whole picture.

    Flashes 0.7 to 1.5 m from the middle, 25 to 80 degrees over the table; against the direction where it reflects.
    """
    rng = np.random.default_rng([seed, int(offset_mm)])
    full = Camera(6000, 4000, FOCAL_PX, FOCAL_PX, 2999.5, 1999.5)
    turn = rng.uniform(0, 2 * np.pi) if offset_mm < 250 else 0.0
    x, y = offset_mm * np.cos(turn), offset_mm * np.sin(turn)
    left, top = np.clip(np.round(full.project([x, y, -1000.0])).astype(int) - [300, 280], 0, [5400, 3440])
    camera = Camera(600, 560, FOCAL_PX, FOCAL_PX, full.cx - left, full.cy - top)
    azimuth, height = rng.uniform(0, 2 * np.pi, count), np.deg2rad(rng.uniform(25, 80, count))
    way = np.stack([np.cos(height) * np.cos(azimuth), np.cos(height) * np.sin(azimuth), np.sin(height)], -1)
    lights = OBJECT + way * rng.uniform(700, 1500, count)[:, None]
    table = np.array([0.0, 0.0, -1020.0]), np.array([0.0, 0.0, 1.0])
    world = World(camera, [], lights, np.full((count, 3), 0.35), *table, ambient=0.005).stand("chrome", x, y, 20.0)
    frames, sensor = photograph(world, Sensor(), np.random.default_rng([seed, 3])), Sensor()
    found, points = (
        calibrate(frames, camera, world.requests()).lights,
        reflection_points(camera, world.balls[0], lights),
    )
    setting = f"one ball, {np.degrees(np.arctan(offset_mm / 1000)):.1f}° off the axis, virtual"
    given = frames, camera, world.spheres(), lights, found
    return _judged(setting, f"seed {seed}", *given, neutral=sensor.neutral, points=points)


def _measured(what: str, *case: Any) -> list[PeerRow]:
    return {"others": _others, "off axis": _off_axis}[what](*case)


def _cases(scale: Scale) -> list[tuple]:
    if scale == "small":
        return [("off axis", 0.0, 0, 3)]
    handed = [("others", str(one)) for one in scenes_of(SHARED / "sessions")]
    if scale == "gates":
        return [*handed[:1], ("off axis", OFF_AXIS_MM[-1], 0, 8)]
    off = [("off axis", offset, seed, LIGHTS) for offset in OFF_AXIS_MM for seed in range(2)]
    return [*handed, *off]


def _pooled(rows: Sequence[PeerRow]) -> dict[tuple[str, str], tuple[list[float], list[float]]]:
    """Return errors of directions and of positions by setting and tool."""
    pooled: dict[tuple[str, str], tuple[list[float], list[float]]] = {}
    for row in rows:
        direction, position = pooled.setdefault((row.setting, row.tool), ([], []))
        direction.extend(row.direction_deg)
        position.extend(row.position_percent)
    return pooled


def _shown(rows: Sequence[PeerRow]) -> str:
    pooled = _pooled(rows)
    lines = {setting: {"setting": setting} for setting, _ in pooled}
    for (setting, tool), (direction, position) in pooled.items():
        lost = np.isnan(direction).mean()
        lines[setting][tool] = spread(direction) + (f", {lost:.0%} lost" if lost else "")
        lines[setting][f"{tool} position"] = spread(position)
    tools = dict.fromkeys(row.tool for row in rows)
    heads = {tool: f"{{{tool}}}" for tool in tools}
    heads |= {f"position, % of the distance: {tool}": f"{{{tool} position}}" for tool in ("RelightLab", "rgbn")}
    return markdown({"direction, degrees: median / p95": "{setting}", **heads}, lines.values())


def _figures(rows: Sequence[PeerRow]) -> Figures:
    return {f"{setting}: {tool}, median_deg": float(np.nanmedian(direction))
            for (setting, tool), (direction, _) in _pooled(rows).items()}  # fmt: skip


TABLES = (
    Table("calibration", "peers", ("calibrate.calibrate",), PeerRow, _cases, _measured, _shown, _figures),
)  # fmt: skip
