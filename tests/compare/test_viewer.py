"""The report in a browser, by what a person does: look, point, click, wipe, relight, print; checked against numpy."""

import base64
import importlib.resources
import importlib.util
import json

import cv2
import numpy as np
import pytest
from scipy.ndimage import binary_fill_holes

from compare.report.facts import Material
from compare.report.layers import ViewerLayers
from compare.report.report import write_report
from formats.picture_files import srgb_from_linear
from scene.files import write_npy
from scene.normals import angular_error_deg

DESK, PHONE = {"width": 1280, "height": 800}, {"width": 390, "height": 844}
NORMAL_DEG = 0.4
"""Three components, each rounded by at most 1 / 255: sqrt(3) / 255 radians."""
SHIFTS = """new Promise((done) => { const found = [];
new PerformanceObserver((list) => list.getEntries().forEach((entry) => {
  found.push([entry.value, ...entry.sources.map(({node}) => node && (node.id || node.textContent))]); }))
  .observe({ type: "layout-shift", buffered: true }); setTimeout(() => done(found), 300); })"""
"""How far what moved on the screen by itself."""


expect = pytest.importorskip("playwright.sync_api").expect


@pytest.fixture(scope="module")
def shown(session):
    path = write_report(session.store, session.summary)
    return path, ViewerLayers.of(Material(session.store, session.summary), session.summary)


@pytest.fixture(scope="module")
def faults():
    return []


@pytest.fixture(autouse=True)
def silent(faults):
    """What the console says fails the test."""
    yield
    said, faults[:] = list(faults), []
    assert said == []


@pytest.fixture(scope="module")
def visit(chromium, shown, faults):
    """Open the report at a size."""
    pages = []

    def opened(viewport=DESK, **how):
        page = chromium.new_page(viewport=viewport, reduced_motion="reduce", **how)
        page.on("console", lambda message: faults.append(message.text))
        page.on("pageerror", lambda error: faults.append(str(error)))
        page.goto(shown[0].as_uri())
        pages.append(page)
        return page

    yield opened
    for page in pages:
        page.close()


