"""PLY as scanners write it: polygons, and the triangle strips of Cyberware and Stanford.

trimesh reads a PLY with `tristrips` as an empty mesh, without a word, and none with polygons of
different lengths; this reads them all. The format: [Turk1994].
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from formats.meshes.numbers_in_text import parse
from formats.meshes.polygons import fans, strips
from scene.errors import AlignError
from scene.files import write_whole
from scene.reading import reading, shortened

TYPES = {
    "char": "i1", "int8": "i1", "uchar": "u1", "uint8": "u1", "short": "i2", "int16": "i2", "ushort": "u2",
    "uint16": "u2", "int": "i4", "int32": "i4", "uint": "u4", "uint32": "u4", "float": "f4", "float32": "f4",
    "double": "f8", "float64": "f8",
}  # fmt: skip


@dataclass(frozen=True)
class _Element:
    name: str
    count: int
    properties: list[tuple[str, str, str | None]]
    """(name, value type, type of the list's length or None)."""


Columns = dict[str, dict[str, Any]]
"""Of each element, each property's values (N,), or of a list all lengths (N,) and all values in a row."""


def read_ply(path: Path) -> tuple[NDArray[np.float64], NDArray[np.int64], Columns]:
    """Return vertices (V, 3) and triangles (T, 3), in the file's unit, and all that the file holds.

    Polygons become fans. Raises AlignError: The file is no PLY, ends early, is a range grid, or has no positions.
    """
    with reading(path, "cannot be read", AlignError):
        data = path.read_bytes()
    encoding, elements, offset = _header(path, data)
    names = [element.name for element in elements]
    if "range_grid" in names and "face" not in names and "tristrips" not in names:
        raise AlignError(
            f"{path}: a range grid, one view as the scanner saw it, without faces. Merge and mesh the views first "
            "(for example with VripPack or MeshLab), and give the merged mesh."
        )
    promised = shortened(", ".join(f"{element.count} {element.name}" for element in elements))
    do = f"Its header promises {promised}. Export the scan again."
    with reading(path, "the PLY ends early or is damaged", AlignError, do=do):
        _check_counts(elements, len(data) - offset, is_text=encoding == "ascii")
        if encoding == "ascii":
            columns = _read_ascii(data[offset:], elements)
        else:
            columns = _read_binary(data, offset, elements, "<" if encoding == "binary_little_endian" else ">")
        return *_triangles(path, columns), columns


def _check_counts(elements: list[_Element], there: int, *, is_text: bool) -> None:
    """Raise ValueError where a header promises more than the `there` bytes behind it can hold."""
    for element in elements:
        # A row takes at least its single values and its lists' lengths; in a text a digit and a space for each.
        sizes = [2 if is_text else np.dtype(length or kind).itemsize for _, kind, length in element.properties]
        if element.count < 0 or element.count * sum(sizes) > there + 1:
            raise ValueError(f"{element.count} {element.name} do not fit into {there} bytes")


def _triangles(path: Path, columns: Columns) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    vertex = columns.get("vertex", {})
    if not {"x", "y", "z"} <= set(vertex):
        raise AlignError(f"{path}: the PLY has no vertices with x, y, z. Export the scan as a triangle mesh.")
    vertices = np.stack([np.asarray(vertex[axis], np.float64) for axis in "xyz"], -1)
    faces = [np.zeros((0, 3), np.int64)]
    for element, values in columns.items():
        for name, (counts, flat) in ((n, v) for n, v in values.items() if isinstance(v, tuple)):
            if element == "face" and name in ("vertex_indices", "vertex_index"):
                faces.append(fans(counts, flat))
            elif element == "tristrips" and name in ("vertex_indices", "vertex_index"):
                faces.append(strips(counts, flat))
    return vertices, np.concatenate(faces)


def write_ply(path: Path, columns: dict[str, NDArray], faces: NDArray[np.int64]) -> None:
    """Write triangles (T, 3) as binary PLY, in double precision; millimetres.

    `columns`: of each vertex, values (V, k) by the names of k properties, with blanks between: "x y z", "nx ny nz".
    """
    rows = np.concatenate([np.asarray(values, "<f8") for values in columns.values()], 1)
    listed = np.empty(len(faces), [("count", "u1"), ("corners", "<i4", 3)])
    listed["count"], listed["corners"] = 3, faces
    properties = "".join(f"property double {name}\n" for name in " ".join(columns).split())
    header = (
        f"ply\nformat binary_little_endian 1.0\ncomment millimetres\nelement vertex {len(rows)}\n{properties}"
        f"element face {len(faces)}\nproperty list uchar int vertex_indices\nend_header\n"
    )
    with write_whole(path) as file:
        file.write(header.encode() + rows.tobytes() + listed.tobytes())


def _header(path: Path, data: bytes) -> tuple[str, list[_Element], int]:
    end = data.find(b"end_header")
    if not data.startswith(b"ply") or end < 0:
        raise AlignError(f"{path}: no PLY: it starts with {data[:12]!r}. Check that the file is whole.")
    offset = data.find(b"\n", end) + 1
    # Old Macintosh writers end lines with a lone carriage return.
    if b"\n" not in data[:end]:
        offset = end + len(b"end_header") + 1
    encoding, elements = "", []
    for line in data[:end].decode("latin-1").splitlines():
        words = line.split()
        try:
            if words[:1] == ["format"]:
                encoding = words[1]
            elif words[:1] == ["element"]:
                elements.append(_Element(words[1], int(words[2]), []))
            elif words[:2] == ["property", "list"]:
                elements[-1].properties.append((words[4], TYPES[words[3]], TYPES[words[2]]))
            elif words[:1] == ["property"]:
                elements[-1].properties.append((words[2], TYPES[words[1]], None))
        except (IndexError, KeyError, ValueError) as error:
            raise AlignError(
                f"{path}: cannot read the PLY header line {shortened(line)!r}. Export the scan again."
            ) from error
    if encoding not in ("ascii", "binary_little_endian", "binary_big_endian"):
        raise AlignError(f"{path}: unknown PLY format {shortened(encoding)!r}; expected ascii or binary_*_endian.")
    return encoding, elements, offset


def _read_ascii(text: bytes, elements: list[_Element]) -> Columns:
    """An ASCII file is a binary one whose values all are float64: the same reader serves both."""
    numbers = parse(text)
    plain = [
        _Element(e.name, e.count, [(name, "f8", "f8" if length else None) for name, _, length in e.properties])
        for e in elements
    ]
    return _read_binary(numbers.tobytes(), 0, plain, "=")


def _read_binary(data: bytes, at: int, elements: list[_Element], order: str) -> Columns:
    columns = {}
    for element in elements:
        if not element.count or not element.properties:
            columns[element.name] = {name: np.zeros(0) for name, _, length in element.properties if not length}
            continue
        table = _read_table(data, at, element, order)
        columns[element.name], at = table or _read_lists(data, at, element, order)
    return columns


def _read_table(data: bytes, at: int, element: _Element, order: str) -> tuple | None:
    """Read an element whose rows all have one size, which the first row has; None where lists differ in length."""
    fields: list[tuple] = []
    lengths, here = {}, at
    for name, kind, length in element.properties:
        if length:
            count = int(np.frombuffer(data, order + length, 1, here)[0])
            if count < 0:
                raise ValueError(f"a list of {count} {name}")
            lengths[name] = count
            fields += [(f"count of {name}", order + length), (name, order + kind, (count,))]
            here += np.dtype(length).itemsize + count * np.dtype(kind).itemsize
        else:
            fields.append((name, order + kind))
            here += np.dtype(kind).itemsize
    dtype = np.dtype(fields)
    if lengths and at + element.count * dtype.itemsize > len(data):
        return None
    table = np.frombuffer(data, dtype, element.count, at)
    values = {}
    for name, _, length in element.properties:
        if length and (table[f"count of {name}"] != lengths[name]).any():
            return None
        values[name] = (np.full(element.count, lengths[name]), table[name].ravel()) if length else table[name]
    return values, at + element.count * dtype.itemsize


def _read_lists(data: bytes, at: int, element: _Element, order: str) -> tuple[dict, int]:
    """Read an element whose lists differ in length: walk it once, then fetch each list's values together."""
    from formats.meshes.ply_walk import fetch, walk

    size = [np.dtype(kind).itemsize for _, kind, _ in element.properties]
    length_size = [np.dtype(length).itemsize if length else 0 for *_, length in element.properties]
    is_float = [bool(length) and length.startswith("f") for *_, length in element.properties]
    if any(is_float) and order != "=":
        raise ValueError("the length of a list is not an integer")
    raw = np.frombuffer(data, np.uint8)
    numbers = np.frombuffer(data, np.float64) if any(is_float) else np.zeros(0)
    starts, counts, at = walk(raw, at, element.count, np.array(size), np.array(length_size), order == ">", numbers)
    if at < 0:
        raise ValueError(f"{element.name}: values are missing")
    values = {}
    for column, (name, kind, length) in enumerate(element.properties):
        if length:
            lengths = counts[:, column] * size[column]
            flat = np.zeros(lengths.sum(), np.uint8)
            fetch(raw, starts[:, column], lengths, flat)
            values[name] = (counts[:, column], flat.view(order + kind))
    return values, at
