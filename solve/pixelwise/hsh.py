"""Hemispherical harmonics: each pixel as a smooth function of the light's direction; normals are read off it."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from solve.methods import Method
from solve.problem import Problem
from solve.samples import Samples

_SINGULAR = 1e3
"""Condition number from which the three equations for b are not solved."""
_CHUNK = 1024
"""Pixels whose own matrices are made at once."""
_VIRTUAL = np.array([[np.cos(a), np.sin(a), 1.0] for a in np.radians([30.0, 150.0, 270.0])]) / np.sqrt(2.0)


class HshSettings(NamedTuple):
    """Settings of `hsh`.

    Parameters
    ----------
    order : int
        1, 2, 3: 4, 9, 16 terms.
    three_lights : bool
        Read the normal off three virtual lights, 45 degrees up.
    cutoff : float
        Singular values under this share of the largest are left out; 0: none is, as by a plain inverse.
    """

    order: int = 2
    three_lights: bool = False
    cutoff: float = 1e-3


SEED = HshSettings(three_lights=True, cutoff=0.0)
"""The plain reading: order 2, inverted as it stands, however singular, normals by three virtual lights, as relighting
viewers do. The benchmark names neither the order nor how normals are had."""


def warned(problem: Problem, settings: HshSettings) -> Problem:
    """Return the problem, warned where its lights do not tell all harmonics."""
    directions, order = problem.lights.directions, settings.order
    values = np.linalg.svd(harmonics(directions, order), compute_uv=False)
    terms = (order + 1) ** 2
    rank = int(np.count_nonzero(values > 1e-3 * values[0]))
    if rank == terms:
        return problem
    condition = values[0] / values[-1] if len(values) == terms and values[-1] > 0 else np.inf
    smoothed = "It is smoothed by the terms that can be told"
    worth = "Normals are not to be believed" if settings.three_lights else smoothed
    return problem.warned(
        f"order {order} has {terms} terms, and {len(directions)} lights where these stand tell {rank} of them "
        f"(condition number {condition:.0e}): a ring, a narrow set or too few. {worth}."
    )


def _matrices(directions: NDArray, valid: NDArray, settings: HshSettings) -> NDArray[np.float64]:
    """Return the (..., 3, F) that make b of the valid samples (..., F); zeros where they cannot be had."""
    basis = harmonics(directions, settings.order) * valid[..., None]
    values, vectors = np.linalg.eigh(np.swapaxes(basis, -1, -2) @ basis)
    kept = np.abs(values) > settings.cutoff**2 * values[..., -1:]
    inverse = np.divide(1.0, values, out=np.zeros_like(values), where=kept)
    pseudo = (vectors * inverse[..., None, :]) @ np.swapaxes(vectors, -1, -2) @ np.swapaxes(basis, -1, -2)
    if settings.three_lights:
        return np.linalg.inv(_VIRTUAL) @ harmonics(_VIRTUAL, settings.order) @ pseudo
    toward = directions * valid[..., None]
    smooth = np.swapaxes(toward, -1, -2) @ basis @ pseudo
    normal = smooth @ toward
    # Its eigenvalues are the squares of what the lights' own would be.
    solvable = np.linalg.cond(normal) < _SINGULAR**2
    normal = np.where(solvable[..., None, None], normal, np.eye(3))
    return np.linalg.solve(normal, smooth) * solvable[..., None, None]


def fit(samples: Samples, scale: float, settings: HshSettings):
    """Fit b = albedo x normal to the harmonics of each pixel's samples; see `solve.methods.Method`.

    Used are all samples that are not clipped: there is no defence against shadows and gloss but smoothness.

    Notes
    -----
    H_l^m(theta, phi) = K_l^m P_l^|m|(2 cos theta - 1) {sqrt 2 cos m phi, 1, sqrt 2 sin |m| phi},
    K_l^m = sqrt((2l + 1) (l - |m|)! / (2 pi (l + |m|)!)) [Gautron2004], a fit of relighting as in [Malzbender2001].
    With A the harmonics at the lights, A+ its pseudoinverse and L the light directions:

    - by default P = A A+ keeps of the samples what is smooth, and b = argmin |P (m - L b)|^2: exact on
      Lambertian samples although no x = sin theta cos phi is among the harmonics. They all but hold it (P L is L to
      two percent), so that this is all but least squares on every sample: on shadows and gloss no better than that;
    - with three virtual lights V, b = V^-1 H(V) A+ m: what the fit says is seen from 45 degrees. The harmonics'
      misfit to a cosine costs a tenth of a degree, a shadow at one of the three ten: the floor on any object.

    Both are linear in m: one 3 x F matrix for all pixels that are not clipped. Clipped samples or near lights need a
    matrix for each pixel.

    Do not believe it on a ring of lights of one height (rank 5 of 9), nor on a narrow set: then A is singular, and
    what the fit says 45 degrees up is invented. `warned` tells.
    """
    gray, valid = samples.gray.astype(np.float64), samples.valid
    b, used = np.zeros((len(gray), 3)), valid & (valid.sum(1, keepdims=True) >= 3)
    own = np.ones(len(gray), bool)
    if not samples.lights.is_near:
        own = ~valid.all(1)
        b[~own] = gray[~own] @ _matrices(samples.lights.directions, np.ones(gray.shape[1]), settings).T
    own = np.flatnonzero(own & used.any(1))
    for some in np.split(own, range(_CHUNK, len(own), _CHUNK)):
        toward, known = samples.some(some).toward(), valid[some]
        length = np.linalg.norm(toward, axis=-1)
        matrices = _matrices(toward / length[..., None], known, settings)
        b[some] = np.einsum("pif,pf->pi", matrices, np.where(known, gray[some] / length, 0))
    return b, used


def harmonics(directions: NDArray, order: int) -> NDArray[np.float64]:
    """Return the hemispherical harmonics (..., (order + 1)^2) at unit vectors (..., 3), those below z = 0 as on it."""
    from scipy.special import sph_harm_y

    polar = np.arccos(2 * np.clip(directions[..., 2], 0, 1) - 1)
    azimuth = np.arctan2(directions[..., 1], directions[..., 0])
    found = []
    for degree in range(order + 1):
        # Those of the whole sphere, twice as dense; by their real and imaginary parts.
        whole = [np.sqrt(2.0) * sph_harm_y(degree, m, polar, azimuth) for m in range(degree + 1)]
        found += [np.sqrt(2.0) * one.imag for one in whole[:0:-1]] + [whole[0].real]
        found += [np.sqrt(2.0) * one.real for one in whole[1:]]
    return np.stack(found, -1)


METHOD = Method("hsh", {"default": HshSettings(), "seed": SEED}, fit=fit, prepare=warned)
