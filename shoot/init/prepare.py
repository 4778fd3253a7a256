"""A folder looked at: roles of the photographs, camera, balls or a light file, scan; what is not sure is noted."""

import re
from collections.abc import Sequence
from contextlib import suppress
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np

from align.mask.object_mask import find_object
from align.scan.mended_scan import load_scan
from calibrate.detection.balls import find_balls
from calibrate.known_lights.read_known import read_lights
from capture.camera.exif import read_exif
from capture.camera.session_camera import usual_camera
from capture.session.globs import frame_names, kind_of
from capture.session.manifest import FramesTable, Manifest, SphereTable
from capture.session.session_types import Encoding
from capture.survey.board_layout import find_board
from capture.survey.folder_files import FEWEST, FolderFiles, name_of, pattern_of
from capture.survey.small_pictures import Small, by_light, frames_of, of_one_size, otherwise_lit, read_small
from formats.picture_files import read_values
from lab.progress import progress_bar, say
from scene.camera import Camera
from scene.errors import AlignError, CalibrationError, SceneError, SessionError
from scene.spheres import KINDS, Sphere
from shoot.init.answers import Asking
from shoot.init.draft import Draft

ALIKE = 0.3
"""Correlation with most photographs under which one shows another scene."""
SAME_OBJECT = 0.7
"""Of the mean pictures of two groups of names, above which they show one object: by 0.73 and more in real captures of
one object, 0.17 to 0.71 of seven."""


def prepare(
    files: FolderFiles, asking: Asking, small: Sequence[Small] = (), balls: Sequence[SphereTable] | None = None
) -> Draft:
    """Return what a folder's files are, with what the user answered.

    `small`, `balls`: the photographs as they were read already, and the balls as they were found.

    Raises SessionError: too few photographs can be read or are of one size, or they show several objects; answers do
    not fit what was found.
    """
    linear, encoding = encoding_of(files.by_role["flash"][0], asking)
    every = [path for role in ("flash", "ambient", "board", "chart") for path in files.by_role.get(role, [])]
    unread: list[str] = []
    if not small:
        with progress_bar(f"look at {files.folder.name}") as tell:
            small, unread = read_small(every, encoding, tell)
    draft = _look(files, linear, {one.path: one for one in small}, unread)
    if "board" not in draft.photographs:
        draft = draft.saying("camera", **asking.camera(is_known=draft.camera[0] is not None))
    return _given(_with_balls(draft, files, asking, balls), files, asking)


def _look(files: FolderFiles, linear: bool | None, by_path: dict[Path, Small], unread: list[str]) -> Draft:
    """Give the photographs whose names tell nothing their roles."""
    flash, notes = files.by_role["flash"], list(files.left_out)
    boards, dims = files.by_role.get("board", []), files.by_role.get("ambient", [])
    notes += [f"left out, cannot be read: {text}" for text in unread]
    shots = [by_path[path] for path in flash if path in by_path]
    if len(shots) < FEWEST:
        raise SessionError(
            f"{files.folder}: {len(shots)} of {len(flash)} photographs can be read.\n" + "\n".join(unread)
        )
    shots, odd = of_one_size(shots)
    named = [by_path[path] for path in boards if path in by_path]
    light = np.stack([one.light.ravel() for one in shots])
    usual = np.median(light, axis=0)
    alike = [np.corrcoef(usual, row)[0, 1] if row.std() > 0 else 1.0 for row in light]
    unlike = [one for one, share in zip(shots, alike, strict=True) if share < ALIKE]
    layout, shown = find_board(named or [*odd, *unlike])
    if named and not shown:
        notes.append(f"{named[0].path.name}: no ChArUco board or chessboard is seen in it; it is not used.")
    shots, odd = ([one for one in some if one not in shown] for some in (shots, odd))
    if odd:
        notes.append(f"left out, of another size: {', '.join(one.path.name for one in odd[:5])}.")
    ambient = [by_path[path] for path in dims if path in by_path]
    roles = {"flash": shots, "ambient": ambient} if ambient else by_light(shots)
    if roles.get("ambient") and not ambient:
        names = ", ".join(one.path.name for one in roles["ambient"])
        notes.append(f"assumed: {names} is without flash, by its light.")
    shots, ambient = roles.get("flash", []), roles.get("ambient", [])
    # After boards and unlit frames: they show something else, too.
    _check_one_object(files.folder, shots)
    lit = otherwise_lit(shots)
    if lit is not None:
        shots = [one for one in shots if one is not lit]
        notes.append(
            f"left out: {lit.path.name} is brighter than all others nearly everywhere, as by the room's lamps. If it "
            "is a flash frame, add it to frames.flash."
        )
    if len(shots) < FEWEST:
        raise SessionError(f"{files.folder}: {len(shots)} photographs show the flash; {FEWEST} or more are needed.")
    photographs = {
        "flash": [one.path for one in shots],
        "ambient": [one.path for one in ambient],
        "dark": [*files.by_role.get("dark", []), *(one.path for one in roles.get("dark", []))],
        "flat": files.by_role.get("flat", []),
    }
    globs = {role: pattern_of(some, files.folder) for role, some in photographs.items() if some}
    frames = FramesTable.model_validate({**globs, "linear": linear})
    first = shots[0]
    draft = Draft(
        Manifest(frames=frames), files.folder, first.width, first.height, frames_of(shots, ambient), first.step,
        tuple(read_exif(one.path) for one in shots), notes=tuple(notes),
    )  # fmt: skip
    draft = _with_chart(draft, [by_path[path] for path in files.by_role.get("chart", []) if path in by_path])
    if layout is None:
        return draft
    shots_key = "charuco" if layout.dictionary else "chessboard"
    pattern = pattern_of([one.path for one in shown], files.folder)
    return draft.saying("camera", board=layout.model_dump(exclude_none=True), **{shots_key: pattern})


