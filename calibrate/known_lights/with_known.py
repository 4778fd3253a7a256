"""Lights that are known beforehand: used as they are, completed and checked by whatever balls there are.

Balls say where they see the lights. Without balls Lambert's law knows whether the lights are in the photographs' order,
whatever the surface: every matte pixel says v_f = b . l_f with a vector b of its own, and three unknowns fit many
frames only if each frame has its own light. Lights in other axes fit as well (b follows them): these are judged by
balls, or by `solve.axes`.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from calibrate.calibration import Calibration, Notes, flag_warnings
from calibrate.detection.balls import Ball, find_balls
from calibrate.detection.coarse import Progress
from calibrate.detection.detect import Rejected
from calibrate.known_lights.measured_lights import are_sure
from calibrate.known_lights.read_known import AS_THEY_ARE, NO_INTENSITIES, lacks_intensities, without_flag
from calibrate.known_lights.rig import against_balls
from calibrate.lights.agreement import agreed_spots
from calibrate.lights.directions import mirrored_rays, no_shading
from calibrate.photometry.from_white import intensities_from_white
from calibrate.photometry.matte_shading import brightness_beside, read_surface, shading_directions
from calibrate.photometry.table_normal import table_normal
from calibrate.without_balls.from_object import strengths_from_object
from calibrate.without_balls.probe import CANDIDATES, read_probe, varied
from scene.camera import Camera
from scene.errors import CalibrationError
from scene.frames import Frames
from scene.lights import Lights
from scene.normals import angular_error_deg, unit
from scene.spheres import Sphere, SphereRequest

Array = NDArray[np.float64]
Order = NDArray[np.intp]
EQUALLY_BRIGHT = "no white ball: all flashes are taken as equally bright. 5 % of variation bends normals by 2 degrees."
SUSPICIOUS_DEG = 20.0
"""Median angle between known and seen directions that nothing honest explains: flashes a metre away, taken as distant,
are 10 to 15 degrees elsewhere for a ball that is 200 mm beside the object."""
BETTER_DEG, BETTER_SHARE = 18.0, 0.5  # median angle, and share of it, that another order or other axes may leave
TURNS = {
    "with y flipped: is the file y-down?": ("x-yz", (0, 1, 2)),
    "with y and z flipped: is the file in OpenCV's frame?": ("x-y-z", (0, 1, 2)),
    "with z flipped: is the file z-away?": ("xy-z", (0, 1, 2)),
    "with x flipped: are the photographs mirrored?": ("-xyz", (0, 1, 2)),
    "with x and y flipped: are the photographs upside down, or the vectors away from the lights?": ("-x-yz", (0, 1, 2)),
    "with every sign flipped: do the vectors point away from the lights?": ("-x-y-z", (0, 1, 2)),
    "with x and y exchanged": ("xyz", (1, 0, 2)),
    "with y and z exchanged: is the file y-up?": ("xyz", (0, 2, 1)),
    "turned by 90 degrees to the left: were the photographs turned?": ("-xyz", (1, 0, 2)),
    "turned by 90 degrees to the right: were the photographs turned?": ("x-yz", (1, 0, 2)),
}
"""In words, the signs and the places of a file's axes."""
FEWEST_PIXELS, FEWEST_FRAMES = 200, 6  # to be asked; three unknowns a pixel fit any order of fewer frames
PAIRS_UP_TO = 40  # frames of which any two are tried exchanged
SUSPICIOUS, BETTER = 0.06, 0.7  # relative misfit from which another order is sought, and its share that one may leave
MUCH_BETTER = 0.25  # the same of other strengths: gamma and ambient light are explained by them in part
CHANCE, SHUFFLES = 0.55, 20
"""Share of the median misfit of so many orders at random from which the file says nothing of these photographs."""
STRENGTH_ROUNDS, STRENGTHS = 4, (0.1, 10)  # turns in which unknown strengths are read, and their bounds, mean 1
USED = "it is used as it stands."


