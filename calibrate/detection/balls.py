"""The balls that a session asks for: given, or found, and each with its diameter."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from calibrate.detection.coarse import Coarse, Progress, shrink
from calibrate.detection.detect import Rejected, around_hint, detect
from calibrate.detection.diameters import Diameter, doubted_diameters, told_diameters
from calibrate.silhouette.ball_silhouette import OutlineFit, best_outline, fit_mask, fit_outline, with_blur
from calibrate.silhouette.mirrored_table import Beside
from calibrate.silhouette.outline import difference, share_in_picture
from scene.camera import Camera
from scene.errors import CalibrationError
from scene.frames import Frames
from scene.spheres import KINDS, Kind, Sphere, SphereRequest

Array = NDArray[np.float64]
HINT_REACH, HINT_REACH_PX = 0.2, 3.0
"""Share of its radius by which a circle given by hand may be wrong, and at least: the outline is sought so far."""
HINT_SEARCH = 0.04  # radii around the given circle itself in which its outline is sought, `HINT_REACH_PX` at least
HINT_SCORE = 0.6  # share of its outline that a ball must show before it is moved off the circle given by hand,
HINT_SURE = 0.9  # from which a matte ball's is taken, and of another's score that may still be as good
GIVEN_SIGMA = 0.05
"""Share of its radius to which a circle given by hand is believed where no outline is found; a pixel at least."""
FORGOTTEN = 0.95  # probability from which a ball that nobody asked for is named
WHOLE = 0.97  # share of its outline in the picture under which a ball is cut by the border
LEAST_MASK_PX, MASK_ROUND = 200, 0.05  # pixels of a mask, and how far, in radii, its border may scatter about a ball's


class NoProbeError(CalibrationError):
    """The photographs show no ball, or none that tells the lights."""


@dataclass(frozen=True)
class Ball:
    """A ball with its outline's covariance and the photographs that show it."""

    sphere: Sphere
    covariance: Array
    frames: Frames
    coarse: Coarse


def find_balls(
    frames: Frames, camera: Camera, requests: Sequence[SphereRequest], *, progress: Progress | None = None
) -> tuple[list[Ball], tuple[Rejected, ...], tuple[str, ...]]:
    """Return the balls, the circles that are none, and warnings.

    Balls that were shot in their own photographs are looked for there; without requests, whatever balls the session's
    frames show are taken.

    Raises
    ------
    NoProbeError
        No ball was found.
    CalibrationError
        A request cannot be met by its own photographs.
    """
    # Grouped by identity: frames hold arrays, which have no hash.
    groups: dict[int, tuple[Frames, list[SphereRequest]]] = {}
    for request in requests:
        own = frames if request.frames is None else request.frames
        _check_own_frames(frames, own, camera)
        groups.setdefault(id(own), (own, []))[1].append(request)
    balls: list[Ball] = []
    rejected: tuple[Rejected, ...] = ()
    warnings: list[str] = []
    stacks = list(groups.values()) or [(frames, [])]
    for number, (own, group) in enumerate(stacks):

        def step(done: int, total: int, number: int = number) -> None:
            if progress:
                progress(number * total + done, len(stacks) * total)

        coarse = shrink(own, camera, progress=step)
        given = [r for r in group if r.mask is not None or r.center_px is not None]
        open_ = [r for r in group if r.mask is None and r.center_px is None]
        starts = [_circle(r) if r.mask is None else _fit_given_mask(own, camera, r.kind, r.mask) for r in given]
        there = [one.sphere if isinstance(one, OutlineFit) else one for one in starts]
        fits = [s if isinstance(s, OutlineFit) else _given(own, camera, coarse, s, there, warnings) for s in starts]
        diameters = [Diameter(request.diameter_mm, 0.0) for request in given]
        if open_ or not group:
            wanted: dict[Kind, int] | None = Counter(r.kind for r in open_) if group else None
            found, refused = detect(own, camera, coarse, wanted=wanted, taken=tuple(fit.sphere for fit in fits))
            rejected += refused
            placed = [replace(fit.sphere, diameter_mm=d.mm) for fit, d in zip(fits, diameters, strict=True)]
            for one, diameter in _match(found, open_, placed, refused, warnings):
                fits.append(one)
                diameters.append(diameter)
        listed = [replace(fit.sphere, diameter_mm=d.mm) for fit, d in zip(fits, diameters, strict=True) if d.mm]
        warnings += doubted_diameters(listed)
        blurs = [fit.blur_px for fit in fits if fit.sphere.kind == "white" and np.isfinite(fit.blur_px)]
        for fit, diameter in zip(fits, diameters, strict=True):
            fit = with_blur(own, camera, fit, float(np.median(blurs))) if blurs else fit
            known = {"diameter_mm": diameter.mm, "diameter_sigma": diameter.sigma}
            sphere = replace(fit.sphere, **known, apart=own is not frames)
            warnings += _cautions(camera, sphere, is_open=fit.is_open)
            balls.append(Ball(sphere, fit.covariance, own, coarse))
    if not balls:
        raise NoProbeError(_nothing(requests, rejected))
    return balls, rejected, tuple(warnings)


