"""A folder looked at: roles of the photographs, camera, balls, scan; what is not sure is noted."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from capture.camera.exif import read_exif
from capture.camera.focal_length import camera_from_lens
from capture.session.globs import kind_of
from capture.session.session_types import Encoding, Lens
from capture.survey.board_layout import find_board
from capture.survey.folder_files import FEWEST, FolderFiles
from capture.survey.small_pictures import Small, by_light, frames_of, of_one_size, read_small
from formats.pictures import read_values
from scene.errors import SceneError, SessionError
from scene.spheres import KINDS
from shoot.init.answers import Asking
from shoot.init.draft import Draft, DraftBall
from shoot.init.draft_balls import with_balls
from shoot.init.scan_unit import object_across_px, read_scan

Progress = Callable[[int, int], None]


def prepare(files: FolderFiles, asking: Asking, progress: Progress | None = None) -> Draft:
    """Return what a folder's files are, with what the user answered.

    Raises
    ------
    SessionError
        Too few photographs can be read or are of one size; answers do not fit what was found.
    """
    return completed(_look(files, asking, progress), files, asking)


def completed(draft: Draft, files: FolderFiles, asking: Asking, balls: list[DraftBall] | None = None) -> Draft:
    """Return a draft whose photographs have their roles with all else: camera, balls, mask, scan; see `prepare`.

    `balls`: as they were found already; None: they are looked for.
    """
    lens = asking.answers.lens
    if draft.board is not None or lens != Lens() or not asking.answers.distance_mm:
        draft = with_camera(draft, lens)
    draft = with_balls(draft, files, asking, balls)
    draft = _given(draft, files, asking)
    return _by_distance(draft, asking)


def _look(files: FolderFiles, asking: Asking, progress: Progress | None) -> Draft:
    """Decode small; give the photographs whose names tell nothing their roles."""
    flash, notes = files.photographs["flash"], list(files.left_out)
    linear, encoding = encoding_of(flash[0], asking)
    boards, dims = files.photographs.get("board", []), files.photographs.get("ambient", [])
    every, count = [*flash, *dims, *boards], 0

    def done() -> None:
        nonlocal count
        count += 1
        if progress:
            progress(count, len(every))

    small, unread = read_small(every, encoding, done=done)
    notes += [f"left out, cannot be read: {text}" for text in unread]
    by_path = {one.path: one for one in small}
    shots = [by_path[path] for path in flash if path in by_path]
    if len(shots) < FEWEST:
        raise SessionError(
            f"{files.folder}: {len(shots)} of {len(flash)} photographs can be read.\n" + "\n".join(unread)
        )
    shots, odd = of_one_size(shots)
    named = [by_path[path] for path in boards if path in by_path]
    layout, shown = find_board(named or [*odd, *_unlike(shots)])
    shots = [one for one in shots if one not in shown]
    if named and not shown:
        notes.append(f"{named[0].path.name}: no ChArUco board or chessboard is seen in it; it is not used.")
    odd = [one for one in odd if one not in shown]
    if odd:
        notes.append(f"left out, of another size: {', '.join(one.path.name for one in odd[:5])}.")
    ambient = [by_path[path] for path in dims if path in by_path]
    dark: list[Small] = []
    if not ambient:
        sorted_ = by_light(shots)
        shots, ambient, dark = (sorted_.get(role, []) for role in ("flash", "ambient", "dark"))
        if ambient:
            notes.append(f"assumed: {', '.join(o.path.name for o in ambient)} is without flash, by its light.")
    if len(shots) < FEWEST:
        raise SessionError(f"{files.folder}: {len(shots)} photographs show the flash; {FEWEST} or more are needed.")
    photographs = {
        "flash": [one.path for one in shots],
        "ambient": [one.path for one in ambient],
        "dark": [*files.photographs.get("dark", []), *(one.path for one in dark)],
        "flat": files.photographs.get("flat", []),
        "board": [one.path for one in shown],
    }
    first = shots[0]
    return Draft(
        files.folder, {role: paths for role, paths in photographs.items() if paths},
        first.width, first.height, frames_of(shots, ambient), first.step,
        exif=tuple(map(read_exif, photographs["flash"])),
        board=layout if shown else None, linear=linear, notes=tuple(notes),
    )  # fmt: skip


def encoding_of(first: Path, asking: Asking) -> tuple[bool | None, Encoding]:
    """Return what session.toml is to say of the values' coding, None for nothing, and the coding."""
    if kind_of(first) != "image":
        return None, "linear"
    if first.suffix.lower() in (".jpg", ".jpeg"):
        linear = bool(asking.answers.linear)
    elif asking.answers.linear is None and not _has_eight_bits(first):
        return True, "linear"
    else:
        linear = asking.is_linear(first.name)
    return linear, "linear" if linear else "srgb"


