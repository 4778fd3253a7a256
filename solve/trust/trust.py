"""Which normals to believe where no truth is known: each answer's photographs are predicted and solved again."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from scene.camera import Camera
from scene.errors import SceneError
from scene.frames import Frames
from scene.lights import Lights
from scene.normals import angular_error_deg
from solve.method_names import FAMILIES, METHODS, UNCALIBRATED
from solve.problem import Problem
from solve.samples import GRAY
from solve.solve import solve
from solve.thinning import at_pixels, step_for, thinned
from solve.trust.answer_world import Material, World, world_of
from solve.trust.corrected import joined
from solve.trust.held_out import unexplained

SAMPLES, PIXELS, JUDGED = 150_000, (2_500, 9_000), 2_000
"""Pixels times frames of the world; its pixels, least and most; pixels that the photographs judge."""
FEWEST = 5
"""Frames."""
ROUNDS, AT_REST = 6, 0.1
"""Of world and answer in turn, at most; degrees (median) that the answer then moves."""
LARGEST = 0.3
"""Of the albedo: an unexplained difference counts no more."""
AT_ONCE = 200_000
"""Pixels that are joined at a time."""
COMMON = np.radians(10.0)
"""What is not explained turns all normals together by this times its share of the photographs."""


@dataclass(frozen=True)
class Judged:
    """What is predicted of one method: its error in degrees, and `explains`, how many times less well than the best one
    its normals foretell frames that it was not given (None: too few frames).
    """

    median_deg: float
    mean_deg: float
    p90_deg: float
    explains: float | None


@dataclass(frozen=True)
class Trust:
    """What is predicted of all methods.

    Parameters
    ----------
    best : (H, W, 3) float32
        Normals joined from all answers, each with its predicted error taken off.
    sigma_deg : (H, W) float32
        Their own predicted error: rms of the angle.
    won : (H, W) uint8
        Which of the methods lies nearest to `best`; 255 outside.
    methods : mapping of str to Judged
        `best` among them.
    recommended : str
    margin_deg : float
        By how much its predicted error (mean) is less than that of the next one; below `doubt_deg` they are level.
    doubt_deg : float
    world_rms : float
        By how much the photographs differ from the predicted ones, of their rms.
    """

    best: NDArray[np.float32]
    sigma_deg: NDArray[np.float32]
    won: NDArray[np.uint8]
    methods: Mapping[str, Judged]
    recommended: str
    margin_deg: float
    doubt_deg: float
    world_rms: float

    def predicted_deg(self, normals: NDArray) -> NDArray[np.float32]:
        """Return the predicted error (H, W) of normals (H, W, 3), rms of the angle, bias included."""
        return np.hypot(angular_error_deg(normals, self.best), self.sigma_deg).astype(np.float32)


@dataclass(frozen=True)
class _Small:
    """Every n-th pixel of a session under the lights that its methods are given, and what the object is made of."""

    problem: Problem
    step: int
    profile: str

    @classmethod
    def of(cls, problem: Problem, pixels: float, profile: str) -> "_Small":
        step = step_for(problem, pixels)
        return cls(thinned(problem, step), step, profile)

    def thinned(self, values: NDArray) -> NDArray:
        return np.array(values[:: self.step, :: self.step])

    def solve(self, name: str, problem: Problem) -> NDArray:
        """Return a method's normals of a problem; NaN where it cannot be run."""
        frames, lights, camera, mask = problem.frames, problem.lights, problem.camera, problem.mask
        try:
            return solve(name, frames, lights, camera, mask, profile=self.profile).normals
        except SceneError:
            return np.full((*mask.shape, 3), np.nan, np.float32)

    def errors(self, world: World, names: Sequence[str]) -> NDArray:
        """Return (M, P, 3), what each method finds in a world's photographs less the normals that they show."""
        inside = world.problem.mask
        seen = replace(self.problem, frames=world.photographs(self._colors(inside)), mask=inside)
        found = [self.solve(name, seen)[inside] for name in names]
        return np.stack(found).astype(np.float64) - world.normals

    def _colors(self, inside: NDArray[np.bool_]) -> NDArray:
        """Return (P, 3), each channel over gray."""
        frames, lights = self.problem.frames, self.problem.lights
        total = sum(np.maximum(frames.frame(k)[inside], 0) / lights.intensities[k] for k in range(len(frames)))
        return np.asarray(total) / np.maximum(np.asarray(total) @ GRAY, 1e-9)[:, None]


