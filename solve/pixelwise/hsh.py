"""Hemispherical harmonics: each pixel as a smooth function of the light's direction; normals are read off it."""

from typing import NamedTuple

import numba
import numpy as np

from solve.assess import condition_and_inverse
from solve.methods import Method
from solve.pixelwise.kernels import light_vectors
from solve.problem import Problem

_SINGULAR = 1e3
"""Condition number from which the three equations for b are not solved."""
_VIRTUAL = np.array([[np.cos(a), np.sin(a), 1.0] for a in np.radians([30.0, 150.0, 270.0])]) / np.sqrt(2.0)


class Settings(NamedTuple):
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


SEED = Settings(three_lights=True, cutoff=0.0)
"""The plain reading: order 2, inverted as it stands, however singular, normals by three virtual lights, as relighting
viewers do. The benchmark names neither the order nor how normals are had."""


def cautions_of(directions, settings: Settings) -> tuple[str, ...]:
    """Say whether the harmonics can be had from lights (F, 3) at all."""
    order = settings.order
    values = np.linalg.svd(harmonics(np.ascontiguousarray(directions), order), compute_uv=False)
    terms = (order + 1) ** 2
    rank = int(np.count_nonzero(values > 1e-3 * values[0]))
    if rank == terms:
        return ()
    condition = values[0] / values[-1] if len(values) == terms and values[-1] > 0 else np.inf
    smoothed = "It is smoothed by the terms that can be told"
    worth = "Normals are not to be believed" if settings.three_lights else smoothed
    return (
        f"order {order} has {terms} terms, and {len(directions)} lights where these stand tell {rank} of them "
        f"(condition number {condition:.0e}): a ring, a narrow set or too few. {worth}.",
    )


def _warned(problem: Problem, settings: Settings) -> Problem:
    return problem.warned(*cautions_of(problem.lights.directions, settings))


@numba.njit(nogil=True, cache=True)
def harmonics(directions, order):  # pragma: no cover
    """Return the hemispherical harmonics (F, (order + 1)^2) at unit vectors (F, 3); below the horizon, those on it."""
    out = np.empty((len(directions), (order + 1) ** 2))
    for i in range(len(directions)):
        phi = np.arctan2(directions[i, 1], directions[i, 0])
        x = 2.0 * min(max(directions[i, 2], 0.0), 1.0) - 1.0
        first = 1.0
        for m in range(order + 1):
            # Associated Legendre functions, upward in l from P_m^m.
            if m:
                first *= -(2.0 * m - 1.0) * np.sqrt(max(1.0 - x * x, 0.0))
            before, now = 0.0, first
            for degree in range(m, order + 1):
                if degree > m:
                    before, now = now, ((2.0 * degree - 1.0) * x * now - (degree + m - 1.0) * before) / (degree - m)
                ratio = 1.0
                for k in range(degree - m + 1, degree + m + 1):
                    ratio *= k
                factor = np.sqrt((2.0 * degree + 1.0) / (2.0 * np.pi * ratio)) * now
                middle = degree * degree + degree
                if m == 0:
                    out[i, middle] = factor
                else:
                    out[i, middle + m] = np.sqrt(2.0) * factor * np.cos(m * phi)
                    out[i, middle - m] = np.sqrt(2.0) * factor * np.sin(m * phi)
    return out


@numba.njit(nogil=True, cache=True)
def _matrix(directions, settings):  # pragma: no cover
    """Return the (3, F) matrix that makes b of samples; zeros where it cannot be had."""
    basis = harmonics(directions, settings.order)
    values, vectors = np.linalg.eigh(np.dot(basis.T, basis))
    inverse = np.zeros_like(values)
    for k in range(len(values)):
        if abs(values[k]) > settings.cutoff * settings.cutoff * values[-1]:
            inverse[k] = 1.0 / values[k]
    pseudo = np.dot(np.ascontiguousarray(vectors * inverse), np.dot(np.ascontiguousarray(vectors.T), basis.T))
    if settings.three_lights:
        virtual = _VIRTUAL.copy()
        return np.dot(np.linalg.inv(virtual), np.dot(harmonics(virtual, settings.order), pseudo))
    smooth = np.dot(np.ascontiguousarray(directions.T), np.dot(basis, pseudo))
    n = np.dot(smooth, directions)
    condition, (a, b, c, d, e, f) = condition_and_inverse(n[0, 0], n[0, 1], n[0, 2], n[1, 1], n[1, 2], n[2, 2])
    if not condition < _SINGULAR:
        return np.zeros_like(smooth)
    return np.dot(np.array([[a, b, c], [b, d, e], [c, e, f]]), smooth)


@numba.njit(nogil=True, cache=True)
def fit(samples, scale, settings):  # pragma: no cover
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
    matrix for each pixel, some 50 microseconds.

    Do not believe it on a ring of lights of one height (rank 5 of 9), nor on a narrow set: then A is singular, and
    what the fit says 45 degrees up is invented. `cautions_of` tells.
    """
    gray, valid, points, geometry = samples
    pixels, lights = gray.shape
    b = np.zeros((pixels, 3))
    used = np.zeros((pixels, lights), np.bool_)
    vectors = np.empty((lights, 3))
    common = _matrix(geometry.directions, settings)
    for i in range(pixels):
        count = np.sum(valid[i])
        if count == lights and not geometry.is_near:
            for k in range(lights):
                for axis in range(3):
                    b[i, axis] += common[axis, k] * gray[i, k]
            used[i] = True
        elif count >= 3:
            light_vectors(points[i], geometry, vectors)
            toward, values = np.empty((count, 3)), np.empty(count)
            size = 0
            for k in range(lights):
                if valid[i, k]:
                    length = np.sqrt(np.sum(vectors[k] * vectors[k]))
                    toward[size] = vectors[k] / length
                    values[size] = gray[i, k] / length
                    size += 1
            b[i] = np.dot(_matrix(toward, settings), values)
            used[i] = valid[i]
    return b, used


METHOD = Method("hsh", {"default": Settings(), "seed": SEED}, fit=fit, prepare=_warned)
