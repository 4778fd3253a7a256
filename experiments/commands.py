"""`rgbn sweep`, `rgbn series` and `rgbn dataset` as the command line has them: what they do is loaded with the work."""

import json as json_module
from dataclasses import asdict
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from lab.options import (
    AS_BEFORE,
    BY_DEFAULT,
    BY_NAME,
    Jobs,
    Json,
    Place,
    Processes,
    Scheduler,
    Settings,
    Solving,
    Staging,
)
from lab.progress import say
from scene.errors import SceneError
from scene.method_names import METHODS


def sweep(
    experiment: Annotated[
        str,
        Parameter(
            help="Experiments, with commas, or all: ambient, interreflection, material, images, noise, ring, "
            "roughness, shadow, specularity; and, with wrong lights, directions, intensities."
        ),
    ],
    /,
    *,
    staging: Annotated[
        Staging,
        Parameter(
            help="one-factor: all else is easy. benchmark: path-traced scenes as in the RGBN benchmark's text, "
            "with levels that span its errors."
        ),
    ] = "one-factor",
    quick: Annotated[bool, Parameter(help="A first look: few levels, one shape, small pictures.", negative="")] = False,
    shape: Annotated[
        str, Parameter(help="Other shapes than the experiments' own, with commas: gyroid, or bear,heart.")
    ] = "",
    method: Annotated[
        str, Parameter(alias="-m", help=f"Methods, with commas: {', '.join(METHODS)}.")
    ] = "ls,rpca,iterative,hsh,ldr,entropy,tv",
    out: Annotated[Path | None, Parameter(alias="-o", help="Output folder. Default: out/sweeps.")] = None,
    processes: Processes = None,
    scheduler: Scheduler = None,
) -> None:
    """Make one factor harder and harder, and show which method breaks where."""
    from experiments.sweeps.sweep import sweep as run_sweep

    folder = run_sweep(
        experiment.casefold(),
        quick=quick,
        staging=staging,
        shape=shape.casefold(),
        method=method,
        out=out,
        processes=processes,
        scheduler=scheduler,
    )
    print(folder / "index.html")


def series(
    folder: Annotated[
        Path,
        Parameter(help='Folder of the sessions. Each session.toml has [series], such as factor = "iso", value = 400.'),
    ],
    /,
    *,
    place: Place = BY_NAME,
    said: Settings = AS_BEFORE,
    scheduler: Scheduler = None,
    jobs: Jobs = 1,
) -> None:
    """Process sessions of one object in which one factor changes. Shows errors against it, real beside synthetic."""
    from experiments.series import series as run_series

    run_series(folder, place, said, jobs=jobs, scheduler=scheduler)


SHELF = Path("out") / "datasets"

Shelf = Annotated[Path, Parameter(help="Folder of the datasets and of their list.")]


def list_datasets(
    pattern: Annotated[
        list[str] | None,
        Parameter(help="Names, patterns such as 'pear-*', or benchmark, which is a list of 93. Default: all."),
    ] = None,
    /,
    *,
    shelf: Shelf = SHELF,
    json: Json = False,
) -> None:
    """List the datasets, and which of them are on the shelf."""
    from experiments.datasets import shelf as on_shelf

    found = on_shelf.entries(shelf)
    if pattern:
        names = {one.name for one in on_shelf.select(found, pattern)}
        found = [one for one in found if one.name in names or one.same_as in names]
    if json:
        print(json_module.dumps([{**asdict(one), "folder": str(one.folder)} for one in found], indent=1))
    else:
        print(on_shelf.listing(found))


def make(
    name: Annotated[
        list[str], Parameter(help="Names, patterns such as 'pear-*', or benchmark, which is a list of 93.")
    ],
    /,
    *,
    shelf: Shelf = SHELF,
    side: Annotated[
        int, Parameter(help="Side of a picture, pixels. A side other than 256 is part of the dataset's name.")
    ] = 256,
    processes: Processes = None,
) -> None:
    """Make datasets in the DiLiGenT layout, with true maps. Keeps what is current."""
    from experiments.catalogue import benchmark_names, catalogue, first_names, wanted
    from experiments.datasets.make import make as make_datasets

    if side < 16:
        raise SceneError(f"--side {side}: expected 16 pixels or more.")
    known = catalogue()
    names = wanted(name, known, benchmark_names(), first_names())
    sized = [one.sized(side) for one in known.values() if one.name in names]
    for folder in make_datasets(shelf, sized, processes=processes):
        print(folder)


def add(
    folder: Annotated[Path, Parameter(help="Folder in the DiLiGenT layout.")],
    /,
    *,
    name: Annotated[str | None, Parameter(help="Its name. Default: the folder's.")] = None,
    text: Annotated[str, Parameter(help="A line that says what it is.")] = "",
    shelf: Shelf = SHELF,
) -> None:
    """Read a dataset's files and note it on the shelf. They stay where they are."""
    from experiments.datasets.shelf import add as add_dataset

    entry = add_dataset(shelf, folder, name=name, text=text)
    print(f"{entry.name}: added, {entry.text}; {entry.folder}")


def run(
    *,
    on: Annotated[
        list[str] | None,
        Parameter(help="Datasets of the shelf, by names, patterns or benchmark. Default: all.", negative=""),
    ] = None,
    said: Solving = BY_DEFAULT,
    shelf: Shelf = SHELF,
    out: Annotated[Path, Parameter(alias="-o", help="Output folder.")] = Path("out") / "datasets-table",
) -> None:
    """Solve datasets of the shelf. Writes a table of angular errors and a gallery."""
    from experiments.datasets.run_methods import results_text
    from experiments.datasets.run_methods import run as run_methods

    rows = run_methods(shelf, on or [], solving=said, out=out)
    print(results_text(rows), end="")
    say(f"gallery: {out / 'index.html'}")
