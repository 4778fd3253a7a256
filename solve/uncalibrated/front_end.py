"""What all uncalibrated methods begin and end with: pseudo-normals and pseudo-lights that leave three numbers open.

M = B S' by a robust rank-3 factorisation, B then made integrable: what remains is the generalised bas-relief family
[Belhumeur1999]. A method chooses its member, here it becomes normals and lights: convex or concave, and the scale.
Memory: 9 bytes a sample beside the samples themselves.
"""

from dataclasses import dataclass
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from scene.errors import CalibrationError
from scene.fan_out import fan_out
from solve.methods import Whole
from solve.pixelwise import iterative
from solve.plausible_axes import outward_vote
from solve.samples import Geometry, Samples

Array = NDArray[np.float64]

FEWEST_FRAMES = 4
_CHUNK = 2048
RANK_GAP = 2.0
EIGEN_GAP = 0.1
SMOOTH_PX = 2.0
"""Standard deviation of the Gaussian under the derivatives."""
CLEAR_VOTE = 0.75
STEEP = 0.4


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
    """

    robust: bool = True
    sign: str = "outline"


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
    rest = float(singular[3])
    lights = np.ascontiguousarray(vectors[:, :-4:-1])
    # The decomposition leaves three signs open.
    lights *= np.sign((gray @ lights).sum(0))
    if settings.robust:
        # The lights from every so many pixels; then each pixel by them.
        some = slice(None, None, max(1, len(gray) // 5_000))
        scale, few = samples.scale(), samples.some(some)
        for _ in range(4):
            b, used = _robust_pixels(few, lights, scale)
            # Orthonormal, so that a pixel's lights look as spread as they can.
            basis, triangle = np.linalg.qr(lights_of(few.gray, used, b))
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
    matrix, gap = integrable(np.where(known[:, None], b, b.mean(0)), mask)
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
        return iterative.fit(samples.some(slice(start, start + _CHUNK)), scale, iterative.IterativeSettings())

    b, used = zip(*fan_out(each, range(0, len(samples.gray), _CHUNK)), strict=True)
    return np.concatenate(b), np.concatenate(used)


def lights_of(gray: NDArray, used: NDArray[np.bool_], b: Array) -> Array:
    """Return the lights (F, 3) by least squares over the samples that are used."""
    weight = used.T.astype(np.float64)
    normal = (weight @ (b[:, :, None] * b[:, None, :]).reshape(-1, 9)).reshape(-1, 3, 3)
    right = np.where(used, gray, 0).T.astype(np.float64) @ b
    trace = np.trace(normal, axis1=1, axis2=2)
    ridge = (1e-9 * trace + 1e-30)[:, None, None] * np.eye(3)
    solution: Array = np.linalg.solve(normal + ridge, right[..., None])[..., 0]
    return solution


def integrable(pseudo: Array, mask: NDArray[np.bool_]) -> tuple[Array, float]:
    """Return (3, 3) T, with b = pseudo @ T integrable, and how well T is determined.

    `pseudo` (P, 3) is any linear image of albedo x normal of the mask's pixels. The third column of T is a convention:
    b G is as integrable for every bas-relief transform G. How well: the smallest eigenvalue as a share of the next;
    near 1, other surfaces explain the pictures as well.

    Notes
    -----
    d/dy (b1 / b3) = d/dx (b2 / b3), with b_i = p_i . e, is linear in the six numbers c = p3 x p2, d = p3 x p1:
    c . (e x e_x) - d . (e x e_y) = 0 [Yuille1999], whatever factor each e has. Weights 1 / |residual| make it a
    least-absolute fit: at occluding edges and shadows' borders it does not hold. Then T is the transposed
    inverse of [-c, d, g], g = c x d of their mean length.
    """
    # Whitened, so that no component counts more than another, and without the albedo, whose edges are no shape.
    moments = pseudo.T @ pseudo / len(pseudo)
    root = np.linalg.cholesky(moments + (1e-12 * np.trace(moments) + 1e-300) * np.eye(3))
    white = np.linalg.solve(root, pseudo.T).T
    length = np.linalg.norm(white, axis=1, keepdims=True)
    e, e_x, e_y = _derivatives(white / np.maximum(length, 1e-12), mask)
    rows = np.concatenate([np.cross(e, e_x), -np.cross(e, e_y)], 1)
    weights = np.ones(len(rows))
    values, vectors = np.ones(6), np.eye(6)
    for _ in range(15):
        values, vectors = np.linalg.eigh((rows * weights[:, None]).T @ rows)
        residual = np.abs(rows @ vectors[:, 0])
        weights = 1 / np.maximum(residual, 0.5 * np.median(residual) + 1e-12)
    solution = vectors[:, 0] * np.sign(vectors[np.argmax(np.abs(vectors[:, 0])), 0])
    c, d = solution[:3], solution[3:]
    across = np.cross(c, d)
    across *= np.sqrt(np.linalg.norm(c) * np.linalg.norm(d)) / max(float(np.linalg.norm(across)), 1e-300)
    inverse = np.stack([-c, d, across], 1)
    matrix = np.linalg.inv(root).T @ np.linalg.inv(inverse).T
    return matrix, float(values[0] / max(values[1], 1e-300))


def _derivatives(e: Array, mask: NDArray[np.bool_]) -> tuple[Array, Array, Array]:
    """Return e, smoothed, and its derivatives along x (right) and y (up) where all four neighbours are in the mask."""
    field = np.zeros((*mask.shape, 3), np.float32)
    field[mask] = e
    field, share = (
        cv2.GaussianBlur(one, (0, 0), SMOOTH_PX, borderType=cv2.BORDER_CONSTANT)
        for one in (field, mask.astype(np.float32))
    )
    field = field.astype(np.float64) / np.maximum(share, 1e-6)[..., None]
    middle = mask[1:-1, 1:-1] & mask[:-2, 1:-1] & mask[2:, 1:-1] & mask[1:-1, :-2] & mask[1:-1, 2:]
    e_x = (field[1:-1, 2:] - field[1:-1, :-2])[middle] / 2
    e_y = (field[:-2, 1:-1] - field[2:, 1:-1])[middle] / 2
    return field[1:-1, 1:-1][middle], e_x, e_y


def finish(
    found: Family, relief: tuple[float, float, float], mask: NDArray[np.bool_], settings: FrontEnd, *cautions: str
) -> Whole:
    """Return normals and lights for mu, nu and depth > 0 of the bas-relief transform; see `Family.relief`.

    Lights are relative to their mean length, which b takes. The cautions are added to the family's.
    """
    b, lights = found.relief(*relief)
    said = [*found.cautions, *cautions]
    if settings.sign == "outline":
        vote, steepness = outward_vote(b, mask)
        if np.isnan(vote):
            said.append("convex or concave is not known: the object's outline is not in the picture.")
        else:
            if vote < 0.5:
                b, lights = b * [-1, -1, 1], lights * [-1, -1, 1]
            if max(vote, 1 - vote) < CLEAR_VOTE:
                said.append(
                    f"convex or concave is uncertain: {max(vote, 1 - vote):.0%} of the outline votes for it, expected "
                    f"{CLEAR_VOTE:.0%} or more."
                )
            elif steepness < STEEP:
                said.append(
                    f"convex or concave is uncertain: normals at the outline face the camera (sine {steepness:.2f}, "
                    f"expected {STEEP} or more), so that it is no limb of the object."
                )
    behind = float(np.mean(lights[:, 2] <= 0))
    if behind > 0.1:
        said.append(f"{behind:.0%} of the lights would stand behind the object.")
    size = float(np.mean(np.linalg.norm(lights, axis=1)))
    return Whole(b * size, found.used, tuple(said), lights / size)