def _cautions(camera: Camera, sphere: Sphere, *, is_open: bool) -> list[str]:
    """Name a mirror whose outline nothing confirms, and a ball that the picture's border cuts."""
    seen, told = share_in_picture(camera, sphere), []
    (u, v), kind = sphere.center_px, sphere.kind
    if is_open:
        # It is in no sigma: that is no scatter.
        told.append(
            f"chrome ball at ({u:.0f}, {v:.0f}) px: taken with a radius of {sphere.radius_px:.0f} px, but it does not "
            "mirror the table beside it, and may be what a larger ball mirrors. Look at the picture; center_px and "
            "radius_px in session.toml decide."
        )
    if seen < WHOLE:
        told.append(
            f"the {kind} ball at ({u:.0f}, {v:.0f}) px is cut by the picture's border: {seen:.0%} of its outline is "
            f"seen, and places it to {sphere.sigma_px:.2f} px. Move it into the picture."
        )
    return told


def _check_own_frames(frames: Frames, own: Frames, camera: Camera) -> None:
    if own is frames:
        return
    if len(own) != len(frames):
        raise CalibrationError(
            f"spheres.frames: {len(own)} photographs of the ball, but {len(frames)} flash frames. A ball that is shot "
            "apart needs the same lights in the same order."
        )
    if (own.width, own.height) != (camera.width, camera.height):
        raise CalibrationError(
            f"spheres.frames: {own.width} x {own.height} px, but the camera has {camera.width} x {camera.height}."
        )


def _circle(request: SphereRequest) -> Sphere:
    """Return the circle that the user gave for a ball."""
    if request.center_px is None or request.radius_px is None:
        raise CalibrationError("spheres: center_px needs radius_px too; give both, or neither to have the ball found.")
    return Sphere(request.kind, np.array(request.center_px, np.float64), float(request.radius_px))


def _given(
    frames: Frames, camera: Camera, coarse: Coarse, circle: Sphere, given: list[Sphere], warnings: list[str]
) -> OutlineFit:
    """Fit a ball whose circle is one of those that the user gave."""
    beside = Beside(others=[other for other in given if other is not circle])
    fit = _fit_hint(frames, camera, coarse, circle, beside)
    if fit is not None:
        return fit
    u, v = circle.center_px
    sigma = max(1.0, GIVEN_SIGMA * circle.radius_px)
    warnings.append(
        f"{circle.kind} ball at ({u:.0f}, {v:.0f}) px: no outline was found within {HINT_REACH:.0%} of the given "
        f"circle's radius, {circle.radius_px:.0f} px; it is taken as it is, with {sigma:.1f} px of doubt."
    )
    return OutlineFit(replace(circle, sigma_px=sigma, score=0.0), np.eye(3) * sigma**2, sigma)


def _fit_given_mask(frames: Frames, camera: Camera, kind: Kind, mask: NDArray[np.bool_]) -> OutlineFit:
    if mask.shape != (frames.height, frames.width):
        raise CalibrationError(
            f"spheres.mask: {mask.shape[1]} x {mask.shape[0]} px, but the frames are {frames.width} x {frames.height}."
        )
    rows, columns = np.nonzero(mask)
    if len(rows) < LEAST_MASK_PX:
        raise CalibrationError(
            f"spheres.mask: only {len(rows)} px are set; a ball needs {LEAST_MASK_PX} at least. White is the ball."
        )
    start = Sphere(kind, np.array([columns.mean(), rows.mean()]), float(np.sqrt(len(rows) / np.pi)))
    fit = fit_mask(mask, camera, start)
    if fit is None or fit.residual_px > MASK_ROUND * start.radius_px:
        raise CalibrationError("spheres.mask: its border is not the outline of a ball.")
    return fit


