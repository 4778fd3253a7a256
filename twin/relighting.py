"""How well a twin predicts photographs that it has not seen: fitted to every second frame, it predicts the others."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scene.errors import RenderError
from scene.frames import Frames
from twin.description.description import Sampling
from twin.material.material_samples import inner_pixels, samples_at
from twin.material.scan_material import SAMPLES_AT_ONCE, scan_material
from twin.scan_scene import scan_scene
from twin.visibility import Sight

FEWEST = 8
"""Frames: of half of them a pixel must be lit by three."""
MASKS = ("fitted", "lit", "whole")


@dataclass(frozen=True)
class Relighting:
    """Photographs predicted, over three sets of pixels.

    fitted, predicted: Names of the frames that the material was fitted to, and of those that were predicted.
    relative_rmse: By the set: `fitted` (samples such as the material is fitted to), `lit` (all of the mask in no shadow
        of the scan, not clipped), `whole` (all of the mask that is not clipped: cast shadows, light from elsewhere, and
        outline included). Root of the squared errors' sum over the squared values'.
    """

    fitted: tuple[str, ...]
    predicted: tuple[str, ...]
    relative_rmse: dict[str, float]

    def facts(self) -> dict[str, Any]:
        """Return what the summary keeps of it."""
        rmse = {f"relative_rmse_{name}": value for name, value in self.relative_rmse.items()}
        return {"fitted": self.fitted, "predicted": self.predicted, **rmse}

    def __str__(self) -> str:
        """The line that is printed."""
        rmse = ", ".join(f"{100 * value:.1f} % {name}" for name, value in self.relative_rmse.items())
        return (
            f"fitted to {len(self.fitted)} frames, it predicts the other {len(self.predicted)} to a relative RMSE of "
            f"{rmse}"
        )


def relighting(
    sight: Sight,
    frames: Frames,
    mask: NDArray[np.bool_],
    sampling: Sampling,
    render: Callable[[Any], Frames],
) -> Relighting:
    """Return how well the material that every second frame tells predicts the others.

    Parameters
    ----------
    sight, frames, mask
        As in `twin.material.scan_material.scan_material`.
    sampling : Sampling
        Of the rendering.
    render : callable
        Returns a scene's frames (`twin.engines.render.render_scene`).

    Raises
    ------
    RenderError
        There are too few frames, or no material can be fitted to half of them.
    """
    if len(frames) < FEWEST:
        raise RenderError(f"{len(frames)} frames; {FEWEST} or more can be divided into fitted and predicted ones.")
    first, others = slice(0, None, 2), slice(1, None, 2)
    seen, unseen = (replace(sight, lights=sight.lights.only(which)) for which in (first, others))
    found = scan_material(seen, frames.only(first), mask)
    scene, _ = scan_scene(unseen, found.albedo, sampling, fit=found.fit)
    photographs = frames.only(others)
    return Relighting(seen.lights.names, unseen.lights.names, score(unseen, photographs, render(scene), mask))


def score(sight: Sight, photographs: Frames, predicted: Frames, mask: NDArray[np.bool_]) -> dict[str, float]:
    """Return the relative RMSE over each set of pixels; see `Relighting`."""
    rows, columns = np.nonzero(mask)
    sets = _sets(sight, photographs, mask)
    sums = {name: np.zeros(2) for name in MASKS}
    for index in range(len(photographs)):
        read, clipped = photographs.read_pixels(index, rows, columns)
        value = read.astype(np.float64)
        guess = predicted.read_pixels(index, rows, columns)[0].astype(np.float64)
        for name, total in sums.items():
            own = ~clipped if name == "whole" else ~clipped & sets[name][:, index]
            total += np.sum((guess[own] - value[own]) ** 2), np.sum(value[own] ** 2)
    return {name: float(np.sqrt(a / b)) for name, (a, b) in sums.items()}


def _sets(sight: Sight, photographs: Frames, mask: NDArray[np.bool_]) -> dict[str, NDArray[np.bool_]]:
    """Return, of the mask's pixels, (P, F) which are such as the material is fitted to, and which the scan sees lit."""
    number = np.cumsum(mask).reshape(mask.shape) - 1
    fitted, lit = np.zeros((2, int(mask.sum()), len(photographs)), bool)
    rows, columns = inner_pixels(mask, sight.normals)
    step = max(1, SAMPLES_AT_ONCE // len(photographs))
    for first in range(0, len(rows), step):
        some = samples_at(sight, photographs, rows[first : first + step], columns[first : first + step])
        fitted[number[some.rows, some.columns]] = some.usable
    filled = np.flatnonzero(mask.any(1))
    for band, face, _, points in sight.rows(slice(int(filled[0]), int(filled[-1]) + 1), slice(0, mask.shape[1])):
        pixels = mask[band] & (face >= 0)
        flat = sight.mesh.face_normals[face[pixels]]
        lit[number[band][pixels]] = ~np.logical_or(*sight.shadows(points[pixels], flat, flat))
    return {"fitted": fitted, "lit": lit}
