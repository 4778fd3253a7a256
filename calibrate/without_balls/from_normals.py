"""Lights from an object whose normals are given: no ball and no lights' file, but every pixel's n is known."""

import numpy as np
from numpy.typing import NDArray

from calibrate.without_balls.probe import FEWEST_PIXELS, LIT, SECTORS, read_probe, turned
from scene.camera import Camera
from scene.errors import CalibrationError
from scene.frames import Frames
from scene.lights import Lights
from scene.normals import unit
from scene.robust import TUKEY, spread, tukey

Array = NDArray[np.float64]
ROUNDS, MORE = 200, 30  # turns of lights and albedos, and of either without a part of the pixels
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
    common factor, and found by turns, each by least squares; Tukey's weights on the relative misfit let shadows and
    gloss leave. Sigma: how much pixels that face different ways differ in what they say.
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
    weight, scale = good.astype(np.float64), np.inf
    for turn in range(ROUNDS):
        strength = np.linalg.norm(b, axis=1)
        cosine = b @ n.T / strength[:, None]
        residual = values / (albedo * strength[:, None]) - cosine
        lit = good & (cosine > LIT)
        scale = max(spread(residual[lit]), 1e-4)
        weight = np.where(lit, tukey(residual, TUKEY * scale * max(1.0, 3.0 - turn / 25)), 0)
        weight[:, np.count_nonzero(weight, axis=0) < 3] = 0
        few = np.flatnonzero(np.count_nonzero(weight, axis=1) < FEWEST_PIXELS)
        if len(few):
            raise CalibrationError(
                f"{', '.join(frames.names[f] for f in few[:3])}: fewer than {FEWEST_PIXELS} pixels of the object are "
                "lit, unclipped and agree with its given normals. Did the flash fire? List the frame under frames.skip."
            )
        b, albedo = _turn(values, n, weight, b, albedo)
    strength = np.linalg.norm(b, axis=1)
    directions = b / strength[:, None]
    sigma_deg, sigma = _sigma(values, n, weight, b, albedo)
    shading, intensities = directions @ n.T, np.empty((len(b), 3))
    for c in range(3):
        # Each channel has albedos and strengths of its own; directions and weights are shared.
        channel, own = probe.values[..., c].astype(np.float64), strength
        for _ in range(MORE):
            shape = shading * own[:, None]
            pixel = np.sum(weight * shape * channel, 0) / np.maximum(np.sum(weight * shape**2, 0), 1e-12)
            part, relative = pixel * shading, weight / np.maximum(pixel, 1e-6) ** 2
            own = np.sum(relative * part * channel, 1) / np.sum(relative * part**2, 1)
        intensities[:, c] = own
    lights = Lights(
        frames.names,
        directions,
        intensities,
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


def _turn(values: Array, n: Array, weight: Array, b: Array, albedo: Array) -> tuple[Array, Array]:
    """Return better light vectors (F, 3) and, with these, albedos (P,), of mean 1."""
    matrix = (weight @ (n[:, :, None] * n[:, None, :]).reshape(-1, 9)).reshape(-1, 3, 3) + 1e-9 * np.eye(3)
    b = np.asarray(np.linalg.solve(matrix, ((weight * values / albedo) @ n)[..., None])[..., 0], np.float64)
    # Relative errors: a bright flash's scatter in proportion.
    share = weight / np.sum(b**2, 1, keepdims=True)
    shading = b @ n.T
    square = np.sum(share * shading**2, 0)
    better = np.where(square > 0, np.sum(share * shading * values, 0) / np.maximum(square, 1e-30), albedo)
    scale = float(better.mean())
    return b * scale, np.maximum(better, 1e-9 * scale) / scale


def _sigma(values: Array, n: Array, weight: Array, b: Array, albedo: Array) -> tuple[Array, Array]:
    """Return the sigma of directions (F,), degrees, and of strengths (F,), relative: each part left out in turn."""
    part = ((turned(n) / (2 * np.pi) + 0.5) * SECTORS).astype(np.intp) % SECTORS
    without = []
    for k in range(SECTORS):
        less, one, pixels = weight * (part != k), b, albedo
        for _ in range(MORE):
            one, pixels = _turn(values, n, less, one, pixels)
        without.append(one)
    moves = np.stack(without) / np.linalg.norm(b, axis=1)[:, None]
    directions = unit(b)
    along = np.sum(moves * directions, -1)
    across = moves / along[..., None] - directions
    # What a part says is farther off by as much as there are others.
    degrees = (SECTORS - 1) * np.rad2deg(np.sqrt(np.mean(np.sum(across**2, -1), 0) / 2))
    relative = along / along.mean(1, keepdims=True) - 1
    return degrees, (SECTORS - 1) * np.sqrt(np.mean(relative**2, 0))
