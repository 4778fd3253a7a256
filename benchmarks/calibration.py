"""Balls and lights against truth: in scenes by other programs' renderers, then in our own.

Scenes by others lie beside the project (`SHARED`), and in out/scenes, where their generators wrote them:

    python ../shared/tools/ball_scenes.py out/scenes/mitsuba --first 1200 --count 30
    python ../shared/tools/blender_session.py out/scenes/blender --first 200 --count 8 --width 660   (needs bpy)

Seeds 200 to 219 of Blender's and from 1200 on of the other are for reporting: nothing is tuned on them.
"""

import json
import tempfile
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.calibration_sessions import directions_to, reflection_points, session
from benchmarks.harness import ROOT, SHARED, Figures, Scale, Table, folded, markdown, opened, spread
from calibrate.calibrate import calibrate
from calibrate.calibration import Calibration, CrossValidation
from calibrate.detection.balls import find_balls
from fixtures.random_scenes import judge, random_scene
from lab.run import STEPS
from scene.clock import now, since
from scene.errors import SceneError
from scene.lights import Lights
from scene.normals import angular_error_deg
from scene.spheres import Sphere

SCENES = ROOT / "out" / "scenes"
SAME, SAME_PX = 0.04, 1.5
"""Share of the radius, and pixels at least, by which a found ball's circle may differ from the true one."""
INSIDE_2 = 5.991
"""95 % quantile of chi-square with 2 degrees of freedom."""
FAIR = 0.5, 1.5  # between which balls, each alone, differ by about what is stated of them
OURS = {"two": "two chrome balls of 67 px, a white one", "four": "four of 67 px, a white one", "one": "one of 170 px",
        "far": "two of 67 px, a white one, distant flash"}  # fmt: skip
COUNTS = {"two": 14, "four": 10, "one": 10, "far": 5}


@dataclass(frozen=True)
class SessionRow:
    """What came of one session.

    Lists are of balls or of lights; angles are those of the lights' directions at the session's reference point.
    `asked`: session.toml says which balls there are.
    """

    group: str
    name: str
    asked: bool
    refused: str
    warnings: int
    balls: int
    false: tuple[str, ...]
    missed: tuple[str, ...]
    radius_off_px: tuple[float, ...]
    radius_sigma_px: tuple[float, ...]
    direction_deg: tuple[float, ...]
    sigma_deg: tuple[float, ...]
    position_percent: tuple[float, ...]
    intensity_percent: tuple[float, ...]
    alone: float | None  # what balls, each alone, differ by, over their stated doubt
    processor_s: float


@dataclass(frozen=True)
class Truth:
    """Balls, the lights' positions (F, 3) mm, their strengths (F, C) as radiant intensities; where there is an object,
    the pose (4, 4) of its scan, and its normals (H, W, 3), NaN beyond.
    """

    balls: list[Sphere]
    lights_mm: np.ndarray
    power: np.ndarray | None
    camera_from_scan: np.ndarray | None = None
    normals: np.ndarray | None = None


def scenes_of(folder: Path) -> list[Path]:
    """Return the scenes in a folder: each has truth.json."""
    return [path.parent for path in sorted(folder.glob("*/truth.json"))]


def read_truth(scene: Path) -> Truth:
    """Return what truth.json, and truth.npz where it is there, say."""
    said = json.loads((scene / "truth.json").read_text())
    more = np.load(scene / "truth.npz") if (scene / "truth.npz").is_file() else {}
    balls = [
        Sphere(
            one["kind"], np.array(one["centre_px"]), said["fx"] * one["diameter_mm"] / 2 / -one["centre_mm"][2],
            one["diameter_mm"],
        )
        for one in said["spheres"]
    ]  # fmt: skip
    lights = np.array(said.get("light_positions_mm", more.get("light_positions_mm") if more else None))
    power = said.get("light_power", more.get("light_power") if more else None)
    pose, normals = said.get("camera_from_scan"), None
    if "normals" in more:
        normals = np.where(more["mask"][..., None], more["normals"].astype(float), np.nan)
    power = None if power is None else np.reshape(power, (len(lights), -1))
    return Truth(balls, lights, power, None if pose is None else np.array(pose), normals)


def is_same(found: Sphere, true: Sphere) -> bool:
    """Whether a found ball is the true one."""
    off = max(float(np.hypot(*(found.center_px - true.center_px))), abs(found.radius_px - true.radius_px))
    return found.kind == true.kind and off < max(SAME_PX, SAME * true.radius_px)