def with_known_lights(
    frames: Frames,
    camera: Camera,
    requests: Sequence[SphereRequest],
    lights: Lights,
    *,
    own: Callable[[Sequence[Ball]], Calibration] | None = None,
    progress: Progress | None = None,
) -> Calibration:
    """Use given lights; find the balls that were asked for, and say how far they agree.

    `own`: what balls say of the lights by themselves; lights whose sigmas are known are held against it.
    """
    if len(lights) != len(frames):
        raise CalibrationError(f"lights: {len(lights)} known lights for {len(frames)} flash frames.")
    # Of fewer no normals are asked for: a scan finds its place by the outline.
    if len(lights) > 2:
        lights.check()
    notes = Notes()
    if lights.positions_mm is not None and camera.is_orthographic and camera.source == "assumed":
        lights = replace(lights, positions_mm=None)
        notes.warnings.append(
            "the known lights have positions in mm, but nothing is known of the camera: taken as distant, with the "
            "directions at their reference point. Add [camera]."
        )
    notes.evidence.append(f"{len(lights)} known lights ({lights.model}), {AS_THEY_ARE}")
    balls: list[Ball] = []
    rejected: tuple[Rejected, ...] = ()
    if requests:
        try:
            balls, rejected, cautions = find_balls(frames, camera, requests, progress=progress)
        except CalibrationError as error:
            cautions = (str(error),)
        notes.warnings.extend(cautions)
    doubts: list[str | None] = []
    table = table_normal(camera, [ball.sphere for ball in balls])
    shown = np.full((len(balls), len(frames), 2), np.nan)
    chrome = [i for i, ball in enumerate(balls) if ball.sphere.kind == "chrome"]
    spots = agreed_spots(camera, [balls[i] for i in chrome], no_shading(len(frames)))
    for i, one in zip(chrome, spots, strict=True):
        shown[i] = one.pixels
    for i, ball in enumerate(balls):
        if ball.sphere.kind == "chrome":
            points, seen = mirrored_rays(camera, ball.sphere, shown[i])
            target = _toward(lights, ball.sphere, points)
            off_deg = angular_error_deg(seen, target)
            if np.isfinite(off_deg).any():
                told = f"{np.nanmedian(off_deg):.2f} degrees off (median)"
                notes.evidence.append(f"chrome ball {i + 1} sees the known lights {told}")
            else:
                notes.warnings.append(f"chrome ball {i + 1} mirrors no flash: it checks nothing of lights.file.")
        else:
            beside = brightness_beside(ball.frames, ball.sphere)
            seen, _ = shading_directions(read_surface(ball.frames, camera, ball.sphere, table), beside)
            target = _toward(lights, ball.sphere, ball.sphere.center_mm(camera))
        doubts.append(contradiction(f"{ball.sphere.kind} ball {i + 1}", frames.names, seen, target))
    if not balls:
        doubts.append(wrong_order(frames, camera, lights, np.ones((frames.height, frames.width), bool)))
    contradictions = [doubt for doubt in doubts if doubt]
    notes.warnings.extend(contradictions)
    if own and balls and not contradictions and are_sure(lights.direction_sigma_deg).all():
        try:
            notes.warnings.extend(against_balls(lights, own(balls), camera))
        except CalibrationError as error:
            notes.warnings.append(f"the balls cannot check lights.file: {error}")
    if lacks_intensities(lights):
        try:
            lights = _with_intensities(frames, camera, balls, lights, notes)
        except CalibrationError as error:
            # Under wrong directions a lit ball looks as if its flash had not fired.
            if not contradictions:
                raise
            raise CalibrationError("\n".join(contradictions)) from error
    notes.warnings.extend(flag_warnings(lights.names, lights.flags))
    return Calibration([b.sphere for b in balls], lights, shown, rejected, tuple(notes.evidence), tuple(notes.warnings))


def _toward(lights: Lights, sphere: Sphere, points: Array) -> Array:
    """Return unit vectors (F, 3) from points (F, 3) or (3,) on a ball to the lights."""
    if lights.positions_mm is None or not sphere.diameter_mm:
        return lights.directions
    return unit(lights.positions_mm - points)


def _with_intensities(frames: Frames, camera: Camera, balls: list[Ball], lights: Lights, notes: Notes) -> Lights:
    """Read on the white balls, else on the object, the intensities that the lights' file does not have."""
    white, table = [b for b in balls if b.sphere.kind == "white"], table_normal(camera, [b.sphere for b in balls])
    surfaces = [read_surface(ball.frames, camera, ball.sphere, table) for ball in white]
    if surfaces:
        lights = intensities_from_white(frames, surfaces, lights, notes)
        notes.evidence.append("intensities from the white ball, read with the known directions: the file has none")
    else:
        lacking = next(flag for flags in lights.flags for flag in flags if flag.endswith(NO_INTENSITIES))
        own = Notes(notes.evidence)
        read = strengths_from_object(frames, camera, [ball.sphere for ball in balls], lights, own)
        if read is None:
            notes.warnings.append(
                f"{lacking}, and there is {EQUALLY_BRIGHT} State a white ball ([[spheres]]), or give a lights.json."
            )
            return lights
        lights = replace(lights, intensities=read[0], intensity_sigma=read[1])
        notes.warnings.extend(f"{lacking}, and there is {text}" for text in own.warnings)
    return replace(lights, flags=without_flag(lights)).normalised()


