"""The shelf: one folder of the datasets that were made, and of others' that were checked and added; and its list."""

import re
import shutil
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

from experiments.catalogue import FAMILIES, catalogue
from experiments.datasets.check import check_dataset
from experiments.datasets.checksums import FILE, checksums_of, differences
from experiments.datasets.write import mark_of
from scene.current import fingerprint
from scene.errors import SceneError
from scene.files import move_folder, write_json
from scene.output_folder import open_record, read_record
from scene.reading import json_of, listed, told
from scene.record import Record

ADDED = ".added"
"""Folder of the shelf: one NAME.json for each dataset that was added, with its checksums."""


@dataclass(frozen=True)
class Entry:
    """A dataset as the list shows it."""

    name: str
    family: str
    text: str
    state: str  # "": not made yet; "made"; "outdated": made by another version; "added": of others
    folder: Path  # where it is, or would be


def entries(shelf: Path) -> list[Entry]:
    """Return the catalogue, then what else the shelf has: catalogue datasets of other sizes, and those added."""
    known, record = catalogue(), read_record(shelf)
    found = [Entry(one.name, one.family, one.text, _state(record, one), shelf / one.name) for one in known.values()]
    notes = [json_of(path) for path in sorted((shelf / ADDED).glob("*.json"))]
    taken = {*known, *(note["name"] for note in notes)}
    for path in sorted(shelf.glob("*px")):
        sized = re.fullmatch(r"(.+)-(\d+)px", path.name)
        base = known.get(sized[1]) if sized else None
        if sized and base and path.name not in taken and record and record.files_of(path.name):
            text, one = f"{base.text}; {sized[2]} px", base.sized(int(sized[2]))
            found.append(Entry(path.name, base.family, text, _state(record, one), path))
    found += [Entry(note["name"], "added", note["text"], "added", Path(note["folder"])) for note in notes]
    return found


def _state(record: Record | None, dataset) -> str:
    if record is None or not record.files_of(dataset.name):
        return ""
    return "made" if record.is_current(dataset.name, mark_of(dataset)) else "outdated"


def add(shelf: Path, folder: Path, *, name: str | None = None, text: str = "", link: bool = False) -> Entry:
    """Check a dataset in the DiLiGenT layout, and put it on the shelf, by default under its folder's name.

    text: what it is, in a line. link: leave the files where they are and remember their checksums; else they are
    copied. SceneError: it does not pass the check, or the name is taken.
    """
    verdict = check_dataset(folder)
    if verdict.faults:
        raise SceneError(told(folder, verdict.faults, "not added, "))
    name = name or folder.resolve().name
    if not re.fullmatch(r"[A-Za-z0-9][A-Za-z0-9._-]*", name):
        raise SceneError(f"--name {name!r}: expected letters, digits, dots, - and _. Give another with --name.")
    with open_record(shelf, input_folders=[folder]) as record:
        place, note, work = shelf / name, shelf / ADDED / f"{name}.json", f"{ADDED}/{name}"
        if (
            name in catalogue()
            or (place.exists() and not record.files_of(work))
            or (note.exists() and Path(json_of(note)["folder"]).exists())
        ):
            raise SceneError(f"dataset {name}: the name is taken. Give another with --name.")
        sums = checksums_of(folder)
        text = text or f"{verdict.facts['photographs']} photographs, {verdict.facts['object_pixels']} pixels"
        entry = Entry(name, "added", text, "added", (folder if link else place).resolve())
        with record.making(work, fingerprint(sums)):
            if not link:
                unfinished = record.scratch("added") / name
                shutil.rmtree(unfinished, ignore_errors=True)
                for line in sums.splitlines():
                    target = unfinished / line.split("  ", 1)[1]
                    target.parent.mkdir(parents=True, exist_ok=True)
                    shutil.copyfile(folder / line.split("  ", 1)[1], target)
                move_folder(unfinished, place)
            # Last: a dataset without a note is a name that is free.
            write_json(note, {**asdict(entry), "linked": link, "checksums": sums, "facts": verdict.facts})
    return entry


def contents_of(shelf: Path, entry: Entry) -> str:
    """Return the checksums of a dataset that is there and unchanged; raise SceneError where it is not."""
    note, is_added = shelf / ADDED / f"{entry.name}.json", entry.state == "added"
    if not entry.folder.is_dir():
        do = f"add it again, or remove {note}" if is_added else "or make it again"
        raise SceneError(f"dataset {entry.name}: {entry.folder} is gone. Put it back, {do}.")
    expected = json_of(note)["checksums"] if is_added else (entry.folder / FILE).read_text()
    if said := differences(expected, entry.folder):
        do = "Put the files back, or add it under another name" if is_added else "Remove it and make it again"
        raise SceneError(f"{entry.folder}: {listed(said, 3)}, since it was put on the shelf. {do}.")
    return expected


def tell(found: list[Entry]) -> None:
    """Print a line a dataset, and how many there are."""
    lines = [(one.name, one.state or "-", one.text) for one in found]
    _tell_table(("name", "on the shelf", "what it is"), lines)
    print(f"{len(found)} datasets, {sum(bool(one.state) for one in found)} on the shelf")


def tell_families(found: list[Entry]) -> None:
    """Print a line a family."""
    _tell_table(("family", "datasets", "what is varied", "for instance"), _families(found))


def families_markdown(found: list[Entry]) -> str:
    """Return a Markdown table of the families."""
    lines = ["| family | datasets | what is varied | for instance |", "|---|---|---|---|"]
    lines += [f"| `{name}` | {count} | {varied} | `{example}` |" for name, count, varied, example in _families(found)]
    return "\n".join([*lines, f"| all | {len(found)} | | |"]) + "\n"


def _families(found: list[Entry]) -> list[tuple[str, str, str, str]]:
    """Return of each family its name, how many datasets it has, what is varied, and one of them."""
    names = {family: [one.name for one in found if one.family == family] for family in FAMILIES}
    return [
        (one, str(len(names[one])), text, names[one][len(names[one]) // 2])
        for one, text in FAMILIES.items()
        if names[one]
    ]


def _tell_table(head: Sequence[str], lines: Iterable[Sequence[str]]) -> None:
    from rich.console import Console
    from rich.table import Table

    table = Table(box=None, padding=(0, 2, 0, 0))
    for column in head:
        table.add_column(column, no_wrap=column == "name")
    for line in lines:
        table.add_row(*line)
    console = Console()
    # A pipe has no width: names and texts must not be cut there.
    if not console.is_terminal:
        console = Console(width=200)
    console.print(table, markup=False)
