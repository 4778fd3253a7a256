"""Which flash to add: the one that most improves what all pixels know, and so on, one after the other."""

import numpy as np
from numpy.typing import NDArray

from solve.design.normal_information import information, variance_of_normals

Array = NDArray[np.float64]
ROUNDS, LEAST_GAIN = 5, 1e-6
"""Of exchanges: how often each flash is tried, and the relative gain that counts."""


def known_before(b: Array, told: Array | float = 0.0) -> Array:
    """Return the covariance of b (P, 3) before the next flash, with the information (P, 3, 3) that there is.

    Notes
    -----
    To the information comes that of a normal of which nothing is known: |b|^-2 in every direction, a standard deviation
    of one albedo. It keeps a pixel that no flash reaches, or only two, finite, and is nothing beside three flashes.
    """
    return np.linalg.inv(np.eye(3) / np.maximum(np.sum(b * b, -1), 1e-300)[:, None, None] + told)


def gains(b: Array, covariances: Array, vectors: Array, noise: Array, seen: NDArray[np.bool_]) -> Array:
    """Return by how much each candidate flash would lower the normals' sigma, radians, one tangent axis.

    Parameters
    ----------
    b : (P, 3) float
        Albedo x normal.
    covariances : (P, 3, 3) float
        Of b so far, finite; see `known_before`.
    vectors : (C, P, 3) float
        The candidates' light vectors at the pixels.
    noise : (C, P) float
        Standard deviation of each sample.
    seen : (C, P) bool
        False in shadow or in a highlight.

    Returns
    -------
    gains : (C,) float64
        At least 0, mean over pixels: no single dark pixel outweighs all others.

    Notes
    -----
    One sample is a rank-one change of J [Sherman1950]: C' = C - C v v^T C / (s^2 + v^T C v).
    """
    square = np.sum(b * b, -1)
    found, across = np.zeros(len(vectors)), variance_of_normals(b, covariances)
    for c, (vector, sigma, lit) in enumerate(zip(vectors, noise, seen, strict=True)):
        moved = np.einsum("pij,pj->pi", covariances, vector)
        known = np.maximum(np.sum(moved * vector, 1), 0)
        share = np.where(lit, 1 / (sigma**2 + known) / square, 0)
        fallen = share * (np.sum(moved * moved, 1) - np.sum(moved * b, 1) ** 2 / square) / 2
        found[c] = np.mean(np.sqrt(across) - np.sqrt(np.maximum(across - fallen, 0)))
    return found


def with_flash(covariances: Array, vector: Array, noise: Array, seen: NDArray[np.bool_]) -> Array:
    """Return the covariances (P, 3, 3) with one more flash: its vectors (P, 3), its noise and where seen (P,)."""
    moved = np.einsum("pij,pj->pi", covariances, vector)
    weight = np.where(seen, 1 / (np.square(noise) + np.maximum(np.sum(moved * vector, 1), 0)), 0)
    return covariances - weight[:, None, None] * moved[:, :, None] * moved[:, None, :]


def choose_flashes(
    b: Array, covariances: Array, vectors: Array, noise: Array, seen: NDArray[np.bool_], count: int
) -> NDArray[np.intp]:
    """Return the `count` candidates, each once, that one after the other help most.

    Takes what `gains` takes. Greedy: each flash is the best one given those before it.
    """
    left, flashes = np.ones(len(vectors), bool), []
    for _ in range(min(count, len(vectors))):
        gain = gains(b, covariances, vectors[left], noise[left], seen[left])
        best = int(np.flatnonzero(left)[gain.argmax()])
        covariances = with_flash(covariances, vectors[best], noise[best], seen[best])
        left[best] = False
        flashes.append(best)
    return np.array(flashes, np.intp)


def exchange_flashes(
    b: Array, told: Array | float, vectors: Array, noise: Array, seen: NDArray[np.bool_], flashes: NDArray[np.intp]
) -> NDArray[np.intp]:
    """Return a set of as many candidates that no exchange of one improves, in the order in which they help most.

    What one after the other was best is not always the best set. `told`: see `known_before`; the rest as in
    `choose_flashes`.

    Notes
    -----
    One flash after the other is taken out, and the best candidate put in its place [Fedorov1972].
    """
    chosen = list(map(int, flashes))
    for _ in range(ROUNDS):
        changed = False
        for place, old in enumerate(chosen):
            others = chosen[:place] + chosen[place + 1 :]
            known = known_before(b, told + information(vectors[others], noise[others], seen[others]))
            gain = gains(b, known, vectors, noise, seen)
            gain[others] = -np.inf
            best = int(gain.argmax())
            if gain[best] > gain[old] * (1 + LEAST_GAIN):
                chosen[place], changed = best, True
        if not changed:
            break
    some = np.array(chosen, np.intp)
    return some[choose_flashes(b, known_before(b, told), vectors[some], noise[some], seen[some], len(some))]
