"""Lights from an object whose normals are given: no ball and no lights' file, but every pixel's n is known."""

import numpy as np
from numpy.typing import NDArray

from calibrate.without_balls.probe import FEWEST_PIXELS, by_channel, read_probe, sectors
from scene.camera import Camera
from scene.errors import CalibrationError
from scene.frames import Frames
from scene.lights import Lights
from scene.robust import TUKEY, spread, tukey

Array = NDArray[np.float64]
ROUNDS = 30
LIT = 0.15  # cosine under which a pixel is taken to be in shadow
BRIGHT = 0.3  # share of what it should show, or of the brightest, under which a pixel is in shadow to begin with
FACING = 0.2  # cosine to the camera's axis under which a pixel mixes with what lies behind
CURVED = 0.02  # smallest to largest singular value of the normals under which they face too much alike to fix a light
MISFIT = 0.15  # relative misfit from which the object is not matte, or the normals are not its own


def lights_from_normals(
    frames: Frames, camera: Camera, normals: NDArray, mask: NDArray[np.bool_]
) -> tuple[Lights, tuple[str, ...], tuple[str, ...]]:
    """Find each frame's distant light by the shading of a surface of known normals and unknown albedo.

    Parameters
    ----------
    frames : Frames
    camera : Camera
    normals : (H, W, 3) float
        Camera frame, unit, NaN where unknown; on the frames' pixels.
    mask : (H, W) bool
        The object.

    Returns
    -------
    lights : Lights
        Distant, with intensities per channel and sigmas.
    evidence, warnings : tuple of str

    Raises
    ------
    CalibrationError
        Too few lit pixels, or normals that all face one way.

    Notes
    -----
    I_pf = rho_p max(0, n_p.b_f): with n known, direction and strength b_f and albedo rho_p are fixed but for one
    common factor. Gauss-Newton with all rho_p eliminated; Tukey's weights on the relative misfit let
    shadows and gloss leave. Sigma: how much pixels that face different ways differ in what they say.
    """
    region = mask & np.isfinite(normals).all(-1) & (normals[..., 2] > FACING)
    probe = read_probe(frames, region)
    n = normals[probe.pixels[:, 1], probe.pixels[:, 0]].astype(np.float64)
    singular = np.linalg.svd(n, compute_uv=False) if len(n) >= FEWEST_PIXELS else np.zeros(3)
    if singular[-1] <= CURVED * singular[0]:
        raise CalibrationError(
            f"object.normals: {len(n)} of its pixels face the camera, and their directions spread by "
            f"{singular[-1] / max(singular[0], 1e-9):.3f} (expected at least {FEWEST_PIXELS} pixels and {CURVED:g}): "
            "they do not tell the lights. Put balls beside the object, or give a lights' file."
        )
    values = probe.values.mean(-1, dtype=np.float64)
    good = ~probe.clipped
    b, albedo = _start(values, good, n)
    weight = good.astype(np.float64)
    scale = np.inf
    for turn in range(ROUNDS):
        strength = np.linalg.norm(b, axis=1)
        cosine = b @ n.T / strength[:, None]
        residual = values / (albedo * strength[:, None]) - cosine
        lit = good & (cosine > LIT)
        scale = max(spread(residual[lit]), 1e-4)
        reach = TUKEY * scale * max(1.0, 3.0 - turn / 5)
        weight = np.where(lit, tukey(residual, reach), 0)
        weight[:, np.count_nonzero(weight, axis=0) < 3] = 0
        _check_seen(frames, weight)
        move, shift = _step(n, cosine, weight, residual)
        albedo = albedo * np.exp(np.clip(shift, -1, 1))
        b = b + strength[:, None] * move
    strength = np.linalg.norm(b, axis=1)
    directions = b / strength[:, None]
    sigma_deg, sigma = _sigma(n, directions, weight, values / (albedo * strength[:, None]))
    lights = Lights(
        frames.names,
        directions,
        by_channel(probe.values, strength, directions @ n.T, weight),
        None,
        np.zeros(3),
        sigma_deg,
        sigma,
    ).normalised()
    lights.check()
    evidence = (
        f"no ball and no lights' file: lights from the shading of the given normals ({np.count_nonzero(weight.any(0))} "
        f"pixels; misfit {scale:.1%} of a flash, directions to {np.median(sigma_deg):.1f} degrees, intensities to "
        f"{np.median(sigma):.1%})",
    )
    warnings = ["the lights are from object.normals themselves: methods that are judged by them are judged too kindly."]
    if not camera.is_orthographic:
        warnings.append("distant lights: a normal map has no distances, so that near flashes are not told from far.")
    if scale > MISFIT:
        warnings.append(
            f"object.normals: its shading misses the frames by {scale:.0%} of a flash (expected under {MISFIT:.0%}): "
            "another object's, in another frame of reference, not registered, or the object is far from matte."
        )
    return lights, evidence, tuple(warnings)


