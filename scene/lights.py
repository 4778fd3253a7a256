"""Flashes: direction, position, intensity, and what each pixel sees of them."""

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from scene.errors import CalibrationError

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Lights:
    """N lights, one a frame.

    Parameters
    ----------
    names : tuple of N str
        The frames' names.
    directions : (N, 3) float64
        Unit vectors from `reference_point_mm` toward the light, camera frame.
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

    def __len__(self) -> int:
        return len(self.names)

    @property
    def model(self) -> str:
        return "distant" if self.positions_mm is None else "near"

    def normalised(self) -> "Lights":
        """Return the same lights with each channel's mean intensity 1 (`white_value` takes the factor)."""
        mean = self.intensities.mean(0)
        white = None if self.white_value is None else self.white_value * mean
        return replace(self, intensities=self.intensities / mean, white_value=white)

    def seen_from(self, point: ArrayLike) -> "Lights":
        """Return the lights with directions and intensities at another point (3,), mm."""
        point = np.asarray(point, np.float64)
        if self.positions_mm is None:
            return replace(self, reference_point_mm=point)
        vectors = self.at(point[None])[:, 0]
        directions = self.positions_mm - point
        directions = directions / np.linalg.norm(directions, axis=1, keepdims=True)
        intensities = np.linalg.norm(vectors, axis=-1)
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
            Fewer than three lights, or all in one plane.
        """
        if len(self) < 3:
            raise CalibrationError(
                f"lights: found {len(self)}, photometric stereo needs at least 3. Shoot more flash frames."
            )
        singular = np.linalg.svd(self.directions, compute_uv=False)
        if singular[2] < 0.02 * singular[0]:
            raise CalibrationError(
                f"lights: the {len(self)} directions lie in one plane (smallest to largest singular value "
                f"{singular[2] / singular[0]:.4f}, expected above 0.02): the normal's component across that plane "
                "cannot be seen. Fire the flash also from beside that plane."
            )
