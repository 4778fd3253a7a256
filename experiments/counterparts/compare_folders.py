"""`rgbn compare REAL TWIN`: two processed folders, whether the methods fail alike on both."""

import json as json_module
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from experiments.counterparts.compared_side import Folder, error_maps, open_folder, shifts_of
from lab.progress import say
from scene.current import libraries
from scene.errors import SceneError
from scene.files import write_json, write_text
from scene.output_folder import open_record
from scene.store import Store

PAGE, NUMBERS = "counterparts.html", "counterparts.json"


def compare_folders(
    real: Path, twin: Path, out: Path | None = None, *, methods: str | None = None, json: bool = False
) -> dict[str, Any]:
    """Compare two processed folders, and write counterparts.html and counterparts.json.

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
        Of `compare.statistics.counterpart_verdict.compare_counterparts`, with name, created, versions and folders.

    Raises
    ------
    SceneError
        A folder is not processed, a method asked for is not in both, or the two have none in common.
    """
    from compare.report.counterpart_page import counterpart_page
    from compare.statistics.counterpart_verdict import compare_counterparts

    folders = {"real": open_folder(real), "twin": open_folder(twin)}
    common = _common(folders, methods)
    folder = out or Path("out") / f"{real.resolve().name}-against-{twin.resolve().name}"
    with open_record(folder, input_folders=[real, twin]) as record:
        place = Store(record.folder)
        say(f"compare {real} with {twin}: {', '.join(common)}")
        sides = {kind: capture_of(folder, common, seed) for seed, (kind, folder) in enumerate(folders.items())}
        found = compare_counterparts(sides["real"], sides["twin"])
        title = f"{sides['real'].name} against {sides['twin'].name}"
        now = datetime.now(UTC).isoformat(timespec="seconds")
        found = {"name": title, "created": now, "versions": libraries(), **found}
        write_json(place.path(NUMBERS), found)
        subtitle = f"methods {', '.join(common)} · {now} · rgbn {found['versions'].get('rgbn', '')}"
        write_text(place.path(PAGE), counterpart_page(found, sides["real"], sides["twin"], title, subtitle))
    if json:
        print(json_module.dumps(place.read_json(NUMBERS), indent=1))
    else:
        tell(found)
        print(place.path(PAGE))
    return found


def capture_of(folder: Folder, methods: tuple[str, ...], seed: int) -> Any:
    """Return a folder's errors, and what its lights and registration leave open."""
    from compare.statistics.counterpart_draws import Capture

    shifts, carried = shifts_of(folder, methods, seed=seed)
    return Capture(folder.name, folder.kind, error_maps(folder, methods), shifts, carried)


def tell(found: dict[str, Any]) -> None:
    """Print the verdict, its reasons, and how the methods follow each other."""
    words = {"level": "errors as large", "pattern": "at the same places", "order": "methods rank alike"}
    print(f"{found['name']}: {found['verdict']}")
    for question, answer in found["reasons"].items():
        print(f"  {words[question]:20} {answer}")
    if found["left_out"]:
        print(f"  left out, without a known error on one of the two: {', '.join(found['left_out'])}")
    for kind, told in found["order"]["sentences"].items():
        for text in told:
            print(f"  {kind}: {text}")


def _common(folders: dict[str, Folder], asked: str | None) -> tuple[str, ...]:
    there = [folder.methods for folder in folders.values()]
    names = "; ".join(f"{one.store.folder}: {', '.join(one.methods)}" for one in folders.values())
    common = tuple(name for name in there[0] if name in there[1])
    if asked is not None:
        wanted = tuple(dict.fromkeys(word.strip() for word in asked.split(",") if word.strip()))
        missing = [name for name in wanted if name not in common]
        if missing or not wanted:
            raise SceneError(
                f"--method {asked}: {', '.join(missing) or 'nothing'} is not among the methods that both folders have "
                f"normals of ({names}). Ask for {', '.join(common) or 'none'}, or process both by it."
            )
        return wanted
    if not common:
        raise SceneError(f"compare: no method's normals are in both folders ({names}). Process both alike.")
    return common
