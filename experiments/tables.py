"""Rows of results: their columns, the parquet files that keep them, and what they say of each method."""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scene.files import write_whole

Row = dict[str, Any]
Rows = list[Row]
Results = Any
"""A pandas DataFrame of rows, see `results`; a checker of types cannot make much of pandas'."""

GAP_DEG = 90.0
"""Error that a pixel without a normal counts as, where it counts."""
BREAKS_DEG = 10.0
"""Median angular error past which a method counts as broken."""
ERRORS = {
    "status": "string", "mean_deg": "float64", "median_deg": "float64", "min_deg": "float64", "max_deg": "float64",
    "std_deg": "float64", "q1_deg": "float64", "q3_deg": "float64", "under_5_deg": "float64",
    "under_10_deg": "float64", "pixels": "int64", "filled_deg": "float64", "unanswered": "float64", "doubts": "string",
}  # fmt: skip
"""Columns of every table of results, and their types."""
KEY = {
    "experiment": "string", "level": "int32", "value": "float64", "label": "string", "shape": "string",
    "seed": "int32", "solver": "string", "profile": "string",
}  # fmt: skip
"""What names a sweep's row."""
RESULTS = KEY | ERRORS | {"flip_deg": "float64", "frames": "int64", "albedo_error_percent": "float64"}
"""Columns of a sweep's results.parquet."""
SECONDS = KEY | {"seconds": "float64"}
"""Columns of seconds.parquet; `solver` empty: the photographs were made."""
DATASETS = (
    {"dataset": "string", "family": "string", "method": "string", "profile": "string"} | ERRORS | {"seconds": "float64"}
)
"""Columns of the results of methods on datasets."""


def write_table(path: Path, rows: Rows, columns: dict[str, str]) -> None:
    """Write rows as a parquet file, whole or not at all."""
    import pyarrow
    from pyarrow import parquet

    schema = pyarrow.schema([(name, getattr(pyarrow, kind)()) for name, kind in columns.items()])
    sink = pyarrow.BufferOutputStream()
    parquet.write_table(pyarrow.Table.from_pylist(rows, schema=schema), sink)
    with write_whole(path) as file:
        file.write(sink.getvalue())


def results(rows: Rows) -> Results:
    """Return a sweep's rows as a table, NaN where a row has no number, with three columns more.

    is_ok: it has a result. has_failed: it has none by a fault of ours, not by the method's own word. is_broken: no
    answer, or a median error past `BREAKS_DEG`, or no normal for half of the object.
    """
    from pandas import DataFrame

    table = DataFrame(rows, columns=[*RESULTS])
    table = table.astype({name: float for name in RESULTS if name.endswith(("_deg", "_percent"))})
    table["is_ok"], table["has_failed"] = table["status"] == "ok", table["status"].str.startswith("failed")
    table["is_broken"] = ~table["is_ok"] | (table["median_deg"] > BREAKS_DEG) | (table["unanswered"] > 0.5)
    return table


def errors_of(normals: NDArray, truth: NDArray, silent: str) -> Row:
    """Return the columns of `ERRORS` of normals (P, 3) judged by the truth (P, 3), but `doubts`.

    silent: what the status begins with where no pixel has a normal. filled_deg: the mean with `GAP_DEG` for a pixel
    without a normal; the others are over the pixels that have one. unanswered: share of the pixels that have none.
    """
    from compare.statistics.statistics import angular_statistics
    from scene.normals import angular_error_deg

    error = angular_error_deg(normals, truth)
    numbers = angular_statistics(error)
    status = "ok" if numbers["pixels"] else f"{silent}: no pixel has a normal"
    filled = {"filled_deg": float(np.nan_to_num(error, nan=GAP_DEG).mean()) if len(truth) else GAP_DEG}
    return {"status": status, **numbers, **filled, "unanswered": 1 - int(numbers["pixels"]) / max(len(truth), 1)}


def why(error: Exception) -> str:
    """Return an error in one line: an input's as it is told, others with their kind."""
    from scene.errors import SceneError

    text = " ".join(str(error).split())
    return text if isinstance(error, SceneError) else f"{type(error).__name__}: {text}"
