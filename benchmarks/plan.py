"""What `rgbn plan` says before a shoot, against shoots by the virtual camera: the sigma, and where to put the flashes.

A shoot: balls on a table, path-traced mirrors of it, a mesh with cast shadows and gloss, a Bayer sensor's noise. Seeds
31 to 40 are the page's; develop on others.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from benchmarks.harness import Table, markdown
from calibrate.calibrate import calibrate
from experiments.shapes import SHAPES
from fixtures.ball_scene import World, develop, radiance
from lab.shoot.ball_places import light_sigmas, stand_balls
from lab.shoot.flash_places import Reach
from lab.shoot.flash_samples import ObjectPixels, lights_at, pixels_of
from lab.shoot.set_up import GLOSSES, SetUp
from lab.shoot.shoot_plan import joint_covariance, light_slopes, plan_shoot, predict
from scene.camera import Camera
from scene.frames import Frames
from scene.lights import Lights
from scene.mesh import Mesh
from scene.normals import angular_error_deg, unit
from scene.spheres import Kind, Sphere
from solve.solve import solve
from twin.camera.virtual_camera import Sensor
from twin.material.reflection_models import coat, reflected
from twin.visibility import Sight

Array = NDArray[np.float64]
WIDTH, HEIGHT, DISTANCE_MM = 480, 320, 1000.0
CAMERA = Camera(WIDTH, HEIGHT, 1.6 * WIDTH, 1.6 * WIDTH, WIDTH / 2 - 0.5, HEIGHT / 2 - 0.5)
EXPOSURE = 0.55
"""Value of a surface of reflectance 1 facing the mean flash: the white ball stays below white under all."""
FACING = 0.3
"""Cosine to the viewer from which a pixel's normal is judged."""
HAND_MM = 6.0
"""Standard deviation of a flash beside its planned place, and of a ball beside its own."""
WITHIN = 0.2
"""How far a predicted sigma may be off to be called right."""
FAR_MM, DIRECTION_DEG = 30_000.0, 0.1
"""Flashes whose places are compared: so far that no method has to know the object's depth; what is unknown of each."""
COUNTS, REPEATS, PIXELS = (4, 6, 8, 12, 16, 24), 3, 2500
"""Of flashes, the last as an even dome to be reached with fewer; draws of noise; of the object."""


