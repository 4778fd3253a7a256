"""Where the scan could stand by its silhouette alone, and which of these poses some lights explain best."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from align.pose.full_resolution import FinalEvidence
from align.pose.scan_view import View
from align.pose.search import unexplained
from align.pose.shading import ShadedSamples
from scene.lights import Lights
from scene.pose import Pose

Array = NDArray[np.float64]
ROUNDS = 8
LEAST_SEEN = 0.3
"""Share of the object's pixels that must show the scan's outside: a scan of one side says nothing from behind."""
UNKNOWN = 0.15
"""Residual, in units of the loss, of a pixel that looks into a hole of the scan: little more than of one explained."""
LOOSE = 0.15
"""Residual, relative to the pixel, of a sample that is half explained: gloss and shadows are not modelled yet."""


class Candidate(NamedTuple):
    """A pose, and the lights that explain the photographs best there."""

    pose: Pose
    vectors: Array  # (N, 3) direction times intensity
    cost: float  # 0 explained, 1 not at all

    def lights(self, names: tuple[str, ...], middle_mm: Array) -> Lights:
        """Return the lights about the scan's middle (3,), in its own frame."""
        strength = np.linalg.norm(self.vectors, axis=1, keepdims=True)
        even = np.repeat(strength, 3, 1)
        return Lights(names, self.vectors / strength, even, None, self.pose.apply(middle_mm)).normalised()


def candidates(rough: Sequence[FinalEvidence], samples: ShadedSamples) -> list[Candidate]:
    """Return poses by the shading under the lights that suit each, best first; `rough`: of `rough_poses`."""
    # The silhouette has its say: a pose that lies beside it explains pixels that it should not see.
    outside = [unexplained(one) for one in rough]
    found = [_rated(one.view, samples) for one in rough]
    rated = [one._replace(cost=one.cost + more - outside[0]) for one, more in zip(found, outside, strict=True)]
    return sorted(rated, key=lambda one: one.cost)


def _rated(view: View, samples: ShadedSamples) -> Candidate:
    points, normals = view.surface(*view.camera.rays(samples.pixels))
    vectors, cost = rough_lights(samples, normals)
    missed, explained = ~np.isfinite(points[:, 0]), np.isfinite(normals[:, 0])
    # Through a hole of the scan nothing is known: it is charged little, since a wrong pose may hide there.
    shares = missed.mean(), explained.mean(), (~missed & ~explained).mean()
    told = float(np.dot(shares, (1.0, cost, UNKNOWN**2)))
    return Candidate(view.pose, vectors, told if explained.mean() > LEAST_SEEN else 1.0)


def rough_lights(samples: ShadedSamples, normals: Array) -> tuple[Array, float]:
    """Return distant lights (N, 3), direction times intensity, that explain samples by normals (P, 3), and the cost.

    Lights and albedos in turns, by robust least squares. The cost is the mean of r^2 / (r^2 + LOOSE^2).
    """
    seen = np.isfinite(normals).all(1)
    n, values = normals[seen], samples.values[:, seen] / samples.scale[seen]
    free, usable = ~samples.clipped[:, seen], samples.usable[:, seen]
    albedo, weight = np.ones(len(n)), usable.astype(np.float64)
    vectors, residual = np.zeros((len(values), 3)), values
    for _ in range(ROUNDS):
        along = albedo[:, None] * n
        matrix = np.einsum("np,pi,pj->nij", weight, along, along, optimize=True) + 1e-6 * np.eye(3)
        vectors = np.linalg.solve(matrix, ((weight * values) @ along)[..., None])[..., 0]
        cosine = vectors @ n.T
        square = np.maximum((weight * cosine**2).sum(0), 1e-9)
        albedo = np.clip((weight * cosine * values).sum(0) / square, 0.05, 20.0)
        residual = values - albedo * np.maximum(cosine, 0)
        weight = usable * (cosine > 0) / (1 + (residual / LOOSE) ** 2) ** 2
    relative = (residual / LOOSE) ** 2
    cost = np.where(free, relative / (1 + relative), 0).sum() / max(free.sum(), 1)
    return vectors, float(cost)
