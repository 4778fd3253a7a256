"""Files of results/: by the libraries of other programs, to the last step of their codes."""

import json
from types import SimpleNamespace

import cv2
import numpy as np
import pytest
import tifffile
import trimesh
from PIL import Image

from capture.session.session_types import SphereSpec
from lab.options import Settings
from lab.results import pixel_size_mm, results
from scene.camera import Camera
from scene.estimate import Estimate
from scene.lights import Lights
from scene.normals import angular_error_deg
from scene.store import Store
from solve.surface.solved_surface import solved_surface

CAMERA = Camera(60, 50, 500.0, 500.0, 29.5, 24.5)
CENTER, RADIUS = np.array([0.0, 0.0, -1000.0]), 36.0
BALL = np.array([0.5, 0.4, 0.3])
INTENSITIES = np.array([[1.0, 1.0, 1.0], [0.8, 0.9, 1.1], [1.2, 1.1, 0.9]])


def sphere():
    """Return normals and points (H, W, 3) of a ball before the camera, NaN beside it."""
    _, rays = CAMERA.rays(CAMERA.grid())
    rays = rays / np.linalg.norm(rays, axis=-1, keepdims=True)
    along = rays @ CENTER
    square = along**2 - CENTER @ CENTER + (0.9 * RADIUS) ** 2
    seen = square > 0
    root = np.sqrt(np.where(seen, along**2 - CENTER @ CENTER + RADIUS**2, np.nan))
    points = (along - root)[..., None] * rays
    return (points - CENTER) / RADIUS, points


def made(tmp_path, *, normals="opengl", z_mm=-1000.0, done=None, ball=BALL, without=(), deep=(), reflectance=None):
    store, (true, points) = Store(tmp_path), sphere()
    mask, rng = np.isfinite(true[..., 0]), np.random.default_rng(0)
    albedo = np.where(mask[..., None], rng.uniform(0.1, 0.9, (50, 60, 3)), np.nan).astype(np.float32)
    sigma = np.where(mask, rng.uniform(0.1, 3, mask.shape), np.nan).astype(np.float32)
    store.save_camera(CAMERA)
    store.save_mask(mask)
    store.save_lights(Lights(("a", "b", "c"), np.eye(3), INTENSITIES, None, np.array([0, 0, z_mm]), white_value=ball))
    for name in ("ls", "iterative"):
        found = np.full(true.shape, np.nan) if name in without else true
        maps = {"sigma_deg": sigma, "z_mm": points[..., 2] if name in deep else None}
        store.save_estimate(Estimate(name, found.astype(np.float32), albedo, mask.astype(np.uint16), **maps))
    session = SimpleNamespace(spheres=(SphereSpec("white", reflectance=reflectance),))
    told = {"settings": Settings(normals=normals), "methods": ("ls", "iterative"), "done": done or {}}
    job = SimpleNamespace(store=store, session=session, **told)
    return store, results(job), true, points, albedo, sigma


def test_maps_are_read_by_others(tmp_path):
    store, said, true, _, albedo, sigma = made(tmp_path)
    known = np.isfinite(true[..., 0])
    read = tifffile.imread(store.path("results", "normals_ls.tif"))
    assert read.dtype == np.uint16
    assert (read[~known] == 0).all()
    assert angular_error_deg(read[known] / 65535 * 2 - 1, true[known]).max() < 0.003
    white = said.result["albedo_white"]["ls"]
    found = cv2.imread(str(store.path("results", "albedo_ls.tif")), cv2.IMREAD_UNCHANGED)[..., ::-1]
    np.testing.assert_allclose(found[known] / 65535 * white, (albedo / BALL)[known], atol=white / 65535)
    with Image.open(store.path("results", "sigma_ls.tif")) as picture:
        np.testing.assert_array_equal(np.asarray(picture), sigma)
        # 2 mm a pixel, 1000 mm before a lens of 500 px.
        assert picture.info["dpi"] == pytest.approx((12.7, 12.7))
    world = store.path("results", "sigma_ls.tfw").read_text().split()
    assert [float(number) for number in world] == [2, 0, 0, -2, 0, 0]
    with tifffile.TiffFile(store.path("results", "normals_ls.tif")) as file:
        told = json.loads(file.pages[0].description)
    assert told["axes"] == "x right, y up, z toward the camera"
    assert sorted(said.result["files"]) == sorted(
        path.relative_to(tmp_path).as_posix() for path in store.path("results").iterdir()
    )


@pytest.mark.parametrize("flash", [None, 1])
def test_albedo_is_in_colours_where_a_chart_or_the_camera_tells_them(tmp_path, flash):
    camera, light = np.array([[0.7, 0.25, 0.05], [0.2, 0.7, 0.1], [0.05, 0.25, 0.7]]), np.array([0.6, 1, 0.8])
    # The chart stood in a frame of other strength and colour; the ball gives back 0.9, and is a little yellow.
    strength = np.ones(3) if flash is None else INTENSITIES[flash]
    ball = 0.9 * camera @ [1, 1, 0.95] * light
    chart = {"source": "chart", "camera_to_srgb": np.linalg.inv(np.diag(strength * light) @ camera).tolist()}
    known = {**chart, "flash": flash, "delta_e_2000": {"median": 1.0, "worst": 2.0}}
    *_, albedo, _ = found = made(tmp_path, ball=ball, reflectance=0.9, done={"check": {"result": {"colour": known}}})
    mask, told = np.isfinite(albedo[..., 0]), json.loads((tmp_path / "results" / "colour.json").read_text())
    true = albedo[mask] @ np.linalg.inv(np.diag(light) @ camera).T / ([0.2126, 0.7152, 0.0722] @ np.array([1, 1, 0.95]))
    white = found[1].result["albedo_white"]["ls"]
    codes = tifffile.imread(tmp_path / "results" / "albedo_ls.tif")
    np.testing.assert_allclose(codes[mask] / 65535 * white, np.clip(true, 0, white), atol=white / 65535)
    assert told["one"] == "all light (the white ball: 0.9, as stated)"
    assert told["source"] == "chart"
    own = {"source": "camera", "camera_to_srgb": np.linalg.inv(camera / camera.sum(1, keepdims=True)).tolist()}
    made(tmp_path, ball=camera @ np.ones(3) * light, done={"check": {"result": {"colour": own}}})
    told = json.loads((tmp_path / "results" / "colour.json").read_text())
    assert np.array(told["camera_to_srgb"]) == pytest.approx(np.linalg.inv(np.diag(light) @ camera))