@dataclass(frozen=True)
class Case:
    """A set-up to be predicted, and photographed again and again.

    `shape`: of `experiments.shapes.SHAPES`. `layout` of the flashes: a dome, a ring, drawn at random, by `plan_shoot`.
    """

    name: str
    shape: str
    layout: Literal["dome", "ring", "random", "plan"]
    flashes: int
    seed: int
    chrome_mm: tuple[float, ...] = (60.0, 60.0, 60.0)
    iso: float = 400.0
    gloss: str = "matte"
    albedo: float = 0.5
    size_mm: float = 120.0
    relief: float = 0.6
    flash_mm: float = 900.0

    @cached_property
    def set_up(self) -> SetUp:
        """Object, camera, noise."""
        shape = SHAPES[self.shape](self.relief)
        mesh = Mesh(shape.vertices * self.size_mm / 2, np.asarray(shape.faces, np.int64))
        mesh = Mesh(mesh.vertices + [0, 0, -DISTANCE_MM] - mesh.center_mm, mesh.faces)
        sensor = Sensor(iso=self.iso)
        return SetUp(CAMERA, mesh, sensor, self.gloss, self.albedo, white_value=EXPOSURE, is_mosaic=True)

    def places(self, layout: str, count: int) -> Array:
        """Return where flashes of a layout stand, (F, 3) mm."""
        middle, size = self.set_up.middle_mm, self.set_up.size_mm
        reach = Reach("ring" if layout == "ring" else "dome", to_deg=62.0, distance_mm=self.flash_mm)
        if layout == "plan":
            return plan_shoot(pixels_of(self.set_up), self.spheres, reach, count, look_ahead=0).positions_mm[:count]
        if layout == "random":
            rng, every = np.random.default_rng([self.seed, 1]), reach.positions(middle, size, 200)
            return rng.permutation(every)[:count]
        return reach.positions(middle, size, count)[:count]

    @cached_property
    def spheres(self) -> list[Sphere]:
        """Where the balls are to stand."""
        kinds: list[tuple[Kind, float]] = [*(("chrome", one) for one in self.chrome_mm), ("white", 60.0)]
        return stand_balls(self.set_up, self.places("dome", 60), kinds)

    @cached_property
    def positions(self) -> Array:
        """(F, 3) where the flashes are to be."""
        return self.places(self.layout, self.flashes)

    @cached_property
    def seen(self) -> tuple[NDArray[np.bool_], ObjectPixels]:
        """The object's mask (H, W), and its pixels."""
        mesh = self.set_up.mesh
        face, weights, points = Sight(mesh, CAMERA, Lights.unknown(())).at(CAMERA.grid())
        mask = face >= 0
        normals = unit(np.einsum("pc,pck->pk", weights[mask], mesh.vertex_normals[mesh.faces[face[mask]]]))
        albedo = np.full(len(normals), self.albedo)
        return mask, ObjectPixels(self.set_up, points[mask], normals, mesh.face_normals[face[mask]], albedo)

    @cached_property
    def judged(self) -> tuple[NDArray[np.bool_], ObjectPixels]:
        """The same of the pixels whose normals are judged: not at outlines, where two surfaces mix."""
        import cv2

        mask, pixels = self.seen
        fit = mask.astype(np.uint8)
        fit[mask] = np.sum(pixels.normals * -unit(pixels.points), 1) >= FACING
        fit = cv2.erode(fit, np.ones((5, 5), np.uint8)) > 0
        parts = (getattr(pixels, name)[fit[mask]] for name in ("points", "normals", "flat", "albedo"))
        return fit, ObjectPixels(self.set_up, *parts)

    def photograph(self, run: int) -> tuple[Frames, World]:
        """Return one shoot: frames, and the world as it truly stood."""
        rng = np.random.default_rng([self.seed, 7, run])
        positions = self.positions + HAND_MM * rng.standard_normal(self.positions.shape)
        distance = np.linalg.norm(positions - self.set_up.middle_mm, axis=1)
        # Flashes of one energy: white that faces the mean one at the object shows EXPOSURE.
        power = EXPOSURE / np.mean((1000 / distance) ** 2) * np.ones((len(positions), 3))
        world = World(
            CAMERA, [], positions, power, table_point=np.array([0.0, 0.0, self.set_up.table_mm]),
            table_normal=np.array([0.0, 0.0, 1.0]), table_albedo=0.08, table_texture="noise",
        )  # fmt: skip
        for sphere in self.spheres:
            x, y = sphere.center_mm(CAMERA)[:2] + HAND_MM * rng.standard_normal(2)
            world.stand(sphere.kind, x, y, sphere.radius_mm)
        sensor, (mask, pixels) = self.set_up.sensor, self.seen
        images, codes = radiance(world, blur_px=sensor.blur_px)[0], []
        for image, values in zip(images, rendered(pixels, positions), strict=True):
            image[mask] = (power[0, 0] * values)[:, None]
            codes.append(develop(image, replace(sensor, blur_px=0.0), rng))
        names = tuple(f"flash_{i:03d}" for i in range(len(positions)))
        return Frames(names, np.stack(codes), np.ones(len(names)), None, is_mosaic=True), world

    def normals(self, run: int) -> Array:
        """Return one shoot's normals (P, 3) at the judged pixels, NaN where unknown."""
        frames, world = self.photograph(run)
        found, mask = calibrate(frames, CAMERA, world.requests(hints=True)), self.judged[0]
        lights = found.lights.seen_from(self.set_up.middle_mm)
        return solve("iterative", frames, lights, CAMERA, mask).normals[mask].astype(np.float64)


