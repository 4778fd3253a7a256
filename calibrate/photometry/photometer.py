"""A matte ball as a photometer: how bright each flash was, per channel, and what light was left over.

    value = E_f (m + k B) + a

m is the flash's own shading, B the light that an even white table under the ball throws back at it, k the table's
albedo, and a the light that is there without flash. Only E_f is a frame's own: a free intercept in each frame would
trade against its intensity, 1 % of error where this leaves 0.1 %.
"""

from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

from calibrate.lights.directions import two_across
from calibrate.photometry.matte_shading import FEWEST_PIXELS, TERMINATOR, MatteSurface, tukey_weights
from scene.lights import Lights
from scene.normals import unit

Array = NDArray[np.float64]
DIM = 0.3  # share of the median flash under which a frame is not brought up to the others' weight
PARTLY, PARTLY_TIMES = 0.05, 3
"""Relative misfit of one frame from which something hides a part of the ball, or glares on it; and in the median's."""
SIDES = 8  # parts of a ball's outline whose errors are taken to agree
RINGS, SPOKES, FIRST_RING, GROWTH = 18, 24, 0.1, 1.33
"""Patches of the table around the ball's foot: rings that widen by `GROWTH`, from a tenth of the radius."""
STEADY = 3  # frames before and after a lamp was switched, at least
UNEVEN = 0.1  # share of a frame's bounce that an even, endless table misses: its edge, its pattern, others' shadows


class Photometry(NamedTuple):
    """What the ball measured."""

    intensities: Array  # (F, 3) pixel value of the ball facing each light at the reference point; NaN: unreadable
    sigma: Array  # (F,) relative to the others' mean, one frame, from the fit and from the error of the lights' places
    ambient: Array  # (3,) pixel value of light that is there in all frames alike, where the ball faces the camera
    misfit: Array  # (F,) relative rms of each frame's fit
    clipped: Array  # (F,) share of the ball's pixels that are clipped
    evidence: str  # what the ball showed beside the flashes

    @property
    def rms(self) -> float:
        """The misfit over all frames that could be read, 0 where none could."""
        known = self.misfit[np.isfinite(self.misfit)]
        return float(np.sqrt(np.mean(known**2))) if len(known) else 0.0

    @property
    def residual(self) -> float:
        """The median frame's misfit, 0 where none could be read."""
        return float(np.nanmedian(self.misfit)) if np.isfinite(self.misfit).any() else 0.0


def covariance_of(lights: Lights) -> Array:
    """Return the covariance (F, 3, 3) of positions, mm^2, or of unit directions, that the directions' sigmas make."""
    along = lights.directions[:, :, None] * lights.directions[:, None, :]
    across = np.deg2rad(np.nan_to_num(lights.direction_sigma_deg))[:, None, None] ** 2 * (np.eye(3) - along)
    if lights.positions_mm is None:
        return across
    return np.sum((lights.positions_mm - lights.reference_point_mm) ** 2, 1)[:, None, None] * across


