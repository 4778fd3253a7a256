"""An output folder as the steps leave it, made from closed forms: a bumpy ball, three calibration balls, 12 lights."""

import copy
import shutil
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest

from compare.compare import compare
from fixtures.lit_surfaces import flashes_at, gloss, lights_along, matte, spiral
from scene.camera import Camera
from scene.files import write_json, write_png
from scene.frames import Frames
from scene.lights import Lights
from scene.normals import unit
from scene.pose import Pose
from scene.spheres import Sphere
from scene.store import Store
from solve.solve import solve

NAME = "lab <script>alert(1)</script> & “penguin”"


@dataclass(frozen=True)
class Session:
    store: Store
    summary: dict[str, Any]


def lights_above(count: int, rng: np.random.Generator) -> Lights:
    """Return near lights 20 to 60 degrees from the axis, of unlike colours; the last one is flagged."""
    directions = spiral(np.cos(np.radians(20 + 40 * np.arange(count) / count)))
    reference = np.array([0.0, 0.0, -700.0])
    intensities = rng.uniform(0.7, 1.3, (count, 1)) * rng.uniform(0.95, 1.05, (count, 3))
    sigmas = {"direction_sigma_deg": rng.uniform(0.1, 0.5, count), "intensity_sigma": rng.uniform(0.004, 0.01, count)}
    flags = ((),) * (count - 1) + (("highlight near the rim",),)
    places = reference + directions * rng.uniform(800, 1100, (count, 1))
    return flashes_at(places, reference, intensities / intensities.mean(0), flags=flags, **sigmas)


def bumpy_ball(camera: Camera, center_px: np.ndarray, radius_px: float) -> tuple[np.ndarray, np.ndarray]:
    """Return normals (H, W, 3), NaN outside, and a smooth albedo (H, W, 3)."""
    grid = camera.grid()
    x, y = (grid[..., 0] - center_px[0]) / radius_px, -(grid[..., 1] - center_px[1]) / radius_px
    square = 1 - x * x - y * y
    z = np.sqrt(np.where(square > 0.02, square, np.nan))
    normals = np.stack([x + 0.25 * np.sin(9 * x), y + 0.25 * np.cos(8 * y), z], -1)
    shade = 0.45 + 0.15 * np.sin(5 * x) * np.cos(4 * y)
    return unit(normals), shade[..., None] * np.array([1.0, 0.85, 0.7])


def render(camera: Camera, lights: Lights, balls: list[Sphere], normals: np.ndarray, albedo: np.ndarray) -> np.ndarray:
    """Return (F, H, W, 3): matte object with a soft gloss and attached shadows, matte and mirror balls."""
    normals, known = np.nan_to_num(normals), np.isfinite(normals[..., :1])
    albedo, shine, power = np.where(known, albedo, 0), 0.25 * known, np.full(known.shape[:2], 30)
    for ball in balls:
        mask = ball.mask(camera)
        normals[mask] = ball.normals(camera, camera.grid()[mask])[0]
        albedo[mask], shine[mask] = (0.7, 0) if ball.kind == "white" else (0.02, 0.9)
        power[mask] = 900
    distant = lights_along(lights.directions, lights.intensities)
    glossy = shine * gloss(normals, lights.directions, power)[..., None] * lights.intensities[:, None, None]
    images = matte(distant, normals, normals, albedo) + glossy
    return 0.6 * np.where(images.any((0, -1))[..., None], images, 0.01)


