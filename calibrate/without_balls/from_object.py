"""The flashes' strengths where no white ball and no file tells them: by something matte that is seen.

Directions are known. Every matte pixel says I_f = e_f b.l_f with a vector b of its own: three unknowns a pixel, and
F - 1 in common.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from calibrate.calibration import Notes, leave_out
from calibrate.lights.directions import two_across
from calibrate.photometry.from_white import no_flash
from calibrate.photometry.table_normal import standing
from calibrate.without_balls.from_table import strengths_on_table
from calibrate.without_balls.probe import (
    FEWEST_PIXELS,
    LIT,
    Probe,
    ProbePhotometry,
    read_beside,
    turned,
    varied,
)
from scene.camera import Camera
from scene.frames import Frames
from scene.intensities import GROUPS, Eliminated, Evidence, evidence, solve_intensities
from scene.lights import Lights
from scene.normals import unit
from scene.robust import spread
from scene.spheres import Sphere

Array = NDArray[np.float64]
FEWEST_FRAMES = 5
"""Three frames fix a pixel's b, and the fourth says nothing of itself until there is a fifth to doubt it."""
ROUNDS, OUTLIER = 16, 2.5  # turns of the fit, and spreads from which a sample is believed no more
CONTRAST = 1.5  # of what the next best strengths leave to what the best ones do: less, and the pixels do not tell them
ARC = 2  # neighbours of `GROUPS` whose strengths scatter: parts of the pixels that face one way
DRAWS = 8  # of the directions within their sigmas, whose strengths scatter
RELIEF = 0.07  # how far, of its distance, a surface may lie off the reference point's plane
USUALLY_BELIEVED = 0.5  # of the other frames' share of believed samples: under it a frame shows another object
TOO_VAGUE = 0.25  # sigma of the strengths from which they are no better than taking all flashes for equally bright


def strengths_from_object(
    frames: Frames, camera: Camera, spheres: list[Sphere], lights: Lights, notes: Notes
) -> tuple[Array, Array] | None:
    """Read the flashes' strengths from the table, or from the object, whichever tells them better; say so.

    They are drawn to equal power as far as their errors allow.

    Returns intensities (F, 3), each channel's mean 1, and their relative sigma (F,); None where nothing matte is lit
    from enough sides, and the lights are distant.
    """
    read, equal = measured_beside_balls(frames, camera, spheres, lights), _of_equal_power(lights)
    if read is None or not np.median(read.sigma) < TOO_VAGUE:
        if lights.positions_mm is None:
            return None
        notes.warnings.append(
            "no white ball, and nothing matte that tells the flashes' strengths: all are taken as equally powerful, by "
            "their distances. 5 % of variation bends normals by 2 degrees."
        )
        return np.repeat(equal[:, None], 3, 1), np.full(len(lights), np.nan)
    intensities, sigma, scatter = _shrunk(read.intensities, read.sigma, equal)
    notes.evidence.append(
        f"no white ball: the flashes' strengths from {read.pixels} pixels of {read.surface} (misfit "
        f"{read.residual:.1%} of a flash); they vary in power by {scatter:.0%}, each to {np.median(sigma):.1%}; what "
        "is within their errors is drawn to equal power"
    )
    notes.warnings.append(
        f"no white ball: the flashes' strengths are from the shading of {read.surface}, which supposes that it is "
        f"matte; to {np.median(sigma):.1%}, and errors that bend all normals alike. Put a white ball beside the "
        "object, or list the one that is there under [[spheres]]."
    )
    return intensities, sigma


def white_in_shadow(frames: Frames, camera: Camera, spheres: list[Sphere], lights: Lights, notes: Notes) -> Lights:
    """Give flashes of infinite sigma, which no white ball shows, the strength that table or object show beside others'.

    How far these and the white balls agree on the other flashes is its sigma. Raises CalibrationError where they do not
    tell it.
    """
    hidden = np.isinf(lights.intensity_sigma)
    names = [name for name, lacks in zip(lights.names, hidden, strict=True) if lacks]
    read, white, sigma = measured_beside_balls(frames, camera, spheres, lights), lights.intensities, np.inf
    if read is not None and np.count_nonzero(~hidden) > 1 and _is_seen_in(read, hidden):
        ratio = np.log(white[~hidden] / read.intensities[~hidden])
        sigma = float(ratio.mean(1).std(ddof=1))
    if read is None or sigma > TOO_VAGUE:
        raise no_flash(names, white[hidden].mean(1) / np.median(white.mean(1)))
    notes.warnings.append(
        f"{', '.join(names)}: every white ball stands in shadow: the flash's strength is what the shading of "
        f"{read.surface} says, beside the other flashes', to {sigma:.0%}. Reshoot with a white ball in the light, or "
        f"leave out: {leave_out(names)}."
    )
    intensities = np.where(hidden[:, None], read.intensities * np.exp(ratio.mean(0)), white)
    return replace(lights, intensities=intensities, intensity_sigma=np.where(hidden, sigma, lights.intensity_sigma))