def measure(surface: MatteSurface, lights: Lights, covariance: Array | None = None) -> Photometry:
    """Read each light's intensity from the ball's shading.

    `lights`: where they are; their intensities are not looked at. `covariance` (F, 3, 3): of each position, mm^2, or
    of each distant direction; None: exact.
    """
    count = len(surface.values)
    clipped = surface.clipped.mean(1) if surface.clipped.size else np.zeros(count)
    intensities, sigma, misfit = np.full((count, 3), np.nan), np.full(count, np.nan), np.full(count, np.nan)
    every = _cut(surface, lights)
    read = np.any(every.weight > 0, axis=1)
    if not read.any():
        return Photometry(intensities, sigma, np.full(3, np.nan), misfit, clipped, "")
    every = every.only(read)
    rough = _misfit(every, _energies(every, every.shading, 0.0, every.gray)[1])
    # What hides the flash from the ball in one frame must not bend what all frames share.
    level = every.level
    sound = (level > DIM * np.median(level)) & (rough < max(PARTLY, PARTLY_TIMES * float(np.median(rough))))
    kept = every.only(sound)
    ambient = np.zeros(3)
    for c in range(3):
        table, ambient[c] = _fit(kept, kept.values[..., c])
        shape = every.shading + table * every.bounce
        intensities[read, c] = _energies(every, shape, ambient[c], every.values[..., c])[0]
    table, room = _fit(kept, kept.gray)
    energy, residual = _energies(every, every.shading + table * every.bounce, room, every.gray)
    misfit[read] = _misfit(every, residual)
    # Half of the ball's sides agree by chance.
    sigma[read] = misfit[read] / np.sqrt(SIDES / 2)
    places = np.flatnonzero(read)[sound]
    moved = None if covariance is None else _moved_by(kept, lights.only(places), np.nan_to_num(covariance[places]))
    sigma[places] = _sigma(kept, table, room, moved)
    text = (
        f"white ball: ambient light of {ambient.mean() / np.median(energy[sound]):.1%} of the median flash, a table of "
        f"albedo {table:.2f} under it; residual {np.nanmedian(misfit):.1%}"
    )
    return Photometry(intensities, sigma, ambient, misfit, clipped, text)


def without_lamp(surface: MatteSurface, lights: Lights) -> tuple[int, MatteSurface] | None:
    """Return the frame from which on a lamp shone, and the surface without its light; None where none can be sought.

    value = E_f m + a . (1, n) + d . (1, n) [f >= k]: light from afar on a matte ball is nearly of first order in its
    normal [Basri2003]. E_f is eliminated in each frame; of all k the one is taken whose d removes most.
    """
    ball = _cut(surface, lights)
    read = np.any(ball.weight > 0, axis=1)
    frames = np.flatnonzero(read)
    if len(frames) < 2 * STEADY:
        return None
    ball = ball.only(read)
    table, _ = _fit(ball, ball.gray)
    root = np.sqrt(ball.relative)
    flash = root * (ball.shading + table * ball.bounce)
    flash /= np.maximum(np.linalg.norm(flash, axis=1, keepdims=True), 1e-30)
    lobes = root[..., None] * np.column_stack([np.ones(len(ball.normals)), ball.normals])
    lobes -= flash[..., None] * np.einsum("fb,fbi->fi", flash, lobes)[:, None]
    square, right = np.einsum("fbi,fbj->fij", lobes, lobes), np.einsum("fbi,fb,fbc->fic", lobes, root, ball.values)
    best, first, light = 0.0, 0, np.zeros((4, 3))
    for k in range(STEADY, len(frames) - STEADY + 1):
        (all_s, all_r), (new_s, new_r) = ((square[k0:].sum(0), right[k0:].sum(0)) for k0 in (0, k))
        matrix, target = np.block([[all_s, new_s], [new_s, new_s]]), np.concatenate([all_r, new_r])
        found = np.linalg.lstsq(matrix, target, rcond=1e-9)[0]
        if (gain := float(np.sum(found * target))) > best:
            best, first, light = gain, k, found[4:]
    values = surface.values.copy()
    values[frames[first] :] -= (light[0] + surface.normals @ light[1:]).astype(values.dtype)
    return int(frames[first]), replace(surface, values=values)


@dataclass(frozen=True)
class _Patches:
    """One ball in F frames, B patches; errors agree within a patch."""

    weight: Array  # (F, B) 0 where nothing is known
    values: Array  # (F, B, 3)
    shading: Array  # (F, B) max(0, n.l) with a near light's fall-off, of a flash of intensity 1
    bounce: Array  # (F, B) what a white table under the ball throws back of it
    normals: Array  # (B, 3)
    points: Array  # (B, 3)

    @property
    def gray(self) -> Array:
        return self.values.mean(-1)

    @property
    def level(self) -> Array:
        """(F,) how bright the flashes are, roughly."""
        square = np.sum(self.weight * self.shading**2, 1)
        return np.sum(self.weight * self.shading * self.gray, 1) / np.maximum(square, 1e-12)

    @property
    def relative(self) -> Array:
        """(F, B) weights of relative errors: a bright flash's patches scatter in proportion."""
        return self.weight / np.maximum(self.level, DIM * np.median(self.level))[:, None] ** 2

    def only(self, frames: NDArray[np.bool_]) -> "_Patches":
        names = ("weight", "values", "shading", "bounce")
        return replace(self, **{name: getattr(self, name)[frames] for name in names})