def _has_eight_bits(path: Path) -> bool:
    try:
        return read_values(path, SceneError)[0].dtype == np.uint8
    except SceneError:
        # It is named among those that cannot be read.
        return False


def _unlike(shots: list[Small]) -> list[Small]:
    """Return the pictures that show another scene than most."""
    light = np.stack([one.light.ravel() for one in shots])
    usual = np.median(light, axis=0)
    alike = [np.corrcoef(usual, row)[0, 1] if row.std() > 0 else 1.0 for row in light]
    return [one for one, share in zip(shots, alike, strict=True) if share < 0.3]


def with_camera(draft: Draft, lens: Lens) -> Draft:
    """Return the draft with its camera, as a lens, EXIF or shots of a board tell it.

    Raises SessionError: the lens is known in a part that does not tell the camera.
    """
    if draft.board is not None:
        shots = draft.photographs["board"]
        kind = "chessboard" if draft.board.dictionary is None else "ChArUco board"
        across = " x ".join(map(str, draft.board.squares))
        return replace(draft, camera=None, camera_told=f"{len(shots)} shots of a {kind} of {across} squares")
    camera, told = camera_from_lens(lens, draft.exif, draft.width, draft.height)
    if camera.is_orthographic:
        text = "not known: no EXIF, no board. It is sought by the balls; or give focal_mm and sensor_mm."
        return replace(draft, lens=lens, camera=None, camera_told=text)
    words = told[0].removeprefix("camera: ").partition(". ")[0] if told else f"focal length {camera.fx:.0f} px"
    return replace(draft, lens=lens, camera=camera, camera_told=words)


def _given(draft: Draft, files: FolderFiles, asking: Asking) -> Draft:
    """Take the mask, the normals and the scan, with its unit."""
    apart = {word for kind in KINDS for word in (kind, "gray", "grey")}
    masks = [path for path in files.masks if not apart & set(path.stem.lower().replace(".", "_").split("_"))]
    draft = replace(draft, mask=masks[0] if masks else None, normals=files.normals[0] if files.normals else None)
    for what, paths in (("mask", masks), ("normal map", files.normals)):
        if len(paths) > 1:
            draft = draft.noting(f"{len(paths)} files may be the {what}: {paths[0].name} is taken.")
    if not files.scans:
        return draft
    scans = sorted(files.scans, key=lambda path: -path.stat().st_size)
    if len(scans) > 1:
        draft = draft.noting(f"{len(scans)} meshes: the largest, {scans[0].name}, is taken for the scan.")
    circles = [ball.sphere(draft.step) for ball in draft.balls if ball.radius_px]
    across = object_across_px(draft.small, draft.small_camera, circles) if circles else None
    across_px = across and across * draft.step
    draft = replace(draft, scan=scans[0], scan_size=read_scan(scans[0]), across_px=across_px)
    return replace(draft, unit=asking.unit(scans[0].name, draft.likely_unit))


def _by_distance(draft: Draft, asking: Asking) -> Draft:
    """Take the focal length from the balls' distance: radius_px = fx radius_mm / distance."""
    distance = asking.answers.distance_mm
    if not distance or asking.answers.lens != Lens():
        return draft
    focal = [distance / ball.mm_per_px for ball in draft.balls if ball.mm_per_px]
    if not focal:
        raise SessionError(
            "--distance-mm: needs balls that are found and whose diameter is given: --chrome or --white."
        )
    fx = round(float(np.median(focal)), 1)
    told = f"{fx:g} px, by {len(focal)} balls {distance:g} mm away"
    return replace(draft, lens=Lens(fx=fx), camera_told=told)
