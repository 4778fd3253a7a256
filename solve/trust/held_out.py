"""The photographs as judge: how well a method's normals from some frames foretell the others."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from solve.problem import Problem
from solve.samples import all_samples
from solve.trust.answer_world import Material
from solve.trust.shading import Geometry, albedo_of

FOLDS = 3
FEWEST = 4
"""Frames that normals can be told from and still be judged."""
DARK = 0.02

Solve = Callable[[str, Problem], NDArray]
"""Gives a method's normals (H, W, 3) of a problem."""


def unexplained(given: Problem, material: Material, methods: Sequence[str], solve: Solve) -> Mapping[str, float]:
    """Return by how much the photographs differ from what each method's normals foretell, of the albedo, median.

    Every third frame in turn is left out; normals and albedos come from the others. What all pixels share comes from
    all frames. Judged are the samples that are lit, or that the normals say are. Empty where there are too few frames.

    Parameters
    ----------
    given : Problem
        Under the lights that the methods are given.
    material : Material
        Of the same pixels, under the lights that are taken to be true.
    methods : sequence of str
    solve : callable
    """
    frames, lights = given.frames, given.lights
    count = len(frames)
    if count - -(-count // FOLDS) < FEWEST:
        return {}
    samples = all_samples(material.problem)
    gray, toward, views = samples.gray.astype(np.float64), samples.toward(), material.problem.views()
    dark = DARK * samples.scale()
    gaps: dict[str, list[NDArray]] = {name: [] for name in methods}
    for fold in range(FOLDS):
        left_out = np.arange(count) % FOLDS == fold
        seen = replace(given, frames=frames.only(~left_out), lights=lights.only(~left_out))
        for name in methods:
            normals = solve(name, seen)[given.mask]
            known = np.isfinite(normals).all(1)
            geometry = Geometry.of(normals[known], views[known], toward[known])
            usable = samples.valid[known] & (gray[known] > dark)
            fitted, foretold = geometry.only(~left_out), geometry.only(left_out)
            albedo = albedo_of(fitted, gray[known][:, ~left_out], usable[:, ~left_out], material.shared)
            value = np.maximum(foretold.cosine * foretold.reflectance(material.shared), 0)
            gap = np.abs(gray[known][:, left_out] / albedo[:, None] - value)
            judged = usable[:, left_out] | (samples.valid[known][:, left_out] & (foretold.cosine > 0))
            # A pixel without an answer explains nothing.
            nothing = np.ones(np.count_nonzero(~known) * int(left_out.sum()))
            gaps[name].append(np.concatenate([gap[judged], nothing]))
    return {name: float(np.median(np.concatenate(parts))) for name, parts in gaps.items()}
