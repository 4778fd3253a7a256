"""Numbers in text files, line by line, read in one go: the kinds of meshes that are text."""

import codecs
import re
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

Integers = NDArray[np.int64]


def read_text(path: Path) -> bytes:
    """Return a text without mark and comments (from # on); each line follows a line feed, the first one too."""
    data = path.read_bytes()
    if data[:2] in (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE):
        data = data.decode("utf-16").encode()
    text = b"\n" + data.removeprefix(codecs.BOM_UTF8).replace(b"\r\n", b"\n").replace(b"\r", b"\n")
    return re.sub(rb"#[^\n]*", b"", text) if b"#" in text else text


def lines_of(text: bytes, words: bytes) -> bytes:
    """Return the lines whose first word is one of these: a regular expression."""
    return re.sub(rb"\n(?![ \t]*(?:%s)\s)[^\n]*" % words, b"", text)


def table(text: bytes) -> tuple[NDArray[np.float64], Integers]:
    """Return all numbers of a text, separated by white space, and how many each line has that is not blank.

    text: Each line follows a line feed. Raises ValueError: Something in it is no number.
    """
    letters = np.frombuffer(text + b"\n", np.uint8)
    spaces = letters <= ord(" ")
    begins = np.flatnonzero(spaces[:-1] > spaces[1:])
    words = np.diff(np.searchsorted(begins, np.flatnonzero(letters == ord("\n"))))
    return np.array(text.split(), np.float64), words[words > 0]


def whole(values: NDArray) -> Integers:
    """Return whole numbers as integers; ValueError where one is not whole."""
    with np.errstate(invalid="ignore"):
        found = values.astype(np.int64)
    if (found != values).any():
        raise ValueError(f"{values[found != values][0]:g} where a whole number belongs")
    return found


def places(starts: Integers, counts: Integers, step: int = 1) -> Integers:
    """Return where the values of lists lie that begin at `starts` (N,) and have `counts` (N,), one after the other."""
    if len(counts) and (counts == counts[0]).all():
        return (starts[:, None] + step * np.arange(counts[0])).ravel()
    before = np.cumsum(counts) - counts
    return np.repeat(starts - step * before, counts) + step * np.arange(counts.sum())
