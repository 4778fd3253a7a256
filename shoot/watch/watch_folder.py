"""`rgbn watch`: photographs taken as they come, judged at once, and a session in the end.

The state of a shoot is told in words, and as a file and a picture of sigma that the studio shows while it goes on.
"""

import signal
import sys
import threading
import time
from collections.abc import Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from capture.photographs.kept import kept_folder
from capture.session.globs import kind_of
from capture.survey.folder_files import FEWEST, FolderFiles, files_below, sorted_files
from capture.survey.hot_folder import ALONE_S, HotFolder, list_photographs
from compare.report.pictures import error_picture, with_colour_scale
from lab.progress import logged, say
from lab.run import run_session
from lab.session_place import default_out, note_session
from scene.current import look_of
from scene.errors import SessionError
from scene.files import write_json, write_png
from scene.origin import Origin
from scene.output_folder import open_record, record_for
from shoot.init.answers import Answers, Asking
from shoot.init.draft import Draft, notes_of
from shoot.init.init_session import check_free, check_layout, write_manifest, write_sheet
from shoot.init.prepare import prepare
from shoot.plan.run_plan import clock
from shoot.watch.shoot import Shoot
from shoot.watch.taken import Taken

EVERY_S = 0.5
"""A folder is listed so often; one that is slow to list, half of the time."""
STATUS, MAP = "watch.json", "watch-sigma.png"


class Screen:
    """What the photographer and the studio see.

    Parameters
    ----------
    shoot : Shoot
    out : Path
        Output folder.
    wanted_deg : float
        Sigma of the normals that is good enough.
    """

    def __init__(self, shoot: Shoot, out: Path, wanted_deg: float) -> None:
        self._shoot, self._out, self._wanted_deg = shoot, out, wanted_deg
        self._warnings: list[str] = []
        self._said: list[str] = []

    def note(self, text: str) -> None:
        """Say what happened."""
        say(f"  {text}")

    def warn(self, text: str) -> None:
        """Say a warning, with the terminal's bell."""
        self._warnings.append(text)
        bell = "\a" if sys.stderr.isatty() else ""
        say(f"{bell}warning: {text}", always=True)

    def renew(self, *, is_over: bool = False) -> None:
        """Say what is known by now, and write watch.json, and watch-sigma.png where the normals are known."""
        shoot, record, known = self._shoot, record_for(self._out / STATUS), None
        assert record is not None
        with record.part_of("watch"):
            if shoot.sigma_deg is not None:
                sigma = shoot.sigma_deg[np.isfinite(shoot.sigma_deg)]
                known = {
                    "sigma_deg_median": float(np.median(sigma)),
                    "wanted_deg": self._wanted_deg,
                    "share_under_wanted": float(np.mean(sigma < self._wanted_deg)),
                    "next_flash": shoot.next_flash,
                }
                end = 2 * self._wanted_deg
                scaled = with_colour_scale(error_picture(shoot.sigma_deg, end), end, "sigma of the normals")
                write_png(self._out / MAP, scaled)
            lights, ambient = shoot.lights.facts() if shoot.lights else None, len(shoot.roles["ambient"])
            lines = state_lines(shoot, known)
            status = {"flash": len(shoot.flash), "ambient": ambient, "warnings": self._warnings, "told": lines}
            write_json(self._out / STATUS, {"is_over": is_over, **status, "lights": lights, "normals": known})
        # What is as it was need not be said again.
        for line in [] if is_over else [line for line in lines if line not in self._said]:
            self.note(line)
        self._said = lines