def _fit_hint(frames: Frames, camera: Camera, coarse: Coarse, hint: Sphere, beside: Beside) -> OutlineFit | None:
    """Return the best outline around a circle given by hand, or None: a hand slips by a tenth of the radius.

    The static circles around it come first: beside an outline there is always some weaker edge, and a search of a
    few pixels around the given circle would take it. A matte ball's own outline wins only where it shows clearly more.
    A mirror's may be clearer than what it mirrors and still be missed among the static circles, where noise hides
    all but the rim of the mirrored dark: it is always looked at, and of equals the outermost wins.
    """
    reach = max(HINT_REACH_PX, HINT_REACH * hint.radius_px)
    starts = [(start, coarse.search_px) for start in around_hint(coarse, hint, reach_px=reach)[:2]]
    fits: list[OutlineFit] = []
    for start, search_px in [*starts, (hint, max(HINT_REACH_PX, HINT_SEARCH * hint.radius_px))]:
        is_last, best = start is hint, best_outline(fits, hint.kind) if fits else None
        if is_last and best and best.sphere.score >= HINT_SURE and hint.kind == "white":
            break
        one = fit_outline(frames, camera, start, search_px=search_px, beside=beside)
        if one and one.sphere.score >= HINT_SCORE and np.abs(difference(one.sphere, hint)).max() < reach:
            if is_last and best and hint.kind == "white" and HINT_SURE * one.sphere.score <= best.sphere.score:
                break
            fits = [one] if is_last and hint.kind == "white" else [*fits, one]
    return best_outline(fits, hint.kind) if fits else None


def _match(
    found: list[OutlineFit],
    requests: list[SphereRequest],
    given: list[Sphere],
    rejected: tuple[Rejected, ...],
    warnings: list[str],
) -> list[tuple[OutlineFit, Diameter]]:
    """Give each found ball the diameter of a request of its kind; balls of a kind by their size in the picture."""
    if not requests:
        return [(one, Diameter(None, 0.0)) for one in found]
    balls = {k: sorted((f for f in found if f.sphere.kind == k), key=lambda f: -f.sphere.radius_px) for k in KINDS}
    listed: dict[Kind, list[float | None]] = {k: [r.diameter_mm for r in requests if r.kind == k] for k in KINDS}
    # It can be nothing else than a ball: what is round and matte may be the object.
    for (u, v), one in ((r.center_px, r) for r in rejected if r.kind == "chrome" and r.probability > FORGOTTEN):
        warnings.append(
            f"a chrome ball that session.toml does not list stands at ({u:.0f}, {v:.0f}) px, radius "
            f"{one.radius_px:.0f} px (probability {one.probability:.0%}). List it under [[spheres]], with its "
            'diameter_mm, to have it used. If it is listed, is kind wrong there? A mirror is "chrome", a matte ball '
            '"white".'
        )
    for kind in KINDS:
        asked, there = len(listed[kind]), len(balls[kind])
        if there < asked:
            near = "; ".join(f"{_place(r)}: {r.reason}" for r in rejected if r.kind == kind)
            warnings.append(
                f"{asked} {kind} ball{'s' * (asked > 1)} asked for, {there} found"
                f"{f' (refused: {near})' if near else ''}. Give center_px and radius_px of the one that is missing "
                "under [[spheres]], correct its kind, or drop it."
            )
    told = told_diameters({kind: [one.sphere for one in balls[kind]] for kind in KINDS}, listed, given, warnings)
    return [pair for kind in KINDS for pair in zip(balls[kind], told[kind], strict=True)]


def _place(one: Rejected) -> str:
    u, v = one.center_px
    return f"({u:.0f}, {v:.0f}) px, radius {one.radius_px:.0f} px"


def _nothing(requests: Sequence[SphereRequest], rejected: tuple[Rejected, ...]) -> str:
    asked = ", ".join(f"{count} {kind}" for kind, count in Counter(r.kind for r in requests).items())
    text = f"spheres: no ball found (asked for: {asked or 'any'}); {len(rejected)} circles were looked at"
    if rejected:
        text += f", the best at {_place(rejected[0])}: {rejected[0].reason}"
    return text + ". Give center_px and radius_px in session.toml, or known lights (lights.file)."
