"""The order in which the photographs put all methods against the true one: sessions with ground truth, scenes by seed.

The scenes are drawn with known truth: an object, its material, its lights and what calibration gets wrong of them.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import groupby
from typing import Any

import numpy as np
from scipy.stats import spearmanr

from benchmarks.harness import Figures, Scale, Table, markdown
from benchmarks.methods import SESSIONS
from benchmarks.sessions import Registered, registered, with_truth
from experiments.photographs import photograph_dataset
from experiments.recipe import Dataset, Recipe
from experiments.scenes import dataset_scene
from scene.clock import now, since
from scene.errors import SceneError
from scene.lights import Lights
from scene.method_names import METHODS, UNCALIBRATED
from scene.normals import angular_error_deg, unit
from scene.spheres import WHITE_BALL_ALBEDO
from solve.frame_intensities import corrected
from solve.solve import solve
from solve.trust import trust
from twin.camera.virtual_camera import NO_FILTER, Sensor
from twin.ground_truth import ground_truth

SHAPES = {"pear": (1, 1), "blob": (1, 1), "knot": (1, 1), "cone": (0.3, 1.0), "bowl": (0.2, 0.8), "waves": (0.4, 1.2),
          "ridges": (0.5, 1.5)}  # fmt: skip
"""Least and greatest relief."""
MATERIALS = ("diffuse", "diffuse_texture", "specular", "specular_texture")
COUNTS = (8, 12, 16, 24, 48)
FIRST, SIDE = 300, 220
"""Seeds below were looked at while `trust` was made; pixels along a picture's side."""


def trust_scene(seed: int, side: int) -> tuple[str, Registered]:
    """Return a scene's name, and the scene: every choice is drawn from the seed."""
    draw = np.random.default_rng([seed, 21])
    shape = str(draw.choice(list(SHAPES)))
    recipe = Recipe(
        shape=shape, relief=float(draw.uniform(*SHAPES[shape])), material=str(draw.choice(MATERIALS)),
        reflectance=float(draw.uniform(0.25, 0.85)), roughness=float(np.exp(draw.uniform(np.log(0.05), np.log(0.5)))),
        specularity=float(draw.uniform(0.3, 1.0)), count=int(draw.choice(COUNTS)),
        polar_deg=float(draw.uniform(35, 70)), depth=6, side=side, seed=seed,
    )  # fmt: skip
    is_near = bool(draw.random() < 0.5)
    sensor = Sensor(cfa=NO_FILTER, iso=float(draw.choice([100, 400, 1600])))
    name = f"{seed}: {shape}, {recipe.material}, {recipe.count} {'near' if is_near else 'distant'} lights"
    near = float(draw.uniform(600, 1500)) if is_near else 0.0
    dataset = Dataset(name, "trust", name, recipe, near_mm=near, hand_held=is_near, sensor=sensor)
    shot = photograph_dataset(dataset)
    # What a white ball beside the object would show.
    exposure = float(np.nanmedian(shot.albedo / ground_truth(dataset_scene(dataset)).albedo))
    lights = replace(_calibrated(shot.lights, draw), white_value=np.full(3, exposure * WHITE_BALL_ALBEDO))
    return name, Registered(shot.frames, lights, shot.camera, shot.mask, shot.normals)


def _calibrated(lights: Lights, draw: np.random.Generator) -> Lights:
    """Return lights with the errors of a calibration, which are as large as their sigmas say."""
    angle, share = float(draw.uniform(0.1, 1.0)), float(draw.uniform(0.003, 0.02))
    aside = np.radians(angle) * draw.standard_normal(lights.directions.shape)
    along = np.sum(aside * lights.directions, 1, keepdims=True) * lights.directions
    directions = unit(lights.directions + aside - along)
    intensities = lights.intensities * (1 + share * draw.standard_normal((len(lights), 1)))
    positions = lights.positions_mm
    if positions is not None:
        away = np.linalg.norm(positions - lights.reference_point_mm, axis=1, keepdims=True)
        positions = lights.reference_point_mm + directions * away * (1 + 0.01 * draw.standard_normal(away.shape))
    many = np.ones(len(lights))
    return replace(
        lights, directions=directions, intensities=intensities, positions_mm=positions,
        direction_sigma_deg=angle * many, intensity_sigma=share * many,
    ).normalised()  # fmt: skip


@dataclass(frozen=True)
class TrustRow:
    """One method on one scene: what it leaves unexplained, how far it is from the recommended one, its true error; and
    of the scene what the recommended one leaves unexplained, relative, rms, the share of its pixels whose error lies
    within two stated sigmas, and the processor seconds of the judgement.
    """

    group: str
    scene: str
    method: str
    is_recommended: bool
    unexplained: float
    apart_deg: float
    median_deg: float
    mean_deg: float
    relative_rmse: float
    within_sigmas: float
    processor_s: float


