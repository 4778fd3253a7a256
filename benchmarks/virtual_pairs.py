"""Virtual captures and their synthetic counterparts, each a folder that the steps take, and the two compared.

The capture: the lab rendered and photographed by the virtual camera, a session for `process`. Its lights are found on
the balls, as a real session's are; the true ones are written nowhere that a step reads. The counterpart: the object
alone, as the setup has it, solved with the true lights.
"""

import json
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks import virtual_lab
from benchmarks.virtual_lab import (
    BALLS,
    CAMERA,
    CENTRE_MM,
    SAMPLES,
    VIRTUAL_EXPERIMENTS,
    Experiment,
    Level,
    Setup,
    lab_scene,
    object_maps,
    object_scene,
    photograph_lab,
    photograph_object,
)
from experiments.compare_folders import NUMBERS, VIRTUAL, compare_folders
from experiments.photographs import Images
from experiments.stagings import SOLVERS
from scene.current import code_fingerprint, fingerprint
from scene.errors import SceneError
from scene.files import write_json, write_npy, write_text
from scene.frames import Frames
from scene.normals import angular_error_deg, unit
from scene.output_folder import open_record
from scene.record import Record
from scene.spheres import Sphere
from scene.store import Store
from twin.camera.virtual_camera import Sensor

METHODS = tuple(SOLVERS)
DARK_SHARE = 0.3
"""Of the median frame's light on and about the white ball: below, it stands in the object's shadow."""
_FIRST_SHOT = datetime(2000, 1, 1, 12, 0)


def write_capture(folder: Store, setup: Setup, name: str, balls: Sequence[Sphere] = ()) -> None:
    """Photograph a setup, and write it as a session's folder; its name begins with `virtual`.

    The folder gets session.toml (last), raw/flash_NNN.dng, mask.png, truth.npy and virtual.json, which says that no
    camera was there. balls: where another session found them, for camera and balls stand still. Without, each session
    finds its own.
    """
    from twin.camera.virtual_photograph import write_photograph

    (mask, truth), images = object_maps(setup), photograph_lab(setup)
    sensor, names = Sensor(iso=setup.iso), lab_scene(setup).lights.names
    for index, light in enumerate(names):
        write_photograph(
            folder.path("raw", f"{light}.dng"),
            images[index],
            sensor,
            np.random.default_rng([setup.seed, 2, index]),
            focal_mm=CAMERA.fx * sensor.pixel_um / 1000,
            time=_FIRST_SHOT + timedelta(seconds=2 * index),
        )
    folder.save_mask(mask)
    write_npy(folder.path("truth.npy"), truth)
    write_json(folder.path(VIRTUAL), {"virtual": True, "setup": asdict(setup), "samples": SAMPLES})
    write_text(folder.path("session.toml"), _manifest(name, balls, in_shadow(names, images)))


def in_shadow(names: Sequence[str], images: Images) -> list[str]:
    """Return the frames in which the white ball is dark: the object stands in its light, as a look at them tells."""
    center, radius = next((np.array(center), radius) for kind, radius, center in BALLS if kind == "white")
    u, v = CAMERA.project(center[None])[0]
    reach = int(CAMERA.fx * radius / -center[2])
    ball = images[:, int(v) - reach : int(v) + reach, int(u) - reach : int(u) + reach]
    brightness = ball.mean((1, 2, 3))
    dark = brightness < DARK_SHARE * np.median(brightness)
    return [name for name, left_out in zip(names, dark, strict=True) if left_out]


def _manifest(name: str, balls: Sequence[Sphere], skip: Sequence[str]) -> str:
    lines = [
        "# A virtual capture: rendered by rgbn, photographed by its virtual camera.",
        "version = 1",
        f'name = "{name}"',
        "",
        "[frames]",
        'flash = "raw/flash_*.dng"',
        *([f"skip = {json.dumps([f'{one}.dng' for one in skip])}"] if skip else []),
        "",
        "[camera]",
        *(f"{key} = {getattr(CAMERA, key)}" for key in ("width", "height", "fx", "fy", "cx", "cy")),
    ]
    for number, (kind, radius, _) in enumerate(BALLS):
        lines += ["", "[[spheres]]", f'kind = "{kind}"', f"diameter_mm = {2 * radius}"]
        if balls:
            u, v = balls[number].center_px
            lines += [f"center_px = [{u:.3f}, {v:.3f}]", f"radius_px = {balls[number].radius_px:.3f}"]
    return "\n".join([*lines, "", "[object]", 'mask = "mask.png"', 'normals = "truth.npy"', ""])


