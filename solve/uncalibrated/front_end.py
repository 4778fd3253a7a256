"""What all uncalibrated methods begin with: pseudo-normals and pseudo-lights that leave three numbers open.

M = B S' by a robust rank-3 factorisation, B then made integrable: what remains is the generalised bas-relief family
[Belhumeur1999]. Memory: 8 bytes a sample beside the samples themselves.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from scene.errors import CalibrationError
from scene.fan_out import fan_out
from solve.pixelwise import iterative
from solve.samples import Geometry, Samples
from solve.uncalibrated.integrability import integrable

Array = NDArray[np.float64]

ROUNDS = 4
FEWEST_FRAMES = 4
_CHUNK = 2048
RANK_GAP = 2.0
EIGEN_GAP = 0.1


@dataclass(frozen=True)
class Family:
    """Pseudo-normals and lights up to a generalised bas-relief transform, with a convention for its three numbers.

    Pseudo-normals times pseudo-albedo (P, 3), the mean of the third component being positive; lights (F, 3), with gray
    = b @ lights.T where lit; the samples that agree (P, F); and cautions.
    """

    b: Array
    lights: Array
    used: NDArray[np.bool_]
    cautions: tuple[str, ...]

    def rendered(self) -> NDArray[np.float32]:
        """Return the matte images (P, F), shadows at zero."""
        return np.maximum(self.b.astype(np.float32) @ self.lights.T.astype(np.float32), 0)

    def relief(self, mu: float, nu: float, depth: float) -> tuple[Array, Array]:
        """Return b G (P, 3) and the lights (F, 3) that go with it, G = [[1, 0, 0], [0, 1, 0], [mu, nu, depth]].

        depth < 0: with the sign changed too, so that the normals keep facing the camera.
        """
        matrix = np.array([[1, 0, 0], [0, 1, 0], [mu, nu, depth]], float)
        sign = 1.0 if depth > 0 else -1.0
        return sign * self.b @ matrix, sign * self.lights @ np.linalg.inv(matrix).T


class FrontEnd(NamedTuple):
    """Settings that all uncalibrated methods share.

    Parameters
    ----------
    robust : bool
        Drop shadows and highlights: each pixel's samples that disagree with the pseudo-lights. Otherwise
        the plain singular value decomposition of all samples.
    sign : str
        `outline`: of (b1, b2, b3) and (-b1, -b2, b3), which give the same pictures under mirrored lights, that
        whose normals point outward along the mask's outline. `arbitrary`: as the eigenvectors left it.
    smooth_px : float
        Standard deviation of the Gaussian under the derivatives.
    """

    robust: bool = True
    sign: str = "outline"
    smooth_px: float = 2.0


PLAIN = FrontEnd(robust=False, sign="arbitrary")
"""The plain reading: no cleaning of the samples, no rescue of the sign."""


def family(samples: Samples, mask: NDArray[np.bool_], settings: FrontEnd) -> Family:
    """Factorise the samples of the mask's pixels and make the pseudo-normals integrable.

    Raises
    ------
    CalibrationError
        Fewer than four frames.

    Notes
    -----
    M ~ U S V' from the eigenvectors of M' M (F, F) [Hayakawa1994]. A pixel's fit to known lights knows no
    difference between lights and any linear image of them: `solve.pixelwise.iterative` serves as it is, in turn with
    least squares for the lights over the samples that it keeps.
    """
    gray = samples.gray
    if gray.shape[1] < FEWEST_FRAMES:
        raise CalibrationError(
            f"uncalibrated methods: found {gray.shape[1]} frames, expected {FEWEST_FRAMES} or more, each lit from "
            "another side. Shoot more flash frames, or calibrate the lights."
        )
    cautions = []
    moments = np.zeros((gray.shape[1],) * 2)
    for start in range(0, len(gray), 4096):
        some = gray[start : start + 4096].astype(np.float64)
        moments += some.T @ some
    square, vectors = np.linalg.eigh(moments)
    singular = np.sqrt(np.maximum(square[::-1], 0))
    rest = float(singular[3]) if len(singular) > 3 else 0.0
    lights = np.ascontiguousarray(vectors[:, :-4:-1])
    # The decomposition leaves three signs open.
    lights *= np.sign((gray @ lights).sum(0))
    if settings.robust:
        # The lights from every so many pixels; then each pixel by them.
        some = slice(None, None, max(1, len(gray) // 5_000))
        scale, few = samples.scale(), samples.some(some)
        for _ in range(ROUNDS):
            b, used = _robust_pixels(few, lights, scale)
            # Orthonormal, so that a pixel's lights look as spread as they can.
            basis, triangle = np.linalg.qr(_lights(few.gray, used, b))
            lights = np.ascontiguousarray(basis * np.where(np.diag(triangle) < 0, -1.0, 1.0))
        b, used = _robust_pixels(samples, lights, scale)
        # Of what was kept: the least dimension against a fourth one of noise.
        singular = np.linalg.svd(b, compute_uv=False)
        misfit = (gray[some] - b[some] @ lights.T)[used[some]]
        rest = float(np.sqrt(len(gray) * np.mean(misfit**2))) if len(misfit) else 0.0
    else:
        b, used = gray @ lights, np.ones_like(samples.valid)
    if singular[2] < RANK_GAP * rest:
        cautions.append(
            f"the third singular value of the samples is only {singular[2] / rest:.1f} times the fourth, expected "
            f"{RANK_GAP:g}: shadows, gloss or too few lights hide the surface's three dimensions."
        )
    known = np.linalg.norm(b, axis=1) > 0
    matrix, gap = integrable(np.where(known[:, None], b, b.mean(0)), mask, settings.smooth_px)
    if gap > EIGEN_GAP:
        cautions.append(
            f"integrability hardly tells the surface from others (eigenvalues at a ratio of {gap:.2f}, expected under "
            f"{EIGEN_GAP}): too flat, too small or too noisy."
        )
    b, lights = b @ matrix, np.asarray(lights @ np.linalg.inv(matrix).T, np.float64)
    facing = float(np.mean(b[known, 2] > 0))
    if facing < 0.5:
        b, lights, facing = -b, -lights, 1 - facing
    if facing < 0.97:
        cautions.append(
            f"{1 - facing:.0%} of the pseudo-normals face away from the camera: this is no visible surface."
        )
    return Family(b, lights, used, tuple(cautions))


def _robust_pixels(samples: Samples, lights: Array, scale: float) -> tuple[Array, NDArray[np.bool_]]:
    """Return b (P, 3) and the samples that agree (P, F), the pseudo-lights being given."""
    samples = samples._replace(points=np.zeros((len(samples.gray), 3)), lights=Geometry.distant(lights))

    def each(start: int) -> tuple[Array, NDArray[np.bool_]]:
        return iterative.fit(samples.some(slice(start, start + _CHUNK)), scale, iterative.Settings())

    b, used = zip(*fan_out(each, range(0, len(samples.gray), _CHUNK)), strict=True)
    return np.concatenate(b), np.concatenate(used)


def _lights(gray: NDArray, used: NDArray[np.bool_], b: Array) -> Array:
    """Return the lights (F, 3) by least squares over the samples that are used."""
    weight = used.T.astype(np.float64)
    normal = (weight @ (b[:, :, None] * b[:, None, :]).reshape(-1, 9)).reshape(-1, 3, 3)
    right = np.where(used, gray, 0).T.astype(np.float64) @ b
    trace = np.trace(normal, axis1=1, axis2=2)
    ridge = (1e-9 * trace + 1e-30)[:, None, None] * np.eye(3)
    solution: Array = np.linalg.solve(normal + ridge, right[..., None])[..., 0]
    return solution
