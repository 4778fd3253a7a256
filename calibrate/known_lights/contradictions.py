"""Known lights that the photographs contradict: which mistake with axes or order would explain it.

Balls say where they see the lights. Without balls Lambert's law knows whether the lights are in the photographs' order,
whatever the surface: every matte pixel says v_f = b . l_f with a vector b of its own, and three unknowns fit many
frames only if each frame has its own light. Lights in other axes fit as well (b follows them): these are judged by
balls, or by `solve.axes`.
"""

from collections.abc import Iterator
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from calibrate.known_lights.read_known import lacks_intensities
from calibrate.without_balls.from_object import varied
from calibrate.without_balls.probe import Probe, read_probe
from scene.camera import Camera
from scene.frames import Frames
from scene.lights import Lights
from scene.normals import angular_error_deg

Array = NDArray[np.float64]
SUSPICIOUS_DEG = 20.0
"""Median angle between known and seen directions that nothing honest explains: flashes a metre away, taken as distant,
are 10 to 15 degrees elsewhere for a ball that is 200 mm beside the object."""
BETTER_DEG, BETTER_SHARE = 18.0, 0.5  # median angle, and share of it, that another order or other axes may leave
TURNS = {
    "with y flipped: is the file y-down?": np.diag([1.0, -1.0, 1.0]),
    "with y and z flipped: is the file in OpenCV's frame?": np.diag([1.0, -1.0, -1.0]),
    "with z flipped: is the file z-away?": np.diag([1.0, 1.0, -1.0]),
    "with x flipped: are the photographs mirrored?": np.diag([-1.0, 1.0, 1.0]),
    "with x and y flipped: are the photographs upside down, or the vectors away from the lights?": np.diag(
        [-1.0, -1.0, 1.0]
    ),
    "with every sign flipped: do the vectors point away from the lights?": -np.eye(3),
    "with x and y exchanged": np.eye(3)[[1, 0, 2]],
    "with y and z exchanged: is the file y-up?": np.eye(3)[[0, 2, 1]],
    "turned by 90 degrees to the left: were the photographs turned?": np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]]),
    "turned by 90 degrees to the right: were the photographs turned?": np.array([[0.0, 1, 0], [-1, 0, 0], [0, 0, 1]]),
}
PIXELS, FEWEST_PIXELS = 12000, 200
FEWEST_FRAMES = 6  # below, three unknowns a pixel fit any order
PAIRS_UP_TO = 40  # frames of which any two are tried exchanged
LIT = 0.15  # share of a pixel's brightest samples under which it is taken to be in shadow
SUSPICIOUS = 0.06  # relative misfit under which nothing is looked for
BETTER = 0.7  # share of the misfit that another order must leave at most
UNEQUAL, MUCH_BETTER = 0.1, 0.25
"""Misfit above which other strengths are tried, and its share that they must leave at most: gamma and ambient light are
explained by them in part."""
CHANCE, SHUFFLES = 0.55, 20
"""Share of the median misfit of so many orders at random from which the file says nothing of these photographs."""
STRENGTH_ROUNDS, STRENGTHS = 4, (0.1, 10)  # turns in which unknown strengths are read, and their bounds, mean 1


def _orders(count: int) -> Iterator[tuple[str, NDArray[np.intp]]]:
    """Yield orders in which a file of lights may be, in words, but for exchanged pairs."""
    here = np.arange(count)
    yield from ((f"{k} frame{'s' * (k > 1)} later", np.roll(here, k)) for k in range(1, count))
    yield "in reverse order", here[::-1]


def contradiction(witness: str, names: tuple[str, ...], seen: Array, known: Array) -> str | None:
    """Say what is wrong with known light directions (F, 3), if a witness ("chrome ball 1") sees them elsewhere.

    Rows of `seen` are NaN where the witness saw nothing. None where they agree to 20 degrees (median), and no frame is
    farther off than that from the median.
    """
    use = np.isfinite(seen).all(1) & np.isfinite(known).all(1)
    if use.sum() < 3:
        return None
    each = angular_error_deg(seen, known)
    off = float(np.median(each[use]))
    if off < SUSPICIOUS_DEG:
        return _odd_frames(witness, names, seen, known, np.flatnonzero(use & (each > off + SUSPICIOUS_DEG)))
    start = f"lights.file: {witness} sees its lights {off:.0f} degrees off (median)"
    asked = {"in reverse order": ": is the file sorted otherwise?"}
    trials = [(words, known @ turn.T) for words, turn in TURNS.items()]
    for words, order in _orders(len(known)):
        trials.append((words + asked.get(words, ": are they of these photographs?"), known[order]))
    words, better = min(
        ((words, float(np.nanmedian(angular_error_deg(seen[use], trial[use])))) for words, trial in trials),
        key=lambda item: item[1],
    )
    if better < min(BETTER_SHARE * off, BETTER_DEG):
        return f"{start}, but only {better:.1f} degrees {words} Correct lights.file; it is used as it stands."
    return (
        f"{start}, and no flip or roll explains it: the lights do not belong to these photographs, or their order is "
        "lost. Correct lights.file; it is used as it stands."
    )


