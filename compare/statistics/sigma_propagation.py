"""What lights and registration leave open, carried to the methods' errors by Monte Carlo: all move, all solve again."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from compare.statistics.block_bootstrap import KEYS
from compare.statistics.statistics import angular_statistics
from scene.camera import Camera
from scene.frames import Frames
from scene.lights import Lights
from scene.normals import angular_error_deg, unit
from scene.pose import rotation_from_vector

Array = NDArray[np.float64]
Map = NDArray[np.float32]
Mask = NDArray[np.bool_]
Solve = Callable[[str, Frames, Lights, Camera, Mask], Map | None]
"""Gives a method's normals; None where it cannot be run."""

MOVES = 24
"""How often lights and registration are moved."""
PIXELS = 3000
"""Of the object, that are solved again under moved lights."""


@dataclass(frozen=True)
class Registration:
    """How far the true normals may be off: rms lengths of vectors, along one axis less by the root of 3."""

    sigma_deg: float
    sigma_mm: float


@dataclass(frozen=True)
class Processed:
    """What a session's methods were run on, and the truth by which they are judged."""

    frames: Frames
    lights: Lights
    camera: Camera
    mask: Mask  # (H, W)
    truth: Map  # (H, W, 3)
    registration: Registration | None  # of the truth; None: it is exact

    def thinned(self, step: int) -> "Processed":
        """Return every n-th pixel: pixel u becomes u / n."""
        mask, truth = self.mask[::step, ::step], self.truth[::step, ::step]
        return replace(self, frames=self.frames.every(step), camera=self.camera.every(step), mask=mask, truth=truth)


def propagated_shifts(
    processed: Processed, methods: Sequence[str], solve: Solve, *, seed: int = 0
) -> tuple[dict[str, Array], dict[str, Any]]:
    """Return what the errors change by when lights and registration move by their sigmas.

    Parameters
    ----------
    processed : Processed
    methods : sequence of str
    solve : callable
        See `Solve`.
    seed : int

    Returns
    -------
    shifts : dict of str to (MOVES, 4) float64
        By method, in the order of `compare.statistics.block_bootstrap.KEYS`; row k is one movement for all methods.
    carried : dict
        pixels, moves; not_carried: methods that could not be run again.

    Notes
    -----
    The stack is thinned to every n-th pixel. Each movement turns every light by its sigma along two tangent axes,
    scales its intensity by its sigma, turns the true normals by the pose's sigma and shifts them by its millimetres;
    then every method solves again, and its statistics are held against those of the thinned stack unmoved.
    """
    step = int(np.ceil(np.sqrt(max(1.0, processed.mask.sum() / PIXELS))))
    thin, lights, rng = processed.thinned(step), processed.lights, np.random.default_rng(seed)
    moved = [(lights, np.asarray(thin.truth, np.float64))]
    for _ in range(MOVES):
        truth = _moved_truth(processed, rng)[::step, ::step]
        moved.append((moved_lights(lights, rng), truth))
    shifts, left_out = {}, []
    for name in methods:
        found = []
        for light, truth in moved:
            normals = solve(name, thin.frames, light, thin.camera, thin.mask)
            if normals is None:
                break
            statistics = angular_statistics(angular_error_deg(normals[thin.mask], truth[thin.mask]))
            found.append([statistics[key] for key in KEYS])
        if len(found) < len(moved) or not np.isfinite(found).all():
            left_out.append(name)
            continue
        shifts[name] = np.array(found[1:]) - found[0]
    return shifts, {"moves": MOVES, "pixels": int(thin.mask.sum()), "not_carried": left_out}


def moved_lights(lights: Lights, rng: np.random.Generator) -> Lights:
    """Return lights turned and scaled by their sigmas; a near one keeps its distance."""
    direction, intensity = (np.nan_to_num(one) for one in (lights.direction_sigma_deg, lights.intensity_sigma))
    aside = np.radians(direction)[:, None] * rng.standard_normal((len(lights), 3))
    aside -= np.sum(aside * lights.directions, 1, keepdims=True) * lights.directions
    directions = unit(lights.directions + aside)
    intensities = lights.intensities * (1 + intensity * rng.standard_normal(len(lights)))[:, None]
    positions = lights.positions_mm
    if positions is not None:
        distance = np.linalg.norm(positions - lights.reference_point_mm, axis=1, keepdims=True)
        positions = lights.reference_point_mm + distance * directions
    return replace(lights, directions=directions, intensities=intensities, positions_mm=positions)


def _moved_truth(processed: Processed, rng: np.random.Generator) -> Array:
    """Return true normals turned and shifted by the registration's sigmas; a shift in depth is left out."""
    open_by = processed.registration
    if open_by is None:
        return np.asarray(processed.truth, np.float64)
    pixels_per_mm = processed.camera.fx / (abs(float(processed.lights.reference_point_mm[2])) or 1.0)
    turn = np.radians(open_by.sigma_deg / np.sqrt(3)) * rng.standard_normal(3)
    across, down = open_by.sigma_mm / np.sqrt(3) * pixels_per_mm * rng.standard_normal(2)
    return shifted(processed.truth, across, down) @ rotation_from_vector(turn).T


def shifted(normals: Map, across: float, down: float) -> Array:
    """Return a map (H, W, 3) moved by parts of a pixel, NaN where it is then unknown."""
    import cv2

    height, width = normals.shape[:2]
    motion = np.array([[1, 0, across], [0, 1, down]], np.float64)
    known = np.isfinite(normals[..., 0])
    filled = np.where(known[..., None], normals, 0).astype(np.float32)
    moved = np.asarray(cv2.warpAffine(filled, motion, (width, height), flags=cv2.INTER_LINEAR), np.float64)
    share = cv2.warpAffine(known.astype(np.float32), motion, (width, height), flags=cv2.INTER_LINEAR)
    moved[np.asarray(share) < 0.5] = np.nan
    return unit(moved)
