"""How many flashes the next best flash saves: planned, one after the other, even and random, solved and judged.

Rendered and solved, not predicted: each arrangement's samples are shaded with cast shadows, gloss and noise, the
default method solves them under lights that are off by as much as balls leave, and the truth judges.
"""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.plan_captures import EXPOSURE, Case
from fixtures.mesh_scene import random_rotation
from lab.shoot.flash_places import Reach
from lab.shoot.flash_samples import ObjectPixels, lights_at
from lab.shoot.set_up import GLOSSES, SetUp
from scene.camera import Camera
from scene.frames import Frames
from scene.lights import Lights
from scene.mesh import Mesh
from scene.normals import angular_error_deg, unit
from solve.design.next_flash import choose_flashes, exchange_flashes, known_before
from solve.samples import GRAY
from solve.solve import solve
from twin.visibility import Sight

Array = NDArray[np.float64]
COUNTS = (4, 6, 8, 10, 12, 14, 16, 20, 24, 32, 40, 48)
TARGET = 24
"""Flashes of the even dome, and of the random places, whose error is to be reached with fewer."""
DRAWS, REPEATS = 4, 3
"""Of random places; of noise and light errors."""
POOL = 60
FAR_MM = 30_000.0
"""Of the flashes: distant, so that no method has to know the object's depth."""
DIRECTION_DEG, INTENSITY = 0.1, 0.003
"""What is left unknown of each light."""
PIXELS = 2500
REACH = Reach("dome", 10.0, 70.0, FAR_MM)


@dataclass(frozen=True)
class Thing:
    """An object with cast shadows and gloss, turned by its seed."""

    name: str
    shape: str
    gloss: str
    seed: int
    relief: float = 1.0
    turned_deg: float = 180.0

    @cached_property
    def pixels(self) -> ObjectPixels:
        """What is seen of it."""
        case = Case(self.name, self.shape, "dome", 4, relief=self.relief, gloss=self.gloss, size_mm=180.0)
        mesh = case.set_up.mesh
        if mesh.face_normals[:, 2].mean() < -0.1:
            # An open shape, seen from its inside.
            mesh = Mesh(mesh.vertices, mesh.faces[:, ::-1].copy())
        turn = random_rotation(np.random.default_rng([self.seed, 3]))
        if self.turned_deg < 180:
            angle = np.radians(self.turned_deg) * np.random.default_rng([self.seed, 4]).uniform(0.3, 1)
            c, s = np.cos(angle), np.sin(angle)
            turn = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])
        middle = mesh.center_mm
        mesh = Mesh((mesh.vertices - middle) @ turn.T + middle, mesh.faces)
        return _judged(replace(case.set_up, mesh=mesh))


OBJECTS = (
    Thing("knot, gloss", "knot", "gloss", 11),
    Thing("knot, semi-gloss", "knot", "semi-gloss", 12),
    Thing("bowl, gloss", "bowl", "gloss", 13, 0.8, 25.0),
    Thing("cone seen from its base, semi-gloss", "cone", "semi-gloss", 14, 0.9, 20.0),
    Thing("steep waves, gloss", "waves", "gloss", 15, 1.6, 20.0),
    Thing("steep ridges, semi-gloss", "ridges", "semi-gloss", 16, 3.0, 30.0),
)


def _judged(set_up: SetUp) -> ObjectPixels:
    from lab.shoot.flash_samples import pixels_of

    return pixels_of(set_up, PIXELS)


def rendered(pixels: ObjectPixels, lights: Lights) -> Array:
    """Return values (F, P), noiseless, of a white exposure of `EXPOSURE`."""
    from twin.material.reflection_models import coat, reflected

    set_up = pixels.set_up
    attached, cast = Sight(set_up.mesh, set_up.camera, lights).shadows(pixels.points, pixels.normals, pixels.flat)
    toward = unit(lights.toward(pixels.points))
    value = pixels.albedo * np.einsum("fpi,pi->fp", toward, pixels.normals)
    material = GLOSSES[set_up.gloss]
    if material is not None:
        views = unit(-pixels.points)
        way = np.ascontiguousarray(toward.swapaxes(0, 1))
        value = value + material[1] * reflected(coat(material[0]), pixels.normals.copy(), views, way)[1].T
    return EXPOSURE * np.where((attached | cast).T, 0.0, np.maximum(value, 0))


