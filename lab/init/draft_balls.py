"""The balls of a draft: in the frames, or in photographs of their own; or a light file in their place."""

from dataclasses import replace
from pathlib import Path

from capture.camera.session_camera import usual_camera
from capture.session.globs import frame_names
from capture.survey.folder_files import FolderFiles
from lab.init.answers import Asking
from lab.init.draft import Draft, DraftBall
from lab.progress import say
from scene.camera import Camera
from scene.errors import CalibrationError, SceneError
from scene.spheres import Kind, Sphere


def with_balls(draft: Draft, files: FolderFiles, asking: Asking, camera: Camera | None) -> Draft:
    """Find the balls, in the frames or in photographs of their own, and ask for their diameters."""
    apart, notes = _shot_apart(files, len(draft.photographs["flash"]))
    for path in files.lights if not apart else ():
        fault = _unreadable_lights(path, draft, camera)
        if not fault:
            told = f"lights are read from {path.name}: balls were not looked for."
            return replace(draft, lights=path).noting(told)
        draft = draft.noting(f"{path.name} is not used: {fault}")
    if apart and files.lights:
        notes.append(f"{files.lights[0].name} is not used: the balls' own photographs tell the lights.")
    if not apart:
        say("looking for balls ...")
    balls = apart or found_balls(draft, camera)
    draft = replace(draft.noting(*notes), balls=tuple(balls))
    if not balls:
        return draft.noting(
            "no ball was found. Without balls, light file or given normals there are no lights: rgbn studio shows the "
            "picture, and balls can be marked there; or add [[spheres]] with center_px and radius_px."
        )
    kinds: tuple[Kind, ...] = ("chrome", "white")
    usual = usual_camera(draft.small.width, draft.small.height)
    known: list[DraftBall] = []
    for kind in kinds:
        own = [ball for ball in draft.balls if ball.kind == kind]
        if not own:
            draft = draft.noting(f"no {kind} ball was found{', so lights have no positions' * (kind == 'chrome')}.")
            continue
        given = asking.diameters(kind, [ball.center_px for ball in own if ball.radius_px], len(own))
        known += [replace(ball, diameter_mm=mm) for ball, mm in zip(own, given or (None,) * len(own), strict=True)]
        if not given:
            draft = draft.noting(
                f"the diameter of the {kind} balls is not known: give --{kind} MM for positions in mm."
            )
    return replace(draft, balls=tuple(known)).noting(*_doubted(known, camera or usual, draft.step))


def _doubted(balls: list[DraftBall], camera: Camera, step: int) -> list[str]:
    """Name diameters that put balls where no lab has them: in centimetres or inches."""
    from calibrate.calibrate import LAB_M

    notes = []
    for ball in balls:
        if not ball.diameter_mm or not ball.radius_px:
            continue
        away_m = camera.fx * step * ball.diameter_mm / (2000 * ball.radius_px)
        if not LAB_M[0] < away_m < LAB_M[1]:
            notes.append(
                f"a {ball.kind} ball of {ball.diameter_mm:g} mm would stand {away_m:.2g} m from the camera; expected "
                f"{LAB_M[0]:g} to {LAB_M[1]:g} m. Is the diameter in millimetres (1 cm = 10 mm, 1 inch = 25.4 mm)?"
            )
    return list(dict.fromkeys(notes))[:1]


def _unreadable_lights(path: Path, draft: Draft, camera: Camera | None) -> str:
    """Return why a file gives no lights for the flash frames; empty where it does."""
    from calibrate.known_lights.read_known import read_lights

    names = tuple(frame_names(draft.photographs["flash"]))
    try:
        read_lights(path, names, camera=camera)
    except SceneError as error:
        return str(error).splitlines()[0]
    return ""


def found_balls(draft: Draft, camera: Camera | None) -> list[DraftBall]:
    """Return the balls that the small frames show, the largest of each kind first."""
    from calibrate.detection.balls import find_balls

    try:
        found, _, _ = find_balls(draft.small, camera or usual_camera(draft.small.width, draft.small.height), [])
    except CalibrationError:
        return []
    spheres = sorted((one.sphere for one in found), key=lambda sphere: (sphere.kind, -sphere.radius_px))
    return [DraftBall(one.kind, *_full_size(one, draft.step)) for one in spheres]


def _full_size(sphere: Sphere, step: int) -> tuple[tuple[float, float], float]:
    u, v = ((float(c) + 0.5) * step - 0.5 for c in sphere.center_px)
    return (u, v), float(sphere.radius_px) * step


def _shot_apart(files: FolderFiles, count: int) -> tuple[list[DraftBall], list[str]]:
    """Return balls with photographs of their own, one for each flash frame."""
    balls: list[DraftBall] = []
    notes: list[str] = []
    for kind in ("chrome", "white"):
        groups: dict[tuple[Path, str], list[Path]] = {}
        for path in files.photographs.get(kind, []):
            groups.setdefault((path.parent, path.suffix.lower()), []).append(path)
        fitting = [paths for paths in groups.values() if len(paths) == count]
        alike = [p for p in fitting if p[0].suffix == files.photographs["flash"][0].suffix] or fitting
        balls += [DraftBall(kind, files=tuple(paths)) for paths in alike[:1]]
        notes += [f"{place.name}: {len(paths)} photographs, but {count} flash frames; not used."
                  for (place, _), paths in groups.items() if paths not in fitting]  # fmt: skip
    return balls, notes