def rendered(pixels: ObjectPixels, positions: Array) -> Array:
    """Return values (F, P) under flashes of power 1 at positions (F, 3): white at 1 m shows 1; shadows, gloss."""
    set_up, lights = pixels.set_up, lights_at(positions, pixels.set_up.middle_mm)
    attached, cast = Sight(set_up.mesh, set_up.camera, lights).shadows(pixels.points, pixels.normals, pixels.flat)
    away = positions[:, None] - pixels.points
    toward, far = unit(away), np.linalg.norm(away, axis=-1)
    value = pixels.albedo * np.einsum("fpi,pi->fp", toward, pixels.normals)
    material = GLOSSES[set_up.gloss]
    if material is not None:
        ways = np.ascontiguousarray(toward.swapaxes(0, 1))
        value = value + material[1] * reflected(coat(material[0]), pixels.normals, -unit(pixels.points), ways)[1].T
    return np.where((attached | cast).T, 0.0, np.maximum(value, 0)) * (1000 / far) ** 2


CASES = (
    Case("pear, dome of 4, one ball", "pear", "dome", 4, 900, (60.0,)),
    Case("pear, dome of 12", "pear", "dome", 12, 31),
    Case("pear, dome of 24, two balls of 40 mm, ISO 100", "pear", "dome", 24, 32, (40.0, 40.0), 100),
    Case("blob, 16 at random, ISO 1600", "blob", "random", 16, 33, iso=1600),
    Case("knot, dome of 24, ISO 800", "knot", "dome", 24, 34, iso=800),
    Case("knot, 12 as planned", "knot", "plan", 12, 35),
    Case("bowl, dome of 16", "bowl", "dome", 16, 36),
    Case("waves with gloss, ring of 8", "waves", "ring", 8, 37, gloss="gloss"),
    Case("waves, semi-gloss, 20 at random, two balls", "waves", "random", 20, 38, (60.0, 60.0), 1600, "semi-gloss"),
    Case("pear with gloss, dome of 16, ISO 800", "pear", "dome", 16, 39, iso=800, gloss="gloss"),
    Case("ridges, dark, 10 as planned, balls of 40 mm", "ridges", "plan", 10, 40, 3 * (40.0,), 200, albedo=0.2),
)
OBJECTS = tuple(
    Case(
        f"{shape}, {gloss}", shape, "dome", 4, seed, gloss=gloss, relief=relief, size_mm=180.0, flash_mm=FAR_MM,
    )
    for shape, gloss, seed, relief in (
        ("waves", "gloss", 15, 1.6), ("ridges", "semi-gloss", 16, 3.0), ("knot", "gloss", 11, 1.0),
        ("knot", "semi-gloss", 12, 1.0), ("bowl", "gloss", 13, 0.8),
    )
)  # fmt: skip


@dataclass(frozen=True)
class SigmaRow:
    """One set-up: sigma of a tangent axis, median over pixels; `shared_deg`: what all shoots have in common."""

    case: str
    shoots: int
    predicted_deg: float
    found_deg: float
    ratio: float
    shared_deg: float


def _predicted(number: int, runs: int) -> list[SigmaRow]:
    case = CASES[number]
    pixels, middle = case.judged[1], case.set_up.middle_mm
    lights = light_sigmas(case.set_up, case.spheres, case.positions)
    shown = pixels.under(lights_at(case.positions, middle))
    slopes = light_slopes(case.positions, middle, pixels.points, pixels.b)
    sigma = predict(pixels, shown, slopes, joint_covariance(lights)).sigma_deg
    every = np.array([case.normals(run) for run in range(runs)])
    used = np.isfinite(every).all((0, 2)) & (sigma < 90)
    mean, freedom = every.mean(0), 2 * (runs - 1)
    spread = np.degrees(np.sqrt(((every - mean) ** 2).sum(-1).sum(0) / freedom))
    # The median of so few shoots' standard deviations lies below the true one.
    found = np.median(spread[used]) / np.sqrt(chi2.median(freedom) / freedom)
    predicted, shared = np.median(sigma[used]), np.median(angular_error_deg(mean[used], pixels.normals[used]))
    return [SigmaRow(case.name, runs, *map(float, (predicted, found, predicted / found, shared)))]


