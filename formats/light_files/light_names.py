"""The photographs that a file of lights names, found among the frames, however it spells them."""

import re
import unicodedata
from collections import Counter
from collections.abc import Sequence

ENCODINGS = ("utf-8", "cp1252", "mac_roman", "cp850")
"""That names are tried in: everyone's, and those that Windows, old Macs and DOS wrote in western Europe."""
QUOTES = " \t\"'“”„«»‘’"


def places(wanted: Sequence[str], names: Sequence[str]) -> list[list[int]]:
    """Return where in a file's names each wanted one stands: one place each, if the file names each of them once.

    A file's name counts without its folder and its suffixes (`IMG_01.CR2.jpg`: `IMG_01`), whatever its case, the
    composition of its accents, quotation marks around it and zeros before its numbers; where two of the wanted are
    then alike, only what is the same to the letter counts. A name that is not UTF-8 (`scene.reading.text_of`) is read
    in the one of `ENCODINGS` in which the most are found.
    """
    exact = {name: place for place, name in enumerate(wanted)}
    keys = [(_folded(key), place) for place, name in enumerate(wanted) for key in keys_of(name)]
    counts = Counter(key for key, _ in keys)
    folded = {key: place for key, place in keys if counts[key] == 1}
    trials = []
    for encoding in ENCODINGS:
        found: list[list[int]] = [[] for _ in wanted]
        for row, name in enumerate(names):
            hits = (exact.get(key, folded.get(_folded(key))) for key in keys_of(_read_in(name, encoding)))
            place = next((hit for hit in hits if hit is not None), None)
            if place is not None:
                found[place].append(row)
        trials.append(found)
    return max(trials, key=lambda found: sum(map(bool, found)))


def keys_of(name: str) -> list[str]:
    """Return what a photograph of this name, in a path of any system, may be called, the longest first."""
    *folders, file = name.strip(QUOTES).replace("\\", "/").split("/")
    keys = [file]
    while cut := re.fullmatch(r"(.+)\.(?!\d+$)\w{1,5}", keys[-1]):
        keys.append(cut[1])
    # So are two photographs of one name in two folders told apart.
    return keys + [f"{folders[-1]}_{key}" for key in keys if folders]


def _folded(name: str) -> str:
    name = unicodedata.normalize("NFC", unicodedata.normalize("NFC", name).casefold())
    return re.sub(r"(?<!\d)0+(?=\d)", "", name)


def _read_in(name: str, encoding: str) -> str:
    try:
        return name.encode("utf-8", "surrogateescape").decode(encoding)
    except UnicodeError:
        return name


def nameless(count: int) -> tuple[str, ...]:
    """Return names for the lights of a file that has none.

    Never a frame's name: frames are often named by number, and row 1 need not be frame "1".
    """
    return tuple(f"(row {i + 1})" for i in range(count))
