"""How far `rgbn dataset check` can be trusted: datasets are made wrong on purpose, one thing at a time."""

import shutil
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.io import loadmat, savemat

from benchmarks.harness import Figures, Table, markdown
from experiments.catalogue import catalogue
from experiments.datasets.check import check_dataset
from experiments.datasets.make import make_one

SIDE = 56
HARD = (
    "blob-near-0250", "knot-near-0400", "pear-near-0700", "blob-hand-08", "knot-hand-16", "pear-hand-60",
    "knot-camera-canon-16x", "blob-camera-canon-4x", "blob-camera-diligent", "group-metal", "group-mixed-near",
    "knot-ring-05", "blob-ring-85", "blob-images-03", "knot-images-04", "blob-roughness-0.05", "knot-roughness-0.20",
    "waves-shadow-7.00", "ridges-shadow-2.00", "blob-material-specular-texture", "bowl-interreflection-1.8",
    "blob-ambient-1.00", "knot-noise-0.300",
)  # fmt: skip
"""Near, noisy, glossy, shadowed, few lights, lights from one side."""
LIGHTS, POWER, NORMALS = "light_directions.txt", "light_intensities.txt", "Normal_gt.mat"
FLIP_X, FLIP_Y, FLIP_Z, SWAP = np.diag([-1, 1, 1]), np.diag([1, -1, 1]), np.diag([1, 1, -1]), np.eye(3)[[1, 0, 2]]
WRONG: dict[str, tuple[str, Callable[[np.ndarray], np.ndarray], str]] = {
    "lights: x left": (LIGHTS, lambda rows: rows @ FLIP_X, f"{LIGHTS}: x points left; expected"),
    "lights: y down": (LIGHTS, lambda rows: rows @ FLIP_Y, f"{LIGHTS}: y points down; expected"),
    "lights: z away": (LIGHTS, lambda rows: rows @ FLIP_Z, f"{LIGHTS}: z points away from the viewer; expected"),
    "lights: x and y swapped": (LIGHTS, lambda rows: rows @ SWAP, f"{LIGHTS}: x and y are swapped; expected"),
    "lights: negated": (LIGHTS, np.negative, f"{LIGHTS}: they go from the light to the surface; expected"),
    "normals: y down": (NORMALS, lambda normals: normals @ FLIP_Y, f"{NORMALS}: y points down; expected"),
    "normals: y down, z away": (
        NORMALS, lambda normals: normals @ FLIP_Y @ FLIP_Z,
        f"{NORMALS}: y points down and z away from the viewer (OpenCV's frame); expected",
    ),
    "normal map mirrored": (NORMALS, np.flipud, f"{NORMALS}: the map is mirrored top to bottom against"),
    "one intensity doubled": (
        POWER, lambda rows: rows * np.where(np.arange(len(rows)) == 2, 2, 1)[:, None], "than given: row 3 by 0.",
    ),
    "two rows of lights exchanged": (
        LIGHTS, lambda rows: rows[[1, 0, *range(2, len(rows))]], "001.png that of row 2, 002.png that of row 1.",
    ),
}  # fmt: skip
"""What is made wrong, in which file, and what the one fault that is right says."""
RIGHT = "nothing is wrong"


@dataclass(frozen=True)
class CheckRow:
    """What the check says of one dataset with one thing made wrong."""

    dataset: str
    wrong: str
    is_named: bool
    faults: tuple[str, ...]


def _checked(name: str, *some: str) -> list[CheckRow]:
    with tempfile.TemporaryDirectory() as place:
        dataset, spoilt = catalogue()[name].sized(SIDE), Path(place) / "spoilt"
        make_one(Path(place), dataset)
        folder = Path(place) / dataset.name
        alarms = tuple(check_dataset(folder).faults)
        rows = [CheckRow(name, RIGHT, not alarms, alarms)]
        for wrong in some or WRONG:
            file, how, words = WRONG[wrong]
            shutil.copytree(folder, spoilt, ignore=shutil.ignore_patterns("truth"))
            if file == NORMALS:
                savemat(spoilt / file, {"Normal_gt": how(loadmat(spoilt / file)["Normal_gt"])})
            else:
                np.savetxt(spoilt / file, how(np.loadtxt(spoilt / file)), fmt="%.8f")
            faults = tuple(check_dataset(spoilt).faults)
            shutil.rmtree(spoilt)
            rows.append(CheckRow(name, wrong, any(words in fault for fault in faults), faults))
    return rows


def _verdicts(rows: Sequence[CheckRow]) -> list[dict]:
    found = []
    for wrong in dict.fromkeys(row.wrong for row in rows):
        some = [row for row in rows if row.wrong == wrong]
        alone, unseen = sum(row.is_named and len(row.faults) < 2 for row in some), sum(not row.faults for row in some)
        named = sum(row.is_named for row in some)
        found.append({"wrong": wrong, "count": len(some), "named": named, "alone": alone, "unseen": unseen})
    return found


def _figures(rows: Sequence[CheckRow]) -> Figures:
    return {f"{one['wrong']}: named": one["named"] / one["count"] for one in _verdicts(rows)}


TABLES = (
    Table(
        "datasets", "check", ("experiments.datasets.check",), CheckRow,
        lambda scale: [("blob-images-03", "lights: y down")] if scale == "small"
        else [(name,) for name in (HARD[6:12] if scale == "gates" else HARD)],
        _checked,
        lambda rows: markdown(
            {
                "made wrong": "{wrong}", "named rightly": "{named} of {count}", "and nothing else said": "{alone}",
                "passed unseen": "{unseen}",
            },
            _verdicts(rows),
        ),
        _figures,
    ),
)  # fmt: skip
