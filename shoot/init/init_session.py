"""`rgbn init`: a folder looked at, shown, and its session.toml written, with a picture of what was found."""

import os
import shlex
from contextlib import suppress
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from capture.session.manifest_file import parse, toml_tables
from capture.session.session import load_session
from capture.survey.folder_files import FolderFiles, survey
from compare.report.picture_strip import INK, PAPER, PictureStrip
from compare.report.pictures import Exposure
from lab.progress import say
from lab.session_place import MANIFEST, default_out
from lab.terminal_tables import fact_table, show
from scene.errors import SceneError, SessionError
from scene.files import write_png, write_text
from scene.light_text import FILENAMES
from scene.origin import Origin
from scene.output_folder import open_record
from scene.record import Record
from shoot.init.answers import Answers, Asking
from shoot.init.draft import Draft, facts_of, is_unedited, notes_of, session_text, signed
from shoot.init.prepare import prepare

SHEET = "contact-sheet.png"
WIDTH = 1236
"""Of six small pictures beside each other."""
MOST = 12
"""Photographs that are shown small."""
COLOURS = {"chrome": (90, 220, 255), "white": (255, 190, 60)}


def init_sessions(folder: Path, told: Answers, *, yes: bool = False) -> list[tuple[Draft, Path, Path]]:
    """Write a session.toml for a folder, or one for each object's subfolder; return each with its draft and sheet.

    One that rgbn wrote and nobody changed is written anew: what it says holds where nothing else is said.

    Raises SessionError: there is a session.toml of a person's, or the folder is one in the DiLiGenT layout; no
    photographs; answers do not fit.
    """
    check_layout(folder)
    found = survey(folder)
    for one in found:
        check_free(one)
    if len(found) > 1:
        say(f"{len(found)} objects: {', '.join(one.folder.name for one in found)}")
    asking, made = Asking(told, yes), []
    for one in found:
        asking.earlier = Answers()
        if (manifest := one.folder / MANIFEST).is_file():
            with suppress(SceneError):
                known, _ = parse(toml_tables(manifest))
                asking.earlier = Answers.said_in(known) if known else Answers()
        draft = prepare(one, asking)
        show(fact_table(f"{draft.folder}", dict(facts_of(draft))))
        for note in notes_of(draft):
            print(f"note: {note}")
        origin = Origin("session", draft.folder, tuple(draft.photographs["flash"]))
        out = default_out(origin, draft.folder.name)
        with open_record(out, origin=origin, input_folders=[draft.folder]) as record:
            sheet = write_sheet(draft, record)
        made.append((draft, write_manifest(draft), sheet))
    for _, manifest, sheet in made:
        print(f"written  {manifest}")
        print(f"         {sheet}: the balls in circles; look whether all are found")
    for draft, _, _ in made:
        place = shlex.quote(str(draft.folder))
        unknown = sorted({f" --{ball.kind} MM" for ball in draft.manifest.spheres if ball.diameter_mm is None})
        if unknown:
            print(f"tell     rgbn init {place}{''.join(unknown)}: diameters, for the lights' positions")
        print(f"next     rgbn process {place}")
    return made


def write_sheet(draft: Draft, record: Record) -> Path:
    """Write the contact sheet into the session's output folder, which is held, and return its path."""
    sheet = record.folder / SHEET
    record.forget(["init"])
    with record.part_of("init"):
        write_png(sheet, contact_sheet(draft))
    return sheet


def write_manifest(draft: Draft) -> Path:
    """Write a draft's session.toml, and return its path. No output folder is held: the file is the user's from then on.

    Raises SceneError, and leaves what was there: the lens is known in part, or what was written cannot be read again.
    """
    manifest, text = draft.folder / MANIFEST, signed(session_text(draft))
    before = manifest.read_bytes() if manifest.is_file() else None
    write_text(manifest, text)
    try:
        load_session(manifest)
    except SceneError:
        manifest.unlink() if before is None else manifest.write_bytes(before)
        raise
    return manifest


def check_layout(folder: Path) -> None:
    """Raise SessionError where a folder needs no session.toml."""
    if (folder / FILENAMES).is_file():
        run = f"rgbn process {shlex.quote(str(folder))}"
        raise SessionError(f"{folder}: is a session in the DiLiGenT layout already. Run: {run}")


def check_free(files: FolderFiles) -> None:
    """Raise SessionError where session.toml is there already and not as rgbn wrote it, or cannot be written."""
    manifest = files.folder / MANIFEST
    own = not manifest.is_symlink() and manifest.is_file()
    if os.path.lexists(manifest) and not (own and is_unedited(manifest.read_bytes().decode("utf-8", "replace"))):
        raise SessionError(
            f"{manifest}: is there already, and is not written over. Correct it by hand, or rename it and run the same "
            "command again."
        )
    if not os.access(files.folder, os.W_OK):
        raise SessionError(f"{files.folder}: cannot be written. Copy the folder to a place of your own.")


def contact_sheet(draft: Draft) -> NDArray[np.uint8]:
    """Return the sheet (H, W, 3), RGB."""
    frames = draft.small
    some = frames.only(slice(None, None, -(-len(frames) // MOST)))
    linear = some.read()
    mean, *pictures = (Exposure.for_picture(one).develop(one) for one in (linear.mean(axis=0), *linear))
    size = WIDTH, round(WIDTH * frames.height / frames.width)
    scene = np.array(cv2.resize(mean, size, interpolation=cv2.INTER_AREA), np.uint8)
    scale = WIDTH / (frames.width * draft.step)
    for number, ball in enumerate(draft.manifest.spheres, 1):
        if not ball.center_px or not ball.radius_px:
            continue
        u, v, radius = (scale * value for value in (*ball.center_px, ball.radius_px))
        colour = COLOURS[ball.kind]
        cv2.circle(scene, (round(16 * u), round(16 * v)), round(16 * radius), colour, 2, cv2.LINE_AA, shift=4)
        size = f", {ball.diameter_mm:g} mm" if ball.diameter_mm else ""
        _write(scene, f"{number} {ball.kind}{size}", u, v - radius - 8, colour)
    _write(scene, f"{draft.folder.name}: mean of the flash frames", 0, 26, (255, 255, 255))
    strip = PictureStrip.of(pictures, [(name[-24:], INK) for name in some.names]).image
    beside = np.full((len(strip), WIDTH - strip.shape[1], 3), PAPER, np.uint8)
    return np.concatenate([scene, np.concatenate([strip, beside], 1)])


def _write(picture: NDArray[np.uint8], text: str, x: float, y: float, colour: tuple[int, int, int]) -> None:
    """Write a text on a dark ground, its middle at x if it is then wholly inside the picture."""
    (width, height), below = cv2.getTextSize(text, cv2.FONT_HERSHEY_SIMPLEX, 0.6, 1)
    x = int(np.clip(x - width / 2, 2, max(picture.shape[1] - width - 2, 2)))
    y = int(np.clip(y, height + 2, picture.shape[0] - below - 2))
    ground = picture[max(y - height - 2, 0) : y + below, max(x - 2, 0) : x + width + 2]
    ground //= 3
    cv2.putText(picture, text, (x, y), cv2.FONT_HERSHEY_SIMPLEX, 0.6, colour, 1, cv2.LINE_AA)