def _odd_frames(witness: str, names: tuple[str, ...], seen: Array, known: Array, odd: NDArray[np.intp]) -> str | None:
    """Name the few frames whose lights are another's."""
    if not len(odd):
        return None
    listed = ", ".join(names[f] for f in odd)
    exchanged = known.copy()
    exchanged[odd] = known[odd[::-1]]
    start = f"lights.file: {witness} sees the light of {listed} elsewhere (more than {SUSPICIOUS_DEG:.0f} degrees off)"
    if len(odd) == 2 and angular_error_deg(seen[odd], exchanged[odd]).max() < SUSPICIOUS_DEG:
        return (
            f"{start}, and each where the other's should be: exchanged. Correct lights.file, or the photographs' names."
        )
    return f"{start}. Is another thing's reflection taken for the flash there, or is the file's order wrong?"


def wrong_order(frames: Frames, camera: Camera, lights: Lights, region: NDArray[np.bool_]) -> str | None:
    """Say which other order of the lights explains the photographs, or that none does; None where theirs will do.

    `region` (H, W): the pixels to be asked, the object, or all that is no mirror.
    """
    count = len(lights)
    probe = read_probe(frames, region, most=PIXELS)
    if count < FEWEST_FRAMES or not len(probe.pixels):
        return None
    depth = float(lights.reference_point_mm[2])

    def toward_of(pixels: NDArray) -> Array:
        return lights.toward(camera.points_at_depth(pixels, depth) if depth < 0 else np.zeros((len(pixels), 3)))

    # A table is one normal, and fits any order: pixels that face many ways decide.
    probe = probe.take(varied(probe, toward_of(probe.pixels)))
    if len(probe.pixels) < FEWEST_PIXELS:
        return None
    values, weight = _samples(probe)
    toward = np.moveaxis(toward_of(probe.pixels) * lights.intensities.mean(1)[:, None, None], 0, 1)

    # The strengths that the file does not have are read from the photographs, in each order anew.
    known = not lacks_intensities(lights)

    def misfit(order: NDArray[np.intp], rounds: int = 1 if known else STRENGTH_ROUNDS) -> float:
        light, strength = toward[:, order] * weight[..., None], np.ones(count)
        matrix = np.linalg.inv(np.swapaxes(light, 1, 2) @ light + 1e-9 * np.eye(3))
        rest = values
        for turn in range(rounds):
            right = np.swapaxes(light, 1, 2) @ (values / strength)[..., None]
            shade = (light @ (matrix @ right))[..., 0]
            if turn < rounds - 1:
                strength = np.sum(shade * values, 0) / np.maximum(np.sum(shade**2, 0), 1e-12)
                strength = np.clip(strength / strength.mean(), *STRENGTHS)
            rest = values - shade * strength
        return float(np.median(np.sqrt(np.sum(rest**2, 1) / np.sum(values**2, 1))))

    here = np.arange(count)
    given = misfit(here)
    if given < SUSPICIOUS:
        return None
    trials = list(_orders(count))
    if count <= PAIRS_UP_TO:
        for i, j in combinations(range(count), 2):
            order = here.copy()
            order[[i, j]] = j, i
            trials.append((f"with {frames.names[i]} and {frames.names[j]} exchanged", order))
    words, best = min(((words, misfit(order)) for words, order in trials), key=lambda trial: trial[1])
    if best < BETTER * given:
        return (
            f"lights.file: the photographs miss Lambert's law by {given:.0%} under these lights, but only by "
            f"{best:.0%} {words}: the lights are in another order than the photographs. Correct lights.file; it is "
            "used as it stands."
        )
    if known and given > UNEQUAL and (free := misfit(here, STRENGTH_ROUNDS)) < MUCH_BETTER * given:
        return (
            f"lights.file: the photographs miss Lambert's law by {given:.0%} under these lights, but only by "
            f"{free:.0%} if the flashes' strengths are others than the file's: correct its intensities, or leave them "
            "out; or the photographs' exposures differ, which EXIF should tell. They are used as they stand."
        )
    rng = np.random.default_rng(0)
    chance = float(np.median([misfit(rng.permutation(count)) for _ in range(SHUFFLES)]))
    if given > CHANCE * chance:
        return (
            f"lights.file: the photographs miss Lambert's law by {given:.0%} under these lights, and by "
            f"{chance:.0%} under the same in any order: the lights do not belong to these photographs, or their order "
            "is lost; or the photographs were turned, or are coded otherwise than frames says. Correct lights.file or "
            "the photographs; they are used as they stand."
        )
    return None


def _samples(probe: Probe) -> tuple[Array, Array]:
    """Return the lit, unclipped values (P, F), zero elsewhere, and which they are, 1 or 0."""
    values = probe.values.mean(-1, dtype=np.float64).T
    bright = np.quantile(values, 0.9, axis=1, keepdims=True)
    weight = (~probe.clipped.T & (values > LIT * bright)).astype(np.float64)
    return values * weight, weight