def test_the_surface_is_read_by_others(tmp_path):
    store, said, true, points, albedo, _ = made(tmp_path, done={"trust": {"result": {"recommended": "iterative"}}})
    known = np.isfinite(true[..., 0])
    assert said.result["surface"]["method"] == "iterative"
    ply = trimesh.load(store.path("results", "surface_iterative.ply"), process=False)
    shift = np.median(points[known][:, 2]) - np.median(ply.vertices[:, 2])
    # Integrated normals of a ball, to a fifth of a pixel of 2 mm.
    np.testing.assert_allclose(ply.vertices[:, 2] + shift, points[known][:, 2], atol=0.4)
    glb = trimesh.load(store.path("results", "surface_iterative.glb"), process=False).to_mesh()
    np.testing.assert_allclose(1000 * glb.vertices, ply.vertices, atol=1e-3)
    # Each vertex finds its own albedo in the picture, but for white and the curve.
    picture = np.asarray(glb.visual.material.baseColorTexture.convert("RGB")).astype(float)
    u, v = (glb.visual.uv * [1, -1] + [0, 1]).T * [[picture.shape[1]], [picture.shape[0]]]
    shown = picture[v.astype(int), u.astype(int)]
    order = np.argsort(albedo[known][:, 1])
    assert (np.diff(shown[order, 1]) >= 0).all()
    depth = tifffile.imread(store.path("results", "depth_iterative.tif"))
    np.testing.assert_allclose(depth[known], ply.vertices[:, 2], rtol=1e-6)


FOUND = {"iterative": {"real": {"median_deg": 9.0}}, "ls": {"real": {"median_deg": 2.0}}}
JUDGED = {"has_truth": True, "methods": FOUND, "level": {"best": "ls", "level": []}}


@pytest.mark.parametrize(
    ("told", "method"),
    [
        ({"trust": {"recommended": "ls"}}, "ls"),
        ({"trust": {"recommended": "iterative"}}, "iterative"),
        ({"compare": JUDGED}, "ls"),
        ({"compare": JUDGED, "trust": {"recommended": "iterative"}}, "ls"),
        ({"compare": JUDGED | {"tolerance": {"method": "iterative"}}}, "iterative"),
        ({"compare": {"has_truth": False, "methods": FOUND, "level": {"best": None}}}, "iterative"),
        ({}, "iterative"),
    ],
)
def test_the_surface_is_of_what_the_report_recommends_else_of_what_found_its_depth(tmp_path, told, method):
    done = {step: {"result": result} for step, result in told.items()}
    store, said, _, points, *_ = made(tmp_path, deep=("iterative",), done=done)
    assert said.result["surface"]["method"] == method
    assert store.path("results", f"surface_{method}.glb").exists()
    depth = tifffile.imread(store.path("results", "depth_iterative.tif"))
    np.testing.assert_array_equal(depth, points[..., 2].astype(np.float32))


def test_methods_that_found_no_normal_stop_nothing(tmp_path):
    """Where all is clipped there is no surface, and a report of that all the same."""
    assert made(tmp_path / "one", without=("ls",))[1].result["surface"]["method"] == "iterative"
    store, said, *_ = made(tmp_path / "none", without=("ls", "iterative"))
    assert said.result["surface"] is None
    assert said.warnings == ["no method found a normal: there is no surface."]
    assert not tifffile.imread(store.path("results", "normals_ls.tif")).any()


def test_green_is_down_where_it_is_asked_for(tmp_path):
    up, down = (made(tmp_path / axes, normals=axes)[0] for axes in ("opengl", "directx"))
    one, two = (tifffile.imread(store.path("results", "normals_ls.tif")).astype(int) for store in (up, down))
    known = one.any(-1)
    np.testing.assert_array_equal(one[..., [0, 2]], two[..., [0, 2]])
    assert np.abs(one[known][:, 1] + two[known][:, 1] - 65535).max() <= 1


def test_a_size_that_nothing_tells_is_not_written(tmp_path):
    store, said, *_ = made(tmp_path, z_mm=0.0, ball=None)
    assert said.result["pixel_mm"] is None
    assert said.warnings == []
    assert not list(store.path("results").glob("*.tfw"))
    with tifffile.TiffFile(store.path("results", "albedo_ls.tif")) as file:
        assert file.pages[0].tags["ResolutionUnit"].value == 1
    assert "its size is as arbitrary" in said.result["surface"]["scale"]
    store.save_camera(Camera.orthographic(60, 50))
    assert "a pixel was taken for a millimetre" in solved_surface(store, ("ls",), 10**6).scale
    # Of an orthographic camera a pixel counts as a millimetre where nothing is known.
    near = Lights(("a",), np.array([[0, 0, 1.0]]), np.ones((1, 3)), np.array([[0, 0, 500.0]]), np.array([0, 0, -9.0]))
    assert pixel_size_mm(CAMERA, near) == pytest.approx(9 / 500)
    assert pixel_size_mm(Camera.orthographic(60, 50, source="DiLiGenT layout"), near) is None