def _judged(group: str, which: Any, methods: str, side: int) -> list[TrustRow]:
    if group == "scenes":
        return _rows(group, *trust_scene(which, side), methods)
    try:
        with registered({**with_truth(), **SESSIONS}[which]) as session:
            return _rows(group, which, session, methods)
    except SceneError:
        # It is not registered: sessions/sessions says why.
        return []


def _rows(group: str, name: str, shot: Registered, methods: str) -> list[TrustRow]:
    frames, lights, camera, mask, truth, _ = shot
    lights, _ = corrected(frames, lights, camera, mask)
    answers = {method: solve(method, frames, lights, camera, mask).normals for method in methods.split(",")}
    start = now()
    judged = trust(frames, lights, camera, mask, answers)
    seconds, rows = since(start)["processor_seconds"], []
    off, sigma = angular_error_deg(answers[judged.recommended], truth)[mask], judged.sigma_deg[mask]
    within = float(np.mean(off[np.isfinite(off)] <= 2 * sigma[np.isfinite(off)]))
    for method, normals in answers.items():
        error, told = angular_error_deg(normals, truth)[mask], judged.methods[method]
        rows.append(
            TrustRow(
                group, name, method, method == judged.recommended, told.unexplained or 0.0, told.apart_deg,
                float(np.nanmedian(error)), float(np.nanmean(error)), judged.relative_rmse, within, seconds,
            )
        )  # fmt: skip
    return rows


def _cases(scale: Scale) -> list[tuple]:
    if scale == "small":
        return [("scenes", FIRST + 1, "ls,iterative,l1", 40)]
    every = ",".join(METHODS)
    there = {name: place for name, place in {**with_truth(), **SESSIONS}.items() if place.is_dir()}
    names = sorted(there, key=lambda name: name == "fixture")
    if scale == "gates":
        return [("sessions", names[0], every, SIDE), ("scenes", FIRST + 2, every, SIDE)]
    return [("sessions", name, every, SIDE) for name in names] + [
        ("scenes", seed, every, SIDE) for seed in range(FIRST, FIRST + 8)
    ]


def _verdicts(rows: Sequence[TrustRow]) -> list[dict[str, Any]]:
    """Return what is said of each scene: see the columns of `_shown`."""
    verdicts = []
    for (group, scene), some in groupby(rows, lambda row: (row.group, row.scene)):
        every = list(some)
        least, taken = min(row.mean_deg for row in every), next(row for row in every if row.is_recommended)
        verdicts.append({
            "group": group, "scene": scene, "recommended": taken.method, "over_least": taken.mean_deg / least,
            "rank": _rank(every), "rank_calibrated": _rank([row for row in every if row.method not in UNCALIBRATED]),
            "relative_rmse": taken.relative_rmse, "within_sigmas": taken.within_sigmas,
        })  # fmt: skip
    return verdicts


def _rank(rows: Sequence[TrustRow]) -> float:
    ranked: Any = spearmanr([row.apart_deg for row in rows], [row.mean_deg for row in rows])
    return float(ranked.statistic)


def _means(verdicts: Sequence[dict[str, Any]]) -> dict[str, float]:
    """Return means over scenes, of the ratio the geometric one."""
    means = {key: float(np.mean([one[key] for one in verdicts])) for key, value in verdicts[0].items()
             if isinstance(value, float)}  # fmt: skip
    return means | {"over_least": float(np.exp(np.mean(np.log([one["over_least"] for one in verdicts]))))}


def _shown(rows: Sequence[TrustRow]) -> str:
    verdicts, text = _verdicts(rows), ""
    for group, some in groupby(verdicts, lambda one: one["group"]):
        every = list(some)
        text += markdown(
            {
                group: "{scene}", "rank correlation": "{rank:.2f}",
                "recommended": "{recommended}", "its error over the least": "{over_least:.2f}",
                "within two sigmas": "{within_sigmas:.0%}", "unexplained, rms": "{relative_rmse:.1%}",
            },
            [*every, {"scene": f"all {len(every)}", "recommended": "", **_means(every)}],
        ) + "\n"  # fmt: skip
    return text


def _figures(rows: Sequence[TrustRow]) -> Figures:
    return {
        f"{group}: {key}": _means(list(some))[key]
        for group, some in ((g, list(s)) for g, s in groupby(_verdicts(rows), lambda one: one["group"]))
        for key in ("rank", "rank_calibrated", "over_least", "relative_rmse", "within_sigmas")
    }


TABLES = (Table("trust", "trust", ("lab.run", "experiments.photographs"), TrustRow, _cases, _judged, _shown, _figures),)
