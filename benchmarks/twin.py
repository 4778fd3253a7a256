"""The twin: photographs that it was not fitted to, and its engines against stock Mitsuba at equal error.

The engines render a bumpy blob of 330 000 triangles in the corner of matte walls, under distant flashes. Processor
seconds are those of all threads, warm: what is compiled on first use does not count.
"""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from itertools import groupby
from typing import Any

import numpy as np
import trimesh
from numpy.typing import NDArray

from benchmarks.harness import Figures, Scale, Table, markdown
from benchmarks.real_captures import REAL, washington
from benchmarks.real_surfaces import DILIGENT, diligent_object
from benchmarks.sessions import registered, with_truth
from benchmarks.unknown_lights import photographed
from draw.line_chart import line_chart
from fixtures.mesh_shapes import blob
from scene.camera import Camera
from scene.clock import now, since
from scene.errors import SceneError
from scene.frames import Frames
from scene.lights import Lights
from scene.mesh import Mesh
from scene.normals import unit
from twin.description.description import Sampling, TwinObject, TwinScene
from twin.description.materials import Diffuse
from twin.description.object_mesh import built_in, smooth
from twin.engines.film import Film, sensor_description
from twin.engines.many import Many
from twin.engines.mitsuba_scene import mitsuba_scene
from twin.engines.render import render_scene
from twin.engines.variant import import_mitsuba
from twin.relighting import MASKS, relighting
from twin.visibility import Sight

Images = NDArray[np.float32]

GRAY_BALL, SCENE = "Washington gray ball", "test scene"


@dataclass(frozen=True)
class RelightingRow:
    """Photographs foretold by a material that was fitted to every second one; see `twin.relighting`."""

    photographs: str
    fitted: int
    foretold: int
    rmse_fitted_percent: float
    rmse_lit_percent: float
    rmse_whole_percent: float


def _captures(scale: Scale) -> list[tuple]:
    if scale == "small":
        return [(SCENE,)]
    names = [f"DiLiGenT {name}" for name in ("ball", "cat") if (DILIGENT / f"{name}PNG").is_dir()]
    if scale == "full":
        names += [GRAY_BALL] if (REAL / "uw_psm").is_dir() else []
        names += list(with_truth())
    return [(name,) for name in names]


@contextmanager
def _capture(name: str) -> Iterator[tuple[Sight, Frames, NDArray[np.bool_]]]:
    """Hold a capture whose shape is known for a block: what is seen, the photographs, and the object's mask."""
    if name == GRAY_BALL:
        yield _gray_ball()
    elif name in with_truth():
        with registered(with_truth()[name]) as one:
            assert one.surface is not None
            yield Sight(one.surface, one.camera, one.lights, one.normals), one.frames, one.mask
    else:
        of_set = name.removeprefix("DiLiGenT ")
        one = photographed("potato", 1, 1.0, 60) if name == SCENE else diligent_object(of_set, "orthographic")
        assert one.surface is not None
        yield Sight(one.surface, one.camera, one.lights, one.normals), one.frames, one.mask


def _gray_ball() -> tuple[Sight, Frames, NDArray[np.bool_]]:
    """Return the University of Washington's gray ball as a sphere, under the lights that its chrome ball shows."""
    shot = washington()
    camera, ball, lights = shot.camera, shot.matte, shot.found.lights
    assert ball is not None
    normals = ball.normals(camera, camera.grid())[0].astype(np.float32)
    distant = Lights(lights.names, lights.directions, lights.intensities).normalised()
    # The ball's size is unknown: in the orthographic camera's unit it is what it is in pixels.
    sphere, scale = trimesh.creation.icosphere(subdivisions=5), ball.radius_px / (ball.radius_mm * camera.fx)
    surface = scale * (ball.radius_mm * np.array(sphere.vertices) + ball.center_mm(camera))
    return Sight(Mesh(surface, np.array(sphere.faces)), camera, distant, normals), shot.frames, ball.mask(camera)


def _relit(name: str) -> list[RelightingRow]:
    try:
        with _capture(name) as (sight, frames, mask):
            found = relighting(sight, frames, mask, Sampling(), lambda one: render_scene(one).frames)
    except SceneError:
        # It is not registered: sessions/sessions says why.
        return []
    shares = (100 * found.relative_rmse[key] for key in MASKS)
    return [RelightingRow(name, len(found.fitted), len(found.predicted), *shares)]


def _shown_relit(rows: Sequence[RelightingRow]) -> str:
    columns = {"photographs": "{photographs}", "frames fitted, foretold": "{fitted}, {foretold}"}
    columns |= {f"relative RMSE, {name}": f"{{rmse_{name}_percent:.1f}} %" for name in MASKS}
    return markdown(columns, [vars(row) for row in rows])


