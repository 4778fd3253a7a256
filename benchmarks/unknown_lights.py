"""Methods under lights that are wrong or unknown in part: their intensities, their distances, or everything.

Sessions that others made come first; then test scenes with gloss, cast shadows and noise, of seeds not used before.
"""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace

import numpy as np

from benchmarks.harness import Figures, Scale, Table, markdown
from benchmarks.methods import SESSIONS
from benchmarks.sessions import Registered, registered
from compare.statistics.statistics import four_ways
from fixtures.mesh_scene import Tracer, random_scene
from fixtures.mesh_shapes import SHAPES
from scene.clock import now, since
from scene.lights import Lights
from scene.mesh import Mesh
from scene.method_names import UNCALIBRATED
from scene.normals import angular_error_deg, unit
from solve.problem import Problem
from solve.solve import solve
from solve.whole.near import find_positions

THEIRS = tuple(name for name in ("DiLiGenT cat", "DiLiGenT ball", "bunny") if SESSIONS[name].is_dir())
DRAWN = ("blob", "relief", "brick", "knot", "mug", "gear")
"""Shapes of the test scenes."""
FIRST, HEIGHT, FLASHES = 31_000, 240, 16
WRONG = (0, 10, 20, 30)
"""Percent by which given intensities are off, each by itself."""