def _with_chart(draft: Draft, charts: list[Small]) -> Draft:
    """Take the first photograph that is called a ColorChecker's and is as the flash frames are."""
    suffix, size = draft.photographs["flash"][0].suffix.lower(), (draft.width, draft.height)
    alike = [one.path for one in charts if one.path.suffix.lower() == suffix and (one.width, one.height) == size]
    lost = ", ".join(one.path.name for one in charts if one.path not in alike[:1])
    why = "one photograph of the ColorChecker is used" if alike else "another size or kind than the flash frames"
    draft = draft.noting(f"left out: {lost}: {why}.") if lost else draft
    return draft.saying("frames", chart=name_of(alike[0], draft.folder)) if alike else draft


def encoding_of(first: Path, asking: Asking) -> tuple[bool | None, Encoding]:
    """Return what session.toml is to say of the values' coding, None for nothing, and the coding."""
    if kind_of(first) != "image":
        return None, "linear"
    linear = asking.said("linear")
    if linear is None and first.suffix.lower() not in (".jpg", ".jpeg"):
        linear = True
        # One that cannot be read is named among those.
        with suppress(SceneError):
            linear = read_values(first, SceneError)[0].dtype != np.uint8
    return bool(linear), "linear" if linear else "srgb"


def _check_one_object(folder: Path, shots: list[Small]) -> None:
    """Raise SessionError where names tell several groups of photographs, and each shows another object."""
    groups: dict[str, list[Small]] = {}
    for one in shots:
        groups.setdefault(re.sub(r"[\d\W_]+$", "", one.path.stem), []).append(one)
    groups = {name: some for name, some in groups.items() if len(some) >= FEWEST}
    if len(groups) < 2:
        return
    means = np.stack([np.mean([one.boxes.ravel() for one in some], 0) for some in groups.values()])
    alike = np.corrcoef(means + 1e-9 * np.arange(means.shape[1]))
    if np.median([alike[pair] for pair in combinations(range(len(means)), 2)]) < SAME_OBJECT:
        told = ", ".join(f"{name} {len(some)}" for name, some in groups.items())
        raise SessionError(
            f"{folder}: holds photographs of several objects ({told}). Give each object a folder of its own, and a "
            "ball that was shot apart one called chrome or white; then run the same command again."
        )


def _given(draft: Draft, files: FolderFiles, asking: Asking) -> Draft:
    """Take the mask, the normals and the scan, with its unit."""
    apart = {word for kind in KINDS for word in (kind, "gray", "grey")}
    masks, scans, maps = (files.by_role.get(role, []) for role in ("mask", "scan", "normals"))
    masks = [path for path in masks if not apart & set(path.stem.lower().replace(".", "_").split("_"))]
    scans = sorted(scans, key=lambda path: -path.stat().st_size)
    keys: dict[str, Any] = {}
    for key, paths, what in (
        ("mask", masks, "files may be the mask: {} is taken."),
        ("normals", maps, "files may be the normal map: {} is taken."),
        ("scan", scans, "meshes: the largest, {}, is taken for the scan."),
    ):
        keys[key] = name_of(paths[0], draft.folder) if paths else None
        draft = draft.noting(f"{len(paths)} {what.format(paths[0].name)}") if len(paths) > 1 else draft
    draft = draft.saying("object", **keys)
    if not scans:
        return draft
    return draft.with_unit(load_scan(scans[0], "unknown").vertices, _across_px(draft), asking)


