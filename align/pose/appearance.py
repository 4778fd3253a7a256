"""How an object looks under known lights, whatever it is made of and wherever it stands: told by its photographs.

A sample is E = a (k n.v + |v| g(n.h) + c.n + d): albedo a, the scan's normal n, the light's vector v at the point, h
the direction midway between light and camera. k and g, neither negative, are the material's, from matte (g = 0) to
metal (k = 0): an isotropic microfacet material is a function of n.h before all [Cook1982]. c and d are the frame's:
what its surroundings send back, by spherical harmonics of the first order [Basri2003], and what the light is other than
it was calibrated to be.
"""

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from align.pose.motion import looking_along
from scene.normals import unit
from scene.robust import spread

Array = NDArray[np.float64]

LOBE_DEG = 0.0, 4.0, 8.0, 12.0, 17.0, 23.0, 30.0, 40.0, 55.0, 90.0
"""Angles between n and h at which g is known; linear in n.h between them."""
NODES = 1 - np.cos(np.radians(LOBE_DEG))
ROUNDS = 5
"""Of Gauss and Newton."""
REWEIGHTED = 3
LEAST_LOSS, SIGMAS, FIRST_LOSS = 0.1, 3.0, 1.0
"""Of the pixel's scale: where Geman and McClure's loss [Geman1987] bends, at least, in sigmas, and at first."""
RIDGE, TINY = 1e-4, 1e-12
"""Of the mean diagonal of the equations: what the samples do not tell stays small."""
LIGHT_ALONE = 1e-3
"""The same, of the fit: what the samples do not tell of the surroundings is drawn to none. Under distant lights a
constant lobe and constant surroundings look alike, and would grow against each other."""
TURNS, LONGEST = 8, 0.1
"""Steps by which a normal is turned to where it fits best, and the longest of them, radians."""


class Lit(NamedTuple):
    """N lights at P points."""

    vectors: Array
    """(N, P, 3), their fall-off in them, of intensity 1."""
    halfway: Array
    """(N, P, 3) unit, midway between light and camera."""
    strength: Array
    """(N, P), the vectors' lengths."""

    @classmethod
    def of(cls, vectors: Array, toward_camera: Array) -> "Lit":
        """Take the light vectors (N, P, 3) at points seen from unit directions (P, 3)."""
        strength = np.linalg.norm(vectors, axis=-1)
        return cls(vectors, unit(vectors / strength[..., None] + toward_camera), strength)

    def only(self, pixels: NDArray) -> "Lit":
        """Return some of the points."""
        return Lit(self.vectors[:, pixels], self.halfway[:, pixels], self.strength[:, pixels])


