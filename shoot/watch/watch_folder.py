"""`rgbn watch`: photographs taken as they come, judged at once, and a session in the end."""

import math
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

from capture.hot_folder.hot_folder import HotFolder
from capture.hot_folder.ledger import Ledger
from capture.hot_folder.tracker import ALONE_S
from capture.photographs.kept import kept_folder
from capture.session.globs import kind_of
from capture.survey.folder_files import files_below
from lab.progress import say
from lab.run import run_session
from lab.run_log import logged
from lab.session_place import default_out, note_session
from scene.origin import Origin
from scene.output_folder import open_record
from shoot.init.answers import Answers, Asking
from shoot.init.draft_notes import notes_of
from shoot.init.init_session import write_session
from shoot.watch.alarm import Alarm
from shoot.watch.screen import Screen, screen_for
from shoot.watch.session_end import check_folder, draft_of_shoot, left_out, note_manifest
from shoot.watch.shoot import Shoot
from shoot.watch.status import write_status
from shoot.watch.take import Taken, Taking


def whole_photographs(folder: Path) -> tuple[Path, ...]:
    """Return the photographs of a folder that no program writes to: half of one has other contents later."""
    latest = time.time() - ALONE_S
    return tuple(file for file in files_below(folder) if kind_of(file) and _written(file) < latest)


def _written(file: Path) -> float:
    """Return when a file was last written to; never ending for one that is gone meanwhile."""
    try:
        return file.stat().st_mtime
    except OSError:
        return math.inf


def watch_folder(
    folder: Path,
    out: Path | None,
    answers: Answers,
    alarm: Alarm,
    *,
    until_idle_s: float | None = None,
    wanted_deg: float = 1.0,
    clock: Callable[[], float] = time.monotonic,
) -> None:
    """Watch a folder until Ctrl-C, or until no photograph has come for a while; then write its session, and decode it.

    Parameters
    ----------
    folder : Path
        Where the camera's program writes.
    out : Path, optional
        Output folder; outside of `folder`. Default: out/NAME here, by the folder's name.
    answers : Answers
        Camera and balls, as `init` is told them.
    alarm : Alarm
    until_idle_s : float, optional
        Seconds without a new photograph after which the shoot is over. Default: it ends on Ctrl-C.
    wanted_deg : float
        Sigma of the normals that is good enough.

    Raises
    ------
    SceneError
        The folder is not there, it has a session.toml of another's, `out` lies in it or is another's; in the end too
        few photographs make no session.
    """
    folder = folder.resolve()
    check_folder(folder)
    asking = Asking(answers, silent=True)
    origin = Origin("session", folder, whole_photographs(folder))
    out = out or default_out(origin, folder.name)
    with open_record(out, origin=origin, input_folders=[folder]) as record, logged(record), alarm:
        ledger = Ledger(record.scratch("watch") / "ledger.json")
        check_folder(folder, record)
        shoot = Shoot(folder, asking)
        # By it the studio knows the folder, before there is a session.
        note_session(record, folder)
        with (
            HotFolder(folder, ledger.whole, clock=clock) as hot,
            screen_for(shoot, record.folder, wanted_deg) as screen,
        ):
            taking = Taking(hot, ledger, kept_folder(record.folder), shoot, asking)

            def tell(taken: Taken, start: float) -> None:
                for text in taken.notes:
                    screen.note(text)
                warnings = list(taken.warnings)
                if taken.shots:
                    for verdict in shoot.add(taken.shots, start):
                        screen.verdict(verdict)
                        warnings += verdict.warnings
                for text in warnings:
                    screen.warn(text)
                    alarm.warn(text)

            say(f"watching {folder}; Ctrl-C ends the shoot and writes its session")
            with suppress(KeyboardInterrupt):
                tell(taking.resume(), clock())
                _loop(hot, taking, shoot, screen, tell, alarm, until_idle_s)
        say("the shoot is over")
        write_status(record.folder, shoot, screen.warnings, wanted_deg, is_over=True)
        notes = [*left_out(shoot.sorted, shoot.shots), *taking.unreadable.values()]
        draft = draft_of_shoot(folder, shoot.sorted, asking, shoot.lights_so_far.balls, notes)
    made = write_session(draft, out)
    with open_record(out, input_folders=[folder]) as record:
        note_manifest(record, made.manifest)
    for note in notes_of(draft):
        say(f"note: {note}")
    say(f"written  {made.manifest}")
    run_session(folder, "check", out=out)
    say(f"next     rgbn process {folder} --out {out}")


def _loop(
    hot: HotFolder,
    taking: Taking,
    shoot: Shoot,
    screen: Screen,
    tell: Callable[[Taken, float], None],
    alarm: Alarm,
    until_idle_s: float | None,
) -> None:
    clock = hot.clock
    last, judged, was_there = clock(), -1, True
    while True:
        files = hot.whole()
        if hot.is_there != was_there:
            was_there = hot.is_there
            screen.note("the folder is there again" if was_there else "the folder is gone; waiting for it to return")
        now = clock()
        if files:
            tell(taking.take(files), now)
            last = clock()
            continue
        if judged != len(shoot.verdicts):
            judged = len(shoot.verdicts)
            for warnings in shoot.follow():
                for text in warnings:
                    screen.warn(text)
                    alarm.warn(text)
                # A photograph that came meanwhile goes first.
                if hot.whole():
                    judged = -1
                    break
            else:
                shoot.look_at_object()
            screen.refresh(clock() - now)
            continue
        if until_idle_s is not None and now - last > until_idle_s and not hot.is_waiting:
            return
        hot.wait()