def state_lines(shoot: Shoot, known: dict[str, Any] | None) -> list[str]:
    """Return what is known by now, in lines; `known`: `normals` of watch.json."""
    count = len(shoot.flash)
    lines = [f"{count} flash frame{'s' * (count != 1)}, {len(shoot.roles['ambient'])} ambient"]
    light = shoot.light_of(shoot.newest) if shoot.newest else None
    lines += [f"{shoot.newest.name}: flash at {place_text(light)}"] if shoot.newest and light else []
    if shoot.lights is None:
        return [*lines, f"lights: not known yet; {shoot.why}"]
    lines.append(f"lights: {shoot.lights!r}")
    if known is None:
        return [*lines, f"normals: not known yet; {shoot.why}"]
    sigma, wanted, following = known["sigma_deg_median"], known["wanted_deg"], known["next_flash"]
    lines.append(
        f"normals: sigma {sigma:.2g} degrees (median), {known['share_under_wanted']:.0%} of the object under {wanted:g}"
    )
    if sigma <= wanted:
        return [*lines, f"enough: the median sigma is under {wanted:g} degrees"]
    return [*lines, f"next flash: {place_text(following)}: sigma to {following['sigma_deg']:.2g} degrees"]


def place_text(light: dict[str, Any]) -> str:
    """Return where a flash stands, in words; `light`: a row of `Lights.facts`."""
    away = f", {light['distance_mm']:.0f} mm away" if light["distance_mm"] is not None else ""
    sigma = light.get("direction_sigma_deg")
    known = "" if sigma is None else f" (to {sigma:.2g})"
    return f"{light['zenith_deg']:.0f} degrees from the axis{known} at {clock(light['azimuth_deg'])} o'clock{away}"


def whole_photographs(folder: Path) -> tuple[Path, ...]:
    """Return the photographs of a folder that no program writes to: half of one has other contents later."""
    latest = 1e9 * (time.time() - ALONE_S)
    files = [(file, look_of(file)) for file in files_below(folder) if kind_of(file)]
    return tuple(file for file, look in files if look is not None and look.mtime_ns < latest)


def watch_folder(
    folder: Path, *, out: Path | None, until_idle: float | None, told: Answers, wanted_deg: float = 1.0
) -> None:
    """Watch a folder until it is ended, or no photograph has come for a while; then write its session, and decode it.

    Ctrl-C ends it, and SIGTERM, as services send it; another one costs nothing until session.toml is written.

    For its parameters see `shoot.shoot_commands.watch`.

    Raises SceneError: the folder is not there, it has a session.toml of another's, `out` lies in it or is another's; in
    the end too few photographs make no session.
    """
    folder = folder.resolve()
    if not folder.is_dir():
        lacks = "is no folder" if folder.exists() else "there is no such folder"
        raise SessionError(f"{folder}: {lacks}. Give the folder that the camera's program writes into.")
    check_layout(folder)
    # In the end session.toml is written; one that rgbn wrote and nobody has changed is written anew.
    check_free(FolderFiles(folder))
    asking = Asking(told, silent=True)
    origin = Origin("session", folder, whole_photographs(folder))
    out = out or default_out(origin, folder.name)
    with ExitStack() as until_written:
        with open_record(out, origin=origin, input_folders=[folder]) as record, logged(record):
            # By it the studio knows the folder, before there is a session.
            note_session(record, folder)
            shoot = Shoot(folder, asking)
            screen = Screen(shoot, out, wanted_deg)
            taken = Taken(folder, kept_folder(record.folder), asking, screen.note, screen.warn)
            is_ended = until_written.enter_context(_ended_by_signals())
            say(f"watching {folder}; Ctrl-C ends the shoot and writes its session")
            _loop(folder, taken, shoot, screen, until_idle, is_ended)
            say("the shoot is over; writing its session ...")
            screen.renew(is_over=True)
            draft = _draft_of(folder, shoot, told, taken)
            # What stood there first, perhaps an ambient frame alone, is no longer what tells the session from others.
            Origin("session", folder, tuple(shot.path for shot in taken.shots.values())).claim(record, out)
            write_sheet(draft, record)
        manifest = write_manifest(draft)
    for note in notes_of(draft):
        say(f"note: {note}")
    say(f"written  {manifest}")
    run_session(folder, "check", out=out)
    say(f"next     rgbn process {folder} --out {out}")


