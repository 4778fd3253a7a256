"""The balls of a draft: in the frames, or in photographs of their own; or a light file in their place."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from capture.session.globs import frame_names
from capture.session.manifest import SphereTable
from capture.survey.folder_files import FolderFiles, name_of, pattern_of
from lab.progress import say
from scene.camera import Camera
from scene.errors import CalibrationError, SceneError
from scene.spheres import KINDS, Sphere
from shoot.init.answers import Asking
from shoot.init.draft import Draft


def with_balls(draft: Draft, files: FolderFiles, asking: Asking, found: Sequence[SphereTable] | None = None) -> Draft:
    """Find the balls, in the frames or in photographs of their own, and ask for their diameters.

    `found`: those in the frames, where they are known.
    """
    apart, notes = _shot_apart(files, len(draft.photographs["flash"]))
    for path in files.lights if not apart else ():
        fault = _unreadable_lights(path, draft)
        if not fault:
            return draft.saying("lights", file=name_of(path, draft.folder))
        draft = draft.noting(f"{path.name} is not used: {fault}")
    if apart and files.lights:
        notes.append(f"{files.lights[0].name} is not used: the balls' own photographs tell the lights.")
    if not apart and found is None:
        say("looking for balls ...")
        found = found_balls(draft)
    draft = replace(draft, found=tuple(() if apart else found or ()))
    return draft.noting(*notes).with_balls(with_diameters(apart or draft.found, asking))


def with_diameters(balls: Sequence[SphereTable], asking: Asking) -> list[SphereTable]:
    """Return balls, of each kind the largest first, with the diameters that are known or asked for.

    Raises
    ------
    SessionError
        Diameters were given, neither one for all balls of a kind nor one for each.
    """
    known: list[SphereTable] = []
    for kind in KINDS:
        own = [ball for ball in balls if ball.kind == kind]
        if own:
            given = asking.diameters(kind, [ball.center_px for ball in own if ball.center_px], len(own))
            diameters = given or (None,) * len(own)
            known += [ball.model_copy(update={"diameter_mm": mm}) for ball, mm in zip(own, diameters, strict=True)]
    return known


def _unreadable_lights(path: Path, draft: Draft) -> str:
    """Return why a file gives no lights for the flash frames; empty where it does."""
    from calibrate.known_lights.read_known import read_lights

    names = tuple(frame_names(draft.photographs["flash"]))
    try:
        read_lights(path, names, camera=draft.known_camera()[0])
    except SceneError as error:
        return str(error).splitlines()[0]
    return ""


def found_balls(draft: Draft) -> list[SphereTable]:
    """Return the balls that the small frames show, the largest of each kind first."""
    from calibrate.detection.balls import find_balls

    try:
        found, _, _ = find_balls(draft.small, small_camera(draft), [])
    except CalibrationError:
        return []
    return drafted([one.sphere for one in found], draft.step)


def small_camera(draft: Draft) -> Camera:
    """Return the camera of the small frames, as far as it is known."""
    return draft.assumed_camera.scaled(draft.small.width, draft.small.height, 1 / draft.step, 1 / draft.step)


def drafted(spheres: Sequence[Sphere], step: int = 1) -> list[SphereTable]:
    """Return balls that were found in frames of which a pixel is `step` of the photographs' wide, the largest first."""
    ordered = sorted(spheres, key=lambda sphere: (sphere.kind, -sphere.radius_px))
    return [
        SphereTable(
            kind=one.kind,
            center_px=[(float(c) + 0.5) * step - 0.5 for c in one.center_px],
            radius_px=float(one.radius_px) * step,
        )
        for one in ordered
    ]


def _shot_apart(files: FolderFiles, count: int) -> tuple[list[SphereTable], list[str]]:
    """Return balls with photographs of their own, one for each flash frame."""
    balls: list[SphereTable] = []
    notes: list[str] = []
    for kind in KINDS:
        groups: dict[tuple[Path, str], list[Path]] = {}
        for path in files.photographs.get(kind, []):
            groups.setdefault((path.parent, path.suffix.lower()), []).append(path)
        fitting = [paths for paths in groups.values() if len(paths) == count]
        alike = [p for p in fitting if p[0].suffix == files.photographs["flash"][0].suffix] or fitting
        for paths in alike[:1]:
            balls.append(SphereTable.model_validate({"kind": kind, "frames": pattern_of(paths, files.folder)}))
        notes += [f"{place.name}: {len(paths)} photographs, but {count} flash frames; not used."
                  for (place, _), paths in groups.items() if paths not in fitting]  # fmt: skip
    return balls, notes
