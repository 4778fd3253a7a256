"""Every method on sessions with ground truth, and what the pixelwise ones cost beside reading the photographs."""

import os
import tempfile
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path

import numba
import numpy as np

from benchmarks.harness import ROOT, SHARED, Figures, Scale, Table, markdown, opened
from compare.report.facts import family
from draw.speed_chart import SpeedPoint, pareto_front, speed_chart
from lab.options import Solving
from lab.run import STEPS
from scene.camera import Camera
from scene.clock import now, since
from scene.frames import Frames
from scene.lights import Lights
from scene.method_names import METHODS
from scene.normals import angular_error_deg
from solve.solve import solve

SESSIONS = {
    "fixture": ROOT / "fixtures" / "bumpy",
    "bunny": SHARED / "sessions" / "bunny",
    "bronze": SHARED / "sessions" / "blender_1" / "whole",
    "DiLiGenT ball": SHARED / "real" / "diligent" / "ballPNG",
    "DiLiGenT cat": SHARED / "real" / "diligent" / "catPNG",
}
"""With all but the bronze in view one thing was chosen: how strongly `reflectance` is pulled to matte."""
LIGHTS, SEED, ROUNDS = 96, 10_001, 3
ALONE = ("ls", "iterative", "position", "l1", "sbl", "hsh")
"""Methods that treat each pixel alone."""
READING = "reading the bytes once"


@dataclass(frozen=True)
class MethodRow:
    """One method on one session; None: it gave no answer. `seconds`: of a processor, a million pixels of one frame."""

    session: str
    method: str
    frames: int
    kilopixels: float
    mean_deg: float | None
    median_deg: float | None
    under_10_deg: float | None
    seconds: float


def _sessions(scale: Scale) -> list[tuple]:
    there = [name for name, folder in SESSIONS.items() if folder.is_dir()]
    return [("fixture", "ls,iterative")] if scale == "small" else [(name, ",".join(METHODS)) for name in there]


def _solved(session: str, methods: str) -> list[MethodRow]:
    """Take a session as far as `solve` in an empty folder."""
    rows = []
    with tempfile.TemporaryDirectory() as out, opened(SESSIONS[session], Path(out), Solving(methods)) as job:
        job.run(STEPS, "solve")
        truth = job.store.load_normals("truth")
        for name, solved in job.done["solve"]["result"]["methods"].items():
            error = angular_error_deg(job.store.load_normals(name), truth)
            error = error[np.isfinite(error)]
            mean, median, under = (float(f(error)) for f in (np.mean, np.median, lambda e: np.mean(e < 10)))
            known = (mean, median, under) if len(error) else (None, None, None)
            seconds = solved["processor_seconds_per_megapixel_image"]
            rows.append(MethodRow(session, name, solved["frames"], 1e3 * solved["megapixels"], *known, seconds))
    return rows


def _errors(rows: Sequence[MethodRow]) -> str:
    """Return a row a method, a column a session: mean error, and seconds; and the charts."""
    columns, cells = {"method": "`{method}`"}, {}
    seconds: dict[str, list[float]] = {}
    for session, group in groupby(rows, lambda row: row.session):
        some = list(group)
        columns[f"{session}, {some[0].frames} x {some[0].kilopixels:.0f} kpx"] = f"{{{session}}}"
        for row in some:
            shown = "no answer" if row.mean_deg is None else f"{row.mean_deg:.2f}°"
            cells.setdefault(row.method, {"method": row.method})[session] = shown
            seconds.setdefault(row.method, []).append(row.seconds)
    for method, some in seconds.items():
        cells[method]["seconds"] = f"{_two_digits(min(some))} to {_two_digits(max(some))}"
    columns["seconds"] = "{seconds}"
    pictures = [f"\n![{name}]({_chart_name(name)})\n\n{_front(some)}\n" for name, some in _points(rows).items()]
    return "".join([markdown(columns, cells.values()), *pictures])


def _points(rows: Sequence[MethodRow]) -> dict[str, list[SpeedPoint]]:
    """Return each session's points: the methods with an answer."""
    return {
        session: [
            SpeedPoint(row.method, family(row.method), "real", row.seconds, row.median_deg)
            for row in group
            if row.median_deg
        ]
        for session, group in groupby(rows, lambda row: row.session)
    }


def _two_digits(value: float) -> str:
    """Return 0.025 of 0.0251, and 100 of 101, which the format alone writes as 1e+02."""
    return f"{float(f'{value:.2g}'):g}"


def _front(points: Sequence[SpeedPoint]) -> str:
    """Return in a sentence what each amount of time buys at best."""
    best = [
        f"`{one.method}` ({_two_digits(one.seconds)} s, {_two_digits(one.median_deg)}°)" for one in pareto_front(points)
    ]
    return f"Nothing is better than {', '.join(best)}."