@dataclass(frozen=True)
class Appearance:
    """The material's k and g, and each frame's surroundings."""

    material: Array
    """(1 + len(NODES),): k, and g at `NODES`."""
    around: Array | None
    """(N, 4): c and d of each frame; None where there is the light alone."""
    loss: float = LEAST_LOSS
    """Where the loss bends."""

    @classmethod
    def matte(cls) -> "Appearance":
        """Return Lambert's law under the light alone."""
        return cls(np.eye(1 + len(NODES))[0], None)

    @classmethod
    def of(cls, values: Array, used: NDArray[np.bool_], normals: Array, lit: Lit) -> "Appearance":
        """Fit the appearance to values (N, P) that are used, of pixels with these normals (P, 3).

        Robust Gauss-Newton with the pixels' albedos eliminated (variable projection [Golub1973]); of each step, the
        surroundings are eliminated first (Schur complement [Triggs2000]), and the material is held at what can be. What
        all samples have in common is the albedos': that factor is held.
        """
        from scipy.optimize import nnls

        count, basis = len(values), _material_basis(lit, normals)
        beside, own = _beside(normals), basis.shape[2]
        material, around, loss = cls.matte().material, np.zeros((count, 4)), FIRST_LOSS
        for _ in range(ROUNDS):
            shown = cls(material, around).predict(lit, normals)
            albedo, weight = albedo_of(values, used, shown, loss)
            left = np.where(used, values - albedo * shown, 0.0)
            square = _squares(basis, beside, weight, albedo, shown)
            pull, common = (
                np.concatenate([np.einsum("np,npi->i", pulled, basis), (pulled @ beside).ravel()])
                for pulled in (weight * albedo * left, weight * shown)
            )
            typical = np.trace(square) / len(square)
            square[own:, own:] += LIGHT_ALONE * typical * np.eye(4 * count)
            pull[own:] -= LIGHT_ALONE * typical * around.ravel()
            square += typical / max(common @ common, TINY) * np.outer(common, common)
            taken = np.linalg.solve(square[own:, own:], np.column_stack([square[own:, :own], pull[own:]]))
            root = np.linalg.cholesky(square[:own, :own] - square[:own, own:] @ taken[:, :own])
            wanted = np.linalg.solve(root, pull[:own] - square[:own, own:] @ taken[:, own])
            before, material = material, nnls(root.T, root.T @ material + wanted)[0]
            around = around + (taken[:, own] - taken[:, :own] @ (material - before)).reshape(count, 4)
            loss = float(np.clip(SIGMAS * spread(left[used]), LEAST_LOSS, loss))
        return cls(material, around, loss)

    def predict(self, lit: Lit, normals: Array) -> Array:
        """Return what pixels (P,) of albedo one show in each frame (N, P)."""
        known = np.nan_to_num(normals)
        out = self.material[0] * np.einsum("npk,pk->np", lit.vectors, known)
        if self.around is None:
            return out
        away = 1 - np.einsum("npk,pk->np", lit.halfway, known)
        out += lit.strength * np.interp(away, NODES, self.material[1:])
        return out + self.sent_back(known)

    def only(self, frames: NDArray) -> "Appearance":
        """Return the appearance in some of the frames."""
        return self if self.around is None else replace(self, around=self.around[frames])

    def sent_back(self, normals: Array) -> Array:
        """Return what the surroundings alone show in each frame (N, P), of albedo one."""
        if self.around is None:
            return np.zeros((1, len(normals)))
        return self.around[:, :3] @ np.nan_to_num(normals).T + self.around[:, 3:]

    def slopes(self, lit: Lit, normals: Array) -> Array:
        """Return d(predict)/d(normal) (N, P, 3)."""
        out = self.material[0] * lit.vectors
        if self.around is None:
            return out
        away = 1 - np.einsum("npk,pk->np", lit.halfway, np.nan_to_num(normals))
        segment = np.clip(np.searchsorted(NODES, away) - 1, 0, len(NODES) - 2)
        slope = np.where(away < NODES[-1], (np.diff(self.material[1:]) / np.diff(NODES))[segment], 0.0)
        return out - (lit.strength * slope)[..., None] * lit.halfway + self.around[:, None, :3]


def albedo_of(values: Array, used: NDArray[np.bool_], shown: Array, loss: float) -> tuple[Array, Array]:
    """Return each pixel's best albedo (P,) and the weights (N, P) of the samples that its rest does not contradict."""
    weight, albedo = used.astype(np.float64), np.zeros(values.shape[1])
    for turn in range(REWEIGHTED + 1):
        albedo = (weight * shown * values).sum(0) / np.maximum((weight * shown * shown).sum(0), 1e-12)
        if turn < REWEIGHTED:
            weight = used / (1 + ((values - albedo * shown) / loss) ** 2) ** 2
    return albedo, weight


def freed_of_appearance(changes: Array, weight: Array, albedo: Array, shown: Array, lit: Lit, normals: Array) -> Array:
    """Return changes (N, P, K) of weighted samples less what another appearance and other albedos would make of them.

    `shown` (N, P): the samples as they are predicted at albedo one. Weighted projection: albedos are eliminated pixel
    by pixel; what is left of material and surroundings is one system of equations.
    """
    count = len(changes)
    basis, beside = _material_basis(lit, normals), _beside(normals)
    square = _squares(basis, beside, weight, albedo, shown)
    pulled = (weight * albedo)[..., None] * changes
    pull = [np.tensordot(basis, pulled, ((0, 1), (0, 1))), (beside.T @ pulled).reshape(4 * count, -1)]
    step = np.linalg.solve(square, np.concatenate(pull))
    own = basis.shape[2]
    taken = albedo[:, None] * (basis @ step[:own] + beside @ step[own:].reshape(count, 4, -1))
    share = ((weight * shown)[..., None] * taken).sum(0)
    taken -= shown[..., None] * share / np.maximum((weight * shown * shown).sum(0), 1e-12)[:, None]
    return changes - taken