def trust(
    frames: Frames,
    lights: Lights,
    camera: Camera,
    mask: NDArray[np.bool_],
    answers: Mapping[str, NDArray],
    *,
    sigma_deg: Mapping[str, NDArray] | None = None,
    profile: str = "default",
    progress: Callable[[int, int], None] | None = None,
) -> Trust:
    """Predict each method's error from the photographs alone.

    Parameters
    ----------
    frames, lights, camera, mask : as in `solve.solve.solve`
    answers : mapping of str to (H, W, 3) float
        Each method's normals. Of another program's (a name that is not in `METHODS`) no error is predicted to be taken
        off; it is judged like the others.
    sigma_deg : mapping of str to (H, W) float, optional
        Their noise.
    profile : str
    progress : callable, optional
        Called with (steps done, steps).

    Raises
    ------
    SceneError
        No calibrated method among the answers, lights that are not known, or too few frames.

    Notes
    -----
    A parametric bootstrap with the scene itself for its model [Efron1993]. The answer that best foretells frames that
    it was not given describes a world: surface, shadows, gloss, light from part to part (`answer_world`). The
    photographs that this world predicts are solved by every method; what a method finds there less what is shown is
    the error that such a scene makes it commit. Taken off its answer, all answers should agree, whatever the method;
    joined (`corrected`), they are the next world, until it stands still: indirect inference [Gourieroux1993], and for
    light from part to part what [Nayar1991] do. A method's predicted error is its distance from that; added in
    squares is what the joined answer itself may be wrong by: the answers' disagreement, what the world leaves
    unexplained and the lights' sigmas, both carried to the normal by least squares, and a share of what light from
    other parts does.

    Do not believe it where the photographs are explained badly (`world_rms`), or where all that is wrong is wrong
    alike in every answer and fits the photographs: lights that are turned together, above all.
    """
    names = [name for name in answers if name in METHODS]
    calibrated = [name for name in names if name not in UNCALIBRATED]
    if not calibrated or lights.is_unknown:
        raise SceneError(
            "trust: errors are predicted by calibrated lights; found "
            + ("none. Give lights or balls." if calibrated else f"only {', '.join(names)}. Add iterative.")
        )
    if len(frames) < FEWEST:
        raise SceneError(
            f"trust: found {len(frames)} frames; errors are predicted from {FEWEST} on: three fit anything."
        )
    steps, done = ROUNDS + 3, 0

    def tell() -> None:
        nonlocal done
        done += 1
        if progress:
            progress(min(done, steps), steps)

    whole = Problem(frames, lights, camera, mask, slice(0, len(mask)))
    small = _Small.of(whole, float(np.clip(SAMPLES / len(frames), *PIXELS)), profile)
    material = Material.of(small.problem)
    step = step_for(small.problem, JUDGED)
    judged = replace(material, problem=thinned(material.problem, step))
    gaps = unexplained(thinned(small.problem, step), judged, names, small.solve)
    tell()
    base = min(calibrated, key=lambda name: gaps.get(name, 0.0))
    given = {name: small.thinned(answers[name]).astype(np.float64) for name in names}
    noise = {name: np.radians(small.thinned(values)) for name, values in (sigma_deg or {}).items()}
    quick = [name for name in calibrated if FAMILIES[name] == "pixelwise"] or [base]
    field, together = given[base], quick
    for turn in range(ROUNDS + 1):
        world = world_of(field, material)
        inside = world.problem.mask
        errors = small.errors(world, together)
        sigma = np.stack([noise.get(name, np.zeros(inside.shape))[inside] for name in together])
        found, spread = joined(np.stack([given[name][inside] for name in together]), errors, sigma)
        moved = float(np.nanmedian(angular_error_deg(found, field[inside])))
        tell()
        if together is names:
            break
        field = np.full(field.shape, np.nan)
        field[inside] = found
        if moved < AT_REST or turn == ROUNDS - 1:
            together = names
    maps = np.full((*inside.shape, 3 * len(names) + 1), np.nan)
    maps[inside, :-1] = errors.transpose(1, 0, 2).reshape(len(found), -1)
    maps[inside, -1] = np.sqrt(spread**2 + doubt_of(world, lights))
    return _judged(maps, small.step, mask, answers, names, noise_of=sigma_deg or {}, gaps=gaps, world=world)