def write_rendering(folder: Store, setup: Setup, name: str) -> None:
    """Render a setup's object, photograph it by a sensor of its ISO, and solve it.

    The folder gets a session with its true lights, and normals/, as a session's twin/ has.
    """
    from capture.photographs.decode import decode
    from capture.session.session import load_session
    from solve.solve import solve
    from twin.twin_session import Shooting, write_session

    scene = object_scene(setup)
    mask, truth = object_maps(setup)
    frames = Frames.from_linear(scene.lights.names, photograph_object(setup))
    # Neither lens nor colour filter: what the setup says is the noise.
    sensor, lights = Sensor(iso=setup.iso, cfa="none", blur_px=0.0), scene.lights.normalised()
    path = write_session(
        folder, frames, CAMERA, lights, mask, truth, shooting=Shooting(sensor, seed=setup.seed), name=name
    )
    taken, _ = decode(load_session(path), folder)
    folder.save_camera(CAMERA)
    for method in METHODS:
        folder.save_estimate(solve(method, taken, lights, CAMERA, mask))


REFERENCE = Setup(shape="cardboard", fold_deg=160.0)
"""Where the balls are found for all sessions: beside a white sphere nothing tells the white ball from the object."""


@dataclass(frozen=True)
class Pair:
    """One level: its value, and what was found of capture and counterpart."""

    level: Level
    found: dict[str, Any]  # by `compare_folders`
    known: dict[str, float]  # by `against_the_lab`
    processor_s: float
    folders: tuple[Path, Path]  # of the processed capture, of the rendering

    def medians(self, kind: str) -> dict[str, float]:
        """Return each method's median error on `real` or `twin`."""
        return {name: row[kind]["median_deg"] for name, row in self.found["methods"].items()}

    def correlation(self, method: str) -> float:
        """Return Pearson's correlation of a method's two error maps; NaN where one is constant."""
        found = self.found["methods"][method]["pattern"]["pearson"]
        return np.nan if found is None else found

    @property
    def sigma_deg(self) -> float:
        """The median stated sigma of the capture's light directions; NaN where none is known."""
        found = self.found["captures"]["real"]["carried"]["direction_sigma_deg"]
        return np.nan if found is None else found

    @property
    def spearman(self) -> float:
        """Rank correlation of the methods' medians between the two."""
        from scipy.stats import spearmanr

        real, twin = self.medians("real"), self.medians("twin")
        return float(spearmanr(list(real.values()), [twin[name] for name in real]).statistic)  # type: ignore[union-attr]


def run_experiments(
    out: Path, experiments: Sequence[Experiment] = VIRTUAL_EXPERIMENTS, *, tell: Callable[[str], None] = print
) -> Iterator[tuple[Experiment, list[Pair]]]:
    """Yield each experiment with its levels; what is there, of this setup and code, is not made again.

    out gets virtual-NAME-LEVEL (a session), processed-NAME-LEVEL, rendered-NAME-LEVEL and pairs/NAME-LEVEL.
    """
    with open_record(out) as record:
        out = record.folder
        balls = reference_balls(record)
        for experiment in experiments:
            pairs = []
            for level, setup in experiment.setups():
                label = f"{experiment.name}-{level_name(level)}"
                place, mark = Store(out / "pairs" / label), _mark(setup)
                processed, rendering = out / f"processed-{label}", out / f"rendered-{label}"
                if not (record.is_current(label, mark) and place.path(NUMBERS).exists()):
                    tell(f"{label} ...")
                    start = time.process_time()
                    with record.making(label, mark) as kept:
                        process_capture(out / f"virtual-{label}", processed, setup, balls)
                        write_rendering(Store(rendering), setup, f"rendered {label}")
                        compare_folders(processed, rendering, place.folder, methods=",".join(METHODS))
                        kept["known"] = against_the_lab(setup, Store(processed))
                        kept["processor_s"] = time.process_time() - start
                kept = record.done[label]
                found = place.read_json(NUMBERS)
                pairs.append(Pair(level, found, kept["known"], kept["processor_s"], (processed, rendering)))
            yield experiment, pairs


