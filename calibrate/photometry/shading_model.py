"""What a matte ball shows under every flash, and the smallest model that explains it.

    value = E_f (m exp(-mu A) + k B(up) + g S) + a + a'.n

m is the flash's own shading, A how far beside its axis the surface lies (-log cos; it aims at the reference point), B
the table's bounce with up the table's normal, S its gloss, and a the light that is there without flash.
"""

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from calibrate.photometry.patches import GLOSS_WIDTHS, Patches, Table, table_under
from scene.normals import unit

Array = NDArray[np.float64]
DEMANDED = 10.0  # how much BIC must fall before a part is taken into the model
BEAM, BEAM_BOUNCE = 0.5, 1.5
"""Standard deviation of mu, and what a bounce adds to it, times the table's albedo: light from the object's side."""
CERTAIN = 2  # standard deviations from which on a beam is claimed
DIM = 0.3  # share of the median flash under which a frame is not brought up to the others' weight
STEP = 1e-6  # of the differences by the table's tilt
FLOOR = 1e-3  # relative misfit that is not worth a further part: blur, quantisation, the patches' finite size
STARTS = {"bounce": 0.1, "gloss": 0.02, "beam": 1.0}  # numbers with which a part is tried
MOST_TABLES = 16  # that are kept, by tilt


@dataclass(frozen=True)
class Parts:
    """Which parts a model has, and their nonlinear numbers; None where a part is left out."""

    ambient: int = 0  # 0: none; 1: an even one; 4: one that also has a direction
    bounce: float | None = None  # the table's albedo, as far as the ball sees an even, endless one
    tilt: tuple[float, float] | None = None  # x and y of the table's normal over its z; None: it faces the camera
    gloss: float | None = None  # strength of the lobe
    width: int = 0  # which of `GLOSS_WIDTHS`
    beam: float | None = None  # mu of a near flash's cos^mu

    @property
    def beam_sigma(self) -> float:
        """How far mu may be off for what else is around: the object's reflected light, or its shadow."""
        return BEAM + BEAM_BOUNCE * (self.bounce or 0.0)

    @property
    def is_certain(self) -> bool:
        """Whether no beam is claimed that the surroundings could feign."""
        return self.beam is None or self.beam > CERTAIN * self.beam_sigma

    def numbers(self) -> Array:
        """Return the free nonlinear numbers in a row."""
        strengths = [x for x in (self.bounce, self.gloss, self.beam) if x is not None]
        return np.array([*strengths, *(self.tilt or ())], float)

    def with_numbers(self, row: Array) -> "Parts":
        """Return the same model with other numbers: the inverse of `numbers`."""
        rest = [float(x) for x in row]
        bounce, gloss, beam = (None if x is None else rest.pop(0) for x in (self.bounce, self.gloss, self.beam))
        tilt = None if self.tilt is None else (rest[0], rest[1])
        return replace(self, bounce=bounce, gloss=gloss, beam=beam, tilt=tilt)


class Fit(NamedTuple):
    """A model fitted."""

    parts: Parts
    energy: Array  # (F,) pixel value of the surface that faces the flash at the reference point
    ambient: Array  # (4,) a and a'
    residual: Array  # (F, B) value less model
    bic: float


