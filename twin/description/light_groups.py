"""Lights as a person writes them - single ones, rings, grids on a hemisphere, a session's own - to `Lights`."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Literal, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import Field, model_validator

from formats.toml_documents import TomlTable
from scene.errors import RenderError
from scene.lights import Lights
from scene.store import Store
from twin.description.description import white_of
from twin.description.value_kinds import Count, Number, Positive, Rgb, Three, file_of, key

Array = NDArray[np.float64]
Many = Annotated[Count, Field(le=10_000)]
Few = Annotated[Count, Field(le=100)]
"""No capture has as many lights."""


def direction(azimuth_deg: ArrayLike, elevation_deg: ArrayLike) -> Array:
    """Return unit vectors (..., 3).

    Azimuth counts from x (right) toward y (up), counter-clockwise as the camera sees it; elevation from the picture's
    plane toward the viewer: 90 is z, straight from the camera.
    """
    azimuth, elevation = (np.radians(np.asarray(angle, float)) for angle in (azimuth_deg, elevation_deg))
    x, y, z = np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)
    return np.stack(np.broadcast_arrays(x, y, z), -1)


class LightTable(TomlTable):
    """What all lights but a session's have."""

    name: Annotated[str | None, key("Name of the frame; a group's lights are numbered. Absent: the kind.")] = None
    intensity: Annotated[Rgb, key("One number or three.")] = (1.0, 1.0, 1.0)

    @property
    def is_near(self) -> bool:
        """Whether it stands somewhere; else it is infinitely far."""
        return any(getattr(self, name, None) is not None for name in ("position_mm", "distance_mm"))

    @property
    def radius(self) -> float:
        """Of discs, mm; 0: points."""
        return getattr(self, "radius_mm", None) or 0.0

    def offsets(self, reference_mm: Array) -> Array:
        """Return (K, 3): positions from the reference point of near lights, directions of distant ones."""
        raise NotImplementedError


class DistantLight(LightTable):
    """One light, infinitely far."""

    kind: Literal["distant"] = "distant"
    direction: Annotated[Three | None, key("Direction toward the light. Give it or both angles.")] = None
    azimuth_deg: Annotated[Number | None, key("Angle from x toward y.", "deg")] = None
    elevation_deg: Annotated[
        Number | None, key("Angle above the picture's plane. 90: from the camera's side.", "deg")
    ] = None

    @model_validator(mode="after")
    def _one_way(self) -> "DistantLight":
        angles = [angle for angle in (self.azimuth_deg, self.elevation_deg) if angle is not None]
        if len(angles) != (2 if self.direction is None else 0):
            raise ValueError("wants either direction, or azimuth_deg and elevation_deg")
        if self.direction is not None and not any(self.direction):
            raise ValueError("expected a direction that is not 0, 0, 0")
        return self

    def offsets(self, reference_mm: Array) -> Array:
        """See `LightTable`."""
        if self.direction is not None:
            return np.array([self.direction], float)
        assert self.azimuth_deg is not None
        assert self.elevation_deg is not None
        return direction(self.azimuth_deg, self.elevation_deg)[None]


class PointLight(LightTable):
    """One light without size."""

    kind: Literal["point"] = "point"
    position_mm: Annotated[Three, key("Where it stands.", "mm")]

    def offsets(self, reference_mm: Array) -> Array:
        """See `LightTable`."""
        return np.array([self.position_mm]) - reference_mm


class AreaLight(PointLight):
    """A disc that faces the reference point."""

    kind: Literal["area"] = "area"  # type: ignore[assignment]
    radius_mm: Annotated[Positive, key("Radius of the disc.", "mm")]


class GroupTable(LightTable):
    """What rings and grids share."""

    distance_mm: Annotated[
        Positive | None, key("Distance from the reference point. Absent: infinitely far.", "mm", start=800.0)
    ] = None
    radius_mm: Annotated[Positive | None, key("Radius of discs. Absent: points.", "mm", start=20.0)] = None

    @model_validator(mode="after")
    def _an_area_is_near(self) -> "GroupTable":
        if self.radius_mm is not None and self.distance_mm is None:
            raise ValueError("radius_mm wants distance_mm: a distant light has no size")
        return self


class RingTable(GroupTable):
    """Lights in a ring about the camera's axis."""

    kind: Literal["ring"] = "ring"
    count: Annotated[Many, key("Number of lights.")]
    polar_deg: Annotated[Number, Field(gt=0, lt=180), key("Angle from z.", "deg")]
    start_deg: Annotated[Number, key("Azimuth of the first.", "deg")] = 0.0

    def offsets(self, reference_mm: Array) -> Array:
        """See `LightTable`."""
        azimuth = self.start_deg + 360.0 * np.arange(self.count) / self.count
        return direction(azimuth, 90.0 - self.polar_deg) * (self.distance_mm or 1.0)


