"""How soon the studio's page shows a 24-megapixel session and a million triangles; into docs/evidence/studio.md.

    .venv/bin/python -m benchmarks.bench_studio_page [--write]

In headless Chromium, which draws by software: from the press, or from the address being asked for, until what was asked
for is in the view with its picture. The session has 24 frames of 6000 x 4000 px; its files were written just before, as
by a run that has just ended. Medians of five.
"""

import argparse
import os
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.bench_studio import LARGE, bumpy_ball
from benchmarks.chromium import SCREEN, chromium
from benchmarks.pages import put
from scene.camera import Camera
from scene.frames import PEDESTAL, Frames
from scene.lights import Lights
from scene.normals import unit
from scene.store import Store
from studio.desk import Desk
from studio.server import Studio
from studio.workspace import Workspace
from twin.description.mesh_files import write_mesh
from twin.description.object_mesh import ObjectMesh

DOCS = Path(__file__).resolve().parents[1] / "docs" / "evidence"
WIDTH, HEIGHT, FRAMES, TIMES = 6000, 4000, 24, 5
SEEN = """([name, before]) => new Promise(done => {
  function look() {
    let found = null;
    window.__viserMutable?.nodeRefFromName?.[name]?.traverse?.(one => {
      const key = one.material?.map?.image ? one.uuid : `${one.geometry?.attributes.position?.count}`;
      if (one.isMesh && key !== before && (one.material.map?.image || name !== "/photograph/picture")) found = key;
    });
    found ? requestAnimationFrame(() => done([found, performance.timeOrigin + performance.now()]))
          : requestAnimationFrame(look);
  }
  look();
})"""
"""Waits until something else than before is in the view under a name; returns which, and when, ms."""
NOW = "() => performance.timeOrigin + performance.now()"


def write_folder(folder: Path) -> None:
    """Write the output folder of a large session that is checked and calibrated."""
    store, names = Store(folder), tuple(f"flash_{index:03d}" for index in range(FRAMES))
    store.path("frames").mkdir(parents=True)
    shape = (FRAMES, HEIGHT, WIDTH, 3)
    codes = np.lib.format.open_memmap(store.path("frames", "codes.npy"), "w+", np.uint16, shape)
    rng = np.random.default_rng(24)
    for frame in codes:
        level = PEDESTAL + 20_000 * np.linspace(0.2, rng.uniform(0.5, 1), WIDTH)[None, :, None]
        frame[:] = level + rng.integers(0, 200, (HEIGHT, 1, 3))
    codes.flush()
    store.save_frames_header(Frames(names, codes, np.ones(FRAMES), None, 1.0, True))
    camera = Camera(WIDTH, HEIGHT, 8000.0, 8000.0, WIDTH / 2, HEIGHT / 2)
    store.save_camera(camera)
    Store(store.path("frames")).save_camera(camera)
    directions = unit(np.column_stack([rng.uniform(-1, 1, (FRAMES, 2)), np.ones(FRAMES)]))
    store.save_lights(Lights(names, directions, np.ones((FRAMES, 3)), None, np.array([0.0, 0.0, -800.0])))


def of_session(browser: Any, root: Path) -> dict[str, float]:
    """Return seconds until a session is open, and until another frame is shown."""
    write_folder(root / "out")
    studio = Studio(Workspace.at(root), port=0, desk=Desk(area="Session", review=(root / "out", None)))
    opened, changed, name = [], [], "/photograph/picture"
    try:
        for _ in range(TIMES):
            page = browser.new_page(viewport=SCREEN)
            start = page.evaluate(NOW)
            page.goto(studio.address)
            shown, at = page.evaluate(SEEN, [name, ""])
            opened.append(at - start)
            page.wait_for_timeout(3000)
            start = page.evaluate(NOW)
            page.get_by_role("slider").first.press("End")
            _, at = page.evaluate(SEEN, [name, shown])
            changed.append(at - start)
            page.close()
    finally:
        studio.close()
    seconds = {"a session of 24 frames of 24 MP opened": opened, "another frame of it shown": changed}
    return {what: float(np.median(values)) / 1000 for what, values in seconds.items()}


def of_model(browser: Any, root: Path) -> dict[str, float]:
    """Return seconds until a million triangles are in the view."""
    ball = bumpy_ball(LARGE)
    write_mesh(root / "large.ply", ObjectMesh(ball.vertices, ball.faces))
    studio = Studio(Workspace.at(root), port=0, desk=Desk(area="Scene"))
    seconds = []
    try:
        for _ in range(TIMES):
            page = browser.new_page(viewport=SCREEN)
            page.goto(studio.address)
            name = "/object_0/mesh"
            page.get_by_role("button", name="Load model", exact=True).wait_for()
            before, _ = page.evaluate(SEEN, [name, ""])
            page.wait_for_timeout(4000)
            start = page.evaluate(NOW)
            page.get_by_role("button", name="Load model", exact=True).click(force=True)
            seconds.append(page.evaluate(SEEN, [name, before])[1] - start)
            page.close()
            while studio.windows:
                time.sleep(0.1)
            # The next window is to begin anew.
            studio._left.clear()
    finally:
        studio.close()
    return {f"{LARGE:,} triangles in the view": float(np.median(seconds)) / 1000}


def main() -> None:
    """Print the table; with --write put it into docs/evidence/studio.md."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--write", action="store_true")
    write, rows = parser.parse_args().write, {}
    with chromium() as browser:
        for measure in (of_session, of_model):
            with tempfile.TemporaryDirectory() as folder:
                rows |= measure(browser, Path(folder))
    text = "| in headless Chromium | seconds |\n|---|---|\n"
    text += "".join(f"| {what} | {seconds:.2f} |\n" for what, seconds in rows.items())
    text += f"\nMeasured on {os.cpu_count()} cores by `benchmarks/bench_studio_page.py`; medians of {TIMES}.\n"
    print(text)
    if write:
        put(DOCS / "studio.md", "page", text)


if __name__ == "__main__":
    main()
