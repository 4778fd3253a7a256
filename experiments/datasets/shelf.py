"""The shelf: one folder of the datasets that were made, and of others' that were checked and added; and its list."""

import re
import shutil
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

from experiments.catalogue import FAMILIES, benchmark_names, catalogue, first_names, wanted
from experiments.datasets.check import check_dataset
from experiments.datasets.checksums import FILE, checksums_of, differences
from experiments.datasets.write import mark_of
from scene.current import fingerprint
from scene.errors import SceneError
from scene.files import move, write_json
from scene.output_folder import open_record, read_record
from scene.reading import json_of, listed, told
from scene.record import Record

ADDED = ".added"
"""Folder of the shelf: one NAME.json for each dataset that was added, with its checksums."""
FAMILY_COLUMNS = ("family", "datasets", "of the benchmark's list", "what is varied", "for instance")


@dataclass(frozen=True)
class Entry:
    """A dataset as the list shows it."""

    name: str
    family: str
    text: str
    state: str  # "": not made yet; "made"; "outdated": made by another version; "added": of others
    folder: Path  # where it is, or would be
    benchmark: bool = False  # of the benchmark's list of 93
    same_as: str = ""  # the dataset that it is another name of; empty: none


def entries(shelf: Path) -> list[Entry]:
    """Return the catalogue, then what else the shelf has: catalogue datasets of other sizes, and those added."""
    known, record, first = catalogue(), read_record(shelf), first_names()
    found: list[Entry] = []
    for one in known.values():
        name = first[one.name]
        text, same_as = (one.text, "") if name == one.name else (f"the same stack as {name}", name)
        more = (name in benchmark_names(), same_as)
        found.append(Entry(one.name, one.family, text, _state(record, known[name]), shelf / name, *more))
    notes = [json_of(path) for path in sorted((shelf / ADDED).glob("*.json"))]
    taken = {*known, *(note["name"] for note in notes)}
    for path in sorted(shelf.glob("*px")):
        sized = re.fullmatch(r"(.+)-(\d+)px", path.name)
        base = known.get(str(sized[1])) if sized else None
        if sized and base and path.name not in taken and record and record.files_of(path.name):
            text, one = f"{base.text}; {sized[2]} px", base.sized(int(sized[2]))
            found.append(Entry(path.name, base.family, text, _state(record, one), path, base.name in benchmark_names()))
    return found + [Entry(note["name"], "added", note["text"], "added", Path(note["folder"])) for note in notes]


def select(found: Sequence[Entry], patterns: Sequence[str]) -> list[Entry]:
    """Return the entries that names, patterns or the word `benchmark` choose, each stack once, under its own name.

    SceneError: a pattern fits none.
    """
    first = {one.name: one.same_as for one in found if one.same_as}
    names = wanted(patterns, [one.name for one in found], [one.name for one in found if one.benchmark], first)
    return [one for one in found if one.name in names]


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
    with open_record(shelf, origin="shelf of datasets", input_folders=[folder]) as record:
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
                move(unfinished, place)
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
    lines = [(one.name, "benchmark" if one.benchmark else "ours", one.state or "-", one.text) for one in found]
    _tell_table(("name", "list", "on the shelf", "what it is"), lines)
    own = [one for one in found if not one.same_as]
    more = f" and {len(found) - len(own)} other names" if len(own) < len(found) else ""
    marked = sum(one.benchmark for one in own)
    there = sum(bool(one.state) for one in own)
    print(f"{len(own)} datasets{more}; {marked} of the benchmark's list; {there} on the shelf")


def tell_families(found: list[Entry]) -> None:
    """Print a line a family."""
    _tell_table(FAMILY_COLUMNS, _families(found))


def families_markdown(found: list[Entry]) -> str:
    """Return a Markdown table of the families."""
    rows = _families(found)
    lines = [f"| {' | '.join(FAMILY_COLUMNS)} |", "|---|---|---|---|---|"]
    lines += [f"| `{row[0]}` | {' | '.join(row[1:4])} | `{row[4]}` |" for row in rows]
    counts = [sum(int(row[column]) for row in rows) for column in (1, 2)]
    return "\n".join([*lines, f"| all | {counts[0]} | {counts[1]} | | |"]) + "\n"


def _families(found: list[Entry]) -> list[tuple[str, str, str, str, str]]:
    """Return of each family the cells of `FAMILY_COLUMNS`; a stack counts once, in the first family that has it."""
    rows = []
    for family, text in FAMILIES.items():
        own = [one for one in found if one.family == family and not one.same_as]
        if own:
            marked = sum(one.benchmark for one in own)
            rows.append((family, str(len(own)), str(marked), text, own[len(own) // 2].name))
    return rows


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