class GridTable(GroupTable):
    """Rings of lights over the hemisphere of the camera's side."""

    kind: Literal["hemisphere"] = "hemisphere"
    rings: Annotated[Few, key("Number of rings.")]
    around: Annotated[Few, key("Number of lights in a ring.")]
    max_polar_deg: Annotated[Number, Field(gt=0, le=90), key("Angle from z of the outermost ring.", "deg")] = 70.0

    def offsets(self, reference_mm: Array) -> Array:
        """See `LightTable`."""
        # The first ring stands half a step from the axis, so that no two lights stand together there.
        polar = self.max_polar_deg * (np.arange(self.rings) + 0.5) / (self.rings - 0.5)
        azimuth = 360.0 * np.arange(self.around) / self.around
        return direction(azimuth, 90.0 - polar[:, None]).reshape(-1, 3) * (self.distance_mm or 1.0)


class SessionLights(TomlTable):
    """The lights that a session was calibrated to. They stand alone, with their reference point and white value."""

    kind: Literal["session"] = "session"
    file: Annotated[Path, file_of(Path, lambda path: path), key("A lights.json of rgbn.", input="session")]

    def lights(self) -> Lights:
        """Return the session's own. Raises RenderError: they cannot be read."""
        if self.file.name != "lights.json" or not self.file.is_file():
            raise RenderError(f"lights[0].file: {self.file} is not there, or not a lights.json that rgbn wrote.")
        lights = Store(self.file.parent).load_lights()
        return replace(lights, intensities=lights.intensities * white_of(lights), white_value=None, ambient=None)


LightGroup = DistantLight | PointLight | AreaLight | RingTable | GridTable | SessionLights
LIGHTS: dict[str, type[TomlTable]] = {one.model_fields["kind"].default: one for one in get_args(LightGroup)}
"""What a description's file calls them."""


def expand(groups: Sequence[LightGroup], reference_mm: Array) -> tuple[Lights, Array]:
    """Return the lights of a description's [[lights]], in their order, and their radii in mm (0: points).

    Parameters
    ----------
    groups : sequence of tables
    reference_mm : (3,) float64
        Where intensities hold and rings and grids have their middle.

    Raises
    ------
    RenderError
        Distant and near lights together, names that occur twice, a light in the reference point, or a session's lights
        beside others.
    """
    session = next((group for group in groups if isinstance(group, SessionLights)), None)
    if session is not None:
        if len(groups) > 1:
            raise RenderError(
                f'lights: found {len(groups)} groups, one of them kind = "session"; a session\'s lights have their own '
                "reference point and stand alone. Drop the others, or write its lights out one by one."
            )
        lights = session.lights()
        return lights, np.zeros(len(lights))
    tables = [group for group in groups if isinstance(group, LightTable)]
    offsets = [group.offsets(reference_mm) for group in tables]
    counts = [len(found) for found in offsets]
    names: list[str] = []
    for group, count in zip(tables, counts, strict=True):
        names += _names(group, count, names)
    near, radii, intensities = (
        np.repeat(values, counts, 0)
        for values in ([group.is_near for group in tables], [group.radius for group in tables],
                       np.array([group.intensity for group in tables], float))
    )  # fmt: skip
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise RenderError(f"lights: {', '.join(twice[:3])} occurs twice; each light is one frame and names it.")
    if near.any() and not near.all():
        raise RenderError(
            f"lights: {near.sum()} of {len(near)} are near (points, areas, groups with distance_mm), the others "
            "distant; all must be of one sort. Put the distant ones far away instead."
        )
    away = np.concatenate(offsets)
    distance = np.linalg.norm(away, axis=1)
    if not (distance > 0).all():
        raise RenderError(
            f"lights: {names[int(np.argmin(distance))]} stands in the reference point {reference_mm.tolist()} mm, "
            "where its intensity is to hold. Move it, or set reference_point_mm."
        )
    positions = reference_mm + away if near.all() else None
    return Lights(
        tuple(names), away / distance[:, None], intensities, positions, np.asarray(reference_mm, float)
    ), radii


def _names(group: LightTable, count: int, taken: list[str]) -> list[str]:
    """Return the names of a group's lights: its own of a single light, else numbered on."""
    if not isinstance(group, GroupTable) and group.name is not None:
        return [group.name]
    stem = group.name or getattr(group, "kind", "light")
    first = sum(name.startswith(f"{stem}_") for name in taken)
    return [f"{stem}_{first + number:03d}" for number in range(count)]