@dataclass(frozen=True)
class EngineRow:
    """An engine at one setting: the error of its images over their mean, and what the whole stack costs.

    `stock_s`: processor seconds at which stock Mitsuba has that error; None: this is stock Mitsuba. `is_beyond`: the
    error is less than any that was measured of it, so that it is extrapolated.
    """

    scene: str
    engine: str
    setting: str
    frames: int
    error_percent: float
    processor_s: float
    wall_s: float
    stock_s: float | None = None
    is_beyond: bool = False


def dome(count: int) -> Lights:
    """Return distant flashes over a cap of 40 degrees, all moved up and to the right."""
    k = np.arange(count)
    z = 1 - (1 - np.cos(np.radians(40.0))) * (k + 0.5) / count
    across, azimuth = np.sqrt(1 - z**2), k * 2.39996
    directions = unit(np.stack([across * np.cos(azimuth) + 0.3, across * np.sin(azimuth) + 0.3, z], -1))
    return Lights(tuple(f"flash_{i:02d}" for i in k), directions, np.ones((count, 3)))


def stage(lights: Lights, side: int, depth: int) -> TwinScene:
    """Return the blob before a wall, on a floor and beside a red wall."""
    mesh = blob()
    material = {"blob": Diffuse((0.6, 0.6, 0.6)), "wall": Diffuse((0.7, 0.7, 0.7)), "red": Diffuse((0.7, 0.25, 0.2))}
    floor = np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0.0]])
    beside = np.array([[0, 0, 1], [0, 1, 0], [-1, 0, 0.0]])

    def placed(name: str, shape: Any, use: str, turn: NDArray, size: float, offset: Sequence[float]) -> TwinObject:
        matrix = np.eye(4)
        matrix[:3, :3], matrix[:3, 3] = size * turn, np.array([0.0, 0.0, -300.0]) + offset
        return TwinObject(name, shape, use, matrix)

    square = built_in("square")
    objects = (
        placed("blob", smooth(mesh), "blob", np.eye(3), 0.9, [0, 0, 0]),
        placed("wall", square, "wall", np.eye(3), 240.0, [0, 0, -60]),
        placed("floor", square, "wall", floor, 110.0, [0, -60, -60]),
        placed("beside", square, "red", beside, 110.0, [-75, 0, -60]),
    )
    focal = 1.76 * side
    camera = Camera(side, side, focal, focal, (side - 1) / 2, (side - 1) / 2)
    return TwinScene(camera, objects, material, lights, sampling=Sampling("mitsuba", max_depth=depth))


class StockMitsuba:
    """One scene, loaded once, of which only the flash's direction changes from frame to frame.

    Parameters
    ----------
    scene : TwinScene
    film : Film
    sampler : str
        One of Mitsuba's.
    """

    def __init__(self, scene: TwinScene, film: Film, sampler: str) -> None:
        self._mi, self._scene = import_mitsuba(), scene
        self._mi.set_log_level(self._mi.LogLevel.Error)
        self._loaded = mitsuba_scene(scene, light=0)
        self._parameters = self._mi.traverse(self._loaded)
        self._integrator = self._mi.load_dict({"type": "path", "max_depth": scene.sampling.max_depth})
        description = sensor_description(film, scene.points, 0, scene.camera.height)
        self._sensor = self._mi.load_dict({**description, "sampler": {"type": sampler}})

    def images(self, lights: Sequence[int], samples: int, seed: int) -> Images:
        """Return (K, H, W, 3) under some of the flashes, one after the other."""
        return np.stack([self._image(index, samples, 1000 * seed + index) for index in lights])

    def _image(self, index: int, samples: int, seed: int) -> Images:
        mi, direction = self._mi, self._scene.lights.directions[index]
        up = np.eye(3)[np.argmin(np.abs(direction))].tolist()
        turned = mi.Transform4f().look_at(origin=[0, 0, 0], target=(-direction).tolist(), up=up)
        self._parameters["flash.to_world"] = turned
        self._parameters.update()
        image = mi.render(self._loaded, sensor=self._sensor, integrator=self._integrator, spp=samples, seed=seed)
        return np.asarray(image, np.float32)[..., :3]


