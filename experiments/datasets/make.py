"""`rgbn dataset make`: what is missing is rendered, one dataset a core, written apart and moved to its place."""

import shutil
from collections.abc import Sequence
from functools import partial
from pathlib import Path

from experiments.datasets.write import mark_of, write_dataset
from experiments.photographs import one_thread
from experiments.recipe import Dataset
from experiments.workers import run_all
from lab.progress import progress_bar, say
from scene.errors import SceneError
from scene.files import move
from scene.output_folder import open_record
from scene.record import Record


def make(shelf: Path, datasets: Sequence[Dataset], *, processes: int | None = None) -> list[Path]:
    """Make the datasets that are not on the shelf yet, or not by this recipe and code; return all of their folders.

    Each becomes a folder of its name; what counts as made is whole. SceneError: what could not be made, and why, after
    all others have been; or a folder of that name that rgbn did not make.
    """
    with open_record(shelf, origin="shelf of datasets") as record:
        for one in datasets:
            folder = shelf / one.name
            if folder.exists() and not record.files_of(one.name):
                raise SceneError(
                    f"{folder}: is there already, and is not a dataset that rgbn made. Move it away, or choose another "
                    "--shelf."
                )
        missing = [one for one in datasets if not record.is_current(one.name, mark_of(one))]
        outdated = [one.name for one in missing if (shelf / one.name).exists()]
        if outdated:
            say(f"{len(outdated)} made anew, their recipe or the code has changed: {', '.join(outdated[:5])} ...")
        if missing:
            _make(record, missing, processes)
    return [shelf / one.name for one in datasets]


def _make(record: Record, missing: list[Dataset], processes: int | None) -> None:
    failed, unfinished = [], record.scratch("datasets")
    with progress_bar("datasets") as report:
        report(0, len(missing))
        for done, (one, why) in enumerate(run_all(missing, partial(make_one, unfinished), processes=processes), 1):
            if why is None:
                with record.making(one.name, mark_of(one)):
                    move(unfinished / one.name, record.folder / one.name)
            else:
                failed.append(f"{one.name}: {why}")
            report(done, len(missing))
    if failed:
        raise SceneError(f"{len(failed)} of {len(missing)} datasets could not be made:\n  " + "\n  ".join(failed))


def make_one(unfinished: Path, dataset: Dataset) -> str | None:
    """Make one dataset in a folder of its name, in a process of its own; return why not, if the input is at fault."""
    folder = unfinished / dataset.name
    shutil.rmtree(folder, ignore_errors=True)
    try:
        with one_thread():
            write_dataset(folder, dataset)
    except SceneError as error:
        return " ".join(str(error).split())
    return None