def _start(values: Array, good: NDArray[np.bool_], n: Array) -> tuple[Array, Array]:
    """Return light vectors (F, 3) and albedos (P,): albedo as a pixel's bright frames show it, then by turns."""
    albedo = np.maximum(np.quantile(values, 0.9, axis=0), 1e-6)
    b = np.empty((len(values), 3))
    for f, row in enumerate(values / albedo):
        use = good[f] & (row > BRIGHT * np.quantile(row, 0.95))
        for _ in range(5):
            b[f] = np.linalg.lstsq(n[use], row[use], rcond=None)[0] if use.sum() >= 3 else [0, 0, 1.0]
            use = good[f] & (n @ b[f] > LIT * np.linalg.norm(b[f])) & (row > BRIGHT * (n @ b[f]))
    return b, albedo


def _check_seen(frames: Frames, weight: Array) -> None:
    few = np.flatnonzero(np.count_nonzero(weight, axis=1) < FEWEST_PIXELS)
    if len(few):
        raise CalibrationError(
            f"{', '.join(frames.names[f] for f in few[:3])}: fewer than {FEWEST_PIXELS} pixels of the object are lit, "
            "unclipped and agree with its given normals. Did the flash fire? List the frame under frames.skip."
        )


def _reduced(n: Array, cosine: Array, weight: Array, residual: Array) -> tuple[Array, Array, Array]:
    """Return the normal matrix (3F, 3F) and its right side with every albedo eliminated, and w m^2 summed (P,)."""
    count = len(cosine)
    square = np.maximum(np.sum(weight * cosine**2, 0), 1e-9)
    v = (weight * cosine)[..., None] * n
    right = np.einsum("fp,pi->fi", weight * residual, n)
    right -= np.einsum("p,fpi->fi", np.sum(weight * cosine * residual, 0) / square, v)
    flat = (v / np.sqrt(square)[:, None]).transpose(0, 2, 1).reshape(3 * count, -1)
    matrix = -flat @ flat.T
    blocks = np.einsum("fp,pi,pj->fij", weight, n, n, optimize=True)
    for f in range(count):
        matrix[3 * f : 3 * f + 3, 3 * f : 3 * f + 3] += blocks[f]
    return matrix, right.ravel(), square


def _step(n: Array, cosine: Array, weight: Array, residual: Array) -> tuple[Array, Array]:
    """Return the change of each light (F, 3), relative to its strength, and of each albedo's logarithm (P,)."""
    matrix, right, square = _reduced(n, cosine, weight, residual)
    # The common factor of lights and albedos is free: the pseudo-inverse leaves it where it is.
    move = (np.linalg.pinv(matrix, rcond=1e-7, hermitian=True) @ right).reshape(-1, 3)
    return move, np.sum(weight * cosine * (residual - move @ n.T), 0) / square


def _sigma(n: Array, directions: Array, weight: Array, shown: Array) -> tuple[Array, Array]:
    """Return the sigma of directions (F,), degrees, and of strengths (F,), relative."""
    cosine = directions @ n.T
    moves = []
    for here in sectors(n):
        matrix, right, _ = _reduced(n[here], cosine[:, here], weight[:, here], (shown - cosine)[:, here])
        moves.append((np.linalg.pinv(matrix, rcond=1e-3, hermitian=True) @ right).reshape(-1, 3))
    all_moves = np.array(moves)
    along = np.sum(all_moves * directions, -1)
    across = all_moves - along[..., None] * directions
    degrees = np.rad2deg(np.sqrt(np.mean(np.sum(across**2, -1), 0) / 2))
    relative = along - along.mean(1, keepdims=True)
    return degrees, np.sqrt(np.mean(relative**2, 0))
