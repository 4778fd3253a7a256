"""`rgbn dataset make`: what is missing is rendered, one dataset a core, written beside its place and renamed."""

import os
import shutil
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

from lab.datasets.catalogue import Dataset
from lab.datasets.checksums import FILE
from lab.datasets.write import mark_in, mark_of, write_dataset
from lab.job import locked
from lab.progress import progress_bar, say
from lab.sweeps.workers import run_here
from scene.errors import SceneError


def make(shelf: Path, datasets: Sequence[Dataset], *, processes: int | None = None) -> list[Path]:
    """Make the datasets that are not on the shelf yet, or not by this recipe and code.

    Parameters
    ----------
    shelf : Path
        Each becomes a folder of its name in there, whole or not at all.
    datasets : sequence of Dataset
    processes : int, optional
        Default: one a core.

    Returns
    -------
    list of Path
        All of their folders.

    Raises
    ------
    SceneError
        What could not be made, and why, after all others have been; or a folder of that name that rgbn did not make.
    """
    for one in datasets:
        folder = shelf / one.name
        if folder.exists() and mark_in(folder) is None:
            raise SceneError(
                f"{folder}: is there already, and is not a dataset that rgbn made. Move it away, or choose another "
                "--shelf."
            )
    with locked(shelf):
        missing: list[Any] = [one for one in datasets if not is_current(shelf, one)]
        outdated = [one.name for one in missing if (shelf / one.name).exists()]
        if outdated:
            say(f"{len(outdated)} made anew, their recipe or the code has changed: {', '.join(outdated[:5])} ...")
        if missing:
            _make(shelf, missing, min(processes or os.cpu_count() or 1, len(missing)))
    return [shelf / one.name for one in datasets]


def is_current(shelf: Path, dataset: Dataset) -> bool:
    """Whether a dataset is on the shelf as this recipe and code make it."""
    folder = shelf / dataset.name
    return (folder / FILE).exists() and mark_in(folder) == mark_of(dataset)


def _make(shelf: Path, missing: list[Any], processes: int) -> None:
    failed: list[str] = []
    work: Any = partial(make_one, shelf)
    with progress_bar("datasets") as report:
        report(0, len(missing))
        made: Any = run_here(missing, work, processes=processes)
        for done, (one, why) in enumerate(made, 1):
            if why is not None:
                failed.append(f"{one.name}: {why}")
            report(done, len(missing))
    if failed:
        raise SceneError(f"{len(failed)} of {len(missing)} datasets could not be made:\n  " + "\n  ".join(failed))


def make_one(shelf: Path, dataset: Dataset) -> str | None:
    """Make one dataset, in a process of its own; return why not, if the input is at fault."""
    from multiprocessing import parent_process

    if parent_process() is not None:
        import cv2
        import drjit

        # Its neighbours have the other cores. (Writing an EXR has asked for a second thread.)
        cv2.setNumThreads(1)
        drjit.set_thread_count(1)
    folder, name = shelf / dataset.name, dataset.name
    unfinished, old = shelf / f".{name}.part", shelf / f".{name}.old"
    try:
        for rest in (unfinished, old):
            shutil.rmtree(rest, ignore_errors=True)
        write_dataset(unfinished, dataset)
        if folder.exists():
            folder.rename(old)
        unfinished.rename(folder)
        shutil.rmtree(old, ignore_errors=True)
    except SceneError as error:
        return " ".join(str(error).split())
    finally:
        shutil.rmtree(unfinished, ignore_errors=True)
    return None