def _ball(ball: Sphere) -> str:
    return f"{ball.kind} of {ball.radius_px:.0f} px"


def _row(
    group: str, name: str, truth: Truth, found: Calibration | str, spent: float, *, asked: bool = True
) -> SessionRow:
    """Hold a calibration, or the message that refused it, against the truth."""
    if isinstance(found, str):
        missed = tuple(map(_ball, truth.balls))
        return SessionRow(
            group, name, asked, found, 0, len(truth.balls), (), missed, (), (), (), (), (), (), None, spent
        )
    left, missed, off, sigma = list(found.spheres), [], [], []
    for one in truth.balls:
        match = next((ball for ball in left if is_same(ball, one)), None)
        if match is None:
            missed.append(_ball(one))
            continue
        left = [ball for ball in left if ball is not match]
        if one.kind == "chrome":
            off.append(match.radius_px - one.radius_px)
            sigma.append(float(match.sigma_px or np.nan))
    direction, stated, position, intensity = of_lights(found.lights, truth) if asked else ((), (), (), ())
    return SessionRow(
        group, name, asked, "", len(found.warnings), len(truth.balls), tuple(map(_ball, left)), tuple(missed),
        tuple(off), tuple(sigma), direction, stated, position, intensity,
        found.cross_validation and found.cross_validation.ratio, spent,
    )  # fmt: skip


def of_lights(lights: Lights, truth: Truth) -> tuple[tuple[float, ...], ...]:
    """Return errors and sigmas of directions, errors of positions and of intensities at the reference point."""
    point, sigma = lights.reference_point_mm, lights.direction_sigma_deg
    direction = angular_error_deg(lights.directions, directions_to(truth.lights_mm, point))
    away = np.linalg.norm(truth.lights_mm - point, axis=1)
    position, intensity = (), ()
    if lights.positions_mm is not None:
        position = tuple(100 * np.linalg.norm(lights.positions_mm - truth.lights_mm, axis=1) / away)
    if truth.power is not None:
        strength = truth.power.mean(1) / away**2
        intensity = tuple(100 * (lights.intensities.mean(1) / (strength / strength.mean()) - 1))
    known = np.full(len(direction), np.nan) if sigma is None else sigma
    return tuple(direction), tuple(known), position, intensity


def _others(group: str, folder: str, mode: str) -> list[SessionRow]:
    """Calibrate a session by others as its user would."""
    scene = Path(folder)
    place, truth, start = scene / mode if mode else scene, read_truth(scene), now()
    try:
        with tempfile.TemporaryDirectory() as out, opened(place, Path(out)) as job:
            job.run(STEPS, "check")
            start = now()
            job.run(STEPS, "calibrate")
            store, done = job.store, job.done["calibrate"]
            shown, alone = np.zeros((0, len(truth.lights_mm), 2)), done["result"]["cross_validation"]
            said = {"warnings": tuple(done["warnings"]), "cross_validation": alone and CrossValidation(**alone)}
            found = Calibration(store.load_spheres(), store.load_lights(), shown, **said)
    except SceneError as error:
        found = str(error).replace(str(scene), scene.name)
    spent = since(start)["processor_seconds"]
    return [_row(group, scene.name, truth, found, spent, asked=mode != "unasked")]


def _ours(kind: str, seed: int) -> list[SessionRow]:
    """Calibrate a session of the virtual camera; with one ball directions hold where it reflects."""
    made = session(seed, kind)
    world, start = made.world, now()
    truth = Truth(world.spheres(), world.lights, np.asarray(world.powers))
    try:
        found = calibrate(made.frames, world.camera, world.requests())
    except SceneError as error:
        found = str(error)
    spent = since(start)["processor_seconds"]
    row = _row(OURS[kind], f"seed {seed}", truth, found, spent)
    if kind != "one" or isinstance(found, str):
        return [row]
    points = reflection_points(world.camera, next(b for b in world.balls if b.kind == "chrome"), world.lights)
    off = angular_error_deg(found.lights.directions, directions_to(world.lights, points))
    return [replace(row, direction_deg=tuple(off))]


def _measured(where: str, *case: Any) -> list[SessionRow]:
    return _ours(*case) if where == "ours" else _others(where, *case)