def _error_figures(rows: Sequence[MethodRow]) -> Figures:
    known = [row for row in rows if row.mean_deg is not None]
    means = {f"{row.session}: {row.method}, mean_deg": row.mean_deg for row in known if row.mean_deg is not None}
    least = {
        f"{session}: least, mean_deg": min(row.mean_deg for row in group if row.mean_deg is not None)
        for session, group in groupby(known, lambda row: row.session)
    }
    return means | least | {
        f"{row.session}: {row.method}, median_deg": row.median_deg for row in known if row.median_deg is not None
    }  # fmt: skip


def _chart_name(session: str) -> str:
    return f"speed-{session.lower().replace(' ', '-')}.svg"


def _charts(rows: Sequence[MethodRow]) -> dict[str, str]:
    return {
        _chart_name(session): speed_chart(points, label=f"Time against median angular error, {session}")
        for session, points in _points(rows).items()
    }


@dataclass(frozen=True)
class PixelwiseRow:
    """One method on a picture of a glossy, noisy ball: seconds of the wall's clock, and of processors a megapixel."""

    method: str
    megapixels: float
    wall_s: float
    processor_s: float
    to_reading: float
    mean_deg: float | None


def ball(side: int) -> tuple[Frames, Lights, np.ndarray]:
    """Return frames, lights and true normals (side, side, 3) of a ball that fills a square picture."""
    rng = np.random.default_rng(SEED)
    k = np.arange(LIGHTS)
    z = 1 - (1 - np.cos(np.radians(50.0))) * (k + 0.5) / LIGHTS
    across, azimuth = np.sqrt(1 - z**2), k * 2.39996
    directions = np.stack([across * np.cos(azimuth), across * np.sin(azimuth), z], -1)
    y, x = np.mgrid[1 : -1 : side * 1j, -1 : 1 : side * 1j]
    # The ball is larger than the picture: every pixel is on it, the corners almost at the limb.
    normals = np.stack([0.69 * x, 0.69 * y, np.sqrt(np.clip(1 - 0.476 * (x**2 + y**2), 0.01, 1))], -1)
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    albedo = 0.35 + 0.1 * np.sin(20 * x) * np.sin(17 * y)
    half = directions + [0, 0, 1]
    half /= np.linalg.norm(half, axis=1, keepdims=True)
    codes = np.empty((LIGHTS, side, side, 3), np.uint16)
    for f in range(LIGHTS):
        shade = albedo * np.maximum(normals @ directions[f], 0) + 0.3 * np.clip(normals @ half[f], 0, 1) ** 100
        noise = 0.003 * rng.standard_normal((side, side), np.float32)
        codes[f] = np.clip((shade[..., None] * [1.0, 0.8, 0.6] + noise[..., None]) * 60_000 + 2048.5, 0, 65_535)
    names = tuple(f"{f:03d}" for f in range(LIGHTS))
    return Frames(names, codes, np.ones(LIGHTS)), Lights(names, directions, np.ones((LIGHTS, 3))), normals


@numba.njit(nogil=True)
def _total(values):
    total = np.uint64(0)
    for i in range(len(values)):
        total += values[i]
    return total


def _clocked(work: Callable[[], object]) -> tuple[float, float]:
    """Return the least wall and the least processor seconds of some rounds."""
    spent = []
    for _ in range(ROUNDS):
        start = now()
        work()
        spent.append(tuple(since(start).values()))
    return tuple(np.min(spent, axis=0))


def _pixelwise(side: int) -> list[PixelwiseRow]:
    frames, lights, normals = ball(side)
    camera, mask, millions = Camera.orthographic(side, side), np.ones((side, side), bool), side * side / 1e6
    pieces = np.array_split(frames.codes.reshape(-1), 64)
    with ThreadPoolExecutor(os.cpu_count() or 1) as pool:
        wall, reading = _clocked(lambda: list(pool.map(_total, pieces)))
    rows = [PixelwiseRow(READING, millions, wall, reading / millions, 1.0, None)]
    for method in ALONE:
        found = solve(method, frames, lights, camera, mask)
        wall, processor = _clocked(lambda method=method: solve(method, frames, lights, camera, mask))
        error = float(np.nanmean(angular_error_deg(found.normals, normals)))
        rows.append(PixelwiseRow(method, millions, wall, processor / millions, processor / reading, error))
    return rows


TABLES = (
    Table(
        "methods", "table", ("lab.run",), MethodRow, _sessions, _solved, _errors, _error_figures, _charts,
        is_timed=True, is_steady=True,
    ),
    Table(
        "methods", "speed", ("solve.solve", "solve.methods"), PixelwiseRow,
        lambda scale: [({"small": 128, "gates": 512, "full": 1024}[scale],)], _pixelwise,
        lambda rows: markdown(
            {
                f"method, {rows[0].megapixels:.2f} megapixels x {LIGHTS}": "{method}",
                "processor, s a megapixel": "{processor_s:.2f}", "to reading": "{to_reading:.1f}",
                "error": "{mean_deg:.2f}°",
            },
            rows,
        ),
        lambda rows: {f"{row.method}, processor to reading": row.to_reading for row in rows[1:]},
        is_timed=True,
    ),
)  # fmt: skip
