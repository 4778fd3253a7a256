"""PLY [Turk1994]: read as scanners write it, polygons and triangle strips of Cyberware and Stanford; written binary.

trimesh reads a PLY with `tristrips` as an empty mesh, without a word, and no binary one with polygons of different
lengths; Open3D reads neither strips nor lines that hold more numbers than the header says.
"""

import re
import struct
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from formats.meshes.polygons import places, table, whole
from scene.files import write_whole
from scene.reading import shortened

Integers = NDArray[np.int64]
TYPES = {
    "int8": "b", "uint8": "B", "int16": "h", "uint16": "H", "int32": "i", "uint32": "I", "int64": "q", "uint64": "Q",
    "float32": "f", "float64": "d", "char": "b", "uchar": "B", "short": "h", "ushort": "H", "int": "i", "uint": "I",
    "float": "f", "double": "d",
}  # fmt: skip
"""As `struct` and NumPy name them; of two names the last one is written."""


@dataclass(frozen=True)
class Element:
    """Rows of one kind."""

    name: str
    count: int
    properties: list[tuple[str, str, str | None]]
    """(name, value type, type of the list's length or None)."""


Columns = dict[str, dict[str, Any]]
"""Of each element, each property's values (N,), or of a list all lengths (N,) and all values in a row."""


def read_ply(path: Path) -> Columns:
    """Return all that a file holds; ValueError where it is no PLY, or holds less or more than its header says."""
    data = path.read_bytes()
    encoding, elements, at = _header(data)
    for element in elements:
        # A row takes at least its single values and its lists' lengths; in a text a digit and a space for each.
        sizes = [2 if encoding == "ascii" else np.dtype(n or kind).itemsize for _, kind, n in element.properties]
        if element.count < 0 or element.count * sum(sizes) > len(data) - at + 1:
            raise ValueError(f"{element.count} {element.name} do not fit into {len(data) - at} bytes")
    if encoding == "ascii":
        return read_rows(b"\n" + data[at:].replace(b"\r", b"\n"), elements)
    return _read_binary(data, at, elements, "<" if encoding == "binary_little_endian" else ">")


def _header(data: bytes) -> tuple[str, list[Element], int]:
    """Return the encoding, the elements, and where their values begin."""
    found = re.match(rb"(?:\xef\xbb\xbf)?ply\s.*?[\r\n]end_header[ \t]*(\r\n?|\n)", data, re.DOTALL)
    if not found:
        raise ValueError(f"no PLY: it starts with {data[:12]!r}")
    # Old Macintosh writers end lines with a lone carriage return, and any byte may follow the last one.
    at = found.end() if b"\n" in data[: found.start(1)] else found.start(1) + 1
    encoding, elements = "", []
    for line in re.split(r"[\r\n]+", found[0].decode("latin-1")):
        words = line.split()
        try:
            if words[:1] == ["format"]:
                encoding = words[1]
            elif words[:1] == ["element"]:
                elements.append(Element(words[1], int(words[2]), []))
            elif words[:2] == ["property", "list"]:
                elements[-1].properties.append((words[4], TYPES[words[3]], TYPES[words[2]]))
            elif words[:1] == ["property"]:
                elements[-1].properties.append((words[2], TYPES[words[1]], None))
        except (IndexError, KeyError, ValueError) as error:
            raise ValueError(f"the header's line {shortened(line)!r} is not PLY") from error
    if encoding not in ("ascii", "binary_little_endian", "binary_big_endian"):
        raise ValueError(f"unknown PLY format {shortened(encoding)!r}; expected ascii or binary_*_endian")
    return encoding, elements, at


def read_rows(text: bytes, elements: list[Element]) -> Columns:
    """Return the rows of a text, one a line, each line after a line feed.

    Lines may hold more than their row: exporters and scripts append flags and colours.
    """
    numbers, words = table(text)
    data, ends = numbers.view(np.uint8), 8 * np.cumsum(words)
    columns, line = {}, 0
    for element in elements:
        rows = slice(line, line + (element.count if element.properties else 0))
        line = rows.stop
        if line > len(ends):
            raise ValueError(f"{element.name}: values are missing, or several rows share a line")
        columns[element.name], _ = _rows(element, (ends - 8 * words)[rows], ends[rows], data)
    if line < len(ends):
        raise ValueError(f"{len(ends) - line} lines are left behind the last {elements[-1].name}")
    return columns