def photographed(shape: str, seed: int, farther: float, height: int = HEIGHT) -> Registered:
    """Return a test scene; its flashes are so many times farther away than 0.5 to 0.9 m."""
    scene = random_scene(SHAPES[shape](), seed, width=height * 3 // 2, height=height, flashes=FLASHES)
    lights = scene.lights
    assert lights.positions_mm is not None
    arm = lights.positions_mm - lights.reference_point_mm
    scene = replace(scene, lights=replace(lights, positions_mm=lights.reference_point_mm + farther * arm))
    tracer = Tracer(scene)
    _, normals, _, on_object, weight, pixel = tracer.look()
    weighted = (weight[:, None] * normals)[on_object]
    total = np.stack([np.bincount(pixel[on_object], weighted[:, k], tracer.count) for k in range(3)], -1)
    mask = tracer.cover > 0.999
    normals, surface = (
        unit(total.reshape(*mask.shape, 3)),
        Mesh(scene.pose.apply(scene.mesh.vertices), scene.mesh.faces),
    )
    return Registered(scene.photograph(), scene.lights, scene.camera, mask, normals, surface)


@contextmanager
def _shot(name: str, seed: int, farther: float, height: int) -> Iterator[Registered]:
    """Hold a session, or a test scene of a shape, for a block."""
    if name in SESSIONS:
        with registered(SESSIONS[name]) as session:
            yield session
    else:
        yield photographed(name, seed, farther, height)


def _cases(scale: Scale, theirs: Sequence[str], distances: Sequence[float]) -> list[tuple]:
    """Return cases of `_shot`; a shape has the same seed at all distances."""
    if scale == "small":
        return [("blob", FIRST, 1.0, 60)]
    sessions: list[tuple] = [(name, 0, 1.0, 0) for name in theirs]
    scenes = [(shape, FIRST + k, far, HEIGHT) for far in distances for k, shape in enumerate(DRAWN)]
    return sessions[:1] + scenes[:1] if scale == "gates" else sessions + scenes


@dataclass(frozen=True)
class IntensityRow:
    """One method under intensities that are off by `wrong_percent`; found ones, rms of the worst channel."""

    lights: str
    subject: str
    method: str
    wrong_percent: int
    mean_deg: float
    found_off_percent: float | None


def _intensities(name: str, seed: int, farther: float, height: int) -> list[IntensityRow]:
    rows, group = [], name if name in SESSIONS else f"test scenes, {0.5 * farther:g} to {0.9 * farther:g} m away"
    with _shot(name, seed, farther, height) as (frames, lights, camera, mask, normals, _):
        random = np.random.default_rng([seed, 9])
        for wrong in WRONG:
            factor = np.exp(wrong / 100 * random.standard_normal((len(lights), 1)))
            given = replace(lights, intensities=lights.intensities * factor).normalised()
            for method in ("iterative", "semicalibrated"):
                found, off = solve(method, frames, given, camera, mask), None
                if found.lights is not None:
                    there = found.lights.seen_from(lights.reference_point_mm).intensities
                    off = 100 * float(np.log(there / lights.intensities).std(0).max())
                mean = float(np.nanmean(angular_error_deg(found.normals, normals)[mask]))
                rows.append(IntensityRow(group, f"{name} {seed}", method, wrong, mean, off))
    return rows


def _by_lights(rows: Sequence[IntensityRow]) -> list[dict]:
    """Return lights and method, the mean error over subjects by `wrong_percent`, and least and most of what is off."""
    lines = []
    for lights, method in dict.fromkeys((row.lights, row.method) for row in rows):
        some = [row for row in rows if (row.lights, row.method) == (lights, method)]
        off = [row.found_off_percent for row in some if row.found_off_percent is not None]
        means = {f"by_{w}": float(np.mean([row.mean_deg for row in some if row.wrong_percent == w])) for w in WRONG}
        ends = {"least": min(off), "most": max(off)} if off else {"least": None, "most": None}
        lines.append({"lights": lights, "method": method, **means, **ends})
    return lines


def _shown_intensities(rows: Sequence[IntensityRow]) -> str:
    columns = {"lights": "{lights}", "method": "`{method}`", "right": "{by_0:.2f}°"}
    columns |= {f"{wrong} %": f"{{by_{wrong}:.2f}}°" for wrong in WRONG[1:]}
    return markdown({**columns, "intensities found, off (rms)": "{least:.1f} to {most:.1f} %"}, _by_lights(rows))


def _intensity_figures(rows: Sequence[IntensityRow]) -> Figures:
    return {f"{one['lights']}: {one['method']}, {w} % off": one[f"by_{w}"] for one in _by_lights(rows) for w in (0, 20)}


@dataclass(frozen=True)
class DistanceRow:
    """Lights whose directions alone are given; None: they are taken as distant.

    `common`, `each`: mean and standard deviation of found over known distances, less one. Errors are medians.
    """

    subject: str
    lights_m: float
    common_percent: float | None
    each_percent: float | None
    distant_deg: float
    near_deg: float
    near_known_deg: float
    reflectance_deg: float
    processor_s: float


def _distances(name: str, seed: int, farther: float, height: int) -> list[DistanceRow]:
    with _shot(name, seed, farther, height) as (frames, lights, camera, mask, normals, _):
        given = Lights(lights.names, lights.directions, lights.intensities).normalised()

        def error(method: str, lights: Lights) -> float:
            found = solve(method, frames, lights, camera, mask).normals
            return float(np.nanmedian(angular_error_deg(found, normals)[mask]))

        start = now()
        found = find_positions(Problem(frames, given, camera, mask, slice(0, len(mask)))).lights
        spent, common, each = since(start)["processor_seconds"], None, None
        assert lights.positions_mm is not None
        far = np.linalg.norm(lights.positions_mm - lights.reference_point_mm, axis=1)
        if found.positions_mm is not None:
            # The object is put at 1000; its true distance gives the scale.
            scale = -lights.reference_point_mm[2] / 1000
            ratio = scale * np.linalg.norm(found.positions_mm - found.reference_point_mm, axis=1) / far
            common, each = 100 * float(np.mean(ratio) - 1), 100 * float(np.std(ratio))
        errors = error("iterative", given), error("near", given), error("near", lights), error("reflectance", given)
    return [DistanceRow(name, float(np.median(far)) / 1000, common, each, *errors, spent)]


def _shown_distances(rows: Sequence[DistanceRow]) -> str:
    columns = {
        "object": "{subject}", "lights, m": "{lights_m:.1f}", "distances, common": "{common_percent:+.0f} %",
        "each": "{each_percent:.0f} %", "`iterative`, distant": "{distant_deg:.2f}°",
        "`near`, found": "{near_deg:.2f}°", "`near`, known positions": "{near_known_deg:.2f}°",
        "`reflectance`, found": "{reflectance_deg:.2f}°",
    }  # fmt: skip
    return markdown(columns, rows)


@dataclass(frozen=True)
class FourWaysRow:
    """A method that need not know the lights, measured in four ways; see `compare.statistics.statistics`."""

    subject: str
    method: str
    raw_deg: float
    best_sign_deg: float
    oracle_relief_deg: float
    oracle_linear_deg: float
    doubts: int


def _uncalibrated(name: str, seed: int, farther: float, height: int) -> list[FourWaysRow]:
    rows = []
    with _shot(name, seed, farther, height) as (frames, lights, camera, mask, normals, _):
        for method in ("rpca", *UNCALIBRATED):
            found = solve(method, frames, lights, camera, mask)
            raw, sign, relief, linear, _ = four_ways(found.normals, normals, mask).values()
            rows.append(FourWaysRow(name, method, raw, sign, relief, linear, len(found.warnings)))
    return rows


def _shown_ways(rows: Sequence[FourWaysRow]) -> str:
    columns = {"object": "{subject}", "method": "`{method}`", "raw": "{raw_deg:.2f}°"}
    columns |= {"best sign": "{best_sign_deg:.2f}°", "oracle relief": "{oracle_relief_deg:.2f}°"}
    return markdown({**columns, "oracle linear": "{oracle_linear_deg:.2f}°"}, rows)


TABLES = (
    Table(
        "methods", "intensities", ("solve.solve", "solve.methods"), IntensityRow,
        lambda scale: _cases(scale, THEIRS, (20.0, 1.0)), _intensities, _shown_intensities, _intensity_figures,
    ),
    Table(
        "methods", "light distance", ("solve.solve", "solve.methods"), DistanceRow,
        lambda scale: _cases(scale, THEIRS[2:], (1.0, 3.0, 20.0)), _distances, _shown_distances,
        lambda rows: {f"{row.subject}, {row.lights_m:.1f} m: near, found": row.near_deg for row in rows},
    ),
    Table(
        "methods", "four ways", ("solve.solve", "solve.methods", "compare.statistics.statistics"), FourWaysRow,
        lambda scale: _cases(scale, THEIRS, (1.0,)), _uncalibrated, _shown_ways,
        lambda rows: {f"{row.subject}: {row.method}": row.raw_deg for row in rows},
    ),
)  # fmt: skip