def _squares(basis: Array, beside: Array, weight: Array, albedo: Array, shown: Array) -> Array:
    """Return the normal equations' matrix of J numbers of the material and 4 N of the surroundings, albedos eliminated.

    Of columns albedo * (basis (N, P, J), and for each frame beside (P, 4)), weighted (N, P): what changes of the
    pixels' albedos can make of them, times `shown` (N, P), is taken out.
    """
    count, total, own = basis.shape
    square = np.zeros((own + 4 * count,) * 2)
    rest = square[own:, own:].reshape(count, 4, count, 4)
    weighted = weight * albedo**2
    for n in range(count):
        left = weighted[n, :, None] * basis[n]
        square[:own, :own] += left.T @ basis[n]
        square[:own, own + 4 * n : own + 4 * n + 4] = left.T @ beside
        rest[n, :, n] = (beside * weighted[n, :, None]).T @ beside
    square[own:, :own] = square[:own, own:].T
    lean = weight * albedo * shown / np.sqrt(np.maximum((weight * shown * shown).sum(0), 1e-12))
    both = np.concatenate(
        [np.einsum("np,npj->pj", lean, basis), (lean.T[:, :, None] * beside[:, None]).reshape(total, -1)], 1
    )
    square -= both.T @ both
    return square + (RIDGE * np.trace(square) / len(square) + TINY) * np.eye(len(square))


def _beside(normals: Array) -> Array:
    """Return (P, 4): what each number of a frame's surroundings adds to a pixel."""
    return np.column_stack([np.nan_to_num(normals), np.ones(len(normals))])


def free_normals(values: Array, used: NDArray[np.bool_], normals: Array, lit: Lit, look: Appearance) -> Array:
    """Return the normals (P, 3) near the scan's that fit the used samples best under this appearance.

    By some steps of Gauss and Newton.
    """
    best = normals
    for _ in range(TURNS):
        shown = look.predict(lit, best)
        albedo, weight = albedo_of(values, used, shown, look.loss)
        unknown = looking_along(best)[:, :2].transpose(0, 2, 1)
        slopes = albedo[:, None] * np.einsum("npk,pki->npi", look.slopes(lit, best), unknown)
        slopes = np.concatenate([slopes, shown[..., None]], -1) * np.sqrt(weight)[..., None]
        square = np.einsum("npi,npj->pij", slopes, slopes)
        square += RIDGE * np.trace(square, axis1=1, axis2=2)[:, None, None] * np.eye(3)
        pull = np.einsum("npi,np->pi", slopes, np.sqrt(weight) * (values - albedo * shown))
        step = np.linalg.solve(square, pull[..., None])[:, :2, 0]
        step *= np.minimum(1, LONGEST / np.maximum(np.linalg.norm(step, axis=1, keepdims=True), 1e-12))
        best = unit(best + np.einsum("pki,pi->pk", unknown, step))
    return best


def _material_basis(lit: Lit, normals: Array) -> Array:
    """Return (N, P, 1 + len(NODES)): what each number of `Appearance.material` adds to a sample."""
    known = np.nan_to_num(normals)
    away = np.clip(1 - np.einsum("npk,pk->np", lit.halfway, known), 0, NODES[-1])
    segment = np.clip(np.searchsorted(NODES, away) - 1, 0, len(NODES) - 2)
    share = (away - NODES[segment]) / np.diff(NODES)[segment]
    out = np.zeros((*away.shape, 1 + len(NODES)))
    out[..., 0] = np.einsum("npk,pk->np", lit.vectors, known)
    np.put_along_axis(out, segment[..., None] + 1, (lit.strength * (1 - share))[..., None], -1)
    np.put_along_axis(out, segment[..., None] + 2, (lit.strength * share)[..., None], -1)
    return out