def _across_px(draft: Draft) -> float | None:
    """Return the object's diagonal in the picture; None where it, or every ball, is not found."""
    balls = [
        Sphere(ball.kind, (np.array(ball.center_px) + 0.5) / draft.step - 0.5, ball.radius_px / draft.step)
        for ball in draft.manifest.spheres if ball.center_px and ball.radius_px
    ]  # fmt: skip
    try:
        mask = find_object(draft.small, _small_camera(draft), balls).mask if balls else None
    except AlignError:
        mask = None
    return None if mask is None else draft.step * float(np.hypot(*np.ptp(np.argwhere(mask), axis=0)))


def _with_balls(draft: Draft, files: FolderFiles, asking: Asking, found: Sequence[SphereTable] | None) -> Draft:
    """Find the balls, in the frames or in photographs of their own, and ask for their diameters.

    `found`: those in the frames, where they are known.
    """
    apart, notes = _shot_apart(files, len(draft.photographs["flash"]))
    names = tuple(frame_names(draft.photographs["flash"]))
    lights = files.by_role.get("lights", [])
    for path in lights if not apart else ():
        try:
            read_lights(path, names, camera=draft.camera[0])
            return draft.saying("lights", file=name_of(path, draft.folder))
        except SceneError as error:
            draft = draft.noting(f"{path.name} is not used: {str(error).splitlines()[0]}")
    if apart and lights:
        notes.append(f"{lights[0].name} is not used: the balls' own photographs tell the lights.")
    if not apart and found is None:
        say("looking for balls ...")
        with suppress(CalibrationError):
            balls, _, _ = find_balls(draft.small, _small_camera(draft), [])
            found = drafted([one.sphere for one in balls], draft.step)
    balls = apart or found or ()
    known = zip(balls, diameters_of(balls, asking), strict=True)
    return draft.noting(*notes).with_balls([ball.model_copy(update={"diameter_mm": mm}) for ball, mm in known])


def diameters_of(balls: Sequence[SphereTable], asking: Asking) -> list[float | None]:
    """Return the diameters of balls, sorted by kind and size, that are known or asked for.

    Raises SessionError: diameters were given, neither one for all balls of a kind nor one for each.
    """
    known: list[float | None] = []
    for kind in KINDS:
        own = [ball for ball in balls if ball.kind == kind]
        if own:
            known += asking.diameters(kind, [ball.center_px for ball in own if ball.center_px], len(own))
    return known


def _small_camera(draft: Draft) -> Camera:
    """Return the camera of the small frames, as far as it is known."""
    camera = draft.camera[0] or usual_camera(draft.width, draft.height)
    return camera.scaled(draft.small.width, draft.small.height, 1 / draft.step, 1 / draft.step)


def drafted(spheres: Sequence[Sphere], step: int = 1) -> list[SphereTable]:
    """Return balls that were found in frames of which a pixel is `step` of the photographs' wide, the largest first.

    To a tenth of a pixel, as session.toml is to say it.
    """
    ordered = sorted(spheres, key=lambda sphere: (sphere.kind, -sphere.radius_px))
    return [
        SphereTable(
            kind=one.kind,
            center_px=[round((float(c) + 0.5) * step - 0.5, 1) for c in one.center_px],
            radius_px=round(float(one.radius_px) * step, 1),
        )
        for one in ordered
    ]


def _shot_apart(files: FolderFiles, count: int) -> tuple[list[SphereTable], list[str]]:
    """Return balls with photographs of their own, one for each flash frame."""
    balls: list[SphereTable] = []
    notes: list[str] = []
    for kind in KINDS:
        groups: dict[tuple[Path, str], list[Path]] = {}
        for path in files.by_role.get(kind, []):
            groups.setdefault((path.parent, path.suffix.lower()), []).append(path)
        fitting = [paths for paths in groups.values() if len(paths) == count]
        alike = [p for p in fitting if p[0].suffix == files.by_role["flash"][0].suffix] or fitting
        for paths in alike[:1]:
            balls.append(SphereTable.model_validate({"kind": kind, "frames": pattern_of(paths, files.folder)}))
        notes += [f"{place.name}: {len(paths)} photographs, but {count} flash frames; not used."
                  for (place, _), paths in groups.items() if paths not in fitting]  # fmt: skip
    return balls, notes
