"""Scans of millions of triangles: processor seconds and memory to read and mend them, against other readers.

Each reader runs in a process of its own, which has loaded its libraries before; the quickest of some rounds counts.
Memory is the process' peak beyond what it held before. rgbn mends all; trimesh merges vertices and drops broken faces
(`process=True`), Open3D only reads.
"""

import subprocess
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from benchmarks.harness import ROOT, Scale, Table, markdown

READERS = {
    "rgbn": "import scipy.sparse.csgraph, scipy.spatial, trimesh; from align.scan.mended_scan import load_scan as read",
    "trimesh": "import scipy.spatial, trimesh; read = lambda path, _: trimesh.load(path, process=True, force='mesh')",
    "Open3D": "import scene.rays; io = scene.rays.import_open3d().io; read = lambda p, _: io.read_triangle_mesh(p)",
}
"""What a process does before the clock starts."""
ALONE = """
import sys, pathlib, numpy
from scene.clock import now, since
{}
# Not getrusage: its peak is inherited from the process that started this one.
peak = lambda: int(pathlib.Path("/proc/self/status").read_text().split("VmHWM:")[1].split()[0]) / 1024
before, start = peak(), now()
read(pathlib.Path(sys.argv[1]), "mm")
spent = since(start)
print(spent["processor_seconds"], spent["seconds"], peak() - before)
"""
FILES = ("clean.ply", "ASCII.ply", "30 % of the faces turned.ply", "a hole.ply", "text.obj", "no shared vertices.stl")


@dataclass(frozen=True)
class ScanRow:
    """One file by one reader."""

    file: str
    triangles: int
    reader: str
    processor_s: float
    wall_s: float
    memory_mb: float


def write_ring(path: Path, side: int) -> None:
    """Write a bumpy ring of 2 x side^2 triangles, closed, without poles, as the file's name says."""
    import trimesh

    u, v = np.meshgrid(*2 * [2 * np.pi * np.arange(side) / side], indexing="ij")
    radius = 25 * (1 + 0.05 * np.sin(17 * u) * np.cos(11 * v))
    radius += 50 / side * np.random.default_rng(0).standard_normal(u.shape)
    far = 60 + radius * np.cos(v)
    vertices = np.stack([far * np.cos(u), far * np.sin(u), radius * np.sin(v)], -1).reshape(-1, 3)
    index = np.arange(side**2).reshape(side, side)
    a, b, c, d = (np.roll(index, shift, (0, 1)).ravel() for shift in ((0, 0), (-1, 0), (-1, -1), (0, -1)))
    faces = np.concatenate([np.stack(corners, -1) for corners in ((a, b, c), (a, c, d))])
    if "turned" in path.name:
        faces = np.where(np.random.default_rng(1).random((len(faces), 1)) < 0.3, faces[:, ::-1], faces)
    if "hole" in path.name:
        faces = faces[~(np.linalg.norm(vertices - vertices[len(vertices) // 200], axis=1) < 6)[faces].any(1)]
    options = {"encoding": "ascii"} if "ASCII" in path.name else {}
    trimesh.Trimesh(vertices, faces, process=False).export(path, **options)


def _measured(file: str, side: int, rounds: int, readers: tuple[str, ...]) -> list[ScanRow]:
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        write_ring(path := Path(folder) / file, side)
        for reader in readers:
            command = [sys.executable, "-c", ALONE.format(READERS[reader]), path]
            told = [subprocess.check_output(command, text=True, cwd=ROOT).split()[-3:] for _ in range(rounds)]
            rows.append(ScanRow(file, 2 * side**2, reader, *min(tuple(map(float, one)) for one in told)))
    return rows


def _cases(scale: Scale) -> list[tuple]:
    if scale == "small":
        return [(FILES[0], 60, 1, ("rgbn",))]
    side, files = (300, FILES[-2:]) if scale == "gates" else (1000, FILES)
    return [(file, side, 3, tuple(READERS)) for file in files]


def _shown(rows: Sequence[ScanRow]) -> str:
    lines: dict[str, dict[str, str]] = {}
    for row in rows:
        cell = f"{row.processor_s:.2f} s ({row.wall_s:.2f}), {row.memory_mb:.0f} MB"
        lines.setdefault(row.file, {"file": row.file})[row.reader] = cell
    head = {f"{rows[0].triangles / 1e6:g} million triangles": "{file}"}
    return markdown(head | {row.reader: f"{{{row.reader}}}" for row in rows}, lines.values())


def _figures(rows: Sequence[ScanRow]) -> dict[str, float]:
    seconds = {(row.file, row.reader): row.processor_s for row in rows}
    ours = [file for file, reader in seconds if reader == "rgbn" and (file, "trimesh") in seconds]
    return {f"{file}: rgbn to trimesh, processor": seconds[file, "rgbn"] / seconds[file, "trimesh"] for file in ours}


TABLES = (
    Table("scans", "scans", ("align.scan.mended_scan",), ScanRow, _cases, _measured, _shown, _figures, is_timed=True),
)