def level_name(level: Level) -> str:
    """Return a level as files and tables have it."""
    return level if isinstance(level, str) else f"{level:g}"


def against_the_lab(setup: Setup, processed: Store) -> dict[str, float]:
    """Return what the lab knows of a processed capture and no step was told.

    lights_off_deg: median angle between the light directions found and those held, at the object's centre.
    ls_deg: median error of `ls` by the lights found, with the object at its true distance from the camera. Without a
    scan the chain takes it to stand at the balls' distance.
    """
    from solve.solve import solve

    found, held = processed.load_lights(), lab_scene(setup).lights
    kept = [held.names.index(name) for name in found.names]
    toward, expected = (unit(one.toward(CENTRE_MM[None])[:, 0]) for one in (found, held))
    mask, truth = object_maps(setup)
    told = solve("ls", processed.load_frames(), found.seen_from(CENTRE_MM), CAMERA, mask)
    return {
        "lights_off_deg": float(np.median(angular_error_deg(toward, expected[kept]))),
        "ls_deg": float(np.nanmedian(angular_error_deg(told.normals[mask], truth[mask]))),
    }


def reference_balls(record: Record) -> list[Sphere]:
    """Return the balls, found in a session of their own by `calibrate`, in the order of `BALLS`."""
    from lab.plan import STEPS
    from lab.run import open_job

    folder, processed = record.folder / "virtual-balls", Store(record.folder / "processed-balls")
    mark = _mark(REFERENCE)
    if not (record.is_current("balls", mark) and processed.path("spheres.json").exists()):
        with record.making("balls", mark):
            write_capture(Store(folder), REFERENCE, folder.name)
            with open_job(folder, out=processed.folder) as job:
                job.run(STEPS, "calibrate")
    return in_order(processed.load_spheres(), processed.folder)


def in_order(found: Sequence[Sphere], folder: Path) -> list[Sphere]:
    """Return balls in the order of `BALLS`: those of one kind by their places from left to right.

    SceneError: they are others than stand there; `folder` is named.
    """
    ordered: dict[int, Sphere] = {}
    for kind in {kind for kind, _, _ in BALLS}:
        numbers = sorted((i for i, ball in enumerate(BALLS) if ball[0] == kind), key=lambda i: BALLS[i][2][0])
        there = sorted((ball for ball in found if ball.kind == kind), key=lambda ball: ball.center_px[0])
        if len(there) != len(numbers):
            raise SceneError(
                f"{folder}: found {len(there)} {kind} balls, expected {len(numbers)}; no other session can go by them. "
                "Look at the pictures of the balls there."
            )
        ordered |= dict(zip(numbers, there, strict=True))
    return [ordered[i] for i in range(len(BALLS))]


def _mark(setup: Setup) -> str:
    return fingerprint(setup, METHODS, Path(__file__), Path(virtual_lab.__file__), code=code_fingerprint())


def process_capture(folder: Path, done: Path, setup: Setup, balls: Sequence[Sphere]) -> None:
    """Photograph a setup into a session's folder, and process it into another."""
    from lab.options import Solving
    from lab.plan import STEPS
    from lab.run import open_job
    from lab.summary import write_summary

    store = Store(folder)
    write_capture(store, setup, folder.name, balls)
    with open_job(folder, out=done, solving=Solving(",".join(METHODS))) as job:
        job.run(STEPS, "solve")
        write_summary(job, {"up_to": "solve", "session": folder.name, "methods": list(METHODS)})
    write_json(done / VIRTUAL, store.read_json(VIRTUAL))
