"""Flashes: direction, position, intensity, and what each pixel sees of them."""

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from scene.errors import CalibrationError, SceneError
from scene.normals import unit

if TYPE_CHECKING:
    import pandas

    from draw.svg import Drawing

Array = NDArray[np.float64]


def check_count(count: int) -> None:
    """Raise CalibrationError for fewer lights than tell a normal."""
    if count < 3:
        raise CalibrationError(f"lights: found {count}, photometric stereo needs at least 3. Shoot more flash frames.")


@dataclass(frozen=True)
class Lights:
    """N lights, one a frame.

    Parameters
    ----------
    names : tuple of N str
        The frames' names.
    directions : (N, 3) float64
        Unit vectors from `reference_point_mm` toward the light, camera frame; all NaN where nothing tells them.
    intensities : (N, 3) float64
        Irradiance at the reference point, RGB, relative: each channel's mean over frames is 1.
    positions_mm : (N, 3) float64 or None
        None: the lights are distant.
    reference_point_mm : (3,) float64
        The object's centre: where directions and intensities hold.
    direction_sigma_deg, intensity_sigma : (N,) float64
        Standard deviation, along one tangent axis / relative. NaN where nothing is known of it.
    ambient : (3,) float64 or None
        Constant light left in the frames after the ambient frame was subtracted, as pixel value on white.
    white_value : (3,) float64 or None
        Pixel value of the white ball's surface facing a light of intensity 1: ties albedo to the ball's.
    flags : tuple of N tuples of str
        What is suspicious about each light.
    """

    names: tuple[str, ...]
    directions: Array
    intensities: Array
    positions_mm: Array | None = None
    reference_point_mm: Array = field(default_factory=lambda: np.zeros(3))
    direction_sigma_deg: Array = field(default_factory=lambda: np.zeros(0))
    intensity_sigma: Array = field(default_factory=lambda: np.zeros(0))
    ambient: Array | None = None
    white_value: Array | None = None
    flags: tuple[tuple[str, ...], ...] = ()

    def __post_init__(self) -> None:
        count = len(self.names)
        unknown = np.full(count, np.nan)
        for name in ("direction_sigma_deg", "intensity_sigma"):
            if not len(getattr(self, name)):
                object.__setattr__(self, name, unknown)
        if not self.flags:
            object.__setattr__(self, "flags", ((),) * count)
        if self.directions.shape != (count, 3) or self.intensities.shape != (count, 3):
            raise CalibrationError(
                f"lights: {count} frames, but directions {self.directions.shape} and "
                f"intensities {self.intensities.shape}; expected ({count}, 3) each."
            )

    @classmethod
    def unknown(cls, names: tuple[str, ...]) -> "Lights":
        """Return lights of which nothing is known: directions NaN, intensities 1."""
        return cls(names, np.full((len(names), 3), np.nan), np.ones((len(names), 3)))

    def __len__(self) -> int:
        return len(self.names)

    @property
    def is_unknown(self) -> bool:
        """Whether nothing tells the directions: for methods that find them themselves."""
        return bool(np.isnan(self.directions).all()) and len(self) > 0

    @property
    def model(self) -> str:
        """`distant`, `near`, or `unknown`: no directions."""
        if self.is_unknown:
            return "unknown"
        return "distant" if self.positions_mm is None else "near"

    @property
    def room_share(self) -> Array | None:
        """The ambient light on white over a mean flash's, (3,); None if not known."""
        known = self.ambient is not None and self.white_value is not None
        return np.asarray(self.ambient / self.white_value) if known else None  # type: ignore[operator]

    def normalised(self) -> "Lights":
        """Return the same lights with each channel's mean intensity 1 (`white_value` takes the factor)."""
        mean = self.intensities.mean(0)
        white = None if self.white_value is None else self.white_value * mean
        return replace(self, intensities=self.intensities / mean, white_value=white)

    def only(self, which: slice | list[int] | NDArray) -> "Lights":
        """Return some of the lights as they are, in this order: by a slice, their numbers, or a mask (N,)."""
        rows = np.arange(len(self))[which]
        names, flags = (tuple(each[i] for i in rows) for each in (self.names, self.flags))
        fields = ("directions", "intensities", "positions_mm", "direction_sigma_deg", "intensity_sigma")
        arrays = {name: getattr(self, name)[rows] for name in fields if getattr(self, name) is not None}
        return replace(self, names=names, flags=flags, **arrays)

    def seen_from(self, point: ArrayLike) -> "Lights":
        """Return the lights with directions and intensities at another point (3,), mm."""
        point = np.asarray(point, np.float64)
        if self.positions_mm is None:
            return replace(self, reference_point_mm=point)
        directions, intensities = unit(self.positions_mm - point), np.linalg.norm(self.at(point[None])[:, 0], axis=-1)
        return replace(self, directions=directions, intensities=intensities, reference_point_mm=point).normalised()

    def at(self, points: ArrayLike) -> Array:
        """Return the light vectors at points.

        Parameters
        ----------
        points : (P, 3) float
            Camera frame, mm.

        Returns
        -------
        vectors : (N, P, 3 channels, 3) float64
            Direction times intensity: a Lambertian pixel is albedo * max(0, vector . normal).
            A near light falls off as (|q - reference| / |q - point|)^2.
        """
        return self.intensities[:, None, :, None] * self.toward(points)[:, :, None, :]

    def toward(self, points: ArrayLike) -> Array:
        """Return the light vectors at points (P, 3), mm, of lights whose intensity is 1.

        Returns
        -------
        vectors : (N, P, 3) float64
            Unit at the reference point; a near light's length elsewhere is its fall-off.
        """
        points = np.asarray(points, np.float64)
        if self.positions_mm is None:
            return np.broadcast_to(self.directions[:, None], (len(self), len(points), 3))
        toward = self.positions_mm[:, None] - points
        reference = np.linalg.norm(self.positions_mm - self.reference_point_mm, axis=-1)
        return toward * (reference[:, None, None] ** 2 / np.linalg.norm(toward, axis=-1, keepdims=True) ** 3)

    def check(self) -> None:
        """Raise unless normals can be had from these lights.

        Raises
        ------
        CalibrationError
            Fewer than three lights, of unknown directions, or all in one plane.
        """
        check_count(len(self))
        if self.is_unknown:
            raise CalibrationError(
                "lights: their directions are unknown: no ball was found, and no file gives them. Take methods that "
                "need none (--method ldr,entropy,tv), list the balls under [[spheres]], or give lights.file."
            )
        singular = np.linalg.svd(self.directions, compute_uv=False)
        if singular[2] < 0.02 * singular[0]:
            raise CalibrationError(
                f"lights: the {len(self)} directions lie in one plane (smallest to largest singular value "
                f"{singular[2] / singular[0]:.4f}, expected above 0.02): the normal's component across that plane "
                "cannot be seen. Fire the flash also from beside that plane."
            )

    def facts(self) -> dict[str, Any]:
        """Return the lights as figures and the report draw them.

        model; count; reference_point_mm; sigma medians; zenith_max_deg; frames: name, zenith_deg (0 at the camera's
        axis), azimuth_deg (0 right, 90 up, as the camera sees it), intensity [3], intensity_mean, sigmas, position_mm
        and distance_mm (from the reference point) where near, flags. None where unknown.
        """
        x, y, z = self.directions.T
        zenith, azimuth = np.degrees(np.arctan2(np.hypot(x, y), z)), np.degrees(np.arctan2(y, x)) % 360
        places, away = self.positions_mm, np.full(len(self), np.nan)
        if places is not None:
            away = np.linalg.norm(places - self.reference_point_mm, axis=1)
        columns = {
            "name": self.names,
            "zenith_deg": _known(zenith),
            "azimuth_deg": _known(azimuth),
            "intensity": self.intensities.tolist(),
            "intensity_mean": self.intensities.mean(1).tolist(),
            "direction_sigma_deg": _known(self.direction_sigma_deg),
            "intensity_sigma": _known(self.intensity_sigma),
            "position_mm": [None] * len(self) if places is None else places.tolist(),
            "distance_mm": _known(away),
            "flags": map(list, self.flags),
        }
        rows = [dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)]
        return {
            "model": self.model,
            "count": len(rows),
            "reference_point_mm": self.reference_point_mm.tolist(),
            "direction_sigma_deg_median": known_median(self.direction_sigma_deg),
            "intensity_sigma_median": known_median(self.intensity_sigma),
            "zenith_max_deg": max((row["zenith_deg"] for row in rows if not self.is_unknown), default=None),
            "frames": rows,
        }

    def rows(self) -> list[dict[str, str | float | None]]:
        """Return a table of the lights, a row each: what every table of lights shows, here and in files.

        Returns
        -------
        list of dict
            name: the frame's; direction_x, direction_y, direction_z: unit, from the reference point toward the light,
            camera frame (x right, y up, z toward the viewer); elevation_deg: 90 on the camera's axis, 0 in the plane
            of the picture; azimuth_deg: 0 right, 90 up, as the camera sees it; x_mm, y_mm, z_mm: position, camera
            frame; distance_mm: from the reference point; intensity_r, intensity_g, intensity_b: relative, the mean over
            lights is 1; direction_sigma_deg: standard deviation along one tangent axis; intensity_sigma: the relative
            one; flags: what is suspicious, with "; " between. None where unknown; a distant light has no position.
        """
        rows = []
        for fact, direction in zip(self.facts()["frames"], map(_known, self.directions), strict=True):
            place, tilt = fact["position_mm"] or (None, None, None), fact["zenith_deg"]
            toward = zip(("direction_x", "direction_y", "direction_z"), direction, strict=True)
            row = {"name": fact["name"], **dict(toward)}
            row |= {"elevation_deg": None if tilt is None else 90 - tilt, "azimuth_deg": fact["azimuth_deg"]}
            row |= {**dict(zip(("x_mm", "y_mm", "z_mm"), place, strict=True)), "distance_mm": fact["distance_mm"]}
            row |= zip(("intensity_r", "intensity_g", "intensity_b"), fact["intensity"], strict=True)
            row |= {name: fact[name] for name in ("direction_sigma_deg", "intensity_sigma")}
            rows.append(row | {"flags": "; ".join(fact["flags"])})
        return rows

    def to_dataframe(self) -> "pandas.DataFrame":
        """Return `rows` as a pandas DataFrame; NaN where unknown."""
        from scene.notebook import data_frame

        return data_frame(self.rows())

    def plot(self, what: Literal["directions", "intensities", "sigmas"] = "directions") -> "Drawing":
        """Return a drawing of the lights, which a notebook shows.

        Parameters
        ----------
        what : {"directions", "intensities", "sigmas"}
            The hemisphere as the camera sees it; each light's relative intensities, or the standard deviation of its
            direction in degrees.

        Raises
        ------
        SceneError
            Directions of unknown lights, or another word.
        """
        from draw import light_charts

        words = ("directions", "intensities", "sigmas")
        if what not in words:
            raise SceneError(f"lights.plot({what!r}): there are {', '.join(words)}.")
        if what == "directions" and self.is_unknown:
            raise SceneError('lights.plot("directions"): they are unknown: no ball was found, and no file gives them.')
        return getattr(light_charts, what)(self.facts())

    def __repr__(self) -> str:
        if self.is_unknown:
            return f"{len(self)} lights of unknown direction"
        facts = self.facts()
        away, tilt, sigma = _span(facts, "distance_mm"), _span(facts, "zenith_deg"), facts["direction_sigma_deg_median"]
        place = f"{away} mm away" if away else f"{tilt} degrees from the camera's axis"
        known = "" if sigma is None else f", direction sigma {sigma:.2g} degrees (median)"
        doubted = sum(map(bool, self.flags))
        return f"{len(self)} {self.model} lights, {place}{known}" + (f", {doubted} flagged" if doubted else "")

    def _repr_html_(self) -> str:
        from scene.notebook import table_html

        names = ("name", "elevation_deg", "azimuth_deg", "distance_mm", "intensity", "direction_sigma_deg", "flags")
        facts = self.facts()["frames"]
        rows = [row | {"intensity": fact["intensity_mean"]} for row, fact in zip(self.rows(), facts, strict=True)]
        return table_html([{name: row[name] for name in names} for row in rows], repr(self))


def _known(values: NDArray[np.float64]) -> list[float | None]:
    """Return numbers, None for what is not finite."""
    return [value if np.isfinite(value) else None for value in values.tolist()]


def known_median(values: NDArray | None) -> float | None:
    """Return the median of what is a number, None where nothing is finite."""
    known = np.empty(0) if values is None else values[~np.isnan(values)].astype(np.float64)
    return float(np.median(known, overwrite_input=True)) if np.isfinite(known).any() else None


def _span(facts: dict[str, Any], name: str) -> str:
    """Return the least and the greatest of a fact of the lights in words; empty where none is known."""
    known = [row[name] for row in facts["frames"] if row[name] is not None]
    return " to ".join(dict.fromkeys(f"{end:,.0f}" for end in (min(known), max(known)))) if known else ""