def _engine(count: int, side: int, depth: int, settings: Sequence[int], stock: int) -> list[EngineRow]:
    """Measure `many` on `count` flashes with some numbers of samples a pixel, and stock Mitsuba.

    Stock Mitsuba takes 4 samples a pixel, then four times and sixteen times as many, with the sampler that is cheapest
    at equal error at the second; `stock`: half of the samples of its reference. Errors are those of two of the frames.
    """
    scene, lights = stage(dome(count), side, depth), [count // 8, 5 * count // 8]
    film = Film.of_pinhole(scene.camera, slice(0, side), slice(0, side))
    made = {name: StockMitsuba(scene, film, name) for name in ("multijitter", "independent", "orthogonal")}
    halves = [made["independent"].images(lights, stock, seed) for seed in (101, 102)]
    reference, noise = (halves[0] + halves[1]) / 2, float(np.mean((halves[0] - halves[1]) ** 2)) / 4
    title = f"{count} lights, depth {depth}, {side} x {side} pixels"

    def row(name: str, setting: str, work: Callable[[], Images], rounds: int, share: float) -> EngineRow:
        spent = []
        for _ in range(rounds):
            start = now()
            images = work()
            spent.append([share * seconds for seconds in since(start).values()])
        images = images if len(images) == len(lights) else images[lights]
        # The reference's own noise is taken off; what is less than a millionth cannot be told.
        square = max(float(np.mean((images - reference) ** 2)) - noise, 1e-12) / float(reference.mean()) ** 2
        wall, processor = np.min(spent, axis=0)
        error = 100 * float(np.sqrt(square))
        return EngineRow(title, name, setting, count, error, float(processor), float(wall))

    def of_stock(name: str, samples: int) -> EngineRow:
        def work() -> Images:
            return made[name].images(lights, samples, samples)

        return row("mitsuba", f"{samples} samples, {name}", work, 1, count / len(lights))

    for one in made.values():
        one.images(lights[:1], 4, 1)
    first = {name: [of_stock(name, samples) for samples in (4, 16)] for name in made}
    best = min(first, key=lambda name: first[name][1].processor_s * first[name][1].error_percent ** 2)
    theirs = [*first[best], of_stock(best, 64)]
    shapes, ours = mitsuba_scene(scene), []
    for samples in settings:

        def work(samples: int = samples) -> Images:
            many = Many(shapes, film, scene.lights, max_depth=depth)
            return many.band(slice(0, side), samples).sum(0)

        if not ours:
            work()
        ours.append(row("many", f"{samples} samples", work, 2, 1.0))
    return [_held_against(one, theirs) for one in ours] + theirs


def _held_against(row: EngineRow, stock: Sequence[EngineRow]) -> EngineRow:
    """Return a row with what stock Mitsuba costs at its error, straight on logarithmic scales, beyond its ends too."""
    cost, seen = np.log([one.processor_s for one in stock]), np.log([one.error_percent for one in stock])
    wanted = np.log(row.error_percent)
    where = int(np.clip(np.searchsorted(-seen, -wanted) - 1, 0, len(stock) - 2))
    slope = (cost[where + 1] - cost[where]) / (seen[where + 1] - seen[where])
    at = float(np.exp(cost[where] + slope * (wanted - seen[where])))
    return replace(row, stock_s=at, is_beyond=bool(wanted < seen[-1]))


def _engines(scale: Scale) -> list[tuple]:
    if scale == "small":
        return [(4, 24, 2, (4,), 512)]
    side = 64 if scale == "gates" else 256
    return [(24, side, 5, (4, 16, 64), 2 * side), (96, 2 * side, 2, (4, 16, 64), side // 2)]


def _shown_engines(rows: Sequence[EngineRow]) -> str:
    text = ""
    for scene, some in groupby(rows, lambda row: row.scene):
        columns = {
            scene: "`{engine}`, {setting}", "error": "{error_percent:.2f} %", "processor, s": "{processor_s:.2f}",
            "stock, s": "{stock_s:.0f}{beyond}", "times": "**{times:.1f}**",
        }  # fmt: skip
        beyond = ("", " (extrapolated)")
        ours = (row for row in some if row.stock_s is not None)
        shown = [{**vars(row), "times": _times(row), "beyond": beyond[row.is_beyond]} for row in ours]
        text += markdown(columns, shown) + "\n"
    return text + "![Processor seconds a frame against the image's error](twin-error-time.svg)\n"


def _times(row: EngineRow) -> float | None:
    return None if row.stock_s is None else row.stock_s / row.processor_s


def _engine_figures(rows: Sequence[EngineRow]) -> Figures:
    times = {f"{row.scene}, {row.setting}: times": _times(row) for row in rows}
    errors = {f"{row.scene}, {row.setting}: error_percent": row.error_percent for row in rows if row.stock_s}
    return errors | {name: value for name, value in times.items() if value is not None}


def _chart(rows: Sequence[EngineRow]) -> dict[str, str]:
    lines = {}
    for (scene, engine), some in groupby(rows, lambda row: (row.scene, row.engine)):
        every = list(some)
        seconds = [row.processor_s / row.frames for row in every]
        lines[f"{engine}, {scene.split(', ')[1]}"] = seconds, [row.error_percent for row in every]
    x_title, y_title = "processor seconds a frame", "error of the image, % of its mean"
    return {"twin-error-time.svg": line_chart(lines, x_title=x_title, y_title=y_title, log_x=True, log_y=True)}


TABLES = (
    Table(
        "twin", "relighting", ("twin.relighting", "twin.engines.render", "lab.run"), RelightingRow, _captures, _relit,
        _shown_relit, lambda rows: {f"{row.photographs}: rmse_lit_percent": row.rmse_lit_percent for row in rows},
    ),
    Table(
        "twin", "engines", ("twin.engines.many",), EngineRow, _engines, _engine, _shown_engines,
        _engine_figures, _chart, is_timed=True,
    ),
)  # fmt: skip
