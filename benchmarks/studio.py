"""How soon the studio shows what is asked for, and faults of the report's page in a browser."""

import importlib.resources
import json
import os
import shutil
import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing, contextmanager
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.harness import ROOT, Figures, Scale, Table, markdown
from scene.camera import Camera
from scene.clock import now, since
from scene.frames import PEDESTAL, Frames
from scene.lights import Lights
from scene.normals import unit
from scene.pose import rotation_from_vector
from scene.store import Store
from studio.desk import Desk
from studio.editor import edits
from studio.editor.live_scene import LiveScene, refining
from studio.editor.placement import placement_of
from studio.editor.preview import HEIGHT, WIDTH
from studio.server import Studio
from studio.workspace import Workspace
from twin.description.description import TwinScene
from twin.description.materials import Diffuse, RoughPlastic
from twin.description.mesh_files import write_mesh
from twin.description.object_mesh import ObjectMesh, smooth

CHROMIUM = Path(
    os.environ.get("RGBN_CHROMIUM") or shutil.which("chromium") or shutil.which("google-chrome") or "/usr/bin/chromium"
)
WEBGL = ["--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
"""Drawn by software."""
SCREEN, PHONE = {"width": 1280, "height": 800}, {"width": 390, "height": 844}
GALLERY = ROOT / "out" / "gallery"
"""Where `make gallery` puts its output folders."""
COMPILING = 2
"""Rounds that are not counted."""


@contextmanager
def chromium() -> Iterator[Any]:
    """Yield playwright's browser."""
    from playwright.sync_api import sync_playwright

    with (
        sync_playwright() as playwright,
        closing(playwright.chromium.launch(executable_path=CHROMIUM, args=WEBGL)) as browser,
    ):
        yield browser


@dataclass(frozen=True)
class TimeRow:
    """The median time from asking for something until it is there."""

    what: str
    of: str
    wall_s: float
    processor_s: float | None


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


def _changes(scene: TwinScene) -> dict[str, Callable[[TwinScene, int], TwinScene]]:
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


def _latencies(faces: int, rounds: int) -> list[TimeRow]:
    """Time from a change to the first picture, and to the refined one; without rounds one change once."""
    scene, of = edits.added(edits.start_scene(), "ball", bumpy_ball(faces)), f"{faces:,} triangles"
    rows = []
    for name, change in list(_changes(scene).items())[: None if rounds else 1]:
        live, spent = LiveScene(), []
        for number in range(COMPILING + rounds if rounds else 1):
            changed = change(scene, number)
            fresh = replace(changed, objects=tuple(replace(one) for one in changed.objects))
            spent.append(_clocked(lambda it=fresh, on=live: on.picture(it, 0, width=WIDTH, height=HEIGHT)))
        rows.append(TimeRow(name, of, *np.median(spent[COMPILING if rounds else 0 :], axis=0).tolist()))
    if rounds:
        spent = [_clocked(lambda: list(refining(scene, 0, width=WIDTH, height=HEIGHT))) for _ in range(2)]
        rows.append(TimeRow("refined, once still", of, *spent[-1]))
    return rows


def _clocked(work: Callable[[], object]) -> tuple[float, float]:
    """Return wall and processor seconds."""
    start = now()
    work()
    taken = since(start)
    return taken["seconds"], taken["processor_seconds"]


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


def _pages(frames: int, width: int, faces: int, rounds: int) -> list[TimeRow]:
    """Time in the browser: from the address being asked for, or from a press, until what was asked for is in view."""
    spent: dict[str, list[float]] = {}
    with tempfile.TemporaryDirectory() as place, chromium() as browser:
        root, ball = Path(place), bumpy_ball(faces)
        _write_folder(root / "out", frames, width)
        write_mesh(root / "large.ply", ObjectMesh(ball.vertices, ball.faces))
        for _ in range(rounds):
            desk, name = Desk(area="Session", review=(root / "out", None)), "/photograph/picture"
            with closing(Studio(Workspace.at(root), port=0, desk=desk)) as studio:
                page = browser.new_page(viewport=SCREEN)
                start = page.evaluate(NOW)
                page.goto(studio.address)
                shown, at = page.evaluate(SEEN, [name, ""])
                spent.setdefault("a session opened", []).append(at - start)
                page.wait_for_timeout(3000)
                start = page.evaluate(NOW)
                page.get_by_role("slider").first.press("End")
                spent.setdefault("another frame of it", []).append(page.evaluate(SEEN, [name, shown])[1] - start)
                page.close()
            with closing(Studio(Workspace.at(root), port=0, desk=Desk(area="Scene"))) as studio:
                page = browser.new_page(viewport=SCREEN)
                page.goto(studio.address)
                button = page.get_by_role("button", name="Load model", exact=True)
                button.wait_for()
                before, _ = page.evaluate(SEEN, ["/object_0/mesh", ""])
                page.wait_for_timeout(4000)
                start = page.evaluate(NOW)
                button.click(force=True)
                after = page.evaluate(SEEN, ["/object_0/mesh", before])[1]
                spent.setdefault("a model loaded", []).append(after - start)
                page.close()
    of = f"{frames} frames of {width**2 / 1.5e6:.2g} MP, {faces:,} triangles"
    return [TimeRow(what, of, float(np.median(some)) / 1000, None) for what, some in spent.items()]


def _write_folder(folder: Path, count: int, width: int) -> None:
    """Write the output folder of a session that is checked and calibrated."""
    store, names = Store(folder), tuple(f"flash_{index:03d}" for index in range(count))
    store.path("frames").mkdir(parents=True)
    height = width * 2 // 3
    codes = np.lib.format.open_memmap(store.path("frames", "codes.npy"), "w+", np.uint16, (count, height, width, 3))
    rng = np.random.default_rng(24)
    for frame in codes:
        level = PEDESTAL + 20_000 * np.linspace(0.2, rng.uniform(0.5, 1), width)[None, :, None]
        frame[:] = level + rng.integers(0, 200, (height, 1, 3))
    codes.flush()
    store.save_frames_header(Frames(names, codes, np.ones(count), None, 1.0, True))
    camera = Camera(width, height, width * 4 / 3, width * 4 / 3, width / 2, height / 2)
    store.save_camera(camera)
    Store(store.path("frames")).save_camera(camera)
    directions = unit(np.column_stack([rng.uniform(-1, 1, (count, 2)), np.ones(count)]))
    store.save_lights(Lights(names, directions, np.ones((count, 3)), None, np.array([0.0, 0.0, -800.0])))


def _times(rows: Sequence[TimeRow]) -> str:
    columns = {rows[0].of: "{what}", "seconds": "{wall_s:.2f}"}
    return markdown(columns | ({} if rows[0].processor_s is None else {"processor, s": "{processor_s:.2f}"}), rows)


def _time_figures(rows: Sequence[TimeRow]) -> Figures:
    return {f"{row.what}: processor_s": row.processor_s for row in rows if row.processor_s is not None}


@dataclass(frozen=True)
class ReportRow:
    """One report in the browser, all of it unfolded: sums over two sizes of the screen, light and dark."""

    report: str
    photographs: int
    megabytes: float
    messages: int
    shifts: float
    axe_faults: int


SHIFTS = """new Promise((done) => { let sum = 0;
new PerformanceObserver((list) => list.getEntries().forEach((entry) => { sum += entry.value; }))
  .observe({ type: "layout-shift", buffered: true }); setTimeout(() => done(sum), 500); })"""


def _report(folder: str) -> list[ReportRow]:
    report, axe = Path(folder) / "report.html", importlib.resources.files("axe_playwright_python") / "axe.min.js"
    frames = (json.loads((Path(folder) / "summary.json").read_text()).get("capture") or {}).get("frames", 0)
    told, shifts, faults = [], 0.0, 0
    with chromium() as browser:
        for size, scheme in product((SCREEN, PHONE), ("light", "dark")):
            page = browser.new_page(viewport=size, color_scheme=scheme, reduced_motion="reduce")
            page.on("console", lambda message: told.append(message.text))
            page.on("pageerror", lambda error: told.append(str(error)))
            page.goto(report.as_uri())
            shifts += page.evaluate(SHIFTS)
            page.evaluate("document.querySelectorAll('details').forEach((fold) => { fold.open = true; })")
            page.evaluate(axe.read_text("utf-8"))
            faults += page.evaluate("axe.run().then((told) => told.violations.length)")
            page.close()
    return [ReportRow(Path(folder).name, frames, report.stat().st_size / 1e6, len(told), shifts, faults)]


def _report_cases(scale: Scale) -> list[tuple]:
    folders = [str(path.parent) for path in sorted(GALLERY.glob("*/report.html"))]
    return [] if scale == "gates" else [(folder,) for folder in folders[: 1 if scale == "small" else None]]


REPORT = {
    "report": "{report}", "photographs": "{photographs}", "MB": "{megabytes:.1f}", "console messages": "{messages}",
    "layout shifts": "{shifts:g}", "axe-core's faults": "{axe_faults}",
}  # fmt: skip
PAGES: dict[Scale, list[tuple]] = {"small": [(2, 600, 2_000, 1)], "gates": [], "full": [(24, 6000, 1_000_000, 5)]}

TABLES = (
    Table(
        "studio", "latency", ("studio.editor.live_scene", "studio.editor.edits"), TimeRow,
        lambda scale: [(2_000, 0) if scale == "small" else (100_000, 8)], _latencies, _times, _time_figures,
        is_timed=True,
    ),
    Table(
        "studio", "page", ("studio.server",), TimeRow, PAGES.__getitem__, _pages, _times, needs=(CHROMIUM,),
        is_timed=True,
    ),
    Table(
        "studio", "report", ("compare.report.report",), ReportRow, _report_cases, _report,
        lambda rows: markdown(REPORT, rows), needs=(CHROMIUM, GALLERY), is_timed=True,
    ),
)  # fmt: skip