@contextmanager
def _ended_by_signals() -> Iterator[threading.Event]:
    """Yield what Ctrl-C and SIGTERM set: within the block they stop nothing."""
    is_ended, before = threading.Event(), {}
    if threading.current_thread() is threading.main_thread():
        for number in (signal.SIGINT, signal.SIGTERM):
            # In the background of a shell Ctrl-C is another program's.
            if signal.getsignal(number) != signal.SIG_IGN:
                before[number] = signal.signal(number, lambda *_: is_ended.set())
    try:
        yield is_ended
    finally:
        for number, handler in before.items():
            signal.signal(number, handler or signal.SIG_DFL)


def _loop(
    folder: Path, taken: Taken, shoot: Shoot, screen: Screen, until_idle_s: float | None, is_ended: threading.Event
) -> None:
    hot, last, is_followed, was_there = HotFolder(), time.monotonic(), True, True
    following: Future[list[str]] | None = None
    # Beside: a new photograph is judged at once, whatever is still computed of those before.
    with ThreadPoolExecutor(1) as beside:
        while not is_ended.is_set():
            start = time.monotonic()
            files = hot.see(list_photographs(folder), start)
            listed_s = time.monotonic() - start
            if hot.is_there != was_there:
                was_there = hot.is_there
                gone = "the folder is gone; waiting for it to return"
                screen.note("the folder is there again" if was_there else gone)
            fresh, is_changed = taken.renew(files, start)
            warnings: list[str] = []
            if is_changed:
                warnings = shoot.judge(list(taken.shots.values()))
                for shot in fresh:
                    say(f"{shot.name}: {shoot.role_of(shot)} ({time.monotonic() - start:.1f} s)")
                is_followed, last = False, time.monotonic()
            elif following is None and not is_followed:
                is_followed = True
                if shoot.frames is not None:
                    what = shoot.frames, list(shoot.flash), list(shoot.roles["ambient"])
                    following = beside.submit(shoot.follow, *what)
                else:
                    screen.renew()
            elif (
                until_idle_s is not None
                and start - last > until_idle_s
                and not (following or hot.is_growing or taken.is_waiting)
            ):
                return
            else:
                is_ended.wait(max(EVERY_S, listed_s))
            if following is not None and following.done():
                warnings, following = [*warnings, *shoot.new(following.result())], None
                screen.renew()
            for text in warnings:
                screen.warn(text)


def _draft_of(folder: Path, shoot: Shoot, answers: Answers, taken: Taken) -> Draft:
    """Return what a shoot is, as `init` would have found it.

    Raises SessionError: too few photographs show the flash.
    """
    used = {shot.path for some in shoot.roles.values() for shot in some if shot.path.is_file()}
    count = sum(shot.path in used for shot in shoot.flash)
    if count < FEWEST:
        raise SessionError(
            f"{folder}: {count} photographs show the flash; a session needs {FEWEST} or more, and none was "
            "written. Shoot more, and run the same command again: what was taken is kept."
        )
    shots = taken.shots.values()
    lost = {one.name: shoot.left_out.get(one.digest) for one in shots if one.path not in used}
    # Files that were never read must have no say in which of two kinds is kept.
    files = sorted_files([path for path in files_below(folder) if kind_of(path) is None or path in used], folder)

    def prepared(answers: Answers) -> Draft:
        draft = prepare(files, Asking(answers, silent=True), [one.small for one in shots], shoot.balls)
        return draft.noting(*(f"{name}: {text}" for name, text in lost.items() if text), *taken.unreadable)

    try:
        return prepared(answers)
    except SessionError as error:
        # The shoot is over: a diameter that does not fit is put right in session.toml.
        say(f"warning: {error}", always=True)
        return prepared(replace(answers, chrome=(), white=())).noting(str(error))
