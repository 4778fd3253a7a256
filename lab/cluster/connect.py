"""A Dask scheduler, asked for: its executor, and a folder for arrays that its workers see."""

import logging
import shutil
import tempfile
import warnings
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from lab.cluster.executor import Cluster
from scene.current import blocks_digest
from scene.errors import ClusterError, SceneError


@contextmanager
def executor_of(address: str | None, folder: Path | None = None, files: Iterable[Path] = ()) -> Iterator[Any]:
    """Hold the executor of a Dask scheduler for a block; None for threads here.

    Parameters
    ----------
    address : str or None
        Of the scheduler.
    folder : Path or None
        For files that all workers see under the same path; emptied. It lies in the output folder. None: the units write
        no files, and their arrays are small.
    files : iterable of Path
        What the workers must see besides.

    Raises
    ------
    ClusterError
        No scheduler answers; there is no worker for `WAIT_FOR_WORKERS`; a worker has other code or libraries, or does
        not see the files. From a unit within the block: the same, or the scheduler was lost; `WorkerDied`, where one
        worker after the other dies of it.
    """
    if address is None:
        yield None
        return
    from distributed import Client, versions

    # What Dask would say of a lost scheduler, and of versions, is said here, once.
    for name in ("distributed", "distributed.client", "distributed.core", "distributed.comm"):
        logging.getLogger(name).setLevel(logging.CRITICAL)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", versions.VersionMismatchWarning)
        try:
            client = Client(address, timeout=10, set_as_default=False)
        except (OSError, ValueError) as error:
            raise ClusterError(
                f"--scheduler {address}: no Dask scheduler answers there ({error}). Start one with `dask scheduler`, "
                "or leave --scheduler out to work on this computer."
            ) from error
    with client, _shared_folder(folder, files) as shared:
        cluster = Cluster(client, address, shared)
        try:
            cluster.check_workers()
            yield cluster
        finally:
            cluster.shutdown()


@contextmanager
def _shared_folder(folder: Path | None, files: Iterable[Path]) -> Iterator[Path | None]:
    """Make a folder for arrays, for a block; list there what a worker must see."""
    if folder is None:
        yield None
        return
    # Of a run that was killed: only one at a time is at work in an output folder.
    shutil.rmtree(folder, ignore_errors=True)
    try:
        folder.mkdir(parents=True)
        shared = Path(tempfile.mkdtemp(dir=folder.resolve()))
    except OSError as error:
        raise SceneError(
            f"{folder}: cannot be written ({error.strerror}). Choose another folder with --out."
        ) from error
    try:
        seen = sorted({path.resolve() for path in files if path.is_file()})
        shared.joinpath("files").write_text("".join(f"{blocks_digest(path)} {path}\n" for path in seen))
        yield shared
    finally:
        shutil.rmtree(shared, ignore_errors=True)