def _sigma_table(rows: Sequence[SigmaRow]) -> str:
    right = sum(1 / (1 + WITHIN) <= row.ratio <= 1 + WITHIN for row in rows)
    table = markdown(
        {
            "set-up": "{case}", "sigma predicted": "{predicted_deg:.3f}°", "found": "{found_deg:.3f}°",
            "ratio": "{ratio:.2f}", "what all shoots share": "{shared_deg:.3f}°",
        },
        rows,
    )  # fmt: skip
    return f"Within {WITHIN:.0%} in {right} of {len(rows)} set-ups, {rows[0].shoots} shoots each.\n\n{table}"


@dataclass(frozen=True)
class FlashRow:
    """Mean errors of one object's normals with a number of flashes: at the places planned, on an even dome."""

    object: str
    flashes: int
    planned_deg: float
    even_deg: float


def _error_deg(pixels: ObjectPixels, positions: Array, rng: np.random.Generator) -> float:
    """Return the mean angle between solved and true normals; what is not solved counts 90 degrees."""
    sensor, values = pixels.set_up.sensor, EXPOSURE * (FAR_MM / 1000) ** 2 * rendered(pixels, positions)
    noise = np.sqrt(values / sensor.white_e + (sensor.noise_e / sensor.white_e) ** 2)
    images = values[..., None] + noise[..., None] * rng.standard_normal((*values.shape, 3))
    names, shape = tuple(map(str, range(len(positions)))), (1, values.shape[1])
    aside = np.radians(DIRECTION_DEG) * rng.standard_normal(positions.shape)
    lights = Lights(names, unit(unit(positions - pixels.set_up.middle_mm) + aside), np.ones(positions.shape))
    frames = Frames.from_linear(names, np.clip(images, -0.02, 1).astype(np.float32)[:, None])
    found = solve("iterative", frames, lights, Camera.orthographic(shape[1], 1), np.ones(shape, bool)).normals[0]
    return float(np.nan_to_num(angular_error_deg(found, pixels.normals), nan=90.0).mean())


def _arranged(number: int, counts: tuple[int, ...]) -> list[FlashRow]:
    case, rows = OBJECTS[number], []
    pixels, rng = pixels_of(case.set_up, PIXELS), np.random.default_rng([case.seed, 5])
    for count in counts:
        places = [case.places(layout, count) for layout in ("plan", "dome")]
        errors = [np.mean([_error_deg(pixels, some, rng) for _ in range(REPEATS)]) for some in places]
        rows.append(FlashRow(case.name, count, *map(float, errors)))
    return rows


def _needed(rows: Sequence[FlashRow]) -> dict[str, int | None]:
    """Return, by object, the fewest planned flashes that are as good as the most even ones; None: not so many."""
    most = {row.object: row.even_deg for row in sorted(rows, key=lambda row: row.flashes)}
    return {
        name: min((row.flashes for row in rows if row.object == name and row.planned_deg <= error), default=None)
        for name, error in most.items()
    }


def _flash_table(rows: Sequence[FlashRow]) -> str:
    table = markdown(
        {"object": "{object}", "flashes": "{flashes}", "planned": "{planned_deg:.2f}°", "even": "{even_deg:.2f}°"}, rows
    )
    needed = ", ".join(f"{name}: {count or 'none'}" for name, count in _needed(rows).items())
    return f"Planned flashes as good as {max(row.flashes for row in rows)} even ones: {needed}.\n\n{table}"


TABLES = (
    Table(
        "plan", "errors", ("lab.shoot.shoot_plan", "calibrate.calibrate"), SigmaRow,
        lambda scale: {"small": [(0, 2)], "gates": [(1, 3)], "full": [(n, 6) for n in range(1, len(CASES))]}[scale],
        _predicted, _sigma_table, lambda rows: {f"{row.case}: predicted to found": row.ratio for row in rows},
    ),
    Table(
        "plan", "flashes", ("lab.shoot.shoot_plan", "solve.solve"), FlashRow,
        lambda scale: {
            "small": [(0, (4,))], "gates": [(0, COUNTS)], "full": [(n, COUNTS) for n in range(len(OBJECTS))]
        }[scale],
        _arranged, _flash_table,
        lambda rows: {f"{row.object}, {row.flashes} flashes: planned_deg": row.planned_deg for row in rows},
    ),
)  # fmt: skip