def _cases(scale: Scale) -> list[tuple]:
    if scale == "small":
        return [("the fixture", str(ROOT / "fixtures" / "bumpy"), "")]
    mitsuba, blender = scenes_of(SCENES / "mitsuba"), scenes_of(SCENES / "blender")
    handed = scenes_of(SHARED / "sessions")
    if scale == "gates":
        mitsuba, blender = mitsuba[:4], blender[:1]
    modes = ("asked", "unasked") if scale == "full" else ("asked",)
    found: list[tuple] = [("Mitsuba, balls among clutter", str(one), mode) for one in mitsuba for mode in modes]
    found += [("Cycles", str(one), mode) for one in blender for mode in modes]
    found += [
        ("Cycles, handed out", str(one), "asked") if (one / "asked").is_dir() else ("path-traced bunny", str(one), "")
        for one in handed
    ]
    return found + [
        ("ours", kind, seed) for kind, most in COUNTS.items() for seed in range(most if scale == "full" else 1)
    ]


def _summary(rows: Sequence[SessionRow]) -> dict[str, Any]:
    """Return the figures of one group."""
    lit = [row for row in rows if row.direction_deg]
    direction, sigma = (
        np.array([x for row in lit for x in getattr(row, name)]) for name in ("direction_deg", "sigma_deg")
    )
    off, off_sigma = (
        np.array([x for row in rows for x in getattr(row, name)]) for name in ("radius_off_px", "radius_sigma_px")
    )
    alone = np.array([row.alone for row in rows if row.alone is not None])
    there, missed = sum(row.balls for row in rows), sum(len(row.missed) for row in rows)
    silent = sum(bool(row.false or row.missed) and not (row.warnings or row.refused) for row in rows)
    return {
        "sessions": len(rows), "there": there, "found": there - missed, "false": sum(len(row.false) for row in rows),
        "refused": sum(bool(row.refused) for row in rows), "silent": silent,
        "radius": spread(np.abs(off)), "radius_median_px": _or_none(np.median, off),
        "radius_inside": _or_none(np.mean, np.abs(off) < 2 * off_sigma),
        "direction": spread([np.median(row.direction_deg) for row in lit], "{:.3f}"),
        "direction_median_deg": _or_none(np.median, direction), "direction_p95_deg": _or_none(_p95, direction),
        "worst_deg": _or_none(np.max, direction), "sigma_deg": _or_none(np.nanmedian, sigma),
        "inside": _or_none(np.mean, direction**2 < INSIDE_2 * sigma**2),
        "alone": _or_none(np.median, alone), "alone_fair": _or_none(np.mean, (alone > FAIR[0]) & (alone < FAIR[1])),
        "position_percent": _or_none(np.median, np.array([x for row in rows for x in row.position_percent])),
        "intensity_rms_percent": _or_none(_rms, np.array([x for row in rows for x in row.intensity_percent])),
        "processor_s": _or_none(np.median, np.array([row.processor_s for row in rows])),
    }  # fmt: skip


def _or_none(of: Any, values: np.ndarray) -> float | None:
    return float(of(values)) if len(values) else None


def _p95(values: np.ndarray) -> float:
    return float(np.nanquantile(values, 0.95))


def _rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.nanmean(values**2)))


def _groups(rows: Iterable[SessionRow]) -> dict[str, list[SessionRow]]:
    """Return the sessions by group; those that do not name their balls are groups of their own, after the others."""
    found: dict[str, list[SessionRow]] = {}
    for row in sorted(rows, key=lambda row: not row.asked):
        found.setdefault(row.group if row.asked else f"{row.group}, balls not named", []).append(row)
    return found


