"""How far `rgbn dataset check` can be trusted, on datasets and on submissions, and how long the site takes.

    .venv/bin/python -m benchmarks.bench_datasets [check] [site] [--shelf DIR] [--out DIR] [--write]

`check` makes a few datasets of the catalogue, small; `site` makes the benchmark's list and runs all methods on it, as
far as they are not there yet. The tables go into docs/evidence/datasets.md, the families into docs/guide/datasets.md.
"""

import argparse
import re
import shutil
import tempfile
import time
from pathlib import Path

import numpy as np
from scipy.io import loadmat, savemat

from benchmarks.pages import put
from experiments.catalogue import benchmark_names, catalogue
from experiments.datasets.check import check_dataset
from experiments.datasets.make import make
from experiments.datasets.run_methods import run
from experiments.datasets.shelf import entries, families_markdown
from experiments.datasets.site import write_site
from experiments.datasets.submissions import check_submission, dataset_folders
from experiments.stagings import SOLVERS
from lab.options import Solving

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


TURNED = {"as they are": (1, 1, 1), "y down": (1, -1, 1), "z away": (1, 1, -1), "y down, z away": (1, -1, -1)}
"""What is made wrong in all maps of a submission."""
EVERY = 8
"""Of the list, so many datasets apart, are in the submissions whose axes are made wrong."""
TOML = 'method = "Tried"\nauthors = "A"\nsettings = "none"\nhardware = "none"\nseconds = 1\n'


def check_table(shelf: Path, temporary: Path) -> str:
    """Return what the check says of datasets that are made wrong."""
    known = catalogue()
    made = make(shelf, [known[name].sized(SIDE) for name in HARD])
    verdicts = {folder.name: check_dataset(folder) for folder in made}
    alarms = {name: verdict.faults for name, verdict in verdicts.items() if verdict.faults}
    lines = ["| | named rightly | and nothing else said | passed unseen |", "|---|---|---|---|"]
    for words, (name, how, expected) in WRONG.items():
        right = alone = unseen = 0
        for folder in made:
            place = temporary / "spoilt"
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
    return "\n".join(lines) + "\n"


def site_table(shelf: Path, out: Path) -> str:
    """Return how long the site of the benchmark's list takes from results that are there, and how large it is."""
    known = catalogue()
    there = {one.name for one in entries(shelf) if one.state}
    make(shelf, [known[name] for name in benchmark_names() if name not in there])
    rows = run(shelf, ["benchmark"], solving=Solving(",".join(SOLVERS)), out=out)
    start, computed = time.monotonic(), time.process_time()
    site = write_site(shelf, out, rows).parent
    seconds, computed = time.monotonic() - start, time.process_time() - computed
    sizes = {path.name: path.stat().st_size for path in site.iterdir()}
    pages = [size for name, size in sizes.items() if name.endswith(".html")]
    return (
        "| datasets | methods | seconds from results | processor seconds | pages | largest page, MB | site, MB |\n"
        "|---|---|---|---|---|---|---|\n"
        f"| {len({row['dataset'] for row in rows})} | {len(SOLVERS)} | {seconds:.0f} | {computed:.0f} | {len(pages)} | "
        f"{max(pages) / 1e6:.2f} | {sum(sizes.values()) / 1e6:.0f} |\n\n"
        "The benchmark's list, 256 x 256 pixels, one process; the bar is 300 s.\n"
    )


def submission_table(shelf: Path, out: Path, temporary: Path) -> str:
    """Return what the check says of the methods' own results as submissions, as they are and in wrong axes."""
    names = benchmark_names()[::EVERY]
    for name in names:
        no_truth = shutil.ignore_patterns("truth", "Normal_gt.*")
        shutil.copytree(shelf / name, temporary / "public" / name, ignore=no_truth)
    places = {"the truth": dataset_folders(shelf), "least squares": dataset_folders(temporary / "public")}
    lines = ["| maps | held against the truth | held against least squares |", "|---|---|---|"]
    for words, turn in TURNED.items():
        cells = []
        for there in places.values():
            told = 0
            for method in SOLVERS:
                folder = temporary / "submission"
                folder.mkdir()
                (folder / "submission.toml").write_text(TOML)
                for name in names:
                    # A method may have failed.
                    if (answer := out / "work" / name / "normals" / f"{method}.npy").is_file():
                        np.save(folder / f"{name}.npy", np.load(answer) * turn)
                found = check_submission(folder, {name: there[name] for name in names})
                told += bool(found.faults)
                if bool(found.faults) == (turn == (1, 1, 1)):
                    print(words, method, found.faults, found.notes, flush=True)
                shutil.rmtree(folder)
            cells.append(f"{told} of {len(SOLVERS)}")
        lines.append(f"| {words} | {' | '.join(cells)} |")
        print(lines[-1], flush=True)
    said = (
        f"Submissions at fault: {len(SOLVERS)} methods' results on {len(names)} datasets, every {EVERY}th of the list."
    )
    return "\n".join([*lines, "", said]) + "\n"


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("parts", nargs="*", default=["check", "site"])
    parser.add_argument("--shelf", type=Path)
    parser.add_argument("--out", type=Path)
    parser.add_argument("--write", action="store_true")
    wanted = parser.parse_args()
    tables = {}
    with tempfile.TemporaryDirectory() as place:
        temporary = Path(place)
        shelf, out = wanted.shelf or temporary / "shelf", wanted.out or temporary / "out"
        if "check" in wanted.parts:
            tables["check"] = check_table(shelf, temporary)
        if "site" in wanted.parts:
            tables["site"] = site_table(shelf, out)
            print(tables["site"], flush=True)
            tables["submissions"] = submission_table(shelf, out, temporary)
        families = families_markdown(entries(temporary / "none"))
    print("\n".join(tables.values()))
    if wanted.write:
        docs = Path(__file__).parents[1] / "docs"
        for name, text in tables.items():
            put(docs / "evidence" / "datasets.md", name, text)
        put(docs / "guide" / "datasets.md", "families", families)


if __name__ == "__main__":
    main()
