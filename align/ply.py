"""PLY as scanners write it: polygons, and the triangle strips of Cyberware and Stanford.

trimesh reads a PLY with `tristrips` as an empty mesh, without a word; this reads them all.
The format: [Turk1994].
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from scene.errors import AlignError

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


def read_ply(path: Path) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Return vertices (V, 3) and triangles (T, 3), in the file's unit; polygons become fans.

    Raises
    ------
    AlignError
        The file is no PLY, ends early, or has no vertex positions.
    """
    data = path.read_bytes()
    encoding, elements, offset = _header(path, data)
    try:
        if encoding == "ascii":
            columns = _read_ascii(data[offset:], elements)
        else:
            columns = _read_binary(data, offset, elements, "<" if encoding == "binary_little_endian" else ">")
    except (ValueError, IndexError) as error:
        raise AlignError(
            f"{path}: the PLY ends early or is damaged ({error}); its header promises "
            f"{', '.join(f'{e.count} {e.name}' for e in elements)}. Export the scan again."
        ) from error
    vertex = columns.get("vertex", {})
    if not {"x", "y", "z"} <= set(vertex):
        raise AlignError(f"{path}: the PLY has no vertices with x, y, z. Export the scan as a triangle mesh.")
    vertices = np.stack([np.asarray(vertex[axis], np.float64) for axis in "xyz"], -1)
    faces = [np.zeros((0, 3), np.int64)]
    for element, values in columns.items():
        for name, (counts, flat) in ((n, v) for n, v in values.items() if isinstance(v, tuple)):
            if element == "face" and name in ("vertex_indices", "vertex_index"):
                faces.append(_fans(counts, flat))
            elif element == "tristrips":
                faces.append(_strips(counts, flat))
    return vertices, np.concatenate(faces)


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
            raise AlignError(f"{path}: cannot read the PLY header line {line!r}. Export the scan again.") from error
    if encoding not in ("ascii", "binary_little_endian", "binary_big_endian"):
        raise AlignError(f"{path}: unknown PLY format {encoding!r}; expected ascii or binary_*_endian.")
    return encoding, elements, offset


def _read_ascii(text: bytes, elements: list[_Element]) -> dict:
    numbers = np.array(text.split(), dtype=np.float64)
    columns, at = {}, 0
    for element in elements:
        if not any(length for *_, length in element.properties):
            size = element.count * len(element.properties)
            if at + size > len(numbers):
                raise ValueError(f"{element.name}: values are missing")
            table = numbers[at : at + size].reshape(element.count, len(element.properties))
            columns[element.name] = {name: table[:, i] for i, (name, *_) in enumerate(element.properties)}
            at += size
            continue
        lists: dict[str, list] = {name: [] for name, _, length in element.properties if length}
        for _ in range(element.count):
            for name, _, length in element.properties:
                if length is None:
                    at += 1
                    continue
                count = int(numbers[at])
                if at + 1 + count > len(numbers):
                    raise ValueError(f"{element.name}: values are missing")
                lists[name].append(numbers[at + 1 : at + 1 + count])
                at += 1 + count
        columns[element.name] = {name: _flatten(rows) for name, rows in lists.items()}
    return columns


def _read_binary(data: bytes, at: int, elements: list[_Element], order: str) -> dict:
    columns = {}
    for element in elements:
        first = {
            name: int(np.frombuffer(data, order + length, 1, at)[0])
            for name, _, length in element.properties[:1]
            if length and element.count
        }
        lists = [p for p in element.properties if p[2]]
        # One list, first of its element, always as long: the common mesh. One read instead of a loop.
        if not lists or (len(lists) == 1 and first):
            table = _read_table(data, at, element, order, first)
            if table is not None:
                columns[element.name], at = table
                continue
        rows: dict[str, list] = {name: [] for name, *_ in lists}
        for _ in range(element.count):
            for name, kind, length in element.properties:
                if length is None:
                    at += np.dtype(kind).itemsize
                    continue
                count = int(np.frombuffer(data, order + length, 1, at)[0])
                at += np.dtype(length).itemsize
                rows[name].append(np.frombuffer(data, order + kind, count, at))
                at += count * np.dtype(kind).itemsize
        columns[element.name] = {name: _flatten(values) for name, values in rows.items()}
    return columns


def _read_table(data: bytes, at: int, element: _Element, order: str, lengths: dict[str, int]) -> tuple | None:
    """Read an element whose rows all have one size; None where the lists differ in length."""
    fields: list[tuple] = []
    for name, kind, length in element.properties:
        if length:
            fields.append((f"count of {name}", order + length))
            fields.append((name, order + kind, (lengths[name],)))
        else:
            fields.append((name, order + kind))
    dtype = np.dtype(fields)
    if lengths and at + element.count * dtype.itemsize > len(data):
        return None
    table = np.frombuffer(data, dtype, element.count, at)
    values = {}
    for name, _, length in element.properties:
        if length and (table[f"count of {name}"] != lengths[name]).any():
            return None
        values[name] = (table[f"count of {name}"].astype(np.int64), table[name].ravel()) if length else table[name]
    return values, at + element.count * dtype.itemsize


def _flatten(rows: list[NDArray]) -> tuple[NDArray[np.int64], NDArray]:
    return np.array([len(row) for row in rows], np.int64), np.concatenate([*rows, np.zeros(0)])


def _fans(counts: NDArray[np.int64], flat: NDArray) -> NDArray[np.int64]:
    """Cut polygons, given by their lengths and all their corners in a row, into triangles."""
    flat = flat.astype(np.int64)
    starts = np.cumsum(counts) - counts
    triangles = np.maximum(counts - 2, 0)
    polygon = np.repeat(np.arange(len(counts)), triangles)
    second = np.arange(triangles.sum()) - np.repeat(np.cumsum(triangles) - triangles, triangles) + 1
    first = starts[polygon]
    return np.stack([flat[first], flat[first + second], flat[first + second + 1]], -1)


def _strips(counts: NDArray[np.int64], flat: NDArray) -> NDArray[np.int64]:
    """Cut strips into triangles: -1 ends a strip, every second triangle of a strip is turned over."""
    ends = np.cumsum(counts)
    flat = np.insert(flat.astype(np.int64), ends, -1)
    index = np.arange(len(flat))
    last_break = np.maximum.accumulate(np.where(flat < 0, index, -1))
    corners = np.stack([flat[:-2], flat[1:-1], flat[2:]], -1)
    odd = (index[:-2] - last_break[:-2] - 1) % 2 == 1
    corners[odd] = corners[odd][:, [1, 0, 2]]
    return corners[(corners >= 0).all(1)]
