"""How soon the studio's preview shows a change, and how soon a large scan is open; into docs/evidence/studio.md.

    .venv/bin/python -m benchmarks.bench_studio [latency] [opening] [--write] [--faces 100000]

A bumpy ball of so many triangles before a camera of 640 x 480, previewed at 320 x 240. Each kind of change is made
eight times, to other values, after two that compile; the median of the times from the change to the first picture.
"""

import argparse
import os
import tempfile
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from benchmarks.pages import put
from scene.pose import rotation_from_vector
from studio.display_mesh import display_mesh
from studio.editor import edits
from studio.editor.live_scene import LiveScene, refining
from studio.editor.placement import placement_of
from studio.editor.preview import HEIGHT, WIDTH
from twin.description.description import TwinScene
from twin.description.materials import Diffuse, RoughPlastic
from twin.description.mesh_files import read_mesh, write_mesh
from twin.description.object_mesh import ObjectMesh, smooth

DOCS = Path(__file__).resolve().parents[1] / "docs" / "evidence"
COMPILED, TIMED = 2, 8
LARGE = 1_000_000


def bumpy_ball(faces: int) -> ObjectMesh:
    """Return a closed mesh of about so many triangles, 120 mm across, with waves of 3 mm."""
    down = round(np.sqrt(faces / 4))
    t, s = np.meshgrid(np.linspace(0, np.pi, down + 1), np.linspace(0, 2 * np.pi, 2 * down + 1), indexing="ij")
    radius = 60 + 3 * np.sin(9 * s) * np.sin(t) ** 2 * np.sin(11 * t)
    points = radius[..., None] * np.stack([np.sin(t) * np.cos(s), np.cos(t), -np.sin(t) * np.sin(s)], -1)
    corner = np.arange(t.size).reshape(t.shape)
    a, b, c, d = (part.ravel() for part in (corner[:-1, :-1], corner[1:, :-1], corner[1:, 1:], corner[:-1, 1:]))
    triangles = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])
    return smooth(points.reshape(-1, 3), triangles, None, None)


def changes(scene: TwinScene) -> dict[str, Callable[[TwinScene, int], TwinScene]]:
    """Return by name what is changed: the scene, and the number of the change, to the next scene."""
    middle, reference = placement_of(scene.objects[0]).middle_mm, scene.lights.reference_point_mm
    glossy = edits.with_material(scene, "matte", RoughPlastic((0.5, 0.4, 0.3)))
    return {
        "a light moved": lambda s, k: edits.moved_light(s, 0, reference + [100, 20 * k, 200]),
        "a colour": lambda s, k: edits.with_material(s, "matte", Diffuse((0.05 * k, 0.5, 0.3))),
        "a gloss": lambda s, k: edits.with_material(glossy, "matte", RoughPlastic((0.5, 0.4, 0.3), 0.1 + 0.05 * k)),
        "the object moved": lambda s, k: edits.turned(s, 0, middle + [k, 0, 0], np.eye(3)),
        "the object turned": lambda s, k: edits.turned(s, 0, middle, rotation_from_vector(np.array([0, 0.1 * k, 0]))),
        "the camera": lambda s, k: edits.with_camera(s, width=640, height=480, focal_px=1500.0 + k, orthographic=False),
    }


def clocked(work: Callable[[], object]) -> tuple[float, float]:
    """Return wall and processor seconds."""
    wall, processor = time.perf_counter(), time.process_time()
    work()
    return time.perf_counter() - wall, time.process_time() - processor


def latencies(faces: int) -> list[tuple[str, float, float]]:
    """Return (change, median wall s, median processor s)."""
    scene = edits.added(edits.start_scene(), "ball", bumpy_ball(faces))
    rows, all_walls = [], []
    for name, change in changes(scene).items():
        live, seconds = LiveScene(), []
        for number in range(COMPILED + TIMED):
            changed = change(scene, number)
            fresh = replace(changed, objects=tuple(replace(one) for one in changed.objects))
            seconds.append(clocked(lambda now=fresh, on=live: on.picture(now, 0, width=WIDTH, height=HEIGHT)))
        timed = np.array(seconds[COMPILED:])
        rows.append((name, *np.median(timed, axis=0).tolist()))
        all_walls += timed.tolist()
    rows.append(("any of these", *np.median(all_walls, axis=0).tolist()))
    refined = lambda: list(refining(scene, 0, width=WIDTH, height=HEIGHT))  # noqa: E731
    refined()
    rows.append(("refined, once still", *clocked(refined)))
    return rows


def opening(faces: int) -> list[tuple[str, float, float]]:
    """Return what opening a scan of so many triangles takes, step by step; medians of `TIMED`."""
    seconds: dict[str, list[tuple[float, float]]] = {}
    with tempfile.TemporaryDirectory() as folder:
        path, ball = Path(folder) / "large.ply", bumpy_ball(faces)
        write_mesh(path, ObjectMesh(ball.vertices, ball.faces))
        for _ in range(TIMED):
            live, made = LiveScene(), list[ObjectMesh]()
            live.picture(edits.start_scene(), 0, width=WIDTH, height=HEIGHT)

            def picture(mesh: ObjectMesh, on: LiveScene = live) -> object:
                return on.picture(edits.added(edits.start_scene(), "it", mesh), 0, width=WIDTH, height=HEIGHT)

            steps = {
                "read": lambda into=made: into.append(read_mesh(path)),
                "made small": lambda of=made: display_mesh(of[0]),
                "first picture": lambda of=made, draw=picture: draw(of[0]),
            }
            for name, step in steps.items():
                seconds.setdefault(name, []).append(clocked(step))
    rows = [(name, *np.median(each, axis=0).tolist()) for name, each in seconds.items()]
    return [*rows, ("a scan opened", *np.sum([row[1:] for row in rows], axis=0).tolist())]


def main() -> None:
    """Print the tables; with --write put them into docs/evidence/studio.md."""
    parser = argparse.ArgumentParser()
    parser.add_argument("tables", nargs="*", choices=["latency", "opening"], default=["latency", "opening"])
    parser.add_argument("--write", action="store_true")
    parser.add_argument("--faces", type=int, default=100_000)
    arguments = parser.parse_args()
    for name in arguments.tables:
        busy, faces = os.getloadavg()[0], arguments.faces if name == "latency" else LARGE
        text = f"| {faces:,} triangles | seconds | processor seconds |\n|---|---|---|\n"
        for row, wall, processor in latencies(faces) if name == "latency" else opening(faces):
            text += f"| {row} | {wall:.2f} | {processor:.2f} |\n"
        text += (
            f"\nMeasured on {os.cpu_count()} cores by `benchmarks/bench_studio.py`; {busy:.1f} processes wanted them "
        )
        text += "at its start.\n"
        print(text)
        if arguments.write:
            put(DOCS / "studio.md", name, text)


if __name__ == "__main__":
    main()