def _read_binary(data: bytes, at: int, elements: list[Element], order: str) -> Columns:
    columns = {}
    for element in elements:
        # Mostly all rows are as long as the first one.
        edges = at + (_walk(data, at, min(element.count, 1), element, order)[-1] - at) * np.arange(element.count + 1)
        try:
            columns[element.name], ends = _rows(element, edges[:-1], len(data), data, order)
            is_even = np.array_equal(ends, edges[1:])
        except ValueError:
            is_even = False
        if not is_even:
            edges = _walk(data, at, element.count, element, order)
            columns[element.name], _ = _rows(element, edges[:-1], len(data), data, order)
        at = int(edges[-1])
    if data[at:].strip(b"\0 \t\r\n"):
        raise ValueError(f"{len(data) - at} bytes are left behind the last {elements[-1].name}")
    return columns


def _walk(data: bytes, at: int, count: int, element: Element, order: str) -> Integers:
    """Return where rows start and the last one ends (count + 1,): known only when the lists before were read."""
    layout = [
        (struct.Struct(order + length) if length else None, np.dtype(kind).itemsize)
        for _, kind, length in element.properties
    ]
    edges = [at]
    for _ in range(count):
        for length, size in layout:
            number = 1
            if length and at + length.size <= len(data):
                number = length.unpack_from(data, at)[0]
                at += length.size
            if not 0 <= number <= len(data):
                raise ValueError(f"{element.name}: a list of {number} values")
            at += int(number) * size
        edges.append(at)
    return np.array(edges, np.int64)


def _rows(element: Element, at: Integers, ends: Any, data: Any, order: str = "") -> tuple[dict[str, Any], Integers]:
    """Return an element's columns, and where each row's values end.

    at (N,): Where rows start. ends: Where they have to end, one for each or one for all. data: Bytes. order: Of them;
    empty: all values are doubles, as a text's.
    """

    def take(kind: str, counts: Integers) -> tuple[NDArray, Integers]:
        form = np.dtype(order + kind if order else "d")
        if (at + counts * form.itemsize > ends).any():
            raise ValueError(f"{element.name}: values are missing")
        # One could begin at any byte.
        values = np.ndarray(max(len(data) - form.itemsize + 1, 0), form, data, strides=(1,))
        return values[places(at, counts, form.itemsize)], at + counts * form.itemsize

    columns: dict[str, Any] = {}
    for name, kind, length in element.properties:
        counts = np.ones(len(at), np.int64)
        if length:
            lengths, at = take(length, counts)
            counts = whole(lengths)
            if (counts < 0).any():
                raise ValueError(f"{element.name}: a list of {counts.min()} values")
        values, at = take(kind, counts)
        columns[name] = (counts, values) if length else values
    return columns, at


def write_ply(path: Path, columns: Mapping[str, NDArray], faces: NDArray, comment: str = "") -> None:
    """Write triangles (T, 3), and what is known of their corners.

    columns: Arrays (V, n) by the names of their n columns, "x y z", each written in the type that it has.
    """
    known = {name: values[:, i] for names, values in columns.items() for i, name in enumerate(names.split())}
    types, written = {name: column.dtype.char for name, column in known.items()}, {TYPES[name]: name for name in TYPES}
    vertex = np.rec.fromarrays(list(known.values()), [(name, f"<{kind}") for name, kind in types.items()])
    face = np.rec.fromarrays([np.full(len(faces), 3), faces], [("count", "u1"), ("corners", "<i4", 3)])
    header = [
        "ply",
        "format binary_little_endian 1.0",
        *([f"comment {comment}"] if comment else []),
        f"element vertex {len(vertex)}",
        *(f"property {written[kind]} {name}" for name, kind in types.items()),
        f"element face {len(faces)}",
        "property list uchar int vertex_indices",
        "end_header\n",
    ]
    with write_whole(path) as file:
        file.write("\n".join(header).encode())
        file.write(vertex.tobytes())
        file.write(face.tobytes())
