"""Meshes to binary PLY [Turk1994]."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from scene.files import write_whole

KINDS = {"f8": "double", "f4": "float", "u1": "uchar"}


def write_ply(path: Path, columns: Mapping[str, NDArray], faces: NDArray, comment: str = "") -> None:
    """Write triangles (T, 3), and what is known of their corners.

    columns: Arrays (V, n) by the names of their n columns, "x y z", each written in the type that it has.
    """
    types = {name: values.dtype.str[1:] for names, values in columns.items() for name in names.split()}
    vertex = np.empty(len(columns["x y z"]), [(name, f"<{kind}") for name, kind in types.items()])
    for names, values in columns.items():
        for column, name in enumerate(names.split()):
            vertex[name] = values[:, column]
    face = np.empty(len(faces), [("count", "u1"), ("corners", "<i4", 3)])
    face["count"], face["corners"] = 3, faces
    header = [
        "ply",
        "format binary_little_endian 1.0",
        *([f"comment {comment}"] if comment else []),
        f"element vertex {len(vertex)}",
        *(f"property {KINDS[kind]} {name}" for name, kind in types.items()),
        f"element face {len(face)}",
        "property list uchar int vertex_indices",
        "end_header\n",
    ]
    with write_whole(path) as file:
        file.write("\n".join(header).encode())
        file.write(vertex.tobytes())
        file.write(face.tobytes())