def _is_seen_in(read: ProbePhotometry, frames: NDArray[np.bool_]) -> bool:
    """Whether the object is lit in frames (F,), and looks there as in the others: else they show something else."""
    return bool((read.believed[frames] > USUALLY_BELIEVED * np.median(read.believed[~frames])).all())


def measured_beside_balls(
    frames: Frames, camera: Camera, spheres: list[Sphere], lights: Lights
) -> ProbePhotometry | None:
    """Read the flashes' strengths from the table, or from what matte surfaces there are: what tells them better."""
    probe = read_beside(frames, camera, spheres)
    on_object = _measured_on_object(probe, camera, lights)
    # The lights' file may have distant ones, about no place.
    is_placed = lights.reference_point_mm[2] < 0 and len(standing(camera, spheres)) == 1
    if on_object and lights.positions_mm is None and is_placed:
        on_object = _of_any_range(on_object, probe, camera, lights)
    both = strengths_on_table(probe, camera, spheres, lights), on_object
    return min((one for one in both if one is not None), key=lambda one: float(np.median(one.sigma)), default=None)


def _measured_on_object(probe: Probe, camera: Camera, lights: Lights) -> ProbePhotometry | None:
    """Read the flashes' strengths from whatever matte surfaces are seen, with directions known.

    None where these do not tell them. The lights' intensities are not looked at.

    Notes
    -----
    A table fills the picture with one normal, which does not determine them [Cho2016]: so pixels are drawn evenly over
    the directions that they seem to face, not over the picture.
    """
    depth = lights.reference_point_mm[2]

    def toward(stretch: float) -> Array:
        flat = camera.points_at_depth(probe.pixels, depth * stretch) if depth < 0 else np.zeros((len(probe.pixels), 3))
        return lights.toward(flat)

    probe = varied(probe, toward(1.0))
    # Near flashes: the surface's height is unknown, and what is nearer to them is brighter.
    stretches = (1.0,) if lights.positions_mm is None or depth >= 0 else (1.0, 1 - RELIEF, 1 + RELIEF)
    # The first one's sigma is taken: what the directions' errors do to the others is not asked.
    read = [intensities_from_object(probe, toward(s), lights.direction_sigma_deg * (s == 1.0)) for s in stretches]
    good = [one for one in read if one is not None]
    if len(good) < len(stretches):
        return None
    strengths = np.stack([one.intensities.mean(1) for one in good])
    sigma = np.hypot(good[0].sigma, np.abs(strengths / strengths[0] - 1).max(0))
    return good[0]._replace(sigma=sigma)


def _of_any_range(distant: ProbePhotometry, probe: Probe, camera: Camera, lights: Lights) -> ProbePhotometry | None:
    """Read the strengths of flashes whose ranges one ball cannot tell; `distant`: as if they were far away.

    A flash that stands as far away as the camera lights one side of the picture more. It is taken to stand twice as
    far: half-way in 1 / range from there to infinity, and as unsure.
    """
    ranges = 2 * np.linalg.norm(lights.reference_point_mm)
    near = replace(lights, positions_mm=lights.reference_point_mm + ranges * lights.directions)
    read = _measured_on_object(probe, camera, near)
    if read is None:
        return None
    apart = read.intensities.mean(1) / distant.intensities.mean(1) - 1
    return read._replace(sigma=np.hypot(read.sigma, apart))


def _of_equal_power(lights: Lights) -> Array:
    """Return (F,) what flashes of one power do at the reference point, mean 1."""
    if lights.positions_mm is None:
        return np.ones(len(lights))
    fall = 1 / np.sum((lights.positions_mm - lights.reference_point_mm) ** 2, 1)
    return fall / fall.mean()


def _shrunk(intensities: Array, sigma: Array, equal: Array) -> tuple[Array, Array, float]:
    """Draw the strengths to those of equal power as far as their scatter is no more than their errors.

    Notes
    -----
    Mostly one flash is carried around. With measured log powers p of errors sigma, and tau^2 what their variance
    exceeds the errors' by, the best guess is the mean and tau^2 / (tau^2 + sigma^2) of the rest.
    """
    power = np.log(intensities.mean(1) / equal)
    power -= power.mean()
    square = max(float(np.var(power) - np.mean(sigma**2)), 0.0)
    keep = square / (square + sigma**2)
    drawn = intensities * np.exp((keep - 1) * power)[:, None]
    # Flashes of one power that vary by nothing would have no error: leave them a third of what was measured.
    return drawn / drawn.mean(0), sigma * np.sqrt(np.maximum(keep, 1 / 9)), float(np.sqrt(square))


