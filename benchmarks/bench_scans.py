"""Scans of millions of triangles: seconds and memory to read and mend, against others, into docs/evidence/scans.md.

    .venv/bin/python -m benchmarks.bench_scans [--write]

Each reader runs in a process of its own, three times; the quickest run counts. Memory is the process'
peak beyond what it held before. trimesh merges vertices and drops broken faces (process=True), Open3D only reads.
"""

import argparse
import os
import platform
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

from benchmarks.pages import put

ROOT = Path(__file__).resolve().parents[1]
ONE = """
import sys, time
who, path = sys.argv[1:]
import numpy, scipy.sparse.csgraph, scipy.spatial, trimesh
from pathlib import Path
from align.scan.mended_scan import load_scan
from scene.rays import import_open3d
open3d = import_open3d()
read = {
    "bytes": lambda: len(Path(path).read_bytes()),
    "rgbn": lambda: len(load_scan(Path(path), "mm").faces),
    "trimesh": lambda: len(trimesh.load(path, process=True, force="mesh").faces),
    "Open3D": lambda: len(open3d.io.read_triangle_mesh(path).triangles),
}[who]
# Not getrusage: its peak is inherited from the process that started this one.
peak = lambda: int(Path("/proc/self/status").read_text().split("VmHWM:")[1].split()[0]) / 1024
before, start = peak(), time.perf_counter()
read()
print(time.perf_counter() - start, peak() - before)
"""
READERS = ("rgbn", "trimesh", "Open3D")
HEAD = "ply\nformat {} 1.0\nelement vertex {}\nproperty float x\nproperty float y\nproperty float z\nelement face {}\n"
HEAD += "property list uchar int vertex_indices\nend_header\n"


def torus(around: int, across: int) -> tuple[np.ndarray, np.ndarray]:
    """Return vertices (V, 3) float32 and quads (Q, 4) of a bumpy ring: closed, without poles."""
    u, v = np.meshgrid(*(2 * np.pi * np.arange(n) / n for n in (around, across)), indexing="ij")
    radius = 25 * (1 + 0.05 * np.sin(17 * u) * np.cos(11 * v))
    radius += 0.05 * np.random.default_rng(0).standard_normal(u.shape)
    far = 60 + radius * np.cos(v)
    vertices = np.stack([far * np.cos(u), far * np.sin(u), radius * np.sin(v)], -1).reshape(-1, 3)
    i, j = np.meshgrid(np.arange(around), np.arange(across), indexing="ij")
    one, two = (i + 1) % around, (j + 1) % across
    quads = np.stack([i * across + j, one * across + j, one * across + two, i * across + two], -1)
    return vertices.astype(np.float32), quads.reshape(-1, 4)


def triangles(quads: np.ndarray) -> np.ndarray:
    return np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])


def binary_ply(path: Path, vertices: np.ndarray, *polygons: np.ndarray) -> None:
    body = b"".join(
        np.rec.fromarrays(
            [np.full(len(rows), rows.shape[1]), rows], dtype=[("n", "u1"), ("corners", "<i4", (rows.shape[1],))]
        ).tobytes()
        for rows in polygons
    )
    head = HEAD.format("binary_little_endian", len(vertices), sum(map(len, polygons)))
    path.write_bytes(head.encode() + vertices.tobytes() + body)


def files(folder: Path) -> dict[str, Path]:
    """Write the cases; return their files by name."""
    vertices, quads = torus(1000, 1000)
    faces = triangles(quads)
    generator = np.random.default_rng(1)
    turned = np.where(generator.random((len(faces), 1)) < 0.3, faces[:, ::-1], faces)
    hole = np.linalg.norm(vertices - vertices[5000], axis=1) < 6
    binary_ply(folder / "clean.ply", vertices, faces)
    binary_ply(folder / "turned.ply", vertices, turned)
    binary_ply(folder / "hole.ply", vertices, faces[~hole[faces].any(1)])
    binary_ply(folder / "mixed.ply", vertices, quads[::2], triangles(quads[1::2]))
    soup = np.zeros(len(faces), [("normal", "<f4", (3,)), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
    soup["corners"] = vertices[faces]
    (folder / "soup.stl").write_bytes(bytes(80) + np.uint32(len(faces)).tobytes() + soup.tobytes())
    with (folder / "text.ply").open("w") as out:
        out.write(HEAD.format("ascii", len(vertices), len(faces)))
        np.savetxt(out, vertices, "%.6f %.6f %.6f")
        np.savetxt(out, faces, "3 %d %d %d")
    with (folder / "text.obj").open("w") as out:
        np.savetxt(out, vertices, "v %.6f %.6f %.6f")
        np.savetxt(out, faces + 1, "f %d %d %d")
    vertices, quads = torus(1250, 1200)
    binary_ply(folder / "large.ply", vertices, triangles(quads))
    return {
        "PLY, clean": folder / "clean.ply",
        "PLY, 30 % of the faces turned": folder / "turned.ply",
        "PLY, a hole": folder / "hole.ply",
        "PLY, triangles and quads": folder / "mixed.ply",
        "PLY, ASCII": folder / "text.ply",
        "OBJ": folder / "text.obj",
        "STL, no shared vertices": folder / "soup.stl",
        "PLY, 3 million": folder / "large.ply",
    }


def measure(who: str, path: Path) -> tuple[float, float] | None:
    """Return seconds and MB of the quickest of three runs; None where the reader fails."""
    answers = []
    for _ in range(3):
        command = [sys.executable, "-c", ONE, who, str(path)]
        run = subprocess.run(command, capture_output=True, text=True, check=False, cwd=ROOT, timeout=300)
        if run.returncode:
            return None
        answers.append(tuple(map(float, run.stdout.split()[-2:])))
    return min(answers)


def main() -> None:
    """Measure, print, and with --write put the table into docs/evidence/scans.md."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--write", action="store_true", help="put the table into docs/evidence/scans.md")
    arguments = parser.parse_args()
    load = os.getloadavg()[0]
    lines = [
        "| 2 million triangles | bytes alone, s | " + " | ".join(f"{who}, s (MB)" for who in READERS) + " |",
        "|---|---|" + "---|" * len(READERS),
    ]
    with tempfile.TemporaryDirectory() as folder:
        for name, path in files(Path(folder)).items():
            floor = measure("bytes", path)
            cells = [measure(who, path) for who in READERS]
            shown = [f"{cell[0]:.1f} ({cell[1]:.0f})" if cell else "fails" for cell in cells]
            lines.append(f"| {name} | {floor[0]:.2f} | " + " | ".join(shown) + " |" if floor else f"| {name} |")
            print(lines[-1], flush=True)
    text = "\n".join(lines) + (
        f"\n\nMeasured by `benchmarks/bench_scans.py` on {os.cpu_count()} cores ({platform.machine()}; load at the "
        f"start {load:.1f}). rgbn mends all, trimesh merges, Open3D reads.\n"
    )
    print(text)
    if arguments.write:
        page = ROOT / "docs" / "evidence" / "scans.md"
        put(page, "scans", text)


if __name__ == "__main__":
    main()
