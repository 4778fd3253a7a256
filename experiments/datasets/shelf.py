"""The shelf: one folder of the datasets that were made, and of notes on others' that were added; and its list."""

import re
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from experiments.catalogue import benchmark_names, catalogue, first_names, wanted
from experiments.datasets.make import SUMS, checksums_of, mark_of
from scene.current import fingerprint
from scene.errors import SceneError
from scene.files import write_json
from scene.output_folder import open_record, read_record
from scene.reading import json_of
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


def contents(folder: Path) -> tuple[int, NDArray, NDArray[np.bool_], NDArray[np.float32]]:
    """Return how many photographs a dataset has, one of them, its mask (H, W), and its true normals (H, W, 3).

    It is read as a session is, in whatever form. SceneError: lights, mask or truth are missing, or do not do.
    """
    from align.truth import read_normals
    from calibrate.known_lights.read_known import read_lights
    from capture.session.requests import read_mask
    from capture.session.session import load_session
    from formats.picture_files import read_values

    session = load_session(folder)
    files: list[Any] = [session.lights_file, session.mask, session.normals]
    if None in files:
        lacks = ("lights", "a mask", "true normals")[files.index(None)]
        raise SceneError(f"{folder}: has no {lacks}. Without them nothing can be judged: docs/guide/synthetic.md.")
    skipped = tuple(set(range(session.photographed)) - set(session.kept))
    read_lights(files[0], session.names, skipped=skipped).check()
    photograph, _ = read_values(session.flash[len(session.flash) // 2], SceneError)
    size = photograph.shape[:2]
    return len(session.flash), photograph, read_mask(files[1], *size), read_normals(files[2], *size)


def add(shelf: Path, folder: Path, *, name: str | None = None, text: str = "") -> Entry:
    """Read a dataset, and note on the shelf where it is, by default under its folder's name.

    text: what it is, in a line. The files stay where they are. SceneError: one is at fault, or the name is taken.
    Whether the photographs agree with the lights is told when the dataset is solved.
    """
    folder = folder.resolve()
    try:
        count, _, mask, _ = contents(folder)
    except SceneError as error:
        raise SceneError(f"{folder}: not added, {str(error).removeprefix(f'{folder}: ')}") from error
    name = name or folder.name
    if not re.fullmatch(r"[A-Za-z0-9][A-Za-z0-9._-]*", name):
        raise SceneError(f"--name {name!r}: expected letters, digits, dots, - and _. Give another with --name.")
    with open_record(shelf, origin="shelf of datasets", input_folders=[folder]) as record:
        note = shelf / ADDED / f"{name}.json"
        is_other = note.exists() and Path(json_of(note)["folder"]) != folder
        if name in catalogue() or (shelf / name).exists() or is_other:
            raise SceneError(f"dataset {name}: the name is taken. Give another with --name.")
        sums = checksums_of(folder)
        text = text or f"{count} photographs, {np.count_nonzero(mask)} pixels"
        entry = Entry(name, "added", text, "added", folder)
        with record.making(f"{ADDED}/{name}", fingerprint(sums)):
            write_json(note, {**asdict(entry), "checksums": sums})
    return entry


def contents_of(shelf: Path, entry: Entry) -> str:
    """Return the checksums of a dataset that is there and unchanged; raise SceneError where it is not."""
    note, is_added = shelf / ADDED / f"{entry.name}.json", entry.state == "added"
    do = f"add it again, or remove {note}" if is_added else "or remove it and make it again"
    if not entry.folder.is_dir():
        raise SceneError(f"dataset {entry.name}: {entry.folder} is gone. Put it back, {do}.")
    expected = json_of(note)["checksums"] if is_added else (entry.folder / SUMS).read_text()
    now = checksums_of(entry.folder)
    if changed := {line[66:] for line in set(expected.splitlines()) ^ set(now.splitlines())}:
        raise SceneError(
            f"{entry.folder}: {min(changed)} is not as it was when the dataset was put on the shelf. Put it back, {do}."
        )
    return expected


def listing(found: list[Entry]) -> str:
    """Return a line a dataset, and how many there are."""
    lines = [("name", "list", "on the shelf", "what it is")]
    lines += [(one.name, "benchmark" if one.benchmark else "ours", one.state or "-", one.text) for one in found]
    widths = [max(len(line[place]) for line in lines) + 2 for place in range(3)]
    rows = ["".join(f"{cell:{width}}" for cell, width in zip(line, widths, strict=False)) + line[3] for line in lines]
    own = [one for one in found if not one.same_as]
    more = f" and {len(found) - len(own)} other names" if len(own) < len(found) else ""
    # A copy of another size is the same one of the list.
    marked = sum(one.name in benchmark_names() for one in own)
    there = sum(bool(one.state) for one in own)
    return "\n".join([*rows, f"{len(own)} datasets{more}; {marked} of the benchmark's list; {there} on the shelf"])