@pytest.fixture(scope="session")
def session(tmp_path_factory: pytest.TempPathFactory) -> Session:
    """A whole output folder, and the summary that lab would write; tests read it and do not change it."""
    width, height, count, methods = 160, 120, 12, ("ls", "iterative")
    rng, folder = np.random.default_rng(5), tmp_path_factory.mktemp("session")
    store, twin = Store(folder), Store(folder / "twin")
    camera = Camera(width, height, 1.6 * width, 1.6 * width, 0.51 * width, 0.48 * height)
    lights = lights_above(count, rng)
    place = np.array([width, height])
    balls = [
        Sphere("chrome", place * [0.12, 0.22], 0.085 * width, 60.0, 0.08, 0.97),
        Sphere("chrome", place * [0.88, 0.8], 0.085 * width, 60.0, 0.11, 0.93),
        Sphere("white", place * [0.87, 0.2], 0.085 * width, 60.0, 0.21, 0.88),
    ]
    truth, albedo = bumpy_ball(camera, place * [0.48, 0.52], 0.26 * width)
    mask = np.isfinite(truth[..., 0])
    exact = render(camera, lights, balls, truth, albedo)
    noisy = np.clip(exact + rng.normal(0, 0.006, exact.shape), -0.02, None)
    store.save_frames(Frames.from_linear(lights.names, noisy))
    twin.save_frames(Frames.from_linear(lights.names, exact))
    store.save_camera(camera)
    store.save_spheres(balls, camera)
    store.save_lights(lights)
    store.save_pose(Pose(np.eye(4)), residual_px=0.62, sigma_mm=0.11, sigma_deg=0.21)
    store.save_mask(mask)
    store.save_truth(truth, np.where(mask, 0.4, np.nan))
    # What `align` draws; without it each report of a test would draw it, a fifth of a second long.
    write_png(store.path("align", "outline.png"), np.zeros((height, width, 3), np.uint8))
    seen: list[list[Any]] = []
    for ball in balls:
        row: list[Any] = [None] * count
        if ball.kind == "chrome":
            grid = camera.grid()[ball.mask(camera)]
            n, _ = ball.normals(camera, grid)
            half = unit(lights.directions + [0.0, 0.0, 1.0])
            row = [grid[np.argmax(n @ h)] for h in half]
            row[-1] = None
        seen.append(row)
    refused = {"center_px": [12.0, 100.0], "radius_px": 9.0, "reason": "its shading does not slide"}
    calibration = {"highlights_px": seen, "rejected": [refused], "evidence": [], "warnings": []}
    write_json(store.path("calibration.json"), calibration)
    solved: dict[str, Any] = {}
    for number, name in enumerate(methods):
        for where in (store, twin):
            where.save_estimate(solve(name, where.load_frames(), lights, camera, mask))
        megapixels = width * height / 1e6
        seconds = 0.05 * (1 + 7 * number)
        solved[name] = {
            "seconds": seconds, "megapixels": megapixels, "frames": count,
            "processor_seconds_per_megapixel_image": seconds / megapixels / count,
            "settings": {"shadow_share": 0.33, "passes": 5} if number else {},
            "warnings": [f"{name}: 3 pixels see fewer than four lit samples"] if number else [],
            "processor_seconds": 1.1 * seconds, "twin_processor_seconds": 0.9 * seconds,
        }  # fmt: skip
    summary: dict[str, Any] = {
        "name": NAME, "created": "2026-11-21T10:20:30+00:00",
        "versions": {"rgbn": "0.2.0", "numpy": np.__version__},
        "arguments": {"session": "session.toml", "methods": list(methods)},
        "seconds": {"decode": 1.25, "calibrate": 8.5, "align": 12.0, "solve": 0.75, "twin": 20.5},
        "warnings": [
            {"step": "check", "text": "flash_012: 2.1 % of the object is clipped"},
            {"step": "calibrate", "text": "ball 2: <b>no highlight</b> in flash_012"},
            {"step": "solve", "text": "iterative: 3 pixels see fewer than four lit samples"},
        ],
        "capture": {
            "frames": count, "width": width, "height": height, "ambient": True,
            "frames_table": [
                {"name": name, "brightness": float(noisy[i].mean()), "saturated_share": float((noisy[i] > 0.98).mean())}
                for i, name in enumerate(lights.names)
            ],
        },
        "camera": store.read_json("camera.json"),
        "calibrate": {
            "model": "near", "spheres": 3, "evidence": ["near: chi2 per degree of freedom 1.1 against 37 for distant"],
            "direction_sigma_deg_median": float(np.median(lights.direction_sigma_deg)),
            "intensity_sigma_median": float(np.median(lights.intensity_sigma)),
        },
        "align": {
            "residual_px": 0.62, "sigma_mm": 0.11, "sigma_deg": 0.21, "truth_sigma_deg_median": 0.4,
            "evidence": ["3 starts of 40 reached the same pose"],
        },
        "solve": {"methods": solved}, "results": {"files": ["results/normals_ls.tif"]},
        "twin": {"engine": "many", "reason": "light went on", "seconds": 20.5, "warnings": []},
        "truth_check": {"light direction, median": {"value": 0.31, "unit": "°", "bar": 1.0}},
    }  # fmt: skip
    summary["compare"] = compare(store)
    return Session(store, summary)


@pytest.fixture
def copied(session, tmp_path):
    """A copy of the folder and of the summary, to be changed."""
    return Store(shutil.copytree(session.store.folder, tmp_path / "out")), copy.deepcopy(session.summary)