def intensities_from_object(probe: Probe, toward: Array, sigma_deg: Array) -> ProbePhotometry | None:
    """Read the flashes' intensities from matte pixels of unknown normal and albedo.

    Parameters
    ----------
    probe : Probe
        Pixels (P) of the object.
    toward : (F, P, 3) float
        Light vectors of intensity 1 at each pixel: unit, or with the fall-off of near lights.
    sigma_deg : (F,) float
        Standard deviation of the directions, degrees; NaN where unknown.

    Returns
    -------
    ProbePhotometry or None
        None where the pixels do not determine the intensities: too few, or all facing one way.

    Notes
    -----
    Semi-calibrated photometric stereo [Cho2016], see `scene.intensities`, by turns with which samples keep to it:
    shadows and gloss leave. Sigma: how much pixels that face different ways differ, and what the directions' own error
    moves.
    """
    bright, believable = probe.bright, probe.lit.T
    use = believable.sum(1) >= FEWEST_FRAMES
    use &= bright > 0.05 * np.quantile(bright, 0.9) if len(bright) else use
    if use.sum() < FEWEST_PIXELS:
        return None
    values = np.moveaxis(probe.values[:, use], 0, 1).astype(np.float64)
    light, believable = np.moveaxis(np.asarray(toward, np.float64)[:, use], 0, 1), believable[use]

    def solved(light: Array, used: NDArray[np.bool_], energy: Array) -> tuple[Array, list[Evidence], float]:
        """Return intensities (F, 3), what the pixels say of each channel, and how clearly."""
        said = evidence(values / energy[:, None], used, light)
        channels = [solve_intensities(one) for one in said]
        relative = energy[:, None] * np.stack([one.relative for one in channels], -1)
        return relative / relative.mean(0), said, min(one.contrast for one in channels)

    used, energy, scale = believable, np.ones(len(toward)), np.inf
    for turn in range(ROUNDS):
        relative, _, _ = solved(light, used, energy)
        energy = np.clip(np.abs(relative.mean(1)), 0.1, 10)  # one that is far off may come out negative at first
        scaled = values.mean(-1) / energy
        b = Eliminated.of(light, used.astype(np.float64), scaled).b
        length = np.maximum(np.linalg.norm(b, axis=1), 1e-9)[:, None]
        shading = np.einsum("pfi,pi->pf", light, b)
        residual = (scaled - shading) / length
        scale = max(spread(residual[used]), 1e-4)
        # Wide at first: the start may be off by more than the misfit that is looked for.
        used = believable & (np.abs(residual) < OUTLIER * scale * max(1.0, 3.0 - turn / 5)) & (shading > LIT * length)
        used &= used.sum(1, keepdims=True) >= FEWEST_FRAMES
        if np.count_nonzero(used.any(1)) < FEWEST_PIXELS:
            return None
        if turn == 0:
            # From here on pixels that face one way are neighbours: they err alike.
            facing = b / length
            slant = facing @ unit(facing.mean(0))
            order = np.lexsort([turned(facing), slant > np.median(slant)])
            values, light, believable, used = values[order], light[order], believable[order], used[order]
    relative, said, contrast = solved(light, used, energy)
    if not contrast > CONTRAST:
        return None
    some = (np.arange(GROUPS)[:, None] + np.arange(ARC)) % GROUPS
    arcs = [np.mean([solve_intensities(Evidence(e.misfit[k], e.noise[k])).relative for e in said], 0) for k in some]
    sigma = np.sqrt(np.mean((np.stack(arcs) - 1) ** 2, 0))
    rng, turns, moved = np.random.default_rng(0), np.deg2rad(np.nan_to_num(sigma_deg)), []
    strength = np.linalg.norm(light, axis=-1, keepdims=True)
    side, up = two_across(unit(light.mean(0)))
    for a, c in rng.normal(size=(DRAWS if turns.any() else 0, 2, len(turns), 1)):
        off = turns[:, None] * (a * side + c * up)
        moved.append(solved(light + strength * off, used, energy)[0].mean(1) / relative.mean(1) - 1)
    if moved:
        sigma = np.hypot(sigma, np.sqrt(np.mean(np.square(moved), 0)))
    share = used.sum(0) / np.maximum(believable.sum(0), 2 * FEWEST_PIXELS)
    return ProbePhotometry("the object", relative, sigma, scale, int(np.count_nonzero(used.any(1))), share)
