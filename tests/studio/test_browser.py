"""The studio in a real browser: from a model to a dataset, by clicks and drags."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from capture.session.session import load_session
from formats.meshes.scan_files import write_mesh
from formats.picture_files import read_picture
from scene.mesh import Mesh
from studio.editor import edits
from studio.editor.editor_window import begun
from studio.widgets import UNITS_PER_MM
from studio.workspace import Workspace
from tests.studio.conftest import small_document
from twin.description.object_mesh import built_in
from twin.engines.variant import SLOW, pick_variant

pytestmark = [pytest.mark.render, pytest.mark.slow, pytest.mark.full]


@pytest.fixture
def studio(tmp_path, run_studio):
    """A studio whose camera takes small pictures, with one model in its workspace."""
    root = tmp_path / "bench"
    cone = built_in("cone")
    root.mkdir()
    write_mesh(root / "cone.ply", Mesh(cone.vertices * [40, 40, 90], cone.faces, None, cone.texcoords))
    # Direct light alone: what is tested here is the way, not the renderer.
    engine = "mitsuba" if pick_variant()[0] == SLOW else "many"
    sampling = {"engine": engine, "samples": 16, "max_depth": 2}
    quick = small_document(camera={"width": 96, "height": 72, "fx": 240.0}, sampling=sampling)
    return run_studio(root, area="Scene", edits={"Scene": begun(Workspace.at(root), quick, None)})


def test_a_first_dataset(visit, studio, tmp_path):
    """Load, drag, choose lights, export, render: the files are what stock Mitsuba renders and rgbn reads."""
    visitor = visit(studio)
    window, root = visitor.window, visitor.window.workspace.root
    drawn = visitor.preview(lambda: visitor.send("Load model", root / "cone.ply"))
    assert [one.is_refined for one in drawn[-2:]] == [False, True], "a picture comes before the refined one"
    assert [one.name for one in window.scene.objects] == ["cone"]
    assert drawn[-1].picture.max() > 0.2
    visitor.shows("1 cone")
    visitor.see("refined")
    visitor.keep("loaded")

    # The gizmo's arrow along y, drawn upward: the object follows the hand, along y alone.
    was = edits.placement(window.document, 0)
    size = 1.5 * np.ptp(window.scene.objects[0].placed.vertices, axis=0).max() / 2
    grip = (was.middle_mm + [0, 0.8 * size, 0]) * UNITS_PER_MM
    start = visitor.on_screen(grip)
    end = start + [0, -40]
    visitor.drag(start, end)
    visitor.until(lambda: window.history.past[-1][0] == "drag object 0", "the gizmo was dragged")
    now = edits.placement(window.document, 0)
    moved = now.middle_mm - was.middle_mm
    np.testing.assert_allclose(moved[[0, 2]], 0, atol=1e-3)
    np.testing.assert_allclose(now.rotation, was.rotation, atol=1e-5)
    assert np.linalg.norm(visitor.on_screen(grip + moved * UNITS_PER_MM) - end) < 8
    assert moved[1] > 5

    # An arrow's knob, drawn aside: the light shines from where it was let go.
    visitor.frames(3)
    knob, start = free_knob(visitor)
    end = start + [12, 14]
    visitor.drag(start, end)
    visitor.until(lambda: window.history.past[-1][0] == f"drag light {knob}", "the light was dragged")
    middle = visitor.on_screen(window.scene.lights.reference_point_mm * UNITS_PER_MM)
    toward = visitor.on_screen(knob_place(window.scene, knob) * UNITS_PER_MM) - middle
    assert np.linalg.norm(window.scene.lights.directions[knob]) == pytest.approx(1)
    assert toward @ (end - middle) > 0.995 * np.linalg.norm(toward) * np.linalg.norm(end - middle)

    visitor.tab("Lights")
    visitor.press("Replace the lights")
    visitor.until(lambda: window.scene.lights.names[0] == "hemisphere_000", "the lights are a hemisphere")
    assert len(window.scene.lights) == 24
    visitor.see("hemisphere_000")
    visitor.keep("lights")

    visitor.tab("Dataset")
    visitor.press("Export for Mitsuba")
    visitor.see("Exported 24 lights")
    export = root / "scene" / "export"
    program = [Path(sys.executable).parent / "mitsuba", "-m", pick_variant()[0]]
    out = tmp_path / "stock.exr"
    light = window.scene.lights.names[5]
    subprocess.run(
        [*program, "-D", f"light={light}", "-D", "samples=64", "-o", out, export / "scene.xml"],
        check=True,
        capture_output=True,
    )
    visitor.press("Render dataset")
    visitor.see("Rendered into")
    visitor.button("Solve").wait_for()
    visitor.keep("rendered")
    session = load_session(root / "scene" / "dataset")
    assert [path.stem for path in session.flash] == list(window.scene.lights.names)
    stock, ours = read_picture(out, "linear"), read_picture(session.flash[5], "linear")
    lit = stock.mean(-1) > 0.05
    assert lit.mean() > 0.05
    assert np.median(np.abs(stock - ours)[lit] / stock[lit]) < 0.02, "stock Mitsuba renders the export alike"
    outside = [url for url in visitor.asked if studio.address.split("//")[1] not in url and not url.startswith("data:")]
    assert not outside, "nothing is fetched from elsewhere"


def knob_place(scene, index):
    """Return where the arrow of a distant light begins, mm."""
    spread = float(f"{1.1 * np.linalg.norm(np.ptp(scene.points, axis=0)):.2g}")
    return scene.lights.reference_point_mm + spread * scene.lights.directions[index]


def free_knob(visitor):
    """Return the light whose knob stands most by itself on the screen, and where, px."""
    scene, box = visitor.window.scene, visitor.page.locator("canvas").first.bounding_box()
    places = np.array([visitor.on_screen(knob_place(scene, k) * UNITS_PER_MM) for k in range(len(scene.lights))])
    apart = np.linalg.norm(places[:, None] - places, axis=-1) + np.diag(np.full(len(places), np.inf))
    middle = visitor.on_screen(scene.lights.reference_point_mm * UNITS_PER_MM)
    clear = np.minimum(apart.min(1), np.linalg.norm(places - middle, axis=1) / 3)
    low, high = np.array([box["x"] + 30, 300]), np.array([box["x"] + box["width"] - 30, box["height"] - 30])
    clear[((places < low) | (places > high)).any(1)] = -1
    return int(clear.argmax()), places[clear.argmax()]


def test_a_reload_keeps_the_scene_and_its_past(visit, studio):
    visitor = visit(studio)
    visitor.press("Add shape")
    visitor.until(lambda: visitor.window.history.past, "changed")
    visitor.tab("Camera")
    visitor.fill("width, px", 90)
    visitor.until(lambda: len(visitor.window.history.past) == 2, "changed again")
    history = visitor.window.history
    visitor.reload("Undo: camera width")
    assert visitor.window.history is history
