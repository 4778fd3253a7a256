"""Balls corrected by hand, and said as a session says them."""

from capture.session.session_types import Session, SphereSpec
from scene.camera import Camera
from scene.errors import SceneError
from scene.spheres import Sphere
from studio.photograph.outlines import Outline, Outlines
from studio.review.folder import Review


def outlines_of(review: Review) -> Outlines:
    """Return the balls as they were found; where none were, as the session gives them."""
    camera, session = review.material.camera, review.session
    if review.spheres:
        return tuple(
            Outline(s.kind, (float(s.center_px[0]), float(s.center_px[1])), float(s.radius_px), _stated_mm(session, s),
                    apart=s.apart)
            for s in review.spheres
        )  # fmt: skip
    if camera is None or session is None:
        return ()
    scale, found = _scale(session, camera), []
    for i, spec in enumerate(session.spheres):
        # Those that the session names without a place wait in the middle of the picture to be put in place.
        place = (camera.width * (i + 0.5) / len(session.spheres), camera.height / 2)
        if spec.center_px is not None:
            place = (spec.center_px[0] + 0.5) / scale - 0.5, (spec.center_px[1] + 0.5) / scale - 0.5
        radius = (spec.radius_px or 0) / scale or camera.width / 20
        found.append(Outline(spec.kind, place, radius, spec.diameter_mm, apart=bool(spec.frames)))
    return tuple(found)


def specs_of(session: Session, balls: Outlines, camera: Camera) -> tuple[SphereSpec, ...]:
    """Return `[[spheres]]` entries that say these outlines, in the pixels that the session counts in.

    Raises SceneError: the session's balls cannot be said by circles: their lights are given, or a ball has a mask.
    """
    if session.lights_file is not None:
        raise SceneError(
            f"lights.file: this session's lights are from {session.lights_file.name}, not from balls. Take the table "
            "[lights] out of session.toml to calibrate with balls."
        )
    if any(spec.mask for spec in session.spheres):
        raise SceneError(
            "spheres.mask: this session gives its balls by masks. Correct the masks, or replace them by center_px and "
            "radius_px in session.toml."
        )
    if not balls:
        raise SceneError("spheres: there is no ball to calibrate with. Add one.")
    own = [spec for spec in session.spheres if spec.frames]
    apart = [ball for ball in balls if ball.apart]
    if [ball.kind for ball in apart] != [spec.kind for spec in own]:
        raise SceneError(
            "spheres.frames: which ball stands in which photographs of its own is not known here, as not every such "
            "ball was found. Give center_px and radius_px in session.toml."
        )
    frames = iter(spec.frames for spec in own)
    scale = _scale(session, camera)
    specs = []
    for ball in balls:
        center = (ball.center_px[0] + 0.5) * scale - 0.5, (ball.center_px[1] + 0.5) * scale - 0.5
        own_frames = next(frames) if ball.apart else ()
        specs.append(SphereSpec(ball.kind, ball.diameter_mm, center, ball.radius_px * scale, None, own_frames))
    return tuple(specs)


def _stated_mm(session: Session | None, sphere: Sphere) -> float | None:
    """Return a found ball's diameter where the session states it; a white ball's may have been guessed."""
    if session is None or sphere.diameter_mm is None:
        return sphere.diameter_mm
    stated = [spec.diameter_mm for spec in session.spheres if spec.kind == sphere.kind and spec.diameter_mm]
    # Calibration leaves a stated diameter as it is.
    return sphere.diameter_mm if any(abs(one - sphere.diameter_mm) < 1e-6 * one for one in stated) else None


def _scale(session: Session, camera: Camera) -> int:
    from capture.session.requests import hint_scale

    return hint_scale(session, camera.width)
