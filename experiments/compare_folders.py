"""`rgbn compare ONE OTHER`: two processed folders: do the methods fail alike, and did the object change in between?"""

import json as json_module
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lab.options import named
from lab.progress import is_quiet, log, logged, say
from scene.current import libraries
from scene.errors import SceneError
from scene.files import write_json
from scene.origin import Origin
from scene.output_folder import open_record, own_folder
from scene.store import Store

Map = NDArray[np.float32]

NUMBERS = "counterparts.json"


@dataclass(frozen=True)
class Folder:
    """A folder that `process` has left, or the twin in it, and each method's error map (H, W) as `compare` wrote it."""

    store: Store
    kind: str  # "photographs" or "rendering"
    name: str  # the session's
    errors: dict[str, Map]


def compare_folders(
    real: Path, twin: Path, out: Path | None = None, *, methods: str | None = None, json: bool = False
) -> dict[str, Any]:
    """Compare two processed folders, and write counterparts.json; of a scanned object its change.

    Parameters
    ----------
    real, twin : Path
        Output folders of `process`; or one, and the `twin` in it.
    out : Path or None
        Default: out/REAL-against-TWIN.
    methods : str or None
        Names with commas; default: all that are in both.
    json : bool
        Print the numbers as JSON.

    Returns
    -------
    dict
        Of `compare.statistics.counterparts.compare_counterparts`, with name, created, versions, captures: name and
        kind of each; and change: see `experiments.before_after.tell_change`, or None.

    Raises
    ------
    SceneError
        A folder has no errors, a method asked for is not in both, or the two have none in common.
    """
    from compare.statistics.counterparts import compare_counterparts

    folders = {"real": open_folder(real), "twin": open_folder(twin)}
    common = _common((folders["real"], folders["twin"]), methods)
    origin = Origin(f"comparison with {twin.resolve()} of", real.resolve())
    folder = out or own_folder(Path("out") / f"{real.resolve().name}-against-{twin.resolve().name}", origin)
    with open_record(folder, origin=origin, input_folders=[real, twin]) as record, logged(record):
        place = Store(record.folder)
        say(f"compare {real} with {twin}: {', '.join(common)}")
        found = {
            "name": f"{folders['real'].name} against {folders['twin'].name}",
            "created": datetime.now(UTC).isoformat(timespec="seconds"),
            "versions": libraries(),
            "captures": {kind: {"name": one.name, "kind": one.kind} for kind, one in folders.items()},
            **compare_counterparts(*({name: one.errors[name] for name in common} for one in folders.values())),
            "change": _change((folders["real"], folders["twin"]), common, place),
        }
        write_json(place.path(NUMBERS), found)
        log(told(found))
    if json:
        print(json_module.dumps(place.read_json(NUMBERS), indent=1))
    elif not is_quiet():
        print(told(found))
        print(place.path(NUMBERS))
    return found


def told(found: dict[str, Any]) -> str:
    """Return the verdict and a line a method."""
    lines = [f"{found['name']}: {found['verdict']}"]
    for name, row in found["methods"].items():
        r = "no correlation" if row["pearson"] is None else f"r = {row['pearson']:.2f}"
        real, twin = (row[kind]["median_deg"] for kind in ("real", "twin"))
        ends = (row[f"median_difference_{end}_deg"] for end in ("low", "high"))
        between = " to ".join("unknown" if end is None else f"{end:.2f}" for end in ends)
        lines.append(f"  {name}: {row['likeness']}: {r}, medians {real:.2f} and {twin:.2f} degrees, {between} apart")
    if not found["laid_over"]:
        lines.append("  the two do not show the object at the same pixels: their maps cannot be laid over each other")
    if found["change"]:
        lines.append(f"  the object, by {found['change']['method']}: {found['change']['verdict']}")
    if found["left_out"]:
        lines.append(f"  left out, without a known error on one of the two: {', '.join(found['left_out'])}")
    return "\n".join(lines)


def _change(folders: tuple[Folder, Folder], methods: tuple[str, ...], out: Store) -> dict[str, Any] | None:
    """Return where the object changed between two sessions with a scan in place; None where that cannot be told."""
    from experiments.before_after import tell_change

    before, after = (one.store for one in folders)
    if any(one.kind == "rendering" or not one.store.path("pose.json").exists() for one in folders):
        return None
    try:
        return tell_change(before, after, methods, out)
    except SceneError as error:
        say(f"warning: where the object changed is not told. {error}", always=True)
        return None


def _common(folders: tuple[Folder, Folder], asked: str | None) -> tuple[str, ...]:
    names = "; ".join(f"{one.store.folder}: {', '.join(one.errors)}" for one in folders)
    common = tuple(name for name in folders[0].errors if name in folders[1].errors)
    if not common:
        raise SceneError(f"compare: no method's errors are in both folders ({names}). Process both alike.")
    if asked is None:
        return common
    try:
        return named("--method", asked, common)
    except SceneError as error:
        raise SceneError(f"{error} These both folders have errors of ({names}): process both alike.") from None


def open_folder(path: Path) -> Folder:
    """Return a processed folder; raise SceneError where no errors are in it."""
    from compare.report.facts import map_of, method_names, read_optional

    if not path.is_dir():
        raise SceneError(f"{path}: is no folder. Give two output folders of `rgbn process`, or one and its twin/.")
    here = path.resolve()
    is_twin = here.name == "twin" and (here.parent / "compare").is_dir()
    home, kind = (Store(here.parent), "twin") if is_twin else (Store(here), "real")
    errors = {name: found for name in method_names(home)
              if (found := map_of(home, "compare", f"error_{kind}_{name}")) is not None}  # fmt: skip
    if not errors:
        raise SceneError(
            f"{path}: found no methods' errors (compare/*.npy). Give the session a scan, or normals, and process it: "
            "errors are told by a ground truth."
        )
    name = (read_optional(home, "summary.json") or {}).get("name") or home.folder.name
    return Folder(Store(here), "rendering" if is_twin else "photographs", f"{name} twin" if is_twin else name, errors)
