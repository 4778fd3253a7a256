"""Numbers in text files, line by line, read in one go; lists of any length; polygons and strips cut into triangles."""

import codecs
import re
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

Integers = NDArray[np.int64]
MOST_FANS = 1000
"""That are tried on a polygon: more take minutes."""


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


def triangles(counts: Integers, flat: Integers, vertices: NDArray[np.float64]) -> Integers:
    """Cut polygons into fans: about the first corner, or about the first one whose fan does not overlap.

    Parameters
    ----------
    counts, flat : (N,), (C,)
        Each polygon's number of corners, and the vertices at all corners in a row.
    vertices : (V, 3)

    Returns
    -------
    corners : (T, 3)
        Places in `flat`.

    Raises
    ------
    ValueError
        There is no such vertex, or no fan fills a polygon.
    """
    check_corners(flat, len(vertices))
    cut = np.maximum(counts - 2, 0)
    polygon, start, first = np.repeat(np.arange(len(cut)), cut), np.cumsum(counts) - counts, np.cumsum(cut) - cut
    second = np.arange(len(polygon)) + (start - first + 1)[polygon]
    corners = np.stack([start[polygon], second, second + 1], -1)
    if (counts <= 3).all():
        return corners

    def areas(corners: Integers) -> NDArray[np.float64]:
        a, b, c = (vertices[flat[corners[:, k]]] for k in range(3))
        return np.cross(b - a, c - a)

    with np.errstate(all="ignore"):
        area = areas(corners)
        whole = np.stack([np.bincount(polygon, axis, len(counts)) for axis in area.T], -1)
        for one in np.unique(polygon[np.einsum("ti,ti->t", area, whole[polygon]) < 0]):
            size = int(counts[one])
            rolled = (start[one] + np.roll(np.arange(size), -k) for k in range(min(size, MOST_FANS)))
            fans = (np.stack([np.full(size - 2, at[0]), at[1:-1], at[2:]], -1) for at in rolled)
            fan = next((fan for fan in fans if (areas(fan) @ whole[one] >= 0).all()), None)
            if fan is None:
                raise ValueError(f"no fan fills a polygon of {size} corners: export the mesh as triangles")
            corners[first[one] : first[one] + size - 2] = fan
    return corners


def check_corners(corners: Integers, count: int, what: str = "vertices") -> None:
    """Raise ValueError where corners name what is not one of `count`."""
    if corners.size and (corners.min() < 0 or corners.max() >= count):
        raise ValueError(f"faces name {what} {corners.min()} to {corners.max()}, and there are {count}")


def strips(counts: Integers, flat: Integers) -> Integers:
    """Cut strips into triangles (T, 3): -1 ends a strip, every second triangle of a strip is turned over."""
    flat = np.insert(flat, np.cumsum(counts), -1)
    index = np.arange(len(flat))
    last_break = np.maximum.accumulate(np.where(flat < 0, index, -1))
    corners = np.stack([flat[:-2], flat[1:-1], flat[2:]], -1)
    odd = (index[:-2] - last_break[:-2] - 1) % 2 == 1
    corners[odd] = corners[odd][:, [1, 0, 2]]
    return corners[(corners >= 0).all(1)]