def _orders(count: int) -> list[tuple[str, Order]]:
    """Return orders in which a file of lights may be, in words, but for exchanged pairs."""
    here = np.arange(count)
    rolled = [(f"{k} frame{'s' * (k > 1)} later", np.roll(here, k)) for k in range(1, count)]
    return [*rolled, ("in reverse order", here[::-1])]


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
    trials = []
    for words, (axes, places) in TURNS.items():
        signs = np.array([-1 if f"-{axis}" in axes else 1 for axis in "xyz"])
        trials.append((words, known[:, places] * signs))
    trials += [
        (f"{words}: are they of these photographs, and sorted alike?", known[o]) for words, o in _orders(len(known))
    ]
    left = [float(np.nanmedian(angular_error_deg(seen[use], trial[use]))) for _, trial in trials]
    best = int(np.argmin(left))
    start = f"lights.file: {witness} sees its lights {off:.0f} degrees off (median)"
    if left[best] < min(BETTER_SHARE * off, BETTER_DEG):
        return f"{start}, but only {left[best]:.1f} degrees {trials[best][0]} Correct lights.file; {USED}"
    return (
        f"{start}, and no flip or roll explains it: the lights do not belong to these photographs, or their order is "
        f"lost. Correct lights.file; {USED}"
    )


def _odd_frames(witness: str, names: tuple[str, ...], seen: Array, known: Array, odd: Order) -> str | None:
    """Name the few frames whose lights are another's."""
    if not len(odd):
        return None
    listed = ", ".join(names[f] for f in odd)
    start = f"lights.file: {witness} sees the light of {listed} elsewhere (more than {SUSPICIOUS_DEG:.0f} degrees off)"
    if len(odd) == 2 and angular_error_deg(seen[odd], known[odd[::-1]]).max() < SUSPICIOUS_DEG:
        return (
            f"{start}, and each where the other's should be: exchanged. Correct lights.file, or the photographs' names."
        )
    return f"{start}. Is another thing's reflection taken for the flash there, or is the file's order wrong?"


def wrong_order(frames: Frames, camera: Camera, lights: Lights, region: NDArray[np.bool_]) -> str | None:
    """Say which other order of the lights explains the photographs, or that none does; None where theirs will do.

    `region` (H, W): the pixels to be asked, the object, or all that is no mirror.
    """
    count = len(lights)
    probe = read_probe(frames, region, most=CANDIDATES)
    if count < FEWEST_FRAMES or not len(probe.pixels):
        return None
    depth = float(lights.reference_point_mm[2])

    def toward_of(pixels: NDArray) -> Array:
        return lights.toward(camera.points_at_depth(pixels, depth) if depth < 0 else np.zeros((len(pixels), 3)))

    # A table is one normal, and fits any order: pixels that face many ways decide.
    probe = varied(probe, toward_of(probe.pixels))
    if len(probe.pixels) < FEWEST_PIXELS:
        return None
    lit = probe.lit.T
    values = probe.values.mean(-1, dtype=np.float64).T * lit
    toward = np.moveaxis(toward_of(probe.pixels) * lights.intensities.mean(1)[:, None, None], 0, 1)
    # The strengths that the file does not have are read from the photographs, in each order anew.
    usual = STRENGTH_ROUNDS if lacks_intensities(lights) else 1

    def misfit(order: Order, rounds: int = usual) -> float:
        light, strength, rest = toward[:, order] * lit[..., None], np.ones(count), values
        matrix = np.linalg.inv(np.swapaxes(light, 1, 2) @ light + 1e-9 * np.eye(3))
        for turn in range(rounds):
            shade = (light @ (matrix @ (np.swapaxes(light, 1, 2) @ (values / strength)[..., None])))[..., 0]
            if turn < rounds - 1:
                strength = np.sum(shade * values, 0) / np.maximum(np.sum(shade**2, 0), 1e-12)
                strength = np.clip(strength / strength.mean(), *STRENGTHS)
            rest = values - shade * strength
        return float(np.median(np.sqrt(np.sum(rest**2, 1) / np.sum(values**2, 1))))

    here = np.arange(count)
    given = misfit(here)
    if given < SUSPICIOUS:
        return None
    trials = _orders(count)
    for i, j in combinations(range(count), 2) if count <= PAIRS_UP_TO else ():
        order = here.copy()
        order[[i, j]] = j, i
        trials.append((f"with {frames.names[i]} and {frames.names[j]} exchanged", order))
    words, best = min(((words, misfit(order)) for words, order in trials), key=lambda trial: trial[1])
    free = misfit(here, STRENGTH_ROUNDS)
    rng = np.random.default_rng(0)
    chance = float(np.median([misfit(rng.permutation(count)) for _ in range(SHUFFLES)]))
    if best < BETTER * given:
        told = f"but only by {best:.0%} {words}: the lights are in another order than the photographs"
    elif usual == 1 and free < MUCH_BETTER * given:
        told = (
            f"but only by {free:.0%} if the flashes' strengths are others than the file's, or the photographs' "
            "exposures differ, which EXIF should tell"
        )
    elif given > CHANCE * chance:
        told = (
            f"and by {chance:.0%} under the same in any order: the lights do not belong to these photographs, or "
            "their order is lost; or the photographs were turned, or are coded otherwise than frames says"
        )
    else:
        return None
    return (
        f"lights.file: the photographs miss Lambert's law by {given:.0%} under these lights, {told}. Correct "
        f"lights.file; {USED}"
    )
