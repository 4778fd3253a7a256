"""MATLAB's .mat files, 5 to 7.3, read in a process of their own: a single wrong byte can crash their readers."""

import contextlib
import io
import resource
import subprocess
import sys
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from scene.errors import SceneError
from scene.reading import reading, reason

LONGEST_S = 120
MOST_BYTES = 4 << 30
"""Address space of the reading process: the largest maps take a hundredth of it."""


def arrays_of_mat(path: Path, error: type[SceneError] = SceneError) -> dict[str, NDArray]:
    """Return the variables that are numbers, (...) float or int; see `reading`."""
    root = str(Path(__file__).resolve().parents[1])
    script = f"import sys; sys.path.insert(0, {root!r}); import formats.mat_files as m; m.send()"
    with reading(path, "cannot be read as a MATLAB file", error, do="Save it again, with MATLAB or SciPy."):
        try:
            # It has one thread, as `scene` asks: a pool would take more of the address space than the file.
            command = [sys.executable, "-c", script, str(path)]
            done = subprocess.run(command, capture_output=True, timeout=LONGEST_S)
        except subprocess.TimeoutExpired:
            raise ValueError(f"its reader did not come to an end in {LONGEST_S} s") from None
        if done.returncode < 0:
            raise ValueError(f"it crashed its reader with signal {-done.returncode}: the file is damaged")
        if done.returncode:
            raise ValueError(done.stderr.decode(errors="replace").strip().rpartition("\n")[2])
        with np.load(io.BytesIO(done.stdout), allow_pickle=False) as found:
            return {str(name): found[f"arr_{i + 1}"] for i, name in enumerate(found["arr_0"])}


def send() -> None:
    """Write the variables of the file in the first argument to standard output, as .npz."""
    # Where a system has no such limit, the memory is the machine's.
    with contextlib.suppress(OSError, ValueError):
        resource.setrlimit(resource.RLIMIT_AS, (MOST_BYTES, MOST_BYTES))
    try:
        found = _variables(sys.argv[1])
        np.savez(sys.stdout.buffer, np.array(list(found), str), *found.values())
    except Exception as error:
        sys.exit(reason(error))


def _variables(path: str) -> dict[str, NDArray]:
    import h5py

    if h5py.is_hdf5(path):
        with h5py.File(path) as file:
            sets = {name: item for name, item in file.items() if isinstance(item, h5py.Dataset)}
            # MATLAB 7.3 stores columns first: the axes come out reversed.
            return {name: np.asarray(item).T for name, item in sets.items() if item.dtype.kind in "biuf"}
    import scipy.io

    found = scipy.io.loadmat(path).items()
    return {name: item for name, item in found if isinstance(item, np.ndarray) and item.dtype.kind in "biuf"}