def error_deg(pixels: ObjectPixels, values: Array, lights: Lights, rng: np.random.Generator) -> float:
    """Return the mean angle between solved and true normals; what is not solved counts 90 degrees."""
    sensor = pixels.set_up.sensor
    noise = np.sqrt(values / sensor.white_e + (sensor.noise_e / sensor.white_e) ** 2)
    # A gray that is as noisy as a Bayer sensor's three channels, interpolated.
    share = float(np.sqrt(0.6 * np.sum(GRAY**2)) / np.sqrt(np.sum(GRAY**2)))
    images = values[..., None] + share * noise[..., None] * rng.standard_normal((*values.shape, 3))
    count = len(lights)
    aside = np.radians(DIRECTION_DEG) * rng.standard_normal((count, 3))
    directions = unit(lights.directions + aside)
    known = 1 + INTENSITY * rng.standard_normal((count, 1))
    given = Lights(lights.names, directions, known * np.ones((count, 3)))
    frames = Frames.from_linear(lights.names, np.clip(images, -0.02, 1).astype(np.float32)[:, None])
    shape = (1, values.shape[1])
    estimate = solve("iterative", frames, given, Camera.orthographic(shape[1], 1), np.ones(shape, bool))
    return float(np.nan_to_num(angular_error_deg(estimate.normals[0], pixels.normals), nan=90.0).mean())


def compare_arrangements(thing: Thing) -> dict[str, Any]:
    """Return the errors of each arrangement by the number of flashes, and what share of flashes the plans need."""
    pixels, middle = thing.pixels, thing.pixels.set_up.middle_mm
    rng = np.random.default_rng([thing.seed, 5])

    def at(positions: Array) -> tuple[Lights, Array]:
        lights = lights_at(positions, middle)
        return lights, rendered(pixels, lights)

    places = REACH.positions(middle, thing.pixels.set_up.size_mm, POOL)
    lights, values = at(places)
    shown = pixels.under(lights)
    # What is left unknown of each light: b . dl across the light, and the intensity.
    shade = np.einsum("fpi,pi->fp", shown.vectors, pixels.b)
    across = np.sqrt(np.maximum(np.sum(pixels.b**2, 1) - shade**2, 0)) * np.radians(DIRECTION_DEG)
    noise = np.sqrt(shown.noise**2 + across**2 + (INTENSITY * shade) ** 2)
    seen, start = (shown.vectors, noise, shown.seen), known_before(pixels.b)
    greedy = choose_flashes(pixels.b, start, *seen, max(COUNTS)).flashes

    def of(flashes: NDArray, repeats: int = REPEATS) -> float:
        some = Lights(tuple(lights.names[i] for i in flashes), lights.directions[flashes], np.ones((len(flashes), 3)))
        return float(np.mean([error_deg(pixels, values[flashes], some, rng) for _ in range(repeats)]))

    found: dict[str, list[float]] = {"next best": [], "planned": [], "even": [], "random": []}
    for count in COUNTS:
        found["next best"].append(of(greedy[:count]))
        found["planned"].append(of(exchange_flashes(pixels.b, start, *seen, greedy[:count])))
        even, even_values = at(REACH.positions(middle, thing.pixels.set_up.size_mm, count)[:count])
        found["even"].append(float(np.mean([error_deg(pixels, even_values, even, rng) for _ in range(REPEATS)])))
        draws = [of(rng.permutation(len(places))[:count], repeats=1) for _ in range(DRAWS)]
        found["random"].append(float(np.mean(draws)))
    row: dict[str, Any] = {
        "object": thing.name,
        "counts": list(COUNTS),
        "errors_deg": found,
        "pixels": len(pixels.points),
    }
    row |= shares(found)
    row["shadowed"] = float(1 - shown.seen.mean())
    return row


def needed(errors: list[float], wanted: float) -> float:
    """Return the number of flashes at which an error is first reached, between the counts by log-log; inf: never."""
    reached = np.array(errors) <= wanted
    if not reached.any():
        return float("inf")
    first = int(reached.argmax())
    if first == 0:
        return float(COUNTS[0])
    low, high = np.log(errors[first - 1]), np.log(errors[first])
    share = (low - np.log(wanted)) / (low - high)
    return float(np.exp(np.log(COUNTS[first - 1]) + share * np.log(COUNTS[first] / COUNTS[first - 1])))


def shares(found: dict[str, list[float]]) -> dict[str, float]:
    """Return what share of the flashes each plan needs for the error of `TARGET` flashes that are even, or random."""
    out = {}
    for plan in ("next best", "planned"):
        for other in ("even", "random"):
            wanted = found[other][COUNTS.index(TARGET)]
            out[f"{plan} / {other}"] = needed(found[plan], wanted) / needed(found[other], wanted)
    return out