def _cut(surface: MatteSurface, lights: Lights) -> _Patches:
    """Average a ball's pixels over its patches, frame by frame; what its neighbours contradict is left out."""
    blocks = int(surface.block.max(initial=-1)) + 1
    count = len(surface.values)
    normals, points = (_by_block(surface.block, x, np.ones(len(x)), blocks) for x in (surface.normals, surface.points))
    normals = normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-9)
    weight, shading, values = np.zeros((count, blocks)), np.zeros((count, blocks)), np.zeros((count, blocks, 3))
    below = (1 - surface.normals @ surface.table) / 2
    toward = lights.toward(surface.points)
    for f in range(count):
        falling = np.sum(surface.normals * toward[f], 1)
        cosine = falling / np.maximum(np.linalg.norm(toward[f], axis=1), 1e-12)
        lit = (cosine > TERMINATOR) & ~surface.clipped[f]
        if lit.sum() < FEWEST_PIXELS or not np.isfinite(cosine).all():
            continue
        # The dark side shows ambient light and bounce.
        use = lit | ((cosine < -TERMINATOR) & ~surface.clipped[f])
        falling, pixels = np.maximum(falling[use], 0), surface.values[f][use].astype(np.float64)
        robust = tukey_weights(np.column_stack([falling, below[use], np.ones(len(falling))]), pixels.mean(1))
        block = surface.block[use]
        total = np.bincount(block, robust, blocks)
        weight[f] = total / total.sum()
        shading[f] = _by_block(block, falling[:, None], robust, blocks)[:, 0]
        values[f] = _by_block(block, pixels, robust, blocks)
    bounce = _bounce(normals, surface, lights)
    return _Patches(weight, values, shading, bounce, normals, points)


def _bounce(normals: Array, surface: MatteSurface, lights: Lights) -> Array:
    """Return (F, B), the light of each flash that parts of a ball get from an even, matte, white, endless table.

    A part gets sum over the table's patches of E cos cos' dA / (pi d^2). E has the flash's
    own cosine and fall-off at the patch, and is zero in the ball's own shadow: the side that faces the flash gets more.
    """
    edges = np.concatenate([[0.0], FIRST_RING * GROWTH ** np.arange(RINGS)])
    middle, area = 0.5 * (edges[1:] + edges[:-1]), np.pi * np.diff(edges**2) / SPOKES
    turn = 2 * np.pi * (np.arange(SPOKES) + 0.5) / SPOKES
    # From the ball's centre, in its radii.
    side, other = two_across(surface.table)
    ring = np.cos(turn)[:, None] * side + np.sin(turn)[:, None] * other
    patches = (middle[:, None, None] * ring).reshape(-1, 3) - surface.table
    toward = lights.toward(surface.center + surface.radius * patches)
    lit = np.maximum(toward @ surface.table, 0)
    along = -np.sum(unit(toward) * patches, -1)
    # The ball hides the flash from patches whose ray passes its centre nearer than its radius.
    lit[(along > 0) & (np.sum(patches**2, 1) - along**2 < 1)] = 0
    way = patches - normals[:, None]
    square = np.sum(way**2, -1)
    here = np.maximum(np.sum(way * normals[:, None], -1), 0)
    return lit @ (here * -(way @ surface.table) / (np.pi * square**2) * np.repeat(area, SPOKES)).T


def _by_block(block: NDArray[np.intp], values: Array, weight: Array, blocks: int) -> Array:
    """Return the weighted mean (B, k) of values (P, k) over each block."""
    total = np.maximum(np.bincount(block, weight, blocks), 1e-12)
    return np.stack([np.bincount(block, weight * column, blocks) / total for column in values.T], -1)