class ShadingModel:
    """One ball's patches under all flashes, and the solver of the model above."""

    def __init__(self, ball: Patches) -> None:
        self.ball = ball
        self.around = np.column_stack([np.ones(len(ball.normals)), ball.normals])
        level = np.sum(ball.weight * ball.shading * ball.values.mean(-1), 1)
        level /= np.maximum(np.sum(ball.weight * ball.shading**2, 1), 1e-12)
        # Relative errors: a bright flash's patches scatter in proportion. Not those of a ball in shadow.
        self.level = level
        self.weight = ball.weight / np.maximum(level, DIM * np.median(level))[:, None] ** 2
        self._tables: dict[tuple[float, float], Table] = {}

    def table(self, tilt: tuple[float, float] | None) -> Table:
        """Return the table, so tilted."""
        x, y = tilt or (0.0, 0.0)
        if (x, y) not in self._tables:
            if len(self._tables) > MOST_TABLES:
                self._tables.clear()
            self._tables[x, y] = table_under(self.ball, unit(np.array([x, y, 1.0])))
        return self._tables[x, y]

    def bounce(self, parts: Parts) -> Array:
        """Return B (F, B)."""
        return self.table(parts.tilt).bounce(parts.beam or 0.0)

    def shape(self, parts: Parts) -> Array:
        """Return (F, B), what the patches show of a flash of energy 1."""
        shape = self.ball.shading
        if parts.beam is not None:
            shape = shape * np.exp(-parts.beam * self.ball.aside)
        if parts.bounce is not None:
            shape = shape + parts.bounce * self.bounce(parts)
        if parts.gloss is not None:
            shape = shape + parts.gloss * self.ball.gloss[parts.width]
        return shape

    def slopes(self, parts: Parts) -> list[Array]:
        """Return the derivatives (F, B) of `shape` by the numbers of `parts`."""
        out = []
        if parts.bounce is not None:
            out.append(self.bounce(parts))
        if parts.gloss is not None:
            out.append(self.ball.gloss[parts.width])
        if parts.beam is not None:
            by_beam = -self.ball.aside * self.ball.shading * np.exp(-parts.beam * self.ball.aside)
            if parts.bounce is not None:
                by_beam += parts.bounce * self.table(parts.tilt).by_beam(parts.beam)
            out.append(by_beam)
        if parts.tilt is not None and parts.bounce is not None:
            x, y = parts.tilt
            for tilt in ((x + STEP, y), (x, y + STEP)):
                out.append(parts.bounce * (self.bounce(replace(parts, tilt=tilt)) - self.bounce(parts)) / STEP)
        return out

    def linear(self, parts: Parts, values: Array) -> tuple[Array, Array, Array]:
        """Return energy (F,), ambient (p,) and value less model (F, B), the numbers of `parts` held."""
        weight, shape, around = self.weight, self.shape(parts), self.around[:, : parts.ambient]
        square = np.maximum(np.sum(weight * shape**2, 1), 1e-30)
        direct = np.sum(weight * shape * values, 1)
        mixed = (weight * shape) @ around
        ambient = np.zeros(parts.ambient)
        if parts.ambient:
            # With every energy eliminated.
            matrix = around.T @ (weight.sum(0)[:, None] * around) - mixed.T @ (mixed / square[:, None])
            right = around.T @ np.sum(weight * values, 0) - mixed.T @ (direct / square)
            ambient = np.linalg.lstsq(matrix, right, rcond=1e-9)[0]
        energy = (direct - mixed @ ambient) / square
        return energy, ambient, values - energy[:, None] * shape - around @ ambient

    def energies(self, parts: Parts, ambient: Array, values: Array) -> tuple[Array, Array]:
        """Return energy (F,) and value less model (F, B), all else held."""
        shape, rest = self.shape(parts), values - self.around @ ambient
        energy = np.sum(self.weight * shape * rest, 1) / np.maximum(np.sum(self.weight * shape**2, 1), 1e-30)
        return energy, rest - energy[:, None] * shape

    def misfit(self, residual: Array) -> Array:
        """Return (F,) the rms of residuals (F, B), relative to each frame's flash."""
        return np.sqrt(np.sum(self.weight * residual**2, 1))

    def fit(self, parts: Parts, values: Array) -> Fit:
        """Fit a model's numbers, and with them energies and ambient light, to values (F, B)."""
        from scipy.optimize import least_squares

        root = np.sqrt(self.weight)
        start = parts.numbers()
        if len(start):
            # Neither bounce nor gloss takes light away, and no flash spares what it aims at.
            low = np.where(np.arange(len(start)) < len(start) - 2 * (parts.tilt is not None), 0.0, -np.inf)

            def misfit(row: Array) -> Array:
                return (root * self.linear(parts.with_numbers(row), values)[2]).ravel()

            def jacobian(row: Array) -> Array:
                # What the energies and the ambient light cannot follow of a change [Golub1973].
                at = parts.with_numbers(row)
                energy = self.linear(at, values)[0][:, None]
                return np.stack([-(root * self.linear(at, energy * s)[2]).ravel() for s in self.slopes(at)], -1)

            found = least_squares(
                misfit,
                start,
                jacobian,  # pyright: ignore[reportArgumentType]: the stub knows only the names of differences
                bounds=(low, np.inf),
            )
            best = parts.with_numbers(found.x)
        else:
            best = parts
        energy, ambient, residual = self.linear(best, values)
        number = int(np.count_nonzero(self.weight))
        square = np.sum(self.weight * residual**2) / max(np.count_nonzero(self.weight.any(1)), 1)
        free = len(start) + parts.ambient
        bic = number * np.log(square + FLOOR**2) + free * np.log(number)
        return Fit(best, energy, np.pad(ambient, (0, 4 - parts.ambient)), residual, float(bic))


def choose(model: ShadingModel, values: Array) -> tuple[Fit, float]:
    """Return the smallest model that explains values (F, B), and how far BIC fell for it.

    Notes
    -----
    From the plain n.l, step by step, the part is added that lowers BIC most, or one is dropped that it no longer needs.
    """
    plain = fit = model.fit(Parts(), values)
    while True:
        rivals = [model.fit(parts, values) for parts in _larger(fit.parts, near=model.ball.axis is not None)]
        # Light that is left over cannot be negative.
        rivals = [rival for rival in rivals if rival.ambient[0] >= 0 and rival.parts.is_certain]
        best = min(rivals, key=lambda rival: rival.bic, default=fit)
        if fit.bic - best.bic < DEMANDED:
            return fit, plain.bic - fit.bic
        fit = best
        for parts in _smaller(fit.parts):
            rival = model.fit(parts, values)
            if rival.bic < fit.bic + DEMANDED / 2 and rival.ambient[0] >= 0 and rival.parts.is_certain:
                fit = rival


def _larger(parts: Parts, *, near: bool) -> list[Parts]:
    """Return the models with one part more."""
    out = []
    if parts.ambient < 4:
        out.append(replace(parts, ambient=4 if parts.ambient else 1))
    if parts.bounce is None:
        out.append(replace(parts, bounce=STARTS["bounce"]))
    elif parts.tilt is None:
        out.append(replace(parts, tilt=(0.0, 0.0)))
    if parts.gloss is None:
        out += [replace(parts, gloss=STARTS["gloss"], width=i) for i in range(len(GLOSS_WIDTHS))]
    if near and parts.beam is None:
        out.append(replace(parts, beam=STARTS["beam"]))
    return out


def _smaller(parts: Parts) -> list[Parts]:
    """Return the models with one part less: a bounce loses its tilt first."""
    out = [replace(parts, ambient=parts.ambient // 4)] if parts.ambient else []
    for name in ("bounce" if parts.tilt is None else "tilt", "gloss", "beam"):
        out += [replace(parts, **{name: None})] if getattr(parts, name) is not None else []
    return out