def doubt_of(world: World, lights: Lights) -> NDArray:
    """Return the variance (P,), radians squared, of normals found in a world: by lights, by what is not explained, and
    by light from other parts.

    Notes
    -----
    A normal found by least squares moves by J = (1 - n n^T) (sum v v^T)^-1 v for each sample's error over the albedo.
    A light that is turned by sigma makes one of sigma |v x n|, one of another intensity of sigma_e v . n.
    """
    lit, toward, normals = world.lit.astype(float), world.toward, world.normals
    square = np.einsum("pf,pfi,pfj->pij", lit, toward, toward)
    slack = 1e-4 * np.trace(square, axis1=1, axis2=2)[:, None, None] * np.eye(3)
    turn = np.einsum("pij,pfj->pfi", np.linalg.inv(square + slack + 1e-12 * np.eye(3)), toward) * lit[..., None]
    turn -= np.einsum("pfi,pi->pf", turn, normals)[..., None] * normals[:, None]
    shade = np.einsum("pfi,pi->pf", toward, normals)
    aside = np.maximum(np.sum(toward**2, -1) - shade**2, 0)
    variance = np.radians(np.nan_to_num(lights.direction_sigma_deg)) ** 2 * aside
    variance = variance + (np.nan_to_num(lights.intensity_sigma) * shade) ** 2
    gap = np.clip((world.gray - world.predicted) / world.albedo[:, None], -LARGEST, LARGEST)
    count = lit.sum(1)
    # What the lights' errors do is part of what is not explained: the greater of the two, not both.
    variance = np.maximum(variance, gap**2 * (count / np.maximum(count - 3, 1))[:, None])
    bounced = np.linalg.norm(np.einsum("pfi,pf->pi", turn, world.thrown), axis=1)
    common = COMMON * world.unexplained
    return np.einsum("pfi,pf->p", turn**2, variance) + (world.doubt * bounced) ** 2 + common**2


def _judged(
    maps: NDArray, step: int, mask: NDArray[np.bool_], answers: Mapping[str, NDArray], names: Sequence[str], *,
    noise_of: Mapping[str, NDArray], gaps: Mapping[str, float], world: World,
) -> Trust:  # fmt: skip
    """Join all pixels' answers, some rows at a time, and judge every method."""
    best = np.full((*mask.shape, 3), np.nan, np.float32)
    doubt = np.full(mask.shape, np.nan, np.float32)
    won = np.full(mask.shape, 255, np.uint8)
    apart: dict[str, list[NDArray]] = {name: [] for name in (*answers, "best")}
    rows = max(1, AT_ONCE // mask.shape[1])
    for first in range(0, len(mask), rows):
        part = slice(first, first + rows)
        row, column = np.nonzero(mask[part])
        if not len(row):
            continue
        known = at_pixels(maps, step, row + first, column)
        given = np.stack([answers[name][part][row, column] for name in names]).astype(np.float64)
        sigma = np.stack(
            [
                np.radians(noise_of[name][part][row, column]) if name in noise_of else np.zeros(len(row))
                for name in names
            ]
        )
        errors = known[:, :-1].reshape(len(row), len(names), 3).transpose(1, 0, 2)
        found, _ = joined(given, errors, sigma)
        best[first + row, column], doubt[first + row, column] = found, np.degrees(known[:, -1])
        away = np.stack([angular_error_deg(answers[name][part][row, column], found) for name in answers])
        won[first + row, column] = np.argmin(np.nan_to_num(away, nan=np.inf), 0)
        for name, values in zip(answers, away, strict=True):
            apart[name].append(np.hypot(values, np.degrees(known[:, -1])))
        apart["best"].append(np.where(np.isfinite(found[:, 0]), np.degrees(known[:, -1]), np.nan))
    least = min(gaps.values(), default=0.0)
    methods = {}
    for name, parts in apart.items():
        values = np.concatenate(parts)
        values = values[np.isfinite(values)] if np.isfinite(values).any() else np.array([90.0])
        middle, high = np.percentile(values, [50, 90])
        explains = gaps[name] / max(least, 1e-12) if name in gaps else None
        methods[name] = Judged(float(middle), float(values.mean()), float(high), explains)
    order = sorted(answers, key=lambda name: methods[name].mean_deg)
    margin = methods[order[1]].mean_deg - methods[order[0]].mean_deg if len(order) > 1 else np.inf
    return Trust(best, doubt, won, methods, order[0], float(margin), 0.25 * methods["best"].mean_deg, world.unexplained)
