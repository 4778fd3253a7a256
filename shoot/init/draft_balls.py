"""The balls of a draft: in the frames, or in photographs of their own; or a light file in their place."""

from dataclasses import replace
from pathlib import Path

from capture.session.globs import frame_names
from capture.survey.folder_files import FolderFiles
from lab.progress import say
from scene.errors import CalibrationError, SceneError
from scene.spheres import KINDS, Sphere
from shoot.init.answers import Asking
from shoot.init.draft import Draft, DraftBall


def with_balls(draft: Draft, files: FolderFiles, asking: Asking, found: list[DraftBall] | None = None) -> Draft:
    """Find the balls, in the frames or in photographs of their own, and ask for their diameters.

    `found`: those in the frames, where they are known.
    """
    apart, notes = _shot_apart(files, len(draft.photographs["flash"]))
    for path in files.lights if not apart else ():
        fault = _unreadable_lights(path, draft)
        if not fault:
            return replace(draft, lights=path)
        draft = draft.noting(f"{path.name} is not used: {fault}")
    if apart and files.lights:
        notes.append(f"{files.lights[0].name} is not used: the balls' own photographs tell the lights.")
    if not apart and found is None:
        say("looking for balls ...")
        found = found_balls(draft)
    return replace(draft.noting(*notes), balls=tuple(with_diameters(apart or found or [], asking)))


def with_diameters(balls: list[DraftBall], asking: Asking) -> list[DraftBall]:
    """Return balls, of each kind the largest first, with the diameters that are known or asked for.

    Raises
    ------
    SessionError
        Diameters were given, neither one for all balls of a kind nor one for each.
    """
    known: list[DraftBall] = []
    for kind in KINDS:
        own = [ball for ball in balls if ball.kind == kind]
        if not own:
            continue
        given = asking.diameters(kind, [ball.center_px for ball in own if ball.radius_px], len(own))
        known += [replace(ball, diameter_mm=mm) for ball, mm in zip(own, given or (None,) * len(own), strict=True)]
    return known


def _unreadable_lights(path: Path, draft: Draft) -> str:
    """Return why a file gives no lights for the flash frames; empty where it does."""
    from calibrate.known_lights.read_known import read_lights

    names = tuple(frame_names(draft.photographs["flash"]))
    try:
        read_lights(path, names, camera=draft.camera)
    except SceneError as error:
        return str(error).splitlines()[0]
    return ""


def found_balls(draft: Draft) -> list[DraftBall]:
    """Return the balls that the small frames show, the largest of each kind first."""
    from calibrate.detection.balls import find_balls

    try:
        found, _, _ = find_balls(draft.small, draft.small_camera, [])
    except CalibrationError:
        return []
    return drafted([one.sphere for one in found], draft.step)


def drafted(spheres: list[Sphere], step: int = 1) -> list[DraftBall]:
    """Return balls that were found in frames of which a pixel is `step` of the photographs' wide, the largest first."""
    ordered = sorted(spheres, key=lambda sphere: (sphere.kind, -sphere.radius_px))
    return [DraftBall(one.kind, *_full_size(one, step)) for one in ordered]


def _full_size(sphere: Sphere, step: int) -> tuple[tuple[float, float], float]:
    u, v = ((float(c) + 0.5) * step - 0.5 for c in sphere.center_px)
    return (u, v), float(sphere.radius_px) * step


def _shot_apart(files: FolderFiles, count: int) -> tuple[list[DraftBall], list[str]]:
    """Return balls with photographs of their own, one for each flash frame."""
    balls: list[DraftBall] = []
    notes: list[str] = []
    for kind in KINDS:
        groups: dict[tuple[Path, str], list[Path]] = {}
        for path in files.photographs.get(kind, []):
            groups.setdefault((path.parent, path.suffix.lower()), []).append(path)
        fitting = [paths for paths in groups.values() if len(paths) == count]
        alike = [p for p in fitting if p[0].suffix == files.photographs["flash"][0].suffix] or fitting
        balls += [DraftBall(kind, files=tuple(paths)) for paths in alike[:1]]
        notes += [f"{place.name}: {len(paths)} photographs, but {count} flash frames; not used."
                  for (place, _), paths in groups.items() if paths not in fitting]  # fmt: skip
    return balls, notes
