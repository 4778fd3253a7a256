"""What can be done to a scene's lights: functions from one description to the next."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from scene.errors import RenderError
from scene.lights import Lights
from twin.description.description import TwinScene
from twin.description.light_groups import LightGroup, expand

Array = NDArray[np.float64]


def with_lights(scene: TwinScene, groups: Sequence[LightGroup], folder: Path) -> TwinScene:
    """Return the scene in these lights alone.

    groups: Of `twin.description.description_tables`, as a description's [[lights]]. folder: What a session's file is
    relative to. Raises RenderError: as in `twin.description.light_groups.expand`.
    """
    lights, radii = expand(groups, folder, scene.lights.reference_point_mm)
    return replace(scene, lights=lights, radii_mm=radii)


def with_more_lights(scene: TwinScene, groups: Sequence[LightGroup], folder: Path) -> TwinScene:
    """Return the scene with these lights beside those that it has; names that are taken are numbered on.

    Raises RenderError: as in `expand`; or some are near and the others distant.
    """
    was = scene.lights
    more, radii = expand(groups, folder, was.reference_point_mm)
    if (more.positions_mm is None) != (was.positions_mm is None):
        raise RenderError(
            f"lights: those of the scene are {was.model}, these are {more.model}; all must be of one sort. Replace "
            "them, or give these the same."
        )
    if not np.array_equal(more.reference_point_mm, was.reference_point_mm):
        raise RenderError(
            "lights: a session's lights have their own reference point and stand alone. Replace the others."
        )
    taken, names = set(was.names), []
    for name in more.names:
        names.append(_free(name, taken))
        taken.add(names[-1])
    positions = None
    if was.positions_mm is not None and more.positions_mm is not None:
        positions = np.concatenate([was.positions_mm, more.positions_mm])
    lights = Lights(
        (*was.names, *names),
        np.concatenate([was.directions, more.directions]),
        np.concatenate([was.intensities, more.intensities]),
        positions,
        was.reference_point_mm,
        white_value=was.white_value,
    )
    return replace(scene, lights=lights, radii_mm=np.concatenate([scene.radii_mm, radii]))


def moved_light(scene: TwinScene, index: int, place_mm: ArrayLike) -> TwinScene:
    """Return the scene with a light at a place (3,): a near one stands there, a distant one shines from that way.

    Raises RenderError: the place is the reference point, where the light's intensity is to hold.
    """
    lights, place = scene.lights, np.asarray(place_mm, float)
    away = place - lights.reference_point_mm
    distance = float(np.linalg.norm(away))
    if not np.isfinite(distance) or distance < 1e-6:
        raise RenderError(f"lights {lights.names[index]}: would stand in the reference point. Move it elsewhere.")
    positions = None if lights.positions_mm is None else _with_row(lights.positions_mm, index, place)
    directions = _with_row(lights.directions, index, away / distance)
    return replace(scene, lights=replace(lights, directions=directions, positions_mm=positions))


def with_intensity(scene: TwinScene, index: int, intensity: ArrayLike) -> TwinScene:
    """Return the scene with a light of another intensity (3,).

    Raises RenderError: it is negative or not finite.
    """
    value = np.asarray(intensity, float)
    if not np.isfinite(value).all() or (value < 0).any():
        raise RenderError(f"lights {scene.lights.names[index]}: intensity {value}; expected numbers of 0 or more.")
    intensities = _with_row(scene.lights.intensities, index, value)
    return replace(scene, lights=replace(scene.lights, intensities=intensities))


def without_light(scene: TwinScene, index: int) -> TwinScene:
    """Return the scene without a light.

    Raises RenderError: it is the only one.
    """
    if len(scene.lights) == 1:
        raise RenderError("lights: this is the only one; a scene has at least one.")
    rest = [number for number in range(len(scene.lights)) if number != index]
    return replace(scene, lights=some(scene.lights, rest), radii_mm=scene.radii_mm[rest])


def some(lights: Lights, indices: Sequence[int]) -> Lights:
    """Return some of the lights, in this order."""
    rows = list(indices)
    return replace(
        lights,
        names=tuple(lights.names[i] for i in rows),
        directions=lights.directions[rows],
        intensities=lights.intensities[rows],
        positions_mm=None if lights.positions_mm is None else lights.positions_mm[rows],
        direction_sigma_deg=lights.direction_sigma_deg[rows],
        intensity_sigma=lights.intensity_sigma[rows],
        flags=tuple(lights.flags[i] for i in rows),
    )


def _free(name: str, taken: set[str]) -> str:
    if name not in taken:
        return name
    stem = name.rstrip("0123456789").rstrip("_") or name
    return next(f"{stem}_{i:03d}" for i in range(10**6) if f"{stem}_{i:03d}" not in taken)


def _with_row(rows: Array, index: int, value: Array) -> Array:
    changed = rows.copy()
    changed[index] = value
    return changed