def _fit(ball: _Patches, values: Array) -> tuple[float, float]:
    """Return the table's albedo and the ambient light that fit values (F, B) best."""

    def left(table: float) -> float:
        shape = ball.shading + table * ball.bounce
        return float(np.sum(ball.relative * _energies(ball, shape, _ambient(ball, shape, values), values)[1] ** 2))

    found: Any = minimize_scalar(left, bounds=(0, 1), method="bounded", options={"xatol": 1e-3})
    table = float(found.x) if found.fun < left(0.0) else 0.0
    return table, _ambient(ball, ball.shading + table * ball.bounce, values)


def _energies(ball: _Patches, shape: Array, ambient: float, values: Array) -> tuple[Array, Array]:
    """Return the flashes' energies (F,) and value less model (F, B), all else held."""
    rest, weight = values - ambient, ball.weight
    energy = np.sum(weight * shape * rest, 1) / np.maximum(np.sum(weight * shape**2, 1), 1e-30)
    return energy, rest - energy[:, None] * shape


def _ambient(ball: _Patches, shape: Array, values: Array) -> float:
    """Return the ambient light, with every energy eliminated; 0 where it would be negative."""
    weight = ball.relative
    square, mixed = np.maximum(np.sum(weight * shape**2, 1), 1e-30), np.sum(weight * shape, 1)
    left = weight.sum() - np.sum(mixed**2 / square)
    right = np.sum(weight * values) - np.sum(mixed * np.sum(weight * shape * values, 1) / square)
    return max(float(right / left), 0.0) if left > 1e-9 * weight.sum() else 0.0


def _misfit(ball: _Patches, residual: Array) -> Array:
    """Return (F,) the rms of residuals (F, B), relative to each frame's flash."""
    return np.sqrt(np.sum(ball.relative * residual**2, 1))


def _moved_by(ball: _Patches, lights: Lights, covariance: Array) -> Array:
    """Return (3, F, B), the shading of lights that are off by one sigma along each axis of their covariance."""
    values, axes = np.linalg.eigh(covariance)
    out = []
    for step in np.moveaxis(axes * np.sqrt(np.maximum(values, 0))[:, None], -1, 0):
        if lights.positions_mm is None:
            moved = replace(lights, directions=lights.directions + step)
        else:
            moved = replace(lights, positions_mm=lights.positions_mm + step)
        change = np.sum((moved.toward(ball.points) - lights.toward(ball.points)) * ball.normals, -1)
        out.append(np.where(ball.shading > TERMINATOR, ball.shading + change, ball.shading))
    return np.stack(out)


def _sigma(ball: _Patches, table: float, ambient: float, moved: Array | None) -> Array:
    """Return (F,) the relative sigma of each energy against the others' mean.

    Patches on one side of the ball err alike: each side is left out in turn. The lights' places err, and the table is
    not what it is taken for.
    """

    def energies(one: _Patches, shading: Array, table: float, ambient: float) -> Array:
        return _energies(one, shading + table * one.bounce, ambient, one.gray)[0]

    # A patch's place around the outline is in its number: see `read_surface`.
    side = np.arange(ball.weight.shape[1]) * SIDES // ball.weight.shape[1]
    without = []
    for k in range(SIDES):
        less = replace(ball, weight=ball.weight * (side != k))
        without.append(energies(less, less.shading, *_fit(less, less.gray)))
    here = energies(ball, ball.shading, table, ambient)
    others = [energies(ball, ball.shading, (1 - UNEVEN) * table, ambient)]
    others += [] if moved is None else [energies(ball, shading, table, ambient) for shading in moved]
    scatter = np.array([one / one.mean() for one in without])
    square = (SIDES - 1) * scatter.var(0)
    # Each frame's light errs by itself: against the others' mean.
    for other in others:
        square += (other / here - 1) ** 2
    return np.sqrt(square)