def _shown(rows: Sequence[SessionRow]) -> str:
    groups = {name: _summary(some) for name, some in _groups(rows).items()}
    of_balls = markdown(
        {
            "balls": "{group}", "sessions": "{sessions}", "found": "{found} of {there}", "false": "{false}",
            "refused": "{refused}", "wrong, and not said": "{silent}", "chrome radius off, px: median, p95": "{radius}",
            "signed": "{radius_median_px:+.3f}", "within two sigmas": "{radius_inside:.0%}",
        },
        [{"group": name, **one} for name, one in groups.items()],
    )  # fmt: skip
    of_lights = markdown(
        {
            "lights": "{group}", "direction, degrees: median": "{direction_median_deg:.3f}",
            "p95": "{direction_p95_deg:.2f}", "worst": "{worst_deg:.2f}", "stated sigma": "{sigma_deg:.3f}",
            "inside the 95 % region": "{inside:.0%}", "balls alone, over stated": "{alone:.2f}",
            "of these 0.5 to 1.5": "{alone_fair:.0%}", "position, of the distance": "{position_percent:.2f} %",
            "intensity, rms": "{intensity_rms_percent:.2f} %", "processor, s": "{processor_s:.0f}",
        },
        [{"group": name, **one} for name, one in groups.items() if one["direction_median_deg"] is not None],
    )  # fmt: skip
    wrong = folded("The sessions in which something was wrong", map(_wrong, filter(_is_wrong, rows)))
    return f"{of_balls}\n{of_lights}\n{wrong}"


def _is_wrong(row: SessionRow) -> bool:
    sigma = np.nanmedian(row.sigma_deg) if row.direction_deg else np.nan
    is_off = bool(row.direction_deg) and np.median(row.direction_deg) > max(1.0, 2 * sigma)
    return bool(row.refused or row.false or row.missed or is_off)


def _wrong(row: SessionRow) -> str:
    said = [f"refused: {row.refused}"] if row.refused else []
    said += [f"missed {', '.join(row.missed)}"] * bool(row.missed and not row.refused)
    said += [f"false: {', '.join(row.false)}"] * bool(row.false)
    if row.direction_deg:
        said.append(f"lights {np.median(row.direction_deg):.2f}°, stated {np.nanmedian(row.sigma_deg):.2f}°")
    return f"{row.group}, {row.name}{'' if row.asked else ', not named'}: {'; '.join(said)}"


def _figures(rows: Sequence[SessionRow]) -> Figures:
    kept = ("found", "false", "refused", "silent", "radius_median_px", "radius_inside", "direction_median_deg",
            "worst_deg", "sigma_deg", "inside", "alone", "alone_fair", "position_percent",
            "intensity_rms_percent")  # fmt: skip
    found: Figures = {}
    for name, some in _groups(rows).items():
        one = _summary(some)
        found |= {f"{name}: {key}": float(one[key]) for key in kept if one[key] is not None}
    return found


@dataclass(frozen=True)
class SceneRow:
    """Balls sought in one random scene of ours, without any hint."""

    seed: int
    wanted: int
    found: int
    false: tuple[str, ...]
    missed: tuple[str, ...]
    processor_s: float


def _sought(seed: int, width: int) -> list[SceneRow]:
    scene = random_scene(seed, width=width, height=width * 2 // 3)
    frames, start = scene.photograph(), now()
    try:
        found = [ball.sphere for ball in find_balls(frames, scene.world.camera, [])[0]]
    except SceneError:
        found = []
    verdict = judge(found, scene)
    spent = since(start)["processor_seconds"]
    return [SceneRow(seed, verdict.wanted, verdict.found, tuple(verdict.false), tuple(verdict.missed), spent)]


def _balls(rows: Sequence[SceneRow]) -> str:
    wrong = [
        f"seed {row.seed}: {'; '.join([*(f'missed {x}' for x in row.missed), *(f'false {x}' for x in row.false)])}"
        for row in rows
        if row.missed or row.false
    ]
    wanted, found = sum(row.wanted for row in rows), sum(row.found for row in rows)
    text = (
        f"{wanted} balls to be found in {len(rows)} scenes: {found} found ({found / wanted:.1%}), "
        f"{sum(len(row.false) for row in rows)} false; {np.median([row.processor_s for row in rows]):.1f} processor "
        "seconds a scene (median).\n\n"
    )
    return text + folded("The scenes in which something was wrong", wrong)


TABLES = (
    Table(
        "calibration", "lights", ("lab.run",), SessionRow, _cases, _measured, _shown, _figures,
    ),
    Table(
        "calibration", "balls", ("calibrate.detection.balls",), SceneRow,
        # A ball of 15 px is as hard to find in a smaller picture, and takes half the time.
        lambda scale: [(1, 300)] if scale == "small" else [(n, 900) for n in range(6 if scale == "gates" else 100)],
        _sought, _balls,
        lambda rows: {
            "found": sum(row.found for row in rows) / sum(row.wanted for row in rows),
            "false": float(sum(len(row.false) for row in rows)),
        },
    ),
)  # fmt: skip
