"""`rgbn sweep` as the command line has it."""

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter


def sweep(
    experiment: Annotated[
        str,
        Parameter(
            help="ambient, interreflection, material, images, noise, ring, roughness, shadow, specularity; some, with "
            "commas; or all."
        ),
    ],
    /,
    *,
    quick: Annotated[bool, Parameter(help="A first look: few levels, one shape, small pictures.", negative="")] = False,
    method: Annotated[str, Parameter(help="Methods, with commas.")] = "ls,rpca,iterative,hsh,ldr,entropy,tv",
    out: Annotated[Path | None, Parameter(help="Output folder. Default: out/sweeps here.")] = None,
    processes: Annotated[int | None, Parameter(help="How many abreast. Default: one a core.")] = None,
    scheduler: Annotated[
        str | None, Parameter(help="Address of a Dask scheduler; default: this machine's cores.")
    ] = None,
) -> None:
    """Make one factor harder and harder, and see which method breaks where: tables, charts and a page."""
    from experiments.sweeps.sweep import sweep as run_sweep

    folder = run_sweep(experiment, quick=quick, method=method, out=out, processes=processes, scheduler=scheduler)
    print(folder / "index.html")
