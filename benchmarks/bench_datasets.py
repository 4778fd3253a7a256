"""How far `rgbn dataset check` can be trusted: alarms on right datasets, and what it says of ones made wrong.

    .venv/bin/python -m benchmarks.bench_datasets [--shelf DIR] [--write]

Makes a few datasets of the catalogue, small, and puts the table into docs/evidence/datasets.md.
"""

import argparse
import re
import shutil
import tempfile
from pathlib import Path

import numpy as np
from scipy.io import loadmat, savemat

from benchmarks.pages import put
from experiments.catalogue import catalogue
from experiments.datasets.check import check_dataset
from experiments.datasets.make import make

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


def turned(name: str, words: str) -> str:
    """Return the pattern of the fault that says how a file's axes are turned: the whole of it, not a part."""
    return re.escape(f"{name}: {words}; expected x right")


WRONG = {
    "lights: x left": (LIGHTS, lambda rows: rows @ FLIP_X, turned(LIGHTS, "x points left")),
    "lights: y down": (LIGHTS, lambda rows: rows @ FLIP_Y, turned(LIGHTS, "y points down")),
    "lights: z away": (
        LIGHTS,
        lambda rows: rows @ FLIP_Z,
        turned(LIGHTS, "z points away from the viewer"),
    ),
    "lights: x and y swapped": (
        LIGHTS,
        lambda rows: rows @ SWAP,
        turned(LIGHTS, "x and y are swapped"),
    ),
    "lights: from the light to the surface": (
        LIGHTS,
        lambda rows: -rows,
        turned(LIGHTS, "they go from the light to the surface"),
    ),
    "normals: y down": (NORMALS, lambda normals: normals @ FLIP_Y, turned(NORMALS, "y points down")),
    "normals: y down, z away": (
        NORMALS,
        lambda normals: normals @ FLIP_Y @ FLIP_Z,
        turned(NORMALS, "y points down and z away from the viewer (OpenCV's frame)"),
    ),
    "normal map mirrored top to bottom": (
        NORMALS,
        lambda normals: normals[::-1],
        re.escape(f"{NORMALS}: the map is mirrored top to bottom against the photographs"),
    ),
    "one intensity doubled": (
        POWER,
        lambda rows: rows * np.where(np.arange(len(rows)) == 2, 2, 1)[:, None],
        rf"{re.escape(POWER)}: .* than given: row 3 by 0\.[45]\d* \(1 is right\)",
    ),
    "two rows of lights exchanged": (
        LIGHTS,
        lambda rows: rows[[1, 0, *range(2, len(rows))]],
        r"filenames\.txt: 2 of .*: 001\.png that of row 2, 002\.png that of row 1\.",
    ),
}
"""What is made wrong, in which file, and how the one fault that is right begins."""


def spoil(folder: Path, name: str, how) -> None:
    path = folder / name
    if name == NORMALS:
        savemat(path, {"Normal_gt": how(loadmat(path)["Normal_gt"])})
    else:
        np.savetxt(path, how(np.loadtxt(path)), fmt="%.8f")


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--shelf", type=Path)
    parser.add_argument("--write", action="store_true")
    wanted = parser.parse_args()
    known = catalogue()
    with tempfile.TemporaryDirectory() as temporary:
        made = make(wanted.shelf or Path(temporary) / "shelf", [known[name].sized(SIDE) for name in HARD])
        verdicts = {folder.name: check_dataset(folder) for folder in made}
        alarms = {name: verdict.faults for name, verdict in verdicts.items() if verdict.faults}
        lines = ["| | named rightly | and nothing else said | passed unseen |", "|---|---|---|---|"]
        for words, (name, how, expected) in WRONG.items():
            right = alone = unseen = 0
            for folder in made:
                place = Path(temporary) / "spoilt"
                shutil.copytree(folder, place, ignore=shutil.ignore_patterns("truth"))
                spoil(place, name, how)
                faults = check_dataset(place).faults
                shutil.rmtree(place)
                named = any(re.match(expected, fault) for fault in faults)
                right, alone, unseen = right + named, alone + (named and len(faults) == 1), unseen + (not faults)
                if not named:
                    print(words, folder.name, *faults, sep="\n    ", flush=True)
            lines.append(f"| {words} | {right} of {len(made)} | {alone} | {unseen} |")
            print(lines[-1], flush=True)
    least = min(float(verdict.facts["agreement"]) for verdict in verdicts.values())
    lines.append("")
    lines.append(
        f"{len(made)} datasets, chosen hard (near, noisy, glossy, shadowed, three lights, lights from one side), "
        f"{SIDE} x {SIDE} pixels, by `benchmarks/bench_datasets.py`. As they are, {len(alarms)} raise an alarm; "
        f"the least agreement with Lambert's law is {least:.2f}."
    )
    for name, faults in alarms.items():
        print("alarm", name, *faults, sep="\n    ")
    print("\n".join(lines))
    if wanted.write:
        put(Path(__file__).parents[1] / "docs" / "evidence" / "datasets.md", "check", "\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
