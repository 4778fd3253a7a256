"""The balls that a session asks for: given, or found, and each with its diameter."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from calibrate.coarse import Coarse, shrink
from calibrate.detect import Found, Rejected, detect
from calibrate.silhouette import OutlineFit, fit_mask, fit_outline
from scene.camera import Camera
from scene.errors import CalibrationError
from scene.frames import Frames
from scene.spheres import Kind, Sphere, SphereRequest

Array = NDArray[np.float64]
GIVEN_SIGMA_PX = 1.0
"""A circle given by hand whose outline cannot be found is believed to this."""


@dataclass(frozen=True)
class Ball:
    """A ball with its outline's covariance and the photographs that show it."""

    sphere: Sphere
    covariance: Array
    frames: Frames
    coarse: Coarse


def find_balls(
    frames: Frames,
    camera: Camera,
    requests: Sequence[SphereRequest],
    *,
    progress: Callable[[int, int], None] | None = None,
) -> tuple[list[Ball], tuple[Rejected, ...], tuple[str, ...]]:
    """Return the balls, the circles that are none, and warnings.

    Balls that stand in their own photographs are looked for there; without requests, whatever balls stand
    in the session's frames are taken.

    Raises
    ------
    CalibrationError
        No ball was found, or a request cannot be met by its own photographs.
    """
    groups: list[tuple[Frames, list[SphereRequest]]] = []
    for request in requests:
        own = frames if request.frames is None else request.frames
        _check_own_frames(frames, own, camera)
        for group_frames, group in groups:
            if group_frames is own:
                group.append(request)
                break
        else:
            groups.append((own, [request]))
    if not groups:
        groups = [(frames, [])]
    balls: list[Ball] = []
    rejected: tuple[Rejected, ...] = ()
    warnings: list[str] = []
    for number, (own, group) in enumerate(groups):

        def step(done: int, total: int, number: int = number) -> None:
            if progress:
                progress(number * total + done, len(groups) * total)

        coarse = shrink(own, camera, progress=step)
        apart = own is not frames
        given = [r for r in group if r.mask is not None or r.center_px is not None]
        open_ = [r for r in group if r.mask is None and r.center_px is None]
        fits = [_given(own, camera, request, warnings) for request in given]
        spheres = [
            replace(fit.sphere, kind=request.kind, diameter_mm=request.diameter_mm, apart=apart)
            for fit, request in zip(fits, given, strict=True)
        ]
        covariances = [fit.covariance for fit in fits]
        if open_ or not group:
            wanted: dict[Kind, int] | None = None
            if group:
                wanted = {}
                for request in open_:
                    wanted[request.kind] = wanted.get(request.kind, 0) + 1
            found, refused = detect(own, camera, coarse, wanted=wanted, taken=tuple(spheres))
            rejected += refused
            for one, diameter in _match(found, open_, refused, warnings):
                spheres.append(replace(one.sphere, diameter_mm=diameter, apart=apart))
                covariances.append(one.fit.covariance)
        balls += [Ball(s, c, own, coarse) for s, c in zip(spheres, covariances, strict=True)]
    if not balls:
        raise CalibrationError(_nothing(requests, rejected))
    return balls, rejected, tuple(warnings)


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


def _given(frames: Frames, camera: Camera, request: SphereRequest, warnings: list[str]) -> OutlineFit:
    """Fit a ball whose place the user gave, by mask or by circle."""
    if request.mask is not None:
        if request.mask.shape != (frames.height, frames.width):
            raise CalibrationError(
                f"spheres.mask: {request.mask.shape[1]} x {request.mask.shape[0]} px, but the frames are "
                f"{frames.width} x {frames.height}."
            )
        area = int(request.mask.sum())
        if area < 200:
            raise CalibrationError(
                f"spheres.mask: only {area} px are set; a ball needs 200 at least. White is the ball."
            )
        rows, columns = np.nonzero(request.mask)
        start = Sphere(request.kind, np.array([columns.mean(), rows.mean()]), float(np.sqrt(area / np.pi)))
        fit = fit_mask(request.mask, camera, start)
        if fit is None or fit.residual_px > 0.05 * start.radius_px:
            raise CalibrationError("spheres.mask: its border is not the outline of a ball.")
        return fit
    if request.center_px is None or request.radius_px is None:
        raise CalibrationError("spheres: center_px needs radius_px too; give both, or neither to have the ball found.")
    start = Sphere(request.kind, np.array(request.center_px, np.float64), float(request.radius_px))
    fit = fit_outline(frames, camera, start, search_px=max(3.0, 0.04 * start.radius_px))
    if fit is not None:
        moved = np.hypot(*(fit.sphere.center_px - start.center_px)) + abs(fit.sphere.radius_px - start.radius_px)
        if fit.sphere.score > 0.5 and moved < 4 + 0.08 * start.radius_px:
            return fit
    u, v = request.center_px
    warnings.append(
        f"{request.kind} ball at ({u:.0f}, {v:.0f}) px: no outline was found at the given circle; it is taken "
        f"as it is, with {GIVEN_SIGMA_PX} px of doubt."
    )
    return OutlineFit(replace(start, sigma_px=GIVEN_SIGMA_PX, score=0.0), np.eye(3) * GIVEN_SIGMA_PX**2, GIVEN_SIGMA_PX)


def _match(
    found: list[Found], requests: list[SphereRequest], rejected: tuple[Rejected, ...], warnings: list[str]
) -> list[tuple[Found, float | None]]:
    """Give each found ball the diameter of a request of its kind, the larger diameter to the larger picture."""
    if not requests:
        return [(one, None) for one in found]
    out: list[tuple[Found, float | None]] = []
    for kind in dict.fromkeys(request.kind for request in requests):
        asked = [request.diameter_mm for request in requests if request.kind == kind]
        mine = sorted((one for one in found if one.sphere.kind == kind), key=lambda one: -one.sphere.radius_px)
        if len(mine) < len(asked):
            near = "; ".join(
                f"({r.center_px[0]:.0f}, {r.center_px[1]:.0f}) px, radius {r.radius_px:.0f}: {r.reason}"
                for r in rejected[:2]
            )
            warnings.append(
                f"{len(asked)} {kind} balls were asked for, {len(mine)} found"
                + (f" (refused: {near})." if near else ".")
            )
        known = sorted((d for d in asked if d is not None), reverse=True)
        if len(set(known)) > 1 or 0 < len(known) < len(asked):
            if len(known) == len(asked) == len(mine):
                warnings.append(
                    f"{kind} balls of {', '.join(f'{d:g}' for d in known)} mm were told apart by their size in the "
                    "picture."
                )
            else:
                warnings.append(
                    f"{len(mine)} {kind} balls were found for diameters {known} mm and cannot be told apart: no "
                    "diameter is used. Give center_px and radius_px."
                )
                known = []
        for i, one in enumerate(mine):
            out.append((one, known[i] if i < len(known) else None))
    return out


def _nothing(requests: Sequence[SphereRequest], rejected: tuple[Rejected, ...]) -> str:
    asked = ", ".join(f"{sum(r.kind == k for r in requests)} {k}" for k in dict.fromkeys(r.kind for r in requests))
    text = f"spheres: no ball found (asked for: {asked or 'any'}); {len(rejected)} circles were looked at"
    if rejected:
        best = rejected[0]
        u, v = best.center_px
        text += f", the best at ({u:.0f}, {v:.0f}) px, radius {best.radius_px:.0f} px: {best.reason}"
    return text + ". Give center_px and radius_px in session.toml, or known lights (lights.file)."
