"""Rows of results: their columns, how they are grouped, and the parquet files that keep them."""

from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from scene.files import write_whole

Row = dict[str, Any]
Rows = list[Row]

ERRORS = {
    "status": "string", "mean_deg": "float64", "median_deg": "float64", "min_deg": "float64", "max_deg": "float64",
    "std_deg": "float64", "q1_deg": "float64", "q3_deg": "float64", "under_5_deg": "float64",
    "under_10_deg": "float64", "pixels": "int64",
}  # fmt: skip
"""Columns of every table of results, and their types."""
KEY = {
    "experiment": "string", "level": "int32", "value": "float64", "label": "string", "shape": "string",
    "seed": "int32", "solver": "string", "profile": "string",
}  # fmt: skip
"""What names a sweep's row."""
KINDS = {
    "flip_deg": "float64", "relief_deg": "float64", "turn_deg": "float64", "tilt_deg": "float64",
    "tilt_spread_deg": "float64", "unanswered": "float64", "frames": "int64", "albedo_error_percent": "float64",
    "doubts": "string",
}  # fmt: skip
RESULTS = KEY | ERRORS | KINDS
"""Columns of a sweep's results.parquet."""
PERTURBED = KEY | {"breaks_at": "float64"} | ERRORS | KINDS
"""Columns of perturbations.parquet; `status` may be "not told": the method does not ask for the quantity."""
SECONDS = KEY | {"seconds": "float64"}
"""Columns of seconds.parquet; `solver` empty: the photographs were made."""
DATASETS = (
    {"dataset": "string", "family": "string", "method": "string", "profile": "string"}
    | ERRORS
    | {"unanswered": "float64", "gaps_90_deg": "float64", "seconds": "float64", "doubts": "string"}
)
"""Columns of the results.parquet of methods on datasets; gaps_90_deg: the mean with 90 degrees for each gap."""


def write_table(path: Path, rows: Rows, columns: dict[str, str]) -> None:
    """Write rows as a parquet file, whole or not at all."""
    import pyarrow
    from pyarrow import parquet

    schema = pyarrow.schema([(name, getattr(pyarrow, kind)()) for name, kind in columns.items()])
    sink = pyarrow.BufferOutputStream()
    parquet.write_table(pyarrow.Table.from_pylist(rows, schema=schema), sink)
    with write_whole(path) as file:
        file.write(sink.getvalue())


def grouped(rows: Rows, *names: str) -> dict[tuple[Any, ...], Rows]:
    """Return rows by their values of some columns, in the order in which these come."""
    groups: dict[tuple[Any, ...], Rows] = {}
    for row in rows:
        groups.setdefault(tuple(row[name] for name in names), []).append(row)
    return groups


def has_failed(row: Row) -> bool:
    """Tell whether a row is without a result by a fault of ours, and not by the method's own word."""
    return str(row["status"]).startswith("failed")


def errors_of(normals: NDArray, truth: NDArray, silent: str) -> Row:
    """Return the columns of `ERRORS`, and `unanswered`, of normals (P, 3) judged by the truth (P, 3).

    silent: what the status begins with where no pixel has a normal.
    """
    from compare.statistics.statistics import angular_statistics
    from scene.normals import angular_error_deg

    numbers = angular_statistics(angular_error_deg(normals, truth))
    status = "ok" if numbers["pixels"] else f"{silent}: no pixel has a normal"
    return {"status": status, **numbers, "unanswered": 1 - int(numbers["pixels"]) / max(len(truth), 1)}