def place_of(page, grid, u, v):
    """Return where a pixel of the photographs is shown, in the window."""
    box = page.locator("#viewer-canvas").bounding_box()
    width, height = grid.size
    scale = min(box["width"] / width, box["height"] / height)
    x = box["x"] + (box["width"] - width * scale) / 2 + ((u - grid.left) // grid.step + 0.5) * scale
    return x, box["y"] + (box["height"] - height * scale) / 2 + ((v - grid.top) // grid.step + 0.5) * scale


def pixels_inside(session, count):
    mask, error = session.store.load_mask(), session.store.read_array("compare", "error_real_ls.npy")
    rows, columns = np.nonzero(mask & np.isfinite(error))
    chosen = np.random.default_rng(8).choice(len(rows), count, replace=False)
    return [(int(columns[i]), int(rows[i])) for i in chosen]


@pytest.fixture(scope="module")
def desk(visit):
    return visit()


def ready(page):
    """Wait until the viewer shows a photograph."""
    page.locator("#viewer-canvas").scroll_into_view_if_needed()
    expect(page.locator("#viewer-frame-name")).not_to_be_empty()
    return page


@pytest.fixture
def viewer(desk):
    """The viewer on one page for all tests."""
    return ready(desk)


def test_photographs_keep_the_error_that_the_page_states(session, shown):
    """Of a frame that the statement was not measured on."""
    layers, scale = shown[1], shown[1].scales["photograph-real"]
    (layer,) = (one for one in layers.layers if (one.kind, one.side, one.name) == ("photograph", "real", "5"))
    coded = np.frombuffer(base64.b64decode(layer.uri.split(",")[1]), np.uint8)
    code = np.asarray(cv2.imdecode(coded, cv2.IMREAD_COLOR))[..., ::-1] / 255
    linear = np.where(code <= 0.04045, code / 12.92, ((code + 0.055) / 1.055) ** 2.4)
    exact = layers.grid.frame(session.store.load_frames(), 5) / scale["balance"] / scale["white"]
    off = np.abs(linear.mean(-1) - np.clip(exact, 0, 1).mean(-1))
    assert np.quantile(off, 0.95) == pytest.approx(scale["error_share"], rel=0.3)
    assert scale["error_share"] < 0.03


@pytest.mark.parametrize("viewport", [DESK, pytest.param(PHONE, marks=pytest.mark.full)])
@pytest.mark.parametrize("scheme", ["light", pytest.param("dark", marks=pytest.mark.full)])
def test_no_faults_no_shifts_no_overflow(visit, viewport, scheme):
    page = visit(viewport, color_scheme=scheme)
    page.wait_for_timeout(200)
    assert page.evaluate(SHIFTS) == []
    page.evaluate("document.querySelectorAll('details').forEach((fold) => { fold.open = true; })")
    assert page.evaluate("document.documentElement.scrollWidth") <= viewport["width"]
    if importlib.util.find_spec("axe_playwright_python") is None:
        pytest.skip("axe-playwright-python is not installed: make setup")
    page.evaluate((importlib.resources.files("axe_playwright_python") / "axe.min.js").read_text("utf-8"))
    found = page.evaluate("axe.run().then((told) => told.violations)")
    assert [(fault["id"], [node["html"] for node in fault["nodes"]]) for fault in found] == []


def test_the_first_screen_is_one_screen_and_the_rest_is_folded(visit):
    page = visit()
    assert page.evaluate("document.querySelector('.first').getBoundingClientRect().bottom") <= DESK["height"]
    assert page.locator(".tiles li").count() == 4
    assert not page.locator("#statistics table").first.is_visible()
    page.get_by_role("link", name="Statistics", exact=True).press("Enter")
    assert page.locator("#statistics table").first.is_visible()
    assert page.locator("nav").bounding_box()["y"] == 0, "the links stay in sight"
    page.evaluate("dispatchEvent(new Event('beforeprint'))")
    assert page.locator(":is(#why, #warnings) details:not([open])").count() == 0
    page.evaluate("dispatchEvent(new Event('afterprint'))")
    assert page.locator("details:not([open])").count() > 5


def test_the_pointer_reads_what_numpy_has(viewer, session, shown):
    """A swapped axis, a shifted box or a wrong scale would show at one of these pixels."""
    store, grid = session.store, shown[1].grid
    viewer.locator("#viewer-left").select_option("error:real:ls")
    viewer.locator("#viewer-right").select_option("sigma:truth:truth")
    viewer.wait_for_timeout(150)
    maps = {place: store.read_array(place, "ls.npy") for place in ("normals", "albedo")}
    maps["error"] = store.read_array("compare", "error_real_ls.npy")
    end, spent = session.summary["compare"]["error_scale_deg"], []
    for u, v in pixels_inside(session, 12):
        viewer.mouse.move(*place_of(viewer, grid, u, v))
        values = viewer.locator("#viewer-values")
        assert values.get_attribute("data-pixel") == f"{u},{v}"
        row, truth = json.loads(values.get_attribute("data-values"))
        assert angular_error_deg(np.array(row["normal"]), maps["normals"][v, u].astype(float)) < NORMAL_DEG
        assert row["error"] == pytest.approx(min(maps["error"][v, u], end), abs=end / 254)
        np.testing.assert_allclose(row["albedo"], maps["albedo"][v, u], rtol=0.03, atol=0.01)
        assert truth["sigma"] == pytest.approx(0.4, abs=0.01)
        spent.append(float(values.get_attribute("data-ms")))
    assert np.median(spent) < 16


def test_a_click_shows_the_samples_and_each_methods_fit(viewer, session, shown):
    store, grid, layers = session.store, shown[1].grid, shown[1]
    frames, lights, camera = store.load_frames(), store.load_lights(), store.load_camera()
    told, exposure = viewer.locator("#viewer-samples"), layers.scales["photograph-real"]
    for u, v in pixels_inside(session, 3):
        viewer.mouse.click(*place_of(viewer, grid, u, v))
        expect(viewer.locator("#viewer-samples")).to_have_attribute("data-pixel", f"{u},{v}")
        rows = json.loads(told.get_attribute("data-values"))
        assert told.locator("circle").count() == len(frames)
        linear = np.stack(
            [frames.read(slice(v, v + 1), [k], columns=slice(u, u + 1))[0, 0, 0] for k in range(len(frames))]
        )
        seen = (linear / lights.intensities).mean(1)
        # JPEG's blocks at noise: the page states what 95 % of samples keep.
        off = np.array([row["sample"] for row in rows]) - seen
        assert np.median(np.abs(off)) < 3 * exposure["error_share"] * exposure["white"]
        toward = lights.toward(camera.points_at_depth([[u, v]], lights.reference_point_mm[2]))[:, 0]
        for name in ("ls", "iterative"):
            normal, albedo = (
                store.read_array(place, f"{name}.npy")[v, u].astype(float) for place in ("normals", "albedo")
            )
            fit = albedo.mean() * np.maximum(toward @ normal, 0)
            np.testing.assert_allclose([row["fits"][name] for row in rows], fit, rtol=0.04, atol=0.006)
    assert float(told.get_attribute("data-ms")) < 300


def colour_at(page, x, y):
    """Return what is on the screen."""
    shot = page.screenshot(clip={"x": x, "y": y, "width": 1, "height": 1})
    return cv2.imdecode(np.frombuffer(shot, np.uint8), cv2.IMREAD_COLOR)[0, 0, ::-1]


def test_the_wipe_shows_one_side_or_the_other_by_keyboard_too(viewer, session, shown):
    viewer.locator("#viewer-left").select_option("normals:real:ls")
    viewer.locator("#viewer-right").select_option("normals:truth:truth")
    u, v = max(
        pixels_inside(session, 60),
        key=lambda at: session.store.read_array("compare", "error_real_ls.npy")[at[1], at[0]],
    )
    colours = [
        np.round((session.store.read_array("normals", name)[v, u] + 1) * 127.5) for name in ("ls.npy", "truth.npy")
    ]
    place = place_of(viewer, shown[1].grid, u, v)
    wipe = viewer.locator("#viewer-wipe")
    for key, colour in (("End", colours[0]), ("Home", colours[1])):
        wipe.press(key)
        viewer.wait_for_timeout(150)
        np.testing.assert_allclose(colour_at(viewer, *place), colour, atol=1.1)
    assert np.abs(colours[0] - colours[1]).max() > 5, "the two sides can be told apart here"


def test_relit_by_a_known_light_is_the_rendering(viewer, session, shown):
    store, grid, layers = session.store, shown[1].grid, shown[1]
    lights, camera = store.load_lights(), store.load_camera()
    viewer.locator("#viewer-left").select_option("relit:real:ls")
    viewer.locator("#viewer-wipe").press("End")
    viewer.locator("#viewer-frame").focus()
    for light in (0, 7):
        viewer.locator("#viewer-frame").fill(str(light))
        viewer.locator("#viewer-as-light").click()
        viewer.wait_for_timeout(250)
        exposure = layers.scales["photograph-real"]
        for u, v in pixels_inside(session, 8):
            normal, albedo = (store.read_array(place, "ls.npy")[v, u].astype(float) for place in ("normals", "albedo"))
            toward = lights.toward(camera.points_at_depth([[u, v]], lights.reference_point_mm[2]))[light, 0]
            linear = (
                albedo * lights.intensities[light] * max(toward @ normal, 0) / exposure["white"] / exposure["balance"]
            )
            colour = colour_at(viewer, *place_of(viewer, grid, u, v))
            np.testing.assert_allclose(colour, 255 * srgb_from_linear(np.clip(linear, 0, 1)), atol=5)


def test_without_scripts_still_pictures_remain(chromium, shown):
    page = chromium.new_context(java_script_enabled=False).new_page()
    page.goto(shown[0].as_uri())
    assert page.locator("#viewer-still").is_visible()
    assert not page.locator("#instrument").is_visible()
    page.locator("#errors summary").click()
    assert page.locator("#errors img").first.is_visible()
    page.context.close()


def test_the_scene_is_drawn_in_3d(viewer):
    viewer.locator("#viewer-3d > summary").click()
    scene = viewer.locator("#viewer-scene")
    viewer.wait_for_selector("#viewer-scene[data-points]")
    # 12 lights, 3 balls and the camera; this folder's twin has no depth.
    assert float(scene.get_attribute("data-points")) == 16 * 41 * 80
    scene.scroll_into_view_if_needed()

    def orange():
        """Return the places of the lights' pixels on the screen."""
        picture = cv2.imdecode(np.frombuffer(scene.screenshot(), np.uint8), cv2.IMREAD_COLOR).astype(int)
        return np.argwhere((picture[..., 2] > picture[..., 0] + 60) & (picture[..., 1] > picture[..., 0] + 30))

    first = orange()
    assert len(first) > 300
    for key in ("+", "+", "ArrowRight"):
        scene.press(key)
    viewer.wait_for_timeout(200)
    assert len(orange()) != len(first)


def test_a_surface_in_3d_is_closed_and_no_larger_than_it_is_where_it_is_steep(chromium, copied):
    """Half a ball, seen from aside."""
    store, summary = copied
    store.path("spheres.json").unlink()
    camera, lights, mask = store.load_camera(), store.load_lights(), store.load_mask()
    (v, u), radius_px = np.indices(mask.shape), 0.45 * min(np.ptp(axis) for axis in np.nonzero(mask))
    middle = [np.mean(axis) for axis in np.nonzero(mask)]
    square = radius_px**2 - (v - middle[0]) ** 2 - (u - middle[1]) ** 2
    rise_mm = np.sqrt(np.where(square > 0, square, np.nan)) * 700 / camera.fx
    write_npy(store.path("twin", "truth_z_mm.npy"), (-700 + rise_mm).astype(np.float32))
    page = chromium.new_page(viewport=DESK)
    page.goto(write_report(store, summary).as_uri())
    page.locator("#viewer-3d > summary").click()
    page.wait_for_selector("#viewer-scene[data-points]")
    scene = page.locator("#viewer-scene")
    scene.scroll_into_view_if_needed()
    # From half a radian to a quarter turn, and nearly level.
    for key in ["ArrowRight"] * 11 + ["ArrowUp"] * 3 + ["+"] * 3:
        scene.press(key)
    page.wait_for_timeout(200)
    picture = cv2.imdecode(np.frombuffer(scene.screenshot(), np.uint8), cv2.IMREAD_COLOR).astype(int)
    page.close()
    blue, _, red = picture.transpose(2, 0, 1)
    shown = (red >= blue + 5) & (blue > 50)
    reach_mm = np.linalg.norm(lights.positions_mm - lights.reference_point_mm, axis=1).max()
    px_mm = 1.7 * 1.2**3 / reach_mm * min(shown.shape) / 2
    tall, wide = (np.ptp(axis) + 1 for axis in np.nonzero(shown))
    radius = radius_px * 700 / camera.fx * px_mm
    assert tall == pytest.approx(2 * radius, rel=0.05)
    assert wide == pytest.approx(radius, rel=0.1)
    assert (binary_fill_holes(shown) & ~shown).sum() < 0.002 * shown.sum()


def test_wheel_and_keys_move_what_is_read(visit, session, shown):
    viewer = ready(visit())
    (u, v), = pixels_inside(session, 1)  # fmt: skip
    place = place_of(viewer, shown[1].grid, u, v)
    viewer.mouse.move(*place)
    values = viewer.locator("#viewer-values")
    for _ in range(5):
        viewer.mouse.wheel(0, -300)
    viewer.wait_for_timeout(150)
    viewer.mouse.move(place[0] + 1, place[1])
    assert values.get_attribute("data-pixel") == f"{u},{v}", "what lies under the pointer stays there"
    viewer.locator("#viewer-canvas").press("ArrowRight")
    assert values.get_attribute("data-pixel") == f"{u + 1},{v}"
    viewer.locator("#viewer-canvas").press("Enter")
    expect(viewer.locator("#viewer-samples")).to_have_attribute("data-pixel", f"{u + 1},{v}")
