"""Lights as a person writes them - single ones, rings, grids on a hemisphere, a session's own - to `Lights`."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from scene.errors import RenderError
from scene.lights import Lights
from scene.store import Store
from twin.description.description import white_of
from twin.description.description_tables import GridTable, LightTable, RingTable, SessionLightsTable

Array = NDArray[np.float64]


LightGroup = LightTable | RingTable | GridTable | SessionLightsTable


def direction(azimuth_deg: ArrayLike, elevation_deg: ArrayLike) -> Array:
    """Return unit vectors (..., 3).

    Azimuth counts from x (right) toward y (up), counter-clockwise as the camera sees it; elevation from the picture's
    plane toward the viewer: 90 is z, straight from the camera.
    """
    azimuth, elevation = (np.radians(np.asarray(angle, float)) for angle in (azimuth_deg, elevation_deg))
    x, y, z = np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)
    return np.stack(np.broadcast_arrays(x, y, z), -1)


def expand(groups: Sequence[LightGroup], folder: Path, reference_mm: Array) -> tuple[Lights, Array]:
    """Return the lights of a description's [[lights]], in their order, and their radii in mm (0: points).

    Parameters
    ----------
    groups : sequence of tables
        Of `twin.description.description_tables`.
    folder : Path
        What a session's file is relative to.
    reference_mm : (3,) float64
        Where intensities hold and rings and grids have their middle.

    Raises
    ------
    RenderError
        Distant and near lights together, names that occur twice, a light in the reference point, or a session's lights
        beside others.
    """
    session = next((group for group in groups if isinstance(group, SessionLightsTable)), None)
    if session is not None:
        if len(groups) > 1:
            raise RenderError(
                f'lights: found {len(groups)} groups, one of them kind = "session"; a session\'s lights have their own '
                "reference point and stand alone. Drop the others, or write its lights out one by one."
            )
        return _session(session, folder)
    names: list[str] = []
    offsets, near, radii, intensities = [], [], [], []
    for group in groups:
        assert not isinstance(group, SessionLightsTable)
        found = _offsets(group, reference_mm)
        names += _names(group, len(found), names)
        offsets.append(found)
        near += [_is_near(group)] * len(found)
        radii += [group.radius_mm or 0.0] * len(found)
        intensities += [group.intensity] * len(found)
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise RenderError(f"lights: {', '.join(twice[:3])} occurs twice; each light is one frame and names it.")
    if any(near) and not all(near):
        raise RenderError(
            f"lights: {sum(near)} of {len(near)} are near (points, areas, groups with distance_mm), the others "
            "distant; all must be of one sort. Put the distant ones far away instead."
        )
    away = np.concatenate(offsets)
    distance = np.linalg.norm(away, axis=1)
    if not (distance > 0).all():
        raise RenderError(
            f"lights: {names[int(np.argmin(distance))]} stands in the reference point {reference_mm.tolist()} mm, "
            "where its intensity is to hold. Move it, or set reference_point_mm."
        )
    positions = reference_mm + away if all(near) else None
    lights = Lights(
        tuple(names), away / distance[:, None], np.array(intensities, float), positions, np.asarray(reference_mm, float)
    )
    return lights, np.array(radii)


def _names(group: LightTable | RingTable | GridTable, count: int, taken: list[str]) -> list[str]:
    """Return the names of a group's lights: its own of a single light, else numbered on."""
    if isinstance(group, LightTable) and group.name is not None:
        return [group.name]
    stem = group.name or group.kind
    first = sum(name.startswith(f"{stem}_") for name in taken)
    return [f"{stem}_{first + number:03d}" for number in range(count)]


def _is_near(group: LightTable | RingTable | GridTable) -> bool:
    return (group.position_mm if isinstance(group, LightTable) else group.distance_mm) is not None


def _offsets(group: LightTable | RingTable | GridTable, reference_mm: Array) -> Array:
    """Return (K, 3): positions from the reference point of near lights, directions of distant ones."""
    if isinstance(group, LightTable):
        if group.position_mm is not None:
            return np.array([group.position_mm]) - reference_mm
        if group.direction is not None:
            return np.array([group.direction], float)
        assert group.azimuth_deg is not None
        assert group.elevation_deg is not None
        return direction(group.azimuth_deg, group.elevation_deg)[None]
    if isinstance(group, RingTable):
        angles = group.start_deg + 360.0 * np.arange(group.count) / group.count
        toward = direction(angles, 90.0 - group.polar_deg)
    else:
        # The first ring stands half a step from the axis, so that no two lights stand together there.
        polar = group.max_polar_deg * (np.arange(group.rings) + 0.5) / (group.rings - 0.5)
        angles = 360.0 * np.arange(group.around) / group.around
        toward = direction(angles[None], 90.0 - polar[:, None]).reshape(-1, 3)
    return toward * (group.distance_mm or 1.0)


def _session(group: SessionLightsTable, folder: Path) -> tuple[Lights, Array]:
    path = folder / group.file
    if path.name != "lights.json" or not path.is_file():
        raise RenderError(f"lights[0].file: {path} is not there, or not a lights.json that rgbn wrote.")
    lights = Store(path.parent).load_lights()
    lights = replace(lights, intensities=lights.intensities * white_of(lights), white_value=None, ambient=None)
    return lights, np.zeros(len(lights))
